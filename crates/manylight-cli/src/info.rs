//! `manylight info`, `devices` and `methods`

use crate::args::{InfoArgs, JsonArg, SettingArgs};
use crate::{Failure, Outcome, render};
use manylight::gpu::{AdapterDescription, Feature};
use manylight::settings::{Method, PRESETS};
use manylight_scene::{Camera, Light, Projection, Scene, Sky};
use serde_json::{Value, json};
use std::io::Write;

/// Most names of materials listed for people.
const MAX_NAMES: usize = 50;

/// Prints what is in a scene.
pub fn run_info(args: &InfoArgs) -> Result<Outcome, Failure> {
    // Its warnings are a row.
    let shot = render::load(&args.scene, args.camera.as_deref(), true)?;
    let shared = SettingArgs::default();
    render::settings(&shared, &shot)?;
    let size = render::size(&shared, &shot.camera)?;
    let scene = &shot.scene;
    let kinds = |f: fn(&Light) -> bool| scene.lights.iter().filter(|l| f(l)).count();
    let sky = match &scene.sky {
        None => "none".to_owned(),
        Some(Sky::Constant(r)) => format!("constant {r}"),
        Some(Sky::Map(m)) => format!("map {}x{}", m.width, m.height),
    };
    let bounds = scene.bounds().unwrap_or_default().map(|p| p.to_array().map(number));
    let names = scene.materials.iter().map(|m| m.name.as_str());
    let mut rows: Vec<(&str, Value)> = vec![
        ("triangles", json!(scene.triangle_count())),
        ("meshes", json!(scene.meshes.len())),
        ("instances", json!(scene.instances.len())),
        ("bounds_m", json!(bounds)),
        ("materials", json!(scene.materials.len())),
        ("material_names", listed(names, args.json)),
        ("images", json!(scene.images.len())),
        ("emissive_triangles", json!(emissive_triangles(scene))),
        ("suns", json!(kinds(|l| matches!(l, Light::Sun { .. })))),
        ("point_lights", json!(kinds(|l| matches!(l, Light::Point { .. })))),
        ("spot_lights", json!(kinds(|l| matches!(l, Light::Spot { .. })))),
        ("sky", json!(sky)),
        ("cameras", scene.cameras.iter().enumerate().map(camera_name).collect()),
    ];
    rows.extend(camera_rows(&shot.camera));
    rows.push(("size", json!(size)));
    rows.push(("settings", Value::Object(shot.settings.clone())));
    rows.push(("warnings", shot.warnings.iter().map(ToString::to_string).collect()));
    print_rows(&rows, args.json)
}

/// Names, for people no more than can be read.
fn listed<'a>(names: impl ExactSizeIterator<Item = &'a str>, all: bool) -> Value {
    let more = if all { 0 } else { names.len().saturating_sub(MAX_NAMES) };
    let shown = names.len() - more;
    let rest = (more > 0).then(|| format!("… and {more} more; --json has all"));
    names.take(shown).map(str::to_owned).chain(rest).collect()
}

/// What `--camera` takes for a camera of the scene: its name, or its number where it has none.
fn camera_name((i, camera): (usize, &Camera)) -> String {
    if camera.name.is_empty() { i.to_string() } else { camera.name.clone() }
}

/// The camera that a picture is seen through.
fn camera_rows(camera: &Camera) -> Vec<(&'static str, Value)> {
    let lens = match camera.projection {
        Projection::Perspective { vfov_rad } => {
            ("vfov_deg", json!(number(f64::from(vfov_rad).to_degrees() as f32)))
        }
        Projection::Orthographic { half_height } => ("half_height_m", json!(number(half_height))),
    };
    vec![
        ("camera", json!(camera.name)),
        ("position", json!(camera.position.to_array().map(number))),
        ("direction", json!(camera.forward.to_array().map(number))),
        ("up", json!(camera.up.to_array().map(number))),
        lens,
    ]
}

/// A number with the digits that single precision has.
fn number(x: f32) -> f64 {
    x.to_string().parse().unwrap_or_default()
}

fn emissive_triangles(scene: &Scene) -> usize {
    let shines = |mesh: u32| {
        let mesh = &scene.meshes[mesh as usize];
        let material = &scene.materials[mesh.material as usize];
        if material.emission.max_element() > 0.0 { mesh.triangles.len() } else { 0 }
    };
    scene.instances.iter().map(|i| shines(i.mesh)).sum()
}

