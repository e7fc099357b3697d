//! The reference on the device.

use super::{GpuRenderer, Stage};
use crate::composite::Layers;
use crate::error::Error;
use crate::frame::{Frame, Progress};
use crate::gpu::Buf;
use crate::reference::gpu::{GpuPaths, Paths};
use crate::settings::Settings;
use crate::surface::ViewFrame;
use crate::surface::gpu::GpuReceivers;
use glam::{Vec2, Vec3};
use std::time::Instant;

impl GpuRenderer {
    /// Every pixel by paths.
    pub(super) fn render_paths(
        &self,
        view: &ViewFrame,
        settings: &Settings,
        progress: Progress<'_>,
    ) -> Result<Frame, Error> {
        let start = Instant::now();
        let pixels = view.width * view.height;
        let gpu = self.gpu();
        let receivers = GpuReceivers::new(gpu, view.width, view.height)?;
        let (center, normal_maps) = (Vec2::splat(0.5), settings.surface.normal_maps);
        let mut rec = gpu.record(Some(self.scene.group()));
        rec.stage("receivers");
        receivers.trace(&mut rec, view, center, normal_maps);
        rec.submit().wait()?;
        let bounces = settings.vpls.bounces;
        let paths = Paths { spp: settings.path.spp, bounces, normal_maps, seed: settings.seed };
        let sums = GpuPaths::new(gpu, pixels)?;
        let tick = |share| progress("paths", share);
        sums.trace(gpu, self.scene.group(), view, &paths, &tick)?;

        let receivers = receivers.download(gpu, view, center)?;
        let mut layers = Layers::new(&receivers, |_| Vec3::ZERO);
        let read = |plane: &Buf<[f32; 4]>| -> Result<Vec<Vec3>, Error> {
            let values = gpu.read(plane, pixels)?;
            Ok(values.into_iter().map(|[r, g, b, _]| Vec3::new(r, g, b)).collect())
        };
        layers.emission = read(&sums.emission)?;
        layers.direct = read(&sums.direct)?;
        layers.indirect = read(&sums.indirect)?;
        layers.indirect_unshadowed = layers.indirect.clone();
        let time_ms = start.elapsed().as_secs_f64() * 1e3;
        let count = u64::from(paths.spp) * pixels as u64;
        let stages = vec![Stage { name: "paths", time_ms, count }];
        Ok(Frame { layers, stages, d_min: self.renderer().d_min(settings), alpha: None })
    }
}
