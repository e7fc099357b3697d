use super::*;
use crate::composite::Layers;
use crate::emitter::gpu::testing::sky_map;
use crate::frame::Past;
use crate::gpu::testing::{device, device_with};
use crate::gpu::{Feature, GpuOptions};
use glam::Quat;
use manylight_image::Raster;
use manylight_scene::{AlphaMode, Shot, TextureImage, TextureSlot, Wrap};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Largest mean FLIP between the pictures of device and processor.
const MOST_FLIP: f64 = 0.01;

/// Pixels of pictures of built-in scenes.
const SIZE: [usize; 2] = [64, 48];

/// A scene on both sides, with its camera.
struct Both {
    engine: GpuRenderer,
    camera: Camera,
}

/// Runs a test on the device of all these tests, which builds its kernels once; says why where
/// there is none.
fn with_gpu(test: impl FnOnce(Gpu) -> Gpu) {
    static GPU: Mutex<Option<Gpu>> = Mutex::new(None);
    if device().is_none() {
        return;
    }
    let mut kept = GPU.lock().unwrap_or_else(PoisonError::into_inner);
    let options = GpuOptions { base: true, software: true, ..GpuOptions::default() };
    let gpu = kept.take().unwrap_or_else(|| Gpu::open(&options).expect("a device"));
    *kept = Some(test(gpu));
}

/// Runs a part of a test with a scene on the device.
fn with_scene(gpu: Gpu, shot: Shot, test: impl FnOnce(&mut Both)) -> Gpu {
    let camera = shot.camera.clone();
    let renderer = Renderer::new(shot.scene).expect("scene");
    let engine = GpuRenderer::new(gpu, renderer).map_err(|(_, e)| e).expect("scene on the device");
    let mut both = Both { engine, camera };
    test(&mut both);
    both.engine.into_gpu()
}

fn builtin(name: &str) -> Shot {
    manylight_scene::builtin(name).expect(name)
}

/// A preset with few lights.
fn few(preset: &str) -> Settings {
    let mut s = Settings::preset(preset).expect(preset);
    (s.vpls.count, s.vpls.emitter_count, s.grid.evals) = (2000, 400, 150);
    s
}

impl Both {
    /// Every stage agrees.
    fn check_stages(&self, name: &str, size: [usize; 2], settings: &Settings) {
        let rows = self.engine.diff_stages(&self.camera, size, settings).expect("stages");
        let bad: Vec<_> = rows.iter().filter(|row| !row.agrees()).collect();
        assert!(bad.is_empty(), "{name}: {bad:#?}");
        assert!(rows.iter().all(|row| row.stage != "receivers" || row.compared > 0), "{name}");
    }

    /// With lights of its own, though those of the picture before were made the same way.
    fn on_device(&mut self, size: [usize; 2], settings: &Settings) -> Layers {
        self.engine.buffers.iter_mut().for_each(Buffers::forget_lights);
        let frame = self.engine.render(&self.camera, size, settings, &|_, _| ());
        frame.expect("a frame on the device").layers
    }

    fn on_processor(&self, size: [usize; 2], settings: &Settings) -> Layers {
        let frame = self.engine.renderer().render(&self.camera, size, settings, &|_, _| ());
        frame.expect("a frame on the processor").layers
    }

    /// The pictures of device and processor look the same.
    fn check_picture(&mut self, name: &str, size: [usize; 2], settings: &Settings) -> f64 {
        let found = self.on_device(size, settings);
        self.check_layers(name, settings, &found)
    }

    /// A picture of the device looks as that of the processor.
    fn check_layers(&self, name: &str, settings: &Settings, found: &Layers) -> f64 {
        let expected = raster(&self.on_processor([found.width, found.height], settings));
        let found = raster(found);
        let errors = manylight_image::compare(&found, &expected).expect("pictures of one size");
        assert_eq!(errors.nonfinite_count, 0, "{name}");
        assert!(expected.data.iter().any(|v| *v > 0.0), "{name} is black");
        assert!(errors.flip_mean <= MOST_FLIP, "{name}: {errors:?}");
        assert!(errors.energy_bias.abs() <= 0.01, "{name}: {errors:?}");
        errors.flip_mean
    }
}

fn raster(layers: &Layers) -> Raster {
    let data = layers.beauty().iter().flat_map(|c| c.to_array()).collect();
    Raster { width: layers.width, height: layers.height, channels: 3, data }
}

