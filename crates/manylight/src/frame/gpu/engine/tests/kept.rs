//! What frames keep of those before.

use super::*;
use crate::settings::ShadowSettings;

#[test]
fn later_frames_need_fewer_dispatches_until_the_lights_change() {
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    let (settings, view) = (many_rounds(), rented.target());
    // Each frame makes lights of its own.
    let record = |rented: &mut Rented, seed| {
        let before = rented.renderer().gpu().dispatches();
        let encoder = rented.record_with(&settings, seed, &view);
        (rented.renderer().gpu().dispatches() - before, encoder)
    };
    let frame = |rented: &mut Rented, seed| {
        let (dispatches, encoder) = record(rented, seed);
        assert!(!rented.submit(encoder), "the buffers had their size");
        (dispatches, read(rented.renderer().gpu(), &view))
    };
    // Before any is known.
    let (first, _) = record(&mut rented, 1);
    rented.render(&settings, 1);
    rented.renderer().set_lights(vec![lamp()], None).expect("lights");
    let (doubtful, picture) = frame(&mut rented, 1);
    let (known, other) = frame(&mut rented, 2);
    assert!(known < doubtful && doubtful + 10 < first, "{first}, {doubtful}, then {known}");
    let (again, same) = frame(&mut rented, 1);
    assert!(again == known && same == picture && other != picture);
    // What a frame tells of lights that are gone since is doubted.
    let (_, encoder) = record(&mut rented, 3);
    rented.renderer().set_lights(vec![sun()], None).expect("lights");
    rented.submit(encoder);
    let (other, _) = frame(&mut rented, 4);
    let (last, _) = frame(&mut rented, 5);
    assert!(last < other && other < first, "{first}, {other}, then {last}");
}

#[test]
fn lights_are_made_again_only_where_they_would_be_others() {
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    let camera = rented.camera.clone();
    let other = Camera { position: camera.position + Vec3::X * 0.2, ..camera.clone() };
    let settings = settings();
    // Pictures of other seeds before them leave nothing to keep.
    let mut alone = |camera: &Camera, seed| {
        rented.render(&settings, 99);
        rented.render_from(camera, &settings, seed).layers.beauty()
    };
    let expected = [alone(&camera, 7), alone(&other, 7), alone(&camera, 8)];
    let view = rented.target();
    let frame = |rented: &mut Rented, camera: &Camera, seed, is_submitted| {
        let before = rented.renderer().gpu().dispatches();
        let mut encoder = rented.encoder();
        rented.record(&mut encoder, camera, seed, &composite(&view));
        let dispatches = rented.renderer().gpu().dispatches() - before;
        if is_submitted {
            assert!(!rented.submit(encoder), "the buffers had their size");
        }
        dispatches
    };
    let picture = |rented: &mut Rented| read(rented.renderer().gpu(), &view);
    rented.render(&settings, 99);
    let made = frame(&mut rented, &camera, 7, true);
    assert_same(&picture(&mut rented), &expected[0], "made");
    // The camera alone has moved.
    let kept = frame(&mut rented, &other, 7, true);
    assert!(kept + 40 < made, "{made} dispatches, then {kept}");
    assert_same(&picture(&mut rented), &expected[1], "kept");
    // Lights that are never made take the place of those that were.
    assert!(frame(&mut rented, &camera, 8, false) > kept + 40);
    assert!(frame(&mut rented, &camera, 8, true) > kept + 40);
    assert_same(&picture(&mut rented), &expected[2], "made after one that was not");
    // Nor are they kept while nobody knows whether they are done.
    assert!(frame(&mut rented, &camera, 7, false) > kept + 40);
    assert!(frame(&mut rented, &other, 7, true) > kept + 40);
    assert_same(&picture(&mut rented), &expected[1], "made once more");
    // Frames are under way all the time, and one of them is known to be done.
    let mut encoders = [rented.encoder(), rented.encoder()];
    for encoder in &mut encoders {
        rented.record(encoder, &camera, 8, &composite(&view));
    }
    let [first, second] = encoders;
    assert!(!rented.submit(first));
    let mut third = rented.encoder();
    let before = rented.renderer().gpu().dispatches();
    rented.record(&mut third, &camera, 8, &composite(&view));
    assert!(rented.renderer().gpu().dispatches() - before <= kept);
    rented.renderer().gpu().queue().submit([second.finish()]);
    assert!(!rented.submit(third));
    assert_same(&picture(&mut rented), &expected[2], "kept while others are under way");
    // A picture of other lights comes before a frame that counts on those that lie there.
    let mut encoder = rented.encoder();
    rented.record(&mut encoder, &camera, 8, &composite(&view));
    rented.render(&settings, 99);
    rented.submit(encoder);
    assert_same(&picture(&mut rented), &expected[2], "with a picture in between");
    // The same where that picture needs other buffers, but for the grids.
    frame(&mut rented, &camera, 8, true);
    let mut encoder = rented.encoder();
    rented.record(&mut encoder, &camera, 8, &composite(&view));
    let mut more_rays = settings.clone();
    more_rays.shadow.rays += 1;
    rented.renderer().render(&camera, SIZE, &more_rays, &|_, _| ()).expect("frame");
    rented.renderer().gpu().queue().submit([encoder.finish()]);
    rented.renderer().gpu().wait().expect("done");
    assert_same(&picture(&mut rented), &expected[2], "with another picture in between");
    rented.renderer().after_submit().expect("looked");
    frame(&mut rented, &camera, 8, true);
    frame(&mut rented, &camera, 8, true);
    assert_same(&picture(&mut rented), &expected[2], "after it");
    let before = picture(&mut rented);
    rented.renderer().set_lights(vec![sun()], None).expect("lights");
    assert!(frame(&mut rented, &camera, 8, true) > kept + 40);
    assert!(picture(&mut rented) != before);
}

