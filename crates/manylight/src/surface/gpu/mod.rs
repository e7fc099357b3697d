//! Receivers on the graphics device: four planes of four numbers a pixel.
//!
//! A plane of 3840 × 2160 pixels fits the smallest binding that a device may allow.

mod textures;

pub use textures::ReceiverTextures;
pub(crate) use textures::check_texture;

use super::{PixelSample, Receivers, SurfacePoint, ViewFrame};
use crate::error::Error;
use crate::gpu::{Buf, Constant, Gpu, Recorder, Value, dispatches_of, kernel, record};
use glam::{Vec2, Vec3};

/// Depth of pixels that see no surface.
pub const NO_SURFACE: f32 = f32::MAX;

/// Constants of `receivers.wgsl`.
pub const CONSTANTS: &[Constant] =
    &[Constant { name: "NO_SURFACE", value: Value::F32(NO_SURFACE) }];

record! {
    /// [`ViewFrame`] as shaders read it.
    pub struct ViewRecord {
        /// The eye.
        pub position: [f32; 3],
        /// Pixels across.
        pub width: u32,
        /// Unit viewing direction.
        pub forward: [f32; 3],
        /// Pixels down.
        pub height: u32,
        /// Half the picture's extent to the right: at distance 1, or in metres if orthographic.
        pub half_right: [f32; 3],
        /// 1 if so, 0 if orthographic.
        pub perspective: u32,
        /// Half the picture's extent upward.
        pub half_up: [f32; 3],
        /// Where in a pixel rays start, from its left.
        pub offset_x: f32,
        /// And from its top.
        pub offset_y: f32,
        /// Nothing.
        pub _pad: [u32; 3],
    }
}

record! {
    /// What the camera rays need to know.
    pub struct ReceiverParams {
        /// The camera.
        pub view: ViewRecord,
        /// Whether normal textures bend the shading normal.
        pub normal_maps: u32,
        /// First row.
        pub first_row: u32,
        /// Nothing.
        pub _pad: [u32; 2],
    }
}

kernel! {
    /// One ray through every pixel.
    struct TraceReceivers = "surface/receivers", [8, 8, 1], scene,
        [CONSTANTS, crate::world::gpu::CONSTANTS, crate::bvh::gpu::CONSTANTS];
    uniform params: ReceiverParams, write positions: [f32; 4], write normals: [f32; 4],
    write albedos: [f32; 4], write emissions: [f32; 4]
}

/// Every kernel of this room.
#[cfg(test)]
pub(crate) const KERNELS: &[&[&crate::gpu::KernelInfo]] =
    &[&[&TraceReceivers::INFO], textures::KERNELS];

impl ViewRecord {
    /// A view whose rays start at `offset_px` from a pixel's top left corner.
    pub fn new(view: &ViewFrame, offset_px: Vec2) -> Self {
        Self {
            position: view.position.to_array(),
            width: view.width as u32,
            forward: view.forward.to_array(),
            height: view.height as u32,
            half_right: view.half[0].to_array(),
            perspective: u32::from(view.perspective),
            half_up: view.half[1].to_array(),
            offset_x: offset_px.x,
            offset_y: offset_px.y,
            ..Self::default()
        }
    }
}

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

    /// Traces one ray through each pixel at `offset_px` from the pixel's top left corner; pixels
    /// without a surface emit nothing yet.
    pub fn trace(
        &self,
        rec: &mut Recorder<'_>,
        view: &ViewFrame,
        offset_px: Vec2,
        normal_maps: bool,
    ) {
        let view = ViewRecord::new(view, offset_px);
        let normal_maps = u32::from(normal_maps);
        let Self { width, height, positions, normals, albedos, emissions } = self;
        for rows in dispatches_of(*height, *width) {
            let first_row = rows.start as u32;
            let params =
                rec.uniform(&ReceiverParams { view, normal_maps, first_row, _pad: [0; 2] });
            let kernel = TraceReceivers { params, positions, normals, albedos, emissions };
            rec.dispatch_pixels(&kernel, *width, rows.len());
        }
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
        let planes = [&self.positions, &self.normals, &self.albedos, &self.emissions];
        let planes = gpu.read_each(&planes, pixels, |_, plane| plane.to_vec())?;
        let [positions, normals, albedos, emissions] =
            planes.try_into().expect("as many as there are planes");
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

/// A unit vector in two times 16 bits; off by at most 7e-5.
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

#[cfg(test)]
mod tests;
