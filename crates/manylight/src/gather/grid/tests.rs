use super::*;
use crate::math::{Sequence, luminance, uniform_sphere};
use crate::settings::GridSettings;
use crate::surface::SurfacePoint;
use crate::vlight::Vpl;
use glam::{DVec3, Vec3};

/// Lights on a bumpy sphere, with a dense patch and very different intensities.
fn lights(count: u32) -> Vec<Vpl> {
    (0..count)
        .map(|i| {
            let mut s = Sequence::new(17, i);
            let normal = uniform_sphere(s.next_2d());
            let spread = if i % 3 == 0 { 0.05 } else { 1.0 };
            let intensity = Vec3::new(0.2, 1.0, 0.5) * (0.01 + s.next_1d().powi(4) * 10.0);
            let position = Vec3::new(3.0, -2.0, 8.0) + normal * (4.0 * spread + s.next_1d() * 0.2);
            Vpl { position, normal: -normal, intensity }
        })
        .collect()
}

fn grid_of(count: u32, lobes: u32) -> LightingGrid {
    LightingGrid::build(&lights(count), &GridSettings { lobes, ..Default::default() }, 0.1)
}

#[test]
fn intensity_is_conserved_by_every_level() {
    for lobes in [1, 6] {
        let grid = grid_of(20_000, lobes);
        let expected: DVec3 = lights(20_000).iter().map(|l| l.intensity.as_dvec3()).sum();
        assert!(grid.levels.len() > 4);
        for (i, level) in grid.levels.iter().enumerate() {
            let sum: DVec3 = level.lights.iter().map(|l| l.intensity.as_dvec3()).sum();
            let error = ((sum - expected) / expected).abs().max_element();
            assert!(error < 1e-5, "level {} of {lobes} lobes: {error}", i + 1);
        }
        let top = grid.levels.last().expect("levels");
        assert!(top.lights.len() <= 8 * lobes as usize);
    }
}

#[test]
fn moments_of_every_level_are_those_of_the_lights() {
    let lights = lights(5000);
    let grid = LightingGrid::build(&lights, &GridSettings::default(), 0.1);
    let mass: f64 = lights.iter().map(|l| f64::from(luminance(l.intensity))).sum();
    let weighted = |f: &dyn Fn(&Vpl) -> Vec3| -> DVec3 {
        let each = |l: &Vpl| f(l).as_dvec3() * f64::from(luminance(l.intensity)) / mass;
        lights.iter().map(each).sum()
    };
    let (mean, normal) = (weighted(&|l| l.position), weighted(&|l| l.normal));
    let second = weighted(&|l| l.position * l.position);
    for level in &grid.levels {
        let sum = |f: &dyn Fn(&GridLight) -> Vec3| -> DVec3 {
            let each = |l: &GridLight| f(l).as_dvec3() * f64::from(l.luminance) / mass;
            level.lights.iter().map(each).sum()
        };
        assert!((sum(&|l| l.position) - mean).length() < 1e-4);
        assert!((sum(&|l| l.normal) - normal).length() < 1e-4);
        // Variance within plus spread of the means is the whole second moment.
        assert!((sum(&|l| l.variance + l.position * l.position) - second).length() < 1e-2);
    }
}

#[test]
fn points_drawn_from_the_spread_of_a_wall_lie_on_it() {
    for (axis, place) in [(0, -3.7123), (1, 0.1), (2, 11.31)] {
        let on_wall = |mut light: Vpl| {
            light.position[axis] = place;
            light
        };
        let lights: Vec<Vpl> = lights(20_000).into_iter().map(on_wall).collect();
        let grid = LightingGrid::build(&lights, &GridSettings::default(), 0.1);
        let mut apart = 0.0f32;
        for level in &grid.levels {
            for (light, key) in level.lights.iter().zip(0..) {
                let offset = sample::cloud_point(light, level.cell_size, key) - light.position;
                assert_eq!(offset[axis], 0.0, "{light:?}");
                apart = apart.max(offset.length() / level.cell_size);
            }
        }
        assert!(apart > 0.5, "points all at the mean");
    }
}

#[test]
fn octants_add_up_to_the_light() {
    let grid = grid_of(8000, 6);
    for level in &grid.levels {
        for (light, octants) in level.lights.iter().zip(&level.octants) {
            let sum: f32 = octants.luminance.iter().sum();
            assert!((sum / light.luminance - 1.0).abs() < 1e-4);
        }
    }
}

