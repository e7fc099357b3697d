//! Sorting by integer keys, and the codes of cells that are sorted.

use rayon::prelude::*;
use std::slice::IterMut;

/// Bits that one pass looks at.
const DIGIT_BITS: u32 = 8;
const DIGITS: usize = 1 << DIGIT_BITS;
/// Fewest and most parts that a pass works on at once.
const PART_LEN: usize = 1 << 14;
const MOST_PARTS: usize = 64;

/// A key and what it belongs to.
pub(super) type Keyed = (u64, u32);

/// Sorts by the lowest `bits` bits of the keys; equal keys keep their order.
///
/// Every part of the input writes to places of its own: one result at any thread count.
/// Cost: two passes over the items per eight bits in which keys differ
pub(super) fn sort_by_key(items: Vec<Keyed>, bits: u32) -> Vec<Keyed> {
    let mut from = items;
    let mut to = from.clone();
    for shift in (0..bits).step_by(DIGIT_BITS as usize) {
        if sort_by_digit(&from, &mut to, shift) {
            std::mem::swap(&mut from, &mut to);
        }
    }
    from
}

/// One stable pass over the digit at bit `shift`; false if all digits are equal, and nothing is
/// written.
fn sort_by_digit(from: &[Keyed], to: &mut [Keyed], shift: u32) -> bool {
    let digit = |item: &Keyed| (item.0 >> shift) as usize % DIGITS;
    let part_len = from.len().div_ceil(MOST_PARTS).max(PART_LEN);
    let count = |part: &[Keyed]| {
        let mut counts = [0usize; DIGITS];
        part.iter().for_each(|item| counts[digit(item)] += 1);
        counts
    };
    let counts: Vec<[usize; DIGITS]> = from.par_chunks(part_len).map(count).collect();
    let total = |digit: usize| counts.iter().map(|c| c[digit]).sum::<usize>();
    if (0..DIGITS).any(|digit| total(digit) == from.len()) {
        return false;
    }
    // The places of each part, by digit.
    let mut places: Vec<Vec<IterMut<Keyed>>> = counts.iter().map(|_| Vec::new()).collect();
    let mut rest = to;
    for digit in 0..DIGITS {
        for (places, counts) in places.iter_mut().zip(&counts) {
            let (own, others) = rest.split_at_mut(counts[digit]);
            places.push(own.iter_mut());
            rest = others;
        }
    }
    from.par_chunks(part_len).zip(places).for_each(|(part, mut places)| {
        for item in part {
            *places[digit(item)].next().expect("a place for each that was counted") = *item;
        }
    });
    true
}

/// Interleaved bits of a cell's coordinates: the code of the cell around it is shifted by three.
pub(super) fn morton(cell: [u32; 3]) -> u64 {
    spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2
}

/// Coordinates of a cell from its code.
pub(super) fn position_of(code: u64) -> [u32; 3] {
    std::array::from_fn(|axis| gather(code >> axis))
}

/// Puts two zero bits between the bits of a number below 2^21.
fn spread(x: u32) -> u64 {
    let mut x = u64::from(x);
    x = (x | x << 32) & 0x1f_0000_0000_ffff;
    x = (x | x << 16) & 0x1f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// Takes every third bit.
fn gather(x: u64) -> u32 {
    let mut x = x & 0x1249_2492_4924_9249;
    x = (x | x >> 2) & 0x10c3_0c30_c30c_30c3;
    x = (x | x >> 4) & 0x100f_00f0_0f00_f00f;
    x = (x | x >> 8) & 0x1f_0000_ff00_00ff;
    x = (x | x >> 16) & 0x1f_0000_0000_ffff;
    (x | x >> 32) as u32 & 0x1f_ffff
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash_u32;

    #[test]
    fn sorting_is_stable() {
        for (count, bits, mask) in
            [(0, 42, 0), (1, 42, 9), (100_000, 42, 0x3_ff00_00ff), (5000, 3, 7)]
        {
            let key = |i: u32| (u64::from(hash_u32(i)) << 10 | u64::from(hash_u32(!i))) & mask;
            let items: Vec<Keyed> = (0..count).map(|i| (key(i), i)).collect();
            let mut expected = items.clone();
            expected.sort();
            assert_eq!(sort_by_key(items, bits), expected);
        }
    }

    #[test]
    fn codes_nest() {
        let code = morton([5, 3, 8191]);
        assert_eq!(position_of(code), [5, 3, 8191]);
        assert_eq!(code >> 3, morton([2, 1, 4095]));
        assert_eq!(morton([1, 0, 0]) | morton([0, 1, 0]) << 3, 0b10_001);
    }
}
