//! A small builder of glTF files.

#![allow(dead_code, reason = "each test binary uses its own part")]

use manylight_scene::{Error, Shot, load_gltf_bytes};
use serde_json::{Value, json};

pub const U8: u32 = 5121;
pub const I8: u32 = 5120;
pub const I16: u32 = 5122;
pub const U16: u32 = 5123;
pub const U32: u32 = 5125;
pub const F32: u32 = 5126;

/// JSON and binary chunk under construction.
#[derive(Clone)]
pub struct Glb {
    pub json: Value,
    pub bin: Vec<u8>,
}

pub fn f32s(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

pub fn u16s(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// A right triangle in the z = 0 plane, facing +Z.
pub const TRIANGLE: [f32; 9] = [0., 0., 0., 1., 0., 0., 0., 1., 0.];

impl Glb {
    /// A file without content.
    pub fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}], "meshes": [], "accessors": [], "bufferViews": [],
            "buffers": [{"byteLength": 0}],
        });
        Self { json, bin: Vec::new() }
    }

    /// One triangle; accessor 0 holds its positions.
    pub fn triangle() -> Self {
        Self::with_positions(&TRIANGLE)
    }

    /// One mesh without indices; accessor 0 holds its positions.
    pub fn with_positions(positions: &[f32]) -> Self {
        let mut glb = Self::new();
        let accessor = glb.accessor(&f32s(positions), F32, positions.len() / 3, "VEC3");
        glb.json["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": accessor}}]}]);
        glb
    }

    /// A quad of four corners with these mode and indices.
    pub fn indexed(positions: &[f32], mode: u32, indices: &[u16]) -> Self {
        let mut glb = Self::with_positions(positions);
        let accessor = glb.accessor(&u16s(indices), U16, indices.len(), "SCALAR");
        let primitive = &mut glb.json["meshes"][0]["primitives"][0];
        primitive["indices"] = json!(accessor);
        primitive["mode"] = json!(mode);
        glb
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.bin.len().is_multiple_of(4) {
            self.bin.push(0);
        }
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        self.push(
            "bufferViews",
            json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}),
        )
    }

    pub fn accessor(&mut self, bytes: &[u8], component: u32, count: usize, kind: &str) -> usize {
        let view = self.view(bytes);
        let accessor =
            json!({"bufferView": view, "componentType": component, "count": count, "type": kind});
        self.push("accessors", accessor)
    }

    /// Appends to a top-level list; returns the index.
    pub fn push(&mut self, list: &str, value: Value) -> usize {
        if self.json[list].is_null() {
            self.json[list] = json!([]);
        }
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    pub fn attribute(&mut self, name: &str, accessor: usize) {
        self.json["meshes"][0]["primitives"][0]["attributes"][name] = json!(accessor);
    }

    pub fn bytes(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        let mut bin = self.bin.clone();
        while !bin.len().is_multiple_of(4) {
            bin.push(0);
        }
        if json["buffers"][0]["byteLength"] == json!(0) {
            json["buffers"][0]["byteLength"] = json!(bin.len());
        }
        let mut text = json.to_string().into_bytes();
        while !text.len().is_multiple_of(4) {
            text.push(b' ');
        }
        let total = 12 + 8 + text.len() + 8 + bin.len();
        let word = |x: usize| (x as u32).to_le_bytes();
        let mut out = b"glTF".to_vec();
        out.extend([word(2), word(total), word(text.len()), *b"JSON"].concat());
        out.extend(text);
        out.extend([word(bin.len()), *b"BIN\0"].concat());
        out.extend(bin);
        out
    }

    pub fn try_load(&self) -> Result<Shot, Error> {
        load_gltf_bytes("test.glb", &self.bytes())
    }

    pub fn load(&self) -> Shot {
        self.try_load().unwrap()
    }
}

/// How often a warning with this fragment was counted.
pub fn count_warnings(shot: &Shot, fragment: &str) -> u64 {
    shot.warnings.iter().filter(|w| w.message.contains(fragment)).map(|w| w.count).sum()
}

/// A PNG file; texels RGBA, row-major.
pub fn encode_png(width: u32, height: u32, texels: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut out);
    image::ImageEncoder::write_image(
        encoder,
        texels,
        width,
        height,
        image::ExtendedColorType::Rgba8,
    )
    .unwrap();
    out
}
