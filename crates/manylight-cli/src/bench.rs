//! `manylight bench`

use crate::args::BenchArgs;
use crate::render::{self, render_with_bar};
use crate::{Failure, Outcome, memory, output};
use manylight::bench::{self, Quality, RayBatch};
use manylight::gather::grid::{DETAIL, LightingGrid};
use manylight::{Renderer, Settings};
use serde_json::{Value, json};
use std::io::Write;
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
    let dumps: Vec<_> =
        args.dump_rays.iter().flat_map(|p| DUMPS.map(|end| p.with_extension(end))).collect();
    output::check(&dumps, &DUMPS)?;
    render::use_threads(&args.settings)?;
    let default = ["builtin:atrium".to_owned()];
    let scenes = if args.scenes.is_empty() { &default[..] } else { &args.scenes[..] };
    let mut reports = Vec::new();
    for scene in scenes {
        let shot = render::load(scene, args.json)?;
        let settings = render::settings(&args.settings, &shot)?;
        let size = render::size(&args.settings, &shot.camera)?;
        memory::check_render(size, &settings)?;
        let camera = shot.camera.clone();
        let renderer = Renderer::new(shot.scene)?;
        let report = if let Some(receivers) = args.quality {
            quality(&renderer, &camera, size, &settings, receivers)
        } else if args.rays || args.dump_rays.is_some() {
            rays(&renderer, &camera, size, &settings, args)?
        } else if args.build {
            build(&renderer, &settings)
        } else {
            frames(&renderer, &camera, size, &settings, args.frames)?
        };
        if !args.json {
            print(scene, &report)?;
        }
        reports.push(json!({ "scene": scene, "report": report }));
    }
    if args.json {
        writeln!(std::io::stdout(), "{}", Value::Array(reports))?;
    }
    Ok(Outcome::Done)
}

fn print(scene: &str, report: &Value) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{scene}")?;
    if let Value::Object(map) = report {
        for (key, value) in map {
            writeln!(out, "  {key:<28}{value}")?;
        }
    }
    Ok(())
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
    renderer: &Renderer,
    camera: &manylight_scene::Camera,
    size: [usize; 2],
    settings: &Settings,
    args: &BenchArgs,
) -> Result<Value, Failure> {
    let batch = RayBatch::new(renderer, camera, size, settings);
    if let Some(path) = &args.dump_rays {
        for (end, values) in DUMPS.iter().zip([batch.triangles(renderer), batch.to_floats()]) {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            output::write_bytes(&bytes, &path.with_extension(end))?;
        }
    }
    let mut times = Vec::new();
    let mut occluded = 0;
    for _ in 0..RUNS {
        let start = Instant::now();
        occluded = batch.trace(renderer);
        times.push(start.elapsed().as_secs_f64());
    }
    let rate = batch.len() as f64 / median(&mut times) * 1e-6;
    Ok(json!({ "rays": batch.len(), "occluded": occluded, "mrays_per_s": rate,
               "threads": rayon::current_num_threads() }))
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

fn frames(
    renderer: &Renderer,
    camera: &manylight_scene::Camera,
    size: [usize; 2],
    settings: &Settings,
    count: u32,
) -> Result<Value, Failure> {
    let mut stages: Vec<(&'static str, Vec<f64>)> = Vec::new();
    let mut totals = Vec::new();
    for run in 0..=count.max(1) {
        let start = Instant::now();
        let frame = render_with_bar(renderer, camera, size, settings, true)?;
        if run == 0 {
            continue;
        }
        totals.push(start.elapsed().as_secs_f64() * 1e3);
        for stage in &frame.stages {
            match stages.iter_mut().find(|s| s.0 == stage.name) {
                Some(s) => s.1.push(stage.time_ms),
                None => stages.push((stage.name, vec![stage.time_ms])),
            }
        }
    }
    let mut report = serde_json::Map::new();
    let spread = |times: &mut Vec<f64>| {
        let median = median(times);
        json!({ "median_ms": median, "min_ms": times[0], "max_ms": times[times.len() - 1] })
    };
    report.insert("frame".to_owned(), spread(&mut totals));
    for (name, mut times) in stages {
        report.insert(name.to_owned(), spread(&mut times));
    }
    report.insert("peak_memory_mib".to_owned(), json!(memory::find_peak_mib()));
    Ok(Value::Object(report))
}

/// Sorts and returns the middle.
fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
