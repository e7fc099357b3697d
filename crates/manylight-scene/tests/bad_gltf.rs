//! Damaged and hostile glTF files give one sentence, never a panic, a hang or a huge allocation.

mod support;

use manylight_scene::{Error, Shot, load_gltf_bytes};
use serde_json::{Value, json};
use support::*;

/// The message of a refused input: one line, not empty, with the expected fragment.
fn assert_refused(case: &str, result: Result<Shot, Error>, fragment: &str) {
    let message = match result {
        Ok(_) => panic!("{case}: loaded, but should be refused for «{fragment}»"),
        Err(e) => e.to_string(),
    };
    assert!(!message.is_empty() && !message.contains('\n'), "{case}: {message:?}");
    assert!(message.contains(fragment), "{case}: «{message}» lacks «{fragment}»");
}

/// A valid triangle file with the value at a JSON pointer replaced.
fn changed(pointer: &str, value: Value) -> Glb {
    let mut glb = Glb::indexed(&TRIANGLE, 4, &[0, 1, 2]);
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    let parent = glb.json.pointer_mut(parent).unwrap();
    match parent {
        Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
        other => other[key] = value,
    }
    glb
}

#[test]
fn wrong_fields_are_refused_with_their_place() {
    let huge = json!(4_294_967_295_u64);
    let beyond = json!(18_446_744_073_709_551_615_u64);
    let cases: Vec<(&str, Value, &str)> = vec![
        ("/asset", Value::Null, "`asset` is missing"),
        ("/asset/version", json!("1.0"), "convert it to glTF 2.0"),
        ("/asset/version", json!(2), "asset.version: the number 2"),
        ("/extensionsRequired", json!(["KHR_draco_mesh_compression"]), "gltf-transform copy"),
        ("/extensionsRequired", json!(["EXT_meshopt_compression"]), "EXT_meshopt_compression"),
        ("/extensionsRequired", json!(["KHR_texture_basisu"]), "ktxdecompress"),
        ("/extensionsRequired", json!(["EXT_texture_webp"]), "gltf-transform png"),
        ("/extensionsRequired", json!(["X_\n\u{1b}[2J"]), "export the file again"),
        ("/extensionsRequired", json!("all"), "a list"),
        ("/scene", json!(7), "scenes[7] does not exist"),
        ("/scene", json!(-1), "a whole number of 0 or more"),
        ("/scenes/0/nodes", json!([3]), "nodes[3] does not exist"),
        ("/scenes/0/nodes", json!([0, 0]), "more than once"),
        ("/scenes/0/nodes", json!([]), "no triangles"),
        ("/scenes/0/extras", json!({"sky_radiance": [1, 2]}), "3 finite numbers"),
        ("/scenes/0/extras", json!({"sky_radiance": [1, -2, 0]}), "0 or more"),
        ("/scenes/0/extras", json!({"sky_radiance": [1, 1e16, 0]}), "up to 1e15"),
        ("/nodes", json!({}), "nodes: an object found where a list"),
        ("/nodes/0/children", json!([0]), "cycle"),
        ("/nodes", json!([{"children": [1]}, {"children": [0]}]), "cycle"),
        ("/nodes", json!([{"children": [1, 1]}, {}]), "child of more than one"),
        ("/nodes", json!([{"children": [1]}, {}, {"children": [1]}]), "child of more than one"),
        ("/nodes/0/mesh", json!(9), "meshes[9] does not exist"),
        ("/nodes/0/mesh", json!("a"), "nodes[0].mesh: the text"),
        ("/nodes/0/matrix", json!([1, 2, 3]), "16 finite numbers"),
        (
            "/nodes/0/matrix",
            json!([1e300, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
            "single precision",
        ),
        ("/nodes/0/scale", json!([1, "2", 3]), "nodes[0].scale[1]"),
        ("/nodes/0/scale", json!([1e16, 1, 1]), "no triangles"),
        ("/nodes/0/skin", json!(0), "skins[0] does not exist"),
        ("/nodes/0/camera", json!(0), "cameras[0] does not exist"),
        (
            "/nodes/0/extensions",
            json!({"KHR_lights_punctual": {"light": 2}}),
            "light 2 does not exist",
        ),
        (
            "/nodes/0/extensions",
            json!({"EXT_mesh_gpu_instancing": {"attributes": {}}}),
            "none of TRANSLATION",
        ),
        (
            "/nodes/0/extensions",
            json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 1}}}),
            "allowed here: VEC3",
        ),
        ("/meshes/0/primitives", json!(4), "meshes[0].primitives"),
        ("/meshes/0/primitives/0/mode", json!(7), "unknown mode 7"),
        ("/meshes/0/primitives/0/mode", json!(1), "no triangles"),
        ("/meshes/0/primitives/0/material", json!(0), "materials[0] does not exist"),
        ("/meshes/0/primitives/0/attributes", json!({}), "no triangles"),
        ("/meshes/0/primitives/0/attributes/POSITION", json!(5), "accessors[5] does not exist"),
        ("/meshes/0/primitives/0/attributes/POSITION", json!(1), "allowed here: VEC3"),
        ("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(0), "allowed here: VEC2"),
        ("/meshes/0/primitives/0/indices", json!(0), "allowed here: SCALAR"),
        ("/accessors/0/count", json!(4), "4 elements do not fit"),
        ("/accessors/0/count", huge.clone(), "do not fit"),
        ("/accessors/0/count", beyond.clone(), "accessors[0].count"),
        ("/accessors/0/count", json!(2), "names vertex 2"),
        ("/accessors/0/count", json!(0), "names vertex 0"),
        ("/accessors/0/byteOffset", json!(4), "do not fit"),
        ("/accessors/0/byteOffset", huge.clone(), "do not fit"),
        ("/accessors/0/componentType", json!(5124), "unknown number format"),
        ("/accessors/0/type", json!("VEC9"), "unknown type"),
        ("/accessors/0/bufferView", json!(8), "bufferViews[8] does not exist"),
        (
            "/accessors/0/sparse",
            json!({"count": 1, "indices": {"bufferView": 0, "componentType": 5126}}),
            "sparse indices allow",
        ),
        (
            "/accessors/0/sparse",
            json!({"count": 40, "indices": {"bufferView": 0, "componentType": 5123}}),
            "do not fit",
        ),
        (
            "/accessors/0/sparse",
            json!({
                "count": 2,
                "indices": {"bufferView": 0, "componentType": 5125},
                "values": {"bufferView": 0},
            }),
            "ascend strictly",
        ),
        ("/accessors/1/componentType", json!(5126), "do not fit"),
        ("/accessors/1/componentType", json!(5122), "unsigned"),
        ("/accessors/1/count", json!(2), "no triangles"),
        ("/bufferViews/0/buffer", json!(3), "buffer 3 does not exist"),
        ("/bufferViews/0/byteLength", json!(4000), "reach beyond"),
        ("/bufferViews/0/byteOffset", beyond, "bufferViews[0].byteOffset"),
        ("/bufferViews/0/byteStride", json!(0), "smaller than one element"),
        ("/bufferViews/0/byteStride", json!(8), "smaller than one element"),
        ("/bufferViews/0/byteStride", json!(9_000_000_000_000_000_u64), "do not fit"),
        ("/buffers/0/byteLength", huge, "cut short or damaged"),
        ("/buffers/0/uri", json!("other.bin"), "cannot be reached"),
        ("/buffers/0/uri", json!("https://example.org/x.bin"), "not a relative file"),
        ("/buffers/0/uri", json!("/etc/hostname"), "not a relative file"),
        ("/buffers/0/uri", json!("data:;base64,%%%%"), "not base64"),
        ("/buffers/0/uri", json!("data:text/plain,hello"), "not base64"),
        ("/materials", json!([{"alphaMode": "GLOW"}]), "OPAQUE, MASK, BLEND"),
        ("/materials", json!([{"emissiveFactor": [1e300, 0, 0]}]), "single precision"),
        ("/materials", json!([{"emissiveFactor": [0, 1e16, 0]}]), "beyond 1e15"),
        ("/materials", json!([{"normalTexture": {}}]), "`index` is missing"),
        ("/materials", json!([{"normalTexture": {"index": 0}}]), "textures[0] does not exist"),
        ("/materials", json!(["red"]), "materials[0]: the text"),
    ];
    assert!(cases.len() >= 60, "{}", cases.len());
    for (pointer, value, fragment) in cases {
        let case = format!("{pointer} = {value}");
        assert_refused(&case, changed(pointer, value).try_load(), fragment);
    }
}

