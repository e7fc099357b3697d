//! Comparing virtual lights and their grids.

use super::SetStages;
use super::tally::{StageDifference, Tally, apart, apart_by_axis, colors, most};
use crate::error::Error;
use crate::frame::gpu::{MOST_TRIES, endless};
use crate::gather::grid::LightingGrid;
use crate::gather::grid::gpu::record::{CellRecord, GridLightRecord, OctantsRecord};
use crate::gather::grid::gpu::{GpuGrid, GridBuild, GridCapacity, GridInfo, GridRules, PackedGrid};
use crate::gpu::Gpu;
use crate::settings::GridSettings;
use crate::surface::SurfacePoint;
use crate::vlight::vpl::gpu::{GpuVpls, VplInfo, VplRecord};
use crate::vlight::vpl::{Vpl, VplSet};
use glam::Vec3;
use std::collections::HashMap;

/// Light paths whose way may turn at a border: at the edge of a triangle, or of a choice.
const PATHS_ALLOWED: f64 = 2e-3;
/// Lights of a set among which the partner of one is searched where others have none.
const MOST_SKIPPED: usize = 12;
/// Cells and grid lights that may differ: a light on the face of a cell may lie on either side.
const CELLS_ALLOWED: f64 = 1e-3;

/// Distance from a plane within which a point lies in it, as a share of the scene's diagonal.
const PLANE: f32 = 1e-6;

/// Compares a set of virtual lights; lights are the same where they lie in one place.
pub(super) fn diff_vpls(
    names: &SetStages,
    expected: &VplSet,
    (info, found): (&VplInfo, &[VplRecord]),
    diagonal: f32,
) -> [StageDifference; 4] {
    let scale = f64::from(diagonal.max(f32::MIN_POSITIVE));
    let distance =
        |a: &Vpl, b: &VplRecord| apart_by_axis(a.position, Vec3::from(b.position)) / scale;
    let same = |i: usize, j: usize| distance(&expected.lights[i], &found[j]) <= 1e-5;
    let pairs = pair_up(expected.lights.len(), found.len(), same);
    let lights = || pairs.iter().map(|&(i, j)| (&expected.lights[i], &found[j]));

    let mut paths = Tally::new([names.vpls, "light paths"], (0.0, "paths"));
    let path_counts = [expected.path_count, u64::from(info.path_count)];
    (0..path_counts[0].min(path_counts[1])).for_each(|_| paths.add_same(true));
    paths.add_lone(path_counts[0].abs_diff(path_counts[1]) as usize);

    let mut places = Tally::new([names.vpls, "positions"], (1e-5, "of the diagonal"));
    lights().for_each(|(a, b)| places.add(distance(a, b)));
    places.add_lone(expected.lights.len().max(found.len()) - pairs.len());
    let mut normals = Tally::new([names.vpls, "normals"], (1e-4, ""));
    lights().for_each(|(a, b)| normals.add(apart_by_axis(a.normal, Vec3::from(b.normal))));
    // A path more or less changes the share of all others.
    let share = path_counts[1] as f32 / path_counts[0].max(1) as f32;
    let colors_of = lights().map(|(a, b)| (a.intensity, Vec3::from(b.intensity) * share));
    [
        paths.allow(PATHS_ALLOWED),
        places.allow(PATHS_ALLOWED),
        normals.allow(PATHS_ALLOWED),
        colors([names.vpls, "intensities"], colors_of, 1e-4, PATHS_ALLOWED),
    ]
}

/// Lights of all levels in the plane of a surface, whose cosines at it are zero on both ends but
/// for rounding: walls and tables are full of them.
///
/// Cost: all lights
pub(super) fn in_plane(grid: &LightingGrid, surface: &SurfacePoint, diagonal: f32) -> u32 {
    let most = PLANE * diagonal;
    let is_in = |&(position, normal): &(Vec3, Vec3)| {
        let offset = position - surface.position;
        offset.dot(surface.ns).abs() <= most && offset.dot(normal.normalize_or_zero()).abs() <= most
    };
    let points = grid.lights.iter().map(|vpl| (vpl.position, vpl.normal));
    let means = grid.levels.iter().flat_map(|l| &l.lights).map(|l| (l.position, l.normal));
    points.chain(means).filter(is_in).count() as u32
}

