//! From a name to a [`Shot`]: which format, which scene, which camera, which lights.

use std::path::{Path, PathBuf};

use glam::{Affine3A, Vec3};
use serde_json::{Map, Value};

use crate::error::Warnings;
use crate::json::{self, Item};
use crate::shot::{self, ShotFile, ShotLight};
use crate::{
    BUILTINS, Camera, CameraPath, Error, Instance, Light, Material, Mesh, Scene, Shot, Sky,
    builtin, gltf, sky, validate,
};

/// Full vertical angle of a camera that is placed by the program, degrees.
const FRAMED_VFOV_DEG: f32 = 45.0;
/// From the middle of the scene toward such a camera.
const FRAMED_FROM: Vec3 = Vec3::new(0.5, 0.35, 1.0);
/// The way the sun of a bare scene without light travels.
const DEFAULT_SUN: Vec3 = Vec3::new(-0.4, -1.0, -0.3);
/// Its irradiance, W·m⁻².
const DEFAULT_SUN_IRRADIANCE: f32 = 5.0;

/// Loads a shot file (`.json`), a bare scene (`.glb`, `.gltf`) or `builtin:NAME`.
///
/// The content decides which it is, not the name's ending. A bare scene is seen by its first
/// camera, else by one that shows everything; where nothing in it shines, a sun is added. Both
/// are told in [`Shot::warnings`].
///
/// Errors: one sentence naming file, place, what was allowed and what to do.
pub fn load(path: &str) -> Result<Shot, Error> {
    if let Some(name) = path.strip_prefix("builtin:") {
        return find_builtin(path, name);
    }
    let folder = Path::new(path).parent();
    let mut files = vec![PathBuf::from(path)];
    let bytes = gltf::read_file(Path::new(path))?;
    match identify(path, &bytes)? {
        Content::Scene => {
            let mut warnings = Warnings::default();
            let scene = gltf::load_scene(path, &bytes, folder, &mut files, &mut warnings)?;
            finish_bare(scene, files, warnings)
        }
        Content::Shot(value) => {
            let file = shot::parse_shot(&Item::root(path, &value))?;
            build_shot(path, file, files, folder)
        }
    }
}

/// Loads a bare scene from the bytes of a `.glb` or `.gltf` file; `name` stands for it in
/// messages. External files cannot be reached.
///
/// Errors: as [`load`].
pub fn load_gltf_bytes(name: &str, bytes: &[u8]) -> Result<Shot, Error> {
    let mut warnings = Warnings::default();
    let scene = gltf::load_scene(name, bytes, None, &mut Vec::new(), &mut warnings)?;
    finish_bare(scene, Vec::new(), warnings)
}

enum Content {
    Scene,
    Shot(Value),
}

/// Tells glTF from shots by their content.
fn identify(path: &str, bytes: &[u8]) -> Result<Content, Error> {
    if bytes.is_empty() {
        return Err(Error::invalid(path, "the file is empty; give a shot, .gltf or .glb file"));
    }
    if gltf::is_glb(bytes) {
        return Ok(Content::Scene);
    }
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if text.iter().find(|c| !c.is_ascii_whitespace()) != Some(&b'{') {
        return Err(Error::invalid(
            path,
            "neither a shot (JSON) nor glTF (.gltf, .glb): it begins with neither `{` nor `glTF`; \
             give one of these files",
        ));
    }
    let value = json::parse(path, text)?;
    match value.get("asset") {
        Some(_) => Ok(Content::Scene),
        None => Ok(Content::Shot(value)),
    }
}

fn find_builtin(place: &str, name: &str) -> Result<Shot, Error> {
    builtin(name).ok_or_else(|| {
        let known = BUILTINS.join(", ");
        Error::invalid(place, format!("no built-in scene \"{name}\"; there are: {known}"))
    })
}

/// A scene without a shot file: its own camera and lights, or ours.
fn finish_bare(
    mut scene: Scene,
    files: Vec<PathBuf>,
    mut warnings: Warnings,
) -> Result<Shot, Error> {
    validate::check_geometry(&scene, &warnings)?;
    if !validate::shines(&scene) {
        let irradiance = Vec3::splat(DEFAULT_SUN_IRRADIANCE);
        scene.lights.push(Light::Sun { direction: DEFAULT_SUN.normalize(), irradiance });
        warnings.add("nothing in the file shines, so a sun was added", 1);
    }
    let camera = choose_camera(&scene, &mut warnings)?;
    Ok(Shot {
        scene,
        camera,
        path: CameraPath::default(),
        settings: Map::new(),
        warnings: warnings.0,
        files,
    })
}

