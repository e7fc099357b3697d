use super::gather::{Gather, GatherInput, GatherOut};
use super::params::{
    BLOCK_PIXELS, BLOCK_SIDE, CHUNK, INDEX_MASK, LEVEL_SHIFT, NEEDS_RAY, PICK_NONE, PICK_NOTHING,
    Pick, TILE_PIXELS, TILES,
};
use super::upload::PackedGrid;
use super::*;
use crate::emitter::Emitters;
use crate::gather::grid::tiles::{Bounds, TileLight, collect, narrow, shells};
use crate::gather::grid::walk::{Row, TileList};
use crate::gather::grid::{DETAIL, LightingGrid, TILE, contribution, reach, sample};
use crate::gpu::testing::{check_kernel, device, device_with};
use crate::gpu::{Feature, Gpu, KernelInfo};
use crate::math::{hash_u32, morton_2d};
use crate::settings::{Settings, ShadowEstimate};
use crate::surface::gpu::GpuReceivers;
use crate::surface::{Receivers, SurfacePoint, ViewFrame};
use crate::vlight::{Vpl, vpl};
use crate::world::World;
use crate::world::gpu::{GpuWorld, SourceLists};
use glam::{Vec2, Vec3};
use std::collections::HashSet;
use std::sync::OnceLock;

#[test]
fn kernels_of_gathering_are_as_declared() {
    let all = alpha::KERNELS.iter().chain(gather::KERNELS);
    all.for_each(|kernel: &&KernelInfo| check_kernel(kernel));
}

const SEED: u32 = 77;

/// A picture's receivers and a hierarchy of lights.
pub(super) struct Case {
    world: World,
    receivers: Receivers,
    grid: LightingGrid,
    pub settings: Settings,
    d_min: f32,
}

impl Case {
    pub fn new(scene: &str, preset: &str, [width, height]: [usize; 2], lights: u32) -> Self {
        let shot = manylight_scene::load(scene).expect("scene");
        let world = World::new(shot.scene).expect("world");
        let emitters = Emitters::new(&world);
        let view = ViewFrame::new(&shot.camera, width, height);
        let receivers = Receivers::trace(&world, &view, Vec2::splat(0.5), true);
        let d_min = (world.diagonal() * 0.01).min(0.15);
        let settings = Settings::preset(preset).expect("preset");
        let set = vpl::trace(&world, &emitters, lights, 3, 3, true);
        let grid = LightingGrid::build(&set.lights, &settings.grid, DETAIL * d_min);
        Self { world, receivers, grid, settings, d_min }
    }

    pub fn small(scene: &str, preset: &str) -> Self {
        let mut case = Self::new(scene, preset, [36, 20], 2500);
        case.settings.grid.evals = 150;
        case
    }

    /// With the alpha that the processor chose: stages are compared from identical inputs.
    pub fn with_alpha(mut self) -> Self {
        self.settings.grid.alpha =
            Some(reach::choose_alpha(&self.grid, &self.receivers, &self.settings));
        self
    }

    fn bounds(&self, [x, y]: [usize; 2], side: usize) -> Option<Bounds> {
        let Receivers { width, height, samples } = &self.receivers;
        if x >= *width || y >= *height {
            return None;
        }
        let rows = y..(y + side).min(*height);
        let row = |y| &samples[y * width + x..y * width + (x + side).min(*width)];
        Bounds::of(rows.flat_map(row).filter_map(|s| s.surface.as_ref()))
    }

    /// Lights that give a receiver something without fused arithmetic.
    fn plain_count(&self, pixel: usize) -> usize {
        let Some(surface) = &self.receivers.samples[pixel].surface else { return 0 };
        let bounds = Bounds::of(std::iter::once(surface)).expect("a receiver");
        let shells = shells(&self.grid, self.settings.grid.alpha.expect("set"));
        let mut list = Vec::new();
        collect(&self.grid, &shells, &self.settings, &bounds, &mut list);
        let is_lit = |light: &&TileLight| {
            let offset = (Vec3::from(light.position) - surface.position).to_array();
            let n = surface.ns.to_array();
            let g = contribution::geometry::<false>(light, offset, n, self.d_min * self.d_min);
            light.blend::<false>(offset) * g > 0.0
        };
        list.iter().filter(is_lit).count()
    }

