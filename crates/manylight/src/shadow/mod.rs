//! Is the point seen from the light? Shadow rays between a receiver and a light.
//!
//! In: [`World`], [`SurfacePoint`] · Out: visibility, 0 or 1

#[cfg(feature = "gpu")]
pub mod gpu;

use crate::bvh::Ray;
use crate::surface::SurfacePoint;
use crate::vlight::Vpl;
use crate::world::World;
use glam::Vec3;

/// Where a segment to a light ends, as a share of its length: short of the light's own surface.
pub const SEGMENT_END: f32 = 0.9999;

/// Whether a direction (unit, `distance` may be infinite) is free of obstacles.
#[inline]
pub fn is_open(world: &World, surface: &SurfacePoint, direction: Vec3, distance: f32) -> bool {
    let t_max = if distance.is_finite() { distance * SEGMENT_END } else { f32::MAX };
    !world.occluded(&Ray { origin: surface.ray_origin(world), direction, t_max })
}

/// Whether a point on another surface, whose lit side has normal `normal`, is seen.
#[inline]
pub fn is_seen(world: &World, surface: &SurfacePoint, position: Vec3, normal: Vec3) -> bool {
    let origin = surface.ray_origin(world);
    let target = position + normal * world.ray_offset(position);
    !world.occluded(&Ray { origin, direction: target - origin, t_max: SEGMENT_END })
}

/// Whether a virtual light is seen.
#[inline]
pub fn is_vpl_seen(world: &World, surface: &SurfacePoint, light: &Vpl) -> bool {
    is_seen(world, surface, light.position, light.normal)
}

/// Whether a point in space, on no surface, is seen.
#[inline]
pub fn is_point_seen(world: &World, surface: &SurfacePoint, position: Vec3) -> bool {
    is_seen(world, surface, position, Vec3::ZERO)
}
