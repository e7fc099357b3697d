//! Shares of earlier frames on the graphics device.

use super::super::gpu::{GpuNoisy, Guides, NOISY_CONSTANTS, TAP_CONSTANTS, TILE};
use super::{CLAMP, LEAST_TAPS, NORMAL_COS, PLANE_PIXELS, ROUNDING};
use crate::error::Error;
use crate::gpu::{Buf, Constant, Gpu, KernelInfo, Recorder, Value, kernel, record};
use crate::settings::FilterSettings;
use crate::surface::ViewFrame;
use crate::surface::gpu::{GpuReceivers, NO_SURFACE};
use glam::Vec2;

/// In the place of a packed normal, where there is no surface; no unit vector is packed so.
const NO_NORMAL: u32 = 0x8000_8000;
/// In the place of the corner of four taps, where there are none.
const NO_TAPS: u32 = u32::MAX;

const MOTION_CONSTANTS: &[Constant] = &[
    Constant { name: "NO_SURFACE", value: Value::F32(NO_SURFACE) },
    Constant { name: "NO_NORMAL", value: Value::U32(NO_NORMAL) },
    Constant { name: "PLANE_PIXELS", value: Value::F32(PLANE_PIXELS) },
    Constant { name: "NORMAL_COS", value: Value::F32(NORMAL_COS) },
    Constant { name: "LEAST_TAPS", value: Value::F32(LEAST_TAPS) },
    Constant { name: "ROUNDING", value: Value::F32(ROUNDING) },
];
const TAPS_CONSTANTS: &[Constant] = &[Constant { name: "NO_TAPS", value: Value::U32(NO_TAPS) }];
const CLAMP_CONSTANTS: &[Constant] = &[Constant { name: "CLAMP", value: Value::F32(CLAMP) }];

record! {
    /// The last frame's view.
    pub struct ReprojectParams {
        /// Eye point.
        pub eye: [f32; 3],
        /// Whether rays start at one point.
        pub is_perspective: u32,
        /// Unit viewing direction.
        pub forward: [f32; 3],
        /// Side of a pixel is `at_eye` + `per_depth` · depth, metres.
        pub at_eye: f32,
        /// Axis of the picture, see `ViewFrame::axes`.
        pub right: [f32; 3],
        /// See `at_eye`.
        pub per_depth: f32,
        /// Axis of the picture, see `ViewFrame::axes`.
        pub up: [f32; 3],
        /// Whether there was a last frame.
        pub has_last: u32,
        /// Where its rays met their pixels, from the top left corner.
        pub offset_px: [f32; 2],
        /// Pixels across and down.
        pub size: [u32; 2],
    }
}

record! {
    /// What adding a frame needs.
    pub struct AccumulateParams {
        /// Pixels across and down.
        pub size: [u32; 2],
        /// Rays behind a share in one frame.
        pub rays: f32,
        /// Most frames that count.
        pub most: f32,
    }
}

kernel! {
    /// Where surfaces were in the last frame.
    struct Reproject = "filter/temporal/reproject", [TILE[0], TILE[1], 1],
        [MOTION_CONSTANTS, TAPS_CONSTANTS];
    uniform params: ReprojectParams, read positions: [f32; 4], read normals: [f32; 4],
    read last_surfaces: [u32; 4], write surfaces: [u32; 4], write motion: [u32; 4]
}

kernel! {
    /// Shares of this frame and those before it.
    struct Accumulate = "filter/temporal/accumulate", [TILE[0], TILE[1], 1],
        [TAP_CONSTANTS, NOISY_CONSTANTS, TAPS_CONSTANTS, CLAMP_CONSTANTS];
    uniform params: AccumulateParams, read guide_positions: [f32; 4],
    read guide_normals: [f32; 4], read motion: [u32; 4], read noisy: [f32; 2],
    read last_shares: [f32; 2], read last_frames: f32, write shares: [f32; 2], write frames: f32
}

/// Every kernel of this file.
pub const KERNELS: &[&KernelInfo] = &[&Reproject::INFO, &Accumulate::INFO];

/// One signal over several frames, on the device.
#[derive(Debug)]
struct Signal {
    /// Share and trust.
    shares: Buf<[f32; 2]>,
    frames: Buf<f32>,
}

