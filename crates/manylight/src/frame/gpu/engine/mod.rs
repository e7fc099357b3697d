//! A frame inside an engine's own: its device, its commands, its textures.
//!
//! In: camera, [`Settings`], [`EngineReceivers`] · Out: [`EngineTargets`], filled
//! Nothing is submitted, waited for or read back on the way. What a frame would have needed comes
//! back by itself; where a buffer was too small it grows, and the frames after it lack nothing.

use super::buffers::{Origin, Recipe};
use super::{Buffers, GpuPast, GpuRenderer, Job, Renderer, check_size, noise, nothing_shines};
use crate::composite::store::record_store;
use crate::emitter::Emitters;
use crate::emitter::gpu::pack;
use crate::error::Error;
use crate::gpu::{Arrival, Gpu, Later, Recorder, STORE_FORMAT};
use crate::settings::{FilmSettings, Method, Settings};
use crate::surface::ViewFrame;
use crate::surface::gpu::{ReceiverTextures, check_texture};
use manylight_scene::{Camera, Light, Sky};
use std::mem::{swap, take};

/// Which points of the scene are lit: one for every pixel.
#[derive(Clone, Copy, Debug)]
pub enum EngineReceivers<'a> {
    /// What rays through the centers of the pixels find.
    Traced,
    /// What the engine has drawn.
    Textures(ReceiverTextures<'a>),
}

/// Where the light goes: textures of one size and of format [`STORE_FORMAT`] that may be bound for
/// storage. The size of the first is that of the picture; row 0 is at the top.
#[derive(Clone, Copy, Debug)]
pub struct EngineTargets<'a> {
    /// Direct and indirect light and emission, W·m⁻²·sr⁻¹; the fourth is 1.
    pub composite: &'a wgpu::TextureView,
    /// Indirect light alone, W·m⁻²·sr⁻¹; the fourth is its shadow ratio.
    pub indirect: Option<&'a wgpu::TextureView>,
    /// Indirect irradiance without visibility, W·m⁻², and its shadow ratio, for engines that
    /// reflect it themselves: albedo/π · irradiance · ratio is the indirect light.
    pub irradiance: Option<&'a wgpu::TextureView>,
}

/// Frames that have been recorded, and not been looked at since.
#[derive(Debug, Default)]
pub(super) struct InFlight {
    frames: Vec<Recorded>,
    /// Whether one that was looked at lacked room.
    lacked: bool,
}

impl InFlight {
    /// Whether all frames have been looked at.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Whether a frame may need the lights that lie in some buffers.
    pub fn counts_on(&self, buffers: &Buffers) -> bool {
        self.frames.iter().any(|frame| buffers.have_grids_of(&frame.origin))
    }
}

/// A frame that has been recorded.
#[derive(Debug)]
struct Recorded {
    needs: Later,
    origin: Origin,
    settings: Settings,
    /// Number of the lights that it made.
    build: Option<u32>,
}

