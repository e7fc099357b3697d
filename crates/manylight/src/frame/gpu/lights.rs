//! A set of virtual lights of a frame with its grid and its irradiance.

use super::buffers::Buffers;
use crate::error::Error;
use crate::gather::grid::DETAIL;
use crate::gather::grid::gpu::{
    GatherInput, GatherOut, GatherStats, GpuGrid, GridBuild, GridCapacity, GridInfo, GridRules,
};
use crate::gpu::{Gpu, Recorder, take_record};
use crate::settings::{MAX_LEVELS, Method, Settings};
use crate::vlight::vpl::gpu::{EmitterTracer, GpuVpls, VplInfo, VplTracer};

/// How a set is made.
#[derive(Debug)]
enum Tracer {
    /// Points on emissive surfaces.
    Emitters(EmitterTracer),
    /// Hits of light paths.
    Paths(Box<VplTracer>),
}

/// The grid of a set and what it gives to the receivers.
#[derive(Debug)]
pub(super) struct Gathered {
    grid: GpuGrid,
    build: GridBuild,
    pub out: GatherOut,
    /// Most levels, where more would make too many grid lights.
    level_cap: u32,
}

/// What a frame would have needed of a set, and what it found.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Needs {
    vpls: VplInfo,
    grid: GridInfo,
    pub gather: GatherStats,
}

/// A set of virtual lights of a frame.
#[derive(Debug)]
pub(super) struct Lights {
    tracer: Tracer,
    pub vpls: GpuVpls,
    /// None where every light is summed up.
    pub gathered: Option<Gathered>,
    /// Of the last frame that was looked at.
    pub info: VplInfo,
    pub grid_lights: u32,
}

impl Lights {
    /// Room for about `count` lights, on emissive surfaces or from light paths.
    ///
    /// Errors: more than the device can hold
    pub fn new(
        gpu: &Gpu,
        on_emitters: bool,
        size: [usize; 2],
        settings: &Settings,
    ) -> Result<Self, Error> {
        let (count, bounces) = match on_emitters {
            true => (settings.vpls.emitter_count, 1),
            false => (settings.vpls.count, settings.vpls.bounces),
        };
        let tracer = match on_emitters {
            true => Tracer::Emitters(EmitterTracer::new(gpu, count)?),
            false => Tracer::Paths(Box::new(VplTracer::new(gpu, count, bounces)?)),
        };
        let vpls = GpuVpls::new(gpu, count, bounces)?;
        let gathered = match settings.method {
            Method::Brute => None,
            _ => Some(Gathered::new(gpu, vpls.lights.len(), size)?),
        };
        Ok(Self { tracer, vpls, gathered, info: VplInfo::default(), grid_lights: 0 })
    }

    /// Makes the set.
    pub fn trace(&self, rec: &mut Recorder<'_>, normal_maps: bool, seed: u32) {
        match &self.tracer {
            Tracer::Emitters(tracer) => tracer.record(rec, seed, &self.vpls),
            Tracer::Paths(tracer) => tracer.record(rec, normal_maps, seed, &self.vpls),
        }
    }

    /// Builds the grid.
    pub fn build(&self, rec: &mut Recorder<'_>, settings: &Settings, d_min: f32) {
        let Some(Gathered { grid, build, level_cap, .. }) = &self.gathered else { return };
        rec.stage("grid");
        let mut rules = GridRules::new(&settings.grid, DETAIL * d_min);
        rules.level_cap = *level_cap;
        build.record(rec, &self.vpls, &rules, grid);
    }

    /// Gathers from the grid.
    pub fn gather(
        &self,
        rec: &mut Recorder<'_>,
        buffers: &Buffers,
        settings: &Settings,
        d_min: f32,
        seed: u32,
    ) {
        let Some(Gathered { grid, out, .. }) = &self.gathered else { return };
        let receivers = &buffers.receivers;
        let input = GatherInput { receivers, grid, settings, d_min, seed };
        buffers.gather.record(rec, &input, out);
    }

