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
        /// Interleaved sampling `[KellerHeidrich01]` of the grid method: 1 off; 2 or 4: of every
        /// 2 × 2 or 4 × 4 pixels each sums up another part of the lights, and a filter along
        /// surfaces puts them together. Faster, and smoother than the light is.
        interleave: u32 = 1,
        /// The reference path tracer.
        path: PathSettings = PathSettings::default(),
        /// Surfaces.
        surface: SurfaceSettings = SurfaceSettings::default(),
        /// The picture.
        film: FilmSettings = FilmSettings::default(),
        /// The graphics device.
        gpu: GpuSettings = GpuSettings::default(),
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
        /// r_l = alpha · h_l: how far a level reaches, 0.25 to 16; null: chosen from 0.5 to 4 for
        /// `evals`.
        alpha: Option<f32> = None,
        /// Lights that a pixel evaluates on average, about, in each gather (bounced light; light
        /// of emissive surfaces), unless alpha is set; 16 to 65,536. More: truer, and the time of
        /// the lighting in proportion.
        evals: u32 = 480,
        /// Number of levels, 2 to 14; null: chosen from the number and the spread of the lights.
        levels: Option<u32> = None,
        /// 0 evaluates the virtual lights themselves near the receiver, 1 starts at the grid (the
        /// paper).
        start_level: u32 = 0,
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
        /// Rays per pixel and gather, 0 to 256, half of it and at least one for the sky; 0:
        /// virtual lights cast no shadows. Sun, point and spot lights always take a ray each, up
        /// to four.
        rays: u32 = 4,
        /// What a ray aims at.
        target: ShadowTarget = ShadowTarget::Vpl,
        /// Lowest grid level whose lights are drawn for shadows; 0 is for virtual lights
        /// themselves. The top level is always drawn.
        start_level: u32 = 0,
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
        /// Passes; the first reaches one pixel, each one after it twice as far. 1 to 8.
        passes: u32 = 5,
        /// Whether frames of a sequence add the ratios of those before them; a frame then depends
        /// on which were rendered before it, and shadow rays differ from frame to frame.
        temporal: bool = false,
        /// Frames that count for a ratio where they are added, 1 to 256.
        /// More: less noise, and shadows of moving lights that lag further behind.
        history: u32 = 16,
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

group! {
    /// The graphics device, where one renders.
    GpuSettings {
        /// Part of its name, in any case, or its number among all, as in `#2`; null: the fastest
        /// that is not emulated on the processor.
        device: Option<String> = None,
        /// Whether to take only what every device has: smallest limits, no optional feature. For
        /// finding out whether one of them makes a difference.
        base: bool = false,
        /// A folder with shaders, laid out as `crates/manylight/src`, that may change while the
        /// program runs; null: its own. Only in builds with debug assertions.
        shaders: Option<String> = None,
        /// Seconds after which work that is not done counts as lost, 0.001 to 86,400; null: 600,
        /// and without end on a device that is emulated on the processor.
        timeout: Option<f32> = None,
        /// Whether to use operations across invocations that run in step, where the device has
        /// them.
        subgroups: bool = true,
        /// Whether to use numbers of 16 bits, where the device has them.
        half: bool = true,
        /// Whether the device's own clock times stages, where it has one.
        timestamps: bool = true,
        /// Whether lists and textures may be as large as the device allows, beyond what every one
        /// does.
        large_limits: bool = true,
        /// Whether the hardware follows rays, where it can.
        ray_queries: bool = true,
        /// Whether to bind each texture by itself, where the device can and has room for as many,
        /// in place of pages of one array. Texels are the same.
        bindless: bool = false,
    }
}

/// Fewest levels of a lighting grid: one cell of level 1 in eight.
pub const MIN_LEVELS: u32 = 2;
/// Most levels of a lighting grid.
pub const MAX_LEVELS: u32 = 14;

