//! The lighting grid hierarchy: near lights in detail, far lights as ever coarser grid lights.
//!
//! In: virtual lights, receivers · Out: [`LightingGrid`], [`Gathered`](super::Gathered)
//! Paper: `[LinYuksel19]`, `[YukselYuksel17]`; differs: six lobes per vertex, levels from the
//! moments of the level below, shadow rays to real virtual lights, gathering by tiles; see
//! `docs/methods/grid.md`, `docs/methods/lighting.md`, `docs/methods/shadows.md`
//! Limits: at most 14 levels.

mod build;
mod cells;
mod contribution;
mod draw;
#[cfg(feature = "gpu")]
pub mod gpu;
mod interleave;
mod reach;
mod record;
mod sample;
mod sort;
mod sweep;
mod tiles;
mod walk;

pub use record::{GridLight, Level, LightingGrid};
pub use sample::{TILE, gather};

/// Cell size worth resolving, as a multiple of the distance clamp.
pub const DETAIL: f32 = 3.0;

#[cfg(test)]
mod tests;