/// Every number of a frame.
fn bits(layers: &Layers) -> Vec<u32> {
    let colors = [
        &layers.direct,
        &layers.indirect,
        &layers.indirect_unshadowed,
        &layers.emission,
        &layers.albedo,
        &layers.normal,
        &layers.position,
    ];
    let colors = colors.into_iter().flatten().flat_map(|c| c.to_array());
    let numbers = [&layers.shadow_ratio, &layers.depth, &layers.evals];
    colors.chain(numbers.into_iter().flatten().copied()).map(f32::to_bits).collect()
}

#[test]
fn every_stage_is_that_of_the_processor() {
    with_gpu(|mut gpu| {
        for name in manylight_scene::BUILTINS {
            gpu = with_scene(gpu, builtin(name), |both| {
                for preset in ["balanced", "paper"] {
                    both.check_stages(&format!("{name}, {preset}"), [48, 32], &few(preset));
                }
            });
        }
        gpu
    });
}

#[test]
fn every_stage_is_that_of_the_processor_with_other_settings() {
    with_gpu(|gpu| {
        with_scene(gpu, builtin("atrium"), |both| {
            let each = [
                &[("method", "direct"), ("film.samples", "3")][..],
                &[("filter.enabled", "false"), ("shadow.rays", "9")],
                &[("shadow.rays", "0"), ("grid.levels", "5")],
                &[("vpls.bounces", "12"), ("grid.lobes", "1"), ("filter.passes", "2")],
                &[("shadow.estimate", "mean"), ("shadow.stratified", "false")],
                &[("interleave", "4")],
                &[("shadow.start_level", "3"), ("grid.spread", "false"), ("grid.alpha", "0.7")],
            ];
            for sets in each {
                let mut settings = few("balanced");
                for (path, value) in sets {
                    settings.set(path, value).expect("a setting");
                }
                both.check_stages(&format!("{sets:?}"), [35, 21], &settings);
            }
        })
    });
}

#[test]
fn methods_without_stages_are_refused() {
    with_gpu(|gpu| {
        with_scene(gpu, builtin("cornell"), |both| {
            for method in [Method::Path, Method::Brute] {
                let settings = Settings { method, ..few("balanced") };
                let refused = both.engine.diff_stages(&both.camera, [8, 8], &settings);
                assert!(refused.expect_err("no stages").to_string().contains("use grid or direct"));
            }
        })
    });
}

#[test]
fn pictures_are_those_of_the_processor() {
    with_gpu(|mut gpu| {
        for name in manylight_scene::BUILTINS {
            gpu = with_scene(gpu, builtin(name), |both| {
                both.check_picture(name, SIZE, &few("balanced"));
            });
        }
        gpu
    });
}

#[test]
fn every_method_and_more_samples_give_the_picture_of_the_processor() {
    with_gpu(|gpu| {
        with_scene(gpu, builtin("cornell"), |both| {
            let each = [
                ("brute", &[("vpls.count", "300"), ("vpls.emitter_count", "100")][..]),
                ("path", &[("path.spp", "4")]),
                ("direct", &[]),
                ("grid", &[("film.samples", "3"), ("interleave", "2")]),
                ("grid", &[("filter.enabled", "false"), ("shadow.rays", "16")]),
            ];
            for (method, sets) in each {
                let mut settings = few("balanced");
                settings.set("method", method).expect("a method");
                for (path, value) in sets {
                    settings.set(path, value).expect("a setting");
                }
                both.check_picture(&format!("{method} {sets:?}"), [40, 30], &settings);
            }
        })
    });
}

#[test]
fn a_sky_of_many_colors_keeps_them_without_the_filter() {
    with_gpu(|gpu| {
        let mut shot = builtin("atrium");
        shot.scene.lights.clear();
        shot.scene.sky = Some(sky_map());
        with_scene(gpu, shot, |both| {
            let mut settings = Settings { method: Method::Direct, ..few("balanced") };
            for enabled in [false, true] {
                settings.filter.enabled = enabled;
                both.check_stages(&format!("filter {enabled}"), [33, 20], &settings);
                both.check_picture(&format!("filter {enabled}"), [48, 32], &settings);
            }
        })
    });
}

