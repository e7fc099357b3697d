//! Memory that lists share because they are needed one after another.

use super::buffer::HeldBytes;
use super::{Buf, Gpu, Record};
use crate::error::Error;
use std::cell::RefCell;
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
        let size = Buf::<T>::bytes(len);
        let (mut blocks, mut taken) = (self.blocks.borrow_mut(), self.taken.borrow_mut());
        let room = |i: &usize| !taken.contains(i) && blocks[*i].raw.size() >= size;
        let found = (0..blocks.len()).filter(room).min_by_key(|&i| blocks[i].raw.size());
        let Some(place) = found else {
            let own = self.gpu.buffer(name, len)?;
            blocks.push(own.block());
            taken.push(blocks.len() - 1);
            return Ok(own);
        };
        taken.push(place);
        Ok(Buf::within(&blocks[place], name, len))
    }
}