/// Names of the presets, from quick to thorough, and the paper's own.
pub const PRESETS: [&str; 6] = ["draft", "fast", "balanced", "fine", "exhaustive", "paper"];

impl Settings {
    /// Whether frames of a sequence add up their shadow ratios: asked for, and with ratios that are
    /// smoothed.
    pub fn adds_up(&self) -> bool {
        let has_ratios = matches!(self.method, Method::Grid | Method::Direct);
        self.filter.temporal && self.filter.enabled && has_ratios
    }

    /// A preset by name.
    ///
    /// Errors: names the presets there are.
    pub fn preset(name: &str) -> Result<Self, Error> {
        let mut s = Self::default();
        match name {
            "draft" => (s.vpls.count, s.grid.evals, s.shadow.rays) = (20_000, 200, 2),
            "fast" => (s.vpls.count, s.grid.evals) = (50_000, 300),
            "balanced" => {}
            "fine" => (s.vpls.count, s.grid.evals, s.shadow.rays) = (300_000, 800, 8),
            "exhaustive" => {
                (s.vpls.count, s.grid.evals, s.shadow.rays) = (1_000_000, 1500, 32);
                (s.vpls.bounces, s.film.samples) = (8, 4);
            }
            "paper" => {
                s.grid.alpha = Some(1.0);
                (s.grid.lobes, s.grid.spread, s.grid.start_level) = (1, false, 1);
                (s.shadow.start_level, s.shadow.stratified) = (2, false);
                (s.shadow.target, s.shadow.estimate) =
                    (ShadowTarget::Variance, ShadowEstimate::Mean);
            }
            _ => {
                return Err(setting(
                    "preset",
                    format!("no preset {name:?}; use one of {}", PRESETS.join(", ")),
                ));
            }
        }
        Ok(s)
    }

    /// Overlays a JSON object, as found in a shot file.
    ///
    /// Errors: names the unknown key or the value of the wrong type.
    pub fn apply(&mut self, object: &Map<String, Value>) -> Result<(), Error> {
        let mut whole = Value::Object(self.to_json());
        let mut leaves = Vec::new();
        find_leaves(&self.to_json(), object, "", &mut leaves)?;
        let mut applied = self.clone();
        // One by one, so that an error knows its path.
        for (path, value) in leaves {
            if let Some(slot) = whole.pointer_mut(&format!("/{}", path.replace('.', "/"))) {
                *slot = value.clone();
            }
            let is_single = value.as_f64().is_none_or(|x| (x as f32).is_finite());
            applied = match serde_json::from_value(whole.clone()) {
                Ok(settings) if is_single => settings,
                Ok(_) => return Err(self.wrong_value(&path, value, "f32")),
                Err(e) => return Err(self.wrong_value(&path, value, &e.to_string())),
            };
        }
        *self = applied;
        Ok(())
    }

    /// Says what is allowed where `value` is not; `reason` names the type or the choices.
    fn wrong_value(&self, path: &str, value: &Value, reason: &str) -> Error {
        let range = self.ranges().into_iter().find(|r| r.0 == path);
        let choices = reason.starts_with("unknown variant").then(|| reason.split_once("expected "));
        let allowed = match (range, choices.flatten()) {
            (Some((_, _, low, high)), _) if reason.ends_with("u32") => {
                format!("a whole number from {low} to {high}")
            }
            (Some((_, _, low, high)), _) => format!("a number from {low} to {high}"),
            (None, Some((_, choices))) => choices.to_owned(),
            (None, None) if reason.ends_with("a boolean") => "true or false".to_owned(),
            (None, None) => "a name".to_owned(),
        };
        let found: String = value.to_string().chars().take(40).collect();
        setting(path, format!("{found} found; allowed: {allowed}"))
    }

