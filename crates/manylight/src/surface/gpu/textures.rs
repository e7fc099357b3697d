//! Receivers from the textures that an engine has drawn.

use super::{CONSTANTS, GpuReceivers};
use crate::error::Error;
use crate::gpu::{Recorder, kernel, record};

/// What an engine has drawn; of one size, single-sampled, row 0 at the top.
#[derive(Clone, Copy, Debug)]
pub struct ReceiverTextures<'a> {
    /// World position, and depth along the viewing axis, m: `rgba32float`. No surface where the
    /// depth is not above 0. A position must lie on a triangle of the scene up to a few roundings.
    pub position_depth: &'a wgpu::TextureView,
    /// Shading normal in the world, on the side that is seen.
    pub normal: &'a wgpu::TextureView,
    /// Geometric normal in the world, on the side that is seen; none: the shading normal.
    pub geometric_normal: Option<&'a wgpu::TextureView>,
    /// Diffuse reflectance, linear 0…1.
    pub albedo: &'a wgpu::TextureView,
    /// Radiance towards the eye, W·m⁻²·sr⁻¹; none: black. The sky is added.
    pub emission: Option<&'a wgpu::TextureView>,
}

record! {
    /// What loading needs to know.
    pub struct LoadParams {
        /// Pixels across.
        pub width: u32,
        /// Pixels down.
        pub height: u32,
        /// Whether there are geometric normals.
        pub has_geometric_normals: u32,
        /// Whether there is emission.
        pub has_emissions: u32,
    }
}

kernel! {
    /// Copies an engine's textures.
    struct LoadReceivers = "surface/load", [8, 8, 1], [CONSTANTS];
    uniform params: LoadParams, texture position_depths: [f32; 4],
    texture shading_normals: [f32; 4], texture geometric_normals: [f32; 4],
    texture reflectances: [f32; 4], texture radiances: [f32; 4], write positions: [f32; 4],
    write normals: [f32; 4], write albedos: [f32; 4], write emissions: [f32; 4]
}

/// Every kernel of this file.
#[cfg(test)]
pub(super) const KERNELS: &[&crate::gpu::KernelInfo] = &[&LoadReceivers::INFO];

impl<'a> ReceiverTextures<'a> {
    /// Errors: a texture that is no G-buffer of this size
    pub fn check(&self, size: [usize; 2]) -> Result<(), Error> {
        let usage = wgpu::TextureUsages::TEXTURE_BINDING;
        let exact = wgpu::TextureFormat::Rgba32Float;
        check_texture("positions and depths", self.position_depth, size, usage, Some(exact))?;
        let rest = [
            ("normals", Some(self.normal)),
            ("geometric normals", self.geometric_normal),
            ("albedos", Some(self.albedo)),
            ("emission", self.emission),
        ];
        for (name, texture) in rest {
            texture.map_or(Ok(()), |view| check_texture(name, view, size, usage, None))?;
        }
        Ok(())
    }
}

/// Whether a texture that is not ours can be used; where no format is asked for, one of floats.
///
/// Errors: a sentence that names it
pub(crate) fn check_texture(
    name: &str,
    view: &wgpu::TextureView,
    size: [usize; 2],
    usage: wgpu::TextureUsages,
    format: Option<wgpu::TextureFormat>,
) -> Result<(), Error> {
    let texture = view.texture();
    let found = [texture.width() as usize, texture.height() as usize];
    let is_float = |format: wgpu::TextureFormat| {
        let kind = format.sample_type(None, None);
        format.has_color_aspect() && matches!(kind, Some(wgpu::TextureSampleType::Float { .. }))
    };
    let format_fits = format.map_or(is_float(texture.format()), |f| f == texture.format());
    let is_flat = texture.dimension() == wgpu::TextureDimension::D2
        && texture.sample_count() == 1
        && texture.depth_or_array_layers() == 1;
    let problem = if found != size {
        format!("is {} x {}, and the picture is {} x {}", found[0], found[1], size[0], size[1])
    } else if !format_fits {
        let wanted = format.map_or("floats".to_owned(), |f| format!("{f:?}"));
        format!("holds {:?} instead of {wanted}", texture.format())
    } else if !is_flat {
        "has several samples or layers; give one with a single sample and layer".to_owned()
    } else if !texture.usage().contains(usage) {
        format!("was created without the usage {usage:?}")
    } else {
        return Ok(());
    };
    Err(Error::Device { problem: format!("the texture of {name} {problem}") })
}

impl GpuReceivers {
    /// Copies what an engine has drawn; pixels without a surface emit nothing yet.
    pub fn load(&self, rec: &mut Recorder<'_>, textures: &ReceiverTextures<'_>) {
        let Self { width, height, positions, normals, albedos, emissions } = self;
        let params = rec.uniform(&LoadParams {
            width: *width as u32,
            height: *height as u32,
            has_geometric_normals: u32::from(textures.geometric_normal.is_some()),
            has_emissions: u32::from(textures.emission.is_some()),
        });
        let kernel = LoadReceivers {
            params,
            position_depths: textures.position_depth,
            shading_normals: textures.normal,
            // In the place of what is not there: anything that may be read.
            geometric_normals: textures.geometric_normal.unwrap_or(textures.normal),
            reflectances: textures.albedo,
            radiances: textures.emission.unwrap_or(textures.albedo),
            positions,
            normals,
            albedos,
            emissions,
        };
        rec.dispatch_pixels(&kernel, *width, *height);
    }
}
