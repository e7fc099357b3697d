use super::*;
use manylight_scene::SkyMap;

#[test]
fn parallel_rays_cover_the_box() {
    let bounds = [Vec3::new(-1.0, 0.0, 2.0), Vec3::new(3.0, 5.0, 4.0)];
    let direction = Vec3::new(0.3, -0.8, 0.5).normalize();
    for i in 0..500 {
        let mut s = Sequence::new(1, i);
        let (p, area) = point_on_box(bounds, direction, s.next_1d(), s.next_2d());
        assert!((area / box_area_toward(bounds, direction) - 1.0).abs() < 1e-2);
        // A step along the ray enters the box, a step back leaves it.
        let inside = |q: Vec3| q.cmpgt(bounds[0] - 0.01).all() && q.cmplt(bounds[1] + 0.01).all();
        assert!(inside(p) && !inside(p - direction * 0.1));
    }
}

#[test]
fn spots_fade_from_the_inner_to_the_outer_cone() {
    assert_eq!(spot_fade(1.0, 0.5, 0.8), 1.0);
    assert_eq!(spot_fade(0.4, 0.5, 0.8), 0.0);
    assert!((spot_fade(0.65, 0.5, 0.8) - 0.25).abs() < 1e-5);
}

fn gradient_sky() -> SkyMap {
    let radiance = (0..16 * 8).map(|i| Vec3::splat((i % 16) as f32 + 0.1 * (i / 16) as f32));
    SkyMap { width: 16, height: 8, radiance: radiance.collect(), rotation_rad: 0.7 }
}

#[test]
fn sky_draws_match_their_density_and_radiance() {
    let sky = SkyEmitter::new(&Sky::Map(gradient_sky())).expect("bright");
    let (mut mean, mut n) = (0.0f64, 0);
    for i in 0..20_000 {
        let (direction, radiance, pdf_sa) = sky.sample(Sequence::new(4, i).next_2d());
        assert!((direction.length() - 1.0).abs() < 1e-4);
        // At a texel's edge rounding may name the neighbor.
        if radiance == sky.radiance(direction) {
            assert!((sky.pdf_sa(direction) / pdf_sa - 1.0).abs() < 1e-4);
            n += 1;
        }
        mean += f64::from(radiance.x / pdf_sa) / 20_000.0;
    }
    assert!(n > 19_900, "{n}");
    let expected = f64::from(sky.mean_radiance().x) * 4.0 * std::f64::consts::PI;
    assert!((mean / expected - 1.0).abs() < 0.01, "{mean} {expected}");
}

#[test]
fn a_point_light_falls_off_with_the_square() {
    let at = |d: f32| at_distance(Vec3::ZERO, Vec3::Y * d, |_| Vec3::ONE).map(|s| s.irradiance.x);
    assert_eq!((at(1.0), at(2.0)), (Some(1.0), Some(0.25)));
    assert_eq!(at(0.0), None);
}
