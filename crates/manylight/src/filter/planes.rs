//! Several numbers per pixel.

/// Floats of a cache line.
const LINE: usize = 16;
/// Rows shorter than this need no room between them: those of all channels fit a cache together.
const LEAST_PADDED: usize = 256;

/// Channels of a picture. A row holds the row of every channel, one after the other.
pub(super) struct Planes {
    pub width: usize,
    pub height: usize,
    pub channels: usize,
    /// From one channel of a row to the next: where rows are long an odd number of cache lines,
    /// so that the same pixel of many channels does not fall into the same few places of the cache.
    pub stride: usize,
    pub data: Vec<f32>,
}

impl Planes {
    /// All zero.
    pub fn new(width: usize, height: usize, channels: usize) -> Self {
        let stride = if width < LEAST_PADDED { width } else { (width.div_ceil(LINE) | 1) * LINE };
        Self { width, height, channels, stride, data: vec![0.0; height * channels * stride] }
    }

    /// From one row to the next.
    pub fn pitch(&self) -> usize {
        self.channels * self.stride
    }

    /// `n` pixels of a channel from (x, y) on.
    #[inline(always)]
    pub fn run(&self, channel: usize, [x, y]: [usize; 2], n: usize) -> &[f32] {
        let start = (y * self.channels + channel) * self.stride + x;
        &self.data[start..start + n]
    }

    /// All pixels of a channel.
    pub fn channel(&self, channel: usize) -> Vec<f32> {
        (0..self.height).flat_map(|y| self.run(channel, [0, y], self.width)).copied().collect()
    }
}
