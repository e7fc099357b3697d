use super::*;
use crate::math::{hash_u32, unit_f32};
use crate::surface::{PixelSample, SurfacePoint};
use glam::Vec3;
use manylight_scene::{Camera, Projection};

/// Distance between receivers, metres.
pub(super) const PIXEL: f32 = 0.01;

pub(super) fn wall(width: usize, height: usize, normal: impl Fn(usize) -> Vec3) -> Receivers {
    let samples = (0..width * height).map(|i| {
        let (x, y) = (i % width, i / width);
        let surface = SurfacePoint {
            position: Vec3::new(x as f32 * PIXEL, y as f32 * PIXEL, 0.0),
            ng: normal(x),
            ns: normal(x),
            albedo: Vec3::ONE,
            emission: Vec3::ZERO,
            unlit: false,
        };
        PixelSample { surface: Some(surface), direction: Vec3::NEG_Z, depth: 5.0 }
    });
    Receivers { width, height, samples: samples.collect() }
}

pub(super) fn view(receivers: &Receivers) -> ViewFrame {
    let camera = Camera {
        name: String::new(),
        position: Vec3::new(0.0, 0.0, 5.0),
        forward: Vec3::NEG_Z,
        up: Vec3::Y,
        projection: Projection::Orthographic { half_height: 0.5 * PIXEL * receivers.height as f32 },
        size_px: None,
    };
    ViewFrame::new(&camera, receivers.width, receivers.height)
}

fn smoothed(ratio: &[f32], rays: u32, receivers: &Receivers) -> Vec<f32> {
    let noisy = [Noisy { ratio, trust: &[], frames: &[], rays }];
    atrous(&noisy, receivers, &view(receivers), &FilterSettings::default()).remove(0)
}

/// Shares of `rays` rays that a `share` of directions lets through.
pub(super) fn shares(count: usize, rays: u32, share: f32) -> Vec<f32> {
    let seen = |ray: u32| unit_f32(hash_u32(ray)) < share;
    let open = |i: u32| (0..rays).filter(|&ray| seen(i * rays + ray)).count();
    (0..count as u32).map(|i| open(i) as f32 / rays as f32).collect()
}

#[test]
fn noise_on_one_plane_shrinks_and_its_mean_stays() {
    let receivers = wall(64, 64, |_| Vec3::Z);
    let noisy = shares(64 * 64, 1, 0.5);
    let smooth = smoothed(&noisy, 1, &receivers);
    let mean = |v: &[f32]| v.iter().sum::<f32>() / v.len() as f32;
    let variance = |v: &[f32]| v.iter().map(|x| (x - mean(v)).powi(2)).sum::<f32>() / 4096.0;
    assert!((mean(&smooth) - mean(&noisy)).abs() < 0.02);
    assert!(variance(&smooth) < variance(&noisy) / 40.0, "{}", variance(&smooth));
}

#[test]
fn an_edge_between_walls_is_kept() {
    let receivers = wall(64, 16, |x| if x < 32 { Vec3::Z } else { Vec3::X });
    let step: Vec<f32> = (0..64 * 16).map(|i| if i % 64 < 32 { 0.0 } else { 1.0 }).collect();
    assert_eq!(smoothed(&step, 4, &receivers), step);
}

#[test]
fn an_edge_of_shadow_on_one_plane_is_kept() {
    const RAYS: u32 = 4;
    let receivers = wall(64, 64, |_| Vec3::Z);
    // Hidden on the left, four fifths open on the right, by a few rays each.
    let mut noisy = shares(64 * 64, RAYS, 0.8);
    noisy.iter_mut().enumerate().filter(|(i, _)| i % 64 < 32).for_each(|(_, ratio)| *ratio = 0.0);
    let smooth = smoothed(&noisy, RAYS, &receivers);
    let mean = |x: usize| (0..64).map(|y| smooth[y * 64 + x]).sum::<f32>() / 64.0;
    assert!(mean(27) < 0.02 && mean(36) > 0.75, "{} and {}", mean(27), mean(36));
    let right = smooth.iter().enumerate().filter(|(i, _)| i % 64 >= 40).map(|(_, v)| v);
    let spread = right.map(|v| (v - 0.8).powi(2)).sum::<f32>() / (24.0 * 64.0);
    assert!(spread < 0.04 / 20.0, "{spread}");
}

#[test]
fn parallel_walls_do_not_mix() {
    let mut receivers = wall(64, 16, |_| Vec3::Z);
    for (i, sample) in receivers.samples.iter_mut().enumerate().filter(|(i, _)| i % 64 < 32) {
        sample.surface.as_mut().expect("a wall").position.z = -2.0 + 0.001 * (i % 2) as f32;
    }
    // Noisy enough that the change itself stops nothing.
    let step: Vec<f32> = (0..64 * 16).map(|i| if i % 64 < 32 { 0.4 } else { 0.6 }).collect();
    let smooth = smoothed(&step, 1, &receivers);
    let worst = smooth.iter().zip(&step).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < 0.004, "{worst}");
}

