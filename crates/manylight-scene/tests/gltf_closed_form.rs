//! What glTF files mean, by cases small enough to work out by hand.

mod support;

use glam::{Vec2, Vec3, Vec4, vec2, vec3, vec4};
use manylight_scene::{AlphaMode, Light, Projection, Shot, Sky, Wrap};
use serde_json::{Value, json};
use support::*;

/// World positions of the first instance's first triangle.
fn first_triangle(shot: &Shot) -> [Vec3; 3] {
    let instance = shot.scene.instances[0];
    let mesh = &shot.scene.meshes[instance.mesh as usize];
    mesh.triangles[0]
        .map(|v| instance.world_from_object.transform_point3(mesh.positions[v as usize]))
}

fn assert_near(a: Vec3, b: Vec3) {
    assert!((a - b).length() < 1e-5, "{a} is not {b}");
}

#[test]
fn transforms_compose_from_the_root_down() {
    let mut glb = Glb::triangle();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    glb.json["nodes"] = json!([
        {"children": [1], "translation": [10, 0, 0], "rotation": [0, 0, half, half]},
        {"mesh": 0, "scale": [2, 3, 1]},
    ]);
    // (1,0,0) → scale (2,0,0) → quarter turn about z (0,2,0) → (10,2,0)
    let [a, b, c] = first_triangle(&glb.load());
    assert_near(a, vec3(10., 0., 0.));
    assert_near(b, vec3(10., 2., 0.));
    assert_near(c, vec3(7., 0., 0.));
}

#[test]
fn matrices_are_column_major_and_may_mirror_shear_and_flatten() {
    let mut glb = Glb::triangle();
    glb.json["nodes"][0]["matrix"] = json!([-1, 0, 0, 0, 5, 1, 0, 0, 0, 0, 0, 0, 7, 8, 9, 1]);
    let shot = glb.load();
    let [a, b, c] = first_triangle(&shot);
    assert_near(a, vec3(7., 8., 9.));
    assert_near(b, vec3(6., 8., 9.));
    assert_near(c, vec3(12., 9., 9.));
    assert!(shot.scene.instances[0].world_from_object.matrix3.determinant() == 0.0);
}

#[test]
fn strips_and_fans_keep_their_winding() {
    let quad = [0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.];
    let strip = Glb::indexed(&quad, 5, &[0, 1, 2, 3]).load();
    assert_eq!(strip.scene.meshes[0].triangles, [[0, 1, 2], [1, 3, 2]]);
    let fan = Glb::indexed(&quad, 6, &[0, 1, 3, 2]).load();
    assert_eq!(fan.scene.meshes[0].triangles, [[1, 3, 0], [3, 2, 0]]);
    for shot in [strip, fan] {
        let mesh = &shot.scene.meshes[0];
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            assert!((b - a).cross(c - a).z > 0.0);
        }
    }
}

#[test]
fn points_and_lines_are_counted_and_left_out() {
    let mut glb = Glb::triangle();
    let points = json!({"attributes": {"POSITION": 0}, "mode": 0});
    let lines = json!({"attributes": {"POSITION": 0}, "mode": 3});
    let own = glb.json["meshes"][0]["primitives"][0].clone();
    glb.json["meshes"][0]["primitives"] = json!([points, own, lines]);
    let shot = glb.load();
    assert_eq!(shot.scene.triangle_count(), 1);
    assert_eq!(count_warnings(&shot, "points or lines"), 2);
}

#[test]
fn sparse_values_replace_those_of_the_base_and_of_zeros() {
    let mut glb = Glb::triangle();
    let indices = glb.view(&[2, 0, 0, 0]);
    let values = glb.view(&f32s(&[0., 5., 0.]));
    let sparse = json!({"count": 1, "indices": {"bufferView": indices, "componentType": U8},
        "values": {"bufferView": values}});
    glb.json["accessors"][0]["sparse"] = sparse.clone();
    assert_near(first_triangle(&glb.load())[2], vec3(0., 5., 0.));
    // Normals from zeros: two of three are no directions and become the face normal.
    let normals = glb.push(
        "accessors",
        json!({"componentType": F32, "count": 3, "type": "VEC3", "sparse": sparse}),
    );
    glb.attribute("NORMAL", normals);
    let shot = glb.load();
    assert_eq!(shot.scene.meshes[0].normals, [Vec3::Z, Vec3::Z, Vec3::Y]);
    assert_eq!(count_warnings(&shot, "normal that is not a direction"), 2);
}

