//! Sorting by integer keys on the device; twin of [`sort_by_key`](super::super::super::sort).
//!
//! A digit of eight bits at a time, from the lowest: count, prefix sums, move.

use crate::error::Error;
use crate::gpu::scan::Scan;
use crate::gpu::{Buf, Constant, GROUP, MAX_GROUPS, Memory, Recorder, Value};
use crate::gpu::{kernel, record};

/// Bits of a digit.
const DIGIT_BITS: u32 = 8;
/// Items that one workgroup moves.
const SORT_BLOCK: u32 = 1024;

const CONSTANTS: &[Constant] = &[
    Constant { name: "MAX_GROUPS", value: Value::U32(MAX_GROUPS) },
    Constant { name: "SORT_BLOCK", value: Value::U32(SORT_BLOCK) },
    Constant { name: "SORT_DIGITS", value: Value::U32(1 << DIGIT_BITS) },
];

record! {
    /// One pass.
    struct SortParams {
        /// Items that there is room for.
        capacity: u32,
        /// Blocks of them.
        blocks: u32,
        /// Lowest bit of the digit.
        shift: u32,
    }
}

kernel! {
    /// Counts digits.
    struct SortCount = "gather/grid/gpu/build/sort_count", [GROUP, 1, 1], [CONSTANTS];
    uniform params: SortParams, read count: u32, read items: [u32; 4], write places: u32
}

kernel! {
    /// Moves items.
    struct SortScatter = "gather/grid/gpu/build/sort_scatter", [GROUP, 1, 1], [CONSTANTS];
    uniform params: SortParams, read count: u32, read items: [u32; 4], read places: u32,
    write sorted: [u32; 4]
}

/// Every kernel of this file.
#[cfg(test)]
pub(super) const KERNELS: &[&crate::gpu::KernelInfo] = &[&SortCount::INFO, &SortScatter::INFO];

/// Memory for sorting up to some number of items.
#[derive(Debug)]
pub(super) struct Sort {
    /// A key of 64 bits, low word first, what it belongs to, and a number that is not used: to be
    /// filled in before sorting, and sorted after it.
    pub items: Buf<[u32; 4]>,
    other: Buf<[u32; 4]>,
    places: Buf<u32>,
    scan: Scan,
}

impl Sort {
    /// Memory for `capacity` items.
    ///
    /// Errors: more than the device can hold in one list
    pub fn new(memory: &impl Memory, capacity: usize) -> Result<Self, Error> {
        let places = capacity.div_ceil(SORT_BLOCK as usize) << DIGIT_BITS;
        Ok(Self {
            items: memory.list("keys", capacity)?,
            other: memory.list("sorted keys", capacity)?,
            places: memory.list("places of digits", places)?,
            scan: Scan::new(memory, places)?,
        })
    }

    /// Sorts the first `count[0]` items by the lowest `bits` bits of their keys, an even number of
    /// passes; equal keys keep their order.
    pub fn record(&self, rec: &mut Recorder<'_>, count: &Buf<u32>, bits: u32) {
        let capacity = self.items.len() as u32;
        let blocks = capacity.div_ceil(SORT_BLOCK);
        let passes = bits.div_ceil(DIGIT_BITS).next_multiple_of(2);
        let (places, groups) = (&self.places, [blocks, 1, 1]);
        for pass in 0..passes {
            let (items, sorted) = match pass % 2 {
                0 => (&self.items, &self.other),
                _ => (&self.other, &self.items),
            };
            let params = SortParams { capacity, blocks, shift: pass * DIGIT_BITS };
            let params = rec.uniform(&params);
            rec.dispatch(&SortCount { params, count, items, places }, groups);
            self.scan.record(rec, places, places.len());
            rec.dispatch(&SortScatter { params, count, items, places, sorted }, groups);
        }
    }
}
