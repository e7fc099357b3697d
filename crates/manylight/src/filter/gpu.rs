//! The filter on the graphics device, two signals at a time.
//!
//! In: [`GpuReceivers`], lists of share and trust · Out: lists of share and variance

use super::{LEAST_TRUST, LEAST_VARIANCE, PLANE_SLACK, ROUNDING, sweep};
use crate::error::Error;
use crate::gpu::{
    Buf, Constant, Feature, GROUP, Gpu, KernelInfo, MAX_GROUPS, Memory, Recorder, Value,
};
use crate::gpu::{kernel, record};
use crate::settings::FilterSettings;
use crate::surface::ViewFrame;
use crate::surface::gpu::{GpuReceivers, NO_SURFACE};

/// Pixels that one workgroup works on, across and down.
pub(super) const TILE: [u32; 2] = [16, 8];

/// Constants of `taps.wgsl`.
pub(super) const TAP_CONSTANTS: &[Constant] = &[
    Constant { name: "KERNEL_SIDE", value: Value::F32(sweep::KERNEL[0]) },
    Constant { name: "KERNEL_CENTER", value: Value::F32(sweep::KERNEL[1]) },
    Constant { name: "ALBEDO_SCALE", value: Value::F32(sweep::ALBEDO_SCALE) },
];
/// Constants of `noisy.wgsl`.
pub(super) const NOISY_CONSTANTS: &[Constant] = &[
    Constant { name: "LEAST_TRUST", value: Value::F32(LEAST_TRUST) },
    Constant { name: "LEAST_VARIANCE", value: Value::F32(LEAST_VARIANCE) },
];
const CHANGE_CONSTANTS: &[Constant] = &[
    Constant { name: "RATIO_SLACK", value: Value::F32(sweep::RATIO_SLACK) },
    Constant { name: "LEAST_NOISE", value: Value::F32(sweep::LEAST_NOISE) },
];
const GUIDE_CONSTANTS: &[Constant] = &[
    Constant { name: "PLANE_SLACK", value: Value::F32(PLANE_SLACK) },
    Constant { name: "ROUNDING", value: Value::F32(ROUNDING) },
    Constant { name: "NO_SURFACE", value: Value::F32(NO_SURFACE) },
];
const LIST_CONSTANTS: &[Constant] =
    &[Constant { name: "MAX_GROUPS", value: Value::U32(MAX_GROUPS) }];

record! {
    /// The view as the guides need it.
    pub struct GuideParams {
        /// Eye point.
        pub origin: [f32; 3],
        /// Side of a pixel is `at_eye` + `per_depth` · depth, metres.
        pub at_eye: f32,
        /// Pixels across and down.
        pub size: [u32; 2],
        /// See `at_eye`.
        pub per_depth: f32,
        /// Nothing.
        pub _pad: u32,
    }
}

record! {
    /// What the passes over noisy shares need.
    pub struct NoisyParams {
        /// Pixels across and down.
        pub size: [u32; 2],
        /// Rays behind a share of either signal, in one frame.
        pub rays: [f32; 2],
    }
}

record! {
    /// What the other passes need.
    pub struct PassParams {
        /// Pixels across and down.
        pub size: [u32; 2],
        /// Receivers from one tap to the next.
        pub step: u32,
        /// Nothing.
        pub _pad: u32,
    }
}

record! {
    /// What splitting a pair needs.
    pub struct SplitParams {
        /// Pixels.
        pub pixels: u32,
        /// Whether there is a second signal.
        pub is_pair: u32,
    }
}

kernel! {
    /// What tells receivers apart.
    struct MakeGuides = "filter/guides", [TILE[0], TILE[1], 1], [GUIDE_CONSTANTS];
    uniform params: GuideParams, read positions: [f32; 4], read normals: [f32; 4],
    read albedos: [f32; 4], write guide_positions: [f32; 4], write guide_normals: [f32; 4]
}

kernel! {
    /// The first guess of means and variances.
    struct Guess = "filter/guess", [TILE[0], TILE[1], 1], [TAP_CONSTANTS, NOISY_CONSTANTS];
    uniform params: NoisyParams, read guide_positions: [f32; 4], read guide_normals: [f32; 4],
    read first: [f32; 2], read second: [f32; 2], read first_frames: f32, read second_frames: f32,
    write guess: [f32; 4]
}

