//! All settings of a render, by path, with presets and range checks.
//!
//! One text form everywhere: `grid.alpha=1.5` on the command line is `{"grid":{"alpha":1.5}}` in a
//! shot file. Unknown paths are errors.

use crate::error::Error;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// How the picture is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Virtual lights through the lighting grid hierarchy.
    #[default]
    Grid,
    /// Virtual lights, each with its own shadow ray: the definition of every gather.
    Brute,
    /// Unbiased path tracing: the reference.
    Path,
    /// Light that arrives straight from its source.
    Direct,
}

impl Method {
    /// Every method with a sentence for the manual.
    pub const ALL: [(Self, &'static str, &'static str); 4] = [
        (Self::Grid, "grid", "virtual lights gathered by the lighting grid hierarchy (default)"),
        (Self::Brute, "brute", "every virtual light with a shadow ray each: the definition"),
        (Self::Path, "path", "unbiased path tracing with next-event estimation: the reference"),
        (Self::Direct, "direct", "direct light alone"),
    ];

    /// The name used in settings and files.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|m| m.0 == self).map_or("grid", |m| m.1)
    }
}

/// How a shadow ray chooses its target inside a grid light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ShadowTarget {
    /// A real virtual light, drawn in proportion to its share.
    #[default]
    Vpl,
    /// A point drawn from the grid light's variance (the 2019 paper).
    Variance,
}

