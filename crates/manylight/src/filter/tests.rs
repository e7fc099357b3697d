use super::*;
use crate::math::{hash_u32, unit_f32};
use crate::surface::PixelSample;
use glam::Vec3;

fn wall(width: usize, height: usize, normal: impl Fn(usize) -> Vec3) -> Receivers {
    let samples = (0..width * height).map(|i| {
        let (x, y) = (i % width, i / width);
        let surface = SurfacePoint {
            position: Vec3::new(x as f32 * 0.01, y as f32 * 0.01, 0.0),
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

#[test]
fn noise_on_one_plane_shrinks_and_its_mean_stays() {
    let receivers = wall(64, 64, |_| Vec3::Z);
    let noisy: Vec<f32> =
        (0..64 * 64).map(|i| f32::from(u8::from(unit_f32(hash_u32(i)) < 0.5))).collect();
    let smooth = atrous(&noisy, 1, &receivers, &FilterSettings::default());
    let mean = |v: &[f32]| v.iter().sum::<f32>() / v.len() as f32;
    let variance = |v: &[f32]| v.iter().map(|x| (x - mean(v)).powi(2)).sum::<f32>() / 4096.0;
    assert!((mean(&smooth) - mean(&noisy)).abs() < 0.02);
    assert!(variance(&smooth) < variance(&noisy) / 40.0, "{}", variance(&smooth));
}

#[test]
fn an_edge_between_walls_is_kept() {
    let receivers = wall(64, 16, |x| if x < 32 { Vec3::Z } else { Vec3::X });
    let step: Vec<f32> = (0..64 * 16).map(|i| if i % 64 < 32 { 0.0 } else { 1.0 }).collect();
    assert_eq!(atrous(&step, 4, &receivers, &FilterSettings::default()), step);
}

#[test]
fn an_edge_of_shadow_on_one_plane_is_kept() {
    const RAYS: u32 = 4;
    let receivers = wall(64, 64, |_| Vec3::Z);
    // Hidden on the left, four fifths open on the right, by a few rays each.
    let ratio = |i: usize| {
        let seen = |ray: u32| unit_f32(hash_u32(i as u32 * RAYS + ray)) < 0.8;
        let open = (0..RAYS).filter(|&ray| seen(ray)).count();
        if i % 64 < 32 { 0.0 } else { open as f32 / RAYS as f32 }
    };
    let noisy: Vec<f32> = (0..64 * 64).map(ratio).collect();
    let smooth = atrous(&noisy, RAYS, &receivers, &FilterSettings::default());
    let mean = |x: usize| (0..64).map(|y| smooth[y * 64 + x]).sum::<f32>() / 64.0;
    assert!(mean(27) < 0.02 && mean(36) > 0.75, "{} and {}", mean(27), mean(36));
    let right = smooth.iter().enumerate().filter(|(i, _)| i % 64 >= 40).map(|(_, v)| v);
    let spread = right.map(|v| (v - 0.8).powi(2)).sum::<f32>() / (24.0 * 64.0);
    assert!(spread < 0.04 / 20.0, "{spread}");
}