#[test]
fn ratios_filtered_together_are_as_filtered_alone() {
    let receivers = wall(150, 40, |x| if x < 71 { Vec3::Z } else { Vec3::X });
    let (a, b) = (shares(150 * 40, 4, 0.7), shares(150 * 40, 2, 0.2));
    let noisy = [
        Noisy { ratio: &a, trust: &[], frames: &[], rays: 4 },
        Noisy { ratio: &b, trust: &[], frames: &[], rays: 2 },
    ];
    let settings = FilterSettings::default();
    let together = atrous(&noisy, &receivers, &view(&receivers), &settings);
    assert_eq!(together, [smoothed(&a, 4, &receivers), smoothed(&b, 2, &receivers)]);
}

#[test]
fn no_surface_keeps_its_ratio_and_gives_none_away() {
    let mut receivers = wall(64, 8, |_| Vec3::Z);
    let mut ratio = vec![0.25; 64 * 8];
    for i in (0..64 * 8).filter(|i| i % 64 < 5 || i % 7 == 0) {
        (receivers.samples[i].surface, receivers.samples[i].depth) = (None, f32::INFINITY);
        ratio[i] = 1.0;
    }
    let smooth = smoothed(&ratio, 1, &receivers);
    let worst = smooth.iter().zip(&ratio).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < 1e-6, "{worst}");
}

#[test]
fn a_picture_smaller_than_the_reach_is_filtered() {
    let settings = FilterSettings { passes: 8, ..FilterSettings::default() };
    for [width, height] in [[1, 1], [3, 2], [1, 200]] {
        let receivers = wall(width, height, |_| Vec3::Z);
        let ratio = vec![0.5; width * height];
        let noisy = [Noisy { ratio: &ratio, trust: &[], frames: &[], rays: 4 }];
        let smooth = atrous(&noisy, &receivers, &view(&receivers), &settings).remove(0);
        assert!(smooth.iter().all(|p| (p - 0.5).abs() < 1e-6) && smooth.len() == ratio.len());
    }
}

#[test]
fn a_far_orthographic_camera_leaves_planes_whole() {
    let mut receivers = wall(64, 64, |_| Vec3::Z);
    // Pixels of 0.01 mm, seen from 1 km: products with positions seen from there lose that much.
    let forward = -Vec3::new(0.5, 0.6, 0.7).normalize();
    let up = forward.any_orthonormal_vector();
    for (i, sample) in receivers.samples.iter_mut().enumerate() {
        let surface = sample.surface.as_mut().expect("a wall");
        let (x, y) = ((i % 64) as f32 * 1e-5, (i / 64) as f32 * 1e-5);
        surface.position = forward.cross(up) * x + up * y;
        (surface.ng, surface.ns, sample.depth) = (-forward, -forward, 1000.0);
    }
    let camera = Camera {
        name: String::new(),
        position: forward * -1000.0,
        forward,
        up,
        projection: Projection::Orthographic { half_height: 32e-5 },
        size_px: None,
    };
    let noisy = shares(64 * 64, 1, 0.5);
    let far = ViewFrame::new(&camera, 64, 64);
    let signals = [Noisy { ratio: &noisy, trust: &[], frames: &[], rays: 1 }];
    let smooth = atrous(&signals, &receivers, &far, &FilterSettings::default()).remove(0);
    let variance = smooth.iter().map(|p| (p - 0.5).powi(2)).sum::<f32>() / 4096.0;
    assert!(variance < 0.25 / 40.0, "{variance}");
}

#[test]
fn nothing_to_filter_gives_nothing_and_narrow_rows_take_their_own_room() {
    let receivers = wall(3, 2, |_| Vec3::Z);
    let settings = FilterSettings::default();
    assert!(atrous(&[], &receivers, &view(&receivers), &settings).is_empty());
    assert_eq!(Planes::new(1, 1000, 2).data.len(), 2000);
    assert!(Planes::new(1000, 1, 1).stride % 32 == 16);
}

#[test]
fn what_drew_little_counts_little() {
    let receivers = wall(64, 64, |_| Vec3::Z);
    // Every other receiver failed to draw and says dark.
    let failed = |i: usize| (i + i / 64) % 2 == 1;
    let ratio: Vec<f32> = (0..64 * 64).map(|i| if failed(i) { 0.0 } else { 0.75 }).collect();
    let trust: Vec<f32> = (0..64 * 64).map(|i| if failed(i) { 0.0 } else { 1.0 }).collect();
    let settings = FilterSettings::default();
    let middle = |trust: &[f32]| {
        let noisy = [Noisy { ratio: &ratio, trust, frames: &[], rays: 4 }];
        atrous(&noisy, &receivers, &view(&receivers), &settings).remove(0)[32 * 64 + 32]
    };
    assert!((middle(&trust) - 0.75).abs() < 0.05, "{}", middle(&trust));
    assert!((middle(&[]) - 0.375).abs() < 0.05, "{}", middle(&[]));
}