#[test]
fn samples_begin_again_where_a_later_one_lacks_room() {
    with_gpu(|gpu| {
        with_scene(gpu, builtin("cornell"), |both| {
            let mut settings = few("balanced");
            settings.film.samples = 2;
            let expected = bits(&both.on_device(SIZE, &settings));
            let view = ViewFrame::new(&both.camera, SIZE[0], SIZE[1]);
            let engine = &mut both.engine;
            let sample = |n| Job { sample: n, ..Job::new(&view, &settings) };
            let first = engine.render_sample(sample(0), None, &|_, _| ()).expect("a sample");
            assert!(first.is_some());
            engine.buffers.as_mut().expect("buffers").lose_room(&engine.gpu, &settings);
            // The first sample is not in buffers that have grown; they may do so more than once.
            let mut second =
                || engine.render_sample(sample(1), None, &|_, _| ()).expect("a sample").is_some();
            assert!(!second());
            assert!((0..MOST_TRIES).any(|_| second()), "there is room at last");
            assert!(bits(&both.on_device(SIZE, &settings)) == expected);
        })
    });
}

#[test]
fn two_frames_have_the_same_bits() {
    with_gpu(|gpu| {
        with_scene(gpu, builtin("cornell"), |both| {
            for method in [Method::Grid, Method::Brute, Method::Path, Method::Direct] {
                let mut settings = Settings { method, ..few("balanced") };
                (settings.path.spp, settings.film.samples) = (2, 2);
                let first = bits(&both.on_device([33, 21], &settings));
                // Other pixels and settings in between leave no trace.
                both.on_device([20, 11], &Settings { seed: 9, ..settings.clone() });
                assert!(first == bits(&both.on_device([33, 21], &settings)), "{method:?}");
                settings.seed = 1;
                assert!(first != bits(&both.on_device([33, 21], &settings)), "{method:?}: seed");
            }
        })
    });
}

/// Twice the picture of a built-in scene on a device with some feature, and once without.
fn with_and_without(feature: Feature, name: &str) -> Option<[Layers; 3]> {
    let gpu = device_with(feature)?;
    let (mut found, settings) = (Vec::new(), few("balanced"));
    with_scene(gpu, builtin(name), |both| {
        found.extend([both.on_device(SIZE, &settings), both.on_device(SIZE, &settings)]);
    });
    with_gpu(|gpu| {
        with_scene(gpu, builtin(name), |both| found.push(both.on_device(SIZE, &settings)))
    });
    found.try_into().ok()
}

#[test]
fn subgroups_change_no_bit_of_a_picture() {
    let Some([once, again, base]) = with_and_without(Feature::Subgroups, "atrium") else { return };
    assert!(bits(&once) == bits(&base) && bits(&again) == bits(&base));
}

#[test]
fn large_limits_change_no_bit_of_a_picture() {
    let found = with_and_without(Feature::LargeLimits, "cornell");
    let Some([once, again, base]) = found else { return };
    assert!(bits(&once) == bits(&base) && bits(&again) == bits(&base));
}

#[test]
fn timestamps_tell_of_every_stage_and_change_no_bit() {
    let Some(gpu) = device_with(Feature::Timestamps) else { return };
    let settings = few("balanced");
    let mut pictures = Vec::new();
    let mut render = |gpu, is_timed| {
        with_scene(gpu, builtin("cornell"), |both| {
            pictures.push(bits(&both.on_device(SIZE, &settings)));
            let times = both.engine.time_frame(&both.camera, SIZE, &settings, false);
            let times = times.expect("a frame");
            let names: Vec<_> = times.iter().map(|time| time.name).collect();
            let stages = ["receivers", "vpls", "grid", "gather light", "gather shadow", "filter"];
            for name in stages {
                assert_eq!(names.contains(&name), is_timed, "{name}: {names:?}");
            }
            let sum: f64 = times.iter().map(|time| time.time_ms).sum();
            assert_eq!(sum > 0.0, is_timed, "{times:?}");
            let frame = both.engine.render(&both.camera, SIZE, &settings, &|_, _| ());
            let frame = frame.expect("a frame");
            let light = frame.stages.iter().find(|stage| stage.name == "gather light");
            assert_eq!(light.is_some_and(|stage| stage.count > 0), is_timed, "evaluations");
        })
    };
    render(gpu, true);
    with_gpu(|gpu| render(gpu, false));
    assert!(pictures[0] == pictures[1]);
}

#[test]
fn halves_change_a_picture_little_and_repeat_themselves() {
    for name in ["cornell", "atrium"] {
        let Some([once, again, base]) = with_and_without(Feature::Half, name) else { return };
        assert!(bits(&once) == bits(&again), "{name}");
        assert!(bits(&once) != bits(&base), "{name}: nothing is kept in halves");
        let errors = manylight_image::compare(&raster(&once), &raster(&base)).expect("one size");
        println!("{name}: {errors:?}");
        assert_eq!(errors.nonfinite_count, 0, "{name}");
        assert!(errors.flip_mean <= 1e-3 && errors.energy_bias.abs() <= 1e-3, "{name}: {errors:?}");
    }
}

