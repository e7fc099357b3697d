//! `manylight bench`

use crate::args::{Backend, BenchArgs};
use crate::backend::Engine;
use crate::render;
use crate::{Failure, Outcome, memory, output};
use manylight::bench::{self, GpuRayBatch, Quality, RayBatch};
use manylight::frame::Past;
use manylight::frame::gpu::GpuRenderer;
use manylight::gather::grid::{DETAIL, LightingGrid};
use manylight::gpu::Gpu;
use manylight::{Method, Renderer, Settings};
use serde_json::{Value, json};
use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

/// Most receivers of `--quality`; each takes a tile of the picture.
const MAX_RECEIVERS: usize = 20_000;
/// Endings of the files of `--dump-rays`: triangles, rays.
const DUMPS: [&str; 2] = ["tri", "ray"];
/// Runs of a timing that is not a whole frame.
const RUNS: usize = 7;

/// Runs the command.
pub fn run(args: &BenchArgs) -> Result<Outcome, Failure> {
    if let Some(receivers) = args.quality.filter(|n| !(1..=MAX_RECEIVERS).contains(n)) {
        return Err(format!("--quality {receivers}: use 1 to {MAX_RECEIVERS} receivers").into());
    }
    if args.is_static && args.backend == Backend::Cpu {
        return Err("--static: only a graphics device keeps its lights; add --backend gpu".into());
    }
    let dumps: Vec<_> =
        args.dump_rays.iter().flat_map(|p| DUMPS.map(|end| p.with_extension(end))).collect();
    output::check(&dumps, &DUMPS)?;
    let default = ["builtin:atrium".to_owned()];
    let scenes = if args.scenes.is_empty() { &default[..] } else { &args.scenes[..] };
    if args.dump_rays.is_some() && scenes.len() > 1 {
        return Err("--dump-rays: one scene fills the files; name one scene".into());
    }
    let mut reports = Vec::new();
    let result = measure(scenes, &dumps, args, &mut reports);
    // What is finished is not lost by a later scene that fails.
    if args.json && (result.is_ok() || !reports.is_empty()) {
        output::print(&Value::Array(reports).to_string(), result.is_err())?;
    }
    result.map(|()| Outcome::Done)
}

/// Measures scene after scene.
fn measure(
    scenes: &[String],
    dumps: &[PathBuf],
    args: &BenchArgs,
    reports: &mut Vec<Value>,
) -> Result<(), Failure> {
    for scene in scenes {
        // The peak of the first is its own in any case.
        let is_own_peak = reports.is_empty() || memory::reset_peak();
        let shot = render::load(scene, args.settings.camera.as_deref(), args.json)?;
        let inputs = output::Inputs::new(&shot.files);
        dumps.iter().try_for_each(|dump| inputs.check(dump))?;
        let settings = render::settings(&args.settings, &shot)?;
        let size = render::size(&args.settings, &shot.camera)?;
        memory::check_render(size, &settings, true)?;
        let camera = shot.camera;
        let renderer = Renderer::new(shot.scene)?;
        let report = if args.is_of_frames() {
            // The processor would keep nothing.
            let backend = if args.is_static { Backend::Gpu } else { args.backend };
            let mut engine = Engine::new(renderer, backend, &settings, args.json)?;
            frames(&mut engine, &camera, size, &settings, args, is_own_peak)?
        } else if args.rays || args.dump_rays.is_some() {
            let mut engine = Engine::new(renderer, args.backend, &settings, args.json)?;
            rays(&mut engine, &camera, size, &settings, args)?
        } else if let Some(receivers) = args.quality {
            quality(&renderer, &camera, size, &settings, receivers)
        } else {
            build(&renderer, &settings)
        };
        reports.push(finish(scene, report, args)?);
    }
    Ok(())
}

/// Prints a report unless all are wanted as JSON.
fn finish(scene: &str, report: Value, args: &BenchArgs) -> Result<Value, Failure> {
    if !args.json {
        print(scene, &report)?;
    }
    Ok(json!({ "scene": scene, "report": report }))
}

fn print(scene: &str, report: &Value) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{scene}")?;
    let none = serde_json::Map::new();
    let rows = report.as_object().unwrap_or(&none).iter();
    let is_time = |value: &Value| value.get("median_ms").is_some();
    let (times, others): (Vec<_>, Vec<_>) = rows.partition(|(_, value)| is_time(value));
    if !times.is_empty() {
        writeln!(out, "  {:<20}{:>12}{:>12}{:>12}", "stage", "median ms", "p10 ms", "p90 ms")?;
    }
    for (stage, spread) in times {
        let [median, p10, p90] = ["median_ms", "p10_ms", "p90_ms"]
            .map(|key| spread[key].as_f64().map_or("-".to_owned(), |ms| format!("{ms:.2}")));
        writeln!(out, "  {stage:<20}{median:>12}{p10:>12}{p90:>12}")?;
    }
    for (key, value) in others {
        let Value::Object(parts) = value else {
            writeln!(out, "  {key:<28}{}", shown(value))?;
            continue;
        };
        writeln!(out, "  {key}")?;
        for (key, value) in parts {
            writeln!(out, "    {key:<26}{}", shown(value))?;
        }
    }
    Ok(())
}

