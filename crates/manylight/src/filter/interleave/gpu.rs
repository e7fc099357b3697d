//! The same on the graphics device.
//!
//! In: [`Guides`], [`GpuReceivers`], irradiances of parts of the lights · Out: those of all lights

use super::MOST_TRUST;
use crate::error::Error;
use crate::filter::gpu::{Guides, TILE};
use crate::gpu::{Buf, Constant, Memory, Recorder, Value};
use crate::gpu::{kernel, record};
use crate::surface::gpu::GpuReceivers;

const JOIN_CONSTANTS: &[Constant] =
    &[Constant { name: "MOST_TRUST", value: Value::F32(MOST_TRUST) }];

record! {
    /// The windows.
    pub struct JoinParams {
        /// Pixels across and down.
        pub size: [u32; 2],
        /// Pixels along the side of a window.
        pub side: u32,
        /// Nothing.
        pub _pad: u32,
    }
}

kernel! {
    /// Means over windows.
    struct JoinParts = "filter/interleave/join", [TILE[0], TILE[1], 1], [JOIN_CONSTANTS];
    uniform params: JoinParams, read guide_positions: [f32; 4], read normals: [f32; 4],
    read parts: [f32; 4], write shares: [f32; 2], write joined: [f32; 4]
}

/// Memory of [`Join::record`] for pictures of one size.
#[derive(Debug)]
pub struct Join {
    joined: Buf<[f32; 4]>,
}

impl Join {
    /// Room for a picture.
    ///
    /// Errors: more pixels than the device can hold in one list
    pub fn new(memory: &impl Memory, width: usize, height: usize) -> Result<Self, Error> {
        Ok(Self { joined: memory.list("joined parts of the light", width * height)? })
    }

    /// Puts the parts of an irradiance together, and corrects the trust in its shares; twin of
    /// [`join`](super::join).
    ///
    /// Shapes: `parts` `[h·w]`, irradiance and anything; `shares` `[h·w]`, share and trust
    pub fn record(
        &self,
        rec: &mut Recorder<'_>,
        guides: &Guides,
        receivers: &GpuReceivers,
        (parts, shares): (&Buf<[f32; 4]>, &Buf<[f32; 2]>),
        side: u32,
    ) {
        let params = JoinParams { size: guides.size, side, ..JoinParams::default() };
        let kernel = JoinParts {
            params: rec.uniform(&params),
            guide_positions: &guides.positions,
            normals: &receivers.normals,
            parts,
            shares,
            joined: &self.joined,
        };
        rec.dispatch_pixels(&kernel, guides.width(), guides.height());
        rec.copy(&self.joined, 0, parts, self.joined.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::interleave::join;
    use crate::frame::Renderer;
    use crate::gather::Gathered;
    use crate::gpu::testing::{check_kernel, device};
    use crate::math::{hash_u32, unit_f32};
    use crate::surface::{Receivers, ViewFrame};
    use glam::{Vec2, Vec3};

    #[test]
    fn the_kernel_is_as_declared() {
        check_kernel(&JoinParts::INFO);
    }

    #[test]
    fn the_device_joins_as_the_processor_does() {
        let Some(gpu) = device() else { return };
        let cases = [("atrium", [53, 34], 4), ("cornell", [40, 31], 2), ("cornell", [3, 2], 4)];
        for (name, [width, height], side) in cases {
            let shot = manylight_scene::builtin(name).expect(name);
            let renderer = Renderer::new(shot.scene).expect(name);
            let view = ViewFrame::new(&shot.camera, width, height);
            let traced = Receivers::trace(&renderer.world, &view, Vec2::splat(0.5), true);
            let on_device = GpuReceivers::upload(gpu, &traced, |_| Vec3::ZERO).expect("upload");
            let receivers = on_device.download(gpu, &view, Vec2::splat(0.5)).expect("download");
            let random = |i: usize, key: u32| unit_f32(hash_u32(i as u32 ^ hash_u32(key)));
            let mut gathered = Gathered::dark(width * height);
            for (i, sum) in gathered.unshadowed.iter_mut().enumerate() {
                // Some are dark altogether.
                let scale = if i / width < 4 { 0.0 } else { 1.0 };
                *sum = Vec3::new(random(i, 1), random(i, 2), random(i, 3)).powf(3.0) * scale;
            }
            gathered.trust = (0..width * height).map(|i| random(i, 4)).collect();
            let parts: Vec<_> = gathered.unshadowed.iter().map(|c| [c.x, c.y, c.z, 7.0]).collect();
            let shares: Vec<_> = gathered.trust.iter().map(|&trust| [0.5, trust]).collect();
            let parts = gpu.upload("parts", &parts).expect("parts");
            let shares = gpu.upload("shares", &shares).expect("shares");
            join(&mut [&mut gathered], &receivers, &view, side);

            let guides = Guides::new(gpu, width, height).expect("guides");
            let memory = Join::new(gpu, width, height).expect("memory");
            let mut rec = gpu.record(None);
            guides.record(&mut rec, &on_device, &view);
            memory.record(&mut rec, &guides, &on_device, (&parts, &shares), side);
            rec.submit().wait().expect("done");
            let found = gpu.read(&parts, usize::MAX).expect("sums");
            let shares = gpu.read(&shares, usize::MAX).expect("shares");
            for (i, expected) in gathered.unshadowed.iter().enumerate() {
                let [x, y, z, w] = found[i];
                let error = (Vec3::new(x, y, z) - *expected).abs().max_element();
                assert!(w == 7.0 && error < 1e-4, "{name}, pixel {i}: {error}");
                let [share, trust] = shares[i];
                let error = (trust - gathered.trust[i]).abs();
                assert!(share == 0.5 && error < 1e-3 * (1.0 + trust), "{name}, pixel {i}: {error}");
            }
        }
    }
}