/// The last frame's view, and the rays of its signals.
#[derive(Clone, Debug)]
struct Last {
    view: ViewFrame,
    offset_px: Vec2,
    rays: Vec<u32>,
}

/// [`History`](super::History) on the device, for pictures of one size.
#[derive(Debug)]
pub struct GpuHistory {
    /// Of every other frame.
    surfaces: [Buf<[u32; 4]>; 2],
    signals: [Vec<Signal>; 2],
    motion: Buf<[u32; 4]>,
    /// Which of both holds the last frame.
    current: usize,
    last: Option<Last>,
    /// The frame before the last one.
    before: Option<Last>,
    size: [usize; 2],
}

impl GpuHistory {
    /// Memory for up to `signals` signals.
    ///
    /// Errors: more pixels than the device can hold in one list
    pub fn new(gpu: &Gpu, width: usize, height: usize, signals: usize) -> Result<Self, Error> {
        let pixels = width * height;
        let surfaces = || gpu.buffer("surfaces of a frame", pixels);
        let signal = |_| -> Result<_, Error> {
            let shares = gpu.buffer("shares of several frames", pixels)?;
            Ok(Signal { shares, frames: gpu.buffer("numbers of frames", pixels)? })
        };
        let every = || (0..signals).map(signal).collect::<Result<Vec<_>, _>>();
        Ok(Self {
            surfaces: [surfaces()?, surfaces()?],
            signals: [every()?, every()?],
            motion: gpu.buffer("where surfaces were", pixels)?,
            current: 0,
            last: None,
            before: None,
            size: [width, height],
        })
    }

    /// Pixels across and down.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Signals that there is memory for.
    pub fn signals(&self) -> usize {
        self.signals[0].len()
    }

    /// Forgets everything, as at a cut.
    pub fn clear(&mut self) {
        self.last = None;
    }

    /// Forgets the last frame, which is then rendered again: the one before it is the last.
    pub fn undo(&mut self) {
        self.current = 1 - self.current;
        self.last = self.before.take();
    }

    /// Adds a frame's shares to those of earlier frames; twin of [`accumulate`](super::accumulate).
    ///
    /// What comes out is for [`Filter::record`](super::super::gpu::Filter::record) in the same
    /// submission; every recorded frame must be submitted, in order.
    /// Panics: for more signals than there is memory for
    pub fn record<'h>(
        &'h mut self,
        rec: &mut Recorder<'_>,
        (receivers, guides): (&GpuReceivers, &Guides),
        (view, offset_px): (&ViewFrame, Vec2),
        noisy: &[GpuNoisy<'_>],
        settings: &FilterSettings,
    ) -> Vec<GpuNoisy<'h>> {
        let rays: Vec<u32> = noisy.iter().map(|signal| signal.rays).collect();
        self.before = self.last.take();
        let last = self.before.as_ref().filter(|last| last.rays == rays);
        let (before, now) = (self.current, 1 - self.current);
        let params = match last {
            Some(last) => reproject_params(last, guides.size),
            None => ReprojectParams { size: guides.size, ..ReprojectParams::default() },
        };
        let reproject = Reproject {
            params: rec.uniform(&params),
            positions: &receivers.positions,
            normals: &receivers.normals,
            last_surfaces: &self.surfaces[before],
            surfaces: &self.surfaces[now],
            motion: &self.motion,
        };
        rec.dispatch_pixels(&reproject, guides.width(), guides.height());
        let most = settings.history.max(1) as f32;
        for (s, noisy) in noisy.iter().enumerate() {
            let [last, next] = [before, now].map(|frame| &self.signals[frame][s]);
            let rays = noisy.rays.max(1) as f32;
            let kernel = Accumulate {
                params: rec.uniform(&AccumulateParams { size: guides.size, rays, most }),
                guide_positions: &guides.positions,
                guide_normals: &guides.normals,
                motion: &self.motion,
                noisy: noisy.shares,
                last_shares: &last.shares,
                last_frames: &last.frames,
                shares: &next.shares,
                frames: &next.frames,
            };
            rec.dispatch_pixels(&kernel, guides.width(), guides.height());
        }
        (self.current, self.last) = (now, Some(Last { view: *view, offset_px, rays }));
        let signals = self.signals[now].iter().zip(noisy);
        let several = |(signal, noisy): (&'h Signal, &GpuNoisy<'_>)| GpuNoisy {
            shares: &signal.shares,
            frames: Some(&signal.frames),
            rays: noisy.rays,
        };
        signals.map(several).collect()
    }
}

