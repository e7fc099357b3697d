//! How much a gather has room for.

use super::params::{BLOCK_PIXELS, BLOCK_SIDE, CHUNK, GatherStats, TILES};
use crate::gather::grid::TILE;
use crate::gather::grid::reach::ASKED;
use crate::gpu::scan::SCAN_BLOCK;
use crate::gpu::{Gpu, MAX_GROUPS};
use crate::settings::{GridSettings, Settings};

/// Lights of a pixel up to which bands are as large as there is room: 35 G operations each.
const BAND_EVALS: u32 = 480;

/// Room of a gather. Pictures are gathered in bands of blocks, and rays in slices, so that memory
/// does not grow with the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GatherCapacity {
    /// Most blocks of 16 × 16 pixels in a band; more use a large device better, and take about
    /// 70 KiB each.
    pub band_blocks: u32,
    /// Chunks of 64 lights per block, on the average of a band.
    pub block_chunks: u32,
    /// Fewest chunks of a band: small pictures have large blocks.
    pub least_chunks: u32,
    /// Cells of one level that the search of one block has room for.
    pub frontier: u32,
    /// The same for all blocks of a band, at least.
    pub least_frontiers: u32,
    /// Most shadow rays of a receiver in a slice.
    pub slice_rays: u32,
}

impl Default for GatherCapacity {
    fn default() -> Self {
        Self {
            // With their sum one block of a scan.
            band_blocks: SCAN_BLOCK - 1,
            block_chunks: 40,
            least_chunks: 16_384,
            frontier: 3584,
            least_frontiers: 1 << 20,
            slice_rays: 4,
        }
    }
}

/// Lights of a pixel that bands are made for.
pub fn band_evals(settings: &GridSettings) -> u32 {
    settings.alpha.map_or(settings.evals, |_| BAND_EVALS).max(BAND_EVALS)
}

/// Blocks of a picture, across and down; those that interleaved sampling of some side spreads over
/// the same pixels are complete.
pub(super) fn blocks_of(width: usize, height: usize, side: usize) -> [usize; 2] {
    let pixels = BLOCK_SIDE.max(side * TILE);
    [width, height].map(|size| size.div_ceil(pixels) * pixels / BLOCK_SIDE)
}

impl GatherCapacity {
    /// Bands as large as the picture and the device allow, and no larger than asked for.
    pub(super) fn fit(
        mut self,
        gpu: &Gpu,
        width: usize,
        height: usize,
        settings: &Settings,
    ) -> Self {
        let most = gpu.max_list_bytes();
        self.slice_rays = self.slice_rays.min(settings.shadow.rays).max(1);
        let [x, y] = blocks_of(width, height, settings.interleave as usize);
        let all = ((x * y) as u32).max(1);
        let blocks = self.band_blocks.clamp(1, all);
        self.block_chunks = self.block_chunks.max(self.least_chunks.div_ceil(blocks)).max(1);
        self.frontier = self.frontier.max(self.least_frontiers.div_ceil(blocks.max(ASKED as u32)));
        // The search for alpha takes a frontier for each receiver that it asks.
        let side_bytes = 2 * ASKED as u64 * 4;
        self.frontier = u64::from(self.frontier).clamp(8, most / side_bytes) as u32;
        let most_bytes = [
            self.block_chunks as usize * BLOCK_PIXELS * 4,
            (self.block_chunks as usize * CHUNK + 2) * 4,
            2 * self.frontier as usize * 4,
            BLOCK_PIXELS * self.slice_rays as usize * size_of::<[f32; 4]>(),
        ];
        let block_bytes = most_bytes.into_iter().max().unwrap_or(1) as u64;
        let most_blocks = (most / block_bytes).min(u64::from(MAX_GROUPS) / TILES as u64);
        let blocks = u64::from(blocks).min(most_blocks).max(1) as u32;
        let chunks = self.block_chunks.saturating_mul(blocks);
        // The lights of a band are one dispatch, which must not take long.
        let most_evals = u64::from(blocks) * u64::from(BAND_EVALS);
        let blocks = (most_evals / u64::from(band_evals(&settings.grid))).max(1) as u32;
        // Bands of one size, with the room of larger ones: a last small one would leave a large
        // device idle.
        self.band_blocks = all.div_ceil(all.div_ceil(blocks));
        self.block_chunks = chunks / self.band_blocks;
        self
    }

    /// Memory of a band's searches, in words: all of it, where the part begins in which they keep
    /// what they found, and how many lights each block keeps: as many as the list of an average
    /// block has room for, if one list of the device holds them, and what is left beside the
    /// frontiers of the running weights, which lie in the same memory later.
    pub(super) fn search(&self, gpu: &Gpu) -> [usize; 3] {
        let blocks = self.band_blocks as usize;
        let frontiers = 2 * self.frontier as usize * blocks.max(ASKED);
        let weights = self.chunks() as usize * BLOCK_PIXELS;
        let most = gpu.max_list_bytes() as usize / 4;
        let kept = self.chunks() as usize * CHUNK;
        let words = (frontiers + kept).min(most).max(frontiers).max(weights);
        [words, frontiers, (words - frontiers) / blocks]
    }

    /// Chunks that a band has room for.
    pub fn chunks(&self) -> u32 {
        self.band_blocks.saturating_mul(self.block_chunks)
    }

    /// Room for what a gather would have needed, with some to spare; `None` where there was enough.
    pub fn grown(&self, needed: &GatherStats) -> Option<Self> {
        let mut grown = *self;
        if needed.frontier > self.frontier {
            grown.frontier = needed.frontier.saturating_add(needed.frontier / 8);
        }
        if needed.chunks > self.chunks() {
            let per_block = needed.chunks.div_ceil(self.band_blocks);
            grown.block_chunks = per_block.saturating_add(per_block / 4 + 1);
        }
        (grown != *self).then_some(grown)
    }

    /// This with what another one of them grew by.
    pub fn with_growth(mut self, before: &Self, grown: &Self) -> Self {
        if grown.frontier != before.frontier {
            self.frontier = self.frontier.max(grown.frontier);
        }
        if grown.block_chunks != before.block_chunks {
            self.block_chunks = self.block_chunks.max(grown.block_chunks);
        }
        self
    }
}
