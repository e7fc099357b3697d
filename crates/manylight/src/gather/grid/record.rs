//! Records of the hierarchy.

use super::cells::Cell;
use crate::vlight::Vpl;
use glam::Vec3;

/// The share of the virtual lights around one grid vertex that face one way.
#[derive(Clone, Copy, Debug)]
pub struct GridLight {
    /// Luminance-weighted mean position.
    pub position: Vec3,
    /// Luminance of `intensity`.
    pub luminance: f32,
    /// Sum of the shares' intensities, W·sr⁻¹.
    pub intensity: Vec3,
    /// Luminance-weighted mean of the unit normals; its length is their agreement.
    pub normal: Vec3,
    /// Per-axis variance of the position, m².
    pub variance: Vec3,
    /// Lattice coordinates of the vertex.
    pub vertex: [u16; 3],
    /// Dominant axis of the normals, 0…5 for +x −x +y −y +z −z; always 0 with one lobe.
    pub lobe: u8,
}

/// Where the share of a grid light lies: in the eight cells around its vertex; bit a of the index
/// is set where the cell lies above the vertex along axis a.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(super) struct Octants {
    /// Luminance of the share in each cell.
    pub luminance: [f32; 8],
    /// Positions of the cells among those of the level; anything where the luminance is zero.
    pub cells: [u32; 8],
}

impl Octants {
    /// The first cell with a share, times eight, and which of its corners the vertex is;
    /// `u64::MAX` if there is none.
    pub(super) fn first_corner(&self) -> u64 {
        let corner = |i: usize| u64::from(self.cells[i]) * 8 + (7 - i as u64);
        (0..8).filter(|&i| self.luminance[i] > 0.0).map(corner).min().unwrap_or(u64::MAX)
    }
}

/// One level: the lights of all occupied vertices, sorted by (z, y, x, lobe).
#[derive(Clone, Debug, Default)]
pub struct Level {
    /// Cell size h_l, metres.
    pub cell_size: f32,
    /// Occupied vertices, one or more lights each.
    pub lights: Vec<GridLight>,
    /// Where the share of each light lies, for drawing.
    pub(super) octants: Vec<Octants>,
    /// Occupied cells by lobe and Morton code; ends with a sentinel.
    pub(super) cells: Vec<Cell>,
    /// Occupied rows (z, y) in order, each with the index of its first light; ends with a sentinel.
    pub(super) rows: Vec<([u16; 2], u32)>,
}

/// The hierarchy over one set of virtual lights.
#[derive(Clone, Debug, Default)]
pub struct LightingGrid {
    /// Lowest corner of the cube around the lights.
    pub origin: Vec3,
    /// Levels 1 to L; index 0 is level 1.
    pub levels: Vec<Level>,
    /// The virtual lights as level 0, by cell of level 1; empty unless gathering starts there.
    pub(super) level0: Level,
    /// Position in `lights` of each light of `level0`.
    pub(super) level0_lights: Vec<u32>,
    /// The virtual lights, sorted by (lobe, Morton code of the finest possible cell).
    pub lights: Vec<Vpl>,
    /// Position in level-1 cells and luminance of each light, for drawing.
    pub(super) points: Vec<[f32; 4]>,
    /// Luminance shared to the corners of the level-1 cells by all lights before each block, each
    /// light to those of its own cell.
    pub(super) blocks: Vec<[f64; 8]>,
}

impl LightingGrid {
    /// Grid lights over all levels.
    pub fn light_count(&self) -> usize {
        self.levels.iter().map(|l| l.lights.len()).sum()
    }
}

impl Level {
    /// The lights of vertices in an inclusive range of lattice coordinates.
    pub(super) fn for_each_in(
        &self,
        low: [i32; 3],
        high: [i32; 3],
        mut visit: impl FnMut(u32, &GridLight),
    ) {
        let clamp = |v: i32| v.clamp(0, i32::from(u16::MAX)) as u16;
        let (x0, x1) = (clamp(low[0]), clamp(high[0]));
        let (y0, y1) = (clamp(low[1]), clamp(high[1]));
        if high.iter().any(|&h| h < 0) {
            return;
        }
        for z in clamp(low[2])..=clamp(high[2]) {
            let mut row = self.rows.partition_point(|r| r.0 < [z, y0]);
            while row + 1 < self.rows.len() && self.rows[row].0 <= [z, y1] {
                let (start, end) = (self.rows[row].1 as usize, self.rows[row + 1].1 as usize);
                let lights = &self.lights[start..end];
                let first = lights.partition_point(|l| l.vertex[0] < x0);
                for (i, light) in lights[first..].iter().enumerate() {
                    if light.vertex[0] > x1 {
                        break;
                    }
                    visit((start + first + i) as u32, light);
                }
                row += 1;
            }
        }
    }
}