#[test]
fn ray_queries_render_the_same_picture_and_the_same_bits() {
    let Some(gpu) = device_with(Feature::RayQueries) else { return };
    let settings = few("balanced");
    with_scene(gpu, builtin("atrium"), |both| {
        let [a, b] = [(); 2].map(|()| both.on_device(SIZE, &settings));
        let flip = both.check_layers("atrium", &settings, &a);
        println!("FLIP {flip:.5} with ray queries");
        assert!(bits(&a) == bits(&b), "two runs");
    });
}

/// The atrium with images on all that is plain, some of it cut out.
fn papered() -> Shot {
    let mut shot = builtin("atrium");
    let texel = |i: u32| hash_u32(i).to_le_bytes();
    for (i, material) in shot.scene.materials.iter_mut().enumerate() {
        let [width, height] = [5 + i as u32, 9];
        let texels = (0..width * height).map(|t| texel(t + 100 * i as u32)).collect();
        let name = format!("paper {i}");
        let image = shot.scene.images.len() as u32;
        shot.scene.images.push(TextureImage { name, width, height, texels });
        let slot = TextureSlot {
            image,
            uv_set: 0,
            transform: glam::Affine2::IDENTITY,
            wrap: [Wrap::Repeat, Wrap::Mirror],
            linear_filter: i % 2 == 0,
        };
        material.base_color_texture.get_or_insert(slot);
        if i % 5 == 0 {
            material.alpha_mode = AlphaMode::Mask(0.2);
        }
    }
    for mesh in shot.scene.meshes.iter_mut().filter(|mesh| mesh.uvs[0].is_empty()) {
        mesh.uvs[0] = mesh.positions.iter().map(|p| Vec2::new(p.x + p.y, p.z - p.y)).collect();
    }
    shot
}

#[test]
fn bindless_pictures_have_the_same_bits() {
    let Some(bindless) = device_with(Feature::Bindless) else { return };
    with_gpu(|gpu| {
        let mut pictures = Vec::new();
        let methods = [Method::Direct, Method::Grid, Method::Brute, Method::Path];
        let mut render = |gpu| {
            with_scene(gpu, papered(), |both| {
                for method in methods {
                    let mut settings = Settings { method, ..few("balanced") };
                    settings.path.spp = 2;
                    pictures.push(bits(&both.on_device([40, 30], &settings)));
                }
            })
        };
        let gpu = render(gpu);
        render(bindless).check().expect("no problem");
        let (paged, bound) = pictures.split_at(methods.len());
        for (method, (paged, bound)) in methods.iter().zip(paged.iter().zip(bound)) {
            assert!(paged == bound, "{method:?}");
        }
        gpu
    });
}

/// The shots in a folder, each with what it makes of its scene: all but the camera.
fn shots(folder: &Path) -> Vec<(PathBuf, String)> {
    let entries = std::fs::read_dir(folder.join("shots")).expect("a folder of shots");
    let paths = entries.flatten().map(|entry| entry.path());
    let mut shots: Vec<_> = paths
        .filter(|path| path.extension().is_some_and(|end| end == "json"))
        .map(|path| {
            let text = std::fs::read_to_string(&path).expect("a shot");
            let mut value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
            value["camera"].take();
            (path, value.to_string())
        })
        .collect();
    shots.sort();
    shots
}

#[test]
fn real_scenes_look_as_on_the_processor() {
    let Some(folder) = manylight_testing::scenes() else { return };
    let shots = shots(&folder);
    assert!(!shots.is_empty(), "no shots in {}", folder.display());
    // What the other presets do is done by these, more often or less.
    let settings = ["balanced", "paper"].map(|preset| {
        let mut settings = Settings::preset(preset).expect("a preset");
        (settings.vpls.count, settings.vpls.emitter_count) = (4000, 1000);
        (preset, settings)
    });
    with_gpu(|mut gpu| {
        // One scene at a time, made ready once for all its shots.
        for shots in shots.chunk_by(|a, b| a.1 == b.1) {
            let start = std::time::Instant::now();
            let load = |path: &Path| manylight_scene::load(path.to_str().expect("a name"));
            let first = load(&shots[0].0).expect("a shot");
            gpu = with_scene(gpu, first, |both| {
                println!("ready after {:.1} s", start.elapsed().as_secs_f64());
                for (i, (path, _)) in shots.iter().enumerate() {
                    let name = path.file_stem().unwrap_or_default().to_string_lossy();
                    if i > 0 {
                        both.camera = load(path).expect("a shot").camera;
                    }
                    for (preset, settings) in &settings {
                        let name = format!("{name}, {preset}");
                        both.check_stages(&name, [64, 36], settings);
                        let flip = both.check_picture(&name, [64, 36], settings);
                        println!("{name}: FLIP {flip:.4}, {:.1} s", start.elapsed().as_secs_f64());
                    }
                }
            });
        }
        gpu
    });
}

