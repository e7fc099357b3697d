//! Buffers that know what they hold.

use super::groups::Groups;
use super::pool::Block;
use super::{Bound, Gpu, Place};
use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Something that a buffer holds: plain bytes with the layout of a shader's type.
pub trait Record: bytemuck::Pod {
    /// Name and byte offset of every field; empty for numbers and vectors.
    const FIELDS: &'static [(&'static str, usize)] = &[];
}

impl Record for u32 {}
impl Record for f32 {}
impl<const N: usize> Record for [u32; N] where [u32; N]: bytemuck::Pod {}
impl<const N: usize> Record for [f32; N] where [f32; N]: bytemuck::Pod {}

/// Declares a record with the layout of the shader's `struct`; a field that begins with `_` is
/// padding.
macro_rules! record {
    ($(#[$meta:meta])* $vis:vis struct $name:ident {
        $($(#[$field_meta:meta])* $field_vis:vis $field:ident: $type:ty,)*
    }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        $vis struct $name { $($(#[$field_meta])* $field_vis $field: $type,)* }
        impl $crate::gpu::Record for $name {
            const FIELDS: &'static [(&'static str, usize)] =
                &[$((stringify!($field), std::mem::offset_of!($name, $field)),)*];
        }
    };
}
pub(crate) use record;

/// What a device holds: bytes by name.
#[derive(Debug, Default)]
pub struct Account {
    held: Mutex<BTreeMap<&'static str, u64>>,
    /// Memories that there have been.
    count: AtomicU64,
    /// What is bound to some of it.
    pub(super) groups: Groups,
}

impl Account {
    /// Bytes by name, the most first.
    pub fn list(&self) -> Vec<(&'static str, u64)> {
        let held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        let mut list: Vec<_> = held.iter().map(|(&name, &bytes)| (name, bytes)).collect();
        list.sort_by_key(|&(name, bytes)| (Reverse(bytes), name));
        list
    }

    /// A number for another memory.
    pub(super) fn number(&self) -> u64 {
        self.count.fetch_add(1, Ordering::Relaxed)
    }

    fn change(&self, name: &'static str, change: impl FnOnce(u64) -> u64) {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes = held.get(name).copied().unwrap_or(0);
        match change(bytes) {
            0 => held.remove(name),
            bytes => held.insert(name, bytes),
        };
    }
}

/// Some bytes on the account of a device.
#[derive(Debug)]
pub struct HeldBytes {
    account: Arc<Account>,
    name: &'static str,
    bytes: u64,
    /// Number of the memory.
    pub(super) memory: u64,
}

impl HeldBytes {
    pub(super) fn new(account: Arc<Account>, name: &'static str, bytes: u64) -> Self {
        account.change(name, |held| held + bytes);
        let memory = account.number();
        Self { account, name, bytes, memory }
    }
}

impl Drop for HeldBytes {
    fn drop(&mut self) {
        self.account.groups.forget(self.memory);
        self.account.change(self.name, |held| held - self.bytes);
    }
}

/// A storage buffer of `len` records on the device.
#[derive(Debug)]
pub struct Buf<T> {
    raw: wgpu::Buffer,
    /// Where in it the list begins, bytes.
    offset: u64,
    len: usize,
    name: &'static str,
    held: Arc<HeldBytes>,
    holds: PhantomData<fn() -> T>,
}

impl<T: Record> Buf<T> {
    /// Room for `len` records, all zero; at least one, since a binding may not be empty.
    pub(super) fn new(gpu: &Gpu, name: &'static str, len: usize) -> Self {
        let usage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::UNIFORM
            | wgpu::BufferUsages::INDIRECT
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::COPY_SRC;
        let size = Self::bytes(len);
        let raw = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some(name),
            size,
            usage,
            mapped_at_creation: false,
        });
        let held = Arc::new(gpu.hold_bytes(name, size));
        Self { raw, offset: 0, len, name, held, holds: PhantomData }
    }

    /// Bytes of `len` records.
    pub fn bytes(len: usize) -> u64 {
        let size = (len.max(1) * size_of::<T>()) as u64;
        // Mapping asks for multiples of four bytes.
        size.next_multiple_of(4)
    }

    /// A list in memory that other lists use at other times.
    pub(super) fn within(block: &Block, offset: u64, name: &'static str, len: usize) -> Self {
        let Block { raw, held } = block.clone();
        Self { raw, offset, len, name, held, holds: PhantomData }
    }

    /// The memory of the list.
    pub(super) fn block(&self) -> Block {
        Block { raw: self.raw.clone(), held: self.held.clone() }
    }

    /// Another list in the same memory, for another time.
    ///
    /// Panics: beyond the end of this one
    pub fn reused<U: Record>(&self, name: &'static str, len: usize) -> Buf<U> {
        assert!(
            Buf::<U>::bytes(len) <= Self::bytes(self.len),
            "{name} is larger than {}",
            self.name
        );
        Buf::within(&self.block(), self.offset, name, len)
    }

    /// What a kernel is bound to: the list and no more, where its memory is larger.
    pub fn binding(&self) -> Bound<'_> {
        let (memory, offset, size) = (self.held.memory, self.offset, Self::bytes(self.len));
        Bound::Bytes(&self.raw, Place { memory, offset, size })
    }

    /// Records.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is room for none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Where in its memory it begins, bytes.
    pub(super) fn offset(&self) -> u64 {
        self.offset
    }

    /// Name, for messages.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The buffer behind it.
    pub fn raw(&self) -> &wgpu::Buffer {
        &self.raw
    }
}
