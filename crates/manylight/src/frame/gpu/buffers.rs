//! Everything that a frame works on, kept from frame to frame.

use super::GpuRenderer;
use super::lights::{Lights, Needs};
use crate::composite::gpu::GpuLayers;
use crate::error::Error;
use crate::filter::gpu::{Filter, Guides};
use crate::filter::interleave::gpu::Join;
use crate::gather::grid::gpu::{Gather, GatherCapacity};
use crate::gpu::{Buf, Gpu, Later, Recorder};
use crate::settings::{Method, Settings, ShadowSettings};
use crate::surface::gpu::GpuReceivers;
use std::sync::Arc;

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
    has_sky: bool,
}

impl Shape {
    fn new(size: [usize; 2], settings: &Settings, has_sky: bool) -> Self {
        Self {
            size,
            has_sky,
            method: settings.method,
            samples: settings.film.samples,
            vpls: [settings.vpls.count, settings.vpls.bounces, settings.vpls.emitter_count],
            shadow: settings.shadow.clone(),
            interleave: settings.interleave,
        }
    }

    /// Whether pixels see parts of the lights.
    fn is_interleaved(&self) -> bool {
        self.interleave > 1 && self.method != Method::Brute
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
    /// Another one whenever a list is another one.
    generation: Arc<()>,
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
    /// Those of the frame before, with new ones in the place of those that do not fit.
    ///
    /// Errors: more than the device can hold
    pub fn take(
        kept: Option<Self>,
        renderer: &GpuRenderer,
        size: [usize; 2],
        settings: &Settings,
    ) -> Result<Self, Error> {
        let emitters = &renderer.renderer().emitters;
        let shape = Shape::new(size, settings, emitters.sky.is_some());
        let has_emitters = !emitters.surface.is_empty();
        match kept {
            Some(kept) if kept.shape == shape => Ok(kept),
            Some(kept) => kept.refitted(renderer.gpu(), shape, has_emitters, settings),
            None => Self::new(renderer.gpu(), shape, has_emitters, settings),
        }
    }

    fn new(
        gpu: &Gpu,
        shape: Shape,
        has_emitters: bool,
        settings: &Settings,
    ) -> Result<Self, Error> {
        let [width, height] = shape.size;
        let lights = |on_emitters| Lights::new(gpu, on_emitters, shape.size, settings);
        let has_bounced = shape.method != Method::Direct;
        Ok(Self {
            generation: Arc::default(),
            receivers: GpuReceivers::new(gpu, width, height)?,
            irradiance: gpu.buffer("direct irradiance", width * height)?,
            sky: shape.has_sky.then(|| Part::new(gpu, shape.size)).transpose()?,
            emitted: has_emitters.then(|| lights(true)).transpose()?,
            bounced: has_bounced.then(|| lights(false)).transpose()?,
            gather: Gather::new(gpu, width, height, settings, GatherCapacity::default())?,
            guides: Guides::new(gpu, width, height)?,
            join: shape.is_interleaved().then(|| Join::new(gpu, width, height)).transpose()?,
            filter: Filter::new(gpu, width, height, 3)?,
            layers: GpuLayers::new(gpu, width, height, shape.samples)?,
            shape,
        })
    }

    /// Makes anew what another shape asks for; what it leaves as it was keeps what it has learned.
    fn refitted(
        mut self,
        gpu: &Gpu,
        shape: Shape,
        has_emitters: bool,
        settings: &Settings,
    ) -> Result<Self, Error> {
        let old = std::mem::replace(&mut self.shape, shape.clone());
        if old.size != shape.size {
            drop(self);
            return Self::new(gpu, shape, has_emitters, settings);
        }
        let [width, height] = shape.size;
        self.generation = Arc::default();
        if old.samples != shape.samples {
            self.layers = GpuLayers::new(gpu, width, height, shape.samples)?;
        }
        if old.has_sky != shape.has_sky {
            self.sky = shape.has_sky.then(|| Part::new(gpu, shape.size)).transpose()?;
        }
        if old.is_interleaved() != shape.is_interleaved() {
            let join = || Join::new(gpu, width, height);
            self.join = shape.is_interleaved().then(join).transpose()?;
        }
        if old.shadow != shape.shadow || old.interleave != shape.interleave {
            let &GatherCapacity { block_chunks, frontier, .. } = self.gather.capacity();
            let fresh = GatherCapacity::default();
            let capacity = GatherCapacity { block_chunks, frontier, ..fresh };
            self.gather = Gather::new(gpu, width, height, settings, capacity)?;
        }
        let (was_brute, is_brute) = (old.method == Method::Brute, shape.method == Method::Brute);
        let lights = |on_emitters| Lights::new(gpu, on_emitters, shape.size, settings);
        if was_brute != is_brute || old.vpls[2] != shape.vpls[2] {
            self.emitted = None;
            self.emitted = has_emitters.then(|| lights(true)).transpose()?;
        }
        if old.method != shape.method || old.vpls[..2] != shape.vpls[..2] {
            self.bounced = None;
            let has_bounced = shape.method != Method::Direct;
            self.bounced = has_bounced.then(|| lights(false)).transpose()?;
        }
        Ok(self)
    }

    /// Whether they are those of frames of a size with some settings.
    pub fn fits(&self, size: [usize; 2], settings: &Settings) -> bool {
        self.shape == Shape::new(size, settings, self.shape.has_sky)
    }

    /// Stays the same as long as every list does.
    pub fn generation(&self) -> &Arc<()> {
        &self.generation
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
        let lights = |f: fn(&Lights) -> u32| self.lights().map(|l| u64::from(f(l))).sum::<u64>();
        let vpls = |lights: &Option<Lights>| lights.as_ref().map_or(0, |l| l.info.count.into());
        match stage {
            "emitter vpls" => vpls(&self.emitted),
            "vpls" => vpls(&self.bounced),
            "grid" => lights(|l| l.grid_lights),
            _ => 0,
        }
    }

    /// Brings back what the frame recorded so far would have needed.
    pub fn record_needs(&self, rec: &mut Recorder<'_>) -> Later {
        let records: Vec<_> = self.lights().flat_map(Lights::needs_records).collect();
        rec.read_later(&records)
    }

    /// What came back.
    pub fn parse_needs(&self, mut bytes: &[u8]) -> Vec<Needs> {
        self.lights().map(|lights| lights.take_needs(&mut bytes)).collect()
    }

    /// Waits for what the last frame would have needed.
    ///
    /// Errors: what the device reported
    pub fn read_needs(&self, gpu: &Gpu) -> Result<Vec<Needs>, Error> {
        self.lights().map(|lights| lights.read_needs(gpu)).collect()
    }

    /// Makes room for what a frame would have needed; whether it lacked any.
    ///
    /// Errors: more than the device can hold
    pub fn grow(&mut self, gpu: &Gpu, settings: &Settings, needs: &[Needs]) -> Result<bool, Error> {
        let mut lacked = false;
        let mut capacity = *self.gather.capacity();
        for (lights, needs) in self.emitted.iter_mut().chain(&mut self.bounced).zip(needs) {
            lacked |= lights.grow(gpu, settings, needs)?;
            capacity = capacity.grown(&needs.gather).unwrap_or(capacity);
        }
        if capacity != *self.gather.capacity() {
            let [width, height] = self.shape.size;
            self.gather = Gather::new(gpu, width, height, settings, capacity)?;
            lacked = true;
        }
        if lacked {
            self.generation = Arc::default();
        }
        Ok(lacked)
    }

    fn lights(&self) -> impl Iterator<Item = &Lights> {
        self.emitted.iter().chain(&self.bounced)
    }
}

impl Part {
    fn new(gpu: &Gpu, [width, height]: [usize; 2]) -> Result<Self, Error> {
        Ok(Self {
            unshadowed: gpu.buffer("light of the sky", width * height)?,
            ratio: gpu.buffer("shadow ratios of the sky", width * height)?,
        })
    }
}
