//! Shot files: what they mean, and what is refused.

mod support;

use std::path::PathBuf;

use glam::{Vec3, vec3};
use manylight_scene::{Error, Light, Projection, Shot, Sky, load, parse_shot_text};
use serde_json::{Value, json};
use support::*;

/// A folder of its own with `t.glb`, a triangle of material "paint".
fn make_folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    let mut glb = Glb::triangle();
    glb.json["materials"] = json!([{"name": "paint"}, {"name": "lamp"}]);
    glb.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    glb.json["scenes"][0]["extras"] = json!({"sky_radiance": [1, 1, 1]});
    std::fs::write(folder.join("t.glb"), glb.bytes()).unwrap();
    folder
}

fn load_text(folder: &std::path::Path, file: &str, text: &str) -> Result<Shot, Error> {
    let path = folder.join(file);
    std::fs::write(&path, text).unwrap();
    load(&path.display().to_string())
}

fn good() -> Value {
    json!({
        "scene": "t.glb",
        "camera": {"position": [0, 2, 0], "target": [1, 2, 0], "up": [0, 1, 0], "vfov_deg": 60,
            "width": 1280, "height": 720},
        "lights": [
            {"type": "sun", "direction": [0, -2, 0], "irradiance": [20, 19, 17]},
            {"type": "point", "position": [0, 3, 0], "intensity": [50, 50, 50]},
            {"type": "spot", "position": [0, 3, 0], "direction": [0, -1, 0],
                "intensity": [80, 80, 80], "cone_deg": 40},
            {"type": "area", "corner": [0, 4, 0], "edge_u": [1, 0, 0], "edge_v": [0, 0, 1],
                "radiance": [9, 9, 8]},
            {"type": "sky", "radiance": [0.5, 0.65, 0.95]},
            {"type": "emissive", "material": "paint", "radiance": [30, 25, 20]},
        ],
        "settings": {"method": "grid", "anything": [1, 2]},
    })
}

#[test]
fn cameras_move_by_keys() {
    let folder = make_folder("keys");
    let mut shot = good();
    shot["camera"]["keys"] = json!([{"frame": 10, "position": [0, 4, 0]}, {"frame": 11}]);
    let shot = load_text(&folder, "keys.json", &shot.to_string()).unwrap();
    let at = |frame| shot.path.at(frame).unwrap();
    assert_eq!(at(0).position, shot.camera.position);
    assert!(at(5).position.abs_diff_eq(vec3(0.0, 3.0, 0.0), 1e-5));
    assert_eq!(at(11).position, vec3(0.0, 4.0, 0.0));
    assert!(at(12).forward.abs_diff_eq(vec3(1.0, -2.0, 0.0).normalize(), 1e-5));
    let still = load_text(&folder, "still.json", &good().to_string()).unwrap();
    assert!(still.path.is_empty());
}

#[test]
fn cameras_of_the_scene_are_chosen_by_name_or_number() {
    let folder = make_folder("cameras");
    let mut glb = Glb::triangle();
    glb.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.7}}]);
    glb.json["nodes"] = json!([
        {"mesh": 0, "translation": [0, 0, -2], "scale": [3, 1, 1]},
        {"camera": 0, "name": "front", "translation": [0, 0, 5]},
        {"camera": 0, "translation": [0, 0, 7]},
    ]);
    glb.json["scenes"] = json!([{"nodes": [0, 1, 2], "extras": {"sky_radiance": [1, 1, 1]}}]);
    std::fs::write(folder.join("t.glb"), glb.bytes()).unwrap();
    for (name, z) in [("front", 5.0), ("0", 5.0), ("1", 7.0)] {
        let shot = json!({"scene": "t.glb", "camera": name}).to_string();
        let shot = load_text(&folder, "shot.json", &shot).unwrap();
        assert_eq!(shot.camera.position.z, z, "{name}");
    }
    let unknown = json!({"scene": "t.glb", "camera": "back"}).to_string();
    let message = load_text(&folder, "shot.json", &unknown).unwrap_err().to_string();
    assert!(message.contains("camera: the scene has no camera \"back\""), "{message}");
    assert!(message.ends_with("it has: front, 1"), "{message}");

    // A stated camera gives way, with its keys; the size of its picture stays.
    let mut moving = good();
    moving["camera"]["keys"] = json!([{"frame": 10, "position": [0, 4, 0]}]);
    moving["lights"] = Value::Null;
    let mut shot = load_text(&folder, "shot.json", &moving.to_string()).unwrap();
    shot.use_camera("front", "--camera").unwrap();
    assert!(shot.path.is_empty() && shot.camera.position.z == 5.0);
    assert_eq!(shot.camera.size_px, Some([1280, 720]));
    let bounds = [vec3(0.0, 0.0, -2.0), vec3(3.0, 1.0, -2.0)];
    assert_eq!(shot.scene.bounds(), Some(bounds));
}

