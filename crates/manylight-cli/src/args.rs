//! The command line; `--help` is the manual.

use clap::{Args as ClapArgs, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Global illumination from very many lights.
///
/// Exit codes: 0 done, 1 a limit of `compare` was passed or a stage differs, 2 an error.
#[derive(Debug, Parser)]
#[command(name = "manylight", version)]
pub struct Args {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render one picture, or the frames of a sequence
    Render(RenderArgs),
    /// Print the errors between two pictures
    Compare(CompareArgs),
    /// Time the stages of a frame, or measure quality against brute force
    Bench(BenchArgs),
    /// Compare graphics device and processor, stage by stage from the same inputs
    ///
    /// Without --size the picture has 96x54 pixels. Any device will do, emulated ones too.
    DiffStages(DiffStagesArgs),
    /// Print what is in a scene
    Info(InfoArgs),
    /// Print the devices that can render
    Devices(JsonArg),
    /// Print the methods and presets
    Methods(JsonArg),
}

/// Where to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Backend {
    /// The fastest graphics device; the processor where there is none, or only emulated ones and
    /// gpu.device names none.
    Auto,
    /// The processor, on all cores or --threads.
    Cpu,
    /// The fastest graphics device, or the one that gpu.device names, or an error; emulated ones
    /// (software drivers) only where they are named.
    Gpu,
}

/// Options that several commands share.
#[derive(Debug, Default, ClapArgs)]
pub struct SettingArgs {
    /// Start from a preset: draft, fast, balanced, fine, exhaustive or paper
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
    /// Set one field, e.g. --set grid.alpha=1.5; may be repeated
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub sets: Vec<String>,
    /// Look through this camera of the scene: its name, or its number from 0, as `info` lists them
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Picture size, e.g. 1280x720
    #[arg(long, value_name = "WxH", allow_hyphen_values = true)]
    pub size: Option<String>,
    /// Seed of the random numbers
    #[arg(long, value_name = "N")]
    pub seed: Option<u32>,
    /// Threads; default: all cores
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
}

/// `manylight render`
#[derive(Debug, ClapArgs)]
pub struct RenderArgs {
    /// A shot (.json), a scene (.glb, .gltf) or builtin:atrium, builtin:cornell, …
    pub scene: String,
    /// .exr: linear with layers; .png: tone-mapped; .pfm: linear; may be repeated
    #[arg(short, long, value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// grid, brute, path or direct
    #[arg(long, value_name = "NAME")]
    pub method: Option<String>,
    /// Where to compute
    #[arg(long, value_enum, default_value = "auto")]
    pub backend: Backend,
    /// Also write the lights evaluated per pixel as a false-color picture, black for none, pale
    /// yellow for the most of any pixel
    #[arg(long, value_name = "FILE.png")]
    pub heatmap: Option<PathBuf>,
    /// Render frames A to B of a sequence, both included. The number of a frame stands for #### in
    /// the name of a file, else before its ending. Whole files that are there already are kept,
    /// and their frames skipped
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    pub frames: Option<String>,
    /// Render frames again whose files are there already
    #[arg(long, requires = "frames")]
    pub overwrite: bool,
    /// Where filter.temporal adds frames up: how many are rendered and not written before the first
    /// one and before each that follows skipped ones; default: filter.history. On one device frames
    /// that are warmed up from frame 0 have the same bits in any run: --warm-up 1000000
    #[arg(long, value_name = "N", requires = "frames",
        value_parser = clap::value_parser!(u32).range(0..=1_000_000))]
    pub warm_up: Option<u32>,
    /// Settings
    #[command(flatten)]
    pub settings: SettingArgs,
    /// Print results as JSON on standard output, a line for each picture
    #[arg(long)]
    pub json: bool,
    /// Print nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// `manylight compare`
#[derive(Debug, ClapArgs)]
pub struct CompareArgs {
    /// The picture to judge (.exr, .pfm, .hdr, .png)
    pub a: PathBuf,
    /// The reference
    pub b: PathBuf,
    /// The layer to compare; beauty: the picture itself
    #[arg(long, value_name = "NAME", default_value = "beauty")]
    pub layer: String,
    /// Write the FLIP difference as a false-color picture
    #[arg(short, long, value_name = "FILE.png")]
    pub output: Option<PathBuf>,
    /// Fail (exit 1) above this mean FLIP
    #[arg(long, value_name = "X")]
    pub max_flip: Option<f64>,
    /// Fail (exit 1) above this relMSE
    #[arg(long, value_name = "X")]
    pub max_rel_mse: Option<f64>,
    /// Fail (exit 1) above this RMSE relative to the mean
    #[arg(long, value_name = "X")]
    pub max_rmse: Option<f64>,
    /// Fail (exit 1) above this mean absolute percentage error, as a fraction
    #[arg(long, value_name = "X")]
    pub max_mape: Option<f64>,
    /// Fail (exit 1) above this absolute energy bias, as a fraction
    #[arg(long, value_name = "X")]
    pub max_bias: Option<f64>,
    /// Print results as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// `manylight bench`
#[derive(Debug, ClapArgs)]
pub struct BenchArgs {
    /// Shots or scenes; default: builtin:atrium
    pub scenes: Vec<String>,
    /// Judge the gather against brute force on this many random receivers instead of timing
    #[arg(long, value_name = "RECEIVERS", conflicts_with_all = ["rays", "build"])]
    pub quality: Option<usize>,
    /// Measure shadow rays per second over random receivers and virtual lights; on a graphics
    /// device also through a binary hierarchy
    #[arg(long, conflicts_with = "build")]
    pub rays: bool,
    /// Write the triangles and rays of --rays to FILE.tri and FILE.ray (little-endian f32)
    #[arg(long, value_name = "FILE", requires = "rays")]
    pub dump_rays: Option<PathBuf>,
    /// Measure building the grid alone
    #[arg(long)]
    pub build: bool,
    /// Where frames are computed and rays are traced
    #[arg(long, value_enum, default_value = "cpu")]
    pub backend: Backend,
    /// Keep virtual lights and grids from frame to frame, on a graphics device
    #[arg(long = "static", conflicts_with_all = ["quality", "rays", "build"])]
    pub is_static: bool,
    /// Frames to time, after one that is not counted; default: 100 on a graphics device, 5 on the
    /// processor and on devices that it emulates
    #[arg(long, value_name = "N")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub frames: Option<u32>,
    /// Settings
    #[command(flatten)]
    pub settings: SettingArgs,
    /// Print results as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

impl BenchArgs {
    /// Whether whole frames are timed.
    pub fn is_of_frames(&self) -> bool {
        self.quality.is_none() && !self.rays && self.dump_rays.is_none() && !self.build
    }
}

/// `manylight diff-stages`
#[derive(Debug, ClapArgs)]
pub struct DiffStagesArgs {
    /// A shot, a scene or builtin:NAME
    pub scene: String,
    /// Settings
    #[command(flatten)]
    pub settings: SettingArgs,
    /// Print results as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// `manylight info`
#[derive(Debug, ClapArgs)]
pub struct InfoArgs {
    /// A shot, a scene or builtin:NAME
    pub scene: String,
    /// Look through this camera of the scene: its name, or its number from 0
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Print results as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// Commands without other options.
#[derive(Debug, ClapArgs)]
pub struct JsonArg {
    /// Print results as JSON on standard output
    #[arg(long)]
    pub json: bool,
}
