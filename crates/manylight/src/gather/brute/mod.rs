//! Every virtual light with a shadow ray each: the definition of every other gather.
//!
//! In: receivers, lights · Out: shadowed and unshadowed irradiance
//! Cost: receivers × lights rays, except where a cosine is zero.

#[cfg(feature = "gpu")]
pub mod gpu;

use crate::shadow;
use crate::surface::SurfacePoint;
use crate::vlight::{Vpl, vpl};
use crate::world::World;
use glam::{DVec3, Vec3};

/// What all lights together give one receiver.
#[derive(Clone, Copy, Debug, Default)]
pub struct BruteSum {
    /// With visibility, W·m⁻².
    pub shadowed: Vec3,
    /// Without visibility, W·m⁻².
    pub unshadowed: Vec3,
    /// With visibility and without the distance clamp, W·m⁻²: what the clamp removed is the
    /// difference to `shadowed`.
    pub unclamped: Vec3,
    /// Lights with a contribution above zero.
    pub evals: u32,
}

/// Sums all lights at one receiver, in double precision and list order.
pub fn sum(world: &World, surface: &SurfacePoint, lights: &[Vpl], d_min: f32) -> BruteSum {
    let (mut shadowed, mut unshadowed) = (DVec3::ZERO, DVec3::ZERO);
    let (mut unclamped, mut evals) = (DVec3::ZERO, 0);
    for light in lights {
        let e = vpl::irradiance(light, surface.position, surface.ns, d_min * d_min);
        if e == Vec3::ZERO {
            continue;
        }
        evals += 1;
        unshadowed += e.as_dvec3();
        if shadow::is_vpl_seen(world, surface, light) {
            shadowed += e.as_dvec3();
            unclamped += vpl::irradiance(light, surface.position, surface.ns, 0.0).as_dvec3();
        }
    }
    BruteSum {
        shadowed: shadowed.as_vec3(),
        unshadowed: unshadowed.as_vec3(),
        unclamped: unclamped.as_vec3(),
        evals,
    }
}
