//! What can go wrong with pictures.

use std::path::{Path, PathBuf};

use crate::Raster;

/// A failure of this crate, as one sentence that names the thing, the fault and the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file cannot be opened or read.
    #[error("cannot read `{}`: {source}; check the path and its permissions", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file cannot be created, written or renamed; an earlier file is untouched.
    #[error(
        "cannot write `{}`: {source}; check that its folder exists, is writable and has free space",
        path.display()
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The bytes of a file are not the picture they claim to be.
    #[error("`{}` is not a readable {format} picture: {reason}; make the file again or choose \
     another", path.display())]
    Decode {
        /// The file.
        path: PathBuf,
        /// The format that was expected.
        format: &'static str,
        /// What is wrong with the bytes.
        reason: String,
    },
    /// A picture cannot be expressed in a format.
    #[error("cannot store this picture as {format} in `{}`: {reason}", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// The format that was asked for.
        format: &'static str,
        /// What does not fit and what would.
        reason: String,
    },
    /// A file claims more pixels or values than this crate reads.
    #[error(
        "`{}` claims {width} × {height} pixels with {channels} channels, more than the limit \
         of 2^28 pixels and 2^30 values; make it smaller",
        path.display()
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Pixels across.
        width: u64,
        /// Pixels down.
        height: u64,
        /// Values per pixel, over all layers.
        channels: u64,
    },
    /// The content of a file is none of the formats that are read.
    #[error(
        "`{}` is not a picture that can be read; allowed are OpenEXR (.exr), PFM (.pfm), \
         Radiance (.hdr) and PNG (.png)",
        path.display()
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// Two pictures cannot be compared because their shapes differ.
    #[error(
        "cannot compare {}×{} pixels of {} channels with {}×{} pixels of {} channels; render \
         both at one size and choose the same layer",
        a[0], a[1], a[2], b[0], b[1], b[2]
    )]
    Mismatch {
        /// Width, height, channels of the first.
        a: [usize; 3],
        /// Width, height, channels of the second.
        b: [usize; 3],
    },
    /// A picture in memory has a shape that the operation does not take.
    #[error(
        "a picture of {width}×{height} pixels, {channels} channels and {len} values does not \
         fit here; {allowed}"
    )]
    Shape {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
        /// Values per pixel.
        channels: usize,
        /// Values held.
        len: usize,
        /// What the operation takes.
        allowed: &'static str,
    },
}

impl Error {
    /// Wraps a system error of reading.
    pub(crate) fn read(path: &Path, source: std::io::Error) -> Self {
        Self::Read { path: path.to_owned(), source }
    }

    /// Wraps a system error of writing.
    pub(crate) fn write(path: &Path, source: std::io::Error) -> Self {
        Self::Write { path: path.to_owned(), source }
    }

    /// Says why the bytes of a file are no picture.
    pub(crate) fn decode(path: &Path, format: &'static str, reason: impl ToString) -> Self {
        Self::Decode { path: path.to_owned(), format, reason: reason.to_string() }
    }

    /// Says why a picture does not fit a format.
    pub(crate) fn encode(path: &Path, format: &'static str, reason: impl ToString) -> Self {
        Self::Encode { path: path.to_owned(), format, reason: reason.to_string() }
    }

    /// Says that a raster's fields do not fit the operation.
    pub(crate) fn shape(raster: &Raster, allowed: &'static str) -> Self {
        let &Raster { width, height, channels, ref data } = raster;
        Self::Shape { width, height, channels, len: data.len(), allowed }
    }
}

/// Most pixels of a picture that is read.
const MAX_PIXELS: u64 = 1 << 28;
/// Most values of a picture that is read, over all its layers.
const MAX_VALUES: u64 = 1 << 30;

/// Refuses sizes that are zero or too large, before anything is allocated.
pub(crate) fn check_size(
    path: &Path,
    format: &'static str,
    width: u64,
    height: u64,
    channels: u64,
) -> Result<(), Error> {
    let too_large = || Error::TooLarge { path: path.to_owned(), width, height, channels };
    let pixels = width.checked_mul(height).ok_or_else(too_large)?;
    if pixels == 0 || channels == 0 {
        return Err(Error::decode(path, format, "it holds no pixels"));
    }
    let values = pixels.checked_mul(channels).ok_or_else(too_large)?;
    if pixels > MAX_PIXELS || values > MAX_VALUES { Err(too_large()) } else { Ok(()) }
}

/// Refuses rasters whose fields contradict one another or that hold no pixels.
pub(crate) fn check_raster(raster: &Raster) -> Result<(), Error> {
    let len = raster.width.checked_mul(raster.height).and_then(|n| n.checked_mul(raster.channels));
    if raster.data.is_empty()
        || len != Some(raster.data.len())
        || ![1, 3].contains(&raster.channels)
    {
        return Err(Error::shape(
            raster,
            "give at least one pixel, 1 or 3 channels and width · height · channels values",
        ));
    }
    Ok(())
}
