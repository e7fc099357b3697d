//! Round trips, files of other programs, and damage.

use std::fs;

use ::exr::prelude::f16;

use super::*;
use crate::testing::{Folder, Stream, damage, random_raster};

fn sample_image() -> LayeredImage {
    let mut beauty = random_raster(37, 21, 3, 1);
    beauty.data[5] = f32::INFINITY;
    let layers = [("N", 3), ("P", 3), ("depth", 1), ("direct", 3), ("evals", 1)];
    let layers = layers.iter().enumerate().map(|(seed, &(name, channels))| {
        (name.to_owned(), random_raster(37, 21, channels, seed as u64 + 2))
    });
    let metadata = [("comments", "two\nlines"), ("manylight.seed", "7"), ("ünïcode", "“λ”")];
    let metadata = metadata.map(|(name, value)| (name.to_owned(), value.to_owned()));
    LayeredImage { beauty, layers: layers.collect(), metadata: metadata.into() }
}

#[test]
fn layers_and_metadata_survive_a_round_trip() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let image = sample_image();
    write_exr(&image, &path).unwrap();
    assert_eq!(read_exr(&path).unwrap(), image);
    assert_eq!(folder.file_count(), 1);
}

#[test]
fn equal_pictures_are_equal_files() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let mut image = sample_image();
    let more = (0..20).map(|i| (format!("manylight.{i}"), "x".repeat(i * 300)));
    image.metadata.extend(more);
    write_exr(&image, &path).unwrap();
    let bytes = fs::read(&path).unwrap();
    for _ in 0..4 {
        write_exr(&image, &path).unwrap();
        assert!(fs::read(&path).unwrap() == bytes);
    }
    let at = |name: &str| bytes.windows(name.len()).position(|w| w == name.as_bytes()).unwrap();
    let places = ["channels\0", "comments\0", "manylight.0\0", "manylight.9\0", "ünïcode\0"];
    assert!(places.map(at).is_sorted());
    image.metadata.sort();
    assert_eq!(read_exr(&path).unwrap(), image);
}

#[test]
fn channel_names_follow_the_contract() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    write_exr(&sample_image(), &path).unwrap();
    let meta = ::exr::meta::MetaData::read_from_file(&path, true).unwrap();
    let names: Vec<String> =
        meta.headers[0].channels.list.iter().map(|c| c.name.to_string()).collect();
    let expected = "B G N.X N.Y N.Z P.X P.Y P.Z R depth.Z direct.B direct.G direct.R evals.Y";
    assert_eq!(names.join(" "), expected);
    assert_eq!(meta.headers.len(), 1);
}

/// Writes the given channels the way another program might.
fn write_foreign(path: &Path, compression: Compression, names: &[&str], half: bool) {
    let channels = names.iter().enumerate().map(|(index, &name)| {
        let values = (0..15).map(|i| (i + index) as f32);
        let samples = match half {
            true => FlatSamples::F16(values.map(f16::from_f32).collect()),
            false => FlatSamples::F32(values.collect()),
        };
        AnyChannel::new(name, samples)
    });
    let encoding = Encoding { compression, ..Encoding::FAST_LOSSLESS };
    let channels = AnyChannels::sort(channels.collect());
    let layer = Layer::new((5, 3), LayerAttributes::default(), encoding, channels);
    Image::from_layer(layer).write().to_file(path).unwrap();
}

#[test]
fn files_of_other_programs_are_understood() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    write_foreign(&path, Compression::PIZ, &["R", "G", "B", "A", "Z"], true);
    let image = read_exr(&path).unwrap();
    assert_eq!(image.beauty.pixel(1, 1), [6.0, 7.0, 8.0]);
    assert_eq!(image.layers.len(), 1);
    assert_eq!(image.layers[0].0, "depth");

    write_foreign(&path, Compression::RLE, &["Y"], false);
    assert_eq!(read_exr(&path).unwrap().beauty.pixel(4, 2), [14.0; 3]);

    let names = ["View.Combined.R", "View.Combined.G", "View.Combined.B", "View.Combined.A"];
    let names =
        [&names[..], &["View.AO.R", "View.AO.G", "View.AO.B", "View.Mist.Z", "UV.U", "UV.V"]];
    write_foreign(&path, Compression::ZIP1, &names.concat(), false);
    let image = read_exr(&path).unwrap();
    assert_eq!(image.beauty.pixel(0, 0), [0.0, 1.0, 2.0]);
    let layers: Vec<&str> = image.layers.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(layers, ["UV.U", "UV.V", "View.AO", "View.Combined", "View.Mist"]);
}

#[test]
fn pictures_that_do_not_fit_are_refused() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let refuse = |change: &dyn Fn(&mut LayeredImage)| {
        let mut image = sample_image();
        change(&mut image);
        assert!(write_exr(&image, &path).is_err());
        assert_eq!(folder.file_count(), 0);
    };
    refuse(&|image| image.layers[0].1 = Raster::new(3, 3, 1));
    refuse(&|image| image.layers[0].0 = "P".into());
    refuse(&|image| image.layers[0].0 = String::new());
    refuse(&|image| image.layers[0].0 = "x".repeat(254));
    refuse(&|image| image.metadata[0].0 = "channels".into());
    refuse(&|image| image.metadata[0].0 = String::new());
    refuse(&|image| image.beauty = Raster::new(0, 0, 3));
    refuse(&|image| image.beauty.data.truncate(4));
}

#[test]
fn b44_is_refused_with_a_remedy() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    write_foreign(&path, Compression::B44, &["R", "G", "B"], true);
    assert!(read_exr(&path).unwrap_err().to_string().contains("save it with ZIP"));
}

#[test]
fn damaged_files_are_errors_or_pictures_but_never_panics() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let compressions = [Compression::ZIP16, Compression::PIZ, Compression::RLE, Compression::PXR24];
    for compression in compressions {
        write_foreign(&path, compression, &["R", "G", "B"], true);
        let bytes = fs::read(&path).unwrap();
        damage(&bytes, 150, |bytes| {
            fs::write(&path, bytes).unwrap();
            let _ = read_exr(&path);
        });
        fs::write(&path, &bytes[..bytes.len() - 9]).unwrap();
        assert!(read_exr(&path).is_err());
    }
}

#[test]
fn huge_claims_are_refused_before_allocation() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    write_foreign(&path, Compression::ZIP16, &["R", "G", "B"], true);
    let bytes = fs::read(&path).unwrap();
    let window = b"dataWindow\0box2i\0";
    let at = bytes.windows(window.len()).position(|part| part == window).unwrap();
    let at = at + window.len() + 4;
    for corner in [i32::MAX, 1 << 20, -5, 60_000] {
        let mut huge = bytes.clone();
        for offset in [8, 12] {
            huge[at + offset..at + offset + 4].copy_from_slice(&corner.to_le_bytes());
        }
        fs::write(&path, &huge).unwrap();
        assert!(read_exr(&path).is_err());
    }
    let mut stream = Stream(3);
    for _ in 0..200 {
        let mut odd = bytes.clone();
        let offset = at + stream.below(16);
        odd[offset] = stream.next() as u8;
        fs::write(&path, &odd).unwrap();
        let _ = read_exr(&path);
    }
}
