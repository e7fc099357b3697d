use super::*;
use crate::frame::Renderer;

#[test]
fn one_light_above_a_floor_by_hand() {
    let light = Vpl {
        position: Vec3::new(0.0, 2.0, 0.0),
        normal: Vec3::NEG_Y,
        intensity: Vec3::splat(8.0),
    };
    // d² = 4, both cosines 1.
    assert_eq!(irradiance(&light, Vec3::ZERO, Vec3::Y, 0.0), Vec3::splat(2.0));
    // d² = 8, both cosines 1/√2.
    let e = irradiance(&light, Vec3::new(2.0, 0.0, 0.0), Vec3::Y, 0.0);
    assert!((e - Vec3::splat(0.5)).length() < 1e-6);
    // Clamped at d_min = 4 m.
    assert_eq!(irradiance(&light, Vec3::ZERO, Vec3::Y, 16.0), Vec3::splat(0.5));
    // From behind, and where light and receiver coincide.
    assert_eq!(irradiance(&light, Vec3::ZERO, Vec3::NEG_Y, 0.0), Vec3::ZERO);
    assert_eq!(irradiance(&light, light.position, Vec3::Y, 0.0), Vec3::ZERO);
}

#[test]
fn light_paths_keep_the_flux_of_a_closed_scene() {
    // Furnace: emitted flux Φ; bounce b carries Φ/2^b, so I sums to Φ/π · (½ + ¼ + ⅛).
    let shot = manylight_scene::builtin("furnace").expect("furnace");
    let renderer = Renderer::new(shot.scene).expect("furnace");
    let flux = f64::from(renderer.emitters.surface.flux());
    let set = trace(&renderer.world, &renderer.emitters, 100_000, 3, 1, true);
    let sum = f64::from(crate::math::luminance(set.total_intensity()));
    let expected = flux / std::f64::consts::PI * 0.875;
    assert!((sum / expected - 1.0).abs() < 0.01, "{sum} {expected}");
    assert!(set.lights.len() >= 100_000 && set.lights.len() < 100_003);
    let on_emitters = trace_emitters(&renderer.world, &renderer.emitters, 1000, 1);
    let sum = f64::from(crate::math::luminance(on_emitters.total_intensity()));
    assert!((sum / (flux / std::f64::consts::PI) - 1.0).abs() < 0.01);
}

#[test]
fn a_path_does_not_depend_on_the_number_of_lights() {
    let shot = manylight_scene::builtin("cornell").expect("cornell");
    let renderer = Renderer::new(shot.scene).expect("cornell");
    let few = trace(&renderer.world, &renderer.emitters, 100, 3, 9, true);
    let many = trace(&renderer.world, &renderer.emitters, 5000, 3, 9, true);
    for (a, b) in few.lights.iter().zip(&many.lights) {
        assert_eq!((a.position, a.normal), (b.position, b.normal));
    }
}