impl GpuRenderer {
    /// Records a frame between the commands of an engine, one sample a pixel.
    ///
    /// `frame_seed` stands in the place of [`Settings::seed`]: one for each frame gives each its
    /// own noise, and light paths of its own. Where it stays, so do virtual lights and their grids,
    /// as soon as a frame that made them has been looked at and until lights, or settings that
    /// they are made by, change. With `filter.temporal` it makes the noise of the shadow rays
    /// alone, light paths stay where they are, and frames add up; anew after frames that lacked
    /// room or were never submitted, after cuts and [`GpuRenderer::forget_past`].
    ///
    /// Any number of frames may be recorded before one is submitted, and be under way at a time;
    /// each finds camera, settings and lights as they were when it was recorded. They share
    /// everything that they work on, so they have to be submitted in the order in which they were
    /// recorded, to one queue, which is that of [`Gpu::queue`].
    ///
    /// Errors: a setting outside its range, the methods `brute` and `path`, textures that do not
    /// fit, more than the device can hold, and for frames before as
    /// [`GpuRenderer::after_submit`]. After an error the encoder may hold part of a frame,
    /// which does no harm but gives no light
    pub fn record_into(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &Camera,
        settings: &Settings,
        frame_seed: u32,
        receivers: EngineReceivers<'_>,
        targets: &EngineTargets<'_>,
    ) -> Result<(), Error> {
        settings.validate()?;
        check_method(settings.method)?;
        let size = targets.check()?;
        check_size(size)?;
        let given = match receivers {
            EngineReceivers::Traced => None,
            EngineReceivers::Textures(textures) => Some(textures),
        };
        given.as_ref().map_or(Ok(()), |textures| textures.check(size))?;
        self.look_at_frames()?;
        let film = FilmSettings { samples: 1, ..settings.film.clone() };
        let (seed, noise) = match settings.adds_up() {
            true => (settings.seed, noise(frame_seed)),
            false => (frame_seed, 0),
        };
        let settings = Settings { seed, film, ..settings.clone() };
        let view = ViewFrame::new(camera, size[0], size[1]);
        let mut job = Job { noise, given, ..Job::new(&view, &settings) };
        let recipe = Recipe::new(&settings, job.seed());
        let (kept, kept_past) = (self.buffers.take(), self.past.take());
        let (buffers, past, needs, build) = self.gpu.guard(|| {
            let mut buffers = Buffers::take(kept, self, size, &settings)?;
            job.keeps_lights = self.has_built(&mut buffers, &settings, &recipe);
            let build = (!job.keeps_lights).then(|| buffers.builds().begin(&recipe));
            let mut past = GpuPast::go_on(kept_past, self, &view, &settings)?;
            let history = past.as_mut().map(|past| &mut past.history);
            let needs = self.gpu.record_into(encoder, Some(self.scene.group()), |rec| {
                self.record_frame(rec, &buffers, job, history);
                targets.store(rec, &buffers);
                buffers.record_needs(rec)
            });
            Ok((buffers, past, needs, build))
        })?;
        let origin = buffers.origin();
        self.in_flight.frames.push(Recorded { needs, origin, settings, build });
        (self.buffers, self.past) = (Some(buffers), past);
        Ok(())
    }

    /// Looks at the frames that are done, without waiting, and makes room for what they lacked.
    /// Whether one of them lacked any since this was asked last, or had been recorded before the
    /// last change of the buffers: then light or shadows may be missing from its picture, and
    /// frames recorded from now on do better.
    ///
    /// To be called after a submission, or not at all: [`GpuRenderer::record_into`] looks too.
    /// Polls the device, so that callbacks of the engine may run.
    ///
    /// Errors: what the device reported, more than it can hold, loops that its driver ended early
    /// in a frame that is done; what was recorded later goes on
    pub fn after_submit(&mut self) -> Result<bool, Error> {
        self.look_at_frames()?;
        Ok(take(&mut self.in_flight.lacked))
    }

    pub(super) fn look_at_frames(&mut self) -> Result<(), Error> {
        let Self { gpu, buffers, in_flight, past, .. } = self;
        gpu.poll()?;
        let mut open = Vec::new();
        let mut is_broken = false;
        let mut problem = Ok(());
        for frame in take(&mut in_flight.frames) {
            let looked = match frame.needs.look(gpu) {
                Ok(Arrival::Pending) => {
                    open.push(frame);
                    continue;
                }
                Ok(Arrival::Here(bytes)) => frame.grow(gpu, buffers, &bytes),
                Ok(Arrival::Never) => {
                    is_broken = true;
                    continue;
                }
                Err(e) => Err(e),
            };
            is_broken |= !matches!(looked, Ok(false));
            match looked {
                Ok(lacked) => in_flight.lacked |= lacked,
                Err(e) => problem = problem.and(Err(e)),
            }
        }
        if let Some(past) = past.as_mut().filter(|_| is_broken) {
            past.history.clear();
        }
        in_flight.frames = open;
        problem
    }