/// A value for people: numbers of four digits or whole ones.
fn shown(value: &Value) -> String {
    match value {
        Value::Array(list) if list.is_empty() => "none".to_owned(),
        Value::Array(list) => list.iter().map(shown).collect::<Vec<_>>().join(", "),
        Value::String(text) => text.clone(),
        Value::Null => "none".to_owned(),
        Value::Number(number) if number.is_f64() => round(number.as_f64().unwrap_or(f64::NAN)),
        other => other.to_string(),
    }
}

/// Four significant digits.
fn round(x: f64) -> String {
    let magnitude = x.abs().log10().floor();
    match magnitude {
        -4.0..4.0 => format!("{x:.*}", (3.0 - magnitude) as usize),
        4.0..15.0 => format!("{x:.0}"),
        _ if x == 0.0 => "0".to_owned(),
        _ => format!("{x:.3e}"),
    }
}

fn quality(
    renderer: &Renderer,
    camera: &manylight_scene::Camera,
    size: [usize; 2],
    settings: &Settings,
    receivers: usize,
) -> Value {
    let Quality { evals, unshadowed, shadowed, clamp_loss, alpha, grid_lights, levels, vpls } =
        bench::quality(renderer, camera, size, settings, receivers);
    json!({
        "vpls": vpls, "alpha": alpha, "levels": levels, "grid_lights": grid_lights, "evals": evals,
        "unshadowed_rmse": unshadowed.relative_rmse, "unshadowed_bias": unshadowed.energy_bias,
        "shadowed_rmse": shadowed.relative_rmse, "shadowed_bias": shadowed.energy_bias,
        "clamp_loss": clamp_loss,
    })
}

fn rays(
    engine: &mut Engine,
    camera: &manylight_scene::Camera,
    size: [usize; 2],
    settings: &Settings,
    args: &BenchArgs,
) -> Result<Value, Failure> {
    let renderer = engine.renderer();
    let batch = RayBatch::new(renderer, camera, size, settings);
    if let Some(path) = &args.dump_rays {
        for (end, values) in DUMPS.iter().zip([batch.triangles(renderer), batch.to_floats()]) {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            output::write_bytes(&bytes, &path.with_extension(end))?;
        }
    }
    if let Some(report) = engine.on_device(args.json, |gpu| device_rays(gpu, &batch))? {
        return Ok(report);
    }
    let trace = || Ok((batch.trace(engine.renderer()), None));
    let (occluded, rate) = ray_rate(batch.len(), trace)?;
    Ok(json!({ "device": engine.names()[1], "rays": batch.len(), "occluded": occluded,
               "mrays_per_s": rate }))
}

/// The same rays by way of both hierarchies.
fn device_rays(engine: &GpuRenderer, batch: &RayBatch) -> Result<Value, manylight::Error> {
    let (rays, count) = (GpuRayBatch::new(engine, batch)?, batch.len());
    let (occluded, rate) = ray_rate(count, || rays.trace(engine))?;
    let mut report = json!({ "device": engine.gpu().name(),
                             "features": engine.gpu().features().names(), "rays": count,
                             "walk": GpuRayBatch::walk(engine), "occluded": occluded,
                             "mrays_per_s": rate });
    if rays.trace_binary(engine)?.is_some() {
        let (occluded, rate) =
            ray_rate(count, || Ok(rays.trace_binary(engine)?.unwrap_or_default()))?;
        report["binary"] = json!({ "occluded": occluded, "mrays_per_s": rate });
    }
    Ok(report)
}

/// How many rays were stopped, and millions of rays per second: the median of some runs, by the
/// device's clock where it has one.
fn ray_rate(
    count: usize,
    trace: impl Fn() -> Result<(usize, Option<f64>), manylight::Error>,
) -> Result<(usize, f64), manylight::Error> {
    let mut times = Vec::new();
    let mut occluded = 0;
    for _ in 0..RUNS {
        let start = Instant::now();
        let (stopped, device_ms) = trace()?;
        occluded = stopped;
        times.push(device_ms.map_or(start.elapsed().as_secs_f64(), |ms| ms * 1e-3));
    }
    Ok((occluded, count as f64 / median(&mut times) * 1e-6))
}

