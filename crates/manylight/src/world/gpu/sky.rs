//! A map of the sky on the device.
//!
//! In: [`SkyTexels`] · Out: a texture of 16 B a texel
//! Limits: as many texels along a side as the device's largest texture has.

use super::textures::{refused, write};
use crate::error::Error;
use crate::gpu::{Gpu, HeldBytes};

/// Words of the light sources, and the map of the sky among them.
#[derive(Clone, Debug, Default)]
pub struct SourceLists {
    /// What `emitter` packs.
    pub words: Vec<u32>,
    /// The map; empty without one.
    pub sky: SkyTexels,
}

/// Texels of a map of the sky.
#[derive(Clone, Debug, Default)]
pub struct SkyTexels {
    /// Texels across and down.
    pub size: [u32; 2],
    /// Bits of the radiance of each, and a word that `emitter` gives a meaning.
    pub texels: Vec<[u32; 4]>,
}

/// The texture that holds them.
#[derive(Debug)]
pub(super) struct SkyTexture {
    pub view: wgpu::TextureView,
    _held: HeldBytes,
}

impl SkyTexture {
    /// Errors: more texels along a side than the device allows
    pub fn upload(gpu: &Gpu, sky: &SkyTexels) -> Result<Self, Error> {
        let most = gpu.limits().max_texture_dimension_2d;
        check_size(sky.size, most).map_err(|problem| refused(gpu, &problem))?;
        // A binding may not be empty.
        let [width, height] = sky.size.map(|side| side.max(1));
        let texture = gpu.device().create_texture(&wgpu::TextureDescriptor {
            label: Some("map of the sky"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        if !sky.texels.is_empty() {
            write(gpu, &texture, wgpu::Origin3d::ZERO, sky.size, &sky.texels);
        }
        let bytes = 16 * u64::from(width) * u64::from(height);
        let view = texture.create_view(&Default::default());
        Ok(Self { view, _held: gpu.hold_bytes("map of the sky", bytes) })
    }
}

/// Errors: a sentence that names the limit
fn check_size([width, height]: [u32; 2], most: u32) -> Result<(), String> {
    match width.max(height) <= most {
        true => Ok(()),
        false => Err(format!(
            "the map of the sky has {width} x {height} texels, and at most {most} along a side are \
             allowed; make it smaller"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::check_size;

    #[test]
    fn large_maps_fit_the_smallest_limits() {
        let most = wgpu::Limits::defaults().max_texture_dimension_2d;
        for size in [[4096, 2048], [8192, 4096]] {
            assert_eq!(check_size(size, most), Ok(()));
        }
        let problem = check_size([16384, 8192], most).expect_err("too large");
        assert!(problem.contains("16384 x 8192") && problem.contains("8192 along"), "{problem}");
    }
}
