//! Where a picture is computed.

use crate::Failure;
use crate::args::Backend;
use manylight::frame::gpu::GpuRenderer;
use manylight::frame::{Past, Progress};
use manylight::gpu::{Gpu, GpuOptions};
use manylight::{Frame, Renderer, Settings};
use manylight_scene::Camera;
use std::io::Write;

/// A renderer on one of the backends.
pub enum Engine {
    /// All cores of this machine.
    Cpu(Box<Renderer>),
    /// A graphics device.
    Gpu(Box<GpuRenderer>, Fallback),
}

/// Whether the processor takes over from a graphics device that fails.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Fallback {
    /// It was the device that was asked for.
    Never,
    /// It may.
    Ready,
    /// It has.
    Done,
}

impl Engine {
    /// Opens the backend that was asked for and brings a scene there.
    ///
    /// `auto` takes a graphics device that is not emulated, or that the settings name, if it works;
    /// else the processor.
    pub fn new(
        renderer: Renderer,
        backend: Backend,
        settings: &Settings,
        quiet: bool,
    ) -> Result<Self, Failure> {
        if backend == Backend::Cpu {
            return Ok(Self::Cpu(Box::new(renderer)));
        }
        let may_fall_back = backend == Backend::Auto;
        let fallback = if may_fall_back { Fallback::Ready } else { Fallback::Never };
        match Gpu::open(&GpuOptions::from(&settings.gpu)) {
            Ok(gpu) => match GpuRenderer::new(gpu, renderer) {
                Ok(engine) => Ok(Self::Gpu(Box::new(engine), fallback)),
                Err((renderer, reason)) if may_fall_back => {
                    warn(&reason, quiet);
                    Ok(Self::Cpu(renderer))
                }
                Err((_, reason)) => Err(reason.into()),
            },
            // Without a device there is nothing to warn of, unless one was named.
            Err(reason) if may_fall_back => {
                if settings.gpu.device.is_some() {
                    warn(&reason, quiet);
                }
                Ok(Self::Cpu(Box::new(renderer)))
            }
            Err(reason) => Err(reason.into()),
        }
    }

    /// Renders one picture.
    pub fn render(
        &mut self,
        camera: &Camera,
        size: [usize; 2],
        settings: &Settings,
        progress: Progress<'_>,
        quiet: bool,
    ) -> Result<Frame, Failure> {
        match self.on_device(quiet, |gpu| gpu.render(camera, size, settings, progress))? {
            Some(frame) => Ok(frame),
            None => Ok(self.renderer().render(camera, size, settings, progress)?),
        }
    }

    /// Renders the next frame of a sequence; none where the processor has just taken over, which
    /// remembers nothing of the frames before.
    pub fn render_next(
        &mut self,
        (camera, size): (&Camera, [usize; 2]),
        settings: &Settings,
        (frame, past): (u32, &mut Past),
        progress: Progress<'_>,
        quiet: bool,
    ) -> Result<Option<Frame>, Failure> {
        if self.device().is_some() {
            let next =
                |gpu: &mut GpuRenderer| gpu.render_next(camera, size, settings, frame, progress);
            return self.on_device(quiet, next);
        }
        Ok(Some(self.renderer().render_next(camera, size, settings, frame, past, progress)?))
    }

    /// Does something on the graphics device; none where the processor has taken over, or does now.
    pub fn on_device<T>(
        &mut self,
        quiet: bool,
        work: impl FnOnce(&mut GpuRenderer) -> Result<T, manylight::Error>,
    ) -> Result<Option<T>, Failure> {
        let Self::Gpu(gpu, fallback @ (Fallback::Never | Fallback::Ready)) = self else {
            return Ok(None);
        };
        match work(gpu) {
            Err(reason @ manylight::Error::Device { .. }) if *fallback == Fallback::Ready => {
                warn(&reason, quiet);
                *fallback = Fallback::Done;
                Ok(None)
            }
            result => Ok(Some(result?)),
        }
    }

