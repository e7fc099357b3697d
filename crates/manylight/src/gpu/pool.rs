//! Memory that lists share because they are needed one after another.

use super::buffer::HeldBytes;
use super::{Buf, Gpu, Record};
use crate::error::Error;
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;

/// Where room for lists comes from: a device, each list by itself, or a [`Phase`].
pub trait Memory {
    /// The device.
    fn gpu(&self) -> &Gpu;

    /// A list; it holds zeros at first in memory of its own, and anything in that of a [`Phase`].
    ///
    /// Errors: more bytes than one binding of this device may have, or than it has left
    fn list<T: Record>(&self, name: &'static str, len: usize) -> Result<Buf<T>, Error>;
}

impl Memory for Gpu {
    fn gpu(&self) -> &Gpu {
        self
    }

    fn list<T: Record>(&self, name: &'static str, len: usize) -> Result<Buf<T>, Error> {
        self.buffer(name, len)
    }
}

/// How much larger than a list its memory may be; small lists leave large memory to others.
const MOST_SLACK: u64 = 10;
/// Where a list may begin, in bytes: the largest alignment a device may ask for.
const ALIGNMENT: u64 = 256;

/// A piece of memory that lists take in turns.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub raw: wgpu::Buffer,
    pub held: Arc<HeldBytes>,
}

/// Memory for the phases of a frame, one after another.
#[derive(Debug)]
pub struct Pool<'g> {
    gpu: &'g Gpu,
    blocks: Rc<RefCell<Vec<Block>>>,
}

impl<'g> Pool<'g> {
    /// No memory yet.
    pub fn new(gpu: &'g Gpu) -> Self {
        Self { gpu, blocks: Rc::default() }
    }

    /// A time in which no list of another phase is needed. Those that need the largest lists come
    /// first, so that all others fit into their memory.
    pub fn phase(&self) -> Phase<'g> {
        Phase { gpu: self.gpu, blocks: self.blocks.clone(), taken: RefCell::default() }
    }
}

/// A time in which some lists are needed, and lists of other phases are not.
#[derive(Clone, Debug)]
pub struct Phase<'g> {
    gpu: &'g Gpu,
    blocks: Rc<RefCell<Vec<Block>>>,
    /// Blocks that have a list in this phase.
    taken: RefCell<Vec<usize>>,
}

impl Memory for Phase<'_> {
    fn gpu(&self) -> &Gpu {
        self.gpu
    }

    fn list<T: Record>(&self, name: &'static str, len: usize) -> Result<Buf<T>, Error> {
        if let Some(block) = self.take(Buf::<T>::bytes(len)) {
            return Ok(Buf::within(&block, 0, name, len));
        }
        let own = self.gpu.buffer(name, len)?;
        self.keep(own.block());
        Ok(own)
    }
}

impl Phase<'_> {
    /// Memory of some bytes that is free in this phase: the least there is.
    fn take(&self, bytes: u64) -> Option<Block> {
        let (blocks, mut taken) = (self.blocks.borrow(), self.taken.borrow_mut());
        let fits = |size: u64| (bytes..=MOST_SLACK * bytes).contains(&size);
        let is_free = |i: &usize| !taken.contains(i) && fits(blocks[*i].raw.size());
        let found = (0..blocks.len()).filter(is_free).min_by_key(|&i| blocks[i].raw.size())?;
        taken.push(found);
        Some(blocks[found].clone())
    }

    /// New memory, taken in this phase.
    fn keep(&self, block: Block) {
        let mut blocks = self.blocks.borrow_mut();
        self.taken.borrow_mut().push(blocks.len());
        blocks.push(block);
    }

    /// One piece of memory for lists of which no kernel reads one and writes another: devices look
    /// at memory as a whole. Each list gets its own where the device allows no piece as large.
    ///
    /// `bytes`: of each list, see [`Buf::bytes`]
    /// Errors: more bytes than the device has left
    pub fn together(&self, bytes: &[u64]) -> Result<Together<'_>, Error> {
        let all: u64 = bytes.iter().map(|bytes| bytes.next_multiple_of(ALIGNMENT)).sum();
        let mut block = None;
        if all <= self.gpu.max_list_bytes() {
            block = self.take(all);
            if block.is_none() {
                let own =
                    self.gpu.buffer::<u32>("lists that are used together", all as usize / 4)?;
                self.keep(own.block());
                block = Some(own.block());
            }
        }
        Ok(Together { phase: self, block, next: Cell::new(0) })
    }
}

/// Memory for several lists, one behind the other.
#[derive(Debug)]
pub struct Together<'p> {
    phase: &'p Phase<'p>,
    block: Option<Block>,
    next: Cell<u64>,
}

impl Memory for Together<'_> {
    fn gpu(&self) -> &Gpu {
        self.phase.gpu
    }

    /// Panics: beyond the bytes that were asked for
    fn list<T: Record>(&self, name: &'static str, len: usize) -> Result<Buf<T>, Error> {
        let Some(block) = &self.block else { return self.phase.list(name, len) };
        let offset = self.next.get();
        let end = offset + Buf::<T>::bytes(len);
        assert!(end <= block.raw.size(), "{name} was not counted");
        self.next.set(end.next_multiple_of(ALIGNMENT));
        Ok(Buf::within(block, offset, name, len))
    }
}