#[test]
fn grids_stay_while_only_the_gather_and_the_picture_change() {
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    let camera = rented.camera.clone();
    let mut base = Settings { seed: 5, ..settings() };
    // Else so few lights ask for fewer levels, which each picture finds out for itself.
    base.grid.levels = Some(6);
    type Change = fn(&mut Settings, &mut [usize; 2]);
    let changes: [(&str, Change); 5] = [
        ("rays", |settings, _| settings.shadow.rays = 5),
        ("interleaving", |settings, _| settings.interleave = 2),
        ("evaluations", |settings, _| (settings.grid.alpha, settings.grid.evals) = (None, 4000)),
        ("samples", |settings, _| settings.film.samples = 2),
        ("the size", |_, size| *size = [48, 36]),
    ];
    for (name, change) in changes {
        let (mut changed, mut size) = (base.clone(), SIZE);
        change(&mut changed, &mut size);
        let mut render = |size, settings: &Settings| {
            let before = rented.renderer().gpu().dispatches();
            let frame = rented.renderer().render(&camera, size, settings, &|_, _| ());
            let beauty = frame.expect("frame").layers.beauty();
            let work = &rented.renderer().buffers.as_ref().expect("rendered").work;
            let room = (*work.gather.capacity(), rented.renderer().gpu().bytes());
            (beauty, rented.renderer().gpu().dispatches() - before, room)
        };
        let first_room = render(SIZE, &base).2;
        let other_lights = Settings { seed: 6, ..changed.clone() };
        render(size, &changed);
        let (_, made, _) = render(size, &other_lights);
        let (expected, _, room) = render(size, &changed);
        render(SIZE, &base);
        let (kept, dispatches, kept_room) = render(size, &changed);
        let last_room = render(SIZE, &base).2;
        assert!(dispatches + 40 < made, "{name}: {made} dispatches, then {dispatches}");
        assert!(kept == expected, "{name}: another picture");
        assert_eq!(kept_room, room, "{name}");
        assert_eq!(last_room, first_room, "{name}: after it");
    }

    // What a gather has learned stays, and does not grow from change to change.
    let GpuRenderer { gpu, buffers, .. } = rented.renderer();
    buffers.as_mut().expect("buffers").lose_room(gpu, &base);
    let more_rays =
        Settings { shadow: ShadowSettings { rays: 5, ..base.shadow.clone() }, ..base.clone() };
    let rooms: Vec<_> = (0..3)
        .map(|_| {
            for settings in [&base, &more_rays, &base] {
                rented.renderer().render(&camera, SIZE, settings, &|_, _| ()).expect("frame");
            }
            rented.renderer().gpu().bytes()
        })
        .collect();
    assert!(rooms[1] == rooms[0] && rooms[2] == rooms[0], "{rooms:?}");
}