/// Pairs of two lists of about the same items in the same order.
fn pair_up(
    expected: usize,
    found: usize,
    same: impl Fn(usize, usize) -> bool,
) -> Vec<(usize, usize)> {
    let (mut i, mut j, mut pairs) = (0, 0, Vec::new());
    while i < expected && j < found {
        if same(i, j) {
            pairs.push((i, j));
            (i, j) = (i + 1, j + 1);
            continue;
        }
        let ways = (1..=MOST_SKIPPED).flat_map(|n| (0..=n).map(move |skip| (skip, n - skip)));
        let mut ways = ways.filter(|(a, b)| i + a < expected && j + b < found);
        let (a, b) = ways.find(|(a, b)| same(i + a, j + b)).unwrap_or((1, 1));
        (i, j) = (i + a, j + b);
    }
    pairs
}

/// A hierarchy read back.
struct Found {
    info: GridInfo,
    cells: Vec<CellRecord>,
    lights: Vec<GridLightRecord>,
    octants: Vec<OctantsRecord>,
    points: Vec<[f32; 4]>,
}

/// Builds the hierarchy of some lights on the device.
fn build(gpu: &Gpu, lights: &[Vpl], mut rules: GridRules) -> Result<Found, Error> {
    let vpls = GpuVpls::upload(gpu, lights, 1)?;
    let mut capacity = GridCapacity::for_vpls(gpu, lights.len());
    for _ in 0..MOST_TRIES {
        let grid = GpuGrid::new(gpu, &capacity)?;
        let mut rec = gpu.record(None);
        GridBuild::new(gpu, capacity)?.record(&mut rec, &vpls, &rules, &grid);
        rec.submit().wait()?;
        let info = gpu.read(&grid.info, 1)?[0];
        if let Some(grown) = capacity.grown(gpu, &info) {
            capacity = grown;
        } else if let Some(cap) = rules.next_cap(&info) {
            rules.level_cap = cap;
        } else {
            return Ok(Found {
                info,
                cells: gpu.read(&grid.cells, info.cell_count as usize)?,
                lights: gpu.read(&grid.lights, info.light_count as usize)?,
                octants: gpu.read(&grid.octants, info.light_count as usize)?,
                points: gpu.read(&grid.points, info.vpl_count as usize)?,
            });
        }
    }
    Err(endless())
}

/// Compares the hierarchies over the same lights; cells and grid lights are the same by level,
/// place and lobe.
pub(super) fn diff_grid(
    gpu: &Gpu,
    names: &SetStages,
    lights: &[Vpl],
    expected: &LightingGrid,
    (settings, detail): (&GridSettings, f32),
) -> Result<[StageDifference; 5], Error> {
    let found = build(gpu, lights, GridRules::new(settings, detail))?;
    let packed = PackedGrid::new(expected);

    let mut levels = Tally::new([names.grid, "levels"], (0.0, "levels"));
    levels.add(f64::from(packed.info.level_count.abs_diff(found.info.level_count)));
    let mut vpls = Tally::new([names.grid, "order of the lights"], (1e-4, "of a cell"));
    for (a, b) in packed.points.iter().zip(&found.points) {
        vpls.add(most((0..3).map(|axis| apart(a[axis], b[axis]))));
    }
    vpls.add_lone(packed.points.len().abs_diff(found.points.len()));
    let [cells, shares] = diff_cells(names, &packed, &found);
    let lights = diff_grid_lights(names, expected, &packed, &found);
    Ok([levels.allow(0.0), vpls.allow(CELLS_ALLOWED), cells, shares, lights])
}

/// Records of a level by their place and lobe.
fn by_place(
    info: &GridInfo,
    level: usize,
    is_cell: bool,
    place: impl Fn(usize) -> [u32; 2],
) -> HashMap<[u32; 2], usize> {
    let at = &info.levels[level];
    let (first, count) = match is_cell {
        true => (at.first_cell, at.cell_count),
        false => (at.first_light, at.light_count),
    };
    (first as usize..(first + count) as usize).map(|i| (place(i), i)).collect()
}