    /// Takes other sun, point and spot lights and another sky; emissive materials stay what they
    /// are. For frames recorded from now on; the grids of these go on from the levels of those
    /// before, where pictures of [`GpuRenderer::render`] are as those of a new renderer.
    ///
    /// Where light paths suddenly find far less, frames may have fewer virtual lights than asked
    /// for, on average of the same energy, until one of them has come back;
    /// [`GpuRenderer::after_submit`] tells.
    ///
    /// Errors: nothing in the scene would shine, or more than the device can hold; nothing has
    /// changed then
    /// Cost:   O(lights + texels of the sky + emissive triangles); no hierarchy is built
    pub fn set_lights(
        &mut self,
        mut lights: Vec<Light>,
        mut sky: Option<Sky>,
    ) -> Result<(), Error> {
        let Self { gpu, renderer, scene, buffers, forgets_levels, .. } = self;
        let Renderer { world, emitters, .. } = &mut **renderer;
        swap(&mut world.scene.lights, &mut lights);
        swap(&mut world.scene.sky, &mut sky);
        let relit = Emitters::with_surface(world, emitters.surface.clone());
        let done = match relit.is_dark() {
            true => Err(nothing_shines(&world.scene.name)),
            false => gpu.guard(|| scene.set_sources(gpu, &pack(world, &relit))),
        };
        match done {
            Ok(()) => {
                (*emitters, *forgets_levels) = (relit, true);
                buffers.iter_mut().for_each(Buffers::forget_lights);
            }
            Err(_) => {
                swap(&mut world.scene.lights, &mut lights);
                swap(&mut world.scene.sky, &mut sky);
            }
        }
        done
    }
}

impl Recorded {
    /// Makes room for what the frame lacked; whether it may have lacked any.
    fn grow(self, gpu: &Gpu, buffers: &mut Option<Buffers>, bytes: &[u8]) -> Result<bool, Error> {
        // Others than those it was recorded with have grown, or serve other frames.
        let own = buffers.take_if(|b| b.are_of(&self.origin));
        let Some(own) = own else { return Ok(true) };
        let needs = own.parse_needs(bytes);
        let (mut own, lacked) =
            gpu.guard(|| own.grown_since(gpu, &self.settings, &needs, &self.origin))?;
        #[cfg(debug_assertions)]
        if !lacked {
            own.check_faults(gpu, bytes)?;
        }
        if let Some(build) = self.build.filter(|_| !lacked) {
            own.builds().end(build);
        }
        *buffers = Some(own);
        Ok(lacked)
    }
}

impl EngineTargets<'_> {
    /// The size of the picture.
    ///
    /// Errors: a texture that cannot take it
    fn check(&self) -> Result<[usize; 2], Error> {
        let texture = self.composite.texture();
        let size = [texture.width() as usize, texture.height() as usize];
        let all = [
            ("composite", Some(self.composite)),
            ("indirect light", self.indirect),
            ("irradiance", self.irradiance),
        ];
        let usage = wgpu::TextureUsages::STORAGE_BINDING;
        for (name, view) in all {
            let check = |view| check_texture(name, view, size, usage, Some(STORE_FORMAT));
            view.map_or(Ok(()), check)?;
        }
        Ok(size)
    }

    fn store(&self, rec: &mut Recorder<'_>, buffers: &Buffers) {
        let layers = &buffers.work.layers;
        let size = [layers.width, layers.height];
        rec.stage("store");
        record_store(rec, size, [&layers.beauty, &layers.beauty], self.composite);
        if let Some(indirect) = self.indirect {
            record_store(rec, size, [&layers.indirect, &layers.indirect], indirect);
        }
        if let Some(irradiance) = self.irradiance {
            let gathered =
                buffers.work.bounced.as_ref().and_then(|lights| lights.gathered.as_ref());
            // Without bounced light there is no indirect light of any kind.
            let unshadowed = gathered.map_or(&layers.unshadowed, |g| &g.out.unshadowed);
            record_store(rec, size, [unshadowed, &layers.indirect], irradiance);
        }
    }
}

/// Errors: a method that takes many submissions
fn check_method(method: Method) -> Result<(), Error> {
    match method {
        Method::Grid | Method::Direct => Ok(()),
        Method::Brute | Method::Path => Err(Error::Setting {
            path: "method".to_owned(),
            problem: format!(
                "{} takes many submissions, and an engine's frame is one; take grid or direct",
                method.name()
            ),
        }),
    }
}

#[cfg(test)]
mod tests;