kernel! {
    /// The first pass.
    struct FirstPass = "filter/first", [TILE[0], TILE[1], 1],
        [TAP_CONSTANTS, NOISY_CONSTANTS, CHANGE_CONSTANTS];
    uniform params: NoisyParams, read guide_positions: [f32; 4], read guide_normals: [f32; 4],
    read first: [f32; 2], read second: [f32; 2], read first_frames: f32, read second_frames: f32,
    read guess: [f32; 4], write filtered: [f32; 4]
}

kernel! {
    /// Each pass after the first.
    struct NextPass = "filter/pass", [TILE[0], TILE[1], 1], [TAP_CONSTANTS, CHANGE_CONSTANTS];
    uniform params: PassParams, read guide_positions: [f32; 4], read guide_normals: [f32; 4],
    read signals: [f32; 4], write filtered: [f32; 4]
}

kernel! {
    /// Two signals, each into a list of its own.
    struct Split = "filter/split", [GROUP, 1, 1], [LIST_CONSTANTS];
    uniform params: SplitParams, read signals: [f32; 4], write first: [f32; 2],
    write second: [f32; 2]
}

/// Every kernel of this file.
pub const KERNELS: &[&KernelInfo] =
    &[&MakeGuides::INFO, &Guess::INFO, &FirstPass::INFO, &NextPass::INFO, &Split::INFO];

/// What tells receivers apart, on the device.
#[derive(Debug)]
pub struct Guides {
    pub(super) size: [u32; 2],
    /// Position from the eye, 1 / plane slack.
    pub(super) positions: Buf<[f32; 4]>,
    /// Unit geometric normal, luminance of the albedo; see [`kept`].
    pub(super) normals: Buf<[f32; 4]>,
}

impl Guides {
    /// Room for the guides of a picture.
    ///
    /// Errors: more pixels than the device can hold in one list
    pub fn new(memory: &impl Memory, width: usize, height: usize) -> Result<Self, Error> {
        Ok(Self {
            size: [width as u32, height as u32],
            positions: memory.list("guide positions", width * height)?,
            normals: kept(memory, "guide normals", width * height)?,
        })
    }

    /// Finds the guides of receivers of the same size.
    pub fn record(&self, rec: &mut Recorder<'_>, receivers: &GpuReceivers, view: &ViewFrame) {
        debug_assert_eq!(self.size.map(|n| n as usize), [receivers.width, receivers.height]);
        let [at_eye, per_depth] = view.pixel_size_terms();
        let params = rec.uniform(&GuideParams {
            origin: view.eye().to_array(),
            at_eye,
            size: self.size,
            per_depth,
            ..GuideParams::default()
        });
        let kernel = MakeGuides {
            params,
            positions: &receivers.positions,
            normals: &receivers.normals,
            albedos: &receivers.albedos,
            guide_positions: &self.positions,
            guide_normals: &self.normals,
        };
        rec.dispatch_pixels(&kernel, self.width(), self.height());
    }

    /// Pixels across.
    pub(super) fn width(&self) -> usize {
        self.size[0] as usize
    }

    /// Pixels down.
    pub(super) fn height(&self) -> usize {
        self.size[1] as usize
    }
}

/// [`Noisy`](super::Noisy) on the device.
#[derive(Clone, Copy, Debug)]
pub struct GpuNoisy<'a> {
    /// Share, 0…1, and trust, one pair per receiver.
    pub shares: &'a Buf<[f32; 2]>,
    /// Frames behind each of them; `None` if one.
    pub frames: Option<&'a Buf<f32>>,
    /// Rays behind each of them in every frame.
    pub rays: u32,
}

/// A list of four numbers a pixel, in half the bytes where the device has numbers of 16 bits: there
/// `kept_half.wgsl` says what is in it.
fn kept(memory: &impl Memory, name: &'static str, pixels: usize) -> Result<Buf<[f32; 4]>, Error> {
    let is_half = memory.gpu().features().has(Feature::Half);
    memory.list(name, if is_half { pixels.div_ceil(2) } else { pixels })
}

/// Largest rounding of a number of 16 bits, in parts of it.
const HALF_ROUNDING: f32 = 1.0 / 2048.0;

/// By how much a filtered share or its deviation may differ from the processor's.
///
/// In halves the guess and every pass round a share, at most 1, once. Weights are off by eight
/// roundings, as products of four cosines of two normals; that shifts what lies between two shares
/// by a quarter of it at most.
pub fn most_off(gpu: &Gpu, settings: &FilterSettings) -> f32 {
    match gpu.features().has(Feature::Half) {
        true => (settings.passes + 1) as f32 * (1.0 + 8.0 / 4.0) * HALF_ROUNDING,
        false => 1e-4,
    }
}