/// Share of a virtual light at a vertex, from the definition.
fn share(grid: &LightingGrid, level: usize, light: &GridLight, vpl: &Vpl) -> f64 {
    let cell = grid.levels[level - 1].cell_size;
    let axis = vpl.normal.abs().max_position();
    let lobe = 2 * axis as u8 + u8::from(vpl.normal[axis] < 0.0);
    if lobe != light.lobe {
        return 0.0;
    }
    let vertex = Vec3::from(light.vertex.map(f32::from));
    let hat = (1.0 - ((vpl.position - grid.origin) / cell - vertex).abs()).max(Vec3::ZERO);
    f64::from(luminance(vpl.intensity) * hat.element_product())
}

/// Holds the draws of a grid light against the shares of all virtual lights.
fn check_draws(grid: &LightingGrid, level: usize, index: usize) {
    const DRAWS: u32 = 40_000;
    let light = &grid.levels[level - 1].lights[index];
    let shares: Vec<f64> = grid.lights.iter().map(|v| share(grid, level, light, v)).collect();
    let total: f64 = shares.iter().sum();
    assert!((total / f64::from(light.luminance) - 1.0).abs() < 1e-3, "level {level}");
    let mut counts = vec![0u32; shares.len()];
    for i in 0..DRAWS {
        // Stratified: every light's count is within a few of its expectation.
        counts[grid.draw(level, index, (i as f32 + 0.5) / DRAWS as f32)] += 1;
    }
    let (mut chi_sq, mut bins) = (0.0, 0);
    for (count, share) in counts.iter().zip(&shares) {
        let expected = share / total * f64::from(DRAWS);
        assert!((f64::from(*count) - expected).abs() < 12.0, "{count} for {expected}");
        if expected >= 5.0 {
            chi_sq += (f64::from(*count) - expected).powi(2) / expected;
            bins += 1;
        }
    }
    assert!(bins > 3 && chi_sq < f64::from(bins), "level {level}: χ² {chi_sq} of {bins}");
}

#[test]
fn draws_follow_the_shares_exactly() {
    let grid = grid_of(6000, 6);
    for level in [1, 3, grid.levels.len()] {
        let lights = grid.levels[level - 1].lights.iter().enumerate();
        let brightest = lights.max_by(|a, b| a.1.luminance.total_cmp(&b.1.luminance));
        check_draws(&grid, level, brightest.expect("lights").0);
    }
}

/// A crowd of faint lights in one of the finest cells, far from the corner of the cube and behind
/// many bright ones: no sum over all lights has digits left for it.
#[test]
fn draws_hold_in_the_finest_cells() {
    const CROWD: u32 = 400;
    let light = |i: u32| {
        let mut s = Sequence::new(5, i);
        let [x, y] = s.next_2d();
        let p = Vec3::new(x, y, s.next_1d());
        let (position, intensity) = match i {
            0 => (Vec3::ZERO, 1.0),
            1..=CROWD => (Vec3::splat(8190.9) + 0.8 * p, 1e-5 * (0.1 + s.next_1d())),
            _ => (Vec3::splat(7000.0) + 1000.0 * p, 1.0),
        };
        Vpl { position, normal: Vec3::Y, intensity: Vec3::splat(intensity) }
    };
    // The finest cells are 1.0001 m wide.
    let far = Vpl { position: Vec3::X * 8192.0, ..light(0) };
    let lights: Vec<Vpl> = (0..20_000).map(light).chain([far]).collect();
    let settings = GridSettings { levels: Some(14), ..Default::default() };
    let grid = LightingGrid::build(&lights, &settings, 0.1);
    let mut crowded = 0;
    for (level, at) in grid.levels.iter().enumerate().take(4) {
        for (index, light) in at.lights.iter().enumerate() {
            let only_crowd = light.luminance > 1e-5 && light.luminance < 0.1;
            if only_crowd && light.position.min_element() > 8189.0 {
                check_draws(&grid, level + 1, index);
                crowded += 1;
            }
        }
    }
    assert!(crowded >= 8, "{crowded} vertices of the crowd");
}

#[test]
fn blending_is_a_partition_of_unity_with_the_stated_shells() {
    for start_level in [0, 1] {
        let settings = GridSettings { start_level, ..Default::default() };
        let grid = LightingGrid::build(&lights(4000), &settings, 0.1);
        let shells = tiles::shells(&grid, 1.25);
        assert_eq!(shells.len(), grid.levels.len() + usize::from(start_level == 0));
        for i in 0..4000 {
            let d = i as f32 * 0.01;
            let sum: f32 = shells.iter().map(|s| s.point().blend::<false>([0.0, d, 0.0])).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{sum} at {d}");
        }
    }
    // Level 2 rises from r/2 to r and falls to zero at 2r.
    let settings = GridSettings { start_level: 1, ..Default::default() };
    let grid = LightingGrid::build(&lights(4000), &settings, 0.1);
    let shells = tiles::shells(&grid, 2.0);
    let r = 2.0 * grid.levels[1].cell_size;
    let expected = [(0.5, 0.0), (0.75, 0.5), (1.0, 1.0), (1.5, 0.5), (2.0, 0.0), (3.0, 0.0)];
    for (x, y) in expected {
        let blend = shells[1].point().blend::<false>([x * r, 0.0, 0.0]);
        assert!((blend - y).abs() < 1e-5, "{x}");
    }
}