    /// The graphics device, unless the processor has taken over.
    pub fn device(&self) -> Option<&Gpu> {
        match self {
            Self::Cpu(_) | Self::Gpu(_, Fallback::Done) => None,
            Self::Gpu(engine, _) => Some(engine.gpu()),
        }
    }

    /// Forgets the frames of a sequence.
    pub fn forget(&mut self, past: &mut Past) {
        past.clear();
        if let Self::Gpu(engine, _) = self {
            engine.forget_past();
        }
    }

    /// Renders one picture for its time: of each stage, ms; `is_static` keeps its lights. Where
    /// frames add up it is the next one of a sequence. None where the processor has just taken
    /// over.
    pub fn time_frame(
        &mut self,
        (camera, size): (&Camera, [usize; 2]),
        settings: &Settings,
        (frame, past): (u32, &mut Past),
        is_static: bool,
        quiet: bool,
    ) -> Result<Option<Vec<(&'static str, f64)>>, Failure> {
        if self.device().is_some() {
            let times = |gpu: &mut GpuRenderer| gpu.time_frame(camera, size, settings, is_static);
            let times = self.on_device(quiet, times)?;
            return Ok(times.map(|t| t.iter().map(|t| (t.name, t.time_ms)).collect()));
        }
        let frame = self.renderer().render_next(camera, size, settings, frame, past, &|_, _| ())?;
        Ok(Some(frame.stages.iter().map(|s| (s.name, s.time_ms)).collect()))
    }

    /// World and emitters.
    pub fn renderer(&self) -> &Renderer {
        match self {
            Self::Cpu(renderer) => renderer,
            Self::Gpu(engine, _) => engine.renderer(),
        }
    }

    /// What is used of a graphics device beyond what every one has.
    pub fn features(&self) -> Vec<&'static str> {
        self.device().map_or(Vec::new(), |gpu| gpu.features().names())
    }

    /// Backend and device, for the metadata of a picture.
    pub fn names(&self) -> [String; 2] {
        match self.device() {
            None => ["cpu".to_owned(), format!("{} threads", rayon::current_num_threads())],
            Some(gpu) => ["gpu".to_owned(), gpu.name().to_owned()],
        }
    }
}

fn warn(reason: &manylight::Error, quiet: bool) {
    if !quiet {
        let _ = writeln!(std::io::stderr(), "warning: {reason}; the processor takes over");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use manylight_scene::Shot;

    /// A small scene on the first software driver; none, or a failure where tests of graphics
    /// devices are required, without one.
    fn on_device(settings: &Settings) -> Option<(Engine, Camera)> {
        let shot = manylight_scene::load("builtin:cornell");
        let Shot { scene, camera, .. } = shot.expect("a built-in shot");
        let renderer = Renderer::new(scene).expect("a renderer");
        let engine = Engine::new(renderer, Backend::Auto, settings, true).expect("an engine");
        if matches!(engine, Engine::Cpu(_)) {
            manylight_testing::skip_without_device("there is no software Vulkan driver");
            return None;
        }
        Some((engine, camera))
    }

    /// The caller learns that the past is lost, and the processor goes on from the next call.
    #[test]
    fn the_processor_takes_over_in_the_middle_of_a_sequence() {
        let mut settings = Settings::preset("draft").expect("a preset");
        settings.vpls.count = 500;
        settings.filter.temporal = true;
        settings.gpu.device = Some("llvmpipe".to_owned());
        let Some((mut engine, camera)) = on_device(&settings) else { return };
        let mut past = Past::default();
        let mut next = |engine: &mut Engine, number| {
            let next = (number, &mut past);
            engine.render_next((&camera, [16, 9]), &settings, next, &|_, _| (), true)
        };
        assert!(next(&mut engine, 0).expect("a frame").is_some());
        assert_eq!(engine.names()[0], "gpu");
        let Engine::Gpu(device, _) = &engine else { panic!("it was on the device") };
        device.gpu().device().destroy();
        assert!(next(&mut engine, 1).expect("the processor takes over").is_none());
        assert_eq!(engine.names()[0], "cpu");
        assert!(next(&mut engine, 1).expect("a frame").is_some());
    }
}
