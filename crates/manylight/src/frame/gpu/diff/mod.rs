//! The frame on the device held against that on the processor, stage by stage.
//!
//! In: a scene on both sides · Out: [`StageDifference`]s, in the order of the stages
//! Every stage starts from the processor's result of the one before, so that a difference belongs
//! to the stage that shows it. Numbers agree to 1e-4 of a scale; counts and keys exactly. Where a
//! ray passes an edge, a light lies on the border of a cell, or a draw falls on one, rounding
//! decides: a share of such items may differ. It also decides whether a light in a pixel's own
//! plane gives it something next to nothing, or nothing: such lights do not count.
//! Limits: the methods of the grid and of direct light; the first sample, at the pixel's center.

mod lights;
mod tally;

pub use tally::StageDifference;

use super::{GpuRenderer, Job, MOST_TRIES, check_size, endless, sky_rays};
use crate::composite::Layers;
use crate::composite::gpu::{Arriving, GatheredLight, GpuLayers};
use crate::direct::gpu::{SkyRays, record_lights, record_sky};
use crate::emitter::SkyEmitter;
use crate::emitter::gpu::record_background;
use crate::error::Error;
use crate::filter::gpu::{Filter, GpuNoisy, Guides, most_off};
use crate::filter::interleave;
use crate::filter::interleave::gpu::Join;
use crate::frame::stage::Clock;
use crate::gather::Gathered;
use crate::gather::grid::gpu::{Gather, GatherCapacity, GatherInput, GatherOut, GpuGrid};
use crate::gather::grid::{self, LightingGrid};
use crate::gpu::{Buf, Recorder};
use crate::settings::{Method, Settings};
use crate::surface::gpu::GpuReceivers;
use crate::surface::{PixelSample, Receivers, ViewFrame};
use crate::vlight::vpl::gpu::{EmitterTracer, GpuVpls, VplTracer};
use crate::vlight::vpl::{self, VplSet};
use glam::Vec3;
use lights::{diff_grid, diff_vpls, in_plane};
use manylight_scene::Camera;
use tally::{Tally, apart, apart_by_axis, colors, counts, numbers};

/// Pixels whose ray, to a surface or to a sun or lamp, may pass an edge.
const EDGES_ALLOWED: f64 = 3e-3;
/// Pixels of whose few rays to the sky one may pass an edge, or fall on a texel's border.
const SKY_ALLOWED: f64 = 1e-2;
/// Lights that give a pixel nothing within rounding, and count on one side alone.
const COUNTS_ALLOWED: f64 = 1e-4;
/// Pixels of whose drawn lights one may be the next, or its ray pass an edge.
const DRAWS_ALLOWED: f64 = 1.5e-2;

/// Names of the stages of a set of virtual lights.
struct SetStages {
    vpls: &'static str,
    grid: &'static str,
    alpha: &'static str,
    lighting: &'static str,
    shadow: &'static str,
}

const EMITTED: SetStages = SetStages {
    vpls: "emitter vpls",
    grid: "emitter grid",
    alpha: "emitter alpha",
    lighting: "emitter lighting",
    shadow: "emitter shadow",
};
const BOUNCED: SetStages = SetStages {
    vpls: "vpls",
    grid: "grid",
    alpha: "alpha",
    lighting: "lighting",
    shadow: "shadow",
};

impl GpuRenderer {
    /// Runs every stage of a frame on device and processor from the same inputs.
    ///
    /// Errors: as [`GpuRenderer::render`], and a method without stages to compare
    /// Cost:   a frame on the processor, about one and a half on the device, and copies between
    pub fn diff_stages(
        &self,
        camera: &Camera,
        size: [usize; 2],
        settings: &Settings,
    ) -> Result<Vec<StageDifference>, Error> {
        settings.validate()?;
        check_size(size)?;
        if !matches!(settings.method, Method::Grid | Method::Direct) {
            let name = settings.method.name();
            let problem = format!("{name} has no stages to compare; use grid or direct");
            return Err(Error::Setting { path: "method".to_owned(), problem });
        }
        let mut settings = settings.clone();
        settings.film.samples = 1;
        let view = ViewFrame::new(camera, size[0], size[1]);
        let job = Job::new(&view, &settings);
        self.gpu().guard(|| {
            let mut diff = Diff::new(self, job)?;
            diff.run()?;
            Ok(diff.rows)
        })
    }
}