#[test]
fn quantized_attributes_decode_as_specified() {
    let mut glb = Glb::new();
    glb.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    // Positions: normalized i16 with a stride of 8; uv: normalized u8 with a stride of 4.
    let corners: [[i16; 4]; 3] = [[0, 0, 0, 9], [32767, 0, 0, 9], [0, -32768, 0, 9]];
    let bytes: Vec<u8> = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let positions = glb.accessor(&bytes, I16, 3, "VEC3");
    glb.json["bufferViews"][0]["byteStride"] = json!(8);
    glb.json["accessors"][0]["normalized"] = json!(true);
    let uvs = glb.accessor(&[0, 255, 9, 9, 51, 0, 9, 9, 255, 102, 9, 9], U8, 3, "VEC2");
    glb.json["bufferViews"][1]["byteStride"] = json!(4);
    glb.json["accessors"][1]["normalized"] = json!(true);
    let normals = glb.accessor(&[0, 0, 127, 0, 0, 0, 127, 0, 0, 0, 127, 0], I8, 3, "VEC3");
    glb.json["bufferViews"][2]["byteStride"] = json!(4);
    glb.json["accessors"][2]["normalized"] = json!(true);
    let attributes = json!({"POSITION": positions, "TEXCOORD_1": uvs, "NORMAL": normals});
    glb.json["meshes"] = json!([{"primitives": [{"attributes": attributes}]}]);
    let shot = glb.load();
    let mesh = &shot.scene.meshes[0];
    assert_eq!(mesh.positions, [vec3(0., 0., 0.), vec3(1., 0., 0.), vec3(0., -1., 0.)]);
    assert_eq!(mesh.uvs[1], [vec2(0., 1.), vec2(0.2, 0.), vec2(1., 0.4)]);
    assert!(mesh.uvs[0].is_empty());
    assert_eq!(mesh.normals, [Vec3::Z; 3]);
}

#[test]
fn shared_meshes_load_once_and_missing_normals_stay_empty() {
    let mut glb = Glb::triangle();
    glb.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "translation": [0, 0, 4]}]);
    glb.json["scenes"][0]["nodes"] = json!([0, 1]);
    let shot = glb.load();
    assert_eq!((shot.scene.meshes.len(), shot.scene.instances.len()), (1, 2));
    assert_eq!(shot.scene.instances[1].world_from_object.translation.z, 4.0);
    assert!(shot.scene.meshes[0].normals.is_empty());
}

#[test]
fn gpu_instances_multiply_after_the_node() {
    let mut glb = Glb::triangle();
    let t = glb.accessor(&f32s(&[1., 0., 0., 0., 2., 0.]), F32, 2, "VEC3");
    let s = glb.accessor(&f32s(&[1., 1., 1., 3., 3., 3.]), F32, 2, "VEC3");
    let attributes = json!({"TRANSLATION": t, "SCALE": s});
    glb.json["nodes"][0] = json!({"mesh": 0, "scale": [10, 10, 10],
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}});
    let shot = glb.load();
    let placed: Vec<_> = shot
        .scene
        .instances
        .iter()
        .map(|i| i.world_from_object.transform_point3(vec3(1., 0., 0.)))
        .collect();
    assert_eq!(placed, [vec3(20., 0., 0.), vec3(30., 20., 0.)]);
}

#[test]
fn skins_move_vertices_by_their_joints_and_not_by_their_node() {
    let mut glb = Glb::triangle();
    let normals = glb.accessor(&f32s(&[0., 0., 1., 0., 0., 1., 0., 0., 1.]), F32, 3, "VEC3");
    let joints = glb.accessor(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], U8, 3, "VEC4");
    let w = [1., 0., 0., 0., 1., 0., 0., 0., 1., 1., 0., 0.]; // the last sums to 2
    let weights = glb.accessor(&f32s(&w), F32, 3, "VEC4");
    glb.attribute("NORMAL", normals);
    glb.attribute("JOINTS_0", joints);
    glb.attribute("WEIGHTS_0", weights);
    let mut bind = vec![1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
    bind.extend([1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., -1., 1.]);
    let bind = glb.accessor(&f32s(&bind), F32, 2, "MAT4");
    glb.json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": bind}]);
    glb.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "translation": [99, 99, 99]},
        {"translation": [0, 0, 5], "children": [2]},
        {"translation": [2, 0, 0]},
    ]);
    glb.json["scenes"][0]["nodes"] = json!([0, 1]);
    let shot = glb.load();
    let [a, b, c] = first_triangle(&shot);
    assert_near(a, vec3(0., 0., 5.)); // joint 0: +(0,0,5)
    assert_near(b, vec3(3., 0., 4.)); // joint 1: +(2,0,5) − (0,0,1)
    assert_near(c, vec3(1., 1., 4.5)); // half of each
    assert_eq!(shot.scene.meshes[0].normals, [Vec3::Z; 3]);
}