    /// Corners of all blocks, row by row.
    pub fn blocks(&self) -> Vec<[usize; 2]> {
        let Receivers { width, height, .. } = self.receivers;
        let rows = (0..height).step_by(BLOCK_SIDE);
        rows.flat_map(|y| (0..width).step_by(BLOCK_SIDE).map(move |x| [x, y])).collect()
    }

    fn surface(&self, [x, y]: [usize; 2]) -> Option<&SurfacePoint> {
        let Receivers { width, height, samples } = &self.receivers;
        if x < *width && y < *height { samples[y * width + x].surface.as_ref() } else { None }
    }
}

/// Everything that one gather of one band left on the device.
pub(super) struct Run {
    pub candidates: Vec<u32>,
    masks: Vec<[u32; 2]>,
    picks: Vec<Pick>,
    drawn: Vec<Pick>,
    targets: Vec<[f32; 4]>,
    unshadowed: Vec<[f32; 4]>,
    ratio: Vec<[f32; 2]>,
    reach: Reach,
    pub stats: GatherStats,
    pub capacity: GatherCapacity,
}

/// With enough room.
pub(super) fn run(gpu: &Gpu, case: &Case, mut capacity: GatherCapacity) -> Run {
    loop {
        let run = try_run(gpu, case, capacity);
        match run.capacity.grown(&run.stats) {
            Some(grown) => capacity = grown,
            None => return run,
        }
    }
}

pub(super) fn try_run(gpu: &Gpu, case: &Case, capacity: GatherCapacity) -> Run {
    let receivers = GpuReceivers::upload(gpu, &case.receivers, |_| Vec3::ZERO).expect("receivers");
    let grid = GpuGrid::upload(gpu, &case.grid).expect("grid");
    let world = GpuWorld::new(gpu, &case.world, &SourceLists::default()).expect("world");
    let (width, height, settings) = (receivers.width, receivers.height, &case.settings);
    let gather = Gather::new(gpu, width, height, settings, capacity).expect("gather");
    let out = GatherOut::new(gpu, width, height).expect("output");
    let (d_min, seed) = (case.d_min, SEED);
    let input = GatherInput { receivers: &receivers, grid: &grid, settings, d_min, seed };
    let (mut picks, mut drawn) = (Vec::new(), Vec::new());
    let mut rec = gpu.record(Some(world.group()));
    let params = gather.start(&mut rec, &input, &out);
    for band in gather.bands(&params) {
        gather.record_light(&mut rec, &input, &band, &out);
        for slice in gather.slices(&band) {
            // As in `record`, with a look at what the steps leave in the same memory.
            gather.record_picks(&mut rec, &input, &slice, &out);
            std::mem::replace(&mut rec, gpu.record(Some(world.group()))).submit();
            picks = gpu.read(&gather.picks, usize::MAX).expect("picks");
            gather.record_targets(&mut rec, &input, &slice);
            std::mem::replace(&mut rec, gpu.record(Some(world.group()))).submit();
            drawn = gpu.read(&gather.picks, usize::MAX).expect("picks");
            gather.record_shadows(&mut rec, &input, &slice);
            gather.record_ratio(&mut rec, &input, &slice, &out);
        }
    }
    rec.submit().wait().expect("done");
    Run {
        candidates: gpu.read(&gather.candidates, usize::MAX).expect("candidates"),
        masks: gpu.read(&gather.masks, usize::MAX).expect("masks"),
        picks,
        drawn,
        targets: gpu.read(&gather.targets, usize::MAX).expect("targets"),
        unshadowed: gpu.read(&out.unshadowed, usize::MAX).expect("sums"),
        ratio: gpu.read(&out.ratio, usize::MAX).expect("ratios"),
        reach: gpu.read(&out.reach, 1).expect("reach")[0],
        stats: gpu.read(&out.stats, 1).expect("stats")[0],
        capacity: *gather.capacity(),
    }
}

