//! Environment maps from `.hdr` and `.exr` files.
//!
//! In: a file · Out: [`SkyMap`] with the scale applied; bad texels become black and are counted.
//! Limits: at most 32768 texels a side and 2²⁷ texels; no B44 compression, no deep data.

use std::io::Cursor;
use std::path::Path;

use exr::prelude as ex;
use glam::Vec3;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use crate::error::Warnings;
use crate::{Error, SkyMap};

const MAX_SIDE: usize = 32768;
const MAX_TEXELS: usize = 1 << 27;
/// Most numbers of a map, over all its channels: four for each texel of the largest.
const MAX_VALUES: usize = 1 << 29;
/// Brightest texel, emission, intensity or irradiance kept; sums and squares of it stay finite.
pub(crate) const MAX_RADIANCE: f32 = 1e15;

/// Reads an equirectangular map.
pub(crate) fn load_sky_map(
    path: &Path,
    rotation_rad: f32,
    scale: f32,
    warnings: &mut Warnings,
) -> Result<SkyMap, Error> {
    let bytes = crate::gltf::read_file(path)?;
    let name = path.display().to_string();
    let (size, mut radiance) = if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        decode_exr(&name, &bytes)?
    } else if image::guess_format(&bytes).ok() == Some(ImageFormat::Hdr) {
        decode_hdr(&name, &bytes)?
    } else {
        return Err(Error::invalid(&name, "neither Radiance .hdr nor OpenEXR; convert the map"));
    };
    let mut bad_count = 0;
    for texel in &mut radiance {
        let scaled = *texel * scale;
        *texel = scaled.clamp(Vec3::ZERO, Vec3::splat(MAX_RADIANCE));
        if !scaled.is_finite() {
            *texel = Vec3::ZERO;
        }
        bad_count += u64::from(*texel != scaled);
    }
    warnings.add("a sky texel that is negative or not finite was replaced", bad_count);
    Ok(SkyMap { width: size[0] as u32, height: size[1] as u32, radiance, rotation_rad })
}

fn check_size(name: &str, width: usize, height: usize) -> Result<(), Error> {
    let texel_count = width.saturating_mul(height);
    if width == 0 || height == 0 || width.max(height) > MAX_SIDE || texel_count > MAX_TEXELS {
        return Err(Error::invalid(
            name,
            format!(
                "a map of {width} × {height} texels; allowed: 1 to {MAX_SIDE} a side, at most \
                 {MAX_TEXELS} in all"
            ),
        ));
    }
    Ok(())
}

/// Blocks are unpacked with all their channels, whichever are wanted.
fn check_values(name: &str, size: ex::Vec2<usize>, channels: usize) -> Result<(), Error> {
    if size.area().saturating_mul(channels) > MAX_VALUES {
        let ex::Vec2(width, height) = size;
        let problem = format!(
            "a map of {width} × {height} texels with {channels} channels; at most {MAX_VALUES} \
             numbers are read: save R, G and B alone"
        );
        return Err(Error::invalid(name, problem));
    }
    Ok(())
}

type Texels = ([usize; 2], Vec<Vec3>);

fn decode_hdr(name: &str, bytes: &[u8]) -> Result<Texels, Error> {
    let broken = |e: image::ImageError| {
        let reason = crate::gltf::describe_error(&e);
        Error::invalid(name, format!("the map cannot be decoded: {reason}; save it again"))
    };
    let reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Hdr);
    let decoder = reader.into_decoder().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    check_size(name, width as usize, height as usize)?;
    let rgb = DynamicImage::from_decoder(decoder).map_err(broken)?.into_rgb32f();
    let radiance = rgb.pixels().map(|p| Vec3::from(p.0)).collect();
    Ok(([width as usize, height as usize], radiance))
}

fn decode_exr(name: &str, bytes: &[u8]) -> Result<Texels, Error> {
    let broken = |e: ex::Error| {
        Error::invalid(name, format!("the map cannot be decoded: {e}; save it again"))
    };
    // Read the sizes and refuse what is too large, before texels are allocated.
    let meta =
        exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    for header in &meta.headers {
        let channels = header.channels.list.len();
        check_size(name, header.layer_size.0, header.layer_size.1)?;
        check_values(name, header.layer_size, channels)?;
        if let exr::meta::BlockDescription::Tiles(tiles) = header.blocks {
            check_size(name, tiles.tile_size.0, tiles.tile_size.1)?;
            check_values(name, tiles.tile_size, channels)?;
        }
        // The decoder's arithmetic overflows on damaged blocks of this kind.
        if matches!(header.compression, ex::Compression::B44 | ex::Compression::B44A) {
            let problem = "its compression B44 is not supported; save the map with ZIP";
            return Err(Error::invalid(name, problem));
        }
    }
    let new_image = |size: ex::Vec2<usize>, _: &_| {
        Texels::from(([size.0, size.1], vec![Vec3::ZERO; size.area()]))
    };
    let set = |image: &mut Texels, at: ex::Vec2<usize>, (r, g, b, _): (f32, f32, f32, f32)| {
        let index = at.1 * image.0[0] + at.0;
        if let Some(texel) = image.1.get_mut(index) {
            *texel = Vec3::new(r, g, b);
        }
    };
    use ex::{ReadChannels as _, ReadLayers as _};
    let image = ex::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(new_image, set)
        .first_valid_layer()
        .all_attributes()
        .non_parallel() // a panic in a worker of the decoder would abort the whole process
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;
    Ok(image.layer_data.channel_data.pixels)
}
