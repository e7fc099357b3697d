//! Shot files: a scene, a camera, lights and settings in one JSON object.
//!
//! In: text · Out: [`ShotFile`], every number checked; unknown keys are errors naming their
//! place. Whether a named material exists is known only with the scene, see `load`.

use glam::Vec3;
use serde_json::{Map, Value};

use crate::json::{self, Item};
use crate::validate::MAX_COORDINATE;
use crate::{Camera, CameraKey, CameraPath, Error, Light};

/// Share of `cone_deg` at which a spot begins to fade where `inner_deg` is not stated.
const DEFAULT_INNER_SHARE: f32 = 0.75;
/// Largest number of pixels of a picture.
pub const MAX_PIXELS: usize = 1 << 28;
/// Largest picture side, pixels.
const MAX_SIDE_PX: usize = 65536;
/// Largest light value that a shot may state.
const MAX_VALUE: f32 = 1e15;

/// What a shot file says, before its scene is loaded.
#[derive(Clone, Debug)]
pub struct ShotFile {
    /// The scene: a glTF file relative to the shot file, or `builtin:NAME`.
    pub scene: String,
    /// The view; `None`: the scene's own first camera, else one that shows everything.
    pub camera: Option<Camera>,
    /// The scene's camera of this name or number takes the place of `camera`.
    pub camera_name: Option<String>,
    /// Where it is in the frames of a sequence.
    pub path: CameraPath,
    /// Replaces the scene's punctual lights and sky; `None`: everything in the scene shines.
    pub lights: Option<Vec<ShotLight>>,
    /// Settings of the renderer, untouched.
    pub settings: Map<String, Value>,
}

/// One entry of a shot's `lights`.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ShotLight {
    /// `sun`, `point` or `spot`.
    Punctual(Light),
    /// A parallelogram that shines on the side of edge_u × edge_v.
    Area {
        /// A corner, metres.
        corner: Vec3,
        /// From the corner along one edge, metres.
        edge_u: Vec3,
        /// From the corner along the other edge, metres.
        edge_v: Vec3,
        /// W·m⁻²·sr⁻¹.
        radiance: Vec3,
    },
    /// The same light from every direction at infinity.
    Sky {
        /// W·m⁻²·sr⁻¹.
        radiance: Vec3,
    },
    /// An equirectangular picture at infinity.
    SkyMap {
        /// `.hdr` or `.exr` file relative to the shot file.
        file: String,
        /// About +Y, counter-clockwise seen from above, radians.
        rotation_rad: f32,
        /// Multiplies the file's values.
        scale: f32,
    },
    /// Sets the emission of all materials of this name.
    Emissive {
        /// Material name.
        material: String,
        /// W·m⁻²·sr⁻¹.
        radiance: Vec3,
    },
}

/// Parses the text of a shot file; `name` stands for the file in messages.
///
/// Errors: [`Error::Invalid`] naming the key and its place, what stood there and what is allowed.
pub fn parse_shot_text(name: &str, text: &str) -> Result<ShotFile, Error> {
    let value = json::parse(name, text.as_bytes())?;
    parse_shot(&Item::root(name, &value))
}

/// The shot in a parsed document.
pub(crate) fn parse_shot(root: &Item<'_>) -> Result<ShotFile, Error> {
    root.check_keys(&["scene", "camera", "lights", "settings"])?;
    let scene_item = root.required("scene")?;
    let scene = scene_item.text()?.to_owned();
    if scene.trim().is_empty() {
        return Err(scene_item.fail("empty; name a .glb or .gltf file, or builtin:NAME"));
    }
    let camera_item = root.field("camera")?;
    let camera_name = camera_item.as_ref().and_then(|item| item.value.as_str());
    let camera_name = camera_name.map(str::to_owned);
    let stated = camera_item.filter(|_| camera_name.is_none());
    let camera = stated.map(|item| parse_camera(&item)).transpose()?;
    let (camera, path) = camera.map_or_else(Default::default, |(c, path)| (Some(c), path));
    let lights = match root.field("lights")? {
        Some(list) => {
            let lights: Vec<ShotLight> =
                list.items()?.iter().map(parse_light).collect::<Result<_, _>>()?;
            let is_sky =
                |l: &&ShotLight| matches!(l, ShotLight::Sky { .. } | ShotLight::SkyMap { .. });
            if lights.iter().filter(is_sky).count() > 1 {
                return Err(list.fail("more than one sky; keep one entry of type sky"));
            }
            Some(lights)
        }
        None => None,
    };
    let settings = match root.field("settings")? {
        Some(item) => item.map()?.clone(),
        None => Map::new(),
    };
    Ok(ShotFile { scene, camera, camera_name, path, lights, settings })
}

