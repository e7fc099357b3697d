//! Buffers that know what they hold.

use super::Gpu;
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

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

/// Some bytes on the account of a device.
#[derive(Debug)]
pub struct HeldBytes {
    account: Arc<AtomicU64>,
    bytes: u64,
}

impl HeldBytes {
    pub(super) fn new(account: Arc<AtomicU64>, bytes: u64) -> Self {
        account.fetch_add(bytes, Ordering::Relaxed);
        Self { account, bytes }
    }
}

impl Drop for HeldBytes {
    fn drop(&mut self) {
        self.account.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// A storage buffer of `len` records on the device.
#[derive(Debug)]
pub struct Buf<T> {
    raw: wgpu::Buffer,
    len: usize,
    name: &'static str,
    _bytes: HeldBytes,
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
        let size = (len.max(1) * size_of::<T>()) as u64;
        // Mapping asks for multiples of four bytes.
        let size = size.next_multiple_of(4);
        let raw = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some(name),
            size,
            usage,
            mapped_at_creation: false,
        });
        Self { raw, len, name, _bytes: gpu.hold_bytes(size), holds: PhantomData }
    }

    /// Records.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is room for none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
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
