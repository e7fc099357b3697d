//! Everything that a frame works on, kept from frame to frame.

use super::GpuRenderer;
use super::lights::Lights;
use crate::composite::gpu::GpuLayers;
use crate::error::Error;
use crate::filter::gpu::{Filter, Guides};
use crate::filter::interleave::gpu::Join;
use crate::gather::grid::gpu::{Gather, GatherCapacity};
use crate::gpu::{Buf, Gpu};
use crate::settings::{Method, Settings, ShadowSettings};
use crate::surface::gpu::GpuReceivers;

/// What buffers are made for; where it changes they are made anew.
#[derive(Clone, Debug, PartialEq)]
struct Shape {
    size: [usize; 2],
    method: Method,
    samples: u32,
    /// Virtual lights, bounces, virtual lights on emitters.
    vpls: [u32; 3],
    shadow: ShadowSettings,
    interleave: u32,
}

impl Shape {
    fn new(size: [usize; 2], settings: &Settings) -> Self {
        Self {
            size,
            method: settings.method,
            samples: settings.film.samples,
            vpls: [settings.vpls.count, settings.vpls.bounces, settings.vpls.emitter_count],
            shadow: settings.shadow.clone(),
            interleave: settings.interleave,
        }
    }
}

/// Light that few rays shadow.
#[derive(Debug)]
pub(super) struct Part {
    pub unshadowed: Buf<[f32; 4]>,
    pub ratio: Buf<[f32; 2]>,
}

/// What one gather of a frame gave.
#[derive(Clone, Copy)]
pub(super) struct GatherRef<'a> {
    pub unshadowed: &'a Buf<[f32; 4]>,
    pub ratio: &'a Buf<[f32; 2]>,
    /// Rays behind a ratio; 0 where it is no estimate.
    pub rays: u32,
    /// Whether the lights are sources.
    pub is_direct: bool,
}

/// The buffers of a frame.
#[derive(Debug)]
pub(super) struct Buffers {
    shape: Shape,
    pub receivers: GpuReceivers,
    /// From sun, point and spot lights.
    pub irradiance: Buf<[f32; 4]>,
    pub sky: Option<Part>,
    /// Lights on emissive surfaces, where there are any.
    pub emitted: Option<Lights>,
    /// Lights on what light paths hit, unless direct light is all that is asked for.
    pub bounced: Option<Lights>,
    /// Shared by the gathers, one after another.
    pub gather: Gather,
    pub guides: Guides,
    /// Where pixels see parts of the lights.
    pub join: Option<Join>,
    pub filter: Filter,
    pub layers: GpuLayers,
}

impl Buffers {
    /// Those of the frame before where they fit, else new ones.
    ///
    /// Errors: more than the device can hold
    pub fn take(
        kept: Option<Self>,
        renderer: &GpuRenderer,
        size: [usize; 2],
        settings: &Settings,
    ) -> Result<Self, Error> {
        let shape = Shape::new(size, settings);
        if let Some(kept) = kept.filter(|kept| kept.shape == shape) {
            return Ok(kept);
        }
        let (gpu, [width, height]) = (renderer.gpu(), size);
        let emitters = &renderer.renderer().emitters;
        let has_sky = emitters.sky.is_some();
        let has_emitters = !emitters.surface.is_empty();
        let part = || -> Result<_, Error> {
            Ok(Part {
                unshadowed: gpu.buffer("light of the sky", width * height)?,
                ratio: gpu.buffer("shadow ratios of the sky", width * height)?,
            })
        };
        let lights = |on_emitters| Lights::new(gpu, on_emitters, size, settings);
        let has_bounced = settings.method != Method::Direct;
        let is_interleaved = settings.interleave > 1 && settings.method != Method::Brute;
        Ok(Self {
            receivers: GpuReceivers::new(gpu, width, height)?,
            irradiance: gpu.buffer("direct irradiance", width * height)?,
            sky: has_sky.then(part).transpose()?,
            emitted: has_emitters.then(|| lights(true)).transpose()?,
            bounced: has_bounced.then(|| lights(false)).transpose()?,
            gather: Gather::new(gpu, width, height, settings, GatherCapacity::default())?,
            guides: Guides::new(gpu, width, height)?,
            join: is_interleaved.then(|| Join::new(gpu, width, height)).transpose()?,
            filter: Filter::new(gpu, width, height, 3)?,
            layers: GpuLayers::new(gpu, width, height, settings.film.samples)?,
            shape,
        })
    }

    /// Whether they are those of frames of a size with some settings.
    pub fn fits(&self, size: [usize; 2], settings: &Settings) -> bool {
        self.shape == Shape::new(size, settings)
    }

    /// The gathers of a frame of the grid method, in the order of their light's way.
    pub fn gathers(&self, settings: &Settings) -> Vec<GatherRef<'_>> {
        let rays = settings.shadow.rays;
        let sky = self.sky.as_ref().map(|part| GatherRef {
            unshadowed: &part.unshadowed,
            ratio: &part.ratio,
            rays: super::sky_rays(settings),
            is_direct: true,
        });
        let lights = [(&self.emitted, true), (&self.bounced, false)];
        let lights = lights.into_iter().filter_map(|(lights, is_direct)| {
            let out = &lights.as_ref()?.gathered.as_ref()?.out;
            Some(GatherRef { unshadowed: &out.unshadowed, ratio: &out.ratio, rays, is_direct })
        });
        sky.into_iter().chain(lights).collect()
    }

    /// What a stage of the last frame made, as far as that was read back.
    pub fn count_of(&self, stage: &str) -> u64 {
        let lights = |f: fn(&Lights) -> u32| {
            self.emitted.iter().chain(&self.bounced).map(|l| u64::from(f(l))).sum::<u64>()
        };
        let vpls = |lights: &Option<Lights>| lights.as_ref().map_or(0, |l| l.info.count.into());
        match stage {
            "emitter vpls" => vpls(&self.emitted),
            "vpls" => vpls(&self.bounced),
            "grid" => lights(|l| l.grid_lights),
            _ => 0,
        }
    }

    /// Makes room for what the last frame lacked; whether it lacked any.
    ///
    /// Errors: more than the device can hold
    pub fn grow(&mut self, gpu: &Gpu, settings: &Settings) -> Result<bool, Error> {
        let mut lacked = false;
        let mut capacity = *self.gather.capacity();
        for lights in self.emitted.iter_mut().chain(&mut self.bounced) {
            lacked |= lights.grow(gpu, settings)?;
            if let Some(gathered) = &lights.gathered {
                let stats = gpu.read(&gathered.out.stats, 1)?[0];
                capacity = capacity.grown(&stats).unwrap_or(capacity);
            }
        }
        if capacity != *self.gather.capacity() {
            let [width, height] = self.shape.size;
            self.gather = Gather::new(gpu, width, height, settings, capacity)?;
            lacked = true;
        }
        Ok(lacked)
    }
}
