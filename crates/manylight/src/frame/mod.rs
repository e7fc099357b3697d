//! The corridor: one function that reads as the list of stages.
//!
//! In: [`Scene`], camera, [`Settings`] · Out: [`Frame`]

#[cfg(feature = "gpu")]
pub mod gpu;
mod layers;
mod sequence;
mod stage;

pub use sequence::Past;
pub use stage::{Progress, Stage};

use crate::composite::Layers;
use crate::direct;
use crate::emitter::{Emitters, SkyEmitter};
use crate::error::Error;
use crate::filter::temporal::{self, Accumulated, History};
use crate::filter::{self, Noisy};
use crate::gather::{Gathered, brute, grid};
use crate::math::{Sequence, hash_u32, morton_2d};
use crate::reference::{PIXEL_KEY, PathTracer};
use crate::settings::{Method, Settings, VplSettings};
use crate::surface::{Receivers, ViewFrame};
use crate::vlight::vpl;
use crate::world::World;
use glam::{Vec2, Vec3};
use manylight_scene::{Camera, MAX_PIXELS, Scene, Sky};
use rayon::prelude::*;
use sequence::{Moment, noise};
use stage::Clock;
use std::sync::Arc;

/// Sky rays per receiver of the brute method.
const BRUTE_SKY_RAYS: u32 = 256;
/// Share of the diagonal, and most metres, of the default distance clamp.
const DEFAULT_D_MIN: (f32, f32) = (0.01, 0.15);

/// A scene prepared for rendering: build once, render many frames.
#[derive(Debug)]
pub struct Renderer {
    /// Geometry and hierarchies.
    pub world: World,
    /// Sources of light.
    pub emitters: Emitters,
    /// Another one in every renderer.
    identity: Arc<()>,
}

/// One sample of a picture, as far as it is not the view's.
#[derive(Clone, Copy)]
struct Sample<'a> {
    settings: &'a Settings,
    /// Position among the samples of a pixel.
    index: u32,
    /// Mixed into the seeds of what differs from frame to frame.
    noise: u32,
}

/// A finished picture.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The picture and its parts.
    pub layers: Layers,
    /// What each stage took and counted, in order. On a graphics device those that ran, by its own
    /// clock: not the making of lights and grids that were kept, and none without such a clock or
    /// with `gpu.timestamps` off.
    pub stages: Vec<Stage>,
    /// The distance clamp that was used, metres.
    pub d_min: f32,
    /// The alpha that gathered the bounced light, of the last sample; none without a grid.
    pub alpha: Option<f32>,
}

impl Renderer {
    /// Prepares a scene.
    ///
    /// Errors: a scene without triangles or without any light
    pub fn new(scene: Scene) -> Result<Self, Error> {
        let world = World::new(scene)?;
        let emitters = Emitters::new(&world);
        if emitters.is_dark() {
            return Err(nothing_shines(&world.scene.name));
        }
        Ok(Self { world, emitters, identity: Arc::default() })
    }

    /// The distance clamp of a render, metres.
    pub fn d_min(&self, settings: &Settings) -> f32 {
        let (share, most) = DEFAULT_D_MIN;
        settings.vpls.d_min.unwrap_or_else(|| (self.world.diagonal() * share).min(most))
    }

    /// Renders one picture.
    ///
    /// The same seed gives the same bits at any thread count.
    /// Errors: a setting outside its range, a size without pixels or above [`MAX_PIXELS`]
    pub fn render(
        &self,
        camera: &Camera,
        [width, height]: [usize; 2],
        settings: &Settings,
        progress: Progress<'_>,
    ) -> Result<Frame, Error> {
        settings.validate()?;
        check_size([width, height])?;
        let view = ViewFrame::new(camera, width, height);
        Ok(self.render_view(&view, settings, (0, None), progress))
    }

    /// Renders the next frame of a sequence.
    ///
    /// Without `filter.temporal` it is the picture of [`Renderer::render`]. With it, light paths
    /// stay where they are, shadow rays have random numbers of their own in each frame, by its
    /// number, and their ratios are added to those of the frames before: the same bits for the same
    /// frames since the past was empty. It is forgotten at cuts (a turn of 30°, a twentieth of the
    /// scene's diagonal) and where scene, size or settings change.
    /// Errors: as [`Renderer::render`]
    pub fn render_next(
        &self,
        camera: &Camera,
        [width, height]: [usize; 2],
        settings: &Settings,
        frame: u32,
        past: &mut Past,
        progress: Progress<'_>,
    ) -> Result<Frame, Error> {
        settings.validate()?;
        check_size([width, height])?;
        let view = ViewFrame::new(camera, width, height);
        if !settings.adds_up() {
            past.clear();
            return Ok(self.render_view(&view, settings, (0, None), progress));
        }
        past.go_on(self.moment(&view, settings));
        let history = Some(&mut past.history);
        Ok(self.render_view(&view, settings, (noise(frame), history), progress))
    }

