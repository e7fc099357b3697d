//! Rectangles on pages of one size.
//!
//! In: sizes, the largest page · Out: [`Pages`]
//! Limits: a few hundred sizes of a page are tried; no rectangle is turned.

/// Widths and heights of pages that are tried: multiples of the largest rectangle's up to this one.
const MOST_MULTIPLE: u32 = 8;
/// Rectangles that are placed for one height of a page and one order, about.
const MOST_TRIES: usize = 8192;
/// Rectangles beyond which only the largest page is tried, in one order.
const MANY: usize = 4096;

/// Where rectangles lie.
#[derive(Clone, Debug)]
pub(super) struct Pages {
    /// Width of every page.
    pub width: u32,
    /// Height that is used of each.
    pub heights: Vec<u32>,
    /// Page, column and row of each rectangle's first corner.
    pub corners: Vec<[u32; 3]>,
}

impl Pages {
    /// Places all rectangles on pages of at most `most` a side: of the sizes tried the one that
    /// takes the least room on at most `most_pages`, then the fewest pages; more than `most_pages`
    /// only where every size takes more.
    ///
    /// Rectangles must be at most `most` a side themselves.
    /// Cost: O(candidates · rectangles · (pages + steps of a page's outline))
    pub fn pack(sizes: &[[u32; 2]], most: u32, most_pages: u32) -> Self {
        let orders = [[1, 0], [0, 1]].map(|[first, second]| {
            let mut order: Vec<usize> = (0..sizes.len()).collect();
            order.sort_by_key(|&i| (std::cmp::Reverse([sizes[i][first], sizes[i][second]]), i));
            order
        });
        // Few rectangles leave gaps unless the width suits them; many do not mind.
        let parts = MOST_TRIES / (MOST_MULTIPLE as usize * sizes.len().max(1));
        let is_many = sizes.len() > MANY;
        let sides = |axis, parts: usize| match is_many {
            true => vec![most],
            false => sides(sizes, axis, most, parts as u32),
        };
        let (widths, heights) = (sides(0, parts.min(32)), sides(1, parts.min(1)));
        let orders = if is_many { &orders[..1] } else { &orders };
        let all = widths.iter().flat_map(|&w| heights.iter().map(move |&h| [w, h]));
        let tries = orders.iter().flat_map(|order| all.clone().map(move |page| (order, page)));
        let pages = tries.map(|(order, page)| Self::fill(sizes, order, page));
        let cost = |p: &Self| {
            let count = p.heights.len();
            let too_many = count.saturating_sub(most_pages as usize);
            (too_many, p.texels(), count, p.width.max(p.height()))
        };
        pages.min_by_key(cost).expect("one size at least is tried")
    }

    /// Height of all pages where they have the same.
    pub fn height(&self) -> u32 {
        self.heights.iter().copied().max().unwrap_or(1)
    }

    /// Room that pages of the same height take.
    fn texels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height()) * self.heights.len() as u64
    }

    /// Each rectangle on the first page that has room, as high up and then as far left as it goes.
    fn fill(sizes: &[[u32; 2]], order: &[usize], page: [u32; 2]) -> Self {
        let mut outlines: Vec<Outline> = Vec::new();
        let mut corners = vec![[0; 3]; sizes.len()];
        for &i in order {
            let mut open = outlines.iter_mut().enumerate();
            let found = open.find_map(|(n, o)| o.place(sizes[i], page).map(|at| (n, at)));
            let (n, [x, y]) = found.unwrap_or_else(|| {
                let mut outline = Outline { steps: vec![[0, 0]] };
                let at = outline.place(sizes[i], page).expect("no page is smaller");
                outlines.push(outline);
                (outlines.len() - 1, at)
            });
            corners[i] = [n as u32, x, y];
        }
        let lowest = |o: Outline| o.steps.iter().map(|s| s[1]).max().unwrap_or(0);
        Self { width: page[0], heights: outlines.into_iter().map(lowest).collect(), corners }
    }
}

