//! OpenEXR files: one picture with its named layers and text.
//!
//! In: a [`LayeredImage`] or a file of any program. Out: the other of the two.
//! Limits: writes one flat part of 32-bit floats, ZIP in blocks of 16 lines; reads every
//! compression but B44 and every sample type of scan-line and tiled parts at their largest
//! level, but no deep data and no subsampled channels.

mod layers;
mod order;

pub(crate) use layers::replicate;

use std::io::BufReader;
use std::path::Path;

use ::exr::meta::BlockDescription;
use ::exr::meta::attribute::{AttributeValue, Chromaticities, Text};
use ::exr::meta::header::{Header, LayerAttributes, standard_names};
use ::exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image, Layer, ReadChannels,
    ReadLayers, SmallVec, Vec2, WritableImage, read,
};

use order::Remember;

use crate::error::{check_raster, check_size};
use crate::read::open;
use crate::{Error, LayeredImage, Raster, write_atomic};

const FORMAT: &str = "OpenEXR";

/// Linear Rec.709 primaries and the D65 white, as CIE x and y.
///
/// Source: ITU-R BT.709-6, items 1.3 and 1.4.
const REC709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// Writes a picture with its layers and metadata as one flat part.
///
/// Channels are named `R G B` at the root, `name.R name.G name.B` for three-channel layers
/// (`X Y Z` for layers called `N` and `P`), `name.Y` for one-channel layers (`depth.Z` for
/// `depth`). A one-channel beauty becomes a root `Y`. Metadata become text attributes in UTF-8.
/// Equal pictures become equal bytes.
///
/// Errors: `Encode` when names are empty, doubled, reserved or too long, or when a layer has
/// another size; `Write` on system failures. The file is written atomically.
pub fn write_exr(image: &LayeredImage, path: &Path) -> Result<(), Error> {
    let size = Vec2(image.beauty.width, image.beauty.height);
    let mut channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = SmallVec::new();
    let named = image.layers.iter().map(|(name, raster)| (name.as_str(), raster));
    for (name, raster) in std::iter::once(("", &image.beauty)).chain(named) {
        check_raster(raster)?;
        if (raster.width, raster.height) != (size.0, size.1) {
            let (w, h) = (raster.width, raster.height);
            let reason =
                format!("layer `{name}` has {w}×{h} pixels, the beauty {}×{}", size.0, size.1);
            return Err(Error::encode(path, FORMAT, reason));
        }
        for (index, channel) in layers::channel_names(name, raster.channels).into_iter().enumerate()
        {
            let channel = check_name(path, "channel", &channel)?;
            channels.push(AnyChannel::new(channel, select_channel(raster, index)));
        }
    }
    channels.sort_by(|a, b| a.name.bytes().cmp(b.name.bytes()));
    if let Some(pair) = channels.windows(2).find(|pair| pair[0].name == pair[1].name) {
        let reason =
            format!("channel `{}` appears twice; give layers different names", pair[0].name);
        return Err(Error::encode(path, FORMAT, reason));
    }

    let mut attributes = LayerAttributes::default();
    for (name, value) in &image.metadata {
        set_attribute(path, &mut attributes, name, value)?;
    }
    let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::FAST_LOSSLESS };
    let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(channels));
    let mut file = Image::from_layer(layer);
    file.attributes.chromaticities = Some(REC709);
    write_atomic(path, |sink| {
        // The encoder keeps attributes in a map without an order.
        let mut sink = Remember::new(sink);
        file.write().to_buffered(&mut sink).map_err(|error| match error {
            ::exr::error::Error::Io(source) => Error::write(path, source),
            other => Error::encode(path, FORMAT, other),
        })?;
        sink.sort_attributes().map_err(|source| Error::write(path, source))
    })
}

/// Reads an OpenEXR file of any program.
///
/// The data window of the first part becomes the picture; further parts of the same size become
/// layers under their part's name. Root `R G B` (or `Y`) is the beauty, alpha is dropped. Without
/// either, the first layer called combined, beauty or rgba, else the first of three channels,
/// else the first, stands in and stays a layer too. Layers and metadata come sorted by name.
///
/// Errors: `Decode` on damaged, deep or empty files, `TooLarge` before anything is allocated.
pub fn read_exr(path: &Path) -> Result<LayeredImage, Error> {
    let decode = |error: ::exr::error::Error| Error::decode(path, FORMAT, error);
    let file = open(path)?;
    let reader = ::exr::block::read(BufReader::new(file), false).map_err(decode)?;
    check_headers(path, reader.headers())?;

    // Read on this thread: a panic in a worker of the decoder would abort the whole process.
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_chunks(reader)
        .map_err(decode)?;

    let metadata = collect_metadata(&image.layer_data);
    let (beauty, layers) = layers::collect(image.layer_data)
        .ok_or_else(|| Error::decode(path, FORMAT, "it holds no full-resolution channel"))?;
    Ok(LayeredImage { beauty, layers, metadata })
}