/// A shot file with its scene.
fn build_shot(
    path: &str,
    file: ShotFile,
    mut files: Vec<PathBuf>,
    folder: Option<&Path>,
) -> Result<Shot, Error> {
    let mut warnings = Warnings::default();
    let beside = |name: &str| folder.unwrap_or(Path::new("")).join(name);
    let mut own_camera = None;
    let mut scene = match file.scene.strip_prefix("builtin:") {
        Some(name) => {
            let shot = find_builtin(&format!("{path}: scene"), name)?;
            own_camera = Some(shot.camera);
            warnings.0 = shot.warnings;
            shot.scene
        }
        None => load_shot_scene(path, &beside(&file.scene), &mut files, &mut warnings)?,
    };
    if let Some(lights) = file.lights {
        scene.lights.clear();
        scene.sky = None;
        // Materials of the file first, so that none of our own can be meant by name.
        let is_late = |light: &ShotLight| !matches!(light, ShotLight::Emissive { .. });
        let mut lights: Vec<_> = lights.into_iter().enumerate().collect();
        lights.sort_by_key(|(_, light)| is_late(light));
        for (i, light) in lights {
            let place = format!("{path}: lights[{i}]");
            match light {
                ShotLight::SkyMap { file, rotation_rad, scale } => {
                    let file = beside(&file);
                    let map = sky::load_sky_map(&file, rotation_rad, scale, &mut warnings)?;
                    scene.sky = Some(Sky::Map(map));
                    files.push(file);
                }
                light => apply_light(&mut scene, light, &place)?,
            }
        }
    }
    validate::check_geometry(&scene, &warnings)?;
    validate::check_light(&scene, path, &warnings)?;
    let camera = match (&file.camera_name, file.camera.or(own_camera)) {
        (Some(name), _) => find_camera(&scene, name, &format!("{path}: camera"))?.clone(),
        (None, Some(camera)) => camera,
        (None, None) => choose_camera(&scene, &mut warnings)?,
    };
    let (path, settings) = (file.path, file.settings);
    Ok(Shot { scene, camera, path, settings, warnings: warnings.0, files })
}

fn load_shot_scene(
    shot: &str,
    path: &Path,
    files: &mut Vec<PathBuf>,
    warnings: &mut Warnings,
) -> Result<Scene, Error> {
    files.push(path.to_owned());
    let name = path.display().to_string();
    let bytes = gltf::read_file(path).map_err(|e| match e {
        Error::Read { path, reason } => Error::invalid(
            &format!("{shot}: scene"),
            format!("cannot read {path}: {reason}; the path is relative to the shot file"),
        ),
        other => other,
    })?;
    match identify(&name, &bytes)? {
        Content::Scene => gltf::load_scene(&name, &bytes, path.parent(), files, warnings),
        Content::Shot(_) => Err(Error::invalid(
            &format!("{shot}: scene"),
            format!("{name} is not glTF; name a .glb or .gltf file, or builtin:NAME"),
        )),
    }
}

/// Adds one light of a shot to the scene.
fn apply_light(scene: &mut Scene, light: ShotLight, place: &str) -> Result<(), Error> {
    match light {
        ShotLight::Punctual(light) => scene.lights.push(light),
        ShotLight::Sky { radiance } => scene.sky = Some(Sky::Constant(radiance)),
        ShotLight::SkyMap { .. } => {} // needs a file: the caller's
        ShotLight::Area { corner, edge_u, edge_v, radiance } => {
            add_area_light(scene, [corner, edge_u, edge_v], radiance);
        }
        ShotLight::Emissive { material, radiance } => {
            let mut found = false;
            for m in scene.materials.iter_mut().filter(|m| m.name == material) {
                // The stated radiance holds everywhere: neither textured nor hidden by `unlit`.
                m.emission = radiance;
                m.emission_texture = None;
                m.unlit = false;
                found = true;
            }
            if !found {
                let near = find_near_names(scene, &material);
                return Err(Error::invalid(
                    &format!("{place}.material"),
                    format!("the scene has no material \"{material}\"; {near}"),
                ));
            }
        }
    }
    Ok(())
}