impl Run {
    /// Level and index of the lights near a block, and for each a bit per tile that it reaches.
    fn list(&self, block: usize, packed: &PackedGrid) -> Vec<((u32, u32), u32)> {
        let list_start = self.capacity.band_blocks as usize + 1;
        let chunks = self.candidates[block] as usize..self.candidates[block + 1] as usize;
        let mut list = Vec::new();
        for chunk in chunks {
            for i in 0..CHUNK {
                let light = self.candidates[list_start + chunk * CHUNK + i];
                let near = |tile: usize| self.masks[chunk * TILES + tile][i / 32] >> (i % 32) & 1;
                if light != u32::MAX {
                    let tiles = (0..TILES).map(|t| near(t) << t).sum();
                    list.push((packed.origin(light), tiles));
                }
            }
        }
        list
    }
}

impl PackedGrid {
    /// Level and index on the processor of a light on the device.
    fn origin(&self, light: u32) -> (u32, u32) {
        let (level, index) = (light >> LEVEL_SHIFT, light & INDEX_MASK);
        if level == 0 { (0, index) } else { (level, self.origins[index as usize]) }
    }
}

/// Level and index, for level 0 among the sorted virtual lights.
fn name(grid: &LightingGrid, light: &TileLight) -> (u32, u32) {
    match light.level {
        0 => (0, grid.level0_lights[light.index as usize]),
        level => (level, light.index),
    }
}

/// Two scenes with two presets each, and what the device made of them.
fn cases(gpu: &Gpu) -> &'static [(Case, Run)] {
    static CASES: OnceLock<Vec<(Case, Run)>> = OnceLock::new();
    let case = |(scene, preset): (&str, &str)| {
        let case = Case::small(scene, preset).with_alpha();
        let run = run(gpu, &case, GatherCapacity::default());
        (case, run)
    };
    let each = [
        ("builtin:cornell", "balanced"),
        ("builtin:atrium", "balanced"),
        ("builtin:cornell", "paper"),
        ("builtin:atrium", "paper"),
    ];
    CASES.get_or_init(|| each.map(case).into())
}

/// The same lists, but for a few lights whose reach ends at the bounds within rounding.
fn assert_same(found: &[(u32, u32)], expected: &[(u32, u32)], at: &str) {
    let in_both = |a: &[(u32, u32)], b: &[(u32, u32)]| -> Vec<(u32, u32)> {
        let b: HashSet<_> = b.iter().copied().collect();
        a.iter().copied().filter(|light| b.contains(light)).collect()
    };
    let (a, b) = (in_both(found, expected), in_both(expected, found));
    assert!(a == b, "another order at {at}");
    let others = found.len() + expected.len() - 2 * a.len();
    assert!(others <= 1 + expected.len() / 1000, "{others} of {} at {at}", expected.len());
}

#[test]
fn lists_are_those_of_the_processor_in_the_same_order() {
    let Some(gpu) = device() else { return };
    for (case, run) in cases(gpu) {
        let packed = PackedGrid::new(&case.grid);
        let shells = shells(&case.grid, case.settings.grid.alpha.expect("set"));
        let (mut wider, mut list) = (Vec::new(), TileList::default());
        for (block, corner) in case.blocks().into_iter().enumerate() {
            let found = run.list(block, &packed);
            let Some(bounds) = case.bounds(corner, BLOCK_SIDE) else {
                assert!(found.is_empty());
                continue;
            };
            collect(&case.grid, &shells, &case.settings, &bounds, &mut wider);
            let expected: Vec<_> = wider.iter().map(|l| name(&case.grid, l)).collect();
            assert!(!expected.is_empty());
            let lights: Vec<_> = found.iter().map(|l| l.0).collect();
            assert_same(&lights, &expected, &format!("block {block}"));
            for tile in 0..TILES {
                let [x, y] = corner;
                let corner = [x + tile % 2 * TILE, y + tile / 2 * TILE];
                let of_tile = found.iter().filter(|l| l.1 >> tile & 1 == 1).map(|l| l.0);
                let of_tile: Vec<_> = of_tile.collect();
                let Some(bounds) = case.bounds(corner, TILE) else {
                    continue;
                };
                narrow(&wider, 0, &shells, &bounds, &mut list);
                let expected: Vec<_> = list.lights().iter().map(|l| name(&case.grid, l)).collect();
                assert_same(&of_tile, &expected, &format!("tile {tile} of block {block}"));
            }
        }
    }
}

