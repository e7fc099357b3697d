use super::*;
use crate::filter::tests::{view, wall};

/// Every pixel knows its class out of side² and nothing else.
fn classes(receivers: &Receivers, side: usize) -> Gathered {
    let mut gathered = Gathered::dark(receivers.samples.len());
    for (i, sum) in gathered.unshadowed.iter_mut().enumerate() {
        let (x, y) = (i % receivers.width % side, i / receivers.width % side);
        *sum = Vec3::new(1.0, (x + side * y) as f32, if x == 1 { 4.0 } else { 0.0 });
    }
    gathered
}

#[test]
fn a_plane_gets_the_mean_of_all_parts_up_to_its_borders() {
    for side in [2, 4] {
        let receivers = wall(side * 5 + 3, side * 4 + 1, |_| Vec3::Z);
        let mut gathered = classes(&receivers, side);
        join(&mut [&mut gathered], &receivers, &view(&receivers), side as u32);
        let mean = Vec3::new(1.0, 0.5 * (side * side - 1) as f32, 4.0 / side as f32);
        for (i, sum) in gathered.unshadowed.iter().enumerate() {
            assert!((*sum - mean).abs().max_element() < 1e-4, "pixel {i}: {sum} for {mean}");
        }
    }
}

#[test]
fn parts_stay_on_their_wall() {
    let receivers = wall(32, 16, |x| if x < 16 { Vec3::Z } else { Vec3::X });
    let mut gathered = Gathered::dark(32 * 16);
    gathered.unshadowed = (0..32 * 16).map(|i| Vec3::splat((i % 32 / 16) as f32)).collect();
    let before = gathered.unshadowed.clone();
    join(&mut [&mut gathered], &receivers, &view(&receivers), 4);
    assert_eq!(gathered.unshadowed, before);
}

#[test]
fn a_ratio_counts_as_much_as_its_part_of_the_light() {
    let receivers = wall(16, 16, |_| Vec3::Z);
    let mut gathered = Gathered::dark(256);
    // Half of the pixels know all of the light.
    gathered.unshadowed =
        (0..256).map(|i| if i % 2 == 0 { Vec3::splat(2.0) } else { Vec3::ZERO }).collect();
    join(&mut [&mut gathered], &receivers, &view(&receivers), 2);
    for (i, trust) in gathered.trust.iter().enumerate() {
        let expected = if i % 2 == 0 { 2.0 } else { 0.0 };
        assert!((trust - expected).abs() < 1e-5, "pixel {i}: {trust}");
    }
}

#[test]
fn small_pictures_and_no_surfaces_are_fine() {
    let mut receivers = wall(3, 2, |_| Vec3::Z);
    receivers.samples[4].surface = None;
    let mut gathered = classes(&receivers, 4);
    join(&mut [&mut gathered], &receivers, &view(&receivers), 4);
    assert!(gathered.unshadowed.iter().all(|sum| sum.is_finite()));
    assert_eq!(gathered.unshadowed[4], classes(&receivers, 4).unshadowed[4]);
    let nothing = Receivers { width: 0, height: 0, samples: Vec::new() };
    join(&mut [&mut Gathered::dark(0)], &nothing, &view(&receivers), 4);
}