fn build(renderer: &Renderer, settings: &Settings) -> Value {
    let lights = bench::trace_vpls(renderer, settings);
    let mut times = Vec::new();
    let mut counts = (0, 0);
    for _ in 0..RUNS {
        let start = Instant::now();
        let grid = LightingGrid::build(&lights, &settings.grid, DETAIL * renderer.d_min(settings));
        times.push(start.elapsed().as_secs_f64() * 1e3);
        counts = (grid.levels.len(), grid.light_count());
    }
    json!({ "vpls": lights.len(), "levels": counts.0, "grid_lights": counts.1,
            "build_ms": median(&mut times) })
}

/// Times whole frames, everything made anew in each.
fn frames(
    engine: &mut Engine,
    camera: &manylight_scene::Camera,
    size: [usize; 2],
    settings: &Settings,
    args: &BenchArgs,
    is_own_peak: bool,
) -> Result<Value, Failure> {
    if engine.device().is_some() && (settings.method == Method::Path || settings.film.samples > 1) {
        let problem = "bench: a graphics device is timed by one sample a pixel, and not by method \
                       path; render tells what such a picture takes, and --backend cpu times it";
        return Err(problem.into());
    }
    let mut stages: Vec<(&'static str, Vec<f64>)> = Vec::new();
    let mut totals = Vec::new();
    let mut past = Past::default();
    let mut dispatches = None;
    let mut run = 0;
    while run <= args.frames.unwrap_or(frames_of(engine)) {
        let before = engine.device().map(Gpu::dispatches);
        let start = Instant::now();
        let (view, next) = ((camera, size), (run, &mut past));
        let times = engine.time_frame(view, settings, next, args.is_static, args.json)?;
        let Some(times) = times else {
            // From the beginning, on the processor.
            (run, stages, totals) = (0, Vec::new(), Vec::new());
            continue;
        };
        run += 1;
        if run == 1 {
            continue;
        }
        totals.push(start.elapsed().as_secs_f64() * 1e3);
        dispatches = engine.device().map(Gpu::dispatches).zip(before).map(|(now, b)| now - b);
        for (name, time_ms) in times {
            match stages.iter_mut().find(|s| s.0 == name) {
                Some(s) => s.1.push(time_ms),
                None => stages.push((name, vec![time_ms])),
            }
        }
    }
    let mut report = serde_json::Map::new();
    report.insert("device".to_owned(), json!(engine.names()[1]));
    report.insert("features".to_owned(), json!(engine.features()));
    report.insert("frame".to_owned(), spread(&mut totals));
    for (name, mut times) in stages {
        report.insert(name.to_owned(), spread(&mut times));
    }
    // Where the system cannot begin anew, that of all scenes so far.
    let peak = if is_own_peak { "peak_memory_mib" } else { "process_peak_memory_mib" };
    report.insert(peak.to_owned(), json!(memory::find_peak_mib()));
    if let Some(dispatches) = dispatches {
        report.insert("dispatches".to_owned(), json!(dispatches));
    }
    if let Some(lists) = engine.device().map(Gpu::lists) {
        let bytes: u64 = lists.iter().map(|(_, bytes)| bytes).sum();
        report.insert("device_memory_mib".to_owned(), json!(bytes >> 20));
        let lists: serde_json::Map<_, _> =
            lists.iter().map(|&(name, bytes)| (name.to_owned(), json!(bytes))).collect();
        report.insert("device_lists_bytes".to_owned(), lists.into());
    }
    Ok(Value::Object(report))
}

/// Frames that are timed unless someone asks for another number.
fn frames_of(engine: &Engine) -> u32 {
    if engine.device().is_some_and(|gpu| !gpu.is_emulated()) { 100 } else { 5 }
}

/// Median, deciles and extremes of some times, ms.
fn spread(times: &mut [f64]) -> Value {
    let median = median(times);
    let at = |share: f64| times[((times.len() - 1) as f64 * share).round() as usize];
    json!({ "median_ms": median, "p10_ms": at(0.1), "p90_ms": at(0.9), "min_ms": at(0.0),
            "max_ms": at(1.0) })
}

/// Sorts and returns the middle, of an even number the mean of the two there.
fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    let middle = times.len() / 2;
    (times[(times.len() - 1) / 2] + times[middle]) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_an_even_number_lies_between_the_middle_two() {
        assert_eq!(median(&mut [3.0]), 3.0);
        assert_eq!(median(&mut [9.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [9.0, 1.0, 2.0, 4.0]), 3.0);
    }

    #[test]
    fn numbers_for_people_have_four_digits() {
        let values = json!([0.0, 0.012_345_678, 1.0, 12.345_678, 98_765.432_1, 1.5e-9, 7]);
        assert_eq!(shown(&values), "0, 0.01235, 1.000, 12.35, 98765, 1.500e-9, 7");
        assert_eq!(shown(&json!(["half", "subgroups"])), "half, subgroups");
        assert_eq!(shown(&json!([])), "none");
    }
}