fn parse_camera(item: &Item<'_>) -> Result<(Camera, CameraPath), Error> {
    item.check_keys(&["position", "target", "up", "vfov_deg", "width", "height", "keys"])?;
    let first = CameraKey {
        frame: 0,
        position: parse_point(&item.required("position")?)?,
        target: parse_point(&item.required("target")?)?,
        up: item.field("up")?.map_or(Ok(Vec3::Y), |up| parse_point(&up))?,
        vfov_rad: parse_vfov(&item.required("vfov_deg")?)?,
    };
    let mut camera = first.camera().ok_or_else(|| no_frame(item))?;
    camera.size_px = parse_size(item)?;
    let path = match item.field("keys")? {
        Some(list) => parse_keys(first, &list)?,
        None => CameraPath::default(),
    };
    Ok((camera, path))
}

/// The views of later frames; what one does not state is as in the one before.
fn parse_keys(first: CameraKey, list: &Item<'_>) -> Result<CameraPath, Error> {
    let mut keys = vec![first];
    for item in list.items()? {
        item.check_keys(&["frame", "position", "target", "up", "vfov_deg"])?;
        let frame_item = item.required("frame")?;
        let mut key = keys[keys.len() - 1];
        key.frame = match u32::try_from(frame_item.whole()?) {
            Ok(frame) if frame > key.frame => frame,
            _ => {
                let least = key.frame.saturating_add(1);
                return Err(frame_item.fail(format!("allowed: {least} to {}", u32::MAX)));
            }
        };
        let point = |name: &str, last| item.field(name)?.map_or(Ok(last), |p| parse_point(&p));
        key.position = point("position", key.position)?;
        key.target = point("target", key.target)?;
        key.up = point("up", key.up)?;
        if let Some(vfov) = item.field("vfov_deg")? {
            key.vfov_rad = parse_vfov(&vfov)?;
        }
        key.camera().ok_or_else(|| no_frame(&item))?;
        keys.push(key);
    }
    Ok(CameraPath { keys })
}

/// A full vertical angle, radians.
fn parse_vfov(item: &Item<'_>) -> Result<f32, Error> {
    let degrees = item.single()?;
    if !(degrees > 0.0 && degrees < 180.0) {
        return Err(item.fail(format!("{degrees} found; allowed: above 0 and below 180")));
    }
    Ok(degrees.to_radians())
}

fn no_frame(item: &Item<'_>) -> Error {
    item.fail(
        "position, target and up span no frame; move the target away from the position and up \
         out of the line of sight",
    )
}

/// `width` and `height`, both or none.
fn parse_size(camera: &Item<'_>) -> Result<Option<[u32; 2]>, Error> {
    let side = |key: &str| -> Result<Option<u32>, Error> {
        let Some(item) = camera.field(key)? else { return Ok(None) };
        let n = item.whole()?;
        if n == 0 || n > MAX_SIDE_PX {
            return Err(item.fail(format!("{n} found; allowed: 1 to {MAX_SIDE_PX} pixels")));
        }
        Ok(Some(n as u32))
    };
    match (side("width")?, side("height")?) {
        (None, None) => Ok(None),
        (Some(w), Some(h)) if w as usize * h as usize <= MAX_PIXELS => Ok(Some([w, h])),
        (Some(w), Some(h)) => Err(camera.fail(format!(
            "width {w} × height {h} is too large; at most {MAX_PIXELS} pixels are allowed"
        ))),
        _ => Err(camera.fail("width and height belong together; state both or neither")),
    }
}

fn parse_light(item: &Item<'_>) -> Result<ShotLight, Error> {
    let kind = item.required("type")?;
    match kind.text()? {
        "sun" => {
            item.check_keys(&["type", "direction", "irradiance"])?;
            let direction = parse_direction(&item.required("direction")?)?;
            let irradiance = parse_radiometric(&item.required("irradiance")?)?;
            Ok(ShotLight::Punctual(Light::Sun { direction, irradiance }))
        }
        "point" => {
            item.check_keys(&["type", "position", "intensity"])?;
            let position = parse_point(&item.required("position")?)?;
            let intensity = parse_radiometric(&item.required("intensity")?)?;
            Ok(ShotLight::Punctual(Light::Point { position, intensity }))
        }
        "spot" => parse_spot(item),
        "area" => parse_area(item),
        "sky" => parse_sky(item),
        "emissive" => {
            item.check_keys(&["type", "material", "radiance"])?;
            let material = item.required("material")?.text()?.to_owned();
            let radiance = parse_radiometric(&item.required("radiance")?)?;
            Ok(ShotLight::Emissive { material, radiance })
        }
        other => Err(kind.fail(format!(
            "\"{other}\" is no light type; allowed: sun, point, spot, area, sky, emissive"
        ))),
    }
}