#[test]
fn sums_and_ratios_are_those_of_the_processor() {
    let Some(gpu) = device() else { return };
    cases(gpu).iter().for_each(|(case, run)| check_sums(case, run));
}

/// Holds sums, counts and ratios against those of the processor.
pub(super) fn check_sums(case: &Case, run: &Run) {
    let Case { world, receivers, grid, settings, d_min } = case;
    let expected = sample::gather(world, receivers, grid, settings, *d_min, SEED);
    assert!(expected.unshadowed.iter().any(|e| e.max_element() > 0.0));
    let mut same = 0;
    for (i, sum) in expected.unshadowed.iter().enumerate() {
        let [x, y, z, evals] = run.unshadowed[i];
        let error = (Vec3::new(x, y, z) - *sum).abs().max_element();
        assert!(error <= 1e-4 * sum.max_element() + 1e-9, "pixel {i}: {x} {y} {z} for {sum}");
        // Where a cosine is zero within rounding, fused arithmetic counts other lights.
        let near = |count: usize| (evals - count as f32).abs() <= 0.01 * count as f32 + 1.0;
        let is_near = near(expected.evals[i] as usize);
        assert!(is_near || near(case.plain_count(i)), "pixel {i}: {evals} lights");
        let [ratio, trust] = run.ratio[i];
        let [r, t] = [expected.shadow_ratio[i], expected.trust[i]];
        same += usize::from((ratio - r).abs() < 1e-3 && (trust - t).abs() < 1e-3 * t + 1e-6);
    }
    // A draw at a rounding border, or a ray along an edge, changes one pixel.
    let pixels = expected.unshadowed.len();
    assert!(same as f32 >= 0.985 * pixels as f32, "{same} of {pixels} ratios");
}

#[test]
fn picks_and_targets_are_those_of_the_processor() {
    let Some(gpu) = device() else { return };
    for (case, run) in cases(gpu) {
        let packed = PackedGrid::new(&case.grid);
        let mut count = Counts::default();
        for (block, corner) in case.blocks().into_iter().enumerate() {
            for tile in 0..TILES {
                let [x, y] = corner;
                let corner = [x + tile % 2 * TILE, y + tile / 2 * TILE];
                check_tile(case, run, &packed, (block * TILES + tile, corner), &mut count);
            }
        }
        let Counts { all, same, same_targets, targets } = count;
        assert!(all > 1000 && same as f32 >= 0.995 * all as f32, "{same} of {all} picks");
        assert!(same_targets as f32 >= 0.995 * targets as f32, "{same_targets} of {targets}");
    }
}

#[derive(Default)]
struct Counts {
    all: usize,
    same: usize,
    targets: usize,
    same_targets: usize,
}