#[test]
fn a_million_lights_fit_into_six_hundred_mebibytes() {
    let Some(folder) = manylight_testing::scenes() else { return };
    if device().is_none() {
        return;
    }
    let path = folder.join("shots/sponza-atrium.json");
    let shot = manylight_scene::load(path.to_str().expect("a name")).expect("a shot");
    // One that holds nothing else.
    let options = GpuOptions { base: true, software: true, ..GpuOptions::default() };
    let gpu = Gpu::open(&options).expect("a device");
    let mut settings = Settings::default();
    (settings.vpls.count, settings.grid.alpha) = (1_000_000, Some(1.0));
    with_scene(gpu, shot, |both| {
        let buffers = Buffers::take(None, &both.engine, [1280, 720], &settings).expect("room");
        for (name, bytes) in both.engine.gpu().lists().iter().filter(|l| l.1 >> 20 > 0) {
            println!("{:>6.1} MiB {name}", *bytes as f64 / f64::from(1 << 20));
        }
        let all = both.engine.gpu().bytes();
        println!("{:>6.1} MiB in all", all as f64 / f64::from(1 << 20));
        assert!(all <= 600 << 20, "{all} bytes");
        drop(buffers);
    });
}

/// The camera of a frame of a sequence: still, moving, after a cut.
fn camera_of(both: &Both, n: u32) -> Camera {
    let mut camera = both.camera.clone();
    let (turn, step) = [(0.0, 0.0), (0.0, 0.0), (0.03, 0.01), (0.03, 0.1), (0.03, 0.1)][n as usize];
    camera.forward = Quat::from_axis_angle(camera.up, turn) * camera.forward;
    camera.position += camera.forward * (step * both.engine.renderer().world.diagonal());
    camera
}

#[test]
fn sequences_look_as_on_the_processor() {
    const SIZE: [usize; 2] = [40, 30];
    let mut settings = few("balanced");
    settings.filter.temporal = true;
    settings.shadow.rays = 2;
    let check = |both: &mut Both, name: &str| {
        let mut past = Past::default();
        let mut found = Vec::new();
        for n in 0..5 {
            let camera = camera_of(both, n);
            let next = both.engine.render_next(&camera, SIZE, &settings, n, &|_, _| ());
            let layers = next.expect("a frame").layers;
            let renderer = both.engine.renderer();
            let next = renderer.render_next(&camera, SIZE, &settings, n, &mut past, &|_, _| ());
            let expected = raster(&next.expect("a frame").layers);
            let errors = manylight_image::compare(&raster(&layers), &expected).expect("one size");
            println!("{name}, frame {n}: FLIP {:.6}", errors.flip_mean);
            assert!(expected.data.iter().any(|v| *v > 0.0), "{name}, frame {n} is black");
            assert_eq!(errors.nonfinite_count, 0, "{name}, frame {n}");
            assert!(errors.flip_mean <= MOST_FLIP, "{name}, frame {n}: {errors:?}");
            found.push(bits(&layers));
            // A single picture in between leaves the past alone.
            both.on_device([20, 11], &settings);
        }
        let frames = |both: &mut Both, range: std::ops::Range<u32>| {
            both.engine.forget_past();
            let next = |n| {
                let camera = camera_of(both, n);
                let frame = both.engine.render_next(&camera, SIZE, &settings, n, &|_, _| ());
                bits(&frame.expect("a frame").layers)
            };
            range.map(next).collect::<Vec<_>>()
        };
        // The same bits after the same frames, which are few after a cut, and others after others.
        assert!(frames(both, 3..5) == found[3..], "{name}: after a cut");
        assert!(frames(both, 4..5) != found[4..], "{name}: without the one before it");
        assert!(frames(both, 0..1) == found[..1], "{name}: again");
    };
    with_gpu(|mut gpu| {
        for name in ["cornell", "atrium"] {
            gpu = with_scene(gpu, builtin(name), |both| check(both, name));
        }
        gpu
    });
}
