//! Materials.
//!
//! In: JSON · Out: [`Material`]s with their images decoded; factors checked, clamped and counted.

use glam::{Vec3, Vec4};

use super::buffer::Resolver;
use super::texture::Textures;
use super::{Budget, Document};
use crate::error::Warnings;
use crate::json::Item;
use crate::sky::MAX_RADIANCE;
use crate::{AlphaMode, Error, Material, Scene};

/// All materials in file order.
pub(crate) fn load_materials(
    doc: &Document<'_>,
    resolver: &mut Resolver<'_>,
    scene: &mut Scene,
    budget: &mut Budget,
    warnings: &mut Warnings,
) -> Result<(), Error> {
    let mut textures = Textures::new(doc, resolver);
    let Some(list) = doc.root().field("materials")? else { return Ok(()) };
    for (index, item) in list.items()?.into_iter().enumerate() {
        let mut material = parse_material(&item, index, warnings)?;
        let pbr = item.field("pbrMetallicRoughness")?;
        let mut slot = |from: Option<&Item<'_>>, key: &str| match from.map(|f| f.field(key)) {
            Some(Ok(Some(info))) => textures.load_slot(&info, scene, budget, warnings),
            Some(Err(e)) => Err(e),
            _ => Ok(None),
        };
        material.base_color_texture = slot(pbr.as_ref(), "baseColorTexture")?;
        material.metallic_roughness_texture = slot(pbr.as_ref(), "metallicRoughnessTexture")?;
        material.normal_texture = slot(Some(&item), "normalTexture")?;
        // A texture on black emission shows nothing: its image need not be decoded.
        if material.emission != Vec3::ZERO {
            material.emission_texture = slot(Some(&item), "emissiveTexture")?;
        }
        scene.materials.push(material);
    }
    Ok(())
}

fn parse_material(
    item: &Item<'_>,
    index: usize,
    warnings: &mut Warnings,
) -> Result<Material, Error> {
    let mut factor = |from: &Item<'_>, key: &str, default: f32, max: f32| -> Result<f32, Error> {
        let Some(value) = from.field(key)? else { return Ok(default) };
        let x = value.number()? as f32;
        let clamped = x.clamp(0.0, max);
        warnings.add("a material factor outside its range was clamped", u64::from(clamped != x));
        Ok(clamped)
    };
    let mut material = Material::default();
    let name = item.field("name")?.map_or(Ok(""), |n| n.text())?;
    material.name = if name.is_empty() { format!("material {index}") } else { name.to_owned() };
    if let Some(pbr) = item.field("pbrMetallicRoughness")? {
        material.metallic = factor(&pbr, "metallicFactor", 1.0, 1.0)?;
        material.roughness = factor(&pbr, "roughnessFactor", 1.0, 1.0)?;
        if let Some(color) = pbr.field("baseColorFactor")? {
            material.base_color = Vec4::from(color.singles::<4>()?).clamp(Vec4::ZERO, Vec4::ONE);
        }
    }
    if let Some(normal) = item.field("normalTexture")?
        && let Some(scale) = normal.field("scale")?
    {
        material.normal_scale = scale.single()?;
    }
    if let Some(emissive) = item.field("emissiveFactor")? {
        material.emission = emissive.vec3()?.max(Vec3::ZERO);
    }
    if let Some(both) = item.field("doubleSided")? {
        material.double_sided = both.flag()?;
    }
    if let Some(mode) = item.field("alphaMode")? {
        material.alpha_mode = match mode.text()? {
            "OPAQUE" => AlphaMode::Opaque,
            "MASK" => AlphaMode::Mask(factor(item, "alphaCutoff", 0.5, f32::MAX)?),
            "BLEND" => AlphaMode::Blend,
            other => {
                return Err(mode.fail(format!("\"{other}\"; allowed: OPAQUE, MASK, BLEND")));
            }
        };
    }
    if let Some(extensions) = item.field("extensions")? {
        if let Some(e) = extensions.field("KHR_materials_emissive_strength")? {
            material.emission *= factor(&e, "emissiveStrength", 1.0, 1e30)?;
        }
        material.unlit = extensions.field("KHR_materials_unlit")?.is_some();
        if let Some(e) = extensions.field("KHR_materials_transmission")? {
            material.transmission = factor(&e, "transmissionFactor", 0.0, 1.0)?;
        }
        if let Some(e) = extensions.field("KHR_materials_ior")? {
            material.ior = factor(&e, "ior", 1.5, 1e6)?;
        }
    }
    if !(material.emission.max_element() <= MAX_RADIANCE && material.emission.is_finite()) {
        return Err(item.fail("emission beyond 1e15; lower emissiveFactor or emissiveStrength"));
    }
    Ok(material)
}
