//! Measuring the renderer: quality against the definition, ray rates.
//!
//! In: [`Renderer`], camera, [`Settings`] · Out: figures for `manylight bench`

#[cfg(feature = "gpu")]
mod gpu;

#[cfg(feature = "gpu")]
pub use gpu::GpuRayBatch;

use crate::bvh::Ray;
use crate::frame::Renderer;
use crate::gather::{brute, grid};
use crate::math::{Sequence, luminance};
use crate::settings::Settings;
use crate::shadow;
use crate::surface::{Receivers, ViewFrame};
use crate::vlight::{Vpl, vpl};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Rays of one ray-rate measurement.
const RAY_COUNT: u32 = 1 << 20;

/// Error of a gather over some receivers.
#[derive(Clone, Copy, Debug, Default)]
pub struct GatherError {
    /// √mean((Y(a) − Y(b))²) / mean(Y(b)).
    pub relative_rmse: f64,
    /// mean(Y(a) − Y(b)) / mean(Y(b)).
    pub energy_bias: f64,
}

impl GatherError {
    fn new(pairs: &[(f32, f32)]) -> Self {
        let n = pairs.len().max(1) as f64;
        let mean = pairs.iter().map(|p| f64::from(p.1)).sum::<f64>() / n;
        let difference = |p: &(f32, f32)| f64::from(p.0) - f64::from(p.1);
        let square = pairs.iter().map(|p| difference(p).powi(2)).sum::<f64>() / n;
        let bias = pairs.iter().map(difference).sum::<f64>() / n;
        Self { relative_rmse: square.sqrt() / mean, energy_bias: bias / mean }
    }
}

/// The grid against brute force over the same lights and receivers, without a filter.
#[derive(Clone, Copy, Debug)]
pub struct Quality {
    /// Lights with a contribution, mean over receivers.
    pub evals: f64,
    /// Irradiance without visibility.
    pub unshadowed: GatherError,
    /// Irradiance with visibility.
    pub shadowed: GatherError,
    /// Share of the shadowed irradiance of all lights that the distance clamp removes.
    pub clamp_loss: f64,
    /// Reach of the levels.
    pub alpha: Option<f32>,
    /// Grid lights over all levels.
    pub grid_lights: usize,
    /// Levels.
    pub levels: usize,
    /// Virtual lights.
    pub vpls: usize,
}

/// The bounced virtual lights of a frame.
pub fn trace_vpls(renderer: &Renderer, settings: &Settings) -> Vec<Vpl> {
    let (count, bounces) = (settings.vpls.count, settings.vpls.bounces);
    let maps = settings.surface.normal_maps;
    vpl::trace(&renderer.world, &renderer.emitters, count, bounces, settings.seed, maps).lights
}

/// Random receivers of a picture, as a picture of one row.
fn random_receivers(
    renderer: &Renderer,
    camera: &manylight_scene::Camera,
    size: [usize; 2],
    settings: &Settings,
    count: usize,
) -> Receivers {
    let view = ViewFrame::new(camera, size[0], size[1]);
    let all =
        Receivers::trace(&renderer.world, &view, Vec2::splat(0.5), settings.surface.normal_maps);
    let mut samples = Vec::new();
    for i in 0..count as u32 * 8 {
        let u = Sequence::new(settings.seed ^ 77, i).next_2d();
        let (x, y) = ((u[0] * size[0] as f32) as usize, (u[1] * size[1] as f32) as usize);
        let sample = all.samples[y * size[0] + x];
        if sample.surface.is_some_and(|s| s.albedo != Vec3::ZERO) && samples.len() < count {
            samples.push(sample);
        }
    }
    // One receiver per tile, as its neighbors in a picture would not be random.
    let width = grid::TILE;
    let mut spread = Vec::new();
    for sample in samples {
        let sky = crate::surface::PixelSample { surface: None, ..sample };
        spread.push(sample);
        spread.extend(std::iter::repeat_n(sky, width * width - 1));
    }
    // Rows of a tile lie below each other: one column of tiles.
    Receivers { width, height: spread.len() / width, samples: spread }
}

