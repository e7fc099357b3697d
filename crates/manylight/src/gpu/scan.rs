//! Prefix sums over a list, in place.
//!
//! The specification is a running sum; the device adds up blocks, scans their sums the same way,
//! and adds them back.

use super::{Buf, Constant, KernelInfo, Memory, Recorder, Value, kernel, record};
use crate::error::Error;

/// Values that one workgroup scans.
pub(crate) const SCAN_BLOCK: u32 = 2048;
const CONSTANTS: &[Constant] = &[Constant { name: "SCAN_BLOCK", value: Value::U32(SCAN_BLOCK) }];

record! {
    /// What both kernels need to know.
    pub struct ScanParams {
        /// Values.
        pub count: u32,
    }
}

kernel! {
    /// Sums inside blocks.
    struct ScanBlocks = "gpu/scan_blocks", [super::GROUP, 1, 1], [CONSTANTS];
    uniform params: ScanParams, write values: u32, write sums: u32
}

kernel! {
    /// Adds the sums of blocks.
    struct ScanAdd = "gpu/scan_add", [super::GROUP, 1, 1], [CONSTANTS];
    uniform params: ScanParams, read sums: u32, write values: u32
}

/// Every kernel of this file.
pub const KERNELS: &[&KernelInfo] = &[&ScanBlocks::INFO, &ScanAdd::INFO];

/// Memory for scans of lists up to a length.
#[derive(Debug)]
pub struct Scan {
    /// Sums of blocks, of blocks of blocks, and so on up to one.
    sums: Vec<Buf<u32>>,
}

impl Scan {
    /// Memory for lists of up to `most` values.
    ///
    /// Errors: more than the device can hold
    pub fn new(memory: &impl Memory, most: usize) -> Result<Self, Error> {
        let mut sums = Vec::new();
        let mut count = most;
        loop {
            count = count.div_ceil(SCAN_BLOCK as usize);
            sums.push(memory.list("sums of blocks", count)?);
            if count <= 1 {
                return Ok(Self { sums });
            }
        }
    }

    /// Replaces each of the first `count` values by the sum of those before it, modulo 2³².
    ///
    /// A zero at the end becomes the total.
    /// Panics: for more values than there is memory for
    pub fn record(&self, rec: &mut Recorder<'_>, values: &Buf<u32>, count: usize) {
        self.record_level(rec, values, count, 0);
    }

    fn record_level(&self, rec: &mut Recorder<'_>, values: &Buf<u32>, count: usize, level: usize) {
        if count == 0 {
            return;
        }
        let sums = &self.sums[level];
        let blocks = count.div_ceil(SCAN_BLOCK as usize);
        let params = rec.uniform(&ScanParams { count: count as u32 });
        rec.dispatch(&ScanBlocks { params, values, sums }, [blocks as u32, 1, 1]);
        if blocks > 1 {
            self.record_level(rec, sums, blocks, level + 1);
            rec.dispatch(&ScanAdd { params, sums, values }, [blocks as u32, 1, 1]);
        }
    }
}