    /// Sets one field by path, e.g. `set("grid.alpha", "1.5")`.
    ///
    /// Errors: names the path and what was wrong.
    pub fn set(&mut self, path: &str, text: &str) -> Result<(), Error> {
        let value =
            serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.trim().to_owned()));
        // Paths have two parts; the rest of a longer one is an unknown key, not a deeper nest.
        let keys: Vec<&str> = path.splitn(3, '.').collect();
        let nest = |inner, key: &&str| Value::Object(Map::from_iter([((*key).to_owned(), inner)]));
        match keys.iter().rev().fold(value, nest) {
            Value::Object(object) => self.apply(&object),
            _ => Ok(()),
        }
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
        for (path, value, low, high) in self.ranges() {
            // Not the other way round: NaN is in no range.
            if !(low..=high).contains(&value) {
                return Err(setting(path, format!("{value} is outside {low} to {high}")));
            }
        }
        if self.grid.lobes != 1 && self.grid.lobes != 6 {
            return Err(setting("grid.lobes", format!("{} is neither 1 nor 6", self.grid.lobes)));
        }
        if self.filter.temporal && self.film.samples > 1 {
            let problem = format!(
                "true goes with one sample per pixel, and film.samples is {}; leave one of them",
                self.film.samples
            );
            return Err(setting("filter.temporal", problem));
        }
        if ![1, 2, 4].contains(&self.interleave) {
            let problem = format!("{} is neither 1, 2 nor 4", self.interleave);
            return Err(setting("interleave", problem));
        }
        Ok(())
    }

    /// Path, value, least and most of every number; what is left to the program is in its range.
    fn ranges(&self) -> [(&'static str, f64, f64, f64); 19] {
        let Self { vpls, grid, shadow, film, .. } = self;
        let levels = grid.levels.unwrap_or(MIN_LEVELS);
        [
            ("seed", self.seed.into(), 0.0, u32::MAX.into()),
            ("vpls.count", vpls.count.into(), 1.0, 16e6),
            ("vpls.emitter_count", vpls.emitter_count.into(), 1.0, 16e6),
            ("vpls.bounces", vpls.bounces.into(), 1.0, 64.0),
            ("vpls.d_min", vpls.d_min.unwrap_or(0.0).into(), 0.0, 1e6),
            ("grid.alpha", grid.alpha.unwrap_or(1.0).into(), 0.25, 16.0),
            ("grid.evals", grid.evals.into(), 16.0, 65_536.0),
            ("grid.levels", levels.into(), MIN_LEVELS.into(), MAX_LEVELS.into()),
            ("grid.start_level", grid.start_level.into(), 0.0, 1.0),
            ("grid.lobes", grid.lobes.into(), 1.0, 6.0),
            ("shadow.rays", shadow.rays.into(), 0.0, 256.0),
            ("shadow.start_level", shadow.start_level.into(), 0.0, MAX_LEVELS.into()),
            ("filter.passes", self.filter.passes.into(), 1.0, 8.0),
            ("filter.history", self.filter.history.into(), 1.0, 256.0),
            ("interleave", self.interleave.into(), 1.0, 4.0),
            ("path.spp", self.path.spp.into(), 1.0, 1_048_576.0),
            ("film.samples", film.samples.into(), 1.0, 4096.0),
            ("gpu.timeout", self.gpu.timeout.unwrap_or(1.0).into(), 0.001, 86_400.0),
            ("film.exposure_ev", film.exposure_ev.unwrap_or(0.0).into(), -40.0, 40.0),
        ]
    }
}

/// Longest path or key kept in a message, characters; files set no limit.
const MAX_PATH_CHARS: usize = 80;

fn setting(path: &str, problem: String) -> Error {
    let path = path.chars().take(MAX_PATH_CHARS).flat_map(char::escape_debug).collect();
    Error::Setting { path, problem }
}