/// Refuses headers that claim more than we read or that contradict themselves.
fn check_headers(path: &Path, headers: &[Header]) -> Result<(), Error> {
    let mut total_channels = 0;
    for header in headers {
        if header.deep {
            return Err(Error::decode(path, FORMAT, "it holds deep data; flatten it first"));
        }
        // The decoder's arithmetic overflows on damaged blocks of this kind.
        if matches!(header.compression, Compression::B44 | Compression::B44A) {
            let reason = "its compression B44 is not supported; save it with ZIP";
            return Err(Error::decode(path, FORMAT, reason));
        }
        let Vec2(width, height) = header.layer_size;
        let channels = header.channels.list.len() as u64;
        check_size(path, FORMAT, width as u64, height as u64, channels)?;
        if let BlockDescription::Tiles(tiles) = header.blocks {
            let Vec2(across, down) = tiles.tile_size;
            check_size(path, FORMAT, across as u64, down as u64, channels)?;
        }
        total_channels += channels;
    }
    let Some(first) = headers.first() else {
        return Err(Error::decode(path, FORMAT, "it holds no parts"));
    };
    let largest = headers.iter().map(|h| h.layer_size.area() as u64).max().unwrap_or(0);
    let width = first.layer_size.0 as u64;
    check_size(path, FORMAT, width, largest.div_ceil(width.max(1)), total_channels)
}

/// One channel of an interleaved raster as EXR samples.
fn select_channel(raster: &Raster, index: usize) -> FlatSamples {
    FlatSamples::F32(raster.data.iter().skip(index).step_by(raster.channels).copied().collect())
}

/// A name that the format can hold.
fn check_name(path: &Path, kind: &str, name: &str) -> Result<Text, Error> {
    let bare = name.is_empty() || name.starts_with('.');
    if bare || name.len() > 255 || name.contains('\0') {
        let reason =
            format!("the {kind} name `{name}` must have 1 to 255 bytes, none of them zero");
        return Err(Error::encode(path, FORMAT, reason));
    }
    Ok(Text::from_slice_unchecked(name.as_bytes()))
}

/// Stores one line of metadata in the header.
fn set_attribute(
    path: &Path,
    attributes: &mut LayerAttributes,
    name: &str,
    value: &str,
) -> Result<(), Error> {
    let key = check_name(path, "metadata", name)?;
    let text = Text::from_slice_unchecked(value.as_bytes());
    let slot = match name {
        "owner" => &mut attributes.owner,
        "comments" => &mut attributes.comments,
        "capDate" => &mut attributes.capture_date,
        _ if standard_names::ALL.contains(&name.as_bytes()) => {
            let reason = format!("the metadata name `{name}` is reserved; choose another");
            return Err(Error::encode(path, FORMAT, reason));
        }
        _ => {
            attributes.other.insert(key, AttributeValue::Text(text));
            return Ok(());
        }
    };
    *slot = Some(text);
    Ok(())
}

/// The text attributes of the first part, sorted by name.
fn collect_metadata(parts: &[Layer<AnyChannels<FlatSamples>>]) -> Vec<(String, String)> {
    let Some(part) = parts.first() else { return Vec::new() };
    let utf8 = |text: &Text| String::from_utf8_lossy(text.bytes()).into_owned();
    let attributes = &part.attributes;
    let typed = [
        ("owner", &attributes.owner),
        ("comments", &attributes.comments),
        ("capDate", &attributes.capture_date),
    ];
    let typed =
        typed.into_iter().filter_map(|(name, text)| Some((name.into(), utf8(text.as_ref()?))));
    let other = attributes.other.iter().filter_map(|(name, value)| match value {
        AttributeValue::Text(text) => Some((utf8(name), utf8(text))),
        _ => None,
    });
    let mut metadata: Vec<(String, String)> = typed.chain(other).collect();
    metadata.sort();
    metadata
}

#[cfg(test)]
mod tests;
