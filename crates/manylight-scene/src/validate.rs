//! Whether a scene can be rendered at all.

use glam::Vec3;

use crate::error::Warnings;
use crate::{Error, Light, Scene, Sky};

/// Largest coordinate, edge or matrix entry that is kept, metres.
///
/// Renderers take fourth powers of distances in single precision, which are finite up to about four
/// times as much.
pub(crate) const MAX_COORDINATE: f32 = 1e9;

/// What warnings of things beyond that say.
pub(crate) const OUT_OF_REACH: &str = "coordinates not finite or beyond 1e9 m";

/// Most triangles over all instances; renderers number them with 32 bits.
const MAX_TRIANGLES: u64 = 1 << 31;

/// Refuses scenes without triangles and with more than can be numbered.
pub(crate) fn check_geometry(scene: &Scene, warnings: &Warnings) -> Result<(), Error> {
    let triangle_count = scene.triangle_count();
    if triangle_count == 0 {
        let is_lost = |message: &str| {
            let is_geometry = message.starts_with("a triangle") || message.starts_with("a mesh");
            is_geometry && message.contains(OUT_OF_REACH)
        };
        let advice = match warnings.find(is_lost) {
            Some(lost) => format!(": {lost}; move it nearer or scale it down"),
            None => "; put a mesh with an area into its shown scene".to_owned(),
        };
        let problem = format!("the scene has no triangles to show{advice}");
        return Err(Error::invalid(&scene.name, problem));
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
pub(crate) fn check_light(scene: &Scene, place: &str, warnings: &Warnings) -> Result<(), Error> {
    if shines(scene) {
        return Ok(());
    }
    let lost = warnings.find(|message| message.starts_with("a light"));
    let lost = lost.map_or(String::new(), |lost| format!(": {lost}"));
    Err(Error::invalid(
        place,
        format!(
            "nothing shines in this shot{lost}; add a light to `lights`, e.g. {{\"type\": \
             \"sky\", \"radiance\": [1, 1, 1]}}"
        ),
    ))
}
