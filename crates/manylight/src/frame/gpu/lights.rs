//! A set of virtual lights of a frame with its grid and its irradiance.

use super::buffers::Buffers;
use crate::error::Error;
use crate::gather::grid::DETAIL;
use crate::gather::grid::gpu::{
    GatherInput, GatherOut, GatherStats, GpuGrid, GridBuild, GridCapacity, GridInfo, GridRules,
    Reach, fine_levels,
};
#[cfg(debug_assertions)]
use crate::gpu::Suspect;
use crate::gpu::{Buf, Gpu, Memory, Pool, Recorder, take_record};
use crate::settings::{GridSettings, MAX_LEVELS, Method, Settings};
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
    /// Of the last grid that was looked at.
    fine: Option<FineLevels>,
}

/// What of a set stays where all that depends on the picture is made anew.
#[derive(Debug)]
pub(super) struct Built {
    info: Buf<VplInfo>,
    grid: GpuGrid,
    fine: Option<FineLevels>,
    /// Rounds that light paths have taken at most.
    most_rounds: u32,
}

/// How many levels of a grid were fine, see [`GridRules::fine_levels`], and what a grid must share
/// with it to have as many.
#[derive(Debug)]
struct FineLevels {
    count: u32,
    grid: GridSettings,
    d_min: Option<f32>,
    level_cap: u32,
}

/// What a set has room for, as far as frames have told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SetRoom {
    grid: Option<GridCapacity>,
    /// Rounds of light paths, where there were once too few.
    rounds: Option<u32>,
    /// Most that any light's paths have taken.
    most_rounds: u32,
    /// Most levels, where more would make too many grid lights.
    level_cap: Option<u32>,
}

impl SetRoom {
    /// Forgets how many levels the grid should have had at most.
    pub fn forget_levels(&mut self) {
        self.level_cap = None;
    }
}

/// What a frame would have needed of a set, and what it found.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Needs {
    pub vpls: VplInfo,
    grid: GridInfo,
    pub gather: GatherStats,
    reach: Reach,
}

/// What a frame lacked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Lack {
    Nothing,
    /// Something that the next frame does by itself.
    Work,
    /// Room in its lists.
    Memory,
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
    reach: Reach,
}

impl Lights {
    /// Memory for a set on emissive surfaces or from light paths; `pool` for what is needed only
    /// until there is a grid. A grid that was built stays what it is.
    ///
    /// Errors: more than the device can hold
    pub fn new(
        gpu: &Gpu,
        pool: &Pool<'_>,
        on_emitters: bool,
        size: [usize; 2],
        settings: &Settings,
        (room, built): (&SetRoom, Option<Built>),
    ) -> Result<Self, Error> {
        let (count, bounces) = match on_emitters {
            true => (settings.vpls.emitter_count, 1),
            false => (settings.vpls.count, settings.vpls.bounces),
        };
        let making = pool.phase();
        let most_rounds =
            built.as_ref().map(|built| built.most_rounds).filter(|&rounds| rounds > 0);
        let (vpls, gathered) = match settings.method {
            Method::Brute => (GpuVpls::new(gpu, count, bounces)?, None),
            _ => {
                let mut vpls = GpuVpls::new(&making, count, bounces)?;
                let grid = built.map(|Built { info, grid, fine, .. }| {
                    vpls.info = info;
                    (grid, fine)
                });
                let most = vpls.lights.len();
                let gathered = Gathered::new(gpu, &making.clone(), most, size, room, grid)?;
                (vpls, Some(gathered))
            }
        };
        let tracer = match on_emitters {
            true => Tracer::Emitters(EmitterTracer::new(&making, count)?),
            false => {
                let mut tracer = VplTracer::new(&making, count, bounces)?;
                tracer.recall_rounds(room.most_rounds);
                room.rounds.into_iter().for_each(|rounds| tracer.raise_rounds(rounds));
                most_rounds.into_iter().for_each(|rounds| tracer.learn_rounds(rounds));
                Tracer::Paths(Box::new(tracer))
            }
        };
        let (info, reach) = (VplInfo::default(), Reach::default());
        Ok(Self { tracer, vpls, gathered, info, grid_lights: 0, reach })
    }

    /// Its grid and what tells of it, where there is a grid; all else is let go.
    pub fn into_built(self) -> Option<Built> {
        let Gathered { grid, fine, .. } = self.gathered?;
        let most_rounds = match self.tracer {
            Tracer::Emitters(_) => 0,
            Tracer::Paths(tracer) => tracer.most_taken()[0],
        };
        Some(Built { info: self.vpls.info, grid, fine, most_rounds })
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
        let Some(gathered) = &self.gathered else { return };
        rec.stage("grid");
        let mut rules = GridRules::new(&settings.grid, DETAIL * d_min);
        rules.level_cap = gathered.level_cap;
        rules.fine_levels = gathered.fine_levels(settings);
        gathered.build.record(rec, &self.vpls, &rules, &gathered.grid);
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
        buffers.work.gather.record(rec, &input, out);
    }

    /// Reach of the levels in the last frame that was looked at; none without a grid.
    pub fn alpha(&self) -> Option<f32> {
        (self.grid_lights > 0).then_some(self.reach.alpha)
    }