#[test]
fn every_part_of_a_shot_arrives() {
    let folder = make_folder("every_part");
    let shot = load_text(&folder, "shot.json", &good().to_string()).unwrap();
    assert_eq!(shot.settings["anything"], json!([1, 2]));
    assert_eq!(shot.camera.forward, Vec3::X);
    assert_eq!(shot.camera.size_px, Some([1280, 720]));
    let vfov_rad = 60_f32.to_radians();
    assert_eq!(shot.camera.projection, Projection::Perspective { vfov_rad });
    let [sun, point, Light::Spot { cos_inner, cos_outer, .. }] = shot.scene.lights[..] else {
        panic!("{:?}", shot.scene.lights)
    };
    let irradiance = vec3(20., 19., 17.);
    assert_eq!(sun, Light::Sun { direction: Vec3::NEG_Y, irradiance });
    assert!(matches!(point, Light::Point { .. }));
    // inner_deg defaults to three quarters of cone_deg.
    assert!((cos_outer - 40_f32.to_radians().cos()).abs() < 1e-6);
    assert!((cos_inner - 30_f32.to_radians().cos()).abs() < 1e-6);
    let Some(Sky::Constant(sky)) = shot.scene.sky else { panic!() };
    assert_eq!(sky, vec3(0.5, 0.65, 0.95));
    assert_eq!(shot.scene.materials[0].emission, vec3(30., 25., 20.));
    // The area light is a one-sided black quad that faces edge_u × edge_v.
    let mesh = shot.scene.meshes.last().unwrap();
    let material = &shot.scene.materials[mesh.material as usize];
    assert_eq!(mesh.triangles.len(), 2);
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        assert_eq!((b - a).cross(c - a), Vec3::NEG_Y);
    }
    assert_eq!((material.emission, material.double_sided), (vec3(9., 9., 8.), false));
    assert_eq!(material.base_color.truncate(), Vec3::ZERO);
}

