//! Everything that a frame works on, kept from frame to frame.

use super::GpuRenderer;
use super::lights::{Built, Lack, Lights, Needs, SetRoom};
use crate::composite::gpu::GpuLayers;
use crate::error::Error;
use crate::filter::gpu::{Filter, Guides};
use crate::filter::interleave::gpu::Join;
use crate::gather::grid::gpu::{Gather, GatherCapacity, band_evals};
use crate::gpu::{Buf, Gpu, Later, Memory, Pool, Recorder};
#[cfg(debug_assertions)]
use crate::gpu::{Faults, Suspect};
use crate::settings::{GridSettings, Method, Settings, ShadowSettings, VplSettings};
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
    band_evals: u32,
    has_sky: bool,
    has_emitters: bool,
}

impl Shape {
    fn new(size: [usize; 2], settings: &Settings, has_sky: bool, has_emitters: bool) -> Self {
        Self {
            size,
            has_sky,
            has_emitters,
            method: settings.method,
            samples: settings.film.samples,
            vpls: [settings.vpls.count, settings.vpls.bounces, settings.vpls.emitter_count],
            shadow: settings.shadow.clone(),
            interleave: settings.interleave,
            band_evals: band_evals(&settings.grid),
        }
    }

    /// Whether grids made for one serve the other.
    fn shares_grids(&self, other: &Self) -> bool {
        let of = |s: &Self| (s.method, s.vpls, s.has_sky, s.has_emitters);
        of(self) == of(other)
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

/// What lists have room for, as far as frames have told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Room {
    gather: GatherCapacity,
    /// What is asked for where gathers change, for bands as they are: never what was made of it for
    /// one gather, which would grow from change to change.
    learned: GatherCapacity,
    emitted: SetRoom,
    bounced: SetRoom,
}

impl Room {
    /// What of it was learned still holds for another shape.
    fn refitted(mut self, old: &Shape, shape: &Shape) -> Self {
        let bands = |shape: &Shape| (shape.size, shape.interleave, shape.band_evals);
        if bands(old) != bands(shape) {
            self.learned = GatherCapacity::default();
        }
        self.gather = self.learned;
        if old.vpls[2] != shape.vpls[2] {
            self.emitted = SetRoom::default();
        }
        if old.vpls[..2] != shape.vpls[..2] {
            self.bounced = SetRoom::default();
        }
        self
    }
}

/// What makes lights, gathers and filters them and puts the picture together, in memory that these
/// take in turns: a list holds what it should from when it is written in a frame until all that
/// reads it is done.
#[derive(Debug)]
pub(super) struct Work {
    /// For when all of it is made anew.
    room: Room,
    /// Lights on emissive surfaces, where there are any.
    pub emitted: Option<Lights>,
    /// Lights on what light paths hit, unless direct light is all that is asked for.
    pub bounced: Option<Lights>,
    /// Shared by the gathers, one after another.
    pub gather: Gather,
    /// From sun, point and spot lights.
    pub irradiance: Buf<[f32; 4]>,
    pub sky: Option<Part>,
    pub guides: Guides,
    /// Where pixels see parts of the lights.
    pub join: Option<Join>,
    pub filter: Filter,
    pub layers: GpuLayers,
}

impl Work {
    /// `built`: grids that stay, those on emissive surfaces first.
    fn new(
        gpu: &Gpu,
        shape: &Shape,
        settings: &Settings,
        room: Room,
        built: [Option<Built>; 2],
    ) -> Result<Self, Error> {
        let size @ [width, height] = shape.size;
        let pool = Pool::new(gpu);
        // The largest lists come first.
        let gather = Gather::new(&pool.phase(), width, height, settings, room.gather)?;
        let lights = |on_emitters, room: &SetRoom, built| {
            Lights::new(gpu, &pool, on_emitters, size, settings, (room, built))
        };
        let [on_emitters, on_paths] = built;
        let has_bounced = shape.method != Method::Direct;
        let bounced = has_bounced.then(|| lights(false, &room.bounced, on_paths)).transpose()?;
        let emitted =
            shape.has_emitters.then(|| lights(true, &room.emitted, on_emitters)).transpose()?;

        let ending = pool.phase();
        let has_signals = [shape.has_sky, shape.has_emitters, has_bounced];
        let signals = has_signals.into_iter().filter(|has| *has).count();
        let (four, two) =
            (Buf::<[f32; 4]>::bytes(width * height), Buf::<[f32; 2]>::bytes(width * height));
        let sky_bytes = if shape.has_sky { &[four, two][..] } else { &[] };
        // What the kernels of the filter and of the composite read.
        let known = ending.together(&[&[four; 3], sky_bytes, &vec![two; signals]].concat())?;
        let layers = match shape.samples {
            1 => GpuLayers::new(&ending.together(&[four; 3])?, &ending, size, 1)?,
            // They are summed up from sample to sample.
            samples => GpuLayers::new(gpu, gpu, size, samples)?,
        };
        let join = shape.is_interleaved().then(|| Join::new(&ending, width, height));
        Ok(Self {
            room: Room { gather: *gather.capacity(), ..room },
            emitted,
            bounced,
            gather,
            irradiance: known.list("direct irradiance", width * height)?,
            sky: shape.has_sky.then(|| Part::new(&known, size)).transpose()?,
            guides: Guides::new(&known, width, height)?,
            join: join.transpose()?,
            filter: Filter::new(&ending, &known, width, height, signals)?,
            layers,
        })
    }

