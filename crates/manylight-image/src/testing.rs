//! Folders and pictures for the tests of this crate.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use crate::Raster;

/// A folder that is removed at the end of a test.
pub struct Folder(PathBuf);

impl Folder {
    /// Makes an empty folder of its own.
    pub fn new() -> Self {
        static COUNTER: AtomicU32 = AtomicU32::new(0);
        let id = COUNTER.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("manylight-{}-{id}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    /// A path inside.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// How many files lie inside.
    pub fn file_count(&self) -> usize {
        fs::read_dir(&self.0).unwrap().count()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// A repeatable stream of numbers (SplitMix64).
pub struct Stream(pub u64);

impl Stream {
    /// The next 64 bits.
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// The next number in 0..n.
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// A picture of random values, some negative and some bright.
pub fn random_raster(width: usize, height: usize, channels: usize, seed: u64) -> Raster {
    let mut stream = Stream(seed);
    let mut raster = Raster::new(width, height, channels);
    for value in &mut raster.data {
        *value = (stream.next() >> 40) as f32 / (1 << 20) as f32 - 1.0;
    }
    raster
}

/// Calls `read` on every kind of damage: cut short, flipped bytes, noise.
pub fn damage(bytes: &[u8], rounds: usize, mut read: impl FnMut(&[u8])) {
    let mut stream = Stream(7);
    for _ in 0..rounds {
        read(&bytes[..stream.below(bytes.len())]);
        let mut flipped = bytes.to_vec();
        let reach = if stream.below(2) == 0 { bytes.len() } else { bytes.len().min(400) };
        for _ in 0..=stream.below(4) {
            flipped[stream.below(reach)] = stream.next() as u8;
        }
        read(&flipped);
        let noise: Vec<u8> = (0..stream.below(300)).map(|_| stream.next() as u8).collect();
        read(&[&bytes[..bytes.len().min(8)], &noise].concat());
    }
}