#[test]
fn a_picture_of_many_samples_keeps_the_first_and_leaves_frames_alone() {
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    let camera = rented.camera.clone();
    let mut base = Settings { seed: 3, ..settings() };
    base.grid.levels = Some(6);
    let mut many = base.clone();
    many.film.samples = 4;
    let picture = |rented: &mut Rented| {
        let frame = rented.renderer().render(&camera, SIZE, &many, &|_, _| ());
        frame.expect("frame").layers.beauty()
    };
    let expected = picture(&mut rented);
    let view = rented.target();
    let record = |rented: &mut Rented| {
        let mut encoder = rented.encoder();
        let (traced, targets) = (EngineReceivers::Traced, composite(&view));
        let renderer = rented.renderer();
        let recorded = renderer.record_into(&mut encoder, &camera, &base, 3, traced, &targets);
        recorded.expect("frame");
        encoder
    };
    for _ in 0..3 {
        let encoder = record(&mut rented);
        rented.submit(encoder);
    }
    let shown = read(rented.renderer().gpu(), &view);
    let encoder = record(&mut rented);
    assert!(picture(&mut rented) == expected, "a sample was lost");
    rented.renderer().gpu().queue().submit([encoder.finish()]);
    assert!(read(rented.renderer().gpu(), &view) == shown, "the frame lost its lights");
}

#[test]
fn fine_levels_are_those_of_the_same_settings() {
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    let camera = rented.camera.clone();
    let mut dispatches = |grid_levels| {
        let mut settings = settings();
        settings.grid.levels = grid_levels;
        let renderer = rented.renderer();
        let before = renderer.gpu().dispatches();
        renderer.time_frame(&camera, SIZE, &settings, false).expect("frame");
        renderer.gpu().dispatches() - before
    };
    // Buffers grow with the first of each.
    dispatches(None);
    dispatches(Some(2));
    let first = [dispatches(None), dispatches(Some(2)), dispatches(None)];
    let second = dispatches(None);
    assert!(first.iter().all(|n| *n > second + 10), "{first:?}, then {second}");
}

#[test]
fn other_settings_keep_what_does_not_depend_on_them() {
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    let first = settings();
    let before = rented.render(&first, 3).layers.beauty();
    let mut changed = settings();
    changed.shadow.rays = 5;
    changed.vpls.count = 700;
    rented.render(&changed, 3);
    changed.method = Method::Direct;
    changed.film.samples = 2;
    rented.render(&changed, 3);
    assert!(rented.render(&first, 3).layers.beauty() == before);
}

/// Settings that take up to fourteen rounds of light paths before any set is known.
fn many_rounds() -> Settings {
    let mut settings = settings();
    (settings.vpls.count, settings.vpls.bounces) = (4000, 64);
    settings
}

/// A lamp in front of the box: the farther, the fewer of its light paths find it.
fn lamp_at(z: f32) -> Vec<Light> {
    let (position, direction) = (Vec3::new(0.0, 1.0, z), Vec3::NEG_Z);
    let (intensity, cos_outer, cos_inner) = (Vec3::splat(z * z), 0.9, 0.95);
    vec![Light::Spot { position, direction, intensity, cos_outer, cos_inner }]
}

impl Rented {
    fn record_with(
        &mut self,
        settings: &Settings,
        seed: u32,
        view: &wgpu::TextureView,
    ) -> wgpu::CommandEncoder {
        let (mut encoder, camera) = (self.encoder(), self.camera.clone());
        let (traced, targets) = (EngineReceivers::Traced, composite(view));
        let renderer = self.renderer();
        let recorded =
            renderer.record_into(&mut encoder, &camera, settings, seed, traced, &targets);
        recorded.expect("frame");
        encoder
    }

    fn rounds(&mut self) -> u32 {
        self.renderer().buffers.as_ref().expect("buffers").rounds()
    }

    /// Whether each of some frames lacked light paths, one after another.
    fn frames(&mut self, settings: &Settings, count: u32, view: &wgpu::TextureView) -> Vec<bool> {
        let frame = |seed| {
            let encoder = self.record_with(settings, seed, view);
            self.submit(encoder)
        };
        (0..count).map(frame).collect()
    }
}

