use super::*;
use crate::math::luminance;

fn renderer(name: &str) -> (Renderer, Camera) {
    let shot = manylight_scene::builtin(name).expect(name);
    (Renderer::new(shot.scene).expect(name), shot.camera)
}

fn settings(method: Method) -> Settings {
    let mut s = Settings { method, ..Settings::default() };
    (s.vpls.count, s.vpls.emitter_count, s.path.spp) = (3000, 500, 16);
    s
}

fn render(renderer: &Renderer, camera: &Camera, size: [usize; 2], s: &Settings) -> Layers {
    renderer.render(camera, size, s, &|_, _| ()).expect("valid settings").layers
}

fn energy(layer: &[Vec3]) -> f64 {
    layer.iter().map(|&c| f64::from(luminance(c))).sum::<f64>() / layer.len() as f64
}

#[test]
fn radiance_in_the_furnace_is_one() {
    // Albedo ½ and emission ½: L = ½ + ½·L, so L = 1; n bounces leave 1 − 2^−(n+2).
    let (renderer, camera) = renderer("furnace");
    let mut s = settings(Method::Path);
    (s.path.spp, s.vpls.bounces) = (64, 12);
    let layers = render(&renderer, &camera, [24, 24], &s);
    let mean = energy(&layers.beauty());
    assert!((mean - 1.0).abs() < 0.005, "{mean}");
    let direct = energy(&layers.direct);
    assert!((direct - 0.25).abs() < 0.004, "{direct}");
}

#[test]
fn virtual_lights_fill_the_furnace_too() {
    let (renderer, camera) = renderer("furnace");
    for method in [Method::Brute, Method::Grid] {
        let mut s = settings(method);
        (s.vpls.count, s.vpls.emitter_count) = (20_000, 20_000);
        (s.vpls.bounces, s.vpls.d_min) = (12, Some(0.01));
        s.grid.alpha = Some(3.0);
        let mean = energy(&render(&renderer, &camera, [8, 8], &s).beauty());
        assert!((mean - 1.0).abs() < 0.03, "{method:?} {mean}");
    }
}

#[test]
fn brute_force_agrees_with_the_path_tracer() {
    let (renderer, camera) = renderer("cornell");
    let mut path = settings(Method::Path);
    path.path.spp = 256;
    let mut brute = settings(Method::Brute);
    brute.vpls.d_min = Some(0.005);
    // Samples over the pixel, as the path tracer takes them.
    brute.film.samples = 16;
    (brute.vpls.count, brute.vpls.emitter_count) = (2000, 500);
    let path = render(&renderer, &camera, [24, 24], &path);
    let brute = render(&renderer, &camera, [24, 24], &brute);
    for (name, a, b) in
        [("direct", &brute.direct, &path.direct), ("indirect", &brute.indirect, &path.indirect)]
    {
        let bias = energy(a) / energy(b) - 1.0;
        assert!(bias.abs() < 0.03, "{name} {bias}");
    }
}

#[test]
fn the_grid_agrees_with_brute_force() {
    for name in ["cornell", "many_lamps"] {
        let (renderer, camera) = renderer(name);
        let mut grid = settings(Method::Grid);
        (grid.shadow.rays, grid.filter.enabled) = (48, false);
        grid.vpls.count = 8000;
        let mut brute = grid.clone();
        brute.method = Method::Brute;
        let grid = render(&renderer, &camera, [24, 24], &grid);
        let brute = render(&renderer, &camera, [24, 24], &brute);
        let bias = energy(&grid.indirect) / energy(&brute.indirect) - 1.0;
        // Closed rooms come out some percent too bright, see docs/methods/lighting.md.
        assert!(bias.abs() < 0.08, "{name} {bias}");
    }
}

