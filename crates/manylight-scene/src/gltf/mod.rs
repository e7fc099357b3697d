//! glTF 2.0 files, binary or text, become a [`Scene`].
//!
//! In: bytes, and a folder for external files · Out: [`Scene`] and warnings.
//! Limits: geometry, instances and texels are bounded by a multiple of the bytes read, so a
//! small file cannot ask for a large allocation. Animations and morph targets stay at rest.
//! Source: the glTF 2.0 specification and its KHR/EXT extensions named in [`SUPPORTED`].

mod buffer;
mod light;
mod material;
mod mesh;
mod node;
mod skin;
mod texture;

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::error::Warnings;
use crate::json::{self, Item};
use crate::{Error, Scene};
pub(crate) use buffer::read_file;
use buffer::{Bytes, Resolver};
pub(crate) use texture::describe_error;

/// Extensions that are read.
pub(crate) const SUPPORTED: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// A parsed file: its JSON and its bytes.
#[derive(Debug)]
pub(crate) struct Document<'a> {
    /// File name for messages.
    pub(crate) file: &'a str,
    /// The JSON.
    pub(crate) root: &'a Value,
    /// Bytes that views refer to.
    pub(crate) buffers: Vec<Bytes<'a>>,
}

impl<'a> Document<'a> {
    /// The root object.
    pub(crate) fn root(&self) -> Item<'a> {
        Item::root(self.file, self.root)
    }

    /// A top-level list; empty if absent.
    pub(crate) fn list(&self, key: &str) -> Result<&'a [Value], Error> {
        self.root().field(key)?.map_or(Ok(&[]), |list| list.list())
    }

    /// Entry `index` of a top-level list, if it exists.
    pub(crate) fn entry(&self, key: &str, index: usize) -> Result<Option<Item<'a>>, Error> {
        let entry = self.list(key)?.get(index);
        Ok(entry.map(|value| Item { file: self.file, path: format!("{key}[{index}]"), value }))
    }

    /// The index at `reference` and the entry of the top-level list it means.
    pub(crate) fn follow(
        &self,
        reference: &Item<'_>,
        key: &str,
    ) -> Result<(usize, Item<'a>), Error> {
        let index = reference.whole()?;
        let entry = self.entry(key, index)?;
        let length = self.list(key)?.len();
        let entry = entry.ok_or_else(|| {
            reference.fail(format!("{key}[{index}] does not exist; the file has {length} {key}"))
        })?;
        Ok((index, entry))
    }
}

/// Memory a file may still ask for; grows with its size. Primitives, nodes and images that share
/// one part of a small file could otherwise become any number of copies.
#[derive(Debug)]
pub(crate) struct Budget {
    geometry_bytes: u64,
    texel_bytes: u64,
    encoded_bytes: u64,
}

impl Budget {
    fn new(byte_count: u64) -> Self {
        // Tightly packed vertices grow about 4-fold, instances of many primitives 70-fold.
        let grown = byte_count.saturating_mul(32);
        Self {
            geometry_bytes: grown.saturating_add(1 << 28),
            // Dull textures are packed 200-fold; a single flat one may be more.
            texel_bytes: byte_count.saturating_mul(256).saturating_add(1 << 30).min(1 << 33),
            encoded_bytes: byte_count.saturating_mul(4).saturating_add(1 << 26),
        }
    }

    /// Takes `count` vertices, indices or placements that are kept as `T`.
    pub(crate) fn take<T>(&mut self, count: u64, place: &Item<'_>) -> Result<(), Error> {
        let byte_count = count.saturating_mul(size_of::<T>() as u64);
        take_bytes(&mut self.geometry_bytes, byte_count, "geometry", place)
    }

    /// Takes decoded image bytes.
    pub(crate) fn take_texel_bytes(&mut self, n: u64, place: &Item<'_>) -> Result<(), Error> {
        take_bytes(&mut self.texel_bytes, n, "images", place)
    }

    /// Takes bytes of an image that is decoded.
    pub(crate) fn take_encoded_bytes(&mut self, n: u64, place: &Item<'_>) -> Result<(), Error> {
        take_bytes(&mut self.encoded_bytes, n, "images to decode", place)
    }
}

fn take_bytes(left: &mut u64, n: u64, what: &str, place: &Item<'_>) -> Result<(), Error> {
    *left = left.checked_sub(n).ok_or_else(|| {
        place.fail(format!(
            "{n} more bytes of {what} are far beyond what a file of this size may unpack to; \
             copy less of it or export the file again"
        ))
    })?;
    Ok(())
}

/// Whether bytes begin like a binary glTF file.
pub(crate) fn is_glb(bytes: &[u8]) -> bool {
    bytes.starts_with(b"glTF")
}