#[test]
fn wrong_containers_are_refused() {
    let good = Glb::triangle().bytes();
    let mut version_one = good.clone();
    version_one[4] = 1;
    let mut not_json = good.clone();
    not_json[16] = b'X';
    let mut long_chunk = good.clone();
    long_chunk[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    let deep = "[".repeat(100_000).into_bytes();
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("empty", vec![], "not valid JSON"),
        ("zeros", vec![0; 1000], "not valid JSON"),
        ("not UTF-8", vec![0xff; 64], "not valid JSON"),
        ("a list", b"[]".to_vec(), "an object"),
        ("a number", b"3".to_vec(), "an object"),
        ("deep nesting", deep, "recursion limit"),
        ("overflowing number", br#"{"asset": 1e999}"#.to_vec(), "out of range"),
        ("magic only", b"glTF".to_vec(), "cut short"),
        ("version", version_one, "version 1"),
        ("chunk kind", not_json, "not JSON"),
        ("chunk length", long_chunk, "cut short"),
    ];
    for (case, bytes, fragment) in cases {
        assert_refused(case, load_gltf_bytes("bad.glb", &bytes), fragment);
    }
}

#[test]
fn every_truncation_is_refused() {
    let bytes = Glb::indexed(&TRIANGLE, 4, &[0, 1, 2]).bytes();
    for length in 0..bytes.len() {
        assert_refused(&format!("{length} bytes"), load_gltf_bytes("t.glb", &bytes[..length]), "");
    }
}

#[test]
fn flipped_bytes_never_panic() {
    let bytes = Glb::indexed(&TRIANGLE, 4, &[0, 1, 2]).bytes();
    let mut state = 1_u64;
    for _ in 0..4000 {
        let mut damaged = bytes.clone();
        for _ in 0..3 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let place = (state >> 33) as usize % damaged.len();
            damaged[place] = (state >> 25) as u8;
        }
        if let Err(e) = load_gltf_bytes("t.glb", &damaged) {
            assert!(!e.to_string().contains('\n'));
        }
    }
}