fn parse_spot(item: &Item<'_>) -> Result<ShotLight, Error> {
    item.check_keys(&["type", "position", "direction", "intensity", "cone_deg", "inner_deg"])?;
    let position = parse_point(&item.required("position")?)?;
    let direction = parse_direction(&item.required("direction")?)?;
    let intensity = parse_radiometric(&item.required("intensity")?)?;
    let cone_item = item.required("cone_deg")?;
    let cone = cone_item.single()?;
    if !(cone > 0.0 && cone <= 90.0) {
        return Err(
            cone_item.fail(format!("{cone} found; allowed: above 0, up to 90 (half angle)"))
        );
    }
    let mut inner = cone * DEFAULT_INNER_SHARE;
    if let Some(inner_item) = item.field("inner_deg")? {
        inner = inner_item.single()?;
        if !(inner > 0.0 && inner <= cone) {
            return Err(
                inner_item.fail(format!("{inner} found; allowed: above 0, up to cone_deg {cone}"))
            );
        }
    }
    // The falloff divides by the difference of the cosines: keep it above 0 in single precision.
    let cos_outer = f64::from(cone).to_radians().cos() as f32;
    let cos_outer = cos_outer.clamp(0.0, 1.0 - 2.0 * f32::EPSILON);
    let cos_inner = (f64::from(inner).to_radians().cos() as f32).max(cos_outer + f32::EPSILON);
    let spot = Light::Spot { position, direction, intensity, cos_outer, cos_inner };
    Ok(ShotLight::Punctual(spot))
}

fn parse_area(item: &Item<'_>) -> Result<ShotLight, Error> {
    item.check_keys(&["type", "corner", "edge_u", "edge_v", "radiance"])?;
    let corner = parse_point(&item.required("corner")?)?;
    let edge_u = parse_point(&item.required("edge_u")?)?;
    let edge_v = parse_point(&item.required("edge_v")?)?;
    let normal = edge_u.as_dvec3().cross(edge_v.as_dvec3());
    if normal.length() < 1e-18 || edge_u.cross(edge_v).try_normalize().is_none() {
        return Err(item.fail("edge_u and edge_v span no area; make them different directions"));
    }
    let corners = [corner + edge_u, corner + edge_v, corner + edge_u + edge_v];
    if corners.iter().any(|p| p.abs().max_element() > MAX_COORDINATE) {
        return Err(out_of_reach(item));
    }
    let radiance = parse_radiometric(&item.required("radiance")?)?;
    Ok(ShotLight::Area { corner, edge_u, edge_v, radiance })
}

fn parse_sky(item: &Item<'_>) -> Result<ShotLight, Error> {
    item.check_keys(&["type", "radiance", "map", "rotation_deg", "scale"])?;
    let map = item.field("map")?;
    let radiance = item.field("radiance")?;
    match (map, radiance) {
        (None, Some(radiance)) => {
            item.check_keys(&["type", "radiance"])?;
            Ok(ShotLight::Sky { radiance: parse_radiometric(&radiance)? })
        }
        (Some(map), None) => {
            let file = map.text()?.to_owned();
            let rotation = item.field("rotation_deg")?.map_or(Ok(0.0), |r| r.number())?;
            let rotation_rad = (rotation % 360.0).to_radians() as f32;
            let mut scale = 1.0;
            if let Some(scale_item) = item.field("scale")? {
                scale = scale_item.single()?;
                if !(0.0..=MAX_VALUE).contains(&scale) {
                    return Err(
                        scale_item.fail(format!("{scale} found; allowed: 0 to {MAX_VALUE:e}"))
                    );
                }
            }
            Ok(ShotLight::SkyMap { file, rotation_rad, scale })
        }
        _ => Err(item.fail("a sky needs either `radiance` or `map`; state one of them")),
    }
}

/// A position or edge within reach.
fn parse_point(item: &Item<'_>) -> Result<Vec3, Error> {
    let p = item.vec3()?;
    match p.abs().max_element() <= MAX_COORDINATE {
        true => Ok(p),
        false => Err(out_of_reach(item)),
    }
}

fn out_of_reach(item: &Item<'_>) -> Error {
    item.fail(format!("coordinates beyond ±{MAX_COORDINATE:e} m; move it nearer"))
}

/// A unit vector.
fn parse_direction(item: &Item<'_>) -> Result<Vec3, Error> {
    let direction = item.vec3()?.as_dvec3().try_normalize();
    direction
        .map(|d| d.as_vec3())
        .ok_or_else(|| item.fail("has no length; give the way the light travels, e.g. [0, -1, 0]"))
}

/// Three values of 0 or more.
fn parse_radiometric(item: &Item<'_>) -> Result<Vec3, Error> {
    let value = item.vec3()?;
    match value.min_element() >= 0.0 && value.max_element() <= MAX_VALUE {
        true => Ok(value),
        false => {
            Err(item.fail(format!("{value} found; allowed: three numbers from 0 to {MAX_VALUE:e}")))
        }
    }
}
