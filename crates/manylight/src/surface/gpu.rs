//! Receivers on the graphics device: four planes of four numbers a pixel.
//!
//! A plane of 3840 × 2160 pixels fits the smallest binding that a device may allow.

use super::{PixelSample, Receivers, SurfacePoint, ViewFrame};
use crate::error::Error;
use crate::gpu::{Buf, Gpu};
use glam::{Vec2, Vec3};

/// Depth of pixels that see no surface.
pub const NO_SURFACE: f32 = f32::MAX;

/// The receivers of a picture on the device, row-major from the top.
#[derive(Debug)]
pub struct GpuReceivers {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// World position and depth along the viewing axis, [`NO_SURFACE`] where there is none.
    pub positions: Buf<[f32; 4]>,
    /// Unit shading normal, and the geometric one by [`pack_octahedral`] in the bits of the fourth.
    pub normals: Buf<[f32; 4]>,
    /// Diffuse reflectance; the fourth is unused.
    pub albedos: Buf<[f32; 4]>,
    /// Radiance towards the eye, of the sky too, W·m⁻²·sr⁻¹; the fourth is unused.
    pub emissions: Buf<[f32; 4]>,
}

impl GpuReceivers {
    /// Room for the receivers of a picture.
    ///
    /// Errors: more pixels than the device can hold in one list
    pub fn new(gpu: &Gpu, width: usize, height: usize) -> Result<Self, Error> {
        let pixels = width * height;
        Ok(Self {
            width,
            height,
            positions: gpu.buffer("receiver positions", pixels)?,
            normals: gpu.buffer("receiver normals", pixels)?,
            albedos: gpu.buffer("receiver albedos", pixels)?,
            emissions: gpu.buffer("receiver emissions", pixels)?,
        })
    }

    /// Copies receivers to the device; `sky` is the radiance from a direction.
    ///
    /// Errors: as [`GpuReceivers::new`]
    pub fn upload(
        gpu: &Gpu,
        receivers: &Receivers,
        sky: impl Fn(Vec3) -> Vec3,
    ) -> Result<Self, Error> {
        let planes = Self::new(gpu, receivers.width, receivers.height)?;
        let four = |v: Vec3, w: f32| v.extend(w).to_array();
        let each = |f: &dyn Fn(&PixelSample) -> [f32; 4]| -> Vec<[f32; 4]> {
            receivers.samples.iter().map(f).collect()
        };
        let surface = |s: &PixelSample, f: &dyn Fn(&SurfacePoint) -> [f32; 4]| {
            s.surface.as_ref().map_or([0.0; 4], f)
        };
        gpu.write(
            &planes.positions,
            &each(&|s| match &s.surface {
                Some(p) => four(p.position, s.depth),
                None => four(Vec3::ZERO, NO_SURFACE),
            }),
        );
        gpu.write(
            &planes.normals,
            &each(&|s| surface(s, &|p| four(p.ns, f32::from_bits(pack_octahedral(p.ng))))),
        );
        gpu.write(&planes.albedos, &each(&|s| surface(s, &|p| four(p.albedo, 0.0))));
        gpu.write(
            &planes.emissions,
            &each(&|s| match &s.surface {
                Some(p) => four(p.emission, 0.0),
                None => four(sky(s.direction), 0.0),
            }),
        );
        Ok(planes)
    }

    /// Copies receivers back; directions come from the view, `unlit` is lost.
    ///
    /// Errors: what the device reported
    pub fn download(
        &self,
        gpu: &Gpu,
        view: &ViewFrame,
        offset_px: Vec2,
    ) -> Result<Receivers, Error> {
        let pixels = self.width * self.height;
        let positions = gpu.read(&self.positions, pixels)?;
        let normals = gpu.read(&self.normals, pixels)?;
        let albedos = gpu.read(&self.albedos, pixels)?;
        let emissions = gpu.read(&self.emissions, pixels)?;
        let three = |[x, y, z, _]: [f32; 4]| Vec3::new(x, y, z);
        let sample = |i: usize| {
            let pixel = Vec2::new((i % self.width) as f32, (i / self.width) as f32);
            let direction = view.ray(pixel + offset_px).direction;
            let depth = positions[i][3];
            let surface = (depth < NO_SURFACE).then(|| SurfacePoint {
                position: three(positions[i]),
                ng: unpack_octahedral(normals[i][3].to_bits()),
                ns: three(normals[i]),
                albedo: three(albedos[i]),
                emission: three(emissions[i]),
                unlit: false,
            });
            let depth = if surface.is_some() { depth } else { f32::INFINITY };
            PixelSample { surface, direction, depth }
        };
        let samples = (0..pixels).map(sample).collect();
        Ok(Receivers { width: self.width, height: self.height, samples })
    }
}

/// A unit vector in two times 16 bits; off by at most 5e-5.
pub fn pack_octahedral(n: Vec3) -> u32 {
    let scale = 1.0 / (n.x.abs() + n.y.abs() + n.z.abs()).max(1e-30);
    let mut p = Vec2::new(n.x, n.y) * scale;
    if n.z < 0.0 {
        let sign = Vec2::new(1f32.copysign(p.x), 1f32.copysign(p.y));
        p = (Vec2::ONE - Vec2::new(p.y, p.x).abs()) * sign;
    }
    // As pack2x16snorm, with halves rounded up.
    let code = |v: f32| (v.clamp(-1.0, 1.0) * 32_767.0 + 0.5).floor() as i32 as u32 & 0xffff;
    code(p.x) | code(p.y) << 16
}

/// The unit vector of [`pack_octahedral`].
pub fn unpack_octahedral(bits: u32) -> Vec3 {
    let value = |code: u32| (f32::from(code as u16 as i16) / 32_767.0).max(-1.0);
    let (x, y) = (value(bits & 0xffff), value(bits >> 16));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let away = |v: f32| if v >= 0.0 { v - fold } else { v + fold };
    Vec3::new(away(x), away(y), z).normalize()
}