    /// The grids; all else is let go.
    fn into_built(self) -> [Option<Built>; 2] {
        [self.emitted, self.bounced].map(|lights| lights.and_then(Lights::into_built))
    }

    fn lights(&self) -> impl Iterator<Item = &Lights> {
        self.emitted.iter().chain(&self.bounced)
    }
}

/// What virtual lights and their grids are made from, beside the scene: frames that share it share
/// them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Recipe {
    seed: u32,
    vpls: VplSettings,
    /// Without what says how to gather.
    grid: GridSettings,
    normal_maps: bool,
}

impl Recipe {
    /// That of a frame with a seed of its own.
    pub fn new(settings: &Settings, seed: u32) -> Self {
        let grid = GridSettings { alpha: None, evals: 0, spread: true, ..settings.grid.clone() };
        let normal_maps = settings.surface.normal_maps;
        Self { seed, vpls: settings.vpls.clone(), grid, normal_maps }
    }
}

/// Which virtual lights and grids lie in the buffers of a frame once all that was recorded is done.
#[derive(Debug, Default)]
pub(super) struct Builds {
    /// What the last ones that were recorded are made from.
    begun: Option<Recipe>,
    /// Number of the first of those that are made from it, one after another, and of the last.
    numbers: [u32; 2],
    /// Whether one of them is known to be done, and lacked nothing.
    is_done: bool,
}

impl Builds {
    /// Whether the lights of a frame lie here already.
    pub fn has(&self, recipe: &Recipe) -> bool {
        self.is_done && self.begun.as_ref() == Some(recipe)
    }

    /// Whether lights lie here that are known to be complete.
    pub fn are_done(&self) -> bool {
        self.is_done
    }

    /// Lights are about to be made; a number for [`Builds::end`].
    pub fn begin(&mut self, recipe: &Recipe) -> u32 {
        self.numbers[1] += 1;
        if self.begun.as_ref() != Some(recipe) {
            let [first, last] = &mut self.numbers;
            (*first, self.is_done) = (*last, false);
            self.begun = Some(recipe.clone());
        }
        self.numbers[1]
    }

    /// They were made, and lacked nothing; whatever was begun since writes the same, or other
    /// lights are awaited now.
    pub fn end(&mut self, number: u32) {
        self.is_done |= self.begun.is_some() && number >= self.numbers[0];
    }

    /// What lies here is of no use.
    fn forget(&mut self) {
        (self.begun, self.is_done) = (None, false);
    }
}

/// What a frame was recorded with.
#[derive(Debug)]
pub(super) struct Origin {
    generation: Arc<()>,
    grids: Arc<()>,
    lit: Arc<()>,
}