#[test]
fn alpha_gives_the_number_of_lights_asked_for() {
    use crate::surface::{PixelSample, Receivers};
    let mut settings = crate::settings::Settings::default();
    let grid = LightingGrid::build(&lights(20_000), &settings.grid, 0.1);
    // A wall of receivers through the lights: what a column sees depends on the column.
    let picture = |width: usize, height: usize| {
        let sample = |i: usize| {
            let (u, v) = ((i % width) as f32 / width as f32, (i / width) as f32 / height as f32);
            let surface = SurfacePoint {
                position: Vec3::new(3.0, -2.0, 8.0) + Vec3::new(5.0 * u, 6.0 * v - 3.0, 0.0),
                ng: Vec3::Z,
                ns: Vec3::Z,
                albedo: Vec3::ONE,
                emission: Vec3::ZERO,
                unlit: false,
            };
            PixelSample { surface: Some(surface), depth: 1.0, direction: Vec3::Z }
        };
        Receivers { width, height, samples: (0..width * height).map(sample).collect() }
    };
    for evals in [150, 400] {
        settings.grid.evals = evals;
        let alphas = [[64, 64], [200, 90], [512, 128]]
            .map(|[w, h]| reach::choose_alpha(&grid, &picture(w, h), &settings));
        assert!(alphas.iter().all(|a| (a / alphas[0] - 1.0).abs() < 0.1), "{alphas:?}");
        let receivers = picture(64, 64);
        let counts = receivers.samples.iter().filter_map(|s| s.surface.as_ref());
        let mean = counts.map(|s| reach::count(&grid, s, alphas[0], &settings)).sum::<usize>()
            as f32
            / 4096.0;
        assert!((mean / evals as f32 - 1.0).abs() < 0.1, "{mean} of {evals}");
    }
    settings.grid.alpha = Some(1.25);
    assert_eq!(reach::choose_alpha(&grid, &picture(8, 8), &settings), 1.25);
}

/// Blending by the distance of mean positions counts near lights too often.
#[test]
fn a_spread_that_shortens_the_distance_brings_the_sum_nearer_to_the_truth() {
    let floor: Vec<Vpl> = (0..20_000)
        .map(|i| {
            let [x, z] = Sequence::new(41, i).next_2d();
            Vpl { position: Vec3::new(x, 0.0, z), normal: Vec3::Y, intensity: Vec3::ONE }
        })
        .collect();
    let settings = crate::settings::Settings::default();
    let grid = LightingGrid::build(&floor, &settings.grid, 0.01);
    let shells = tiles::shells(&grid, 1.2);
    let (mut sum, mut plain, mut truth) = (0.0, 0.0, 0.0);
    for i in 0..60 {
        let mut s = Sequence::new(43, i);
        let [x, z] = s.next_2d();
        let position = Vec3::new(x, 0.05 + 0.45 * s.next_1d(), z);
        let ns = uniform_sphere(s.next_2d());
        let ns = Vec3::new(ns.x, -ns.y.abs(), ns.z);
        let (albedo, emission) = (Vec3::ONE, Vec3::ZERO);
        let surface = SurfacePoint { position, ng: ns, ns, albedo, emission, unlit: false };
        let bounds = tiles::Bounds::of(std::iter::once(&surface)).expect("a receiver");
        let mut list = Vec::new();
        tiles::collect(&grid, &shells, &settings, &bounds, &mut list);
        for light in list {
            let offset = (Vec3::from(light.position) - position).to_array();
            let term = contribution::geometry::<false>(&light, offset, ns.to_array(), 1e-4);
            let term = f64::from(term * light.intensity[1]);
            sum += term * f64::from(light.blend::<false>(offset));
            let light = tiles::TileLight { nearer: 0.0, ..light };
            plain += term * f64::from(light.blend::<false>(offset));
        }
        let term = |l: &Vpl| crate::vlight::vpl::geometry(l.position, l.normal, position, ns, 1e-4);
        truth += floor.iter().map(|l| f64::from(term(l))).sum::<f64>();
    }
    let (error, plain_error) = (sum / truth - 1.0, plain / truth - 1.0);
    assert!(error.abs() < 0.5 * plain_error && plain_error > 0.03, "{error} {plain_error}");
}

