//! The same corridor on the graphics device.
//!
//! In: a scene prepared by [`Renderer`], camera, [`Settings`] · Out: [`Frame`]
//! A frame of virtual lights is one submission; nothing is read back inside. What it would have
//! needed comes back with it: where a buffer was too small it grows, and the frame is rendered
//! again.

mod buffers;
mod diff;
mod engine;
mod lights;
mod paths;
mod sequence;

pub use diff::StageDifference;
pub use engine::{EngineReceivers, EngineTargets};

use super::sequence::noise;
use super::{BRUTE_SKY_RAYS, Frame, Progress, Renderer, Stage, check_size, nothing_shines};
use crate::composite::gpu::{Arriving, GatheredLight};
use crate::direct::gpu::{SkyRays, record_lights, record_sky, trace_sky};
use crate::emitter::gpu::{pack, record_background};
use crate::error::Error;
use crate::filter::gpu::GpuNoisy;
use crate::filter::temporal::gpu::GpuHistory;
use crate::gather::brute::gpu::GpuBrute;
use crate::gpu::{Buf, Gpu, Later, Recorder, SceneGroup, StageTime};
use crate::math::{Sequence, hash_u32};
use crate::settings::{Method, Settings};
use crate::surface::ViewFrame;
use crate::surface::gpu::ReceiverTextures;
use crate::world::gpu::GpuWorld;
use buffers::{Buffers, GatherRef, Recipe, Work};
use glam::Vec2;
use lights::Lights;
use manylight_scene::Camera;
use sequence::GpuPast;

/// Times that a frame is rendered again with larger buffers, more light paths or fewer levels
/// before it gives up.
const MOST_TRIES: u32 = 32;

/// A scene on the device: build once, render many frames.
#[derive(Debug)]
pub struct GpuRenderer {
    gpu: Gpu,
    renderer: Box<Renderer>,
    scene: GpuWorld,
    buffers: Option<Buffers>,
    /// Frames inside an engine's own.
    in_flight: engine::InFlight,
    /// Of a sequence whose frames add up.
    past: Option<GpuPast>,
    /// Whether the next picture chooses the most levels of its grids anew: its lights may be others
    /// than those that a level was too much for.
    forgets_levels: bool,
}

/// One picture to be rendered.
#[derive(Clone, Copy)]
struct Job<'a> {
    view: &'a ViewFrame,
    settings: &'a Settings,
    /// Position among the samples of a pixel.
    sample: u32,
    /// Mixed into the seeds of what differs from frame to frame.
    noise: u32,
    /// Whether virtual lights and grids of the frame before are kept.
    keeps_lights: bool,
    /// Whether they may be, where they would be made the same way again.
    may_keep: bool,
    /// Receivers that are not traced.
    given: Option<ReceiverTextures<'a>>,
}

impl<'a> Job<'a> {
    /// The first sample of a single picture.
    fn new(view: &'a ViewFrame, settings: &'a Settings) -> Self {
        let (sample, noise, given) = (0, 0, None);
        Self { view, settings, sample, noise, keeps_lights: false, may_keep: true, given }
    }

    /// Seed of the rays that ask for shadows.
    fn draws(&self) -> u32 {
        self.seed() ^ self.noise
    }

    /// Seed of everything else in this sample.
    fn seed(&self) -> u32 {
        hash_u32(self.settings.seed ^ hash_u32(self.sample))
    }

    /// Where in its pixel a camera ray starts.
    fn offset_px(&self) -> Vec2 {
        match self.settings.film.samples {
            1 => Vec2::splat(0.5),
            _ => Vec2::from_array(Sequence::new(self.settings.seed, self.sample).next_2d()),
        }
    }
}