#[test]
fn small_files_cannot_ask_for_large_scenes() {
    // Zeros without a bufferView.
    let mut glb =
        changed("/accessors/0", json!({"componentType": F32, "type": "VEC3", "count": 1 << 24}));
    glb.json["meshes"][0]["primitives"][0]["indices"] = Value::Null;
    assert_refused("implicit zeros", glb.try_load(), "far beyond");
    glb.json["accessors"][0]["count"] = json!(1_u64 << 40);
    assert_refused("more implicit zeros", glb.try_load(), "without a bufferView");
    // Many instances of nothing.
    let mut glb = Glb::triangle();
    let t = glb.push("accessors", json!({"componentType": F32, "type": "VEC3", "count": 1 << 24}));
    let instancing = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": t}}});
    glb.json["nodes"][0]["extensions"] = instancing;
    assert_refused("implicit instances", glb.try_load(), "far beyond");
    // Many primitives that copy one vertex list.
    let mut glb = Glb::with_positions(&TRIANGLE.repeat(1000));
    let primitive = glb.json["meshes"][0]["primitives"][0].clone();
    glb.json["meshes"][0]["primitives"] = json!(vec![primitive; 2000]);
    assert_refused("copied vertices", glb.try_load(), "bytes of geometry are far beyond");
    // Many primitives that each read one list of sparse values.
    let mut glb = Glb::triangle();
    let count = 30_000;
    let all: Vec<u8> = (0..count as u32).flat_map(u32::to_le_bytes).collect();
    let (indices, values) = (glb.view(&all), glb.view(&vec![0; count * 12]));
    glb.json["accessors"][0] = json!({
        "componentType": F32, "type": "VEC3", "count": count, "sparse": {
            "count": count,
            "indices": {"bufferView": indices, "componentType": U32},
            "values": {"bufferView": values},
        },
    });
    let corners = glb.accessor(&u16s(&[0, 1, 2]), U16, 3, "SCALAR");
    let primitive = json!({"attributes": {"POSITION": 0}, "indices": corners});
    glb.json["meshes"][0]["primitives"] = json!(vec![primitive; 20_000]);
    assert_refused("sparse values", glb.try_load(), "bytes of geometry are far beyond");
    // Many images of one small file, large when they are decoded.
    let glb = overlapping_images(&encode_png(4096, 4096, &vec![0; 1 << 26]), 24);
    assert_refused("copied images", glb.try_load(), "bytes of images are far beyond");
    // Many images of one large file, small when they are decoded.
    let mut png = encode_png(1, 1, &[0; 4]);
    png.resize(1 << 23, 0);
    let glb = overlapping_images(&png, 24);
    assert_refused("encoded images", glb.try_load(), "bytes of images to decode are far beyond");
    // Many nodes with a skin that all look at many primitives, to leave them out.
    let mut glb = Glb::triangle();
    let points = json!({"attributes": {}, "mode": 0});
    glb.push("meshes", json!({"primitives": vec![points; 1500]}));
    glb.json["skins"] = json!([{"joints": [0]}]);
    let nodes = std::iter::once(json!({"mesh": 0}));
    glb.json["nodes"] = nodes.chain(vec![json!({"mesh": 1, "skin": 0}); 1500]).collect();
    glb.json["scenes"][0]["nodes"] = (0..1501).collect();
    assert_refused("skipped primitives", glb.try_load(), "bytes of geometry are far beyond");
    // Many skins of many joints.
    let mut glb = Glb::triangle();
    glb.json["skins"] = json!(vec![json!({"joints": vec![0; 100_000]}); 24]);
    glb.json["nodes"] = (0..24).map(|i| json!({"mesh": 0, "skin": i})).collect();
    glb.json["scenes"][0]["nodes"] = (0..24).collect();
    assert_refused("joints", glb.try_load(), "bytes of geometry are far beyond");
    // A chain of nodes deeper than the limit.
    let mut glb = Glb::triangle();
    let chain = (0..5000).map(|i| json!({"children": [i + 1]}));
    glb.json["nodes"] = chain.chain([json!({"mesh": 0})]).collect();
    assert_refused("deep nodes", glb.try_load(), "nested more than");
    // An out-of-range joint.
    let mut glb = Glb::triangle();
    let joints = glb.accessor(&[9; 12], U8, 3, "VEC4");
    let weights = glb.accessor(&f32s(&[1.; 12]), F32, 3, "VEC4");
    glb.attribute("JOINTS_0", joints);
    glb.attribute("WEIGHTS_0", weights);
    glb.json["skins"] = json!([{"joints": [0]}]);
    glb.json["nodes"][0]["skin"] = json!(0);
    assert_refused("joint", glb.try_load(), "joint 9");
}