/// Memory of the filter for pictures of one size; for the lists of four numbers see `kept`.
#[derive(Debug)]
pub struct Filter {
    /// Two signals before and after a pass; the second is that of the guess at first.
    pairs: [Buf<[f32; 4]>; 2],
    /// Frames behind every share where they are not counted.
    one_frame: Buf<f32>,
    /// In the place of a second signal that is not there.
    nothing: Buf<[f32; 2]>,
    filtered: Vec<Buf<[f32; 2]>>,
}

impl Filter {
    /// Memory for up to `signals` signals; `out` for what becomes of them.
    ///
    /// Errors: more pixels than the device can hold in one list
    pub fn new(
        memory: &impl Memory,
        out: &impl Memory,
        width: usize,
        height: usize,
        signals: usize,
    ) -> Result<Self, Error> {
        let gpu = memory.gpu();
        let pixels = width * height;
        let pair = || kept(memory, "pairs of shares", pixels);
        let filtered = (0..signals).map(|_| out.list("filtered shares", pixels));
        Ok(Self {
            pairs: [pair()?, pair()?],
            one_frame: gpu.upload("one frame", &[1.0])?,
            nothing: gpu.buffer("no shares", 1)?,
            filtered: filtered.collect::<Result<_, _>>()?,
        })
    }