#[test]
fn without_lights_the_file_shines_and_without_camera_one_is_placed() {
    let folder = make_folder("without_lights");
    let shot = load_text(&folder, "shot.json", r#"{"scene": "t.glb"}"#).unwrap();
    assert!(matches!(shot.scene.sky, Some(Sky::Constant(_))));
    assert_eq!(count_warnings(&shot, "no camera"), 1);
    assert_eq!(shot.camera.size_px, None);
}

#[test]
fn sky_maps_are_scaled_and_turned() {
    let folder = make_folder("sky_maps");
    let mut bytes = Vec::new();
    let texels = [image::Rgb([1.0_f32, 2.0, 4.0]), image::Rgb([0.5, 0.0, 0.25])];
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&texels, 2, 1).unwrap();
    std::fs::write(folder.join("sky.hdr"), bytes).unwrap();
    exr::prelude::write_rgb_file(folder.join("sky.exr"), 2, 1, |x, _| match x {
        0 => (1.0_f32, 2.0_f32, 4.0_f32),
        _ => (0.5, f32::NAN, 0.25),
    })
    .unwrap();
    for (file, bad_count) in [("sky.hdr", 0), ("sky.exr", 1)] {
        let light = json!({"type": "sky", "map": file, "rotation_deg": 90, "scale": 2});
        let text = json!({"scene": "t.glb", "lights": [light]}).to_string();
        let shot = load_text(&folder, "shot.json", &text).unwrap();
        let Some(Sky::Map(map)) = &shot.scene.sky else { panic!() };
        assert_eq!((map.width, map.height), (2, 1));
        assert_eq!(map.radiance[0], vec3(2., 4., 8.));
        assert!((map.rotation_rad - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
        assert_eq!(count_warnings(&shot, "sky texel"), bad_count);
    }
}

/// An OpenEXR file of 32768 × 32 texels with PIZ compression, and next to no bytes of them.
fn wide_exr(channels: usize) -> Vec<u8> {
    let attribute = |name: &str, kind: &str, value: &[u8]| {
        let length = (value.len() as u32).to_le_bytes();
        [name.as_bytes(), b"\0", kind.as_bytes(), b"\0", &length, value].concat()
    };
    let mut names: Vec<String> = (3..channels).map(|i| format!("c{i:06}")).collect();
    names.extend(["B", "G", "R"].map(str::to_owned));
    names.sort();
    let channel = |name: &String| {
        [name.as_bytes(), &[0, 2, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]].concat()
    };
    let list = [names.iter().flat_map(channel).collect(), vec![0]].concat();
    let window = [0, 0, 32767, 31_i32].map(i32::to_le_bytes).concat();
    let one = 1_f32.to_le_bytes();
    let mut bytes = [
        vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0],
        attribute("channels", "chlist", &list),
        attribute("compression", "compression", &[4]),
        attribute("dataWindow", "box2i", &window),
        attribute("displayWindow", "box2i", &window),
        attribute("lineOrder", "lineOrder", &[0]),
        attribute("pixelAspectRatio", "float", &one),
        attribute("screenWindowCenter", "v2f", &[0; 8]),
        attribute("screenWindowWidth", "float", &one),
        vec![0],
    ]
    .concat();
    let place = bytes.len() as u64 + 8;
    bytes.extend(place.to_le_bytes());
    bytes.extend([0, 100].map(i32::to_le_bytes).concat());
    bytes.resize(bytes.len() + 100, 0);
    bytes
}

#[test]
fn sky_maps_of_many_channels_are_refused_before_they_are_unpacked() {
    let folder = make_folder("many_channels");
    for (channels, fragment) in [(4003, "with 4003 channels; at most"), (3, "cannot be decoded")] {
        std::fs::write(folder.join("wide.exr"), wide_exr(channels)).unwrap();
        let light = json!({"type": "sky", "map": "wide.exr"});
        let text = json!({"scene": "t.glb", "lights": [light]}).to_string();
        let message = load_text(&folder, "shot.json", &text).unwrap_err().to_string();
        assert!(message.contains(fragment), "{message}");
    }
}

#[test]
fn a_shot_knows_its_files() {
    let folder = make_folder("files");
    let mut glb = Glb::triangle();
    glb.json["images"] = json!([{"uri": "not%20used.png"}, {"uri": "data:;base64,"}]);
    std::fs::write(folder.join("t.glb"), glb.bytes()).unwrap();
    exr::prelude::write_rgb_file(folder.join("sky.exr"), 1, 1, |_, _| (1.0, 1.0, 1.0)).unwrap();
    let text = r#"{"scene": "t.glb", "lights": [{"type": "sky", "map": "sky.exr"}]}"#;
    let shot = load_text(&folder, "shot.json", text).unwrap();
    let expected = ["shot.json", "t.glb", "not used.png", "sky.exr"].map(|name| folder.join(name));
    assert_eq!(shot.files, expected);
}

#[test]
fn lost_lights_are_the_reason_why_nothing_shines() {
    let folder = make_folder("lost_lights");
    let mut glb = Glb::triangle();
    glb.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
    let light = json!({"KHR_lights_punctual": {"light": 0}});
    glb.json["nodes"] = json!([{"mesh": 0}, {"translation": [0, 1e20, 0], "extensions": light}]);
    glb.json["scenes"][0]["nodes"] = json!([0, 1]);
    std::fs::write(folder.join("t.glb"), glb.bytes()).unwrap();
    let message = load_text(&folder, "shot.json", r#"{"scene": "t.glb"}"#).unwrap_err().to_string();
    assert!(message.contains("nothing shines in this shot: a light at coordinates"), "{message}");
}

#[test]
fn wrong_fields_are_refused_with_their_place() {
    let folder = make_folder("wrong_fields");
    std::fs::write(folder.join("text.hdr"), "hello").unwrap();
    std::fs::write(folder.join("cut.exr"), [0x76, 0x2f, 0x31, 0x01, 2, 0]).unwrap();
    let cases: Vec<(&str, Value, &str)> = vec![
        ("/scene", Value::Null, "`scene` is missing"),
        ("/scene", json!(""), "empty"),
        ("/scene", json!(3), "scene: the number 3"),
        ("/scene", json!("absent.glb"), "relative to the shot file"),
        ("/scene", json!("shot.json"), "is not glTF"),
        ("/scene", json!("."), "not a file"),
        ("/scene", json!("builtin:nowhere"), "no built-in scene \"nowhere\""),
        ("/extra", json!(1), "extra: unknown key; allowed: scene, camera, lights, settings"),
        ("/settings", json!([1]), "settings: a list"),
        ("/camera", json!(1), "camera: the number 1"),
        ("/camera", json!("front"), "no camera \"front\"; it has none"),
        ("/camera/vfov", json!(1), "camera.vfov: unknown key; allowed: position, target"),
        ("/camera/position", Value::Null, "camera: `position` is missing"),
        ("/camera/position", json!([0, 2]), "3 finite numbers"),
        ("/camera/position", json!([0, "2", 0]), "camera.position[1]"),
        ("/camera/position", json!([0, 1e200, 0]), "single precision"),
        ("/camera/position", json!([0, 1e30, 0]), "coordinates beyond ±1e9 m"),
        ("/camera/position", json!([0, 2e9, 0]), "coordinates beyond ±1e9 m"),
        ("/camera/target", json!([0, 2, 0]), "span no frame"),
        ("/camera/up", json!([1, 0, 0]), "span no frame"),
        ("/camera/up", json!([0, 0, 0]), "span no frame"),
        ("/camera/keys", json!({}), "camera.keys: an object found"),
        ("/camera/keys", json!([{"frame": 0}]), "camera.keys[0].frame: allowed: 1 to"),
        ("/camera/keys", json!([{"frame": 2}, {"frame": 2}]), "keys[1].frame: allowed: 3 to"),
        ("/camera/keys", json!([{"frame": 2.5}]), "a whole number"),
        ("/camera/keys", json!([{"frame": 2, "target": [0, 2, 0]}]), "span no frame"),
        ("/camera/keys", json!([{"frame": 2, "width": 4}]), "keys[0].width: unknown key"),
        ("/camera/keys", json!([{"frame": 2, "vfov_deg": 0}]), "keys[0].vfov_deg: 0 found"),
        ("/camera/vfov_deg", json!(0), "camera.vfov_deg: 0 found"),
        ("/camera/vfov_deg", json!(180), "below 180"),
        ("/camera/vfov_deg", json!("60"), "finite number"),
        ("/camera/width", json!(0), "1 to 65536"),
        ("/camera/width", json!(65537), "1 to 65536"),
        ("/camera/width", json!(12.5), "whole number"),
        ("/camera/width", Value::Null, "belong together"),
        ("/lights", json!({}), "lights: an object"),
        ("/lights", json!([]), "nothing shines"),
        ("/lights", json!([{"type": "sky", "radiance": [0, 0, 0]}]), "nothing shines"),
        (
            "/lights",
            json!([{"type": "emissive", "material": "lamp", "radiance": [1, 1, 1]}]),
            "nothing shines",
        ),
        ("/lights/0/type", Value::Null, "lights[0]: `type` is missing"),
        ("/lights/0/type", json!("moon"), "allowed: sun, point, spot, area, sky, emissive"),
        ("/lights/0/colour", json!(1), "lights[0].colour: unknown key"),
        ("/lights/0/direction", json!([0, 0, 0]), "no length"),
        ("/lights/0/irradiance", json!([1, -1, 0]), "lights[0].irradiance"),
        ("/lights/0/irradiance", json!(4), "3 finite numbers"),
        ("/lights/1/intensity", json!([1e20, 0, 0]), "0 to 1e15"),
        ("/lights/2/cone_deg", json!(91), "up to 90"),
        ("/lights/2/cone_deg", json!(0), "above 0"),
        ("/lights/2/inner_deg", json!(41), "up to cone_deg 40"),
        ("/lights/2/inner_deg", json!(-1), "above 0"),
        ("/lights/3/edge_v", json!([2, 0, 0]), "span no area"),
        ("/lights/3/edge_v", json!([0, 0, 2e9]), "lights[3].edge_v: coordinates beyond"),
        (
            "/lights/3",
            json!({"type": "area", "corner": [0, 0, 0], "edge_u": [1e9, 0, 0],
                "edge_v": [1e9, 0, 1e9], "radiance": [1, 1, 1]}),
            "lights[3]: coordinates beyond",
        ),
        ("/lights/3/radiance", Value::Null, "`radiance` is missing"),
        ("/lights/4/map", json!("sky.hdr"), "either `radiance` or `map`"),
        ("/lights/4/scale", json!(1), "lights[4].scale: unknown key"),
        ("/lights/4", json!({"type": "sky", "map": "none.hdr"}), "none.hdr"),
        ("/lights/4", json!({"type": "sky", "map": "text.hdr"}), "neither Radiance"),
        ("/lights/4", json!({"type": "sky", "map": "cut.exr"}), "cannot be decoded"),
        ("/lights/4", json!({"type": "sky", "map": "a.hdr", "scale": -1}), "lights[4].scale"),
        ("/lights/3", json!({"type": "sky", "radiance": [1, 1, 1]}), "more than one sky"),
        ("/lights/5/material", json!("pant"), "nearest of 2: paint, lamp"),
    ];
    for (pointer, value, fragment) in cases {
        let mut shot = good();
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        match shot.pointer_mut(parent).unwrap() {
            Value::Array(list) => list[key.parse::<usize>().unwrap()] = value.clone(),
            other => other[key] = value.clone(),
        }
        let result = load_text(&folder, "shot.json", &shot.to_string());
        let message = result.expect_err(&format!("{pointer} = {value}")).to_string();
        assert!(!message.contains('\n'), "{message:?}");
        assert!(message.contains(fragment), "{pointer} = {value}: «{message}» lacks «{fragment}»");
    }
}

#[test]
fn wrong_files_are_refused() {
    let folder = make_folder("wrong_files");
    for (text, fragment) in [
        ("", "the file is empty"),
        ("   ", "begins with neither"),
        ("hello", "begins with neither"),
        ("{", "line 1, column 1"),
        ("{\"scene\": 1e999}", "out of range"),
        ("{}", "`scene` is missing"),
        ("{\"asset\": 1}", "asset"),
        ("glTF", "cut short"),
    ] {
        let message = load_text(&folder, "file.json", text).expect_err(text).to_string();
        assert!(message.contains(fragment) && !message.contains('\n'), "{message:?} {fragment}");
    }
    for path in ["", "/nonexistent/shot.json", "builtin:", "builtin:\n"] {
        let message = load(path).expect_err(path).to_string();
        assert!(!message.contains('\n') && !message.is_empty(), "{message:?}");
    }
    assert!(parse_shot_text("a.json", "{\"scene\": \"x.glb\"}").unwrap().lights.is_none());
}
