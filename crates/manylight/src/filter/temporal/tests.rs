use super::*;
use crate::filter::atrous;
use crate::filter::tests::{PIXEL, shares, view, wall};
use manylight_scene::{Camera, Projection};

const CENTER: Vec2 = Vec2::splat(0.5);
const SIZE: [usize; 2] = [40, 30];
const COUNT: usize = SIZE[0] * SIZE[1];

fn settings(history: u32) -> FilterSettings {
    FilterSettings { history, ..FilterSettings::default() }
}

/// Shares of one frame, unlike those of another.
fn frame(index: u32, rays: u32, share: f32) -> Vec<f32> {
    shares(COUNT * (index as usize + 1), rays, share).split_off(COUNT * index as usize)
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len() as f32
}

/// A camera that looks along −z from above the middle of the wall, moved by pixels.
fn above(receivers: &Receivers, moved_px: Vec2) -> ViewFrame {
    let [w, h] = [receivers.width as f32, receivers.height as f32];
    let center = (Vec2::new(w, h) - 1.0) * 0.5 + moved_px;
    let camera = Camera {
        name: String::new(),
        // Rows of these walls grow along +y.
        position: Vec3::new(center.x * PIXEL, center.y * PIXEL, 5.0),
        forward: Vec3::NEG_Z,
        up: Vec3::NEG_Y,
        projection: Projection::Orthographic { half_height: 0.5 * PIXEL * h },
        size_px: None,
    };
    ViewFrame::new(&camera, receivers.width, receivers.height)
}

/// A wall as `above` sees it: +x of the picture is −x of the world.
fn seen_wall(moved_px: Vec2) -> (Receivers, ViewFrame) {
    let mut receivers = wall(SIZE[0], SIZE[1], |_| Vec3::Z);
    let view = above(&receivers, moved_px);
    for (i, sample) in receivers.samples.iter_mut().enumerate() {
        let pixel = Vec2::new((i % SIZE[0]) as f32, (i / SIZE[0]) as f32);
        let origin = view.ray(pixel + CENTER).origin;
        sample.surface.as_mut().expect("a wall").position = origin.with_z(0.0);
    }
    (receivers, view)
}

#[test]
fn projection_inverts_camera_rays() {
    for name in ["cornell", "atrium"] {
        let camera = manylight_scene::builtin(name).expect(name).camera;
        for projection in [camera.projection, Projection::Orthographic { half_height: 3.0 }] {
            let view = ViewFrame::new(&Camera { projection, ..camera.clone() }, 50, 40);
            for point in [Vec2::new(0.25, 39.5), Vec2::new(49.0, 0.0), Vec2::new(20.0, 11.5)] {
                let ray = view.ray(point);
                let found = view.project(ray.origin + ray.direction * 3.7).expect("before it");
                assert!(found.abs_diff_eq(point, 1e-3), "{name}: {found} for {point}");
                let behind = view.project(camera.position - camera.forward);
                let is_parallel = matches!(projection, Projection::Orthographic { .. });
                assert_eq!(behind.is_some(), is_parallel);
            }
        }
    }
}

#[test]
fn noise_falls_as_frames_add_up_and_the_mean_stays() {
    let (receivers, view) = seen_wall(Vec2::ZERO);
    for share in [0.5, 0.9, 0.02] {
        let mut history = History::default();
        for n in 0..24 {
            let ratio = frame(n, 4, share);
            let noisy = [Noisy { ratio: &ratio, trust: &[], frames: &[], rays: 4 }];
            let seen = accumulate(&noisy, &receivers, &view, CENTER, &mut history, &settings(16));
            let seen = &seen[0];
            let frames = (n + 1).min(16) as f32;
            assert!((mean(&seen.frames) - frames).abs() < 0.03 * frames, "{}", mean(&seen.frames));
            let off: Vec<f32> = seen.ratio.iter().map(|r| (r - share).powi(2)).collect();
            // Beyond the most frames, fading ones lower the variance a little further.
            let expected = share * (1.0 - share) / 4.0 / frames;
            let found = mean(&off);
            assert!(found < 1.15 * expected && found > 0.4 * expected, "{n}: {found} {expected}");
            let bias = (mean(&seen.ratio) - share).abs();
            assert!(bias < 4.0 * (expected / COUNT as f32).sqrt(), "{n}: {bias}");
        }
    }
}