macro_rules! group {
    ($(#[$meta:meta])* $name:ident {
        $($(#[$field_meta:meta])* $field:ident: $type:ty = $value:expr,)*
    }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name { $($(#[$field_meta])* pub $field: $type,)* }
        impl Default for $name {
            fn default() -> Self { Self { $($field: $value,)* } }
        }
    };
}

/// How the drawn shadow rays become one ratio.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ShadowEstimate {
    /// Share of rays that arrive (the paper).
    Mean,
    /// Rays weighted by the drawn light's own contribution over its probability.
    #[default]
    Weighted,
}

group! {
    /// Everything that decides the picture besides the scene.
    Settings {
        /// How the picture is computed.
        method: Method = Method::Grid,
        /// Chooses the random numbers; the same seed gives the same bits.
        seed: u32 = 0,
        /// Virtual lights.
        vpls: VplSettings = VplSettings::default(),
        /// The lighting grid hierarchy.
        grid: GridSettings = GridSettings::default(),
        /// Shadow rays of the grid method.
        shadow: ShadowSettings = ShadowSettings::default(),
        /// Filtering of the shadow ratio.
        filter: FilterSettings = FilterSettings::default(),
        /// The reference path tracer.
        path: PathSettings = PathSettings::default(),
        /// Surfaces.
        surface: SurfaceSettings = SurfaceSettings::default(),
        /// The picture.
        film: FilmSettings = FilmSettings::default(),
    }
}

group! {
    /// Virtual lights.
    VplSettings {
        /// How many, about; 1 to 16,000,000. More: less noise baked into the lighting, more time.
        count: u32 = 100_000,
        /// Hits per light path that leave a virtual light, 1 to 64.
        bounces: u32 = 3,
        /// Virtual lights on emissive surfaces, for their direct light; 1 to 16,000,000.
        emitter_count: u32 = 20_000,
        /// Distance below which a light stops growing, metres; null: 1 % of the scene's diagonal,
        /// at most 0.15 m. Smaller: truer corners, more spots.
        d_min: Option<f32> = None,
    }
}

group! {
    /// The lighting grid hierarchy `[LinYuksel19]`.
    GridSettings {
        /// r_l = alpha · h_l: how far a level reaches, 0.25 to 16. Cost grows about with its
        /// square.
        alpha: f32 = 1.1,
        /// Number of levels, 2 to 14; null: chosen from the number and the spread of the lights.
        levels: Option<u32> = None,
        /// 0 evaluates the virtual lights themselves near the receiver, 1 starts at the grid.
        start_level: u32 = 1,
        /// 6: a grid light per vertex and dominant normal axis; 1: one per vertex (the paper).
        lobes: u32 = 6,
        /// Whether a grid light shines as the spread of the lights it stands for; false: as a
        /// point at their mean (the paper).
        spread: bool = true,
    }
}

group! {
    /// Shadow rays of the grid method.
    ShadowSettings {
        /// Rays per pixel and gather, 0 to 256, half of it for the sky; 0: no shadows.
        rays: u32 = 4,
        /// What a ray aims at.
        target: ShadowTarget = ShadowTarget::Vpl,
        /// Lowest grid level whose lights are drawn for shadows.
        start_level: u32 = 1,
        /// Whether the draws of a pixel and its neighbors are stratified against each other;
        /// false: independent (the paper).
        stratified: bool = true,
        /// How the rays become one ratio.
        estimate: ShadowEstimate = ShadowEstimate::Weighted,
    }
}

group! {
    /// Edge-avoiding à-trous filter of the shadow ratio `[Dammertz10]`.
    FilterSettings {
        /// On or off.
        enabled: bool = true,
        /// Passes; pass i reaches 2^(i+1) pixels. 1 to 8.
        passes: u32 = 4,
    }
}

group! {
    /// The reference path tracer.
    PathSettings {
        /// Paths per pixel, 1 to 1,048,576.
        spp: u32 = 64,
    }
}

group! {
    /// Surfaces.
    SurfaceSettings {
        /// Whether normal textures bend the shading normal.
        normal_maps: bool = true,
    }
}

group! {
    /// The picture.
    FilmSettings {
        /// Exposure of the tone-mapped picture, EV; null: automatic.
        exposure_ev: Option<f32> = None,
        /// Samples per pixel of the methods other than `path`, 1 to 4096; 1: the pixel's center.
        samples: u32 = 1,
    }
}

/// Names of the presets, from quick to thorough, and the paper's own.
pub const PRESETS: [&str; 6] = ["draft", "fast", "balanced", "fine", "exhaustive", "paper"];

impl Settings {
    /// A preset by name.
    ///
    /// Errors: names the presets there are.
    pub fn preset(name: &str) -> Result<Self, Error> {
        let mut s = Self::default();
        match name {
            "draft" => (s.vpls.count, s.grid.alpha, s.shadow.rays) = (20_000, 0.75, 2),
            "fast" => (s.vpls.count, s.grid.alpha) = (50_000, 0.9),
            "balanced" => {}
            "fine" => (s.vpls.count, s.grid.alpha, s.shadow.rays) = (300_000, 1.5, 8),
            "exhaustive" => {
                (s.vpls.count, s.grid.alpha, s.shadow.rays) = (1_000_000, 2.0, 32);
                (s.vpls.bounces, s.film.samples) = (8, 4);
            }
            "paper" => {
                s.grid.alpha = 1.0;
                (s.grid.lobes, s.grid.spread) = (1, false);
                (s.shadow.start_level, s.shadow.stratified) = (2, false);
                (s.shadow.target, s.shadow.estimate) =
                    (ShadowTarget::Variance, ShadowEstimate::Mean);
            }
            _ => {
                return Err(setting(
                    "preset",
                    format!("no preset {name:?}; use one of {PRESETS:?}"),
                ));
            }
        }
        Ok(s)
    }

    /// Overlays a JSON object, as found in a shot file.
    ///
    /// Errors: names the unknown key or the value of the wrong type.
    pub fn apply(&mut self, object: &Map<String, Value>) -> Result<(), Error> {
        let mut whole = self.to_json();
        merge(&mut whole, object, "")?;
        *self = serde_json::from_value(Value::Object(whole))
            .map_err(|e| setting("settings", format!("{e}; see `manylight render --help`")))?;
        Ok(())
    }

    /// Sets one field by path, e.g. `set("grid.alpha", "1.5")`.
    ///
    /// Errors: names the path and what was wrong.
    pub fn set(&mut self, path: &str, text: &str) -> Result<(), Error> {
        let value =
            serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.trim().to_owned()));
        let object = path.rsplit('.').fold(value, |inner, key| {
            let mut map = Map::new();
            map.insert(key.to_owned(), inner);
            Value::Object(map)
        });
        let Value::Object(object) = object else { return Ok(()) };
        self.apply(&object).map_err(|e| match e {
            Error::Setting { path: at, problem } if at == "settings" => setting(path, problem),
            other => other,
        })
    }

    /// All settings as one JSON object.
    pub fn to_json(&self) -> Map<String, Value> {
        match serde_json::to_value(self) {
            Ok(Value::Object(map)) => map,
            _ => Map::new(),
        }
    }

    /// Checks every range.
    ///
    /// Errors: the path of the first bad field, its value and what is allowed.
    pub fn validate(&self) -> Result<(), Error> {
        let whole = |path, value: u32, low: u32, high: u32| match value {
            v if v < low || v > high => {
                Err(setting(path, format!("{value} is outside {low} to {high}")))
            }
            _ => Ok(()),
        };
        let real = |path, value: f32, low: f32, high: f32| match value {
            v if v.is_finite() && v >= low && v <= high => Ok(()),
            _ => Err(setting(path, format!("{value} is outside {low} to {high}"))),
        };
        whole("vpls.count", self.vpls.count, 1, 16_000_000)?;
        whole("vpls.emitter_count", self.vpls.emitter_count, 1, 16_000_000)?;
        whole("vpls.bounces", self.vpls.bounces, 1, 64)?;
        self.vpls.d_min.map_or(Ok(()), |d| real("vpls.d_min", d, 0.0, 1e6))?;
        real("grid.alpha", self.grid.alpha, 0.25, 16.0)?;
        self.grid.levels.map_or(Ok(()), |l| whole("grid.levels", l, 2, 14))?;
        whole("grid.start_level", self.grid.start_level, 0, 1)?;
        if self.grid.lobes != 1 && self.grid.lobes != 6 {
            return Err(setting("grid.lobes", format!("{} is neither 1 nor 6", self.grid.lobes)));
        }
        whole("shadow.rays", self.shadow.rays, 0, 256)?;
        whole("shadow.start_level", self.shadow.start_level, 0, 14)?;
        whole("filter.passes", self.filter.passes, 1, 8)?;
        whole("path.spp", self.path.spp, 1, 1 << 20)?;
        whole("film.samples", self.film.samples, 1, 4096)?;
        self.film.exposure_ev.map_or(Ok(()), |e| real("film.exposure_ev", e, -40.0, 40.0))
    }
}

fn setting(path: &str, problem: String) -> Error {
    Error::Setting { path: path.to_owned(), problem }
}

/// Overlays `object` on `whole`, refusing keys that `whole` does not have.
fn merge(
    whole: &mut Map<String, Value>,
    object: &Map<String, Value>,
    at: &str,
) -> Result<(), Error> {
    for (key, value) in object {
        let path = if at.is_empty() { key.clone() } else { format!("{at}.{key}") };
        let known = whole.keys().cloned().collect::<Vec<_>>().join(", ");
        let Some(slot) = whole.get_mut(key) else {
            return Err(setting(&path, format!("unknown; known here: {known}")));
        };
        match (slot, value) {
            (Value::Object(inner), Value::Object(value)) => merge(inner, value, &path)?,
            (Value::Object(inner), _) => {
                let known = inner.keys().cloned().collect::<Vec<_>>().join(", ");
                return Err(setting(&path, format!("is a group; set one of its fields: {known}")));
            }
            (slot, value) => *slot = value.clone(),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_valid_and_differ() {
        for name in PRESETS {
            Settings::preset(name).expect(name).validate().expect(name);
        }
        assert_ne!(Settings::preset("draft").ok(), Settings::preset("fine").ok());
        assert!(Settings::preset("quick").is_err());
    }

    #[test]
    fn a_path_sets_one_field() {
        let mut s = Settings::default();
        s.set("grid.alpha", "1.5").expect("known");
        s.set("method", "brute").expect("known");
        s.set("shadow.target", "variance").expect("known");
        assert_eq!((s.grid.alpha, s.method), (1.5, Method::Brute));
        assert_eq!(s.shadow.target, ShadowTarget::Variance);
    }

    #[test]
    fn bad_settings_name_their_path() {
        let cases = [
            ("grid.alpa", "1", "grid.alpa: unknown; known here: alpha"),
            ("grid", "1", "grid: is a group"),
            ("vpls.count", "many", "vpls.count"),
            ("vpls.count", "-1", "vpls.count"),
            ("vpls.count", "1e12", "vpls.count"),
            ("method", "magic", "method"),
        ];
        for (path, text, expected) in cases {
            let error = Settings::default().set(path, text).expect_err(path).to_string();
            assert!(error.contains(expected), "{path}={text}: {error}");
        }
        for (path, text) in [
            ("vpls.count", "0"),
            ("grid.alpha", "0"),
            ("grid.alpha", "-1"),
            ("grid.lobes", "3"),
            ("grid.levels", "99"),
            ("shadow.rays", "100000"),
            ("film.exposure_ev", "1e9"),
        ] {
            let mut s = Settings::default();
            s.set(path, text).expect(path);
            let error = s.validate().expect_err(path).to_string();
            assert!(error.contains(path), "{error}");
        }
    }
}
