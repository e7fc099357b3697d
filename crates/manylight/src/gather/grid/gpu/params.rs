//! What the kernels of a gather share: constants, uniforms and records.

use crate::gather::grid::{TILE, contribution, draw, interleave, reach, sample, tiles};
use crate::gpu::{Constant, Value, record};
use crate::settings::{Settings, ShadowEstimate};

/// Tiles per side of a block, whose receivers share one search of the grid. Larger ones search less
/// often and find more that reaches none of their tiles.
const BLOCK_TILES: usize = 2;
/// Receivers of a tile.
pub(super) const TILE_PIXELS: usize = TILE * TILE;
/// Tiles of a block.
pub(super) const TILES: usize = BLOCK_TILES * BLOCK_TILES;
/// Receivers of a block, and along its side.
pub(super) const BLOCK_PIXELS: usize = TILES * TILE_PIXELS;
pub(super) const BLOCK_SIDE: usize = BLOCK_TILES * TILE;
/// Lights that a tile takes up at once, one per invocation.
pub(super) const CHUNK: usize = TILE_PIXELS;
/// Invocations that go down the hierarchy together.
pub(super) const SEARCH_GROUP: u32 = 128;
/// Pixels that are counted together.
pub(super) const RUN: u32 = 256;

/// A light is its level above its index.
pub(super) const LEVEL_SHIFT: u32 = 28;
pub(super) const INDEX_MASK: u32 = (1 << LEVEL_SHIFT) - 1;
const NO_LIGHT: u32 = u32::MAX;
/// Nothing can be drawn at a receiver.
pub(super) const PICK_NOTHING: u32 = u32::MAX;
/// Nothing was drawn.
pub(super) const PICK_NONE: u32 = u32::MAX - 1;
/// Bits of a drawn virtual light: its visibility counts; it is seen.
pub(super) const NEEDS_RAY: u32 = 1 << 31;
pub(super) const IS_SEEN: u32 = 1 << 30;

/// Bits of [`GatherParams::flags`].
const SPREAD: u32 = 1;
const STRATIFIED: u32 = 2;
const WEIGHTED: u32 = 4;

const fn u(name: &'static str, value: u32) -> Constant {
    Constant { name, value: Value::U32(value) }
}

const fn f(name: &'static str, value: f32) -> Constant {
    Constant { name, value: Value::F32(value) }
}

/// Constants of a gather's shaders.
pub(super) const CONSTANTS: &[Constant] = &[
    u("TILE", TILE as u32),
    u("BLOCK_TILES", BLOCK_TILES as u32),
    u("CHUNK", CHUNK as u32),
    u("RUN", RUN),
    u("MAX_GROUPS", crate::gpu::MAX_GROUPS),
    u("LEVEL_SHIFT", LEVEL_SHIFT),
    u("INDEX_MASK", INDEX_MASK),
    u("NO_LIGHT", NO_LIGHT),
    u("PICK_NOTHING", PICK_NOTHING),
    u("PICK_NONE", PICK_NONE),
    u("NEEDS_RAY", NEEDS_RAY),
    u("IS_SEEN", IS_SEEN),
    u("SPREAD", SPREAD),
    u("STRATIFIED", STRATIFIED),
    u("WEIGHTED", WEIGHTED),
    u("BLOCK", super::record::BLOCK as u32),
    u("SUPERBLOCK", super::record::SUPERBLOCK as u32),
    u("MOST_SCANNED", draw::MOST_SCANNED as u32),
    u("EVERY", interleave::EVERY),
    u("FIRST_LEVEL", interleave::FIRST_LEVEL),
    u("ASKED", reach::ASKED as u32),
    f("NEARER", tiles::NEARER),
    f("MOST_VARIANCE", tiles::MOST_VARIANCE),
    f("FAR", contribution::FAR),
    f("NEAREST_SHARE", contribution::NEAREST_SQ[0]),
    f("NEAREST_SQ", contribution::NEAREST_SQ[1]),
    f("NO_SPREAD", contribution::NO_SPREAD),
    f("REACH_PULL", contribution::REACH_PULL),
    f("REACH_SPREAD", contribution::REACH_SPREAD),
    f("MOST_WEIGHT", sample::MOST_WEIGHT),
    f("FLAT", sample::FLAT),
    f("PER_DOUBLING", reach::PER_DOUBLING),
    f("LEAST_ALPHA", reach::ALPHAS[0]),
    f("MOST_ALPHA", reach::ALPHAS[1]),
    f("GROWTH", reach::GROWTH),
];