#[test]
fn a_sharp_shadow_stays_sharp() {
    let (receivers, view) = seen_wall(Vec2::ZERO);
    let mut history = History::default();
    // Stripes one, two and many receivers wide, and a lone one.
    let is_lit = |i: usize| {
        let (x, y) = (i % SIZE[0], i / SIZE[0]);
        x < 10 || x == 14 || [20, 21].contains(&x) || (x, y) == (30, 15)
    };
    let ratio: Vec<f32> = (0..COUNT).map(|i| f32::from(u8::from(is_lit(i)))).collect();
    for _ in 0..20 {
        let noisy = [Noisy { ratio: &ratio, trust: &[], frames: &[], rays: 4 }];
        accumulate(&noisy, &receivers, &view, CENTER, &mut history, &settings(16));
    }
    let last = history.last.expect("frames");
    let worst = last.signals[0].ratio.iter().zip(&ratio).map(|(a, b)| (a - b).abs());
    assert!(worst.fold(0.0, f32::max) < 1e-3);
    assert!(last.signals[0].frames.iter().all(|&n| n > 15.9));
}

#[test]
fn history_follows_the_camera() {
    let mut history = History::default();
    // Stripes of eight receivers on the wall.
    let lit = |position: Vec3| {
        let stripe = ((position.x / PIXEL).round() / 8.0).floor();
        f32::from(u8::from(stripe % 2.0 == 0.0))
    };
    for step in 0..6 {
        let (receivers, view) = seen_wall(Vec2::new(-3.0, 2.0) * step as f32);
        let positions = receivers.samples.iter().map(|s| s.surface.expect("a wall").position);
        let ratio: Vec<f32> = positions.map(lit).collect();
        let noisy = [Noisy { ratio: &ratio, trust: &[], frames: &[], rays: 4 }];
        let seen = accumulate(&noisy, &receivers, &view, CENTER, &mut history, &settings(16));
        let (mut oldest, mut newest) = (0.0f32, f32::MAX);
        for (i, (found, expected)) in seen[0].ratio.iter().zip(&ratio).enumerate() {
            assert!((found - expected).abs() < 0.01, "step {step}, {i}: {found} {expected}");
            (oldest, newest) = (oldest.max(seen[0].frames[i]), newest.min(seen[0].frames[i]));
        }
        assert!((oldest - (step + 1) as f32).abs() < 0.01, "{oldest}");
        assert_eq!(newest, 1.0, "what comes into the picture has no history");
    }
}

#[test]
fn no_history_crosses_an_edge_of_depth_or_direction() {
    // The left half lies 2 m behind, or looks elsewhere.
    for change in [Vec3::new(0.0, 0.0, -2.0), Vec3::ZERO] {
        let mut history = History::default();
        let mut counts = Vec::new();
        for step in 0..2 {
            let (mut receivers, view) = seen_wall(Vec2::new(2.5, 0.0) * step as f32);
            // Held by the picture, not by the wall: what is behind comes out or is covered.
            for (_, sample) in receivers.samples.iter_mut().enumerate().filter(|(i, _)| i % 40 < 20)
            {
                let surface = sample.surface.as_mut().expect("a wall");
                surface.position += change;
                if change == Vec3::ZERO {
                    surface.ng = Vec3::new(0.0, 0.8, 0.6);
                }
            }
            let ratio: Vec<f32> = (0..COUNT).map(|i| if i % 40 < 20 { 0.0 } else { 1.0 }).collect();
            let noisy = [Noisy { ratio: &ratio, trust: &[], frames: &[], rays: 4 }];
            let seen = accumulate(&noisy, &receivers, &view, CENTER, &mut history, &settings(16));
            assert_eq!(seen[0].ratio, ratio, "step {step}");
            counts = seen[0].frames.clone();
        }
        // Two or three columns on one side of the edge were another surface, or outside.
        let fresh = counts[..40].iter().filter(|&&n| n == 1.0).count();
        assert!((4..=6).contains(&fresh), "{fresh}: {:?}", &counts[..40]);
    }
}

#[test]
fn a_light_that_goes_out_is_gone_after_six_frames() {
    let (receivers, view) = seen_wall(Vec2::ZERO);
    let mut history = History::default();
    let mut left = Vec::new();
    for n in 0..32 {
        let ratio = if n < 20 { frame(n, 4, 0.8) } else { vec![0.0; COUNT] };
        let noisy = [Noisy { ratio: &ratio, trust: &[], frames: &[], rays: 4 }];
        let seen = accumulate(&noisy, &receivers, &view, CENTER, &mut history, &settings(16));
        left.push(mean(&seen[0].ratio));
    }
    let left = &left[20..];
    assert!(left[0] < 0.12 && left[5] < 0.04 && left[11] < 0.02, "{left:?}");
}