fn check_tile(
    case: &Case,
    run: &Run,
    packed: &PackedGrid,
    (tile, corner): (usize, [usize; 2]),
    count: &mut Counts,
) {
    let Some(bounds) = case.bounds(corner, TILE) else { return };
    let Settings { shadow, grid, .. } = &case.settings;
    let d_min_sq = case.d_min * case.d_min;
    let shells = shells(&case.grid, grid.alpha.expect("set"));
    let (mut wider, mut list) = (Vec::new(), TileList::default());
    collect(&case.grid, &shells, &case.settings, &bounds, &mut wider);
    wider.iter().for_each(|light| list.push(light));
    for local in 0..TILE_PIXELS {
        let pixel = [corner[0] + local % TILE, corner[1] + local / TILE];
        let Some(surface) = case.surface(pixel) else { continue };
        let mut row = Row::default();
        for axis in 0..3 {
            row.position[axis][0] = surface.position[axis];
            row.normal[axis][0] = surface.ns[axis];
        }
        list.walk(&mut row, d_min_sq);
        let total = list.total_weight(0);
        let receiver = [surface.position.to_array(), surface.ns.to_array()];
        for ray in 0..shadow.rays {
            let place = ray as usize * run.capacity.band_blocks as usize * BLOCK_PIXELS
                + tile * TILE_PIXELS
                + local;
            let pick = run.picks[place];
            let morton = morton_2d(pixel[0] as u32, pixel[1] as u32);
            let index = morton * shadow.rays + ray;
            let [u, v] = sample::draw_numbers(shadow.stratified, SEED, index);
            assert_eq!(pick.light == PICK_NOTHING, total <= 0.0);
            if pick.light == PICK_NOTHING {
                continue;
            }
            let expected = list.draw(u * total, receiver, 0, d_min_sq).expect("a draw");
            count.all += 1;
            if pick.light == PICK_NONE {
                continue;
            }
            let (level, light) = packed.origin(pick.light);
            let expected_index = match expected.level {
                0 => case.grid.level0_lights[expected.index as usize],
                _ => expected.index,
            };
            if (level, light) == (expected.level, expected_index) {
                count.same += 1;
                let error = (pick.geometry - expected.geometry).abs();
                assert!(error <= 1e-4 * expected.geometry, "{error} of {}", expected.geometry);
            }
            let at = (pixel, place, index);
            check_target(case, run, (level, light, pick.geometry), (surface, v), at, count);
        }
    }
}

fn check_target(
    case: &Case,
    run: &Run,
    (level, light, geometry): (u32, u32, f32),
    (surface, v): (&SurfacePoint, f32),
    (pixel, place, index): ([usize; 2], usize, u32),
    count: &mut Counts,
) {
    let grid = &case.grid;
    let drawn = run.drawn[place];
    if !run.targets.is_empty() {
        assert_eq!(drawn.geometry, 1.0);
        let expected = match level {
            0 => grid.lights[light as usize].position,
            _ => {
                let level = &grid.levels[level as usize - 1];
                let key = hash_u32(SEED ^ hash_u32(index));
                sample::cloud_point(&level.lights[light as usize], level.cell_size, key)
            }
        };
        let [x, y, z, _] = run.targets[place];
        let error = (Vec3::new(x, y, z) - expected).abs().max_element();
        assert!(error < 1e-4, "{error} at {pixel:?}");
        return;
    }
    let expected = match level {
        0 => light as usize,
        _ => grid.draw(level as usize, light as usize, v),
    };
    count.targets += 1;
    if (drawn.light & INDEX_MASK) as usize != expected {
        return;
    }
    count.same_targets += 1;
    let vpl = &grid.lights[expected];
    let (p, n) = (surface.position, surface.ns);
    let own = vpl::geometry(vpl.position, vpl.normal, p, n, case.d_min * case.d_min);
    let weight = match case.settings.shadow.estimate {
        ShadowEstimate::Mean => 1.0,
        ShadowEstimate::Weighted => (own / geometry).min(sample::MOST_WEIGHT),
    };
    assert!((drawn.geometry - weight).abs() <= 1e-3 * weight + 1e-6, "{drawn:?} for {weight}");
    let needs_ray = weight > 0.0;
    assert!(needs_ray == (drawn.light & NEEDS_RAY != 0) || weight < 1e-4, "{drawn:?} {weight}");
}