/// A parallelogram of black, one-sided emitting material: corner, edge_u, edge_v.
fn add_area_light(scene: &mut Scene, [corner, edge_u, edge_v]: [Vec3; 3], radiance: Vec3) {
    let mut material = Material::lambertian("area light", Vec3::ZERO);
    material.emission = radiance;
    let normal = edge_u.as_dvec3().cross(edge_v.as_dvec3()).normalize_or(glam::DVec3::Y);
    let mesh = Mesh {
        name: "area light".to_owned(),
        positions: vec![corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v],
        normals: vec![normal.as_vec3(); 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        material: scene.materials.len() as u32,
        ..Mesh::default()
    };
    let mesh_index = scene.meshes.len() as u32;
    scene.materials.push(material);
    scene.meshes.push(mesh);
    let world_from_object = Affine3A::IDENTITY;
    scene.instances.push(Instance { mesh: mesh_index, world_from_object });
}

/// The material names most like `wanted`, as advice.
fn find_near_names(scene: &Scene, wanted: &str) -> String {
    let wanted = wanted.to_lowercase();
    let mut names: Vec<(usize, &str)> = scene
        .materials
        .iter()
        .take(4096)
        .map(|m| (edit_distance(&wanted, &m.name.to_lowercase()), m.name.as_str()))
        .collect();
    names.sort();
    names.dedup();
    let shown: Vec<&str> = names.iter().take(6).map(|(_, name)| *name).collect();
    match shown.is_empty() {
        true => "it has no materials".to_owned(),
        false => format!("nearest of {}: {}", names.len(), shown.join(", ")),
    }
}

/// Insertions, deletions and replacements between the first 40 characters of two names.
fn edit_distance(a: &str, b: &str) -> usize {
    let a: Vec<char> = a.chars().take(40).collect();
    let b: Vec<char> = b.chars().take(40).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(ca != cb);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

/// Longest list of names in a message.
const MAX_NAMES: usize = 20;

/// The scene's camera of this name, else of this number, counted from 0.
pub(crate) fn find_camera<'a>(
    scene: &'a Scene,
    name: &str,
    place: &str,
) -> Result<&'a Camera, Error> {
    let cameras = &scene.cameras;
    let by_name = cameras.iter().find(|camera| camera.name == name);
    let by_number = || name.parse().ok().and_then(|number: usize| cameras.get(number));
    by_name.or_else(by_number).ok_or_else(|| {
        let shown = cameras.iter().take(MAX_NAMES).enumerate();
        let name_of = |(i, camera): (usize, &Camera)| match camera.name.is_empty() {
            true => i.to_string(),
            false => camera.name.clone(),
        };
        let names: Vec<String> = shown.map(name_of).collect();
        let known = match names.is_empty() {
            true => "it has none; state position, target and vfov_deg in a shot".to_owned(),
            false => format!("by name or number it has: {}", names.join(", ")),
        };
        Error::invalid(place, format!("the scene has no camera \"{name}\"; {known}"))
    })
}

/// The scene's first camera, else one that shows everything.
fn choose_camera(scene: &Scene, warnings: &mut Warnings) -> Result<Camera, Error> {
    if let Some(camera) = scene.cameras.first() {
        return Ok(camera.clone());
    }
    warnings.add("the file has no camera, so one that shows everything was placed", 1);
    frame_camera(scene).ok_or_else(|| {
        Error::invalid(&scene.name, "no camera can show this scene; add one to the file")
    })
}

/// A camera outside the bounding sphere of the scene's box, looking at its middle.
fn frame_camera(scene: &Scene) -> Option<Camera> {
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let boxes: Vec<[Vec3; 2]> = scene.meshes.iter().map(bound_mesh).collect();
    for instance in &scene.instances {
        let [low, high] = *boxes.get(instance.mesh as usize)?;
        for corner in 0..8 {
            let is_high = |axis: u32| corner >> axis & 1 == 1;
            let corner = Vec3::select(glam::BVec3::from_array([0, 1, 2].map(is_high)), high, low);
            let p = instance.world_from_object.transform_point3(corner);
            (min, max) = (min.min(p), max.max(p));
        }
    }
    let center = (min + max) / 2.0;
    let vfov_rad = FRAMED_VFOV_DEG.to_radians();
    // Far enough to be another place than the middle in single precision; in a scene that is
    // smaller than the last number nothing can be rendered.
    let least = (center.abs().max_element() * 1e-5).max(1e-13);
    let distance = ((max - min).length() / 2.0).max(least) / (vfov_rad / 2.0).sin();
    let position = center + FRAMED_FROM.normalize() * distance;
    Camera::look_at(position, center, Vec3::Y, vfov_rad)
}

/// Smallest and largest coordinates of the vertices that triangles use.
fn bound_mesh(mesh: &Mesh) -> [Vec3; 2] {
    let used = mesh.triangles.iter().flatten().map(|&v| mesh.positions[v as usize]);
    used.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
}
