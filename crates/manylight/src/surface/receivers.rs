//! Camera rays and the receivers they find.

use super::SurfacePoint;
use crate::bvh::Ray;
use crate::world::World;
use glam::{Vec2, Vec3};
use manylight_scene::{Camera, Projection};
use rayon::prelude::*;

/// A camera ready to make rays for a picture of one size.
#[derive(Clone, Copy, Debug)]
pub struct ViewFrame {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    pub(super) position: Vec3,
    pub(super) forward: Vec3,
    /// Half the picture's extent, right and up: at distance 1, or in metres if orthographic.
    pub(super) half: [Vec3; 2],
    pub(super) perspective: bool,
}

impl ViewFrame {
    /// A view of `width` × `height` square pixels.
    pub fn new(camera: &Camera, width: usize, height: usize) -> Self {
        let (half_height, perspective) = match camera.projection {
            Projection::Perspective { vfov_rad } => ((vfov_rad * 0.5).tan(), true),
            Projection::Orthographic { half_height } => (half_height, false),
        };
        let right = camera.forward.cross(camera.up).normalize_or(Vec3::X);
        let half_width = half_height * width as f32 / height as f32;
        let half = [right * half_width, camera.up * half_height];
        let (position, forward) = (camera.position, camera.forward);
        Self { width, height, position, forward, half, perspective }
    }

    /// The ray through a point of the picture, in pixels from the top left; unit direction.
    #[inline]
    pub fn ray(&self, point_px: Vec2) -> Ray {
        let x = 2.0 * point_px.x / self.width as f32 - 1.0;
        let y = 1.0 - 2.0 * point_px.y / self.height as f32;
        let offset = self.half[0] * x + self.half[1] * y;
        let (origin, direction) = match self.perspective {
            true => (self.position, (self.forward + offset).normalize()),
            false => (self.position + offset, self.forward),
        };
        Ray { origin, direction, t_max: f32::MAX }
    }

    /// Where a point is seen, in pixels from the top left; `None` behind the eye.
    #[inline]
    pub(crate) fn project(&self, p: Vec3) -> Option<Vec2> {
        let [right, up] = self.axes();
        let (q, depth) = (p - self.position, self.depth(p));
        let scale = match self.perspective {
            true if depth <= 0.0 => return None,
            true => 1.0 / depth,
            false => 1.0,
        };
        let (x, y) = (q.dot(right) * scale, q.dot(up) * scale);
        Some(Vec2::new(x + 1.0, 1.0 - y) * 0.5 * Vec2::new(self.width as f32, self.height as f32))
    }

    /// Right and up, of length 1 over half the picture's extent: at distance 1, or in metres if
    /// orthographic.
    #[inline]
    pub(crate) fn axes(&self) -> [Vec3; 2] {
        self.half.map(|half| half / half.length_squared())
    }

    /// Distance along the viewing axis, metres.
    #[inline]
    pub fn depth(&self, p: Vec3) -> f32 {
        (p - self.position).dot(self.forward)
    }

    /// Where rays of a perspective view start; the center of the picture of an orthographic one.
    pub(crate) fn eye(&self) -> Vec3 {
        self.position
    }

    /// Unit viewing direction.
    pub(crate) fn forward(&self) -> Vec3 {
        self.forward
    }

    /// Whether rays start at one point.
    #[cfg(feature = "gpu")]
    pub(crate) fn is_perspective(&self) -> bool {
        self.perspective
    }

    /// Side of a pixel at the eye, and what is added to it per metre of depth, metres.
    #[cfg(feature = "gpu")]
    pub(crate) fn pixel_size_terms(&self) -> [f32; 2] {
        let at_one = self.pixel_size(1.0);
        if self.perspective { [0.0, at_one] } else { [at_one, 0.0] }
    }

    /// Side of a pixel at a distance along the viewing axis, metres.
    #[inline]
    pub fn pixel_size(&self, depth: f32) -> f32 {
        let at_one = 2.0 * self.half[1].length() / self.height as f32;
        if self.perspective { at_one * depth } else { at_one }
    }
}

/// What one camera ray found.
#[derive(Clone, Copy, Debug)]
pub struct PixelSample {
    /// The surface; `None` where the ray left the scene.
    pub surface: Option<SurfacePoint>,
    /// Unit direction of the camera ray.
    pub direction: Vec3,
    /// Distance along the viewing axis, metres; infinite where the ray left the scene.
    pub depth: f32,
}

/// The receivers of a picture.
///
/// Shapes: `[height · width]`, row-major from the top
#[derive(Clone, Debug)]
pub struct Receivers {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// One sample per pixel.
    pub samples: Vec<PixelSample>,
}

impl Receivers {
    /// Traces one ray through each pixel at `offset_px` from the pixel's top left corner.
    pub fn trace(world: &World, view: &ViewFrame, offset_px: Vec2, normal_maps: bool) -> Self {
        let trace = |index: usize| {
            let pixel = Vec2::new((index % view.width) as f32, (index / view.width) as f32);
            let ray = view.ray(pixel + offset_px);
            let hit = world.closest(&ray);
            let surface = hit.map(|h| world.surface(&h, ray.direction, normal_maps));
            let depth = surface.map_or(f32::INFINITY, |s| view.depth(s.position));
            PixelSample { surface, direction: ray.direction, depth }
        };
        let samples =
            (0..view.width * view.height).into_par_iter().with_min_len(1024).map(trace).collect();
        Self { width: view.width, height: view.height, samples }
    }
}
