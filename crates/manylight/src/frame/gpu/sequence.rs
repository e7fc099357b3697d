//! Frames one after another on the device.
//!
//! In: view and settings of a frame · Out: the history that it adds its ratios to

use super::{Frame, GpuRenderer, Job, Progress, check_size};
use crate::error::Error;
use crate::filter::temporal::gpu::GpuHistory;
use crate::frame::sequence::{Moment, noise};
use crate::settings::{Method, Settings};
use crate::surface::ViewFrame;
use manylight_scene::Camera;

/// What frames leave to those after them.
#[derive(Debug)]
pub(super) struct GpuPast {
    pub history: GpuHistory,
    last: Option<Moment>,
    /// Frames that have been timed.
    pub timed: u32,
}

impl GpuPast {
    /// Goes on to the next frame; none where its settings add nothing up. The history is forgotten
    /// where the frame does not continue the last one.
    ///
    /// Errors: more than the device can hold
    pub fn go_on(
        kept: Option<Self>,
        renderer: &GpuRenderer,
        view: &ViewFrame,
        settings: &Settings,
    ) -> Result<Option<Self>, Error> {
        if !settings.adds_up() {
            return Ok(None);
        }
        let next = renderer.renderer().moment(view, settings);
        let size = [view.width, view.height];
        // Ratios that few rays make: of the sky, of emissive surfaces, of bounced light.
        let emitters = &renderer.renderer().emitters;
        let has_bounced = settings.method != Method::Direct;
        let has = [emitters.sky.is_some(), !emitters.surface.is_empty(), has_bounced];
        let signals = has.into_iter().filter(|has| *has).count();
        let fits = |h: &GpuHistory| h.size() == size && h.signals() == signals;
        let mut past = match kept.filter(|past| fits(&past.history)) {
            Some(past) => past,
            None => {
                let history = GpuHistory::new(renderer.gpu(), size[0], size[1], signals)?;
                Self { history, last: None, timed: 0 }
            }
        };
        if !past.last.as_ref().is_some_and(|last| last.leads_to(&next)) {
            past.history.clear();
        }
        past.last = Some(next);
        Ok(Some(past))
    }
}

impl GpuRenderer {
    /// Renders the next frame of a sequence; twin of
    /// [`Renderer::render_next`](crate::Renderer::render_next), but the past is the renderer's own.
    /// Pictures of [`GpuRenderer::render`] in between leave it alone.
    ///
    /// Errors: as [`GpuRenderer::render`]; the past is then forgotten
    pub fn render_next(
        &mut self,
        camera: &Camera,
        size: [usize; 2],
        settings: &Settings,
        frame: u32,
        progress: Progress<'_>,
    ) -> Result<Frame, Error> {
        if !settings.adds_up() {
            self.past = None;
            return self.render(camera, size, settings, progress);
        }
        settings.validate()?;
        check_size(size)?;
        let view = ViewFrame::new(camera, size[0], size[1]);
        let kept = self.past.take();
        let mut past = self.gpu.guard(|| GpuPast::go_on(kept, self, &view, settings))?;
        let job = Job { noise: noise(frame), ..Job::new(&view, settings) };
        progress("frame", 0.0);
        let history = past.as_mut().map(|past| &mut past.history);
        self.forgets_levels = true;
        let times = self.render_sample(job, history, progress)?.unwrap_or_default();
        self.past = past;
        self.gpu.guard(|| self.finish(settings, times))
    }

    /// Forgets earlier frames, as at a cut that is not to be seen from the views.
    pub fn forget_past(&mut self) {
        self.past = None;
    }
}