impl GpuRenderer {
    /// Copies a scene to the device.
    ///
    /// Errors: what the device cannot hold; the renderer is handed back
    pub fn new(gpu: Gpu, renderer: Renderer) -> Result<Self, (Box<Renderer>, Error)> {
        let renderer = Box::new(renderer);
        let sources = pack(&renderer.world, &renderer.emitters);
        match gpu.guard(|| GpuWorld::new(&gpu, &renderer.world, &sources)) {
            Ok(scene) => {
                let in_flight = engine::InFlight::default();
                let (buffers, past, forgets_levels) = (None, None, false);
                Ok(Self { gpu, renderer, scene, buffers, in_flight, past, forgets_levels })
            }
            Err(reason) => Err((renderer, reason)),
        }
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// The device, for another scene.
    pub fn into_gpu(self) -> Gpu {
        self.gpu
    }

    /// The scene as kernels that trace rays see it.
    pub fn scene(&self) -> &SceneGroup {
        self.scene.group()
    }

    /// World and emitters.
    pub fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    /// Renders one picture.
    ///
    /// The same seed gives the same bits on the same device.
    /// Errors: as [`Renderer::render`], and what the device cannot do
    pub fn render(
        &mut self,
        camera: &Camera,
        size: [usize; 2],
        settings: &Settings,
        progress: Progress<'_>,
    ) -> Result<Frame, Error> {
        settings.validate()?;
        check_size(size)?;
        let view = ViewFrame::new(camera, size[0], size[1]);
        let mut times = Vec::new();
        if settings.method == Method::Path {
            return self.gpu.guard(|| self.render_paths(&view, settings, progress));
        }
        // Whatever was rendered before, the levels are those of this picture.
        self.forgets_levels = true;
        let samples = settings.film.samples;
        let (mut sample, mut tries) = (0, 0);
        while sample < samples {
            progress("frame", f64::from(sample) / f64::from(samples));
            let job = Job { sample, ..Job::new(&view, settings) };
            match self.render_sample(job, None, progress)? {
                Some(stages) => {
                    add_times(&mut times, stages);
                    sample += 1;
                }
                // What was summed up lay in memory that has grown.
                None if tries < MOST_TRIES => {
                    (sample, tries) = (0, tries + 1);
                    times.clear();
                }
                None => return Err(endless()),
            }
        }
        self.gpu.guard(|| self.finish(settings, times))
    }

    /// Renders one picture without bringing it back, and tells what its stages took.
    ///
    /// `keeps_lights`: takes virtual lights and grids as the frame before left them, if that had
    /// the same size and settings and the scene has the same lights. With `filter.temporal` frames
    /// follow one another.
    /// Errors: as [`GpuRenderer::render`]
    pub fn time_frame(
        &mut self,
        camera: &Camera,
        size: [usize; 2],
        settings: &Settings,
        keeps_lights: bool,
    ) -> Result<Vec<StageTime>, Error> {
        settings.validate()?;
        check_size(size)?;
        let view = ViewFrame::new(camera, size[0], size[1]);
        let fits = self.buffers.as_ref().is_some_and(|b| b.fits(size, settings));
        let keeps_lights = keeps_lights && fits;
        let kept = self.past.take();
        let mut past = self.gpu.guard(|| GpuPast::go_on(kept, self, &view, settings))?;
        let mut job = Job { keeps_lights, may_keep: false, ..Job::new(&view, settings) };
        if let Some(past) = &mut past {
            job.noise = noise(past.timed);
            past.timed += 1;
        }
        let history = past.as_mut().map(|past| &mut past.history);
        let times = self.render_sample(job, history, &|_, _| ()).map(Option::unwrap_or_default);
        self.past = past.filter(|_| times.is_ok());
        times
    }

    /// One sample per pixel, the first again and again until every buffer was large enough; none
    /// where a later one found them too small, and the samples before it are lost.
    fn render_sample(
        &mut self,
        mut job: Job<'_>,
        mut history: Option<&mut GpuHistory>,
        progress: Progress<'_>,
    ) -> Result<Option<Vec<StageTime>>, Error> {
        let size = [job.view.width, job.view.height];
        if !self.in_flight.is_empty() {
            // Those of an engine that are still open after this were not submitted yet.
            self.gpu.wait()?;
            self.look_at_frames()?;
        }
        let kept = self.buffers.take();
        let mut buffers = self.gpu.guard(|| Buffers::take(kept, self, size, job.settings))?;
        if std::mem::take(&mut self.forgets_levels) {
            buffers.forget_levels();
        }
        let recipe = Recipe::new(job.settings, job.seed());
        // Other lights, or frames that lacked room, may have left none.
        job.keeps_lights &= buffers.builds().are_done();
        job.keeps_lights |= job.may_keep && self.has_built(&mut buffers, job.settings, &recipe);
        // Later samples add to what the first one left.
        let makes_lights = !job.keeps_lights || job.settings.film.samples > 1;
        if job.sample == 0 && makes_lights && self.in_flight.counts_on(&buffers) {
            job.keeps_lights = false;
            buffers = self.gpu.guard(|| Buffers::take(None, self, size, job.settings))?;
        }
        for _ in 0..MOST_TRIES {
            // After a build that lacked room nothing is kept.
            let build = (!job.keeps_lights).then(|| buffers.builds().begin(&recipe));
            let (times, needs) = self.gpu.guard(|| match job.settings.method {
                Method::Brute => self.run_brute(&buffers, job, progress),
                _ => self.run_grid(&buffers, job, history.as_deref_mut()),
            })?;
            let bytes = needs.bytes(&self.gpu)?;
            let needs = buffers.parse_needs(&bytes);
            let lacked;
            (buffers, lacked) =
                self.gpu.guard(|| buffers.grown(&self.gpu, job.settings, &needs))?;
            #[cfg(debug_assertions)]
            if !lacked {
                buffers.check_faults(&self.gpu, &bytes)?;
            }
            if let Some(build) = build.filter(|_| !lacked) {
                buffers.builds().end(build);
            }
            if !lacked || job.sample > 0 {
                self.buffers = Some(buffers);
                return Ok((!lacked).then_some(times));
            }
            job.keeps_lights = false;
            if let Some(history) = history.as_deref_mut() {
                history.undo();
            }
        }
        Err(endless())
    }

    /// Whether the lights and grids that a frame would make lie in its buffers.
    fn has_built(&self, buffers: &mut Buffers, settings: &Settings, recipe: &Recipe) -> bool {
        // Shaders that change may change the lights.
        let has_grids = settings.method != Method::Brute && !self.gpu.reloads_shaders();
        has_grids && buffers.builds().has(recipe)
    }

    /// Records and runs the frame of the grid method and of direct light alone.
    fn run_grid(
        &self,
        buffers: &Buffers,
        job: Job<'_>,
        history: Option<&mut GpuHistory>,
    ) -> Result<(Vec<StageTime>, Later), Error> {
        let mut rec = self.gpu.record(Some(self.scene.group()));
        self.record_frame(&mut rec, buffers, job, history);
        let needs = buffers.record_needs(&mut rec);
        let times = rec.submit().wait()?;
        Ok((times, needs))
    }

    /// The list of stages.
    fn record_frame(
        &self,
        rec: &mut Recorder<'_>,
        buffers: &Buffers,
        job: Job<'_>,
        history: Option<&mut GpuHistory>,
    ) {
        let Job { settings, .. } = job;
        let (seed, draws, d_min) = (job.seed(), job.draws(), self.renderer.d_min(settings));
        let Buffers { receivers, work: Work { irradiance, layers, .. }, .. } = buffers;
        self.record_receivers(rec, buffers, job);
        let normal_maps = settings.surface.normal_maps;
        if let Some(lights) = &buffers.work.emitted {
            if !job.keeps_lights {
                rec.stage("emitter vpls");
                lights.trace(rec, normal_maps, seed ^ 1);
                lights.build(rec, settings, d_min);
            }
            lights.gather(rec, buffers, settings, d_min, draws ^ 2);
        }
        if let Some(lights) = &buffers.work.bounced {
            if !job.keeps_lights {
                rec.stage("vpls");
                lights.trace(rec, normal_maps, seed ^ 3);
                lights.build(rec, settings, d_min);
            }
            lights.gather(rec, buffers, settings, d_min, draws ^ 4);
        }
        // From here on nothing that a gather needs is left; see [`Work`].
        // Unless its ratio is smoothed, what arrives from the sky is known in every channel.
        let exact = !settings.filter.enabled;
        let sky_rays = SkyRays { rays: sky_rays(settings), seed: draws ^ 5, exact };
        self.record_direct(rec, buffers, job, sky_rays);
        self.record_guides(rec, buffers, job);
        let gathers = buffers.gathers(settings);
        let smooth = self.record_filter(rec, buffers, &gathers, job, history);
        let is_lit = buffers.work.bounced.is_some();
        layers.begin(rec, receivers, irradiance, job.sample, is_lit);
        let mut smooth = smooth.iter();
        for gather in &gathers {
            let filtered = if gather.rays > 0 { smooth.next() } else { None };
            let arriving = Arriving::Ratio(filtered.unwrap_or(gather.ratio));
            let (unshadowed, is_direct) = (gather.unshadowed, gather.is_direct);
            layers.add(rec, receivers, &GatheredLight { unshadowed, arriving, is_direct });
        }
        layers.finish(rec, receivers);
    }

    /// Adds the ratios of few rays to those of the past, if any, and smooths them.
    fn record_filter<'b>(
        &self,
        rec: &mut Recorder<'_>,
        buffers: &'b Buffers,
        gathers: &[GatherRef<'_>],
        job: Job<'_>,
        history: Option<&mut GpuHistory>,
    ) -> &'b [Buf<[f32; 2]>] {
        let (settings, view) = (&job.settings.filter, (job.view, job.offset_px()));
        let noisy = gathers.iter().filter(|gather| gather.rays > 0);
        let mut signals: Vec<_> =
            noisy.map(|g| GpuNoisy { shares: g.ratio, frames: None, rays: g.rays }).collect();
        if !settings.enabled || signals.is_empty() {
            return &[];
        }
        rec.stage("filter");
        if let Some(history) = history {
            let seen = (&buffers.receivers, &buffers.work.guides);
            signals = history.record(rec, seen, view, &signals, settings);
        }
        buffers.work.filter.record(rec, &buffers.work.guides, &signals, settings)
    }

