//! A float image in memory.

/// A row-major float image with interleaved channels, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Values per pixel: 1 or 3.
    pub channels: usize,
    /// `[height · width · channels]`.
    pub data: Vec<f32>,
}

impl Raster {
    /// An image of zeros.
    pub fn new(width: usize, height: usize, channels: usize) -> Self {
        Self { width, height, channels, data: vec![0.0; width * height * channels] }
    }

    /// The values of one pixel.
    pub fn pixel(&self, x: usize, y: usize) -> &[f32] {
        let start = (y * self.width + x) * self.channels;
        &self.data[start..start + self.channels]
    }
}

/// A picture with its named layers and metadata: what one EXR file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct LayeredImage {
    /// The root layer R, G, B, linear Rec.709.
    pub beauty: Raster,
    /// Named layers of the same size, one or three channels each.
    pub layers: Vec<(String, Raster)>,
    /// Text attributes, name and value.
    pub metadata: Vec<(String, String)>,
}
