//! Bind groups that are kept from submission to submission, as long as their memory is.

use super::{Bound, KernelInfo};
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// Most groups that are kept; a frame has some two hundred.
const MOST_GROUPS: usize = 4096;

/// Some bytes of a memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Place {
    /// Number of the memory; no other has had the same.
    pub memory: u64,
    /// Where they begin.
    pub offset: u64,
    /// How many there are.
    pub size: u64,
}

/// A kernel, and what is bound to its ports.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Key {
    shader: &'static str,
    places: Vec<Place>,
}

impl Key {
    /// None where a texture is bound: nobody tells when one goes.
    pub fn new(kernel: &KernelInfo, bindings: &[Bound<'_>]) -> Option<Self> {
        let place = |bound: &Bound<'_>| match bound {
            Bound::Bytes(_, place) => Some(*place),
            Bound::Texture(_) => None,
        };
        let places = bindings.iter().map(place).collect::<Option<_>>()?;
        Some(Self { shader: kernel.shader, places })
    }
}

/// Bind groups by what is bound. A group holds its memory: it has to go before that can.
#[derive(Debug, Default)]
pub(super) struct Groups(Mutex<HashMap<Key, wgpu::BindGroup>>);

impl Groups {
    /// The group that was kept, or a new one, which is kept.
    pub fn get(&self, key: Key, make: impl FnOnce() -> wgpu::BindGroup) -> wgpu::BindGroup {
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(group) = lock().get(&key) {
            return group.clone();
        }
        let group = make();
        let mut groups = lock();
        if groups.len() >= MOST_GROUPS {
            groups.clear();
        }
        groups.insert(key, group.clone());
        group
    }

    /// Lets go of a memory.
    pub fn forget(&self, memory: u64) {
        let mut groups = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        groups.retain(|key, _| key.places.iter().all(|place| place.memory != memory));
    }

    /// How many there are.
    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).len()
    }

    /// Lets go of everything.
    pub fn clear(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}