    /// Forgets how many levels the grid should have had at most; whether that was known.
    pub fn forget_levels(&mut self) -> bool {
        self.gathered.as_mut().is_some_and(|gathered| {
            std::mem::replace(&mut gathered.level_cap, MAX_LEVELS) != MAX_LEVELS
        })
    }

    /// Light paths and levels may be more work than they were: the lights are others.
    pub fn doubt_work(&mut self) {
        if let Tracer::Paths(tracer) = &mut self.tracer {
            tracer.doubt_rounds();
        }
        if let Some(gathered) = &mut self.gathered {
            gathered.fine = None;
        }
    }

    /// The records that tell what a frame would have needed; one record each.
    pub fn needs_records(&self) -> Vec<&wgpu::Buffer> {
        let gathered = self.gathered.iter();
        let gathered =
            gathered.flat_map(|g| [g.grid.info.raw(), g.out.stats.raw(), g.out.reach.raw()]);
        [self.vpls.info.raw()].into_iter().chain(gathered).collect()
    }

    /// Lists that a frame leaves behind: the lights that are gathered, and what they give.
    #[cfg(debug_assertions)]
    pub fn suspects(&self) -> Vec<Suspect> {
        let Some(Gathered { grid, out, .. }) = &self.gathered else {
            return vec![Suspect::new(&self.vpls.lights)];
        };
        vec![
            Suspect::new(&grid.vpls),
            Suspect::new(&grid.points),
            Suspect::light(&grid.blocks),
            // Lattice coordinates.
            Suspect::new(&grid.lights).without(&[7, 11]),
            Suspect::light(&out.unshadowed),
            Suspect::light(&out.ratio),
        ]
    }

    /// The same, off the front of bytes that came back.
    pub fn take_needs(&self, bytes: &mut &[u8]) -> Needs {
        let vpls = take_record(bytes);
        match self.gathered {
            None => Needs { vpls, ..Needs::default() },
            Some(_) => Needs {
                vpls,
                grid: take_record(bytes),
                gather: take_record(bytes),
                reach: take_record(bytes),
            },
        }
    }

    /// Learns from what a frame would have needed, and what it lacked of it.
    pub fn learn(
        &mut self,
        gpu: &Gpu,
        settings: &Settings,
        needs: &Needs,
        room: &mut SetRoom,
    ) -> Lack {
        self.info = needs.vpls;
        let lack = if self.info.missing > 0 { Lack::Work } else { Lack::Nothing };
        if let Tracer::Paths(tracer) = &mut self.tracer {
            match lack {
                Lack::Nothing => tracer.learn_rounds(self.info.rounds),
                _ => tracer.lack_rounds(self.info.rounds),
            }
            (room.rounds, room.most_rounds) = (tracer.needed_rounds(), tracer.most_taken()[1]);
        }
        let Some(gathered) = &mut self.gathered else { return lack };
        (self.grid_lights, self.reach) = (needs.grid.light_count, needs.reach);
        if let Some(capacity) = gathered.build.capacity().grown(gpu, &needs.grid) {
            room.grid = Some(capacity);
            return Lack::Memory;
        }
        if lack == Lack::Work {
            // The grid of all lights is another.
            gathered.fine = None;
            return lack;
        }
        gathered.fine = Some(FineLevels {
            count: fine_levels(&needs.grid),
            grid: settings.grid.clone(),
            d_min: settings.vpls.d_min,
            level_cap: gathered.level_cap,
        });
        match GridRules::new(&settings.grid, 0.0).next_cap(&needs.grid) {
            None => Lack::Nothing,
            Some(cap) => {
                (gathered.level_cap, room.level_cap) = (cap, Some(cap));
                gathered.fine = None;
                Lack::Work
            }
        }
    }
}

#[cfg(test)]
impl Lights {
    pub fn rounds(&self) -> u32 {
        match &self.tracer {
            Tracer::Emitters(_) => 0,
            Tracer::Paths(tracer) => tracer.rounds(),
        }
    }

    pub fn forget_rounds(&mut self) {
        if let Tracer::Paths(tracer) = &mut self.tracer {
            tracer.forget_rounds();
        }
    }
}

impl Gathered {
    fn new(
        gpu: &Gpu,
        building: &impl Memory,
        vpls: usize,
        [width, height]: [usize; 2],
        room: &SetRoom,
        built: Option<(GpuGrid, Option<FineLevels>)>,
    ) -> Result<Self, Error> {
        let capacity = room.grid.unwrap_or_else(|| GridCapacity::for_vpls(gpu, vpls));
        let (grid, fine) = match built {
            Some(built) => built,
            None => (GpuGrid::new(gpu, &capacity)?, None),
        };
        Ok(Self {
            build: GridBuild::new(building, capacity)?,
            grid,
            out: GatherOut::new(gpu, width, height)?,
            level_cap: room.level_cap.unwrap_or(MAX_LEVELS),
            fine,
        })
    }

    /// Fine levels of a grid by some settings, as far as one has told.
    fn fine_levels(&self, settings: &Settings) -> u32 {
        let is_alike = |fine: &&FineLevels| {
            fine.level_cap == self.level_cap
                && fine.grid == settings.grid
                && fine.d_min == settings.vpls.d_min
        };
        self.fine.as_ref().filter(is_alike).map_or(MAX_LEVELS, |fine| fine.count)
    }
}
