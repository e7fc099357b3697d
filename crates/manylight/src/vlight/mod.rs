//! Virtual lights: small lights that stand for light already scattered, or for a large emitter.
//!
//! In: [`World`](crate::world::World), [`Emitters`](crate::emitter::Emitters)
//! Out: [`Vpl`] · Paper: `[Keller97]`

pub mod vpl;

pub use vpl::{Vpl, VplSet};
