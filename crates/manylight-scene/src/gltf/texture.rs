//! Images and their use by materials.
//!
//! In: JSON, views, files · Out: [`TextureImage`]s decoded once, [`TextureSlot`]s.
//! Limits: PNG and JPEG; at most 16384 texels a side and 2²⁸ bytes decoded.

use std::collections::HashMap;
use std::io::{Cursor, ErrorKind};

use glam::{Affine2, Mat2, Vec2};
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader};

use super::buffer::{Resolver, view_bytes};
use super::{Budget, Document};
use crate::error::Warnings;
use crate::json::Item;
use crate::{Error, Scene, TextureImage, TextureSlot, Wrap};

/// Largest image side, texels.
pub(crate) const MAX_SIDE: u32 = 16384;
/// Largest decoded image, bytes.
pub(crate) const MAX_IMAGE_BYTES: u64 = 1 << 28;

/// Images decoded so far and where they came from.
#[derive(Debug)]
pub(crate) struct Textures<'d, 'r, 'f> {
    pub(crate) doc: &'d Document<'d>,
    pub(crate) resolver: &'r mut Resolver<'f>,
    /// glTF image → scene image.
    known: HashMap<usize, u32>,
    /// Where an encoded image lies in memory, and its bytes → scene image.
    decoded: HashMap<(usize, usize), u32>,
}

impl<'d, 'r, 'f> Textures<'d, 'r, 'f> {
    pub(crate) fn new(doc: &'d Document<'d>, resolver: &'r mut Resolver<'f>) -> Self {
        Self { doc, resolver, known: HashMap::new(), decoded: HashMap::new() }
    }

    /// The slot that a material's texture info describes; `None` with a warning if unusable.
    pub(crate) fn load_slot(
        &mut self,
        info: &Item<'_>,
        scene: &mut Scene,
        budget: &mut Budget,
        warnings: &mut Warnings,
    ) -> Result<Option<TextureSlot>, Error> {
        let (_, texture) = self.doc.follow(&info.required("index")?, "textures")?;
        let Some(source) = texture.field("source")? else {
            warnings.add("a texture without a PNG or JPEG image is ignored", 1);
            return Ok(None);
        };
        let mut uv_item = info.field("texCoord")?;
        let mut transform = Affine2::IDENTITY;
        let extensions = info.field("extensions")?;
        if let Some(item) = extensions.and_then(|e| e.field("KHR_texture_transform").transpose()) {
            let item = item?;
            transform = parse_transform(&item)?;
            uv_item = item.field("texCoord")?.or(uv_item);
        }
        let uv_set = uv_item.map_or(Ok(0), |i| i.whole())?;
        if uv_set > 1 {
            warnings.add("a texture that uses TEXCOORD_2 or higher is ignored", 1);
            return Ok(None);
        }
        let sampler = match texture.field("sampler")? {
            Some(reference) => Some(self.doc.follow(&reference, "samplers")?.1),
            None => None,
        };
        let wrap = match &sampler {
            Some(s) => [parse_wrap(s, "wrapS")?, parse_wrap(s, "wrapT")?],
            None => [Wrap::Repeat; 2],
        };
        let linear_filter = match &sampler {
            Some(s) => parse_filter(s)?,
            None => true,
        };
        let (image_index, item) = self.doc.follow(&source, "images")?;
        let image = match self.known.get(&image_index) {
            Some(&known) => known,
            None => {
                let image = self.decode(&item, scene, budget)?;
                self.known.insert(image_index, image);
                image
            }
        };
        Ok(Some(TextureSlot { image, uv_set: uv_set as u8, transform, wrap, linear_filter }))
    }

    /// The image in the scene; entries that share their bytes share it too.
    fn decode(
        &mut self,
        item: &Item<'_>,
        scene: &mut Scene,
        budget: &mut Budget,
    ) -> Result<u32, Error> {
        let name = item.field("name")?.map_or(Ok(""), |n| n.text())?;
        let name = if name.is_empty() { item.path.clone() } else { name.to_owned() };
        let view = item.field("bufferView")?;
        let file; // stays in memory, as the resolver keeps it
        let bytes: &[u8] = match (&view, item.field("uri")?) {
            (Some(view), _) => view_bytes(self.doc, view)?.0,
            (None, Some(uri)) => {
                file = self.resolver.resolve(&uri)?;
                &file
            }
            (None, None) => {
                let problem = "has neither a `bufferView` nor a `uri`; export the file again";
                return Err(item.fail(problem));
            }
        };
        let place = (bytes.as_ptr() as usize, bytes.len());
        if let Some(&known) = self.decoded.get(&place) {
            return Ok(known);
        }
        if view.is_some() {
            // Views may overlap; files and data URIs are read once.
            budget.take_encoded_bytes(bytes.len() as u64, item)?;
        }
        scene.images.push(decode_image(item, name, bytes, budget)?);
        let index = scene.images.len() as u32 - 1;
        self.decoded.insert(place, index);
        Ok(index)
    }
}

