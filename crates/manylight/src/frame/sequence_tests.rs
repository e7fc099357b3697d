use super::*;
use crate::math::luminance;
use glam::Quat;

const SIZE: [usize; 2] = [48, 36];

fn renderer(name: &str) -> (Renderer, Camera) {
    let shot = manylight_scene::builtin(name).expect(name);
    (Renderer::new(shot.scene).expect(name), shot.camera)
}

fn settings() -> Settings {
    let mut s = Settings::default();
    (s.vpls.count, s.vpls.emitter_count, s.shadow.rays) = (2000, 400, 2);
    s.filter.temporal = true;
    s
}

fn next(renderer: &Renderer, camera: &Camera, s: &Settings, n: u32, past: &mut Past) -> Layers {
    renderer.render_next(camera, SIZE, s, n, past, &|_, _| ()).expect("valid settings").layers
}

/// Every number of a picture, but for what does not depend on light.
fn bits(layers: &Layers) -> Vec<u32> {
    let colors = layers.beauty().into_iter().chain(layers.indirect.clone());
    let ratios = layers.shadow_ratio.iter().copied();
    colors.flat_map(|c| c.to_array()).chain(ratios).map(f32::to_bits).collect()
}

/// Mean squared difference of luminances, over the mean squared luminance of the second.
fn error(found: &[Vec3], expected: &[Vec3]) -> f64 {
    let pairs = found.iter().zip(expected).map(|(a, b)| (luminance(*a), luminance(*b)));
    let sums = pairs.fold((0.0, 0.0), |(off, all), (a, b)| {
        (off + f64::from((a - b).powi(2)), all + f64::from(b.powi(2)))
    });
    sums.0 / sums.1
}

#[test]
fn single_pictures_know_no_past() {
    let (renderer, camera) = renderer("cornell");
    let on = settings();
    let mut off = settings();
    off.filter.temporal = false;
    let single = |s: &Settings| renderer.render(&camera, SIZE, s, &|_, _| ()).expect("ok").layers;
    let expected = bits(&single(&off));
    assert!(expected == bits(&single(&on)), "the setting changes no single picture");
    let mut past = Past::default();
    for n in [0, 7, 8] {
        assert!(expected == bits(&next(&renderer, &camera, &off, n, &mut past)), "frame {n}");
    }
    assert!(expected == bits(&next(&renderer, &camera, &on, 0, &mut past)), "the first frame");
    assert!(expected != bits(&next(&renderer, &camera, &on, 1, &mut past)), "the next");
    for method in [Method::Brute, Method::Path] {
        let mut s = Settings { method, ..settings() };
        (s.vpls.count, s.path.spp) = (50, 1);
        let expected = bits(&single(&s));
        assert!(expected == bits(&next(&renderer, &camera, &s, 3, &mut past)), "{method:?}");
    }
}

#[test]
fn the_error_of_a_static_picture_falls_and_so_does_its_flicker() {
    let (renderer, camera) = renderer("cornell");
    let mut many = settings();
    (many.shadow.rays, many.filter.enabled) = (256, false);
    let reference = renderer.render(&camera, SIZE, &many, &|_, _| ()).expect("ok").layers;
    // Without a past, and with one.
    let run = |history: u32| {
        let mut s = settings();
        s.filter.history = history;
        let mut past = Past::default();
        let frames = (0..16).map(|n| next(&renderer, &camera, &s, n, &mut past).indirect);
        let frames: Vec<_> = frames.collect();
        let errors: Vec<f64> = frames.iter().map(|f| error(f, &reference.indirect)).collect();
        (errors, error(&frames[15], &frames[14]))
    };
    let ((alone, flicker), (added, less)) = (run(1), run(16));
    println!("alone {alone:.6?} {flicker:.6}, added up {added:.6?} {less:.6}");
    assert_eq!(alone[0], added[0]);
    let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
    assert!(mean(&added[12..]) < 0.6 * mean(&alone[12..]));
    assert!(mean(&added[4..8]) < added[0] && mean(&added[12..]) < mean(&added[4..8]));
    assert!(less < 0.1 * flicker);
}

#[test]
fn what_does_not_continue_a_frame_begins_anew() {
    let (renderer, camera) = renderer("cornell");
    let (other, _) = self::renderer("cornell");
    let s = settings();
    let turned = |angle: f32| {
        let turn = Quat::from_axis_angle(camera.up, angle);
        Camera { forward: turn * camera.forward, ..camera.clone() }
    };
    let far = Camera { position: camera.position + camera.forward * 0.5, ..camera.clone() };
    let brighter = Settings { seed: 5, ..settings() };
    let mut exposed = settings();
    exposed.film.exposure_ev = Some(1.0);
    let cases = [
        ("the same", &renderer, camera.clone(), &s, true),
        ("a small turn", &renderer, turned(0.02), &s, true),
        ("another exposure", &renderer, camera.clone(), &exposed, true),
        ("a cut by turning", &renderer, turned(0.6), &s, false),
        ("a cut by going", &renderer, far, &s, false),
        ("another seed", &renderer, camera.clone(), &brighter, false),
        ("another renderer", &other, camera.clone(), &s, false),
    ];
    for (name, renderer_then, camera_then, s_then, continues) in cases {
        let mut past = Past::default();
        (0..2).for_each(|n| drop(next(&renderer, &camera, &s, n, &mut past)));
        let found = bits(&next(renderer_then, &camera_then, s_then, 2, &mut past));
        let alone = bits(&next(renderer_then, &camera_then, s_then, 2, &mut Past::default()));
        assert!(alone.iter().any(|&number| number > 0), "{name}: all black");
        assert_eq!(found != alone, continues, "{name}");
    }
    let mut past = Past::default();
    next(&renderer, &camera, &s, 0, &mut past);
    let small = |past: &mut Past| {
        let frame = renderer.render_next(&camera, [20, 15], &s, 1, past, &|_, _| ());
        bits(&frame.expect("a frame").layers)
    };
    assert!(small(&mut past) == small(&mut Past::default()), "another size");
}

#[test]
fn a_run_that_begins_later_finds_the_same_frames_after_the_same_past() {
    let (renderer, camera) = renderer("cornell");
    let s = settings();
    let frames = |first: u32| {
        let mut past = Past::default();
        (first..4).map(|n| bits(&next(&renderer, &camera, &s, n, &mut past))).collect::<Vec<_>>()
    };
    let (whole, again, late) = (frames(0), frames(0), frames(2));
    assert!(whole == again);
    assert!(whole[2] != late[0] && whole[3] != late[1], "less past, other bits");
}
