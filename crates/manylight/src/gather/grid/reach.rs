//! The alpha at which a receiver evaluates as many lights as asked.
//!
//! The same alpha costs twice as many lights in a cluttered hall as in an empty box. Given the
//! cost, each scene gets the least error it can have for it.

use super::record::LightingGrid;
use super::tiles::{Bounds, collect, shells};
use super::walk::{Row, TileList};
use crate::settings::Settings;
use crate::surface::{Receivers, SurfacePoint};
use rayon::prelude::*;

/// Receivers asked for their number of lights.
pub(super) const ASKED: usize = 128;
/// Most corrections of alpha, and how near the number must be to end them.
pub(super) const STEPS: u32 = 6;
/// Values of alpha between one and its double: finer ones would follow roundings of the number of
/// lights, which differ from one processor or graphics device to the next.
pub(super) const PER_DOUBLING: f32 = 32.0;
/// Least and most alpha that is chosen.
pub(super) const ALPHAS: [f32; 2] = [0.5, 4.0];
/// Number of lights ∝ alpha to this power, about: between surfaces (2) and the levels' sum (1).
pub(super) const GROWTH: f32 = 1.6;

/// Where the i-th of the receivers that are asked lies among all, 0…1: the golden ratio spreads
/// them over rows and columns alike, at any width of the picture.
pub(super) fn asked_share(i: usize) -> f64 {
    (i as f64 * 0.618_033_988_749_894_9).fract()
}

/// Alpha of a gather: as set, or such that the receivers evaluate about `grid.evals` lights each.
///
/// Shapes: receivers `[h·w]` · Cost: 128 receivers, each searching the grid up to six times
pub(super) fn choose_alpha(grid: &LightingGrid, receivers: &Receivers, settings: &Settings) -> f32 {
    if let Some(alpha) = settings.grid.alpha {
        return alpha;
    }
    let surfaces: Vec<&SurfacePoint> =
        receivers.samples.iter().filter_map(|s| s.surface.as_ref()).collect();
    let pick = |i: usize| asked_share(i) * surfaces.len() as f64;
    let asked: Vec<&SurfacePoint> =
        (0..ASKED).filter_map(|i| surfaces.get(pick(i) as usize).copied()).collect();
    let mut alpha = 1.0;
    if grid.levels.is_empty() || asked.is_empty() {
        return alpha;
    }
    for _ in 0..STEPS {
        let evals: usize =
            asked.par_iter().map(|surface| count(grid, surface, alpha, settings)).sum();
        let wanted = settings.grid.evals as f32 * asked.len() as f32 / evals.max(1) as f32;
        let corrected = (alpha * wanted.powf(1.0 / GROWTH)).clamp(ALPHAS[0], ALPHAS[1]);
        let step = (corrected.log2() * PER_DOUBLING).round();
        if step == (alpha.log2() * PER_DOUBLING).round() {
            break;
        }
        alpha = (step / PER_DOUBLING).exp2();
    }
    alpha
}

/// Lights that give one receiver something.
pub(super) fn count(
    grid: &LightingGrid,
    surface: &SurfacePoint,
    alpha: f32,
    settings: &Settings,
) -> usize {
    let Some(bounds) = Bounds::of(std::iter::once(surface)) else { return 0 };
    let mut near = Vec::new();
    collect(grid, &shells(grid, alpha), settings, &bounds, &mut near);
    let mut list = TileList::default();
    near.iter().for_each(|light| list.push(light));
    let mut row = Row::default();
    for axis in 0..3 {
        row.position[axis][0] = surface.position[axis];
        row.normal[axis][0] = surface.ns[axis];
    }
    list.walk(&mut row, 0.0);
    row.evals[0] as usize
}