#[test]
fn lights_shine_along_minus_z_with_their_own_units() {
    let mut glb = Glb::triangle();
    glb.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "directional", "color": [1, 0.5, 0], "intensity": 40},
        {"type": "point", "intensity": 3},
        {"type": "spot", "intensity": 2, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}},
    ]}});
    let light = |i: usize| json!({"KHR_lights_punctual": {"light": i}});
    let down = [-std::f32::consts::FRAC_1_SQRT_2, 0., 0., std::f32::consts::FRAC_1_SQRT_2];
    glb.json["nodes"] = json!([
        {"mesh": 0},
        {"extensions": light(0), "rotation": down, "scale": [3, 3, 3]},
        {"extensions": light(1), "translation": [1, 2, 3]},
        {"extensions": light(2), "translation": [0, 2, 0]},
    ]);
    glb.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    let shot = glb.load();
    let [Light::Sun { direction, irradiance }, point, spot] = shot.scene.lights[..] else {
        panic!("{:?}", shot.scene.lights)
    };
    assert_near(direction, Vec3::NEG_Y);
    assert_eq!(irradiance, vec3(40., 20., 0.));
    let intensity = Vec3::splat(3.0);
    assert_eq!(point, Light::Point { position: vec3(1., 2., 3.), intensity });
    let Light::Spot { direction, cos_inner, cos_outer, .. } = spot else { panic!() };
    assert_near(direction, Vec3::NEG_Z);
    assert_eq!((cos_inner, cos_outer), (0.1_f32.cos(), 0.5_f32.cos()));
    assert_eq!(count_warnings(&shot, "sun was added"), 0);
}

#[test]
fn sky_comes_from_the_extras_of_the_scene() {
    let mut glb = Glb::triangle();
    glb.json["scenes"][0]["extras"] = json!({"sky_radiance": [1, 2, 3]});
    let Some(Sky::Constant(radiance)) = glb.load().scene.sky else { panic!() };
    assert_eq!(radiance, vec3(1., 2., 3.));
}

#[test]
fn cameras_look_along_minus_z() {
    let mut glb = Glb::triangle();
    glb.json["cameras"] = json!([
        {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}},
        {"type": "orthographic", "orthographic": {"xmag": 4, "ymag": 2, "znear": 0, "zfar": 9}},
    ]);
    glb.json["nodes"] = json!([
        {"mesh": 0},
        {"camera": 0, "name": "main", "translation": [0, 0, 5], "rotation": [0, 1, 0, 0]},
        {"camera": 1},
    ]);
    glb.json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    let shot = glb.load();
    let camera = &shot.camera;
    assert_eq!(camera.name, "main");
    assert_near(camera.forward, Vec3::Z);
    assert_near(camera.up, Vec3::Y);
    assert_eq!(camera.projection, Projection::Perspective { vfov_rad: 0.7 });
    let ortho = shot.scene.cameras[1].projection;
    assert_eq!(ortho, Projection::Orthographic { half_height: 2.0 });
}

#[test]
fn bare_scenes_get_a_sun_and_a_camera_that_sees_everything() {
    let shot = Glb::triangle().load();
    assert_eq!(count_warnings(&shot, "sun was added"), 1);
    assert_eq!(count_warnings(&shot, "no camera"), 1);
    let camera = &shot.camera;
    let Projection::Perspective { vfov_rad } = camera.projection else { panic!() };
    for corner in first_triangle(&shot) {
        let cos = (corner - camera.position).normalize().dot(camera.forward);
        assert!(cos > (vfov_rad / 2.0).cos());
    }
}

#[test]
fn materials_keep_what_the_file_says() {
    let mut glb = Glb::triangle();
    glb.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    glb.json["materials"] = json!([{
        "name": "m", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
        "emissiveFactor": [1, 0.5, 0],
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5,
            "roughnessFactor": 7},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8},
            "KHR_materials_transmission": {"transmissionFactor": 0.75},
            "KHR_materials_ior": {"ior": 1.25}, "KHR_materials_unlit": {}},
    }]);
    let shot = glb.load();
    let m = &shot.scene.materials[0];
    assert_eq!((m.name.as_str(), m.double_sided, m.unlit), ("m", true, true));
    assert_eq!(m.alpha_mode, AlphaMode::Mask(0.25));
    assert_eq!(m.emission, vec3(8., 4., 0.));
    assert_eq!(m.base_color, vec4(0.1, 0.2, 0.3, 0.4));
    assert_eq!((m.metallic, m.roughness), (0.5, 1.0));
    assert_eq!((m.transmission, m.ior), (0.75, 1.25));
    assert_eq!(count_warnings(&shot, "factor outside"), 1);
    // An unlit material is no light, so the bare scene got a sun.
    assert_eq!(count_warnings(&shot, "sun was added"), 1);
}

