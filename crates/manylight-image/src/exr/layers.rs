//! Which EXR channels belong together, and what they are called.

use std::collections::BTreeMap;

use ::exr::prelude::{AnyChannels, FlatSamples, Layer, Vec2};

use crate::Raster;

/// The EXR channels of a layer; the root has an empty name.
pub(super) fn channel_names(layer: &str, channels: usize) -> Vec<String> {
    let suffixes: &[&str] = match (layer, channels) {
        ("N" | "P", 3) => &["X", "Y", "Z"],
        (_, 3) => &["R", "G", "B"],
        ("depth", _) => &["Z"],
        _ => &["Y"],
    };
    let name = |suffix: &&str| match layer {
        "" => suffix.to_string(),
        layer => format!("{layer}.{suffix}"),
    };
    suffixes.iter().map(name).collect()
}

/// The planes of one layer by the last word of their names.
type Group = BTreeMap<String, Vec<f32>>;

/// The beauty and the named layers of a file; nothing when no channel has the full size.
pub(super) fn collect(
    parts: impl IntoIterator<Item = Layer<AnyChannels<FlatSamples>>>,
) -> Option<(Raster, Vec<(String, Raster)>)> {
    let (size, mut groups) = group_channels(parts);
    let mut layers = BTreeMap::new();
    let beauty = groups.remove("").and_then(|mut root| {
        root.remove("A");
        let beauty = take_triple(&mut root, size, ["R", "G", "B"])
            .or_else(|| Some(replicate(&plane(size, root.remove("Y")?))));
        for (name, data) in root {
            let name = if name == "Z" { "depth".into() } else { name };
            layers.insert(name, plane(size, data));
        }
        beauty
    });
    for (name, mut group) in groups {
        let color = take_triple(&mut group, size, ["R", "G", "B"]);
        if color.is_some() {
            group.remove("A");
        }
        let whole =
            color.or_else(|| take_triple(&mut group, size, ["X", "Y", "Z"])).or_else(|| {
                let only = (group.len() == 1).then(|| group.pop_first()).flatten();
                only.map(|(_, data)| plane(size, data))
            });
        for (suffix, data) in group {
            layers.insert(format!("{name}.{suffix}"), plane(size, data));
        }
        if let Some(raster) = whole {
            layers.insert(name, raster);
        }
    }
    let layers: Vec<(String, Raster)> = layers.into_iter().collect();
    let beauty = match beauty {
        Some(beauty) => beauty,
        None => choose_beauty(&layers)?,
    };
    Some((beauty, layers))
}

/// Sorts the planes of all parts of the first part's size into layers.
fn group_channels(
    parts: impl IntoIterator<Item = Layer<AnyChannels<FlatSamples>>>,
) -> (Vec2<usize>, BTreeMap<String, Group>) {
    let mut groups: BTreeMap<String, Group> = BTreeMap::new();
    let mut size = None;
    for part in parts {
        let first = size.is_none();
        if *size.get_or_insert(part.size) != part.size {
            continue;
        }
        let part_name = part.attributes.layer_name.filter(|_| !first);
        let part_name = part_name.map(|name| String::from_utf8_lossy(name.bytes()).into_owned());
        for channel in part.channel_data.list {
            if channel.sampling != Vec2(1, 1) {
                continue;
            }
            let name = String::from_utf8_lossy(channel.name.bytes()).into_owned();
            let (layer, suffix) = match (name.rsplit_once('.'), &part_name) {
                (Some((layer, suffix)), _) => (layer.to_owned(), suffix),
                (None, Some(part)) => (part.clone(), name.as_str()),
                (None, None) => (String::new(), name.as_str()),
            };
            let plane = match channel.sample_data {
                FlatSamples::F32(values) => values,
                FlatSamples::F16(values) => values.iter().map(|value| value.to_f32()).collect(),
                FlatSamples::U32(values) => values.iter().map(|&value| value as f32).collect(),
            };
            groups.entry(layer).or_default().entry(suffix.to_uppercase()).or_insert(plane);
        }
    }
    (size.unwrap_or(Vec2(0, 0)), groups)
}

/// Joins three planes of a group, if it has them all.
fn take_triple(group: &mut Group, size: Vec2<usize>, suffixes: [&str; 3]) -> Option<Raster> {
    if !suffixes.iter().all(|&suffix| group.contains_key(suffix)) {
        return None;
    }
    let mut raster = Raster::new(size.0, size.1, 3);
    for (index, suffix) in suffixes.into_iter().enumerate() {
        let values = group.remove(suffix)?;
        for (pixel, value) in raster.data.chunks_exact_mut(3).zip(values) {
            pixel[index] = value;
        }
    }
    Some(raster)
}

/// A raster of one channel.
fn plane(size: Vec2<usize>, data: Vec<f32>) -> Raster {
    Raster { width: size.0, height: size.1, channels: 1, data }
}

/// The same values in three channels.
pub(crate) fn replicate(raster: &Raster) -> Raster {
    if raster.channels == 3 {
        return raster.clone();
    }
    let data = raster.data.iter().flat_map(|&value| [value; 3]).collect();
    Raster { channels: 3, data, ..*raster }
}

/// The layer that stands in when a file has no root colour.
fn choose_beauty(layers: &[(String, Raster)]) -> Option<Raster> {
    let named = |name: &str| {
        let last = name.rsplit('.').next().unwrap_or(name).to_lowercase();
        ["combined", "beauty", "rgba"].contains(&last.as_str())
    };
    let colored = || layers.iter().filter(|(_, raster)| raster.channels == 3);
    let chosen = colored().find(|(name, _)| named(name)).or_else(|| colored().next());
    chosen.or_else(|| layers.first()).map(|(_, raster)| replicate(raster))
}
