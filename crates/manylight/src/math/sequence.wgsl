// Random numbers that depend on (seed, index, dimension) alone; twin of sequence.rs, bit for bit.

// Mixes a 32-bit word (lowbias32).
fn hash_u32(word: u32) -> u32 {
    var x = word;
    x ^= x >> 16u;
    x *= 0x7feb352du;
    x ^= x >> 15u;
    x *= 0x846ca68bu;
    return x ^ (x >> 16u);
}

// The top 24 bits as a number in 0…1, never 1.
fn unit_f32(bits: u32) -> f32 {
    return f32(bits >> 8u) * (1.0 / 16777216.0);
}

fn spread_2d(word: u32) -> u32 {
    var v = word & 0xffffu;
    v = (v | (v << 8u)) & 0x00ff00ffu;
    v = (v | (v << 4u)) & 0x0f0f0f0fu;
    v = (v | (v << 2u)) & 0x33333333u;
    return (v | (v << 1u)) & 0x55555555u;
}

// Interleaves the bits of two numbers below 2^16.
fn morton_2d(x: u32, y: u32) -> u32 {
    return spread_2d(x) | (spread_2d(y) << 1u);
}

// Owen scrambling of a bit-reversed word by hashing. Source: [Burley20, Listing 3]
fn laine_karras(word: u32, seed: u32) -> u32 {
    var x = word + seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    return x ^ (x * 0x8d22f6e6u);
}

fn owen(x: u32, seed: u32) -> u32 {
    return reverseBits(laine_karras(reverseBits(x), seed));
}

// Second dimension of the Sobol sequence; the first is the bit reversal of the index.
fn sobol_y(position: u32) -> u32 {
    // Its matrix is Pascal's triangle modulo 2: a product of one step for each bit of a place.
    var v = position;
    v ^= v >> 16u;
    v ^= (v & 0xff00ff00u) >> 8u;
    v ^= (v & 0xf0f0f0f0u) >> 4u;
    v ^= (v & 0xccccccccu) >> 2u;
    v ^= (v & 0xaaaaaaaau) >> 1u;
    return reverseBits(v);
}

// The random numbers of one path or pixel sample, dimension after dimension.
struct Sequence {
    seed: u32,
    index: u32,
    dimension: u32,
}

fn new_sequence(seed: u32, index: u32) -> Sequence {
    return Sequence(hash_u32(seed ^ 0x9e3779b9u), index, 0u);
}

// The next two dimensions, in 0…1.
fn next_2d(s: ptr<function, Sequence>) -> vec2f {
    let key = hash_u32((*s).seed ^ ((*s).dimension * 0x85ebca6bu));
    (*s).dimension += 2u;
    let shuffled = owen((*s).index, key);
    let x = owen(reverseBits(shuffled), hash_u32(key ^ 0x68bc21ebu));
    let y = owen(sobol_y(shuffled), hash_u32(key ^ 0x02e5be93u));
    return vec2f(unit_f32(x), unit_f32(y));
}

// The next dimension, in 0…1.
fn next_1d(s: ptr<function, Sequence>) -> f32 {
    let key = hash_u32((*s).seed ^ ((*s).dimension * 0x85ebca6bu));
    (*s).dimension += 1u;
    let shuffled = owen((*s).index, key);
    return unit_f32(owen(reverseBits(shuffled), hash_u32(key ^ 0x68bc21ebu)));
}