/// Alpha alone, without lists and sums.
pub(super) fn alpha_of(gpu: &Gpu, case: &Case) -> Reach {
    let receivers = GpuReceivers::upload(gpu, &case.receivers, |_| Vec3::ZERO).expect("receivers");
    let grid = GpuGrid::upload(gpu, &case.grid).expect("grid");
    let (width, height, settings) = (receivers.width, receivers.height, &case.settings);
    let gather = Gather::new(gpu, width, height, settings, GatherCapacity::default());
    let out = GatherOut::new(gpu, width, height).expect("output");
    let d_min = case.d_min;
    let input = GatherInput { receivers: &receivers, grid: &grid, settings, d_min, seed: SEED };
    let mut rec = gpu.record(None);
    gather.expect("gather").start(&mut rec, &input, &out);
    rec.submit().wait().expect("done");
    gpu.read(&out.reach, 1).expect("reach")[0]
}

#[test]
fn the_device_chooses_the_same_alpha() {
    let Some(gpu) = device() else { return };
    for scene in ["builtin:cornell", "builtin:atrium"] {
        let case = Case::small(scene, "balanced");
        let expected = reach::choose_alpha(&case.grid, &case.receivers, &case.settings);
        let found = alpha_of(gpu, &case);
        assert!(found.asked == reach::ASKED as u32 && expected != 1.0);
        assert!((found.alpha / expected - 1.0).abs() < 1e-4, "{} for {expected}", found.alpha);
    }
}

/// Bits of everything that a gather gives.
pub(super) fn bits(run: &Run) -> Vec<u32> {
    let sums = run.unshadowed.iter().flatten().chain(run.ratio.iter().flatten());
    sums.map(|v| v.to_bits()).chain([run.reach.alpha.to_bits()]).collect()
}

#[test]
fn subgroups_gather_the_same_bits() {
    let Some(base) = device() else { return };
    let Some(gpu) = device_with(Feature::Subgroups) else { return };
    for (scene, preset) in [("builtin:atrium", "balanced"), ("builtin:cornell", "paper")] {
        // The device chooses alpha, which counts lights in the same way.
        let case = Case::small(scene, preset);
        let [a, b] = [base, &gpu].map(|gpu| run(gpu, &case, GatherCapacity::default()));
        assert_eq!(a.reach.alpha.to_bits(), b.reach.alpha.to_bits(), "{scene}");
        assert!(a.candidates == b.candidates && a.masks == b.masks, "{scene}: lists");
        assert!(bits(&a) == bits(&b), "{scene}: sums and ratios");
    }
}

#[test]
fn degenerate_lights_and_pictures_are_gathered() {
    let Some(gpu) = device() else { return };
    let mut case = Case::new("builtin:cornell", "balanced", [20, 12], 300);
    let lights = std::mem::take(&mut case.grid).lights;
    let one = lights[17];
    let bad = Vpl { position: Vec3::NAN, ..one };
    for (lights, is_lit) in
        [(vec![], false), (vec![one], true), (vec![one; 1500], true), (vec![bad, one, bad], true)]
    {
        case.grid = LightingGrid::build(&lights, &case.settings.grid, DETAIL * case.d_min);
        let found = run(gpu, &case, GatherCapacity::default());
        let expected = sample::gather(
            &case.world,
            &case.receivers,
            &case.grid,
            &case.settings,
            case.d_min,
            SEED,
        );
        assert!(found.unshadowed.iter().any(|s| s[0] > 0.0) == is_lit);
        for (i, sum) in expected.unshadowed.iter().enumerate() {
            let [x, y, z, _] = found.unshadowed[i];
            let error = (Vec3::new(x, y, z) - *sum).abs().max_element();
            assert!(error <= 1e-4 * sum.max_element() + 1e-9, "pixel {i} of {}", lights.len());
            assert!(found.ratio[i].iter().all(|r| r.is_finite()));
            if lights.is_empty() {
                assert_eq!(found.ratio[i], [1.0; 2]);
            }
        }
    }
    case.receivers.samples.iter_mut().for_each(|s| s.surface = None);
    let found = run(gpu, &case, GatherCapacity::default());
    assert!(found.unshadowed.iter().all(|s| *s == [0.0; 4]));
    assert!(found.ratio.iter().all(|r| *r == [1.0; 2]));
    assert!(found.reach.alpha == 1.0 && found.stats.chunks == 0);
}
