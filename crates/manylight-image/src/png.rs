//! PNG pictures, in sRGB code values.
//!
//! In: rasters to be tone-mapped, finished bytes, or files. Out: files, or linear rasters.
//! Limits: writes 8 bits per channel; reading drops alpha and embedded colour profiles.

use std::io::BufReader;
use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngDecoder, PngEncoder};
use image::{ColorType, DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageError};

use crate::error::check_size;
use crate::read::{describe_error, open};
use crate::{Error, Raster, ToneSettings, linear_from_srgb, tone_map, write_atomic};

const FORMAT: &str = "PNG";

/// Tone-maps a raster and writes it as an 8-bit sRGB PNG.
///
/// Errors: `Shape` for an inconsistent raster, `Write` on system failures.
pub fn write_png(raster: &Raster, settings: &ToneSettings, path: &Path) -> Result<(), Error> {
    write_png_rgb8(&tone_map(raster, settings)?, raster.width, raster.height, path)
}

/// Writes finished sRGB bytes, three per pixel, row 0 at the top.
///
/// Errors: `Encode` when `rgb` does not hold `3 · width · height` bytes, `Write`.
pub fn write_png_rgb8(rgb: &[u8], width: usize, height: usize, path: &Path) -> Result<(), Error> {
    let expected = width.checked_mul(height).and_then(|count| count.checked_mul(3));
    let (Ok(across), Ok(down)) = (u32::try_from(width), u32::try_from(height)) else {
        return Err(Error::encode(path, FORMAT, "its sides must be less than 2^32 pixels"));
    };
    if rgb.is_empty() || expected != Some(rgb.len()) {
        let reason = format!("{} bytes are not {width}×{height} pixels of 3", rgb.len());
        return Err(Error::encode(path, FORMAT, reason));
    }
    write_atomic(path, |sink| {
        PngEncoder::new_with_quality(sink, CompressionType::Default, FilterType::Adaptive)
            .write_image(rgb, across, down, ExtendedColorType::Rgb8)
            .map_err(|error| match error {
                ImageError::IoError(source) => Error::write(path, source),
                other => Error::encode(path, FORMAT, other),
            })
    })
}

/// Reads a PNG of 8 or 16 bits as linear values in 0..1; grey pictures have one channel.
///
/// Errors: `Decode` on damage, `TooLarge` before allocation, `Read` on system failures.
pub fn read_png(path: &Path) -> Result<Raster, Error> {
    let decode = |error: ImageError| Error::decode(path, FORMAT, describe_error(&error));
    let file = open(path)?;
    let decoder = PngDecoder::new(BufReader::new(file)).map_err(decode)?;
    let (width, height) = decoder.dimensions();
    check_size(path, FORMAT, width.into(), height.into(), 3)?;
    let color = decoder.color_type();
    let channels = if color.has_color() { 3 } else { 1 };
    let deep =
        matches!(color, ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16);

    // Decode through a table: few code values, many pixels.
    let image = DynamicImage::from_decoder(decoder).map_err(decode)?;
    let top = if deep { u16::MAX } else { u8::MAX.into() };
    let table: Vec<f32> =
        (0..=top).map(|code| linear_from_srgb(f32::from(code) / f32::from(top))).collect();
    let linear16 = |codes: Vec<u16>| codes.into_iter().map(|code| table[code as usize]).collect();
    let linear8 = |codes: Vec<u8>| codes.into_iter().map(|code| table[code as usize]).collect();
    let data = match (deep, channels) {
        (true, 3) => linear16(image.into_rgb16().into_raw()),
        (true, _) => linear16(image.into_luma16().into_raw()),
        (false, 3) => linear8(image.into_rgb8().into_raw()),
        (false, _) => linear8(image.into_luma8().into_raw()),
    };
    Ok(Raster { width: width as usize, height: height as usize, channels, data })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::srgb_from_linear;
    use crate::testing::{Folder, Stream, damage};

    #[test]
    fn code_values_survive() {
        let folder = Folder::new();
        let path = folder.path("a.png");
        let mut stream = Stream(4);
        let codes: Vec<u8> = (0..9 * 5 * 3).map(|_| stream.next() as u8).collect();
        write_png_rgb8(&codes, 9, 5, &path).unwrap();
        let raster = read_png(&path).unwrap();
        assert_eq!((raster.width, raster.height, raster.channels), (9, 5, 3));
        let back = raster.data.iter().map(|&v| (srgb_from_linear(v) * 255.0).round() as u8);
        assert_eq!(back.collect::<Vec<u8>>(), codes);
    }

    #[test]
    fn sixteen_bits_and_grey_are_read() {
        let folder = Folder::new();
        let path = folder.path("a.png");
        image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 1, vec![0u16, 32768])
            .unwrap()
            .save(&path)
            .unwrap();
        let raster = read_png(&path).unwrap();
        assert_eq!(raster.channels, 1);
        assert!((raster.data[1] - linear_from_srgb(32768.0 / 65535.0)).abs() < 1e-6);
    }

    #[test]
    fn damage_is_an_error_and_bad_sizes_are_refused() {
        let folder = Folder::new();
        let path = folder.path("a.png");
        write_png_rgb8(&[9; 300], 10, 10, &path).unwrap();
        let bytes = fs::read(&path).unwrap();
        damage(&bytes, 300, |bytes| {
            fs::write(&path, bytes).unwrap();
            let _ = read_png(&path);
        });
        fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(read_png(&path).is_err());
        for (len, width, height) in [(3, 2, 1), (0, 0, 0), (3, usize::MAX, 2)] {
            assert!(write_png_rgb8(&vec![0; len], width, height, &path).is_err());
        }
    }
}