#[test]
fn textures_keep_wrap_filter_transform_and_texels() {
    let mut glb = Glb::triangle();
    let texels = [255, 0, 0, 255, 0, 255, 0, 128];
    let view = glb.view(&encode_png(2, 1, &texels));
    glb.json["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
    glb.json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}]);
    glb.json["textures"] = json!([{"source": 0, "sampler": 0}, {"source": 0}]);
    let quarter = std::f32::consts::FRAC_PI_2;
    glb.json["materials"] = json!([{"pbrMetallicRoughness": {
        "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform":
            {"offset": [0, 1], "rotation": quarter, "scale": [0.5, 0.5], "texCoord": 1}}},
        "metallicRoughnessTexture": {"index": 1},
    }}]);
    let shot = glb.load();
    let m = &shot.scene.materials[0];
    let slot = m.base_color_texture.unwrap();
    assert_eq!(slot.wrap, [Wrap::Clamp, Wrap::Mirror]);
    assert_eq!((slot.uv_set, slot.linear_filter), (1, false));
    // The extension's own example: the lower left quadrant, turned by a quarter.
    let mapped = |uv: Vec2| slot.transform.transform_point2(uv);
    assert!((mapped(vec2(0., 0.)) - vec2(0., 1.)).length() < 1e-6);
    assert!((mapped(vec2(1., 0.)) - vec2(0., 0.5)).length() < 1e-6);
    assert!((mapped(vec2(0., 1.)) - vec2(0.5, 1.)).length() < 1e-6);
    let other = m.metallic_roughness_texture.unwrap();
    assert_eq!((other.wrap, other.linear_filter), ([Wrap::Repeat; 2], true));
    // Both textures share one decoded image.
    assert_eq!((shot.scene.images.len(), other.image), (1, slot.image));
    assert_eq!(shot.scene.images[0].texels, [[255, 0, 0, 255], [0, 255, 0, 128]]);
}

#[test]
fn text_files_with_data_uris_load() {
    // Three corners of the triangle in base64.
    let data = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    let mut glb = Glb::triangle();
    glb.json["buffers"] = json!([{"byteLength": 36,
        "uri": format!("data:application/octet-stream;base64,{data}")}]);
    let text = format!("\u{feff} {}", glb.json);
    let shot = manylight_scene::load_gltf_bytes("t.gltf", text.as_bytes()).unwrap();
    assert_eq!(first_triangle(&shot), [Vec3::ZERO, Vec3::X, Vec3::Y]);
}

#[test]
fn only_used_vertices_of_a_long_list_are_kept() {
    let mut positions = vec![0.0; 3 * 100];
    positions.extend(TRIANGLE);
    let mut glb = Glb::indexed(&positions, 4, &[100, 101, 102]);
    let colors: Vec<f32> = (0..103).flat_map(|i| [i as f32 / 103.0, 0., 0.]).collect();
    let accessor = glb.accessor(&f32s(&colors), F32, 103, "VEC3");
    glb.attribute("COLOR_0", accessor);
    let shot = glb.load();
    let mesh = &shot.scene.meshes[0];
    assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert_eq!(mesh.colors[2], Vec4::new(102.0 / 103.0, 0., 0., 1.));
}

#[test]
fn unusable_geometry_is_dropped_and_counted() {
    let mut positions = TRIANGLE.to_vec();
    positions.extend([f32::NAN, 0., 0., f32::INFINITY, 0., 0., 1e30, 1., 1.]);
    positions.extend([0., 0., 0., 1., 1., 1., 2., 2., 2.]);
    let mut glb = Glb::with_positions(&positions);
    let uvs = [f32::NAN; 18];
    let accessor = glb.accessor(&f32s(&uvs), F32, 9, "VEC2");
    glb.attribute("TEXCOORD_0", accessor);
    let colors = [f32::INFINITY; 36];
    let accessor = glb.accessor(&f32s(&colors), F32, 9, "VEC4");
    glb.attribute("COLOR_0", accessor);
    let shot = glb.load();
    let mesh = &shot.scene.meshes[0];
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert!(mesh.positions.iter().all(|p| p.is_finite()));
    assert_eq!(count_warnings(&shot, "not finite or beyond 1e9 m"), 1);
    assert_eq!(count_warnings(&shot, "without area"), 1);
    assert_eq!(mesh.uvs[0], [Vec2::ZERO; 9]);
    assert_eq!(mesh.colors, [Vec4::ONE; 9]);
}

