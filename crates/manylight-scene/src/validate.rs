//! Whether a scene can be rendered at all.

use glam::Vec3;

use crate::{Error, Light, Scene, Sky};

/// Most triangles over all instances; renderers number them with 32 bits.
const MAX_TRIANGLES: u64 = 1 << 31;

/// Refuses scenes without triangles and with more than can be numbered.
pub(crate) fn check_geometry(scene: &Scene) -> Result<(), Error> {
    let triangle_count = scene.triangle_count();
    if triangle_count == 0 {
        return Err(Error::invalid(
            &scene.name,
            "the scene has no triangles to show; put a mesh with an area into its shown scene",
        ));
    }
    if triangle_count > MAX_TRIANGLES {
        return Err(Error::invalid(
            &scene.name,
            format!(
                "the scene has {triangle_count} triangles over all instances; at most \
                 {MAX_TRIANGLES} are allowed: use fewer instances"
            ),
        ));
    }
    Ok(())
}

/// Whether any light, sky or placed material shines.
pub(crate) fn shines(scene: &Scene) -> bool {
    let is_lit = |c: &Vec3| c.max_element() > 0.0;
    let by_lights = scene.lights.iter().any(|light| match light {
        Light::Sun { irradiance, .. } => is_lit(irradiance),
        Light::Point { intensity, .. } | Light::Spot { intensity, .. } => is_lit(intensity),
    });
    let by_sky = match &scene.sky {
        Some(Sky::Constant(radiance)) => is_lit(radiance),
        Some(Sky::Map(map)) => map.radiance.iter().any(is_lit),
        None => false,
    };
    let is_emitter = |mesh: u32| {
        let mesh = scene.meshes.get(mesh as usize);
        let material = mesh.and_then(|m| scene.materials.get(m.material as usize));
        material.is_some_and(|m| !m.unlit && is_lit(&m.emission))
    };
    by_lights || by_sky || scene.instances.iter().any(|i| is_emitter(i.mesh))
}

/// Refuses a shot in which nothing shines.
pub(crate) fn check_light(scene: &Scene, place: &str) -> Result<(), Error> {
    match shines(scene) {
        true => Ok(()),
        false => Err(Error::invalid(
            place,
            "nothing shines in this shot; add a light to `lights`, e.g. {\"type\": \"sky\", \
             \"radiance\": [1, 1, 1]}",
        )),
    }
}
