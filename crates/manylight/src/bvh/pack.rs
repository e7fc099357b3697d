//! Records of the hierarchy, eight lanes each.

use super::WIDTH;

/// Lane values.
pub(super) type Lanes = [f32; WIDTH];

/// Marks a child slot without child.
pub(super) const EMPTY: u32 = u32::MAX;
/// Set in a child reference that names a pack instead of a node.
pub(super) const LEAF: u32 = 1 << 31;
/// Marks a pack lane without triangle.
pub(super) const NO_TRIANGLE: u32 = u32::MAX;
/// Set in a triangle id that is opaque.
pub(super) const OPAQUE: u32 = 1 << 31;

/// Eight child boxes and where they lead.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Lower then upper planes of x, y, z.
    pub planes: [[Lanes; 2]; 3],
    /// Node index, or pack index with `LEAF`, or `EMPTY`.
    pub children: [u32; WIDTH],
}

impl Node {
    pub const EMPTY: Self = Self {
        planes: [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3],
        children: [EMPTY; WIDTH],
    };
}

/// Eight triangles: a corner and the two edges that leave it.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(super) struct Pack {
    pub corner: [Lanes; 3],
    pub edge1: [Lanes; 3],
    pub edge2: [Lanes; 3],
    /// Triangle index, with `OPAQUE`, or `NO_TRIANGLE`.
    pub id: [u32; WIDTH],
}

impl Pack {
    pub const EMPTY: Self = Self {
        corner: [[0.0; WIDTH]; 3],
        edge1: [[0.0; WIDTH]; 3],
        edge2: [[0.0; WIDTH]; 3],
        id: [NO_TRIANGLE; WIDTH],
    };
}
