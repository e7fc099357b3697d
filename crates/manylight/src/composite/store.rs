//! Planes into textures that someone else owns.

use crate::gpu::{Buf, KernelInfo, Recorder, kernel, record};

record! {
    /// What storing needs to know.
    pub struct StoreParams {
        /// Pixels across.
        pub width: u32,
        /// Pixels down.
        pub height: u32,
    }
}

kernel! {
    /// Copies a plane into a texture.
    struct StorePlane = "composite/store", [8, 8, 1];
    uniform params: StoreParams, read colors: [f32; 4], read fourths: [f32; 4],
    store texels: [f32; 4]
}

/// Every kernel of this file.
pub const KERNELS: &[&KernelInfo] = &[&StorePlane::INFO];

/// Copies the first three numbers of one plane and the fourth of another into a texture of format
/// [`STORE_FORMAT`](crate::gpu::STORE_FORMAT), row 0 at the top.
pub fn record_store(
    rec: &mut Recorder<'_>,
    [width, height]: [usize; 2],
    [colors, fourths]: [&Buf<[f32; 4]>; 2],
    texels: &wgpu::TextureView,
) {
    let params = rec.uniform(&StoreParams { width: width as u32, height: height as u32 });
    let kernel = StorePlane { params, colors, fourths, texels };
    rec.dispatch_pixels(&kernel, width, height);
}
