//! Punctual lights, cameras and the sky of a glTF file.
//!
//! In: JSON and the node's placement · Out: [`Light`], [`Camera`], [`Sky`].
//! Units: intensities are taken as plain SI numbers, without a photometric factor.

use glam::{DAffine3, DVec3, Vec3};

use super::Document;
use super::mesh::shorten;
use crate::error::Warnings;
use crate::json::Item;
use crate::sky::MAX_RADIANCE;
use crate::validate::{MAX_COORDINATE, OUT_OF_REACH};
use crate::{Camera, Error, Light, Projection, Sky};

/// The light a node carries, shining along its −Z; `None` with a warning if unusable.
pub(crate) fn load_light(
    doc: &Document<'_>,
    reference: &Item<'_>,
    world_from_node: &DAffine3,
    warnings: &mut Warnings,
) -> Result<Option<Light>, Error> {
    let Some(item) = find_light(doc, reference)? else { return Ok(None) };
    let kind = item.required("type")?;
    let color = item.field("color")?.map_or(Ok(Vec3::ONE), |c| c.vec3())?;
    let intensity = item.field("intensity")?.map_or(Ok(1.0), |i| i.single())?;
    let radiant = color * intensity;
    if !(radiant.min_element() >= 0.0 && radiant.max_element() <= MAX_RADIANCE) {
        warnings.add("a light with an intensity below 0 or beyond 1e15 is left out", 1);
        return Ok(None);
    }
    let position = world_from_node.translation.as_vec3();
    let axis = -world_from_node.matrix3.z_axis;
    let direction = axis.try_normalize().map(|d| d.as_vec3()).filter(|d| d.is_finite());
    let kind_text = kind.text()?;
    if !is_in_reach(position) && kind_text != "directional" {
        warnings.add(&format!("a light at {OUT_OF_REACH} is left out"), 1);
        return Ok(None);
    }
    if direction.is_none() && kind_text != "point" {
        warnings.add("a light whose node has a singular transform is left out", 1);
        return Ok(None);
    }
    let direction = direction.unwrap_or(Vec3::NEG_Z);
    Ok(Some(match kind_text {
        "directional" => Light::Sun { direction, irradiance: radiant },
        "point" => Light::Point { position, intensity: radiant },
        "spot" => {
            let (inner, outer) = parse_cone(&item, warnings)?;
            let (cos_inner, cos_outer) = (inner.cos(), outer.cos());
            Light::Spot { position, direction, intensity: radiant, cos_outer, cos_inner }
        }
        other => {
            return Err(kind.fail(format!("\"{other}\"; allowed: directional, point, spot")));
        }
    }))
}

fn is_in_reach(position: Vec3) -> bool {
    position.abs().cmple(Vec3::splat(MAX_COORDINATE)).all()
}

fn find_light<'a>(doc: &Document<'a>, reference: &Item<'_>) -> Result<Option<Item<'a>>, Error> {
    let index = reference.whole()?;
    let none = || reference.fail(format!("light {index} does not exist in KHR_lights_punctual"));
    let extensions = doc.root().field("extensions")?.ok_or_else(none)?;
    let lights = extensions.field("KHR_lights_punctual")?.ok_or_else(none)?.required("lights")?;
    let value = lights.list()?.get(index).ok_or_else(none)?;
    let path = format!("{}[{index}]", lights.path);
    Ok(Some(Item { file: doc.file, path, value }))
}

/// Half angles with 0 ≤ inner < outer ≤ π/2, repaired if need be.
fn parse_cone(item: &Item<'_>, warnings: &mut Warnings) -> Result<(f32, f32), Error> {
    let right = std::f32::consts::FRAC_PI_2;
    let (mut inner, mut outer) = (0.0, std::f32::consts::FRAC_PI_4);
    if let Some(spot) = item.field("spot")? {
        inner = spot.field("innerConeAngle")?.map_or(Ok(inner), |a| a.single())?;
        outer = spot.field("outerConeAngle")?.map_or(Ok(outer), |a| a.single())?;
    }
    // The cosines must differ in single precision too.
    let (stated_inner, stated_outer) = (inner, outer);
    outer = outer.clamp(0.01, right);
    inner = inner.clamp(0.0, outer - 0.001);
    let repaired = inner != stated_inner || outer != stated_outer;
    warnings.add("a spot light's cone was clamped to 0 ≤ inner < outer ≤ 90°", repaired.into());
    Ok((inner, outer))
}

/// The camera a node carries, looking along its −Z; `None` with a warning if unusable.
pub(crate) fn load_camera(
    doc: &Document<'_>,
    reference: &Item<'_>,
    node_name: &str,
    world_from_node: &DAffine3,
    warnings: &mut Warnings,
) -> Result<Option<Camera>, Error> {
    let (_, item) = doc.follow(reference, "cameras")?;
    let kind = item.required("type")?;
    let projection = match kind.text()? {
        "perspective" => {
            let vfov_rad = item.required("perspective")?.required("yfov")?.single()?;
            let usable = vfov_rad > 0.0 && vfov_rad < std::f32::consts::PI;
            usable.then_some(Projection::Perspective { vfov_rad })
        }
        "orthographic" => {
            let half_height = item.required("orthographic")?.required("ymag")?.single()?.abs();
            let usable = half_height > 0.0 && half_height <= MAX_COORDINATE;
            usable.then_some(Projection::Orthographic { half_height })
        }
        other => {
            return Err(kind.fail(format!("\"{other}\"; allowed: perspective, orthographic")));
        }
    };
    let Some(projection) = projection else {
        warnings.add("a camera with an impossible angle or size is left out", 1);
        return Ok(None);
    };
    let name = match item.field("name")? {
        _ if !node_name.is_empty() => node_name,
        Some(name) => name.text()?,
        None => "",
    };
    let Some(mut camera) = place_camera(world_from_node) else {
        warnings.add("a camera whose node has a singular transform is left out", 1);
        return Ok(None);
    };
    if !is_in_reach(camera.position) {
        warnings.add(&format!("a camera at {OUT_OF_REACH} is left out"), 1);
        return Ok(None);
    }
    camera.projection = projection;
    camera.name = shorten(name).to_owned();
    Ok(Some(camera))
}

fn place_camera(world_from_node: &DAffine3) -> Option<Camera> {
    let forward: DVec3 = (-world_from_node.matrix3.z_axis).try_normalize()?;
    let up: DVec3 = world_from_node.matrix3.y_axis.try_normalize()?;
    let position = world_from_node.translation.as_vec3();
    let right = forward.cross(up);
    if right.length_squared() < 1e-12 {
        return None;
    }
    let up = right.normalize().cross(forward).as_vec3();
    let projection = Projection::Perspective { vfov_rad: 1.0 };
    let forward = forward.as_vec3();
    Some(Camera { name: String::new(), position, forward, up, projection, size_px: None })
}

/// `extras.sky_radiance` of a scene, if any and not black.
pub(crate) fn load_sky(scene: &Item<'_>) -> Result<Option<Sky>, Error> {
    let Some(extras) = scene.field("extras")? else { return Ok(None) };
    if !extras.value.is_object() {
        return Ok(None);
    }
    let Some(item) = extras.field("sky_radiance")? else { return Ok(None) };
    let radiance = item.vec3()?;
    if !(radiance.min_element() >= 0.0 && radiance.max_element() <= MAX_RADIANCE) {
        return Err(item.fail(format!("{radiance} found; allowed: 0 or more, up to 1e15")));
    }
    Ok((radiance != Vec3::ZERO).then_some(Sky::Constant(radiance)))
}