#[test]
fn every_variant_of_the_grid_takes_effect_and_stays_near_brute_force() {
    let (renderer, camera) = renderer("cornell");
    let mut grid = settings(Method::Grid);
    (grid.shadow.rays, grid.filter.enabled) = (16, false);
    let brute = Settings { method: Method::Brute, ..grid.clone() };
    let truth = energy(&render(&renderer, &camera, [20, 20], &brute).indirect);
    let default = render(&renderer, &camera, [20, 20], &grid);
    // One lobe and points of the variance lose much of the light: that is why they are no default.
    let variants = [
        ("grid.lobes", "1", 0.5),
        ("grid.spread", "false", 0.3),
        ("grid.start_level", "1", 0.1),
        ("grid.levels", "4", 0.3),
        ("shadow.target", "variance", 0.5),
        ("shadow.estimate", "mean", 0.1),
        ("shadow.stratified", "false", 0.1),
        ("shadow.start_level", "2", 0.3),
        ("shadow.start_level", "14", 0.3),
        ("shadow.rays", "1", 0.2),
    ];
    for (path, value, tolerance) in variants {
        let mut s = grid.clone();
        s.set(path, value).expect("a setting");
        let layers = render(&renderer, &camera, [20, 20], &s);
        assert!(layers.indirect != default.indirect, "{path}={value} changes nothing");
        let bias = energy(&layers.indirect) / truth - 1.0;
        assert!(bias.abs() < tolerance, "{path}={value}: {bias}");
    }
    grid.shadow.rays = 0;
    let open = render(&renderer, &camera, [20, 20], &grid);
    assert_eq!(open.indirect, open.indirect_unshadowed);
}

