use super::*;

#[test]
fn sequence_is_uniform_in_every_dimension() {
    for dimension_pairs in 0..6 {
        let mut bins = [0u32; 64];
        for index in 0..4096 {
            let mut sequence = Sequence::new(7, index);
            (0..dimension_pairs).for_each(|_| {
                sequence.next_2d();
            });
            let [x, y] = sequence.next_2d();
            bins[(x * 8.0) as usize * 8 + (y * 8.0) as usize] += 1;
        }
        // A (0,2)-sequence puts exactly 64 of 4096 points into each of 64 elementary squares.
        assert!(bins.iter().all(|&n| n == 64), "{bins:?}");
    }
}

#[test]
fn dimensions_are_not_correlated() {
    let n = 4096;
    let mut sum = 0.0f64;
    for index in 0..n {
        let mut sequence = Sequence::new(3, index);
        let a = sequence.next_2d()[0];
        let b = sequence.next_2d()[0];
        sum += f64::from((a - 0.5) * (b - 0.5));
    }
    assert!((sum / f64::from(n)).abs() < 0.004, "{}", sum / f64::from(n));
}

#[test]
fn discrete_draws_in_proportion_and_never_a_zero() {
    let d = Discrete::new([0.0, 1.0, 0.0, 3.0, f32::NAN, -2.0]);
    let mut count = [0; 6];
    for i in 0..4000 {
        count[d.sample(i as f32 / 4000.0).expect("positive total")] += 1;
    }
    assert_eq!(count, [0, 1000, 0, 3000, 0, 0]);
    assert_eq!(d.sample(1.0), Some(3));
    assert!((d.pmf(3) - 0.75).abs() < 1e-6);
    assert_eq!(Discrete::new([0.0, 0.0]).sample(0.5), None);
    assert_eq!(Discrete::new([]).sample(0.5), None);
}

#[test]
fn thresholds_draw_what_sums_draw() {
    let key = |i: u32| unit_f32(hash_u32(i));
    let skewed = |i: u32| if i.is_multiple_of(3) { 0.0 } else { key(i).powi(20) * 1e9 };
    let tables: [Vec<f32>; 8] = [
        vec![0.0, 1.0, 0.0, 3.0, f32::NAN, -2.0, 0.0],
        vec![1.0, 1.0, 1.0],
        vec![1e-30, 1e30, 1e-30],
        vec![5e-45, 0.0],
        vec![0.0, 0.0],
        Vec::new(),
        (0..1000).map(key).collect(),
        (0..3000).map(skewed).collect(),
    ];
    for weights in tables {
        let discrete = Discrete::new(weights.iter().copied());
        let thresholds = discrete.thresholds();
        let check = |k: u32| {
            let index = thresholds.partition_point(|&t| t <= k << 8);
            let drawn = (index < thresholds.len()).then_some(index);
            assert_eq!(drawn, discrete.sample(k as f32 / 16_777_216.0), "{k}");
        };
        (0..20_000).for_each(|i| check(hash_u32(i) >> 8));
        // Where one entry ends and the next begins.
        for &t in &thresholds {
            let k = t >> 8;
            (k.saturating_sub(2)..=(k + 2).min((1 << 24) - 1)).for_each(check);
        }
    }
}

#[test]
fn warps_have_the_stated_means() {
    let n = Vec3::new(0.3, -0.8, 0.5).normalize();
    let (mut cosine, mut cone) = (0.0, Vec3::ZERO);
    for i in 0..4096 {
        let u = Sequence::new(1, i).next_2d();
        cosine += cosine_hemisphere(n, u).dot(n) / 4096.0;
        cone += uniform_cone(n, 0.5, u) / 4096.0;
        assert!((uniform_sphere(u).length() - 1.0).abs() < 1e-5);
    }
    assert!((cosine - 2.0 / 3.0).abs() < 2e-3, "{cosine}");
    assert!((cone - n * 0.75).length() < 2e-3, "{cone}");
}

#[test]
fn tangent_frame_is_orthonormal_everywhere() {
    for i in 0..1000 {
        let n = uniform_sphere(Sequence::new(5, i).next_2d());
        let (t, b) = tangent_frame(n);
        assert!(t.dot(n).abs() < 1e-5 && b.dot(n).abs() < 1e-5 && t.dot(b).abs() < 1e-5);
        assert!((t.cross(b) - n).length() < 1e-5);
    }
    assert!(tangent_frame(-Vec3::Z).0.is_finite());
}

#[test]
fn turns_are_sines_and_cosines() {
    for i in 0..=4096 {
        let turns = i as f32 / 4096.0;
        let (sin, cos) = sin_cos_turns(turns);
        let (true_sin, true_cos) = (f64::from(turns) * std::f64::consts::TAU).sin_cos();
        assert!((f64::from(sin) - true_sin).abs() < 2e-7, "{turns}: {sin}");
        assert!((f64::from(cos) - true_cos).abs() < 2e-7, "{turns}: {cos}");
    }
}