/// A comparison under way.
struct Diff<'a> {
    engine: &'a GpuRenderer,
    job: Job<'a>,
    d_min: f32,
    /// What the stages after the first work on, the same on both sides to the last bit.
    receivers: Receivers,
    planes: GpuReceivers,
    rows: Vec<StageDifference>,
}

impl<'a> Diff<'a> {
    /// Compares the receivers.
    fn new(engine: &'a GpuRenderer, job: Job<'a>) -> Result<Self, Error> {
        let (gpu, renderer, view) = (engine.gpu(), engine.renderer(), job.view);
        let (offset_px, normal_maps) = (job.offset_px(), job.settings.surface.normal_maps);
        let expected = Receivers::trace(&renderer.world, view, offset_px, normal_maps);
        let traced = GpuReceivers::new(gpu, view.width, view.height)?;
        let mut rec = gpu.record(Some(engine.scene.group()));
        traced.trace(&mut rec, view, offset_px, normal_maps);
        record_background(&mut rec, &traced, view, offset_px);
        rec.submit().wait()?;
        let found = traced.download(gpu, view, offset_px)?;
        let emissions = colors_of(&gpu.read(&traced.emissions, usize::MAX)?);
        let diagonal = renderer.world.diagonal();
        let mut rows = diff_receivers(&expected, &found, diagonal, EDGES_ALLOWED);
        let sky = |direction| renderer.sky(direction);
        let emission = |s: &PixelSample| s.surface.map_or_else(|| sky(s.direction), |s| s.emission);
        let pairs = expected.samples.iter().map(emission).zip(emissions);
        rows.push(colors(["receivers", "emission"], pairs, 1e-4, EDGES_ALLOWED));

        let planes = GpuReceivers::upload(gpu, &expected, sky)?;
        let receivers = planes.download(gpu, view, offset_px)?;
        Ok(Self { engine, job, d_min: renderer.d_min(job.settings), receivers, planes, rows })
    }

    /// Compares all other stages.
    fn run(&mut self) -> Result<(), Error> {
        let (engine, settings) = (self.engine, self.job.settings);
        let emitters = &engine.renderer().emitters;
        let irradiance = self.diff_direct()?;
        let mut gathers = Vec::new();
        if let Some(sky) = &emitters.sky {
            gathers.push(self.diff_sky(sky)?);
        }
        if !emitters.surface.is_empty() {
            let set = self.diff_emitter_vpls()?;
            gathers.push(self.diff_gather(&EMITTED, &set, 2)?);
        }
        let direct_gathers = gathers.len();
        if settings.method != Method::Direct {
            let set = self.diff_path_vpls()?;
            gathers.push(self.diff_gather(&BOUNCED, &set, 4)?);
        }
        if settings.interleave > 1 {
            self.diff_interleave(&mut gathers)?;
        }
        self.diff_filter(&mut gathers)?;
        self.diff_composite(&irradiance, &gathers, direct_gathers)
    }