/// Judges the grid against brute force on random receivers of a picture.
///
/// Cost: receivers × lights shadow rays
pub fn quality(
    renderer: &Renderer,
    camera: &manylight_scene::Camera,
    size: [usize; 2],
    settings: &Settings,
    receiver_count: usize,
) -> Quality {
    let lights = trace_vpls(renderer, settings);
    let receivers = random_receivers(renderer, camera, size, settings, receiver_count);
    let d_min = renderer.d_min(settings);
    let lighting_grid = grid::LightingGrid::build(&lights, &settings.grid, grid::DETAIL * d_min);
    let gathered =
        grid::gather(&renderer.world, &receivers, &lighting_grid, settings, d_min, settings.seed);
    let lit: Vec<usize> =
        (0..receivers.samples.len()).filter(|&i| receivers.samples[i].surface.is_some()).collect();
    let truth: Vec<brute::BruteSum> = lit
        .par_iter()
        .filter_map(|&i| {
            let surface = receivers.samples[i].surface.as_ref()?;
            Some(brute::sum(&renderer.world, surface, &lights, d_min))
        })
        .collect();
    let pairs = |shadowed: bool| -> Vec<(f32, f32)> {
        let pair = |(&i, truth): (&usize, &brute::BruteSum)| {
            let ratio = if shadowed { gathered.shadow_ratio[i] } else { 1.0 };
            let sum = if shadowed { truth.shadowed } else { truth.unshadowed };
            (luminance(gathered.unshadowed[i]) * ratio, luminance(sum))
        };
        lit.iter().zip(&truth).map(pair).collect()
    };
    let total = |of: fn(&brute::BruteSum) -> Vec3| -> f64 {
        truth.iter().map(|t| f64::from(luminance(of(t)))).sum::<f64>()
    };
    let (kept, unclamped) = (total(|t| t.shadowed), total(|t| t.unclamped));
    let evals = lit.iter().map(|&i| f64::from(gathered.evals[i])).sum::<f64>();
    Quality {
        evals: evals / lit.len().max(1) as f64,
        unshadowed: GatherError::new(&pairs(false)),
        shadowed: GatherError::new(&pairs(true)),
        clamp_loss: if unclamped > 0.0 { 1.0 - kept / unclamped } else { 0.0 },
        alpha: gathered.alpha,
        grid_lights: lighting_grid.light_count(),
        levels: lighting_grid.levels.len(),
        vpls: lights.len(),
    }
}

/// Incoherent shadow rays: random receivers of a picture to random virtual lights.
#[derive(Debug)]
pub struct RayBatch {
    rays: Vec<Ray>,
}

impl RayBatch {
    /// Makes the rays of a picture.
    pub fn new(
        renderer: &Renderer,
        camera: &manylight_scene::Camera,
        [width, height]: [usize; 2],
        settings: &Settings,
    ) -> Self {
        let lights = trace_vpls(renderer, settings);
        let view = ViewFrame::new(camera, width, height);
        let receivers = Receivers::trace(&renderer.world, &view, Vec2::splat(0.5), true);
        let ray = |i: u32| {
            let mut sequence = Sequence::new(settings.seed ^ 99, i);
            let [x, y] = sequence.next_2d();
            let pixel = (y * height as f32) as usize * width + (x * width as f32) as usize;
            let surface = receivers.samples[pixel].surface.as_ref()?;
            let light = lights.get((sequence.next_1d() * lights.len() as f32) as usize)?;
            let origin = surface.ray_origin(&renderer.world);
            let target = light.position + light.normal * renderer.world.ray_offset(light.position);
            let direction = target - origin;
            Some(Ray { origin, direction, t_max: shadow::SEGMENT_END })
        };
        Self { rays: (0..RAY_COUNT).into_par_iter().filter_map(ray).collect() }
    }

    /// Number of rays.
    pub fn len(&self) -> usize {
        self.rays.len()
    }

    /// Whether the picture saw nothing.
    pub fn is_empty(&self) -> bool {
        self.rays.is_empty()
    }

    /// Traces all rays; how many were stopped.
    pub fn trace(&self, renderer: &Renderer) -> usize {
        self.rays.par_iter().with_min_len(4096).filter(|ray| renderer.world.occluded(ray)).count()
    }

    /// Origin, 0, direction, end of each ray, for other renderers.
    pub fn to_floats(&self) -> Vec<f32> {
        let floats = |r: &Ray| {
            let (o, d) = (r.origin, r.direction);
            [o.x, o.y, o.z, 0.0, d.x, d.y, d.z, r.t_max]
        };
        self.rays.iter().flat_map(floats).collect()
    }

    /// Corners of all triangles, for other renderers.
    pub fn triangles(&self, renderer: &Renderer) -> Vec<f32> {
        let world = &renderer.world;
        let instances = 0..world.scene.instances.len() as u32;
        instances
            .flat_map(|i| (0..world.mesh_of(i).triangles.len() as u32).map(move |t| (i, t)))
            .flat_map(|(i, t)| world.corners(i, t))
            .flat_map(|p| p.to_array())
            .collect()
    }
}