record! {
    /// What a gather's kernels know of a band of blocks and a slice of its rays.
    pub(super) struct GatherParams {
        /// Pixels across.
        pub width: u32,
        /// Pixels down.
        pub height: u32,
        /// Blocks across.
        pub blocks_x: u32,
        /// First block of the band, row by row over the picture.
        pub first_block: u32,
        /// Blocks of the band.
        pub block_count: u32,
        /// Cells that each side of a block's frontier has room for.
        pub frontier_capacity: u32,
        /// Chunks that the band has room for.
        pub chunk_capacity: u32,
        /// Where the first chunk begins in the list of candidates, behind the blocks' places.
        pub list_start: u32,
        /// Shadow rays of a receiver.
        pub rays: u32,
        /// First ray of the slice.
        pub first_ray: u32,
        /// Rays of the slice.
        pub slice_rays: u32,
        /// `SPREAD`, `STRATIFIED`, `WEIGHTED`.
        pub flags: u32,
        /// Lowest level whose lights are drawn for shadows.
        pub shadow_start_level: u32,
        /// Chooses the draws.
        pub seed: u32,
        /// Squared distance clamp, m².
        pub d_min_sq: f32,
        /// Whether the search writes its candidates, or counts and keeps them.
        pub is_writing: u32,
        /// Pixels from one receiver of a tile to the next, and classes of lights across and down.
        pub side: u32,
        /// Added to the class of every tile.
        pub first_class: u32,
        /// Where the first search keeps what it found, behind the frontiers.
        pub kept_start: u32,
        /// Lights that it keeps room for in each block.
        pub kept_capacity: u32,
    }
}

impl GatherParams {
    /// Those of a gather, without its picture, bands and slices.
    pub fn new(settings: &Settings, d_min: f32, seed: u32) -> Self {
        let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
        let shadow = &settings.shadow;
        let is_weighted = shadow.estimate == ShadowEstimate::Weighted;
        Self {
            rays: shadow.rays,
            flags: flag(settings.grid.spread, SPREAD)
                | flag(shadow.stratified, STRATIFIED)
                | flag(is_weighted, WEIGHTED),
            shadow_start_level: shadow.start_level,
            seed,
            d_min_sq: d_min * d_min,
            side: settings.interleave,
            first_class: seed % (settings.interleave * settings.interleave),
            ..Self::default()
        }
    }
}

record! {
    /// How far the levels reach, as the device chose it.
    pub struct Reach {
        /// r_l = alpha · h_l.
        pub alpha: f32,
        /// 1 where it needs no more corrections.
        pub is_done: u32,
        /// Receivers that were asked for their number of lights.
        pub asked: u32,
        /// Nothing.
        pub _pad: u32,
    }
}

record! {
    /// What a gather would have needed; where that is more than there was room for, lights or
    /// shadows are missing.
    pub struct GatherStats {
        /// Most cells of one level that one block looked into.
        pub frontier: u32,
        /// Most chunks of a band.
        pub chunks: u32,
    }
}

record! {
    /// A light that was drawn for a shadow ray.
    pub struct Pick {
        /// Level above index; later the position of a virtual light and two flags.
        pub light: u32,
        /// Its geometry term before blending, m⁻²; later the weight of the ray.
        pub geometry: f32,
    }
}