/// Lengths to try along an axis: multiples of a part of the longest rectangle's, if it has any,
/// that itself, powers of two, the most.
fn sides(sizes: &[[u32; 2]], axis: usize, most: u32, parts: u32) -> Vec<u32> {
    let longest = sizes.iter().map(|s| s[axis]).max().unwrap_or(1);
    let part = longest.div_ceil(parts.max(1));
    let multiples = (1..=MOST_MULTIPLE * parts).map(|k| part.saturating_mul(k));
    let powers = (0..32).map(|k| 1 << k).chain([longest, most]);
    let mut sides: Vec<u32> =
        multiples.chain(powers).filter(|side| (longest..=most).contains(side)).collect();
    sides.sort_unstable();
    sides.dedup();
    sides
}

/// What is taken of a page: all above a line of steps.
struct Outline {
    /// First column and lower edge of each, from left to right.
    steps: Vec<[u32; 2]>,
}

impl Outline {
    /// Takes room for a rectangle below the line; none where the page ends before.
    fn place(&mut self, [width, height]: [u32; 2], page: [u32; 2]) -> Option<[u32; 2]> {
        let rows = (0..self.steps.len()).filter_map(|i| {
            let x = self.steps[i][0];
            let end = x.checked_add(width).filter(|&end| end <= page[0])?;
            let under = self.steps[i..].iter().take_while(|s| s[0] < end);
            let y = under.map(|s| s[1]).max()?;
            y.checked_add(height).filter(|&low| low <= page[1]).map(|_| (y, x, i))
        });
        let (y, x, first) = rows.min()?;
        let end = x + width;
        let covered = self.steps[first..].iter().take_while(|s| s[0] < end).count();
        let last = first + covered;
        let rest = self.steps[last - 1][1];
        let next = self.steps.get(last).map_or(page[0], |s| s[0]);
        let tail = (end < next).then_some([end, rest]);
        self.steps.splice(first..last, [[x, y + height]].into_iter().chain(tail));
        Some([x, y])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash_u32;

    /// No two rectangles overlap, and all are inside; the share of the pages that they fill.
    fn check(sizes: &[[u32; 2]], most: u32) -> f64 {
        let pages = Pages::pack(sizes, most, 256);
        assert!(pages.width <= most && pages.height() <= most);
        for (i, (a, size)) in pages.corners.iter().zip(sizes).enumerate() {
            let [right, low] = [a[1] + size[0], a[2] + size[1]];
            assert!(right <= pages.width && low <= pages.heights[a[0] as usize], "{i}: {a:?}");
            for (b, other) in pages.corners.iter().zip(sizes).skip(i + 1) {
                let apart = a[0] != b[0]
                    || right <= b[1]
                    || b[1] + other[0] <= a[1]
                    || low <= b[2]
                    || b[2] + other[1] <= a[2];
                assert!(apart, "{a:?} {size:?} and {b:?} {other:?}");
            }
        }
        let area = sizes.iter().map(|s| u64::from(s[0]) * u64::from(s[1])).sum::<u64>();
        area as f64 / pages.texels() as f64
    }

    #[test]
    fn nothing_overlaps_and_little_is_left_over() {
        let noise = |i: u32| 1 + hash_u32(i) % 700;
        let any: Vec<[u32; 2]> = (0..150).map(|i| [noise(2 * i), noise(2 * i + 1)]).collect();
        assert!(check(&any, 8192) > 0.9);
        // As color and normal maps of Sponza.
        let pairs: Vec<[u32; 2]> = (0..48).map(|i| [1024 >> (i % 2); 2]).collect();
        assert!(check(&pairs, 8192) == 1.0);
        assert!(check(&[[300, 7000]; 61], 8192) > 0.8);
        assert!(check(&[[1, 1], [8192, 1], [1, 8192]], 8192) > 0.0);
        assert!(check(&[[5, 3]], 8192) == 1.0);
        // Small ones would fill many pages best.
        let small: Vec<[u32; 2]> = (0..1100).map(|i| [1 + i % 5, 1 + i % 7]).collect();
        assert!(check(&small, 8192) > 0.9);
        assert!(Pages::pack(&small, 8192, 256).heights.len() <= 256);
        // Very many.
        let pages = Pages::pack(&[[1, 1]; 100_000], 8192, 256);
        assert_eq!((pages.heights.len(), pages.height()), (1, 13));
        // More than one page holds.
        assert!(check(&[[600, 600]; 9], 1024) > 0.9);
    }

    #[test]
    fn nothing_needs_no_page() {
        let pages = Pages::pack(&[], 8192, 256);
        assert!(pages.corners.is_empty() && pages.heights.is_empty());
    }
}
