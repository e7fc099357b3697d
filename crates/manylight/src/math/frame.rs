//! Orthonormal frames around a direction.

use glam::Vec3;

/// Two unit vectors that complete `n` (unit) to a right-handed frame.
///
/// Source: [Duff17, Listing 3]
#[inline]
pub fn tangent_frame(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    let tangent = Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    (tangent, Vec3::new(b, sign + n.y * n.y * a, -n.y))
}