    /// What tells receivers apart, for all filters; and the first filter, where pixels see parts
    /// of the lights.
    fn record_guides(&self, rec: &mut Recorder<'_>, buffers: &Buffers, job: Job<'_>) {
        let Job { settings, view, .. } = job;
        let Buffers { receivers, work: Work { guides, join, emitted, bounced, .. }, .. } = buffers;
        if settings.filter.enabled || join.is_some() {
            rec.stage(if join.is_some() { "interleave" } else { "filter" });
            guides.record(rec, receivers, view);
        }
        let Some(join) = join else { return };
        for lights in emitted.iter().chain(bounced) {
            let Some(gathered) = &lights.gathered else { continue };
            let parts = (&gathered.out.unshadowed, &gathered.out.ratio);
            join.record(rec, guides, receivers, parts, settings.interleave);
        }
    }

    /// Receivers, and what the sky gives to the other pixels.
    fn record_receivers(&self, rec: &mut Recorder<'_>, buffers: &Buffers, job: Job<'_>) {
        let (view, offset_px) = (job.view, job.offset_px());
        rec.stage("receivers");
        let normal_maps = job.settings.surface.normal_maps;
        match &job.given {
            None => buffers.receivers.trace(rec, view, offset_px, normal_maps),
            Some(textures) => buffers.receivers.load(rec, textures),
        }
        record_background(rec, &buffers.receivers, view, offset_px);
    }