/// The buffers of a frame.
#[derive(Debug)]
pub(super) struct Buffers {
    shape: Shape,
    /// Another one whenever a list is another one.
    generation: Arc<()>,
    /// Another one whenever the lists of the grids are others.
    grids: Arc<()>,
    /// Another one whenever the lights of the scene are others.
    lit: Arc<()>,
    builds: Builds,
    pub receivers: GpuReceivers,
    pub work: Work,
    #[cfg(debug_assertions)]
    faults: Faults,
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
        let (gpu, emitters) = (renderer.gpu(), &renderer.renderer().emitters);
        let (has_sky, has_emitters) = (emitters.sky.is_some(), !emitters.surface.is_empty());
        let shape = Shape::new(size, settings, has_sky, has_emitters);
        let new = || GpuReceivers::new(gpu, size[0], size[1]);
        let (generation, lit) = Default::default();
        // What goes must not stand beside what comes.
        let (receivers, room, built, grids, builds) = match kept {
            Some(kept) if kept.shape == shape => return Ok(kept),
            None => {
                (new()?, Room::default(), Default::default(), Arc::default(), Builds::default())
            }
            Some(Self { shape: old, receivers, work, builds, grids, .. }) => {
                let room = work.room.refitted(&old, &shape);
                let stay = builds.is_done && shape.shares_grids(&old);
                let (built, grids, builds) = match stay {
                    true => (work.into_built(), grids, builds),
                    false => {
                        drop(work);
                        Default::default()
                    }
                };
                let receivers = Some(receivers).filter(|_| old.size == size);
                (receivers.map_or_else(new, Ok)?, room, built, grids, builds)
            }
        };
        let work = Work::new(gpu, &shape, settings, room, built)?;
        Ok(Self {
            shape,
            generation,
            grids,
            lit,
            builds,
            receivers,
            work,
            #[cfg(debug_assertions)]
            faults: Faults::new(gpu)?,
        })
    }

    /// Whether they are those of frames of a size with some settings.
    pub fn fits(&self, size: [usize; 2], settings: &Settings) -> bool {
        let Shape { has_sky, has_emitters, .. } = self.shape;
        self.shape == Shape::new(size, settings, has_sky, has_emitters)
    }

    /// Forgets how many levels the grids of other lights should have had at most, and grids that
    /// were held to that.
    pub fn forget_levels(&mut self) {
        let Work { emitted, bounced, room, .. } = &mut self.work;
        [&mut room.emitted, &mut room.bounced].into_iter().for_each(SetRoom::forget_levels);
        let capped = emitted.iter_mut().chain(bounced).map(Lights::forget_levels);
        if capped.filter(|was_capped| *was_capped).count() > 0 {
            self.builds.forget();
        }
    }

    /// Lights and grids may be more work than they were, now and when frames recorded before are
    /// looked at: the lights are others.
    pub fn forget_lights(&mut self) {
        self.lit = Arc::default();
        self.builds.forget();
        self.doubt_work();
    }

    /// Which lights lie here.
    pub fn builds(&mut self) -> &mut Builds {
        &mut self.builds
    }

    fn doubt_work(&mut self) {
        let Work { emitted, bounced, .. } = &mut self.work;
        emitted.iter_mut().chain(bounced).for_each(Lights::doubt_work);
    }

    /// What a frame that is recorded now is recorded with.
    pub fn origin(&self) -> Origin {
        let Self { generation, grids, lit, .. } = self;
        Origin { generation: generation.clone(), grids: grids.clone(), lit: lit.clone() }
    }

    /// Whether the lists of the grids are what they were.
    pub fn have_grids_of(&self, origin: &Origin) -> bool {
        Arc::ptr_eq(&self.grids, &origin.grids)
    }

    /// Whether every list is what it was.
    pub fn are_of(&self, origin: &Origin) -> bool {
        Arc::ptr_eq(&self.generation, &origin.generation)
    }

    /// The gathers of a frame of the grid method, in the order of their light's way.
    pub fn gathers(&self, settings: &Settings) -> Vec<GatherRef<'_>> {
        let rays = settings.shadow.rays;
        let sky = self.work.sky.as_ref().map(|part| GatherRef {
            unshadowed: &part.unshadowed,
            ratio: &part.ratio,
            rays: super::sky_rays(settings),
            is_direct: true,
        });
        let lights = [(&self.work.emitted, true), (&self.work.bounced, false)];
        let lights = lights.into_iter().filter_map(|(lights, is_direct)| {
            let out = &lights.as_ref()?.gathered.as_ref()?.out;
            Some(GatherRef { unshadowed: &out.unshadowed, ratio: &out.ratio, rays, is_direct })
        });
        sky.into_iter().chain(lights).collect()
    }

    /// What a stage of the last frame made, as far as that was read back.
    pub fn count_of(&self, stage: &str) -> u64 {
        let lights =
            |f: fn(&Lights) -> u32| self.work.lights().map(|l| u64::from(f(l))).sum::<u64>();
        let vpls = |lights: &Option<Lights>| lights.as_ref().map_or(0, |l| l.info.count.into());
        match stage {
            "emitter vpls" => vpls(&self.work.emitted),
            "vpls" => vpls(&self.work.bounced),
            "grid" => lights(|l| l.grid_lights),
            _ => 0,
        }
    }

    /// Brings back what the frame recorded so far would have needed.
    pub fn record_needs(&self, rec: &mut Recorder<'_>) -> Later {
        let records = self.work.lights().flat_map(Lights::needs_records);
        #[cfg(debug_assertions)]
        let records = {
            self.faults.record(rec, &self.suspects());
            records.chain([self.faults.raw()])
        };
        rec.read_later(&records.collect::<Vec<_>>())
    }

    /// What came back.
    pub fn parse_needs(&self, mut bytes: &[u8]) -> Vec<Needs> {
        self.work.lights().map(|lights| lights.take_needs(&mut bytes)).collect()
    }

    /// Looks at what came back of a frame that lacked nothing.
    ///
    /// Errors: numbers in its lists that no stage may leave behind
    #[cfg(debug_assertions)]
    pub fn check_faults(&self, gpu: &Gpu, bytes: &[u8]) -> Result<(), Error> {
        let faults = bytes.len() - self.faults.raw().size() as usize;
        Faults::check(gpu, &self.suspects(), &mut &bytes[faults..])
    }

    /// The lists that a frame leaves behind.
    #[cfg(debug_assertions)]
    fn suspects(&self) -> Vec<Suspect> {
        let Work { irradiance, sky, layers, .. } = &self.work;
        let mut suspects: Vec<_> = self.work.lights().flat_map(Lights::suspects).collect();
        if self.shape.method == Method::Brute {
            // The picture comes in submissions of its own.
            return suspects;
        }
        suspects.push(Suspect::light(irradiance));
        if let Some(part) = sky {
            suspects.extend([Suspect::light(&part.unshadowed), Suspect::light(&part.ratio)]);
        }
        let GpuLayers { beauty, direct, indirect, unshadowed, .. } = layers;
        suspects.extend([beauty, direct, indirect, unshadowed].map(Suspect::light));
        suspects
    }

    /// As [`Buffers::grown`], by a frame of an engine: its lights may be gone since.
    ///
    /// Errors: as that
    pub fn grown_since(
        self,
        gpu: &Gpu,
        settings: &Settings,
        needs: &[Needs],
        origin: &Origin,
    ) -> Result<(Self, bool), Error> {
        let is_lit_alike = Arc::ptr_eq(&self.lit, &origin.lit);
        let (mut grown, lacked) = self.grown(gpu, settings, needs)?;
        if !is_lit_alike {
            grown.doubt_work();
        }
        Ok((grown, lacked))
    }

    /// Makes room for what a frame would have needed; tells whether it lacked any.
    ///
    /// Errors: more than the device can hold; then nothing is left
    pub fn grown(
        mut self,
        gpu: &Gpu,
        settings: &Settings,
        needs: &[Needs],
    ) -> Result<(Self, bool), Error> {
        let mut room = self.work.room;
        let Work { emitted, bounced, .. } = &mut self.work;
        let sets = [(emitted, &mut room.emitted), (bounced, &mut room.bounced)];
        let sets = sets.into_iter().filter_map(|(lights, room)| Some((lights.as_mut()?, room)));
        let mut lack = Lack::Nothing;
        for ((lights, set_room), needs) in sets.zip(needs) {
            lack = lack.max(lights.learn(gpu, settings, needs, set_room));
            if let Some(grown) = room.gather.grown(&needs.gather) {
                room.learned = room.learned.with_growth(&room.gather, &grown);
                (room.gather, lack) = (grown, Lack::Memory);
            }
        }
        if lack != Lack::Memory {
            self.work.room = room;
            if lack == Lack::Work {
                // What is complete may have been written over by this.
                self.builds.forget();
            }
            return Ok((self, lack == Lack::Work));
        }
        let Self { work, .. } = self;
        // What grows must not stand beside what it was.
        drop(work);
        let work = Work::new(gpu, &self.shape, settings, room, Default::default())?;
        let (generation, grids, builds) = Default::default();
        Ok((Self { generation, grids, builds, work, ..self }, true))
    }
}

#[cfg(test)]
impl Buffers {
    /// Rounds of light paths that a frame records.
    pub fn rounds(&self) -> u32 {
        self.work.bounced.as_ref().map_or(0, Lights::rounds)
    }

    /// Forgets how many rounds of light paths frames took.
    pub fn forget_rounds(&mut self) {
        self.work.bounced.iter_mut().for_each(Lights::forget_rounds);
    }

    /// Takes nearly all room from gathers: the next frame will lack it.
    pub fn lose_room(&mut self, gpu: &Gpu, settings: &Settings) {
        let tiny = GatherCapacity {
            block_chunks: 1,
            least_chunks: 1,
            frontier: 8,
            least_frontiers: 1,
            ..GatherCapacity::default()
        };
        let [width, height] = self.shape.size;
        self.work.gather = Gather::new(gpu, width, height, settings, tiny).expect("gather");
        self.work.room.gather = *self.work.gather.capacity();
    }
}

impl Part {
    fn new(memory: &impl Memory, [width, height]: [usize; 2]) -> Result<Self, Error> {
        Ok(Self {
            unshadowed: memory.list("light of the sky", width * height)?,
            ratio: memory.list("shadow ratios of the sky", width * height)?,
        })
    }
}
