//! From a frame to files.

use crate::Failure;
use glam::Vec3;
use manylight::{Frame, Settings};
use manylight_image::{LayeredImage, Raster, ToneSettings};
use std::path::{Path, PathBuf};

/// The picture with all its layers and the story of how it was made.
pub fn picture(frame: &Frame, metadata: Vec<(String, String)>) -> LayeredImage {
    let l = &frame.layers;
    let color = |values: &[Vec3]| Raster {
        width: l.width,
        height: l.height,
        channels: 3,
        data: values.iter().flat_map(|v| v.to_array()).collect(),
    };
    let gray = |values: &[f32]| Raster {
        width: l.width,
        height: l.height,
        channels: 1,
        data: values.to_vec(),
    };
    let layers = [
        ("direct", color(&l.direct)),
        ("indirect", color(&l.indirect)),
        ("indirect_unshadowed", color(&l.indirect_unshadowed)),
        ("shadow_ratio", gray(&l.shadow_ratio)),
        ("emission", color(&l.emission)),
        ("Albedo", color(&l.albedo)),
        ("N", color(&l.normal)),
        ("P", color(&l.position)),
        ("depth", gray(&l.depth)),
        ("evals", gray(&l.evals)),
    ];
    LayeredImage {
        beauty: color(&l.beauty()),
        layers: layers.map(|(name, raster)| (name.to_owned(), raster)).to_vec(),
        metadata,
    }
}

/// Refuses outputs that could not be written later, before any work is done.
pub fn check(paths: &[PathBuf], allowed: &[&str]) -> Result<(), Failure> {
    for path in paths {
        let shown = path.display();
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_lowercase);
        if !extension.as_deref().is_some_and(|e| allowed.contains(&e)) {
            let allowed = allowed.join(" or .");
            return Err(format!("cannot write {shown}: name a file that ends in .{allowed}").into());
        }
        if path.is_dir() {
            return Err(format!("cannot write {shown}: it is a folder; name a file in it").into());
        }
        let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // Creating a file is the only test that covers rights, read-only disks and full ones.
        let probe = parent.join(format!(".manylight-{}.tmp", std::process::id()));
        std::fs::write(&probe, b"manylight").map_err(|e| {
            format!("cannot write {shown}: {e}; choose a folder that exists and is writable")
        })?;
        std::fs::remove_file(&probe)?;
    }
    Ok(())
}

/// Writes a picture in the format its name asks for.
pub fn write(picture: &LayeredImage, path: &Path, settings: &Settings) -> Result<(), Failure> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_lowercase();
    match extension.as_str() {
        "png" => {
            let exposure_ev = settings.film.exposure_ev;
            let tone = ToneSettings { exposure_ev, ..ToneSettings::default() };
            manylight_image::write_png(&picture.beauty, &tone, path)?;
        }
        "pfm" => manylight_image::write_pfm(&picture.beauty, path)?,
        _ => manylight_image::write_exr(picture, path)?,
    }
    Ok(())
}
