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
    let smooth = atrous(&noisy, &receivers, &FilterSettings::default());
    let mean = |v: &[f32]| v.iter().sum::<f32>() / v.len() as f32;
    let variance = |v: &[f32]| v.iter().map(|x| (x - mean(v)).powi(2)).sum::<f32>() / 4096.0;
    assert!((mean(&smooth) - mean(&noisy)).abs() < 0.02);
    assert!(variance(&smooth) < variance(&noisy) / 40.0, "{}", variance(&smooth));
}

#[test]
fn an_edge_between_walls_is_kept() {
    let receivers = wall(64, 16, |x| if x < 32 { Vec3::Z } else { Vec3::X });
    let step: Vec<f32> = (0..64 * 16).map(|i| if i % 64 < 32 { 0.0 } else { 1.0 }).collect();
    assert_eq!(atrous(&step, &receivers, &FilterSettings::default()), step);
}
