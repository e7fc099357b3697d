//! `manylight compare`

use crate::args::CompareArgs;
use crate::{Failure, Outcome, output};
use manylight_image::{LayeredImage, Raster, compare, flip_hdr, heatmap, read_picture};
use serde_json::json;
use std::io::Write;

/// The layer that every picture has.
const BEAUTY: &str = "beauty";

/// Runs the command.
pub fn run(args: &CompareArgs) -> Result<Outcome, Failure> {
    output::check(args.output.as_slice(), &["png"])?;
    check_limits(args)?;
    let inputs = output::Inputs::new([&args.a, &args.b]);
    args.output.iter().try_for_each(|output| inputs.check(output))?;
    let [is_png, other_is_png] = [&args.a, &args.b].map(|path| output::is_png(path));
    if is_png != other_is_png {
        let (a, b) = (args.a.display(), args.b.display());
        let problem = "one is tone-mapped, the other linear; render both as one kind";
        return Err(format!("cannot compare {a} with {b}: {problem}").into());
    }
    let (a, b) = (read_picture(&args.a)?, read_picture(&args.b)?);
    let (a, b) = (layer(&a, args, &args.a)?, layer(&b, args, &args.b)?);
    let errors = compare(a, b)?;
    if errors.nonfinite_count == a.width * a.height {
        let (a, b) = (args.a.display(), args.b.display());
        let problem = "no pixel is finite in both pictures; render them again";
        return Err(format!("cannot compare {a} with {b}: {problem}").into());
    }
    if let Some(path) = &args.output {
        let flip = flip_hdr(a, b)?;
        let rgb = heatmap(&flip, 0.0, 1.0)?;
        manylight_image::write_png_rgb8(&rgb, flip.width, flip.height, path)?;
    }
    let rows = [
        ("relMSE", "rel_mse", errors.rel_mse, args.max_rel_mse),
        ("relative RMSE", "relative_rmse", errors.relative_rmse, args.max_rmse),
        ("RMSE", "rmse", errors.rmse, None),
        ("MAPE", "mape", errors.mape, args.max_mape),
        ("energy bias", "energy_bias", errors.energy_bias, args.max_bias),
        ("FLIP mean", "flip_mean", errors.flip_mean, args.max_flip),
        ("FLIP 99 %", "flip_p99", errors.flip_p99, None),
    ];
    let failed: Vec<_> = rows
        .iter()
        .filter(|(_, _, value, limit)| limit.is_some_and(|l| value.is_nan() || value.abs() > l))
        .collect();
    if args.json {
        let mut report: serde_json::Map<_, _> =
            rows.iter().map(|r| (r.1.to_owned(), json!(r.2))).collect();
        report.insert("nonfinite_count".to_owned(), json!(errors.nonfinite_count));
        report.insert("failed".to_owned(), failed.iter().map(|r| r.1).collect());
        output::print(&serde_json::Value::Object(report).to_string(), true)?;
    } else {
        for (name, _, value, _) in rows {
            output::print(&format!("{name:<16}{value:>14.6}"), true)?;
        }
        if errors.nonfinite_count > 0 {
            let count = errors.nonfinite_count;
            output::print(&format!("{count} pixels are not finite and were left out"), true)?;
        }
    }
    for (name, _, value, limit) in &failed {
        let limit = limit.unwrap_or_default();
        let _ =
            writeln!(std::io::stderr(), "manylight: {name} {value:.6} is above the limit {limit}");
    }
    // Whoever sets limits wants a sound picture: pixels that were left out are no success.
    let is_unsound = errors.nonfinite_count > 0 && rows.iter().any(|r| r.3.is_some());
    if is_unsound {
        let count = errors.nonfinite_count;
        let _ = writeln!(std::io::stderr(), "manylight: {count} pixels are not finite");
    }
    let all_well = failed.is_empty() && !is_unsound;
    Ok(if all_well { Outcome::Done } else { Outcome::CheckFailed })
}

/// Refuses limits that nothing can meet or miss.
fn check_limits(args: &CompareArgs) -> Result<(), Failure> {
    let limits = [
        ("--max-flip", args.max_flip),
        ("--max-rel-mse", args.max_rel_mse),
        ("--max-rmse", args.max_rmse),
        ("--max-mape", args.max_mape),
        ("--max-bias", args.max_bias),
    ];
    for (name, limit) in limits {
        if let Some(limit) = limit.filter(|l| l.is_nan() || *l < 0.0) {
            return Err(format!("{name} {limit}: use a number of 0 or more").into());
        }
    }
    Ok(())
}

fn layer<'a>(
    picture: &'a LayeredImage,
    args: &CompareArgs,
    path: &std::path::Path,
) -> Result<&'a Raster, Failure> {
    let name = &args.layer;
    if name == BEAUTY {
        return Ok(&picture.beauty);
    }
    let found = picture.layers.iter().find(|l| l.0 == *name);
    found.map(|l| &l.1).ok_or_else(|| {
        let names = picture.layers.iter().map(|l| l.0.as_str());
        let names: Vec<_> = std::iter::once(BEAUTY).chain(names).collect();
        let there = names.join(", ");
        format!("{} has no layer {name:?}; its layers: {there}", path.display()).into()
    })
}