    /// Smooths shares along surfaces; twin of [`atrous`](super::atrous).
    ///
    /// Shapes: each signal `[h·w]`; out, share and variance of each, `[h·w]`, until the next call
    /// Panics: for more signals than there is memory for
    /// Cost:   9 taps a pass and receiver for every two signals
    pub fn record<'a>(
        &'a self,
        rec: &mut Recorder<'_>,
        guides: &Guides,
        signals: &[GpuNoisy<'_>],
        settings: &FilterSettings,
    ) -> &'a [Buf<[f32; 2]>] {
        let filtered = &self.filtered[..signals.len()];
        for (signals, filtered) in signals.chunks(2).zip(filtered.chunks(2)) {
            let mut current = 0;
            self.record_first(rec, guides, signals);
            for i in 1..settings.passes {
                let params = PassParams { size: guides.size, step: 1 << i, ..Default::default() };
                let kernel = NextPass {
                    params: rec.uniform(&params),
                    guide_positions: &guides.positions,
                    guide_normals: &guides.normals,
                    signals: &self.pairs[current],
                    filtered: &self.pairs[1 - current],
                };
                rec.dispatch_pixels(&kernel, guides.width(), guides.height());
                current = 1 - current;
            }
            let pixels = filtered[0].len();
            let is_pair = u32::from(filtered.len() == 2);
            let split = Split {
                params: rec.uniform(&SplitParams { pixels: pixels as u32, is_pair }),
                signals: &self.pairs[current],
                first: &filtered[0],
                second: filtered.get(1).unwrap_or(&self.nothing),
            };
            rec.dispatch_items(&split, pixels);
        }
        filtered
    }

    /// The guess and the first pass of one or two signals; twin of `first_pass`.
    fn record_first(&self, rec: &mut Recorder<'_>, guides: &Guides, signals: &[GpuNoisy<'_>]) {
        // A lone signal is its own companion.
        let pair = [signals[0], signals[signals.len() - 1]];
        let rays = pair.map(|signal| signal.rays.max(1) as f32);
        let [first_frames, second_frames] =
            pair.map(|signal| signal.frames.unwrap_or(&self.one_frame));
        let params = rec.uniform(&NoisyParams { size: guides.size, rays });
        let (guide_positions, guide_normals) = (&guides.positions, &guides.normals);
        let [first, second] = pair.map(|signal| signal.shares);
        let [filtered, guess] = &self.pairs;
        let first_guess = Guess {
            params,
            guide_positions,
            guide_normals,
            first,
            second,
            first_frames,
            second_frames,
            guess,
        };
        rec.dispatch_pixels(&first_guess, guides.width(), guides.height());
        let first_pass = FirstPass {
            params,
            guide_positions,
            guide_normals,
            first,
            second,
            first_frames,
            second_frames,
            guess,
            filtered,
        };
        rec.dispatch_pixels(&first_pass, guides.width(), guides.height());
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::shares;
    use super::*;
    use crate::filter::{Noisy, atrous};
    use crate::frame::Renderer;
    use crate::gpu::testing::{check_kernel, device, device_with};
    use crate::math::{hash_u32, unit_f32};
    use crate::surface::Receivers;
    use glam::{Vec2, Vec3};

    const CENTER: Vec2 = Vec2::splat(0.5);

    /// Receivers of a scene as they are on the device, and their view.
    fn scene(gpu: &Gpu, name: &str, [w, h]: [usize; 2]) -> (GpuReceivers, Receivers, ViewFrame) {
        let shot = manylight_scene::builtin(name).expect(name);
        let renderer = Renderer::new(shot.scene).expect(name);
        let view = ViewFrame::new(&shot.camera, w, h);
        let traced = Receivers::trace(&renderer.world, &view, CENTER, true);
        let on_device = GpuReceivers::upload(gpu, &traced, |_| Vec3::ZERO).expect("upload");
        let receivers = on_device.download(gpu, &view, CENTER).expect("download");
        (on_device, receivers, view)
    }

    /// Shares of a shadow with an edge, by a few rays, with some trust, over some frames.
    struct Signal {
        ratio: Vec<f32>,
        trust: Vec<f32>,
        frames: Vec<f32>,
        rays: u32,
    }

    fn signal(receivers: &Receivers, salt: u32, rays: u32) -> Signal {
        let count = receivers.samples.len();
        let (dark, light) = (shares(count, rays, 0.1), shares(count, rays, 0.8));
        let is_dark = |i: usize| (i % receivers.width + salt as usize) % 32 < 16;
        let ratio = (0..count).map(|i| if is_dark(i) { dark[i] } else { light[i] }).collect();
        let random = |i: u32, key: u32| unit_f32(hash_u32(i ^ hash_u32(salt ^ key)));
        let trust = (0..count as u32).map(|i| random(i, 1)).collect();
        let frames = (0..count as u32).map(|i| 1.0 + (random(i, 2) * 8.0).floor()).collect();
        Signal { ratio, trust, frames, rays }
    }

    fn run(
        gpu: &Gpu,
        receivers: &GpuReceivers,
        view: &ViewFrame,
        signals: &[Signal],
        settings: &FilterSettings,
    ) -> Vec<Vec<[f32; 2]>> {
        let (width, height) = (receivers.width, receivers.height);
        let guides = Guides::new(gpu, width, height).expect("guides");
        let filter = Filter::new(gpu, gpu, width, height, signals.len()).expect("filter");
        let lists: Vec<_> = signals
            .iter()
            .map(|s| {
                let pairs: Vec<_> = s.ratio.iter().zip(&s.trust).map(|(&r, &t)| [r, t]).collect();
                let frames = (!s.frames.is_empty()).then(|| gpu.upload("frames", &s.frames));
                let frames = frames.map(|frames| frames.expect("frames"));
                (gpu.upload("shares", &pairs).expect("shares"), frames)
            })
            .collect();
        let noisy: Vec<_> = lists
            .iter()
            .zip(signals)
            .map(|((shares, frames), s)| GpuNoisy { shares, frames: frames.as_ref(), rays: s.rays })
            .collect();
        let mut rec = gpu.record(None);
        guides.record(&mut rec, receivers, view);
        let filtered = filter.record(&mut rec, &guides, &noisy, settings);
        rec.submit().wait().expect("done");
        filtered.iter().map(|list| gpu.read(list, width * height).expect("read")).collect()
    }

    #[test]
    fn kernels_match_their_shaders() {
        KERNELS.iter().for_each(|kernel| check_kernel(kernel));
    }

    #[test]
    fn the_device_filters_as_the_processor_does() {
        let Some(gpu) = device() else { return };
        for (name, size, passes) in
            [("cornell", [61, 45], 5), ("atrium", [64, 40], 3), ("cornell", [24, 31], 1)]
        {
            let (on_device, receivers, view) = scene(gpu, name, size);
            let mut signals = [4, 2, 1].map(|rays| signal(&receivers, rays, rays));
            signals[1].frames.clear();
            let settings = FilterSettings { passes, ..FilterSettings::default() };
            let noisy: Vec<_> = signals
                .iter()
                .map(|Signal { ratio, trust, frames, rays }| Noisy {
                    ratio,
                    trust,
                    frames,
                    rays: *rays,
                })
                .collect();
            for count in 1..=3 {
                let expected = atrous(&noisy[..count], &receivers, &view, &settings);
                let found = run(gpu, &on_device, &view, &signals[..count], &settings);
                assert_eq!(found.len(), count);
                for (expected, found) in expected.iter().zip(&found) {
                    let off = expected.iter().zip(found).map(|(a, b)| (a - b[0]).abs());
                    let worst = off.fold(0.0, f32::max);
                    assert!(worst < 1e-4, "{name}, {count} signals: {worst}");
                    assert!(found.iter().all(|b| b[1] >= 0.0 && b[1] <= 0.25));
                }
            }
        }
    }

    #[test]
    fn the_device_repeats_itself() {
        let Some(gpu) = device() else { return };
        let (on_device, receivers, view) = scene(gpu, "cornell", [48, 48]);
        let signals = [signal(&receivers, 3, 4), signal(&receivers, 9, 2)];
        let settings = FilterSettings::default();
        let once = run(gpu, &on_device, &view, &signals, &settings);
        assert_eq!(once, run(gpu, &on_device, &view, &signals, &settings));
    }

    #[test]
    fn halves_filter_as_whole_numbers_do() {
        let Some(base) = device() else { return };
        let Some(gpu) = device_with(Feature::Half) else { return };
        for (name, size, passes) in
            [("cornell", [61, 45], 5), ("atrium", [64, 40], 8), ("cornell", [24, 31], 1)]
        {
            let settings = FilterSettings { passes, ..FilterSettings::default() };
            let found = [base, &gpu].map(|gpu| {
                let (on_device, receivers, view) = scene(gpu, name, size);
                let signals = [4, 2, 1].map(|rays| signal(&receivers, rays, rays));
                let once = run(gpu, &on_device, &view, &signals, &settings);
                assert!(once == run(gpu, &on_device, &view, &signals, &settings), "{name}");
                once.concat()
            });
            let off = |kept: fn(&[f32; 2]) -> f32| {
                let pairs = found[0].iter().zip(&found[1]);
                pairs.map(|(a, b)| (kept(a) - kept(b)).abs()).fold(0.0, f32::max)
            };
            let worst = [off(|pair| pair[0]), off(|pair| pair[1].sqrt())];
            println!("{name}, {passes} passes: {worst:?} of share and deviation");
            let most = most_off(&gpu, &settings);
            assert!(worst.iter().all(|off| *off <= most), "{name}: {worst:?} above {most}");
            assert!(worst[0] > 0.0, "{name}: nothing is kept in halves");
        }
    }

    #[test]
    fn extremes_stay_finite_in_halves() {
        let Some(gpu) = device_with(Feature::Half) else { return };
        let (on_device, receivers, view) = scene(&gpu, "cornell", [24, 16]);
        let settings = FilterSettings { passes: 8, ..FilterSettings::default() };
        let count = receivers.samples.len();
        for (ratio, trust, frames, rays) in [
            (0.0, 0.0, 1.0, 1),
            (1.0, 1.0, 1.0, 1),
            (1e-38, 1e-30, 1e6, 1 << 20),
            (1.0 - 1e-7, 1e6, 1e6, 1 << 20),
        ] {
            let same = [Signal {
                ratio: vec![ratio; count],
                trust: vec![trust; count],
                frames: vec![frames; count],
                rays,
            }];
            let found = run(&gpu, &on_device, &view, &same, &settings);
            for pair in found.concat() {
                assert!(pair.iter().all(|v| v.is_finite() && *v >= 0.0), "{ratio}: {pair:?}");
                assert!((pair[0] - ratio).abs() <= 9.0 * HALF_ROUNDING, "{ratio}: {pair:?}");
            }
        }
    }

    #[test]
    fn one_pixel_no_surface_and_no_signal_are_fine() {
        let Some(gpu) = device() else { return };
        let settings = FilterSettings { passes: 8, ..FilterSettings::default() };
        let (on_device, receivers, view) = scene(gpu, "cornell", [1, 1]);
        assert!(run(gpu, &on_device, &view, &[], &settings).is_empty());
        let one = |ratio: f32| {
            [Signal { ratio: vec![ratio], trust: vec![0.0], frames: Vec::new(), rays: 0 }]
        };
        let found = run(gpu, &on_device, &view, &one(0.5), &settings);
        assert!((found[0][0][0] - 0.5).abs() < 1e-6);
        let mut empty = receivers;
        (empty.samples[0].surface, empty.samples[0].depth) = (None, f32::INFINITY);
        let empty = GpuReceivers::upload(gpu, &empty, |_| Vec3::ZERO).expect("upload");
        assert_eq!(run(gpu, &empty, &view, &one(0.25), &settings)[0][0][0], 0.25);
    }
}