/// Prints the devices that can render.
pub fn run_devices(args: &JsonArg) -> Result<Outcome, Failure> {
    #[cfg(target_arch = "x86_64")]
    let simd = if std::arch::is_x86_feature_detected!("avx2") { "AVX2" } else { "SSE2" };
    #[cfg(not(target_arch = "x86_64"))]
    let simd = "portable";
    let cpu = format!("{} threads, {simd}", rayon::current_num_threads());
    let adapters = manylight::gpu::describe_adapters();
    if args.json {
        let adapters: Vec<Value> = (1..).zip(&adapters).map(adapter_json).collect();
        writeln!(std::io::stdout(), "{}", json!({ "cpu": cpu, "gpu": adapters }))?;
        return Ok(Outcome::Done);
    }
    let mut out = std::io::stdout().lock();
    writeln!(out, "{:<8}{cpu}", "cpu")?;
    for (number, adapter) in (1..).zip(&adapters) {
        writeln!(out, "{:<8}{}", format!("gpu #{number}"), describe_adapter(adapter))?;
    }
    if adapters.is_empty() {
        writeln!(out, "{:<8}none; needs a driver for Vulkan, Metal or DirectX 12", "gpu")?;
    }
    Ok(Outcome::Done)
}

/// What an adapter is, and which paths it gets.
fn describe_adapter(adapter: &AdapterDescription) -> String {
    let has = |is: bool, name: &str| if is { name.to_owned() } else { format!("no {name}") };
    let AdapterDescription { name, kind, backend, driver, .. } = adapter;
    let use_of_it = match (&adapter.lacks, *kind) {
        (Some(lacks), _) => format!("cannot render: lacks {lacks}"),
        (None, "software") => "renders where --set gpu.device names it".to_owned(),
        (None, _) => "renders".to_owned(),
    };
    let features = Feature::ALL.map(|f| has(adapter.features.has(f), &f.name().replace('_', " ")));
    format!(
        "{name}: {kind}, {backend}, {driver}; {use_of_it}; lists of {} MiB, buffers of {} MiB, {} \
         KiB of workgroup memory, {}",
        adapter.max_binding >> 20,
        adapter.max_buffer >> 20,
        adapter.workgroup_memory >> 10,
        features.join(", "),
    )
}

fn adapter_json((number, adapter): (usize, &AdapterDescription)) -> Value {
    let features = Feature::ALL.map(|f| (f.name().to_owned(), json!(adapter.features.has(f))));
    json!({
        "number": number, "name": adapter.name, "kind": adapter.kind, "backend": adapter.backend,
        "driver": adapter.driver, "max_binding": adapter.max_binding,
        "max_buffer": adapter.max_buffer, "workgroup_memory": adapter.workgroup_memory,
        "features": Value::from_iter(features), "lacks": adapter.lacks,
    })
}

/// Prints the methods and presets.
pub fn run_methods(args: &JsonArg) -> Result<Outcome, Failure> {
    let mut rows: Vec<(&str, Value)> = Method::ALL.iter().map(|m| (m.1, json!(m.2))).collect();
    rows.push(("presets", json!(PRESETS.join(", "))));
    rows.push(("scenes", json!(builtin_names())));
    print_rows(&rows, args.json)
}

fn builtin_names() -> String {
    let names: Vec<_> = manylight_scene::BUILTINS.iter().map(|n| format!("builtin:{n}")).collect();
    names.join(", ")
}

fn print_rows(rows: &[(&str, Value)], as_json: bool) -> Result<Outcome, Failure> {
    let mut out = std::io::stdout().lock();
    if as_json {
        let map: serde_json::Map<_, _> =
            rows.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect();
        writeln!(out, "{}", Value::Object(map))?;
        return Ok(Outcome::Done);
    }
    for (key, value) in rows {
        let text = match value {
            Value::String(s) => s.clone(),
            Value::Array(list) if list.is_empty() => "none".to_owned(),
            Value::Object(fields) if fields.is_empty() => "none".to_owned(),
            Value::Array(list) if list.iter().all(Value::is_string) => {
                list.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(", ")
            }
            other => other.to_string(),
        };
        writeln!(out, "{:<20}{text}", key.replace('_', " "))?;
    }
    Ok(Outcome::Done)
}