    /// Lights of the last frame.
    ///
    /// Errors: what the device reported
    pub fn count(&self, gpu: &Gpu) -> Result<usize, Error> {
        Ok(gpu.read(&self.vpls.info, 1)?[0].count as usize)
    }

    /// Reach of the levels in the last frame; none without a grid.
    ///
    /// Errors: what the device reported
    pub fn alpha(&self, gpu: &Gpu) -> Result<Option<f32>, Error> {
        let Some(gathered) = &self.gathered else { return Ok(None) };
        let reach = gpu.read(&gathered.out.reach, 1)?[0];
        Ok((self.grid_lights > 0).then_some(reach.alpha))
    }

    /// Forgets how many levels the grid should have had at most.
    pub fn forget_levels(&mut self) {
        if let Some(gathered) = &mut self.gathered {
            gathered.level_cap = MAX_LEVELS;
        }
    }

    /// The records that tell what a frame would have needed; one record each.
    pub fn needs_records(&self) -> Vec<&wgpu::Buffer> {
        let gathered = self.gathered.iter();
        let gathered = gathered.flat_map(|g| [g.grid.info.raw(), g.out.stats.raw()]);
        [self.vpls.info.raw()].into_iter().chain(gathered).collect()
    }

    /// The same, off the front of bytes that came back.
    pub fn take_needs(&self, bytes: &mut &[u8]) -> Needs {
        let vpls = take_record(bytes);
        match self.gathered {
            None => Needs { vpls, ..Needs::default() },
            Some(_) => Needs { vpls, grid: take_record(bytes), gather: take_record(bytes) },
        }
    }

    /// Waits for what the last frame would have needed.
    ///
    /// Errors: what the device reported
    pub fn read_needs(&self, gpu: &Gpu) -> Result<Needs, Error> {
        let mut needs = Needs { vpls: gpu.read(&self.vpls.info, 1)?[0], ..Needs::default() };
        if let Some(gathered) = &self.gathered {
            needs.grid = gpu.read(&gathered.grid.info, 1)?[0];
            needs.gather = gpu.read(&gathered.out.stats, 1)?[0];
        }
        Ok(needs)
    }

    /// Makes room for what a frame would have needed; whether it lacked any.
    ///
    /// Errors: more than the device can hold
    pub fn grow(&mut self, gpu: &Gpu, settings: &Settings, needs: &Needs) -> Result<bool, Error> {
        self.info = needs.vpls;
        let mut lacked = false;
        if let Tracer::Paths(tracer) = &mut self.tracer
            && self.info.missing > 0
        {
            tracer.set_rounds(tracer.rounds().saturating_mul(2));
            lacked = true;
        }
        if let Some(gathered) = &mut self.gathered {
            self.grid_lights = needs.grid.light_count;
            lacked |= gathered.grow(gpu, &needs.grid, settings)?;
        }
        Ok(lacked)
    }
}

impl Gathered {
    fn new(gpu: &Gpu, vpls: usize, [width, height]: [usize; 2]) -> Result<Self, Error> {
        let capacity = GridCapacity::for_vpls(gpu, vpls);
        Ok(Self {
            grid: GpuGrid::new(gpu, &capacity)?,
            build: GridBuild::new(gpu, capacity)?,
            out: GatherOut::new(gpu, width, height)?,
            level_cap: MAX_LEVELS,
        })
    }

    fn grow(&mut self, gpu: &Gpu, info: &GridInfo, settings: &Settings) -> Result<bool, Error> {
        if let Some(capacity) = self.build.capacity().grown(info) {
            self.grid = GpuGrid::new(gpu, &capacity)?;
            self.build = GridBuild::new(gpu, capacity)?;
            return Ok(true);
        }
        let cap = GridRules::new(&settings.grid, 0.0).next_cap(info);
        self.level_cap = cap.unwrap_or(self.level_cap);
        Ok(cap.is_some())
    }
}