    /// Records on the device, and waits for it.
    fn submit(&self, record: impl FnOnce(&mut Recorder<'_>)) -> Result<(), Error> {
        let mut rec = self.engine.gpu().record(Some(self.engine.scene.group()));
        record(&mut rec);
        rec.submit().wait()?;
        Ok(())
    }

    fn plane(&self) -> Result<Buf<[f32; 4]>, Error> {
        self.engine.gpu().buffer("plane to compare", self.receivers.samples.len())
    }

    fn read<T: crate::gpu::Record>(&self, buffer: &Buf<T>) -> Result<Vec<T>, Error> {
        self.engine.gpu().read(buffer, usize::MAX)
    }

    /// Irradiance from sun, point and spot lights.
    fn diff_direct(&mut self) -> Result<Vec<Vec3>, Error> {
        let seed = self.job.seed();
        let expected = self.engine.renderer().light_irradiance(&self.receivers, seed);
        let irradiance = self.plane()?;
        self.submit(|rec| record_lights(rec, &self.planes, seed, &irradiance))?;
        let pairs = expected.iter().copied().zip(colors_of(&self.read(&irradiance)?));
        self.rows.push(colors(["direct", "irradiance"], pairs, 1e-4, EDGES_ALLOWED));
        Ok(expected)
    }

    /// Irradiance from the sky and its ratio.
    fn diff_sky(&mut self, sky: &SkyEmitter) -> Result<(Gathered, u32), Error> {
        let (settings, seed) = (self.job.settings, self.job.seed() ^ 5);
        let mut clock = Clock::new(&|_, _| ());
        let renderer = self.engine.renderer();
        let (expected, rays) =
            renderer.gather_sky(sky, &self.receivers, settings, seed, &mut clock);
        let count = self.receivers.samples.len();
        let (light, ratio) = (self.plane()?, self.engine.gpu().buffer("ratios", count)?);
        let mut sky_rays = SkyRays { rays: sky_rays(settings), seed, exact: false };
        self.submit(|rec| record_sky(rec, &self.planes, sky_rays, &light, &ratio))?;
        let pairs = expected.unshadowed.iter().copied().zip(colors_of(&self.read(&light)?));
        self.rows.push(colors(["sky", "unshadowed"], pairs, 1e-4, SKY_ALLOWED));
        let found = self.read(&ratio)?;
        let pairs = expected.shadow_ratio.iter().zip(&found).map(|(a, b)| (*a, b[0]));
        self.rows.push(numbers(["sky", "shadow ratio"], pairs, (1e-4, ""), SKY_ALLOWED));
        sky_rays.exact = true;
        self.submit(|rec| record_sky(rec, &self.planes, sky_rays, &light, &ratio))?;
        let pairs = expected.shadowed.iter().copied().zip(colors_of(&self.read(&light)?));
        self.rows.push(colors(["sky", "arriving"], pairs, 1e-4, SKY_ALLOWED));
        Ok((expected, rays))
    }

    /// Virtual lights on emissive surfaces.
    fn diff_emitter_vpls(&mut self) -> Result<VplSet, Error> {
        let (gpu, seed) = (self.engine.gpu(), self.job.seed() ^ 1);
        let (world, emitters) = (&self.engine.renderer().world, &self.engine.renderer().emitters);
        let count = self.job.settings.vpls.emitter_count;
        let expected = vpl::trace_emitters(world, emitters, count, seed);
        let vpls = GpuVpls::new(gpu, count, 1)?;
        let tracer = EmitterTracer::new(gpu, count)?;
        self.submit(|rec| tracer.record(rec, seed, &vpls))?;
        self.push_vpls(&EMITTED, &expected, &vpls)?;
        Ok(expected)
    }

    /// Virtual lights on what light paths hit.
    fn diff_path_vpls(&mut self) -> Result<VplSet, Error> {
        let (gpu, seed) = (self.engine.gpu(), self.job.seed() ^ 3);
        let (world, emitters) = (&self.engine.renderer().world, &self.engine.renderer().emitters);
        let (vpls, normal_maps) = (&self.job.settings.vpls, self.job.settings.surface.normal_maps);
        let (count, bounces) = (vpls.count, vpls.bounces);
        let expected = vpl::trace(world, emitters, count, bounces, seed, normal_maps);
        let vpls = GpuVpls::new(gpu, count, bounces)?;
        let mut tracer = VplTracer::new(gpu, count, bounces)?;
        for _ in 0..MOST_TRIES {
            self.submit(|rec| tracer.record(rec, normal_maps, seed, &vpls))?;
            if gpu.read(&vpls.info, 1)?[0].missing == 0 {
                self.push_vpls(&BOUNCED, &expected, &vpls)?;
                return Ok(expected);
            }
            tracer.raise_rounds(tracer.rounds().saturating_mul(2));
        }
        Err(endless())
    }

    fn push_vpls(
        &mut self,
        names: &SetStages,
        expected: &VplSet,
        vpls: &GpuVpls,
    ) -> Result<(), Error> {
        let gpu = self.engine.gpu();
        let info = gpu.read(&vpls.info, 1)?[0];
        let found = gpu.read(&vpls.lights, info.count as usize)?;
        let diagonal = self.engine.renderer().world.diagonal();
        self.rows.extend(diff_vpls(names, expected, (&info, &found), diagonal));
        Ok(())
    }

    /// The grid of a set, alpha, sums and ratios.
    fn diff_gather(
        &mut self,
        names: &SetStages,
        set: &VplSet,
        key: u32,
    ) -> Result<(Gathered, u32), Error> {
        let (gpu, settings, d_min) = (self.engine.gpu(), self.job.settings, self.d_min);
        let seed = self.job.seed() ^ key;
        let detail = grid::DETAIL * d_min;
        let on_processor = LightingGrid::build(&set.lights, &settings.grid, detail);
        let rules = (&settings.grid, detail);
        self.rows.extend(diff_grid(gpu, names, &set.lights, &on_processor, rules)?);
        let world = &self.engine.renderer().world;
        let expected = grid::gather(world, &self.receivers, &on_processor, settings, d_min, seed);

        let uploaded = GpuGrid::upload(gpu, &on_processor)?;
        let mut out = self.gather(&uploaded, settings, seed)?;
        if let Some(alpha) = expected.alpha {
            let found = gpu.read(&out.reach, 1)?[0].alpha;
            let pair = std::iter::once((1.0, found / alpha));
            self.rows.push(numbers([names.alpha, "reach"], pair, (1e-4, "of alpha"), 0.0));
            if found != alpha {
                let mut settings = settings.clone();
                settings.grid.alpha = Some(alpha);
                out = self.gather(&uploaded, &settings, seed)?;
            }
        }
        self.push_gathered(names, &on_processor, &expected, &out)?;
        Ok((expected, settings.shadow.rays))
    }

    /// Gathers on the device, with enough room.
    fn gather(&self, grid: &GpuGrid, settings: &Settings, seed: u32) -> Result<GatherOut, Error> {
        let (gpu, d_min, receivers) = (self.engine.gpu(), self.d_min, &self.planes);
        let ViewFrame { width, height, .. } = *self.job.view;
        let out = GatherOut::new(gpu, width, height)?;
        let mut capacity = GatherCapacity::default();
        for _ in 0..MOST_TRIES {
            let gather = Gather::new(gpu, width, height, settings, capacity)?;
            let input = GatherInput { receivers, grid, settings, d_min, seed };
            self.submit(|rec| gather.record(rec, &input, &out))?;
            match gather.capacity().grown(&gpu.read(&out.stats, 1)?[0]) {
                Some(grown) => capacity = grown,
                None => return Ok(out),
            }
        }
        Err(endless())
    }

    fn push_gathered(
        &mut self,
        names: &SetStages,
        grid: &LightingGrid,
        expected: &Gathered,
        out: &GatherOut,
    ) -> Result<(), Error> {
        let (sums, ratios) = (self.read(&out.unshadowed)?, self.read(&out.ratio)?);
        let diagonal = self.engine.renderer().world.diagonal();
        // The same, as far as the lights in the pixel's own plane go.
        let evals = self.receivers.samples.iter().enumerate().map(|(i, sample)| {
            let (a, b) = (expected.evals[i], sums[i][3] as u32);
            match &sample.surface {
                Some(s) if a != b && a.abs_diff(b) <= in_plane(grid, s, diagonal) => (a, a),
                _ => (a, b),
            }
        });
        let pairs = expected.unshadowed.iter().copied().zip(colors_of(&sums));
        let rows = [
            colors([names.lighting, "unshadowed"], pairs, 1e-4, 0.0),
            counts([names.lighting, "evals"], evals, "lights of a pixel", COUNTS_ALLOWED),
            numbers(
                [names.shadow, "ratio"],
                expected.shadow_ratio.iter().zip(&ratios).map(|(a, b)| (*a, b[0])),
                (1e-4, ""),
                DRAWS_ALLOWED,
            ),
            numbers(
                [names.shadow, "trust"],
                expected.trust.iter().zip(&ratios).map(|(a, b)| (*a, b[1])),
                (1e-4, ""),
                DRAWS_ALLOWED,
            ),
        ];
        self.rows.extend(rows);
        Ok(())
    }

    /// What the pixels know together; makes it the gathers' own.
    fn diff_interleave(&mut self, gathers: &mut [(Gathered, u32)]) -> Result<(), Error> {
        let (engine, view, side) = (self.engine, self.job.view, self.job.settings.interleave);
        let gpu = engine.gpu();
        let guides = Guides::new(gpu, view.width, view.height)?;
        let memory = Join::new(gpu, view.width, view.height)?;
        for (gathered, _) in gathers.iter_mut().filter(|(gathered, _)| gathered.alpha.is_some()) {
            let parts = gathered.unshadowed.iter().map(|c| c.extend(0.0).to_array());
            let parts = gpu.upload("parts of the light", &parts.collect::<Vec<_>>())?;
            let shares = gpu.upload("shares", &pairs_of(gathered))?;
            self.submit(|rec| {
                guides.record(rec, &self.planes, view);
                memory.record(rec, &guides, &self.planes, (&parts, &shares), side);
            })?;
            interleave::join(&mut [gathered], &self.receivers, view, side);
            let pairs = gathered.unshadowed.iter().copied().zip(colors_of(&self.read(&parts)?));
            self.rows.push(colors(["interleave", "unshadowed"], pairs, 1e-4, 0.0));
            let found = self.read(&shares)?;
            let pairs = gathered.trust.iter().zip(&found).map(|(a, b)| (*a, b[1]));
            self.rows.push(numbers(["interleave", "trust"], pairs, (1e-3, ""), 0.0));
        }
        Ok(())
    }

    /// The smooth ratios; makes them the gathers' own.
    fn diff_filter(&mut self, gathers: &mut [(Gathered, u32)]) -> Result<(), Error> {
        let (engine, settings, view) = (self.engine, self.job.settings, self.job.view);
        let gpu = engine.gpu();
        let noisy = || (0..gathers.len()).filter(|&i| gathers[i].1 > 0);
        let uploads = noisy().map(|i| gpu.upload("noisy ratios", &pairs_of(&gathers[i].0)));
        let uploads = uploads.collect::<Result<Vec<_>, _>>()?;
        let signals = noisy().zip(&uploads);
        let signals: Vec<_> = signals
            .map(|(i, shares)| GpuNoisy { shares, frames: None, rays: gathers[i].1 })
            .collect();
        if !settings.filter.enabled || signals.is_empty() {
            return Ok(());
        }
        let noisy: Vec<_> = noisy().collect();
        let guides = Guides::new(gpu, view.width, view.height)?;
        let filter = Filter::new(gpu, gpu, view.width, view.height, signals.len())?;
        let mut smooth: &[Buf<[f32; 2]>] = &[];
        self.submit(|rec| {
            guides.record(rec, &self.planes, view);
            smooth = filter.record(rec, &guides, &signals, &settings.filter);
        })?;
        let found = smooth.iter().map(|list| self.read(list)).collect::<Result<Vec<_>, _>>()?;
        let mut clock = Clock::new(&|_, _| ());
        let seen = (&self.receivers, view);
        engine.renderer().filter_ratios(gathers, seen, settings, None, &mut clock);
        let expected = noisy.iter().flat_map(|&i| &gathers[i].0.shadow_ratio);
        let pairs = expected.zip(found.iter().flatten()).map(|(a, b)| (*a, b[0]));
        let most = most_off(gpu, &settings.filter);
        self.rows.push(numbers(["filter", "smooth ratio"], pairs, (f64::from(most), ""), 0.0));
        Ok(())
    }

    /// The layers.
    fn diff_composite(
        &mut self,
        irradiance: &[Vec3],
        gathers: &[(Gathered, u32)],
        direct_gathers: usize,
    ) -> Result<(), Error> {
        let gpu = self.engine.gpu();
        let ViewFrame { width, height, .. } = *self.job.view;
        let mut expected = Layers::new(&self.receivers, |d| self.engine.renderer().sky(d));
        expected.set_direct(irradiance);
        let on_device = GpuLayers::new(gpu, gpu, [width, height], 1)?;
        let upload = |values: &[Vec3], fourth: &dyn Fn(usize) -> f32| {
            let records: Vec<_> =
                values.iter().enumerate().map(|(i, v)| v.extend(fourth(i)).to_array()).collect();
            gpu.upload("plane to compare", &records)
        };
        let irradiance = upload(irradiance, &|_| 0.0)?;
        let mut rec = gpu.record(None);
        let is_lit = gathers.len() > direct_gathers;
        on_device.begin(&mut rec, &self.planes, &irradiance, 0, is_lit);
        for (i, (gathered, _)) in gathers.iter().enumerate() {
            let is_direct = i < direct_gathers;
            match is_direct {
                true => expected.add_direct(gathered),
                false => expected.set_indirect(gathered),
            }
            let unshadowed = upload(&gathered.unshadowed, &|i| gathered.evals[i] as f32)?;
            let ratios = gpu.upload("ratios", &pairs_of(gathered))?;
            let shadowed = upload(&gathered.shadowed, &|_| 0.0)?;
            let arriving = match gathered.shadowed.is_empty() {
                true => Arriving::Ratio(&ratios),
                false => Arriving::Exact(&shadowed),
            };
            let light = GatheredLight { unshadowed: &unshadowed, arriving, is_direct };
            on_device.add(&mut rec, &self.planes, &light);
        }
        on_device.finish(&mut rec, &self.planes);
        rec.submit().wait()?;
        let found = on_device.download(gpu, &self.planes)?;
        let beauty = colors_of(&self.read(&on_device.beauty)?);
        self.push_layers(&expected, &found, &beauty);
        Ok(())
    }

    fn push_layers(&mut self, expected: &Layers, found: &Layers, beauty: &[Vec3]) {
        let expected_beauty = expected.beauty();
        let planes = [
            ("direct", &expected.direct, &found.direct[..]),
            ("indirect", &expected.indirect, &found.indirect),
            ("unshadowed", &expected.indirect_unshadowed, &found.indirect_unshadowed),
            ("picture", &expected_beauty, beauty),
        ];
        for (what, a, b) in planes {
            let pairs = a.iter().copied().zip(b.iter().copied());
            self.rows.push(colors(["composite", what], pairs, 1e-4, 0.0));
        }
        let planes = [
            ("shadow ratio", &expected.shadow_ratio, &found.shadow_ratio, (1e-6, "")),
            ("evals", &expected.evals, &found.evals, (0.0, "lights")),
        ];
        for (what, a, b, tolerance) in planes {
            let pairs = a.iter().copied().zip(b.iter().copied());
            self.rows.push(numbers(["composite", what], pairs, tolerance, 0.0));
        }
    }
}

/// Compares what the camera sees but for its emission.
fn diff_receivers(
    expected: &Receivers,
    found: &Receivers,
    diagonal: f32,
    allowed: f64,
) -> Vec<StageDifference> {
    let name = |what| ["receivers", what];
    let mut surfaces = Tally::new(name("surface or none"), (0.0, ""));
    let mut positions = Tally::new(name("positions"), (1e-5, "of the diagonal"));
    let mut depths = Tally::new(name("depths"), (1e-5, "of the diagonal"));
    // Geometric normals are packed, to 7e-5.
    let mut geometric = Tally::new(name("geometric normals"), (2e-4, ""));
    let mut shading = Tally::new(name("shading normals"), (1e-4, ""));
    let mut albedos = Tally::new(name("albedos"), (1e-4, ""));
    let scale = f64::from(diagonal.max(f32::MIN_POSITIVE));
    for (a, b) in expected.samples.iter().zip(&found.samples) {
        surfaces.add_same(a.surface.is_some() == b.surface.is_some());
        let (depth_a, depth_b) = (a.depth, b.depth);
        let (Some(a), Some(b)) = (&a.surface, &b.surface) else { continue };
        positions.add(apart_by_axis(a.position, b.position) / scale);
        depths.add(apart(depth_a, depth_b) / scale);
        geometric.add(apart_by_axis(a.ng, b.ng));
        shading.add(apart_by_axis(a.ns, b.ns));
        albedos.add(apart_by_axis(a.albedo, b.albedo));
    }
    [surfaces, positions, depths, geometric, shading, albedos]
        .map(|tally| tally.allow(allowed))
        .into()
}

/// The first three of each.
fn colors_of(plane: &[[f32; 4]]) -> Vec<Vec3> {
    plane.iter().map(|&[x, y, z, _]| Vec3::new(x, y, z)).collect()
}

/// Ratio and trust.
fn pairs_of(gathered: &Gathered) -> Vec<[f32; 2]> {
    let trust = |i: usize| gathered.trust.get(i).copied().unwrap_or(1.0);
    gathered.shadow_ratio.iter().enumerate().map(|(i, &ratio)| [ratio, trust(i)]).collect()
}