    fn moment(&self, view: &ViewFrame, settings: &Settings) -> Moment {
        Moment::new((&self.identity, self.world.diagonal()), view, settings)
    }

    /// All samples of a picture, with a frame's noise and what it adds its ratios to.
    fn render_view(
        &self,
        view: &ViewFrame,
        settings: &Settings,
        (noise, mut history): (u32, Option<&mut History>),
        progress: Progress<'_>,
    ) -> Frame {
        let mut clock = Clock::new(progress);
        let samples = if settings.method == Method::Path { 1 } else { settings.film.samples };
        let mut sum: Option<Layers> = None;
        let mut last_alpha = None;
        let weight = 1.0 / samples as f32;
        for index in 0..samples {
            let sample = Sample { settings, index, noise };
            let (layers, alpha) = match settings.method {
                Method::Path => (self.path_layers(view, settings, &mut clock), None),
                _ => self.vpl_layers(view, sample, history.as_deref_mut(), &mut clock),
            };
            last_alpha = alpha;
            match &mut sum {
                None if samples == 1 => sum = Some(layers),
                None => sum = Some(layers.scaled(weight)),
                Some(sum) => sum.add_weighted(&layers, weight),
            }
        }
        let layers = sum.unwrap_or_default();
        let stages = clock.finish();
        Frame { layers, stages, d_min: self.d_min(settings), alpha: last_alpha }
    }

    /// One sample of the methods that use virtual lights, and the alpha of its bounced light.
    fn vpl_layers(
        &self,
        view: &ViewFrame,
        Sample { settings, index, noise }: Sample<'_>,
        history: Option<&mut History>,
        clock: &mut Clock<'_>,
    ) -> (Layers, Option<f32>) {
        let (world, emitters) = (&self.world, &self.emitters);
        let normal_maps = settings.surface.normal_maps;
        let seed = hash_u32(settings.seed ^ hash_u32(index));
        // Lights stay where they are, the rays that ask for their shadows do not.
        let draws = seed ^ noise;
        let d_min = self.d_min(settings);
        let jitter = Vec2::from_array(Sequence::new(settings.seed, index).next_2d());
        let offset_px = if settings.film.samples == 1 { Vec2::splat(0.5) } else { jitter };

        let receivers = clock.run("receivers", || {
            let receivers = Receivers::trace(world, view, offset_px, normal_maps);
            let count = receivers.samples.iter().filter(|s| s.surface.is_some()).count();
            (receivers, count as u64)
        });
        let mut layers = Layers::new(&receivers, |d| self.sky(d));

        let direct = clock.run("direct", || {
            let direct = self.light_irradiance(&receivers, seed);
            (direct, emitters.lights.len() as u64)
        });
        layers.set_direct(&direct);
        // Irradiance whose shadow ratio a few rays made, and their number.
        let mut gathers = Vec::new();
        if let Some(sky) = &emitters.sky {
            gathers.push(self.gather_sky(sky, &receivers, settings, draws ^ 5, clock));
        }

        let on_emitters = clock.run("emitter vpls", || {
            let set = vpl::trace_emitters(world, emitters, settings.vpls.emitter_count, seed ^ 1);
            let count = set.lights.len() as u64;
            (set, count)
        });
        if !on_emitters.lights.is_empty() {
            let lights = &on_emitters.lights;
            gathers.push(self.gather(&receivers, lights, settings, d_min, draws ^ 2, clock));
        }
        let direct_gathers = gathers.len();
        if settings.method != Method::Direct {
            let vpls = self.trace_vpls(settings, seed ^ 3, clock);
            gathers.push(self.gather(&receivers, &vpls, settings, d_min, draws ^ 4, clock));
        }

        if settings.method != Method::Brute && settings.interleave > 1 {
            clock.run("interleave", || {
                // Not the sky, whose light is no sum over virtual lights.
                let parts = gathers.iter_mut().filter(|(gathered, _)| gathered.alpha.is_some());
                let mut parts: Vec<_> = parts.map(|(gathered, _)| gathered).collect();
                filter::interleave::join(&mut parts, &receivers, view, settings.interleave);
                ((), u64::from(settings.interleave))
            });
        }
        let past = history.map(|history| (history, offset_px));
        self.filter_ratios(&mut gathers, (&receivers, view), settings, past, clock);
        let (on_direct, on_indirect) = gathers.split_at(direct_gathers);
        on_direct.iter().for_each(|(gathered, _)| layers.add_direct(gathered));
        on_indirect.iter().for_each(|(gathered, _)| layers.set_indirect(gathered));
        (layers, on_indirect.iter().find_map(|(gathered, _)| gathered.alpha))
    }

