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
        if let Self::Gpu(engine, fallback @ (Fallback::Never | Fallback::Ready)) = self {
            match engine.render(camera, size, settings, progress) {
                Err(reason @ manylight::Error::Device { .. }) if *fallback == Fallback::Ready => {
                    warn(&reason, quiet);
                    *fallback = Fallback::Done;
                }
                result => return Ok(result?),
            }
        }
        Ok(self.renderer().render(camera, size, settings, progress)?)
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
        if let Self::Gpu(engine, fallback @ (Fallback::Never | Fallback::Ready)) = self {
            return match engine.render_next(camera, size, settings, frame, progress) {
                Err(reason @ manylight::Error::Device { .. }) if *fallback == Fallback::Ready => {
                    warn(&reason, quiet);
                    *fallback = Fallback::Done;
                    Ok(None)
                }
                result => Ok(Some(result?)),
            };
        }
        Ok(Some(self.renderer().render_next(camera, size, settings, frame, past, progress)?))
    }

    /// Forgets the frames of a sequence.
    pub fn forget(&mut self, past: &mut Past) {
        past.clear();
        if let Self::Gpu(engine, _) = self {
            engine.forget_past();
        }
    }

    /// Renders one picture for its time: of each stage, ms; `is_static` keeps its lights. Where
    /// frames add up it is the next one of a sequence.
    pub fn time_frame(
        &mut self,
        (camera, size): (&Camera, [usize; 2]),
        settings: &Settings,
        (frame, past): (u32, &mut Past),
        is_static: bool,
    ) -> Result<Vec<(&'static str, f64)>, Failure> {
        Ok(match self {
            Self::Cpu(renderer) => {
                let frame =
                    renderer.render_next(camera, size, settings, frame, past, &|_, _| ())?;
                frame.stages.iter().map(|s| (s.name, s.time_ms)).collect()
            }
            Self::Gpu(engine, _) => {
                let times = engine.time_frame(camera, size, settings, is_static)?;
                times.iter().map(|t| (t.name, t.time_ms)).collect()
            }
        })
    }

    /// Bytes that are held on a graphics device, by name.
    pub fn device_lists(&self) -> Option<Vec<(&'static str, u64)>> {
        match self {
            Self::Cpu(_) => None,
            Self::Gpu(engine, _) => Some(engine.gpu().lists()),
        }
    }

    /// Dispatches that a graphics device was given so far.
    pub fn dispatches(&self) -> Option<u64> {
        match self {
            Self::Cpu(_) => None,
            Self::Gpu(engine, _) => Some(engine.gpu().dispatches()),
        }
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
        match self {
            Self::Cpu(_) | Self::Gpu(_, Fallback::Done) => Vec::new(),
            Self::Gpu(engine, _) => engine.gpu().features().names(),
        }
    }

    /// Backend and device, for the metadata of a picture.
    pub fn names(&self) -> [String; 2] {
        match self {
            Self::Cpu(_) | Self::Gpu(_, Fallback::Done) => {
                ["cpu".to_owned(), format!("{} threads", rayon::current_num_threads())]
            }
            Self::Gpu(engine, _) => ["gpu".to_owned(), engine.gpu().name().to_owned()],
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
