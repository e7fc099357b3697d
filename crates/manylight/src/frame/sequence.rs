//! Frames one after another: what one leaves to the next.
//!
//! In: a frame's number, view and settings · Out: whether it continues the one before, random
//! numbers of its own
//! Limits: the world stands still; a scene that changed is another [`Renderer`](super::Renderer).

use crate::filter::temporal::History;
use crate::math::hash_u32;
use crate::settings::{FilmSettings, Settings};
use crate::surface::ViewFrame;
use std::sync::Arc;

/// Cosine of the largest turn between neighboring frames that is no cut: 30°.
const CUT_COS: f32 = 0.866;
/// Largest way between neighboring frames that is no cut, as a share of the scene's diagonal.
const CUT_SHARE: f32 = 0.05;
/// Tells the numbers of frames from other keys.
const FRAME_KEY: u32 = 0x51ed_270b;

/// What the frames of a sequence leave to those after them; the caller's, one per sequence.
#[derive(Clone, Debug, Default)]
pub struct Past {
    pub(super) history: History,
    last: Option<Moment>,
}

impl Past {
    /// Forgets everything, as at a cut.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Goes on to the next frame; forgets the past where that does not continue it.
    pub(super) fn go_on(&mut self, next: Moment) {
        if !self.last.as_ref().is_some_and(|last| last.leads_to(&next)) {
            self.clear();
        }
        self.last = Some(next);
    }
}

/// What shadow ratios of a frame depend on.
#[derive(Clone, Debug)]
pub(super) struct Moment {
    /// The same for all frames of one renderer.
    scene: Arc<()>,
    /// Of the scene, metres.
    diagonal: f32,
    view: ViewFrame,
    settings: Settings,
}

impl Moment {
    pub fn new((scene, diagonal): (&Arc<()>, f32), view: &ViewFrame, settings: &Settings) -> Self {
        // What changes no ratio of few rays.
        let film = FilmSettings::default();
        let settings = Settings { film, ..settings.clone() };
        Self { scene: scene.clone(), diagonal, view: *view, settings }
    }

    /// Whether the next frame goes on with this one: same scene, settings and size, and no cut.
    pub fn leads_to(&self, next: &Self) -> bool {
        let (a, b) = (&self.view, &next.view);
        Arc::ptr_eq(&self.scene, &next.scene)
            && self.settings == next.settings
            && [a.width, a.height] == [b.width, b.height]
            && a.forward().dot(b.forward()) > CUT_COS
            && a.eye().distance(b.eye()) < CUT_SHARE * self.diagonal
    }
}

/// What is mixed into the seeds of a frame's shadow rays; nothing into those of frame 0, whose
/// random numbers are those of a single picture.
pub(super) fn noise(frame: u32) -> u32 {
    if frame == 0 { 0 } else { hash_u32(frame ^ FRAME_KEY) }
}