#[test]
fn far_placements_are_left_out_and_counted() {
    let mut glb = Glb::triangle();
    glb.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "scale": [1e38, 1, 1]}]);
    glb.json["scenes"][0]["nodes"] = json!([0, 1]);
    let shot = glb.load();
    assert_eq!(shot.scene.instances.len(), 1);
    assert_eq!(count_warnings(&shot, "left out"), 1);
    // What counts is where the mesh ends up.
    let mut glb = Glb::with_positions(&TRIANGLE.map(|x| x * 1e5));
    glb.json["nodes"][0]["translation"] = json!([9e8, 0, 0]);
    assert_eq!(glb.load().scene.instances.len(), 1);
    glb.json["nodes"][0]["scale"] = json!([2e4, 1, 1]);
    let message = glb.try_load().unwrap_err().to_string();
    assert!(message.contains("no triangles to show: a mesh placed at"), "{message}");
}

#[test]
fn far_lights_and_cameras_are_left_out_and_counted() {
    let mut glb = Glb::triangle();
    glb.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point"}, {"type": "spot"}, {"type": "directional"}]}});
    let camera = |kind: &str, key: &str| json!({"type": kind, kind: {key: 1}});
    let wide = json!({"type": "orthographic", "orthographic": {"ymag": 1e30}});
    glb.json["cameras"] =
        json!([camera("perspective", "yfov"), camera("orthographic", "ymag"), wide]);
    let far = |carried: Value, x: f64| {
        let mut node = json!({"translation": [0, x, 0]});
        node.as_object_mut().unwrap().append(carried.clone().as_object_mut().unwrap());
        node
    };
    let light = |i: usize| json!({"extensions": {"KHR_lights_punctual": {"light": i}}});
    let nodes = (0..3).flat_map(|i| [1e20, 2e9, 1e9].map(|x| far(light(i), x)));
    let cameras = (0..2).flat_map(|i| [1e20, 1e9].map(|x| far(json!({"camera": i}), x)));
    let nodes: Vec<_> =
        nodes.chain(cameras).chain([json!({"mesh": 0}), json!({"camera": 2})]).collect();
    glb.json["scenes"][0]["nodes"] = (0..nodes.len()).collect();
    glb.json["nodes"] = json!(nodes);
    let shot = glb.load();
    assert_eq!(shot.scene.lights.len(), 5, "suns have no place");
    assert_eq!(count_warnings(&shot, "a light at coordinates"), 4);
    assert_eq!(shot.scene.cameras.len(), 2);
    assert_eq!(count_warnings(&shot, "a camera at coordinates"), 2);
    assert_eq!(count_warnings(&shot, "impossible angle or size"), 1);
}

#[test]
fn small_scenes_are_framed() {
    for scale in [1e6, 1.0, 1e-4, 1e-9] {
        let shot = Glb::with_positions(&TRIANGLE.map(|x| x * scale)).load();
        let to_middle = vec3(0.5, 0.5, 0.0) * scale - shot.camera.position;
        assert!(to_middle.length() < 3.0 * scale, "{scale}: {to_middle}");
    }
    // What is too small for any picture is for the renderer to say.
    assert!(Glb::with_positions(&TRIANGLE.map(|x| x * 1e-18)).try_load().is_ok());
    // A speck far away: another place in single precision.
    let shot = Glb::with_positions(&TRIANGLE.map(|x| 1e3 + x * 1e-3)).load();
    assert!(shot.camera.position.distance(vec3(1e3, 1e3, 1e3)) > 1e-3);
}

#[test]
fn images_that_share_bytes_are_decoded_once() {
    let mut glb = Glb::triangle();
    let view = glb.view(&encode_png(2, 2, &[7; 16]));
    glb.json["images"] = json!(vec![json!({"bufferView": view}); 3]);
    glb.json["textures"] = (0..3).map(|i| json!({"source": i})).collect();
    glb.json["materials"] = (0..3).map(|i| json!({"normalTexture": {"index": i}})).collect();
    assert_eq!(glb.load().scene.images.len(), 1);
}