#[test]
fn a_lone_plane_with_bent_normals_lights_nothing_but_the_eye() {
    // Sky above a plane: whatever the shading normals, no light is scattered twice.
    let bent = Vec3::new(0.8, 0.6, 0.0);
    let corner = |x, z| Vec3::new(x, 0.0, z);
    let plane = manylight_scene::Mesh {
        positions: vec![corner(-9.0, -9.0), corner(-9.0, 9.0), corner(9.0, 9.0), corner(9.0, -9.0)],
        normals: vec![bent; 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Default::default()
    };
    let mut shot = manylight_scene::builtin("cornell").expect("cornell");
    shot.scene = Scene {
        meshes: vec![plane],
        instances: vec![manylight_scene::Instance {
            mesh: 0,
            world_from_object: glam::Affine3A::IDENTITY,
        }],
        materials: vec![manylight_scene::Material {
            base_color: glam::Vec4::new(0.5, 0.5, 0.5, 1.0),
            ..Default::default()
        }],
        sky: Some(Sky::Constant(Vec3::ONE)),
        ..Default::default()
    };
    (shot.camera.position, shot.camera.forward) = (Vec3::new(0.0, 2.0, 0.0), Vec3::NEG_Y);
    shot.camera.up = Vec3::NEG_Z;
    let renderer = Renderer::new(shot.scene).expect("a plane");
    for method in [Method::Path, Method::Brute] {
        let layers = render(&renderer, &shot.camera, [6, 6], &settings(method));
        assert!(energy(&layers.direct) > 0.1, "{method:?}");
        assert_eq!(energy(&layers.indirect), 0.0, "{method:?}");
    }
}

#[test]
fn interleaving_keeps_the_light_of_smooth_walls() {
    let (renderer, camera) = renderer("furnace");
    let mut s = settings(Method::Grid);
    (s.vpls.count, s.vpls.emitter_count, s.shadow.rays) = (20_000, 20_000, 0);
    let whole = render(&renderer, &camera, [48, 32], &s);
    for side in [2, 4] {
        s.interleave = side;
        let parts = render(&renderer, &camera, [48, 32], &s);
        for (name, a, b) in [
            ("direct", &parts.direct, &whole.direct),
            ("indirect", &parts.indirect, &whole.indirect),
        ] {
            let bias = energy(a) / energy(b) - 1.0;
            assert!(bias.abs() < 0.003, "{name} of side {side}: {bias}");
        }
    }
}

#[test]
fn interleaved_pictures_look_like_whole_ones() {
    let (renderer, camera) = renderer("atrium");
    let mut s = settings(Method::Grid);
    (s.vpls.count, s.shadow.rays) = (20_000, 0);
    let raster = |s: &Settings| {
        let pixels = render(&renderer, &camera, [192, 108], s).beauty();
        let data = pixels.iter().flat_map(|c| c.to_array()).collect();
        manylight_image::Raster { width: 192, height: 108, channels: 3, data }
    };
    let compare =
        |s: &Settings, whole| manylight_image::compare(&raster(s), whole).expect("same size");
    let whole = raster(&s);
    for (side, most_flip) in [(2, 0.04), (4, 0.08)] {
        s.interleave = side;
        let errors = compare(&s, &whole);
        assert!(errors.flip_mean < most_flip, "side {side}: {errors:?}");
        assert!(errors.energy_bias.abs() < 0.003, "side {side}: {errors:?}");
    }
    // Whole pictures with other draws differ too: what stays is the energy.
    (s.shadow.rays, s.interleave) = (4, 1);
    let whole = raster(&s);
    s.interleave = 4;
    let errors = compare(&s, &whole);
    assert!(errors.energy_bias.abs() < 0.005, "{errors:?}");
}

#[test]
fn every_preset_renders() {
    let (renderer, camera) = renderer("cornell");
    for name in crate::settings::PRESETS {
        let mut s = Settings::preset(name).expect(name);
        (s.vpls.count, s.vpls.emitter_count) = (2000, 300);
        let layers = render(&renderer, &camera, [12, 12], &s);
        assert!(energy(&layers.indirect) > 0.0, "{name}");
    }
}

#[test]
fn pictures_without_pixels_are_refused() {
    let (renderer, camera) = renderer("cornell");
    for size in [[0, 0], [0, 4], [usize::MAX, 2]] {
        let error = renderer.render(&camera, size, &Settings::default(), &|_, _| ());
        assert!(error.expect_err("no size").to_string().contains("size"));
    }
}

#[test]
fn the_same_seed_gives_the_same_bits_at_any_thread_count() {
    let (renderer, camera) = renderer("cornell");
    for method in [Method::Grid, Method::Brute, Method::Path, Method::Direct] {
        let mut s = settings(method);
        (s.vpls.count, s.vpls.emitter_count, s.path.spp) = (1000, 200, 4);
        let bits = |threads: usize, s: &Settings| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
            let beauty = pool.install(|| render(&renderer, &camera, [40, 24], s)).beauty();
            beauty.iter().flat_map(|c| c.to_array().map(f32::to_bits)).collect::<Vec<_>>()
        };
        let one = bits(1, &s);
        assert_eq!(one, bits(2, &s), "{method:?}");
        assert_eq!(one, bits(7, &s), "{method:?}");
        s.seed = 1;
        assert_ne!(one, bits(2, &s), "{method:?} ignores its seed");
    }
}

#[test]
fn no_layer_has_a_value_that_is_not_finite() {
    for name in manylight_scene::BUILTINS {
        let (renderer, camera) = renderer(name);
        for method in [Method::Grid, Method::Path] {
            let mut s = settings(method);
            s.path.spp = 2;
            let layers = render(&renderer, &camera, [33, 17], &s);
            assert!(layers.beauty().iter().all(|c| c.is_finite() && c.min_element() >= 0.0));
            assert!(energy(&layers.beauty()) > 0.0, "{name} {method:?} is black");
        }
    }
}

#[test]
fn a_scene_without_light_or_triangles_is_refused_in_one_sentence() {
    let mut shot = manylight_scene::builtin("cornell").expect("cornell");
    shot.scene.materials.iter_mut().for_each(|m| m.emission = Vec3::ZERO);
    let error = Renderer::new(shot.scene.clone()).expect_err("dark").to_string();
    assert!(error.contains("nothing in it shines"), "{error}");
    shot.scene.instances.clear();
    let error = Renderer::new(shot.scene).expect_err("empty").to_string();
    assert!(error.contains("no triangle"), "{error}");
}