    /// Virtual lights on what light paths hit.
    fn trace_vpls(&self, settings: &Settings, seed: u32, clock: &mut Clock<'_>) -> Vec<vpl::Vpl> {
        clock.run("vpls", || {
            let VplSettings { count, bounces, .. } = settings.vpls;
            let normal_maps = settings.surface.normal_maps;
            let set = vpl::trace(&self.world, &self.emitters, count, bounces, seed, normal_maps);
            let count = set.lights.len() as u64;
            (set.lights, count)
        })
    }

    /// Irradiance of a set of virtual lights at the receivers, and the rays behind its ratio; none
    /// where it is exact.
    fn gather(
        &self,
        receivers: &Receivers,
        lights: &[vpl::Vpl],
        settings: &Settings,
        d_min: f32,
        seed: u32,
        clock: &mut Clock<'_>,
    ) -> (Gathered, u32) {
        if settings.method == Method::Brute {
            return (self.gather_brute(receivers, lights, d_min, clock), 0);
        }
        let lighting_grid = clock.run("grid", || {
            let grid = grid::LightingGrid::build(lights, &settings.grid, grid::DETAIL * d_min);
            let count = grid.light_count() as u64;
            (grid, count)
        });
        let gathered = clock.run("lighting", || {
            let gathered =
                grid::gather(&self.world, receivers, &lighting_grid, settings, d_min, seed);
            let evals = gathered.evals.iter().map(|&e| u64::from(e)).sum();
            (gathered, evals)
        });
        (gathered, settings.shadow.rays)
    }

    fn gather_brute(
        &self,
        receivers: &Receivers,
        lights: &[vpl::Vpl],
        d_min: f32,
        clock: &mut Clock<'_>,
    ) -> Gathered {
        let count = receivers.samples.len();
        clock.run_rows("brute", receivers.height, |tick| {
            let sum = |i: usize| {
                let surface = receivers.samples[i].surface.as_ref()?;
                let sum = brute::sum(&self.world, surface, lights, d_min);
                tick(1.0 / receivers.width as f64);
                Some(sum)
            };
            let sums: Vec<_> = (0..count).into_par_iter().map(sum).collect();
            let mut gathered = Gathered::dark(count);
            let sums: Vec<_> = sums.into_iter().map(Option::unwrap_or_default).collect();
            gathered.evals.iter_mut().zip(&sums).for_each(|(evals, sum)| *evals = sum.evals);
            gathered.set_exact(sums.iter().map(|sum| [sum.unshadowed, sum.shadowed]));
            (gathered, lights.len() as u64)
        })
    }

    /// Irradiance from sun, point and spot lights.
    fn light_irradiance(&self, receivers: &Receivers, seed: u32) -> Vec<Vec3> {
        let at = |i: usize| {
            let Some(surface) = &receivers.samples[i].surface else { return Vec3::ZERO };
            let mut sequence = Sequence::new(hash_u32(seed ^ hash_u32(i as u32)), 0);
            direct::from_lights(&self.world, &self.emitters, surface, &mut sequence)
        };
        (0..receivers.samples.len()).into_par_iter().with_min_len(512).map(at).collect()
    }

    /// Irradiance from the sky, and the rays behind its ratio; none where they are enough.
    fn gather_sky(
        &self,
        sky: &SkyEmitter,
        receivers: &Receivers,
        settings: &Settings,
        seed: u32,
        clock: &mut Clock<'_>,
    ) -> (Gathered, u32) {
        let rays = match settings.method {
            Method::Brute => BRUTE_SKY_RAYS,
            _ => settings.shadow.rays.div_ceil(2).max(1),
        };
        let is_constant = matches!(self.world.scene.sky, Some(Sky::Constant(_)));
        let count = receivers.samples.len();
        let gathered = clock.run("sky", || {
            let at = |i: usize| {
                let surface = receivers.samples[i].surface.as_ref()?;
                // Neighbors share one sequence, as the draws of the grid do.
                let (x, y) = ((i % receivers.width) as u32, (i / receivers.width) as u32);
                let first = morton_2d(x, y).wrapping_mul(rays);
                let sequences = (0..rays).map(|ray| Sequence::new(seed, first.wrapping_add(ray)));
                Some(direct::from_sky(&self.world, sky, surface, sequences, is_constant))
            };
            let found: Vec<_> = (0..count).into_par_iter().with_min_len(512).map(at).collect();
            let mut gathered = Gathered::dark(count);
            gathered.set_exact(found.into_iter().map(Option::unwrap_or_default));
            (gathered, u64::from(rays))
        });
        (gathered, if settings.method == Method::Brute { 0 } else { rays })
    }

