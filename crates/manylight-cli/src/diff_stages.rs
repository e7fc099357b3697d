//! `manylight diff-stages`

use crate::args::DiffStagesArgs;
use crate::{Failure, Outcome, memory, render};
use manylight::frame::gpu::{GpuRenderer, StageDifference};
use manylight::gpu::{Gpu, GpuOptions};
use manylight::{Renderer, Settings};
use serde_json::{Value, json};
use std::io::Write;

/// Size of the pictures where nobody chose.
const SIZE: [usize; 2] = [96, 54];

/// Runs the command.
pub fn run(args: &DiffStagesArgs) -> Result<Outcome, Failure> {
    let shot = render::load(&args.scene, args.settings.camera.as_deref(), args.json)?;
    let settings = render::settings(&args.settings, &shot)?;
    let size = match args.settings.size {
        Some(_) => render::size(&args.settings, &shot.camera)?,
        None => SIZE,
    };
    memory::check_render(size, &settings, false)?;
    let gpu = open(&settings)?;
    let renderer = Renderer::new(shot.scene)?;
    let engine = GpuRenderer::new(gpu, renderer).map_err(|(_, reason)| reason)?;
    let rows = engine.diff_stages(&shot.camera, size, &settings)?;
    let first = rows.iter().find(|row| !row.agrees());
    if args.json {
        let report = json!({
            "scene": args.scene, "device": engine.gpu().name(), "size": size,
            "first": first.map(|row| row.stage),
            "stages": rows.iter().map(row_json).collect::<Vec<_>>(),
            "settings": settings.to_json(),
        });
        writeln!(std::io::stdout(), "{report}")?;
    } else {
        print(engine.gpu().name(), &rows, first)?;
    }
    Ok(if first.is_none() { Outcome::Done } else { Outcome::CheckFailed })
}

/// A developer's tool: without a device of its own a machine may emulate one.
fn open(settings: &Settings) -> Result<Gpu, Failure> {
    let options = GpuOptions { software: true, ..GpuOptions::from(&settings.gpu) };
    Ok(Gpu::open(&options)?)
}

fn row_json(row: &StageDifference) -> Value {
    json!({
        "stage": row.stage, "what": row.what, "compared": row.compared,
        "different": row.different, "allowed": row.allowed, "largest": row.largest,
        "tolerance": row.tolerance, "unit": row.unit, "agrees": row.agrees(),
    })
}

fn print(
    device: &str,
    rows: &[StageDifference],
    first: Option<&StageDifference>,
) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{device}")?;
    let (stage, what) = ("stage", "of it");
    let head = ["compared", "differ", "may", "largest", "tolerance"];
    let [compared, differ, may, largest, tolerance] = head;
    writeln!(
        out,
        "{stage:<18}{what:<22}{compared:>9}{differ:>8}{may:>7}{largest:>12}{tolerance:>11}"
    )?;
    for row in rows {
        let StageDifference { stage, what, compared, different, allowed, unit, .. } = row;
        let mark = if row.agrees() { "" } else { "  <" };
        let numbers = format!("{:>12.2e}{:>11.0e} {unit}", row.largest, row.tolerance);
        let numbers = numbers.trim_end();
        writeln!(
            out,
            "{stage:<18}{what:<22}{compared:>9}{different:>8}{allowed:>7}{numbers}{mark}"
        )?;
    }
    match first {
        None => writeln!(out, "all stages agree")?,
        Some(row) => writeln!(out, "first stage that differs: {}, {}", row.stage, row.what)?,
    }
    Ok(())
}