/// Cells by the number of virtual lights in each, and what they share to their corners.
fn diff_cells(names: &SetStages, packed: &PackedGrid, found: &Found) -> [StageDifference; 2] {
    let mut cells = Tally::new([names.grid, "cells"], (0.0, "lights"));
    let mut shares = Tally::new([names.grid, "shares of cells"], (1e-4, "of the sum"));
    let place = |cell: &CellRecord| [cell.cell_xy, cell.cell_z_lobe];
    // The cell after the last of a level is a sentinel.
    let count = |cells: &[CellRecord], i: usize| cells[i + 1].light - cells[i].light;
    for level in 1..=packed.info.level_count as usize {
        let others = by_place(&found.info, level, true, |i| place(&found.cells[i]));
        let own = by_place(&packed.info, level, true, |i| place(&packed.cells[i]));
        cells.add_lone(others.keys().filter(|place| !own.contains_key(*place)).count());
        for (place, i) in own {
            let Some(&j) = others.get(&place) else {
                cells.add_lone(1);
                continue;
            };
            let (a, b) = (&packed.cells[i], &found.cells[j]);
            let counts = [count(&packed.cells, i), count(&found.cells, j)];
            cells.add(f64::from(counts[0].abs_diff(counts[1])));
            // In level 1 these are no octants.
            let sum = a.share.iter().map(|&s| f64::from(s)).sum::<f64>().max(1e-30);
            shares.add(most((0..8).map(|c| apart(a.share[c], b.share[c]))) / sum);
        }
    }
    [cells.allow(CELLS_ALLOWED), shares.allow(CELLS_ALLOWED)]
}

/// Grid lights by everything in them.
fn diff_grid_lights(
    names: &SetStages,
    expected: &LightingGrid,
    packed: &PackedGrid,
    found: &Found,
) -> StageDifference {
    let mut lights = Tally::new([names.grid, "grid lights"], (1e-4, "of their scale"));
    let place = |light: &GridLightRecord| [light.vertex_xy, light.vertex_z_lobe];
    for level in 1..=packed.info.level_count as usize {
        let others = by_place(&found.info, level, false, |i| place(&found.lights[i]));
        let own = by_place(&packed.info, level, false, |i| place(&packed.lights[i]));
        let edge = f64::from(expected.levels[level - 1].cell_size);
        let sum: f64 = own.values().map(|&i| f64::from(packed.lights[i].luminance)).sum();
        let mean = sum / own.len().max(1) as f64;
        lights.add_lone(others.keys().filter(|place| !own.contains_key(*place)).count());
        for (place, i) in own {
            let Some(&j) = others.get(&place) else {
                lights.add_lone(1);
                continue;
            };
            // The share of a light near the other end of its cell loses its digits.
            let scale = (f64::from(packed.lights[i].luminance)).max(0.01 * mean).max(1e-30);
            let octants = (0..8)
                .map(|o| apart(packed.octants[i].luminance[o], found.octants[j].luminance[o]));
            let own = difference(&packed.lights[i], &found.lights[j], edge, scale);
            lights.add(own.max(most(octants) / scale));
        }
    }
    lights.allow(CELLS_ALLOWED)
}

/// Largest difference of two grid lights, each part by its own scale. Where one has next to nothing
/// of the lights around it, as beside a wall that lies in a plane of the lattice, nobody knows the
/// place of that: means count by what they stand for.
fn difference(a: &GridLightRecord, b: &GridLightRecord, edge: f64, luminance: f64) -> f64 {
    let vector = |a: [f32; 3], b: [f32; 3]| apart_by_axis(a.into(), b.into());
    let weight = f64::from(a.luminance) / luminance;
    most(
        [
            vector(a.position, b.position) / edge * weight,
            vector(a.normal, b.normal) * weight,
            vector(a.variance, b.variance) / (edge * edge) * weight,
            vector(a.intensity, b.intensity) / luminance,
            apart(a.luminance, b.luminance) / luminance,
        ]
        .into_iter(),
    )
}
