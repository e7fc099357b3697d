//! Portable float maps: the simplest exact exchange of linear pictures.
//!
//! In: a raster of one or three channels, or a file in either byte order.
//! Out: the other of the two, bit for bit.
//! Limits: the scale of the header only tells the byte order; its size is ignored, as usual.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use crate::error::{check_raster, check_size};
use crate::read::open;
use crate::{Error, Raster, write_atomic};

const FORMAT: &str = "PFM";
/// Most bytes of one word in a header.
const MAX_WORD: u64 = 32;

/// Writes a raster as a little-endian PFM, rows from the bottom up.
///
/// Errors: `Shape` for other than 1 or 3 channels, `Write` on system failures.
pub fn write_pfm(raster: &Raster, path: &Path) -> Result<(), Error> {
    check_raster(raster)?;
    let magic = if raster.channels == 3 { "PF" } else { "Pf" };
    let header = format!("{magic}\n{} {}\n-1.0\n", raster.width, raster.height);
    write_atomic(path, |sink| {
        let system = |source| Error::write(path, source);
        sink.write_all(header.as_bytes()).map_err(system)?;
        for row in raster.data.chunks_exact(raster.width * raster.channels).rev() {
            let bytes: Vec<u8> = row.iter().flat_map(|value| value.to_le_bytes()).collect();
            sink.write_all(&bytes).map_err(system)?;
        }
        Ok(())
    })
}

/// Reads a PFM of one (`Pf`) or three (`PF`) channels.
///
/// Errors: `Decode` when the header is odd or data are missing, `TooLarge`, `Read`.
pub fn read_pfm(path: &Path) -> Result<Raster, Error> {
    let system = |source| Error::read(path, source);
    let mut file = BufReader::new(open(path)?);
    let mut word = || read_word(&mut file).map_err(system);

    let channels = match word()?.as_str() {
        "PF" => 3,
        "Pf" => 1,
        _ => return Err(Error::decode(path, FORMAT, "it does not begin with PF or Pf")),
    };
    let (width, height, scale) = (word()?, word()?, word()?);
    let bad = |what: &str| Error::decode(path, FORMAT, format!("its {what} is not a number"));
    let width: usize = width.parse().map_err(|_| bad("width"))?;
    let height: usize = height.parse().map_err(|_| bad("height"))?;
    let scale: f32 = scale.parse().map_err(|_| bad("scale"))?;
    if !scale.is_finite() || scale == 0.0 {
        return Err(bad("scale"));
    }
    check_size(path, FORMAT, width as u64, height as u64, channels as u64)?;

    // The buffer grows with what arrives, not with what the header claims.
    let expected = width * height * channels * 4;
    let mut bytes = Vec::new();
    file.take(expected as u64).read_to_end(&mut bytes).map_err(system)?;
    if bytes.len() != expected {
        let reason = format!("it has {} of {expected} bytes of pixels", bytes.len());
        return Err(Error::decode(path, FORMAT, reason));
    }
    let decode = if scale < 0.0 { f32::from_le_bytes } else { f32::from_be_bytes };
    let mut data = Vec::with_capacity(expected / 4);
    for row in bytes.chunks_exact(width * channels * 4).rev() {
        data.extend(row.as_chunks().0.iter().map(|&value| decode(value)));
    }
    Ok(Raster { width, height, channels, data })
}

/// The next word of a header and the single white space after it.
fn read_word(file: &mut impl BufRead) -> std::io::Result<String> {
    let mut word = String::new();
    for byte in file.take(MAX_WORD).bytes() {
        let letter = byte? as char;
        if !letter.is_ascii_whitespace() {
            word.push(letter);
        } else if !word.is_empty() {
            break;
        }
    }
    Ok(word)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::testing::{Folder, damage, random_raster};

    #[test]
    fn values_survive_bit_for_bit() {
        let folder = Folder::new();
        for channels in [1, 3] {
            let path = folder.path("a.pfm");
            let mut raster = random_raster(13, 7, channels, 3);
            raster.data[0] = f32::NEG_INFINITY;
            raster.data[1] = f32::MIN_POSITIVE / 2.0;
            write_pfm(&raster, &path).unwrap();
            assert_eq!(read_pfm(&path).unwrap(), raster);
        }
        assert!(write_pfm(&Raster::new(2, 2, 2), &folder.path("b.pfm")).is_err());
    }

    #[test]
    fn rows_run_upward_in_either_byte_order() {
        let folder = Folder::new();
        let path = folder.path("a.pfm");
        let values = [1.0f32, 2.0].map(f32::to_be_bytes).concat();
        fs::write(&path, [b"Pf 1 2 1.0\n".as_slice(), &values].concat()).unwrap();
        assert_eq!(read_pfm(&path).unwrap().data, [2.0, 1.0]);
    }

    #[test]
    fn damage_and_huge_claims_are_errors() {
        let folder = Folder::new();
        let path = folder.path("a.pfm");
        write_pfm(&random_raster(5, 4, 3, 9), &path).unwrap();
        let bytes = fs::read(&path).unwrap();
        damage(&bytes, 300, |bytes| {
            fs::write(&path, bytes).unwrap();
            let _ = read_pfm(&path);
        });
        for odd in ["", "PF", "PF 0 0 1\n", "PF 99999 99999 -1\n", "PF 3 3 nan\n", "PF 1 1 0\n1234"]
        {
            fs::write(&path, odd).unwrap();
            assert!(read_pfm(&path).is_err(), "{odd}");
        }
        let huge = format!("PF {} {} -1\n", usize::MAX, usize::MAX);
        fs::write(&path, huge).unwrap();
        assert!(matches!(read_pfm(&path), Err(Error::TooLarge { .. })));
        fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        assert!(read_pfm(&path).is_err());
        assert!(matches!(read_pfm(&folder.path("none")), Err(Error::Read { .. })));
    }
}
