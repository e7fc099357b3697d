//! Float images in memory and on disk, the curves that show them, and the measures that
//! compare them.
//!
//! In: files (OpenEXR, PFM, Radiance HDR, PNG) or the renderer's pictures.
//! Out: the same kinds of files (Radiance HDR excepted), tone-mapped and false-colour pictures,
//! error numbers and maps.
//! Papers: FLIP `[Andersson20]`, HDR-FLIP `[Andersson21]`; tone curves cited in [`ToneCurve`].
//! Limits: pictures of at most 2²⁸ pixels; deep and B44-compressed EXR files are refused;
//! subsampled EXR channels are skipped.
//!
//! All pixel values are linear with Rec.709 primaries unless a name says `srgb`.
//! Every writer goes through [`write_atomic`]: an interrupted write leaves the earlier file.

mod atomic;
mod color;
mod error;
mod exr;
mod heatmap;
mod pfm;
mod png;
mod raster;
mod read;
mod tone;

pub mod metric;
#[cfg(test)]
mod testing;

pub use atomic::{WriteSeek, check_target, write_atomic};
pub use color::{LUMINANCE_WEIGHTS, linear_from_srgb, luminance, srgb_from_linear};
pub use error::Error;
pub use exr::{read_exr, write_exr};
pub use heatmap::heatmap;
pub use metric::{Errors, compare, compute_rel_mse, flip_hdr, flip_ldr};
pub use pfm::{read_pfm, write_pfm};
pub use png::{read_png, write_png, write_png_rgb8};
pub use raster::{LayeredImage, Raster};
pub use read::{read_hdr, read_picture};
pub use tone::{ToneCurve, ToneSettings, compute_auto_exposure_ev, tone_map};