fn reproject_params(last: &Last, size: [u32; 2]) -> ReprojectParams {
    let [right, up] = last.view.axes();
    let [at_eye, per_depth] = last.view.pixel_size_terms();
    ReprojectParams {
        eye: last.view.eye().to_array(),
        is_perspective: u32::from(last.view.is_perspective()),
        forward: last.view.forward().to_array(),
        at_eye,
        right: right.to_array(),
        per_depth,
        up: up.to_array(),
        has_last: 1,
        offset_px: last.offset_px.to_array(),
        size,
    }
}

#[cfg(test)]
mod tests {
    use super::super::{History, accumulate};
    use super::*;
    use crate::filter::Noisy;
    use crate::filter::tests::shares;
    use crate::frame::Renderer;
    use crate::gpu::testing::{check_kernel, device};
    use crate::math::{hash_u32, unit_f32};
    use crate::surface::Receivers;
    use glam::{Quat, Vec3};

    const SIZE: [usize; 2] = [53, 41];
    const COUNT: usize = SIZE[0] * SIZE[1];

    #[test]
    fn kernels_match_their_shaders() {
        KERNELS.iter().for_each(|kernel| check_kernel(kernel));
    }

    /// One frame of a camera that moves and turns, and its receivers as they are on the device.
    struct Shot {
        view: ViewFrame,
        offset_px: Vec2,
        receivers: Receivers,
        on_device: GpuReceivers,
    }

    fn shots(gpu: &Gpu, name: &str, count: u32) -> Vec<Shot> {
        let shot = manylight_scene::builtin(name).expect(name);
        let renderer = Renderer::new(shot.scene).expect(name);
        let diagonal = renderer.world.diagonal();
        let frame = |n: u32| {
            let mut camera = shot.camera.clone();
            let turn = Quat::from_axis_angle(camera.up, 0.02 * n as f32);
            camera.forward = turn * camera.forward;
            camera.position += (camera.forward + Vec3::X) * (0.003 * diagonal * n as f32);
            let view = ViewFrame::new(&camera, SIZE[0], SIZE[1]);
            let offset_px = Vec2::new(0.5, 0.3 + 0.1 * n as f32);
            let receivers = Receivers::trace(&renderer.world, &view, offset_px, true);
            let on_device = GpuReceivers::upload(gpu, &receivers, |_| Vec3::ZERO).expect("upload");
            let receivers = on_device.download(gpu, &view, offset_px).expect("download");
            Shot { view, offset_px, receivers, on_device }
        };
        (0..count).map(frame).collect()
    }

    /// Ratio and trust of a frame; the lower half goes dark after the third.
    fn signal(frame: u32, salt: u32, rays: u32) -> (Vec<f32>, Vec<f32>) {
        let before = COUNT * (frame + salt) as usize;
        let mut ratio = shares(before + COUNT, rays, 0.7).split_off(before);
        if frame > 2 {
            ratio[COUNT / 2..].fill(0.0);
        }
        let trust = |i: u32| unit_f32(hash_u32(i ^ hash_u32(frame ^ salt)));
        (ratio, (0..COUNT as u32).map(trust).collect())
    }

    /// Share, trust and frames of every signal after every frame, by the device; `signal` makes
    /// ratio and trust from a frame, its salt and rays.
    fn run(
        gpu: &Gpu,
        shots: &[Shot],
        rays: &[u32],
        settings: &FilterSettings,
        signal: impl Fn(u32, u32, u32) -> (Vec<f32>, Vec<f32>),
    ) -> Vec<Vec<[f32; 3]>> {
        let [width, height] = SIZE;
        let guides = Guides::new(gpu, width, height).expect("guides");
        let mut history = GpuHistory::new(gpu, width, height, rays.len()).expect("history");
        let mut found = Vec::new();
        for (n, shot) in shots.iter().enumerate() {
            let list = |(s, rays): (usize, &u32)| {
                let (ratio, trust) = signal(n as u32, 10 * s as u32, *rays);
                let pairs: Vec<_> = ratio.into_iter().zip(trust).map(|(r, t)| [r, t]).collect();
                gpu.upload("shares", &pairs).expect("shares")
            };
            let lists: Vec<_> = rays.iter().enumerate().map(list).collect();
            let noisy = lists.iter().zip(rays);
            let noisy: Vec<_> =
                noisy.map(|(shares, &rays)| GpuNoisy { shares, frames: None, rays }).collect();
            let mut rec = gpu.record(None);
            guides.record(&mut rec, &shot.on_device, &shot.view);
            let seen = (&shot.on_device, &guides);
            let view = (&shot.view, shot.offset_px);
            let several = history.record(&mut rec, seen, view, &noisy, settings);
            rec.submit().wait().expect("done");
            for signal in several {
                let shares = gpu.read(signal.shares, COUNT).expect("shares");
                let frames = gpu.read(signal.frames.expect("frames"), COUNT).expect("frames");
                let three = shares.iter().zip(frames).map(|(&[r, t], n)| [r, t, n]);
                found.push(three.collect());
            }
        }
        found
    }