#[test]
fn what_drew_little_counts_little_in_time_too() {
    let (receivers, view) = seen_wall(Vec2::ZERO);
    let mut history = History::default();
    for n in 0..8 {
        // Every other receiver fails to draw and says dark, the others in the next frame.
        let failed = |i: usize| (i % SIZE[0] + i / SIZE[0] + n) % 2 == 1;
        let ratio: Vec<f32> = (0..COUNT).map(|i| if failed(i) { 0.0 } else { 0.75 }).collect();
        let trust: Vec<f32> = (0..COUNT).map(|i| if failed(i) { 0.0 } else { 1.0 }).collect();
        let noisy = [Noisy { ratio: &ratio, trust: &trust, frames: &[], rays: 1 }];
        let seen = accumulate(&noisy, &receivers, &view, CENTER, &mut history, &settings(64));
        for (i, found) in seen[0].ratio.iter().enumerate().filter(|_| n > 0) {
            let draws = if failed(i) { n.div_ceil(2) } else { n / 2 + 1 } as f32;
            let failures = (n + 1) as f32 - draws;
            let expected = 0.75 * draws / (draws + LEAST_TRUST * failures);
            assert!((found - expected).abs() < 1e-3, "frame {n}: {found} for {expected}");
        }
    }
}

#[test]
fn the_filter_trusts_shares_of_many_frames() {
    // A small step is noise to one frame and a shadow to many.
    let receivers = wall(64, 16, |_| Vec3::Z);
    let ratio: Vec<f32> = (0..64 * 16).map(|i| if i % 64 < 32 { 0.48 } else { 0.52 }).collect();
    let edge = |frames: &[f32]| {
        let noisy = [Noisy { ratio: &ratio, trust: &[], frames, rays: 1 }];
        let smooth = atrous(&noisy, &receivers, &view(&receivers), &FilterSettings::default());
        smooth[0][8 * 64 + 34] - smooth[0][8 * 64 + 29]
    };
    let (one, many) = (edge(&[]), edge(&vec![1000.0; 64 * 16]));
    assert!(one < 0.02 && many > 0.03, "{one} and {many}");
    assert_eq!(one, edge(&vec![1.0; 64 * 16]));
}

#[test]
fn what_is_no_number_is_forgotten() {
    let (receivers, view) = seen_wall(Vec2::ZERO);
    let mut history = History::default();
    for n in 0..3 {
        let mut ratio = vec![0.5; COUNT];
        if n == 1 {
            (ratio[500], ratio[700]) = (f32::NAN, f32::INFINITY);
        }
        let noisy = [Noisy { ratio: &ratio, trust: &[], frames: &[], rays: 4 }];
        let seen = accumulate(&noisy, &receivers, &view, CENTER, &mut history, &settings(16));
        let odd = seen[0].ratio.iter().filter(|r| (*r - 0.5).abs() > 1e-5 || r.is_nan()).count();
        assert_eq!(odd, if n == 1 { 2 } else { 0 }, "frame {n}");
    }
}

#[test]
fn other_sizes_signals_and_cuts_start_anew() {
    let (receivers, seen_from) = seen_wall(Vec2::ZERO);
    let mut history = History::default();
    let ratio = vec![0.5; COUNT];
    let one = Noisy { ratio: &ratio, trust: &[], frames: &[], rays: 4 };
    let frames = |noisy: &[Noisy<'_>], history: &mut History| {
        let seen = accumulate(noisy, &receivers, &seen_from, CENTER, history, &settings(16));
        seen.iter().map(|signal| signal.frames[55]).fold(0.0, f32::max)
    };
    assert_eq!(frames(&[one], &mut history), 1.0);
    assert!(frames(&[one], &mut history) > 1.99);
    assert_eq!(frames(&[one, one], &mut history), 1.0);
    assert_eq!(frames(&[Noisy { rays: 2, ..one }, one], &mut history), 1.0);
    assert_eq!(frames(&[], &mut history), 0.0);
    assert_eq!(frames(&[one], &mut history), 1.0);
    history.clear();
    assert_eq!(frames(&[one], &mut history), 1.0);
    let small = wall(3, 2, |_| Vec3::Z);
    let noisy = [Noisy { ratio: &ratio[..6], ..one }];
    let seen = accumulate(&noisy, &small, &view(&small), CENTER, &mut history, &settings(16));
    assert_eq!(seen[0].frames, [1.0; 6]);
}