#[test]
fn degenerate_sets_build() {
    let settings = GridSettings::default();
    assert!(LightingGrid::build(&[], &settings, 0.1).levels.is_empty());
    let one = lights(1);
    let grid = LightingGrid::build(&one, &settings, 0.1);
    assert!(
        (grid.levels[0].lights.iter().map(|l| l.luminance).sum::<f32>()
            - luminance(one[0].intensity))
        .abs()
            < 1e-6
    );
    let same = vec![one[0]; 5000];
    assert!(LightingGrid::build(&same, &settings, 0.1).light_count() > 0);
    let bad = Vpl { position: Vec3::NAN, ..one[0] };
    let dark = Vpl { intensity: Vec3::ZERO, ..one[0] };
    assert_eq!(LightingGrid::build(&[bad, dark, one[0]], &settings, 0.1).lights.len(), 1);
    for levels in [2, 14] {
        let settings = GridSettings { levels: Some(levels), ..Default::default() };
        assert_eq!(LightingGrid::build(&lights(50), &settings, 0.1).levels.len(), levels as usize);
    }
}

#[test]
fn culling_drops_no_light_that_gives_something() {
    culling_drops_nothing_from(0);
    culling_drops_nothing_from(1);
}

fn culling_drops_nothing_from(start_level: u32) {
    let mut settings = crate::settings::Settings::default();
    settings.grid.start_level = start_level;
    let grid = LightingGrid::build(&lights(6000), &settings.grid, 0.1);
    let shells = tiles::shells(&grid, 1.1);
    let surface = |position: Vec3, ns: Vec3| SurfacePoint {
        position,
        ng: ns,
        ns,
        albedo: Vec3::ONE,
        emission: Vec3::ZERO,
        unlit: false,
    };
    let bounds = |s: &[SurfacePoint]| tiles::Bounds::of(s.iter()).expect("receivers");
    let (mut all, mut wider, mut list) = (Vec::new(), Vec::new(), walk::TileList::default());
    let everywhere = [surface(Vec3::splat(-1e4), -Vec3::ONE), surface(Vec3::splat(1e4), Vec3::ONE)];
    tiles::collect(&grid, &shells, &settings, &bounds(&everywhere), &mut all);
    let vpls = if start_level == 0 { grid.lights.len() } else { 0 };
    assert_eq!(all.len(), grid.light_count() + vpls);
    let sum = |list: &[tiles::TileLight], s: &SurfacePoint| -> (f64, usize) {
        let term = |light: &tiles::TileLight| {
            let offset = (Vec3::from(light.position) - s.position).to_array();
            light.blend::<false>(offset)
                * contribution::geometry::<false>(light, offset, s.ns.to_array(), 0.01)
        };
        let terms: Vec<f32> = list.iter().map(term).filter(|t| *t > 0.0).collect();
        (terms.iter().map(|&t| f64::from(t)).sum(), terms.len())
    };
    let mut kept = 0;
    for block in 0..40 {
        // Patches of receivers of growing size, bent a little, near and far from the lights.
        let mut s = Sequence::new(31, block);
        let (center, n) = (uniform_sphere(s.next_2d()) * 6.0 * s.next_1d(), s.next_2d());
        let normal = uniform_sphere(n);
        // Every fourth at a grid light's mean, where the first level is nearest.
        let first = &grid.levels[0].lights;
        let mean = first[block as usize * first.len() / 40].position;
        let (center, size) = match block % 4 {
            0 => (mean, 1e-4),
            _ => (Vec3::new(3.0, -2.0, 8.0) + center, 0.02 * (1 + block) as f32),
        };
        let receivers: Vec<SurfacePoint> = (0..16)
            .map(|_| {
                let bent = (normal + uniform_sphere(s.next_2d()) * 0.2).normalize();
                surface(center + uniform_sphere(s.next_2d()) * size, bent)
            })
            .collect();
        tiles::collect(&grid, &shells, &settings, &bounds(&receivers), &mut wider);
        for tile in receivers.chunks(4) {
            tiles::narrow(&wider, 0, &shells, &bounds(tile), &mut list);
            let list = list.lights();
            kept += list.len();
            tile.iter().for_each(|s| assert_eq!(sum(&list, s), sum(&all, s)));
        }
    }
    assert!(kept < all.len() * 160 / 4, "{kept} of {}", all.len() * 160);
}