/// Loads a scene from the bytes of a `.glb` or `.gltf` file; `folder` holds external files, which
/// are added to `files`.
pub(crate) fn load_scene(
    file: &str,
    bytes: &[u8],
    folder: Option<&Path>,
    files: &mut Vec<PathBuf>,
    warnings: &mut Warnings,
) -> Result<Scene, Error> {
    let (json_bytes, bin) = if is_glb(bytes) { split_glb(file, bytes)? } else { (bytes, None) };
    let root = json::parse(file, json_bytes)?;
    let root_item = Item::root(file, &root);
    root_item.map()?;
    check_version(&root_item)?;
    check_extensions(&root_item, warnings)?;
    files.extend(folder.map_or(Vec::new(), |folder| buffer::list_files(&root, folder)));
    let mut resolver = Resolver::new(folder);
    let buffers = buffer::load_buffers(&root_item, bin, &mut resolver)?;
    let doc = Document { file, root: &root, buffers };
    let mut budget = Budget::new(bytes.len() as u64 + resolver.byte_count);
    let mut scene = Scene { name: file.to_owned(), ..Scene::default() };
    material::load_materials(&doc, &mut resolver, &mut scene, &mut budget, warnings)?;
    let animations = doc.list("animations")?.len() as u64;
    warnings.add("an animation is shown at rest, as its nodes are placed in the file", animations);
    node::load_nodes(&doc, &mut scene, &mut budget, warnings)?;
    Ok(scene)
}

/// JSON and binary chunk of a `.glb` file.
fn split_glb<'a>(file: &str, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>), Error> {
    let word = |at: usize| -> Option<u32> {
        let b = bytes.get(at..at.checked_add(4)?)?;
        Some(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    };
    let cut = |what: &str| {
        Error::invalid(file, format!("{what} is cut short; copy or export the file again"))
    };
    let version = word(4).ok_or_else(|| cut("the 12-byte glb header"))?;
    if version != 2 {
        let problem = format!("glb version {version}; only 2 is read: convert it to glTF 2.0");
        return Err(Error::invalid(file, problem));
    }
    let declared = word(8).ok_or_else(|| cut("the 12-byte glb header"))? as usize;
    if declared > bytes.len() {
        let found = bytes.len();
        return Err(cut(&format!("the glb file ({found} of {declared} bytes)")));
    }
    let chunk = |at: usize, what: &str| -> Result<(u32, &'a [u8]), Error> {
        let length = word(at).ok_or_else(|| cut(what))? as usize;
        let kind = word(at + 4).ok_or_else(|| cut(what))?;
        let end = (at + 8).checked_add(length).ok_or_else(|| cut(what))?;
        Ok((kind, bytes.get(at + 8..end).ok_or_else(|| cut(what))?))
    };
    let (kind, json_bytes) = chunk(12, "the JSON chunk")?;
    if kind != u32::from_le_bytes(*b"JSON") {
        return Err(Error::invalid(file, "the first glb chunk is not JSON; export the file again"));
    }
    let next = 20 + json_bytes.len();
    if next + 8 > declared {
        return Ok((json_bytes, None));
    }
    let (kind, bin) = chunk(next, "the binary chunk")?;
    Ok((json_bytes, (kind == u32::from_le_bytes(*b"BIN\0")).then_some(bin)))
}

fn check_version(root: &Item<'_>) -> Result<(), Error> {
    let asset = root.required("asset")?;
    let version = asset.required("version")?;
    match version.text()?.split('.').next() {
        Some("2") => Ok(()),
        _ => Err(version.fail(format!(
            "glTF version {}; only 2.x is read: convert it to glTF 2.0",
            version.text()?
        ))),
    }
}

/// Refuses required extensions that are not supported; warns of used ones.
fn check_extensions(root: &Item<'_>, warnings: &mut Warnings) -> Result<(), Error> {
    if let Some(list) = root.field("extensionsRequired")? {
        for item in list.items()? {
            let name = item.text()?;
            if !SUPPORTED.contains(&name) {
                return Err(item.fail(format!(
                    "the file needs the extension {name}, which is not supported; {}",
                    conversion_hint(name)
                )));
            }
        }
    }
    if let Some(list) = root.field("extensionsUsed")? {
        for item in list.items()? {
            let name = item.text()?;
            if !SUPPORTED.contains(&name) {
                warnings.add(&format!("the extension {name} is not supported and ignored"), 1);
            }
        }
    }
    Ok(())
}

/// How to get rid of an extension.
fn conversion_hint(name: &str) -> &'static str {
    match name {
        "KHR_draco_mesh_compression" | "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "unpack it with `gltf-transform copy in.glb out.glb`"
        }
        "KHR_texture_basisu" => "unpack it with `gltf-transform ktxdecompress in.glb out.glb`",
        "EXT_texture_webp" | "EXT_texture_avif" => {
            "convert it with `gltf-transform png in.glb out.glb`"
        }
        "KHR_materials_pbrSpecularGlossiness" => {
            "convert it with `gltf-transform metalrough in.glb out.glb`"
        }
        _ => "export the file again without it",
    }
}