    /// Light from points, suns and the sky.
    fn record_direct(
        &self,
        rec: &mut Recorder<'_>,
        buffers: &Buffers,
        job: Job<'_>,
        sky_rays: SkyRays,
    ) {
        let Buffers { receivers, work: Work { irradiance, sky, .. }, .. } = buffers;
        rec.stage("direct");
        record_lights(rec, receivers, job.seed(), irradiance);
        if let Some(sky) = sky {
            rec.stage("sky");
            record_sky(rec, receivers, sky_rays, &sky.unshadowed, &sky.ratio);
        }
    }

    /// The frame of the brute method: long work in many submissions.
    fn run_brute(
        &self,
        buffers: &Buffers,
        job: Job<'_>,
        progress: Progress<'_>,
    ) -> Result<(Vec<StageTime>, Later), Error> {
        let (settings, seed) = (job.settings, job.seed());
        let d_min = self.renderer.d_min(settings);
        let normal_maps = settings.surface.normal_maps;
        let Buffers { receivers, work, .. } = buffers;
        let Work { emitted, bounced, irradiance, sky, layers, .. } = work;
        let mut rec = self.gpu.record(Some(self.scene.group()));
        self.record_receivers(&mut rec, buffers, job);
        let sets = [(emitted, seed ^ 1, true), (bounced, seed ^ 3, false)];
        for (lights, seed, is_direct) in sets {
            let Some(lights) = lights else { continue };
            rec.stage(if is_direct { "emitter vpls" } else { "vpls" });
            lights.trace(&mut rec, normal_maps, seed);
        }
        rec.stage("direct");
        record_lights(&mut rec, receivers, seed, irradiance);
        let mut times = rec.submit().wait()?;
        if let Some(sky) = sky {
            let rays = SkyRays { rays: BRUTE_SKY_RAYS, seed: seed ^ 5, exact: true };
            let (lists, tick) =
                ((&sky.unshadowed, &sky.ratio), |share: f64| progress("sky", share));
            let scene = self.scene.group();
            let time_ms = trace_sky(&self.gpu, scene, receivers, rays, lists, &tick)?;
            times.push(StageTime { name: "sky", time_ms });
        }
        let mut rec = self.gpu.record(None);
        rec.stage("composite");
        layers.begin(&mut rec, receivers, irradiance, job.sample, bounced.is_some());
        if let Some(sky) = sky {
            let arriving = Arriving::Ratio(&sky.ratio);
            let unshadowed = &sky.unshadowed;
            layers.add(
                &mut rec,
                receivers,
                &GatheredLight { unshadowed, arriving, is_direct: true },
            );
        }
        let needs = buffers.record_needs(&mut rec);
        add_times(&mut times, rec.submit().wait()?);
        let found = buffers.parse_needs(&needs.bytes(&self.gpu)?);
        let start = std::time::Instant::now();
        let brute = GpuBrute::new(&self.gpu, view_pixels(job.view))?;
        let sets =
            sets.into_iter().filter_map(|(set, _, is_direct)| Some((set.as_ref()?, is_direct)));
        for ((lights, is_direct), found) in sets.zip(&found) {
            let set = (&lights.vpls.lights, found.vpls.count as usize);
            let tick = |share| progress("brute", share);
            brute.gather(&self.gpu, self.scene.group(), receivers, set, d_min, &tick)?;
            let mut rec = self.gpu.record(None);
            rec.stage("composite");
            let (unshadowed, arriving) = (&brute.unshadowed, Arriving::Exact(&brute.shadowed));
            layers.add(&mut rec, receivers, &GatheredLight { unshadowed, arriving, is_direct });
            layers.finish(&mut rec, receivers);
            rec.submit().wait()?;
        }
        let time_ms = start.elapsed().as_secs_f64() * 1e3;
        times.push(StageTime { name: "brute", time_ms });
        Ok((times, needs))
    }

