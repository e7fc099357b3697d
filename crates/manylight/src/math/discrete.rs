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

    /// Probability of `index`.
    #[inline]
    pub fn pmf(&self, index: usize) -> f32 {
        let below = if index == 0 { 0.0 } else { self.cumulative[index - 1] };
        ((self.cumulative[index] - below) / self.total()) as f32
    }
}
