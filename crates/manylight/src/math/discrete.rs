//! Drawing an index in proportion to a weight.

/// A discrete distribution over `0..len`, drawn by binary search.
#[derive(Clone, Debug, Default)]
pub struct Discrete {
    /// Running sums, `[n]`; the last one is the total.
    cumulative: Vec<f64>,
}

impl Discrete {
    /// Weights that are negative or not finite count as zero.
    ///
    /// Cost: O(n), 8 B per weight.
    pub fn new(weights: impl IntoIterator<Item = f32>) -> Self {
        let mut sum = 0.0f64;
        let add = |w: f32| {
            sum += if w.is_finite() && w > 0.0 { f64::from(w) } else { 0.0 };
            sum
        };
        Self { cumulative: weights.into_iter().map(add).collect() }
    }

    /// Sum of all weights.
    pub fn total(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// Sum of the weights up to and including `index`.
    pub fn cumulative_at(&self, index: usize) -> f64 {
        self.cumulative[index]
    }

    /// Draws an index for `u` in 0…1; `None` where every weight is zero.
    #[inline]
    pub fn sample(&self, u: f32) -> Option<usize> {
        let target = f64::from(u) * self.total();
        let index = self.cumulative.partition_point(|&c| c <= target);
        let last = || self.cumulative.iter().rposition(|&c| c < self.total()).map_or(0, |i| i + 1);
        match self.total() > 0.0 {
            true if index < self.cumulative.len() => Some(index),
            true => Some(last()),
            false => None,
        }
    }

    /// Running sums as shares of 2³², for draws with integers alone; the last one is 2³² − 1.
    ///
    /// For u = k/2²⁴ the first entry above k·2⁸ is what [`Discrete::sample`] draws, bit for bit;
    /// there is none where every weight is zero.
    pub fn thresholds(&self) -> Vec<u32> {
        const DRAWS: u32 = 1 << 24;
        let total = self.total();
        let target = |k: u32| f64::from(k) / f64::from(DRAWS) * total;
        let threshold = |&sum: &f64| {
            if sum <= 0.0 {
                return 0;
            }
            let share = sum / total;
            // The first draw that passes the sum, found by the roundings of a draw itself.
            let mut first = ((share * f64::from(DRAWS)).ceil() as u32).clamp(1, DRAWS);
            while first > 1 && target(first - 1) >= sum {
                first -= 1;
            }
            while first < DRAWS && target(first) < sum {
                first += 1;
            }
            let (above, most) = (u64::from(first - 1) << 8, u64::from(first) << 8);
            let exact = (share * 4_294_967_296.0).ceil() as u64;
            exact.clamp(above + 1, most).min(u64::from(u32::MAX)) as u32
        };
        self.cumulative.iter().map(threshold).collect()
    }

    /// Probability of `index`.
    #[inline]
    pub fn pmf(&self, index: usize) -> f32 {
        let below = if index == 0 { 0.0 } else { self.cumulative[index - 1] };
        ((self.cumulative[index] - below) / self.total()) as f32
    }
}