    /// Brings the picture back.
    fn finish(&self, settings: &Settings, times: Vec<StageTime>) -> Result<Frame, Error> {
        let buffers = self.buffers.as_ref().expect("a sample was rendered");
        let layers = buffers.work.layers.download(&self.gpu, &buffers.receivers)?;
        let bounced = buffers.work.bounced.as_ref().filter(|_| settings.method == Method::Grid);
        let alpha = bounced.and_then(Lights::alpha);
        let evals = layers.evals.iter().map(|&e| f64::from(e)).sum::<f64>() as u64;
        let count = |name: &str| match name {
            "receivers" => layers.depth.iter().filter(|d| d.is_finite()).count() as u64,
            "direct" => self.renderer.emitters.lights.len() as u64,
            "gather light" | "brute" => evals,
            name => buffers.count_of(name),
        };
        let stages =
            times.iter().map(|t| Stage { name: t.name, time_ms: t.time_ms, count: count(t.name) });
        let stages = stages.collect();
        Ok(Frame { layers, stages, d_min: self.renderer.d_min(settings), alpha })
    }
}

/// The end of trying with ever larger buffers.
fn endless() -> Error {
    let problem = "its lists of lights grow without end; render with --backend cpu".to_owned();
    Error::Device { problem }
}

/// Rays of a receiver to the sky.
fn sky_rays(settings: &Settings) -> u32 {
    settings.shadow.rays.div_ceil(2).max(1)
}

fn view_pixels(view: &ViewFrame) -> usize {
    view.width * view.height
}

/// Adds the times of a sample to those of the samples before.
fn add_times(sum: &mut Vec<StageTime>, times: Vec<StageTime>) {
    for time in times {
        match sum.iter_mut().find(|s| s.name == time.name) {
            Some(stage) => stage.time_ms += time.time_ms,
            None => sum.push(time),
        }
    }
}

#[cfg(test)]
mod tests;
