//! From a frame to files.

use crate::Failure;
use glam::Vec3;
use manylight::Frame;
use manylight_image::{LayeredImage, Raster, ToneSettings};
use std::collections::HashSet;
use std::ffi::OsStr;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

/// The picture with all its layers.
pub fn picture(frame: &Frame) -> LayeredImage {
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
        metadata: Vec::new(),
    }
}

/// Refuses two outputs under one name, of which only the later would remain.
pub fn check_distinct<'a>(paths: impl Iterator<Item = &'a PathBuf>) -> Result<(), Failure> {
    let mut known = Vec::new();
    for path in paths {
        let mut place = (folder_of(path), path.file_name().map(OsStr::to_owned));
        // Links may lead to one file.
        if let Some(file) = path.canonicalize().ok().filter(|file| file.is_file()) {
            place = (file.parent().map(Path::to_owned), file.file_name().map(OsStr::to_owned));
        }
        if known.contains(&place) {
            let shown = path.display();
            return Err(format!("{shown} is named twice; give each output its own name").into());
        }
        known.push(place);
    }
    Ok(())
}

/// The files that a command reads.
pub struct Inputs(HashSet<PathBuf>);

impl Inputs {
    /// Those among these paths that are there.
    pub fn new<'a>(paths: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        Self(paths.into_iter().filter_map(|path| path.canonicalize().ok()).collect())
    }

    /// Refuses an output that would take the place of an input.
    pub fn check(&self, output: &Path) -> Result<(), Failure> {
        if !self.0.is_empty() && output.canonicalize().is_ok_and(|place| self.0.contains(&place)) {
            let shown = output.display();
            return Err(format!("{shown} is read by this command; name another output").into());
        }
        Ok(())
    }
}

/// Prints a line of results. A reader that went away is an error only where nothing else is to be
/// done.
pub fn print(line: &str, goes_on: bool) -> Result<(), Failure> {
    match writeln!(std::io::stdout(), "{line}") {
        Err(e) if goes_on && e.kind() == ErrorKind::BrokenPipe => Ok(()),
        printed => Ok(printed?),
    }
}

/// The folder of a file, whatever way leads there; none where there is none.
pub fn folder_of(path: &Path) -> Option<PathBuf> {
    path.parent().and_then(|folder| folder_or_here(folder).canonicalize().ok())
}

/// The folder of a relative name without one is the current folder.
fn folder_or_here(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
}

/// Refuses what cannot become a file by its name, or by what is there.
pub fn check_target(path: &Path) -> Result<(), Failure> {
    let shown = path.display();
    if path.is_dir() {
        return Err(format!("cannot write {shown}: it is a folder; name a file in it").into());
    }
    if let Err(e) = path.symlink_metadata()
        && e.kind() == ErrorKind::InvalidFilename
    {
        return Err(format!("cannot write {shown}: {e}; choose a shorter name").into());
    }
    manylight_image::check_target(path)
        .map_err(|_| format!("cannot write {shown}: it is a pipe or a socket; name a file").into())
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
        check_target(path)?;
        let parent = path.parent().map_or(Path::new("."), folder_or_here);
        // Creating a file is the only test that covers rights, read-only disks and full ones.
        let probe = parent.join(format!(".manylight-{}.tmp", std::process::id()));
        std::fs::write(&probe, b"manylight").map_err(|e| {
            format!("cannot write {shown}: {e}; choose a folder that exists and is writable")
        })?;
        std::fs::remove_file(&probe)
            .map_err(|e| format!("cannot remove {}: {e}; remove it", probe.display()))?;
    }
    Ok(())
}

/// Writes a file that appears whole or not at all.
pub fn write_bytes(bytes: &[u8], path: &Path) -> Result<(), Failure> {
    manylight_image::write_atomic(path, |sink| {
        let failed = |source| manylight_image::Error::Write { path: path.to_owned(), source };
        sink.write_all(bytes).map_err(failed)
    })?;
    Ok(())
}

/// Whether a picture of this name is tone-mapped.
pub fn is_png(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case("png"))
}

/// Writes a picture in the format its name asks for.
pub fn write(picture: &LayeredImage, path: &Path, exposure_ev: f32) -> Result<(), Failure> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_lowercase();
    match extension.as_str() {
        _ if is_png(path) => {
            let tone = ToneSettings { exposure_ev: Some(exposure_ev), ..ToneSettings::default() };
            manylight_image::write_png(&picture.beauty, &tone, path)?;
        }
        "pfm" => manylight_image::write_pfm(&picture.beauty, path)?,
        _ => manylight_image::write_exr(picture, path)?,
    }
    Ok(())
}
