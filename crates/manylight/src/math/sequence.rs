//! Random numbers that depend on (seed, index, dimension) alone: hashed, Owen-scrambled Sobol.
//!
//! Every stage draws its numbers here, so a path or a pixel gets the same ones whatever thread
//! works on it, and a path keeps its numbers when the scene moves a little.
//! Paper: `[Burley20]`

/// Mixes a 32-bit word (lowbias32).
#[inline]
pub fn hash_u32(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// The top 24 bits as a number in 0…1, never 1.
#[inline]
pub fn unit_f32(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Interleaves the bits of two numbers below 2^16: pixels of a square block are neighbors.
#[inline]
pub fn morton_2d(x: u32, y: u32) -> u32 {
    let spread = |mut v: u32| {
        v &= 0xffff;
        v = (v | v << 8) & 0x00ff_00ff;
        v = (v | v << 4) & 0x0f0f_0f0f;
        v = (v | v << 2) & 0x3333_3333;
        (v | v << 1) & 0x5555_5555
    };
    spread(x) | spread(y) << 1
}

/// Owen scrambling of a bit-reversed word by hashing.
///
/// Source: [Burley20, Listing 3]
#[inline]
fn laine_karras(mut x: u32, seed: u32) -> u32 {
    x = x.wrapping_add(seed);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^ x.wrapping_mul(0x8d22_f6e6)
}

#[inline]
fn owen(x: u32, seed: u32) -> u32 {
    laine_karras(x.reverse_bits(), seed).reverse_bits()
}

/// Second dimension of the Sobol sequence; the first is the bit reversal of the index.
#[inline]
fn sobol_y(index: u32) -> u32 {
    // Its matrix is Pascal's triangle modulo 2: a product of one step for each bit of a place.
    let mut v = index;
    v ^= v >> 16;
    v ^= (v & 0xff00_ff00) >> 8;
    v ^= (v & 0xf0f0_f0f0) >> 4;
    v ^= (v & 0xcccc_cccc) >> 2;
    v ^= (v & 0xaaaa_aaaa) >> 1;
    v.reverse_bits()
}

/// The random numbers of one path or pixel sample, dimension after dimension.
#[derive(Clone, Copy, Debug)]
pub struct Sequence {
    seed: u32,
    index: u32,
    dimension: u32,
}

impl Sequence {
    /// Point `index` of the sequence `seed`. Points of one seed are stratified against each other.
    pub fn new(seed: u32, index: u32) -> Self {
        Self { seed: hash_u32(seed ^ 0x9e37_79b9), index, dimension: 0 }
    }

    /// The next two dimensions, in 0…1.
    #[inline]
    pub fn next_2d(&mut self) -> [f32; 2] {
        let key = hash_u32(self.seed ^ self.dimension.wrapping_mul(0x85eb_ca6b));
        self.dimension += 2;
        let shuffled = owen(self.index, key);
        let x = owen(shuffled.reverse_bits(), hash_u32(key ^ 0x68bc_21eb));
        let y = owen(sobol_y(shuffled), hash_u32(key ^ 0x02e5_be93));
        [unit_f32(x), unit_f32(y)]
    }

    /// The next dimension, in 0…1.
    #[inline]
    pub fn next_1d(&mut self) -> f32 {
        let key = hash_u32(self.seed ^ self.dimension.wrapping_mul(0x85eb_ca6b));
        self.dimension += 1;
        let shuffled = owen(self.index, key);
        unit_f32(owen(shuffled.reverse_bits(), hash_u32(key ^ 0x68bc_21eb)))
    }
}