/// Collects the fields that `object` sets with their paths, refusing keys that `known` lacks.
fn find_leaves<'a>(
    known: &Map<String, Value>,
    object: &'a Map<String, Value>,
    at: &str,
    leaves: &mut Vec<(String, &'a Value)>,
) -> Result<(), Error> {
    for (key, value) in object {
        let path = if at.is_empty() { key.clone() } else { format!("{at}.{key}") };
        let list = |map: &Map<String, Value>| map.keys().cloned().collect::<Vec<_>>().join(", ");
        match (known.get(key), value) {
            (None, _) => {
                return Err(setting(&path, format!("unknown; known here: {}", list(known))));
            }
            (Some(Value::Object(inner)), Value::Object(value)) => {
                find_leaves(inner, value, &path, leaves)?;
            }
            (Some(Value::Object(inner)), _) => {
                let problem = format!("is a group; set one of its fields: {}", list(inner));
                return Err(setting(&path, problem));
            }
            (Some(_), value) => leaves.push((path, value)),
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
        assert_eq!((s.grid.alpha, s.method), (Some(1.5), Method::Brute));
        assert_eq!(s.shadow.target, ShadowTarget::Variance);
    }

    #[test]
    fn bad_settings_name_their_path() {
        let cases = [
            ("grid.alpa", "1", "grid.alpa: unknown; known here: alpha"),
            ("grid.al\npha", "1", "grid.al\\npha: unknown"),
            ("grid.alpha.x.y.z", "1", "grid.alpha: {"),
            ("", "1", "unknown; known here: method"),
            ("grid", "1", "grid: is a group"),
            ("vpls.count", "many", "vpls.count: \"many\" found; allowed: a whole number from 1 to"),
            ("vpls.count", "", "a whole number from 1 to 16000000"),
            ("vpls.count", "-1", "vpls.count: -1 found"),
            ("vpls.count", "1.5", "a whole number"),
            ("vpls.count", "1e12", "a whole number"),
            ("vpls.count", "null", "null found"),
            ("vpls.d_min", "1e300", "a number from 0 to 1000000"),
            ("grid.alpha", "NaN", "\"NaN\" found; allowed: a number from 0.25 to 16"),
            ("grid.alpha", "1e300", "a number from 0.25 to 16"),
            ("grid.alpha", "[1]", "a number from 0.25 to 16"),
            ("seed", "-1", "a whole number from 0 to 4294967295"),
            ("filter.enabled", "1", "allowed: true or false"),
            ("shadow.target", "foo", "shadow.target: \"foo\" found; allowed: `vpl` or `variance`"),
            ("method", "magic", "method: \"magic\" found; allowed: one of `grid`, `brute`"),
            ("shadow.target", "3", "shadow.target"),
        ];
        for (path, text, expected) in cases {
            let mut s = Settings::default();
            let error = s.set(path, text).expect_err(path).to_string();
            assert!(error.contains(expected), "{path}={text}: {error}");
            assert_eq!(s, Settings::default(), "{path}={text} changed something");
        }
        let object = serde_json::json!({"vpls": {"bounces": 2, "count": -1}});
        let error = Settings::default().apply(object.as_object().expect("an object"));
        assert!(error.expect_err("-1").to_string().contains("vpls.count: -1"));
        for (path, text) in [
            ("vpls.count", "0"),
            ("grid.alpha", "0"),
            ("grid.alpha", "-1"),
            ("grid.lobes", "3"),
            ("grid.levels", "99"),
            ("shadow.rays", "100000"),
            ("interleave", "0"),
            ("interleave", "3"),
            ("interleave", "8"),
            ("film.exposure_ev", "1e9"),
            ("filter.history", "0"),
            ("gpu.timeout", "0"),
            ("gpu.timeout", "-1"),
            ("gpu.timeout", "1e9"),
        ] {
            let mut s = Settings::default();
            s.set(path, text).expect(path);
            let error = s.validate().expect_err(path).to_string();
            assert!(error.contains(path), "{error}");
        }
        let mut s = Settings::default();
        (s.filter.temporal, s.film.samples) = (true, 2);
        let error = s.validate().expect_err("two samples").to_string();
        assert!(
            error.contains("filter.temporal") && error.contains("film.samples is 2"),
            "{error}"
        );
    }
}