/// Materials whose images lie in views of different lengths over the same bytes.
fn overlapping_images(png: &[u8], count: usize) -> Glb {
    let mut glb = Glb::triangle();
    let first = glb.view(&[png, &vec![0; count]].concat());
    for i in 0..count {
        let mut view = glb.json["bufferViews"][first].clone();
        view["byteLength"] = json!(png.len() + i);
        let view = glb.push("bufferViews", view);
        glb.push("images", json!({"bufferView": view}));
        glb.push("textures", json!({"source": i}));
        glb.push("materials", json!({"normalTexture": {"index": i}}));
    }
    glb
}

#[test]
fn geometry_without_use_is_refused() {
    let far = "no triangles to show: a triangle with coordinates not finite or beyond 1e9 m";
    let mut large = TRIANGLE.map(|x| x * 2e9);
    let flat = ([0.0; 9], "no triangles to show; put a mesh");
    for (positions, fragment) in
        [([f32::NAN; 9], far), ([f32::INFINITY; 9], far), ([3e38; 9], far), (large, far), flat]
    {
        assert_refused("positions", Glb::with_positions(&positions).try_load(), fragment);
    }
    large[3] = 1e9;
    large[7] = 1e9;
    assert!(Glb::with_positions(&large).try_load().is_ok());
}

#[test]
fn broken_images_are_refused() {
    let good = encode_png(2, 2, &[7; 16]);
    let resized = |width: u32, height: u32| {
        // The size stands in the IHDR chunk at byte 16, its checksum at byte 29.
        let mut png = good.clone();
        png[16..20].copy_from_slice(&width.to_be_bytes());
        png[20..24].copy_from_slice(&height.to_be_bytes());
        let sum = compute_crc(&png[12..29]);
        png[29..33].copy_from_slice(&sum.to_be_bytes());
        png
    };
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("empty", vec![], "neither PNG nor JPEG"),
        ("text", b"hello".to_vec(), "neither PNG nor JPEG"),
        ("gif", b"GIF89a\x01\0\x01\0".to_vec(), "neither PNG nor JPEG"),
        ("truncated", good[..good.len() / 2].to_vec(), "cannot be decoded"),
        ("no width", resized(0, 2), "cannot be decoded"),
        ("no height", resized(2, 0), "images[0]"),
        ("wide", resized(100_000, 1), "images[0]"),
        ("large", resized(16384, 16384), "at most"),
        ("huge", resized(0x7fff_ffff, 0x7fff_ffff), "images[0]"),
        ("jpeg head", vec![0xff, 0xd8, 0xff, 0xe0, 0, 16], "cannot be decoded"),
        ("no chunks", [&good[..8], &[b'x'; 100]].concat(), "decoded: its bytes are damaged; save"),
        ("jpeg marker", [&[0xff, 0xd8, 0xff, 0xe0], &[0; 50][..]].concat(), "decoded: it"),
    ];
    for (case, bytes, fragment) in cases {
        let mut glb = Glb::triangle();
        let view = glb.view(&bytes);
        glb.json["images"] = json!([{"bufferView": view}]);
        glb.json["textures"] = json!([{"source": 0}]);
        glb.json["materials"] = json!([{"normalTexture": {"index": 0}}]);
        assert_refused(case, glb.try_load(), fragment);
    }
}

/// The checksum of PNG chunks.
fn compute_crc(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
    !bytes.iter().fold(!0_u32, |crc, &b| (0..8).fold(crc ^ u32::from(b), step))
}