#[test]
fn frames_under_way_that_lack_light_paths_ask_for_them_once() {
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    let (settings, view) = (many_rounds(), rented.target());
    rented.renderer().set_lights(lamp_at(8.0), None).expect("lights");
    rented.frames(&settings, 6, &view);
    let expected = rented.rounds();
    assert!((16..40).contains(&expected), "{expected} rounds");
    rented.renderer().buffers = None;
    rented.renderer().set_lights(vec![lamp()], None).expect("lights");
    let lacked = rented.frames(&settings, 4, &view);
    assert!(!lacked[3] && rented.rounds() < 6, "{lacked:?}, {} rounds", rented.rounds());
    rented.renderer().set_lights(lamp_at(8.0), None).expect("lights");
    let mut lacked = Vec::new();
    for turn in 0..5 {
        let encoders = [0, 1, 2].map(|n| rented.record_with(&settings, 3 * turn + n, &view));
        for encoder in encoders {
            rented.renderer().gpu().queue().submit([encoder.finish()]);
            rented.renderer().gpu().wait().expect("done");
            lacked.push(rented.renderer().after_submit().expect("looked"));
        }
    }
    assert!(lacked[0] && !lacked[14], "{lacked:?}");
    assert_eq!(rented.rounds(), expected, "{lacked:?}");
}

#[test]
fn complete_lights_that_others_have_written_over_are_not_kept() {
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    let (settings, view) = (many_rounds(), rented.target());
    // Room for both lights, and nothing known of either.
    for lights in [vec![lamp()], lamp_at(7.0)] {
        rented.renderer().set_lights(lights, None).expect("lights");
        rented.frames(&settings, 3, &view);
    }
    let expected = read(rented.renderer().gpu(), &view);
    rented.renderer().set_lights(vec![lamp()], None).expect("lights");
    rented.renderer().buffers.as_mut().expect("buffers").forget_rounds();
    let of_the_lamp = rented.record_with(&settings, 1, &view);
    rented.renderer().set_lights(lamp_at(7.0), None).expect("lights");
    let all = rented.record_with(&settings, 2, &view);
    assert!(!rented.submit(of_the_lamp), "three rounds are enough for the lamp");
    let rounds = rented.rounds();
    let some = rented.record_with(&settings, 2, &view);
    assert!(!rented.submit(all), "{rounds} rounds");
    let kept = rented.record_with(&settings, 2, &view);
    assert!(rented.submit(some), "{rounds} rounds are enough");
    assert!(rented.submit(kept), "what it kept is complete");
    for _ in 0..2 {
        let encoder = rented.record_with(&settings, 2, &view);
        assert!(!rented.submit(encoder), "lights are still lacking");
    }
    assert!(read(rented.renderer().gpu(), &view) == expected);
}

#[test]
fn a_few_lights_that_few_paths_find_are_complete() {
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    rented.renderer().set_lights(lamp_at(60.0), None).expect("lights");
    let (mut settings, camera) = (settings(), rented.camera.clone());
    (settings.vpls.count, settings.vpls.bounces, settings.grid.levels) = (20, 1, Some(3));
    // Four rounds for some of them.
    for seed in 30..70 {
        settings.seed = seed;
        let frame = rented.renderer().render(&camera, [4, 4], &settings, &|_, _| ());
        frame.unwrap_or_else(|e| panic!("{seed}: {e}"));
    }
}

#[test]
fn a_picture_of_other_lights_is_that_of_a_new_renderer() {
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    let (settings, camera) = (many_rounds(), rented.camera.clone());
    let mut picture = |lights: Vec<Light>, is_new| {
        rented.renderer().set_lights(lights, None).expect("lights");
        if is_new {
            rented.renderer().buffers = None;
        }
        let frame = rented.renderer().render(&camera, SIZE, &settings, &|_, _| ());
        frame.expect("frame").layers.beauty()
    };
    for z in [7.0, 12.0] {
        let expected = picture(lamp_at(z), true);
        picture(vec![lamp()], true);
        assert!(picture(lamp_at(z), false) == expected, "{z} m");
    }
}