    /// Adds the ratios that few rays made to those of the past, if any, seen through points of the
    /// pixels, and smooths them, all at once.
    fn filter_ratios(
        &self,
        gathers: &mut [(Gathered, u32)],
        (receivers, view): (&Receivers, &ViewFrame),
        settings: &Settings,
        past: Option<(&mut History, Vec2)>,
        clock: &mut Clock<'_>,
    ) {
        let mut noisy: Vec<_> = gathers.iter_mut().filter(|(_, rays)| *rays > 0).collect();
        if !settings.filter.enabled || noisy.is_empty() {
            return;
        }
        clock.run("filter", || {
            let mut ratios: Vec<_> = noisy
                .iter()
                .map(|(Gathered { shadow_ratio: ratio, trust, .. }, rays)| Noisy {
                    ratio,
                    trust,
                    frames: &[],
                    rays: *rays,
                })
                .collect();
            if let Some((history, offset_px)) = past {
                let filter = &settings.filter;
                let several =
                    temporal::accumulate(&ratios, receivers, view, offset_px, history, filter);
                ratios = several.iter().map(Accumulated::noisy).collect();
            }
            let smooth = filter::atrous(&ratios, receivers, view, &settings.filter);
            for ((gathered, _), ratio) in noisy.iter_mut().zip(smooth) {
                gathered.shadow_ratio = ratio;
                gathered.shadowed.clear();
            }
            ((), u64::from(settings.filter.passes))
        });
    }

    /// The reference: every pixel by paths.
    fn path_layers(&self, view: &ViewFrame, settings: &Settings, clock: &mut Clock<'_>) -> Layers {
        let normal_maps = settings.surface.normal_maps;
        let receivers = Receivers::trace(&self.world, view, Vec2::splat(0.5), normal_maps);
        let mut layers = Layers::new(&receivers, |d| self.sky(d));
        let tracer = PathTracer {
            world: &self.world,
            emitters: &self.emitters,
            bounces: settings.vpls.bounces,
            normal_maps,
        };
        let spp = settings.path.spp;
        let pixels = clock.run_rows("paths", view.height, |tick| {
            let pixel = |i: usize| {
                let seed = hash_u32(settings.seed ^ hash_u32(i as u32 ^ PIXEL_KEY));
                let mut sums = [glam::DVec3::ZERO; 3];
                for s in 0..spp {
                    let (x, y) = (i % view.width, i / view.width);
                    let path = tracer.trace(view, x, y, Sequence::new(seed, s));
                    for (sum, part) in
                        sums.iter_mut().zip([path.emission, path.direct, path.indirect])
                    {
                        *sum += part.as_dvec3();
                    }
                }
                tick(1.0 / view.width as f64);
                sums.map(|s| (s / f64::from(spp)).as_vec3())
            };
            let pixels: Vec<[Vec3; 3]> =
                (0..view.width * view.height).into_par_iter().map(pixel).collect();
            (pixels, u64::from(spp) * (view.width * view.height) as u64)
        });
        for (i, [emission, direct, indirect]) in pixels.into_iter().enumerate() {
            layers.emission[i] = emission;
            layers.direct[i] = direct;
            layers.indirect[i] = indirect;
            layers.indirect_unshadowed[i] = indirect;
        }
        layers
    }

    fn sky(&self, direction: Vec3) -> Vec3 {
        self.emitters.sky.as_ref().map_or(Vec3::ZERO, |s| s.radiance(direction))
    }
}

fn nothing_shines(scene: &str) -> Error {
    let problem = "nothing in it shines; add a light, a sky or an emissive material".to_owned();
    Error::Scene { scene: scene.to_owned(), problem }
}

/// Errors: a size without pixels or above [`MAX_PIXELS`]
fn check_size([width, height]: [usize; 2]) -> Result<(), Error> {
    if width > 0 && height > 0 && width.saturating_mul(height) <= MAX_PIXELS {
        return Ok(());
    }
    let problem = format!("{width}x{height} is empty or above {MAX_PIXELS} pixels");
    Err(Error::Setting { path: "size".to_owned(), problem })
}

#[cfg(test)]
mod sequence_tests;
#[cfg(test)]
mod tests;
