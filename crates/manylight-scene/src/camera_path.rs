//! Where the camera is in each frame of a sequence.
//!
//! In: keys · Out: a [`Camera`] for any frame
//! Limits: straight lines between keys, and nothing but the camera moves.

use glam::Vec3;

use crate::Camera;

/// A view that the camera has in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraKey {
    /// The frame.
    pub frame: u32,
    /// Eye point, metres.
    pub position: Vec3,
    /// What it looks at, metres.
    pub target: Vec3,
    /// Up in the picture.
    pub up: Vec3,
    /// Full vertical angle, radians.
    pub vfov_rad: f32,
}

/// Views from frame to frame: everything changes along straight lines between the keys, and stays
/// as it is before the first and after the last of them. Keys of neighboring frames make a cut.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraPath {
    /// In the order of their frames, which differ; empty: the camera stands still.
    pub(crate) keys: Vec<CameraKey>,
}

impl CameraPath {
    /// The view of a frame; `None` where the camera stands still.
    pub fn at(&self, frame: u32) -> Option<Camera> {
        let after = self.keys.iter().position(|key| key.frame > frame);
        let after = after.unwrap_or(self.keys.len());
        let from = self.keys.get(after.saturating_sub(1))?;
        let Some(to) = self.keys.get(after).filter(|_| after > 0) else { return from.camera() };
        let share = (frame - from.frame) as f32 / (to.frame - from.frame) as f32;
        let between = CameraKey {
            frame,
            position: from.position.lerp(to.position, share),
            target: from.target.lerp(to.target, share),
            up: from.up.lerp(to.up, share),
            vfov_rad: from.vfov_rad + (to.vfov_rad - from.vfov_rad) * share,
        };
        // Half-way between opposite views there may be none.
        between.camera().or_else(|| from.camera())
    }

    /// Whether the camera stands still.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }
}

impl CameraKey {
    /// The view; `None` where its vectors span no frame.
    pub fn camera(&self) -> Option<Camera> {
        Camera::look_at(self.position, self.target, self.up, self.vfov_rad)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(frame: u32, x: f32) -> CameraKey {
        CameraKey {
            frame,
            position: Vec3::new(x, 0.0, 0.0),
            target: Vec3::new(x, 0.0, -1.0),
            up: Vec3::Y,
            vfov_rad: 1.0,
        }
    }

    #[test]
    fn the_camera_goes_straight_from_key_to_key_and_rests_outside() {
        assert!(CameraPath::default().at(3).is_none());
        let path = CameraPath { keys: vec![key(2, 0.0), key(6, 8.0), key(7, 100.0)] };
        for (frame, x) in [(0, 0.0), (2, 0.0), (3, 2.0), (6, 8.0), (7, 100.0), (99, 100.0)] {
            assert_eq!(path.at(frame).expect("a view").position.x, x, "frame {frame}");
        }
    }

    #[test]
    fn opposite_views_have_one_between_them() {
        let back = CameraKey { target: Vec3::new(0.0, 0.0, 1.0), ..key(2, 0.0) };
        let path = CameraPath { keys: vec![key(0, 0.0), back] };
        assert_eq!(path.at(1).expect("a view").forward, Vec3::NEG_Z);
    }
}
