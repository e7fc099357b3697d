//! Pictures of any format, told apart by their first bytes.
//!
//! In: a file. Out: a [`LayeredImage`] with three channels of beauty.
//! Limits: see the readers of the formats.

use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read};
use std::path::Path;

use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder, ImageError};

use crate::error::check_size;
use crate::exr::replicate;
use crate::{Error, LayeredImage, Raster, read_exr, read_pfm, read_png};

/// Reads an OpenEXR, PFM, Radiance HDR or PNG file, whatever it is called.
///
/// Grey pictures get three equal channels. PNG values are linearised to 0..1.
///
/// Errors: `UnknownFormat` for other content, else those of the reader.
pub fn read_picture(path: &Path) -> Result<LayeredImage, Error> {
    let system = |source| Error::read(path, source);
    let mut start = Vec::new();
    open(path)?.take(8).read_to_end(&mut start).map_err(system)?;
    let beauty = match start.as_slice() {
        [0x76, 0x2f, 0x31, 0x01, ..] => return read_exr(path),
        [b'P', b'F' | b'f', space, ..] if space.is_ascii_whitespace() => read_pfm(path)?,
        [b'#', b'?', ..] => read_hdr(path)?,
        [0x89, b'P', b'N', b'G', ..] => read_png(path)?,
        _ => return Err(Error::UnknownFormat { path: path.to_owned() }),
    };
    Ok(LayeredImage { beauty: replicate(&beauty), layers: Vec::new(), metadata: Vec::new() })
}

/// Opens a regular file; pipes and devices may have no end, or never begin.
pub(crate) fn open(path: &Path) -> Result<File, Error> {
    let meta = path.metadata().map_err(|source| Error::read(path, source))?;
    if meta.is_dir() {
        return Err(Error::read(path, ErrorKind::IsADirectory.into()));
    }
    if !meta.is_file() {
        return Err(Error::read(path, io::Error::other("it is a pipe or a device, not a file")));
    }
    // Files of the system that claim to be empty may wait for ever.
    if meta.len() == 0 {
        return Err(Error::UnknownFormat { path: path.to_owned() });
    }
    File::open(path).map_err(|source| Error::read(path, source))
}

/// Why a picture cannot be decoded; decoders have words of their own for it, not for users.
pub(crate) fn describe_error(error: &ImageError) -> String {
    match error {
        ImageError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof => "it is cut short".into(),
        ImageError::IoError(e) => e.to_string(),
        ImageError::Unsupported(_) => "its kind is not supported".into(),
        ImageError::Limits(_) => "it is too large".into(),
        _ => "its bytes are damaged".into(),
    }
}

/// Reads a Radiance HDR picture; its `EXPOSURE` lines are not applied.
///
/// Errors: `Decode` on damage, `TooLarge` before allocation, `Read` on system failures.
pub fn read_hdr(path: &Path) -> Result<Raster, Error> {
    const FORMAT: &str = "Radiance HDR";
    let decode = |error: ImageError| Error::decode(path, FORMAT, describe_error(&error));
    let file = open(path)?;
    let decoder = HdrDecoder::new_nonstrict(BufReader::new(file)).map_err(decode)?;
    let (width, height) = decoder.dimensions();
    check_size(path, FORMAT, width.into(), height.into(), 3)?;
    let data = DynamicImage::from_decoder(decoder).map_err(decode)?.into_rgb32f().into_raw();
    Ok(Raster { width: width as usize, height: height as usize, channels: 3, data })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::testing::{Folder, damage, random_raster};
    use crate::{write_exr, write_pfm, write_png_rgb8};

    #[test]
    fn content_decides_and_not_the_name() {
        let folder = Folder::new();
        let path = folder.path("picture.jpg");
        let raster = random_raster(6, 5, 3, 1);
        let image = LayeredImage { beauty: raster, layers: vec![], metadata: vec![] };
        write_exr(&image, &path).unwrap();
        assert_eq!(read_picture(&path).unwrap(), image);
        write_pfm(&random_raster(6, 5, 1, 1), &path).unwrap();
        assert_eq!(read_picture(&path).unwrap().beauty.channels, 3);
        write_png_rgb8(&[255; 3], 1, 1, &path).unwrap();
        assert_eq!(read_picture(&path).unwrap().beauty.data, [1.0; 3]);
        for odd in ["", "P", "GIF89a", "P6\n1 1\n255\n"] {
            fs::write(&path, odd).unwrap();
            let error = read_picture(&path).unwrap_err();
            assert!(error.to_string().contains(".exr"), "{error}");
        }
        fs::write(&path, b"\x89PNG\r\n\x1a\nxxxxxxxxxxxxxxxxxxxxxxxxxx").unwrap();
        let error = read_picture(&path).unwrap_err().to_string();
        assert!(error.contains("PNG picture: its bytes are damaged; make"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn pipes_and_devices_are_refused_at_once() {
        let folder = Folder::new();
        let pipe = folder.path("pipe.exr");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for path in [&pipe, Path::new("/dev/zero")] {
            for read in [read_picture as fn(&Path) -> Result<LayeredImage, Error>, read_exr] {
                let error = read(path).unwrap_err().to_string();
                assert!(error.contains("not a file"), "{error}");
            }
            assert!(read_pfm(path).is_err() && read_png(path).is_err() && read_hdr(path).is_err());
        }
        let error = crate::write_atomic(&pipe, |_| Ok(())).unwrap_err().to_string();
        assert!(error.contains("it is a pipe or a socket"), "{error}");
        assert!(crate::write_atomic(Path::new("/dev/null"), |_| Ok(())).is_ok());
    }

    #[test]
    fn radiance_pictures_are_read_and_damage_is_survived() {
        let folder = Folder::new();
        let path = folder.path("a.hdr");
        let pixels = vec![image::Rgb([1.0f32, 0.5, 8.0]); 40 * 10];
        let mut bytes = Vec::new();
        image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&pixels, 40, 10).unwrap();
        fs::write(&path, &bytes).unwrap();
        let raster = read_hdr(&path).unwrap();
        for (value, expected) in raster.pixel(39, 9).iter().zip([1.0f32, 0.5, 8.0]) {
            assert!((value - expected).abs() <= 8.0 / 128.0);
        }
        damage(&bytes, 300, |bytes| {
            fs::write(&path, bytes).unwrap();
            let _ = read_picture(&path);
        });
        fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(read_hdr(&path).is_err());
        fs::write(&path, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 99999 +X 99999\n").unwrap();
        assert!(matches!(read_hdr(&path), Err(Error::TooLarge { .. })));
    }
}