    #[test]
    fn the_device_remembers_as_the_processor_does() {
        let Some(gpu) = device() else { return };
        let rays = [4, 1];
        let settings = FilterSettings { history: 4, ..FilterSettings::default() };
        for name in ["cornell", "atrium"] {
            let shots = shots(gpu, name, 6);
            let found = run(gpu, &shots, &rays, &settings, signal);
            assert_eq!(found, run(gpu, &shots, &rays, &settings, signal), "two runs");
            let mut history = History::default();
            let mut fresh = 0;
            for (n, shot) in shots.iter().enumerate() {
                let pairs = [0, 1].map(|s| signal(n as u32, 10 * s as u32, rays[s]));
                let noisy = [0, 1].map(|s| {
                    let (ratio, trust) = &pairs[s];
                    Noisy { ratio, trust, frames: &[], rays: rays[s] }
                });
                let Shot { view, offset_px, receivers, .. } = shot;
                let expected =
                    accumulate(&noisy, receivers, view, *offset_px, &mut history, &settings);
                for (s, expected) in expected.iter().enumerate() {
                    let found = &found[n * 2 + s];
                    fresh += found.iter().filter(|share| share[2] == 1.0).count();
                    for (i, found) in found.iter().enumerate() {
                        let expected = expected.share(i);
                        let expected = [expected.ratio, expected.trust, expected.frames];
                        let off = expected.iter().zip(found).map(|(a, b)| (a - b).abs());
                        let worst = off.fold(0.0, f32::max);
                        assert!(worst < 1e-3, "{name} {n} {s} {i}: {expected:?} and {found:?}");
                    }
                }
            }
            assert!(fresh > 3 * COUNT && fresh < 6 * COUNT, "{name}: {fresh}");
        }
    }

    #[test]
    fn what_is_no_number_is_forgotten_on_the_device() {
        let Some(gpu) = device() else { return };
        let mut shots = shots(gpu, "cornell", 1);
        let again = shots.remove(0);
        let shot = |receivers: &Receivers| Shot {
            view: again.view,
            offset_px: again.offset_px,
            receivers: receivers.clone(),
            on_device: GpuReceivers::upload(gpu, receivers, |_| Vec3::ZERO).expect("upload"),
        };
        let mut empty = again.receivers.clone();
        for sample in &mut empty.samples {
            (sample.surface, sample.depth) = (None, f32::INFINITY);
        }
        let shots =
            [shot(&again.receivers), shot(&again.receivers), shot(&again.receivers), shot(&empty)];
        let odd = |frame: u32, _: u32, _: u32| {
            let mut ratio = vec![0.5; COUNT];
            if frame == 1 {
                (ratio[COUNT / 2], ratio[COUNT / 3]) = (f32::NAN, f32::INFINITY);
            }
            (ratio, vec![1.0; COUNT])
        };
        let found = run(gpu, &shots, &[4], &FilterSettings::default(), odd);
        let is_odd = |share: &&[f32; 3]| !((share[0] - 0.5).abs() < 1e-5 && share[1] == 1.0);
        for (n, shares) in found.iter().enumerate() {
            assert_eq!(shares.iter().filter(is_odd).count(), if n == 1 { 2 } else { 0 }, "{n}");
        }
        assert!(found[3].iter().all(|share| share[2] == 1.0), "no surface has a history");
    }
}