fn decode_image(
    item: &Item<'_>,
    name: String,
    bytes: &[u8],
    budget: &mut Budget,
) -> Result<TextureImage, Error> {
    let broken = |e: ImageError| {
        let reason = describe_error(&e);
        item.fail(format!("image cannot be decoded: {reason}; save it again as PNG or JPEG"))
    };
    let format = image::guess_format(bytes).ok();
    let Some(format @ (ImageFormat::Png | ImageFormat::Jpeg)) = format else {
        return Err(item.fail("image is neither PNG nor JPEG; convert it to one of them"));
    };
    // Read the size and refuse what is too large, before anything is allocated.
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(MAX_IMAGE_BYTES * 3);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let byte_count = u64::from(width) * u64::from(height) * 4;
    if width > MAX_SIDE || height > MAX_SIDE || byte_count > MAX_IMAGE_BYTES {
        return Err(item.fail(format!(
            "image of {width} × {height} texels; at most {MAX_SIDE} a side and {MAX_IMAGE_BYTES} \
             bytes are read: make it smaller"
        )));
    }
    if byte_count == 0 {
        return Err(item.fail("image without texels; replace it"));
    }
    budget.take_texel_bytes(byte_count, item)?;
    let rgba = DynamicImage::from_decoder(decoder).map_err(broken)?.into_rgba8();
    let (texels, _) = rgba.as_raw().as_chunks::<4>();
    Ok(TextureImage { name, width, height, texels: texels.to_vec() })
}

/// Why an image cannot be decoded; decoders have words of their own for it, not for users.
pub(crate) fn describe_error(error: &ImageError) -> String {
    match error {
        ImageError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof => "it is cut short".into(),
        ImageError::IoError(e) => e.to_string(),
        ImageError::Unsupported(_) => "its kind is not supported".into(),
        ImageError::Limits(_) => "it is too large".into(),
        _ => "its bytes are damaged".into(),
    }
}

/// uv' = offset + R·(scale ∘ uv), R turning by −rotation in the (u right, v down) plane, as in
/// the extension's matrices.
fn parse_transform(item: &Item<'_>) -> Result<Affine2, Error> {
    let pair = |key: &str, default: Vec2| -> Result<Vec2, Error> {
        item.field(key)?.map_or(Ok(default), |i| i.singles::<2>().map(Vec2::from))
    };
    let offset = pair("offset", Vec2::ZERO)?;
    let scale = pair("scale", Vec2::ONE)?;
    let rotation = item.field("rotation")?.map_or(Ok(0.0), |r| r.single())?;
    let linear = Mat2::from_angle(-rotation) * Mat2::from_diagonal(scale);
    Ok(Affine2::from_mat2_translation(linear, offset))
}

fn parse_wrap(sampler: &Item<'_>, key: &str) -> Result<Wrap, Error> {
    let Some(item) = sampler.field(key)? else { return Ok(Wrap::Repeat) };
    match item.whole()? {
        10497 => Ok(Wrap::Repeat),
        33648 => Ok(Wrap::Mirror),
        33071 => Ok(Wrap::Clamp),
        other => Err(item.fail(format!(
            "unknown wrap mode {other}; allowed: 10497 (repeat), 33648 (mirror), 33071 (clamp)"
        ))),
    }
}

/// Linear unless the magnification filter, or else the minification filter, says nearest.
fn parse_filter(sampler: &Item<'_>) -> Result<bool, Error> {
    for key in ["magFilter", "minFilter"] {
        if let Some(item) = sampler.field(key)? {
            return match item.whole()? {
                9728 | 9984 | 9986 => Ok(false),
                9729 | 9985 | 9987 => Ok(true),
                other => {
                    Err(item
                        .fail(format!("unknown filter {other}; allowed: 9728, 9729, 9984–9987")))
                }
            };
        }
    }
    Ok(true)
}
