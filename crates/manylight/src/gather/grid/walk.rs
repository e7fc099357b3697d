//! The inner loops: all lights of a tile at one row of receivers, and the draw of one of them.
//!
//! Lights are stored in runs of eight, side by side. The walk takes one light at a time for eight
//! receivers; a draw takes the eight lights of one run at a time for one receiver. Both compute a
//! light's share by the same lines.
//!
//! On x86-64 the loops are compiled twice: for every processor, and with AVX2 and fused
//! multiply-add where the processor has them. The two differ in their last bits.

use super::contribution;
use super::tiles::TileLight;

/// Receivers that the walk works on at once: one row of a tile.
pub(super) const LANES: usize = super::sample::TILE;
/// Lights between two stored running weights.
pub(super) const RUN: usize = 8;

pub(super) type Lanes = [f32; LANES];
type Eight = [f32; RUN];

/// Eight lights side by side; what [`TileLight`] says of each.
#[derive(Clone, Copy, Debug, Default)]
struct Run {
    position: [Eight; 3],
    normal: [Eight; 3],
    variance_4: [Eight; 3],
    nearest_sq: Eight,
    far: Eight,
    nearer: Eight,
    normal_spread_3: Eight,
    intensity: [Eight; 3],
    shadow_weight: Eight,
    rise: [Eight; 2],
    fall: [Eight; 2],
    level: [u32; RUN],
    index: [u32; RUN],
}

/// Light `k` of each component. (An index each: mapping arrays would copy them.)
#[inline(always)]
fn pick<const N: usize>(components: &[Eight; N], k: usize) -> [f32; N] {
    std::array::from_fn(|i| components[i][k])
}

impl Run {
    /// Light `k` as far as its share is concerned.
    #[inline(always)]
    fn at(&self, k: usize) -> TileLight {
        TileLight {
            position: pick(&self.position, k),
            normal: pick(&self.normal, k),
            variance_4: pick(&self.variance_4, k),
            nearest_sq: self.nearest_sq[k],
            far: self.far[k],
            nearer: self.nearer[k],
            normal_spread_3: self.normal_spread_3[k],
            intensity: pick(&self.intensity, k),
            shadow_weight: self.shadow_weight[k],
            rise: pick(&self.rise, k),
            fall: pick(&self.fall, k),
            level: self.level[k],
            index: self.index[k],
            ..TileLight::default()
        }
    }

    fn set(&mut self, k: usize, light: &TileLight) {
        for axis in 0..3 {
            self.position[axis][k] = light.position[axis];
            self.normal[axis][k] = light.normal[axis];
            self.variance_4[axis][k] = light.variance_4[axis];
            self.intensity[axis][k] = light.intensity[axis];
        }
        self.nearest_sq[k] = light.nearest_sq;
        self.far[k] = light.far;
        self.nearer[k] = light.nearer;
        self.normal_spread_3[k] = light.normal_spread_3;
        self.shadow_weight[k] = light.shadow_weight;
        for end in 0..2 {
            self.rise[end][k] = light.rise[end];
            self.fall[end][k] = light.fall[end];
        }
        (self.level[k], self.index[k]) = (light.level, light.index);
    }
}

/// The lights of a tile, and the running shadow weights of the row at hand.
#[derive(Debug, Default)]
pub(super) struct TileList {
    runs: Vec<Run>,
    /// Running shadow weight of every lane after every run.
    weights: Vec<Lanes>,
    /// Lights; the last run is filled up with lights that give nothing.
    count: usize,
}

/// Some receivers with their running sums.
#[derive(Debug, Default)]
pub(super) struct Row {
    pub position: [Lanes; 3],
    pub normal: [Lanes; 3],
    pub sum: [Lanes; 3],
    pub evals: Lanes,
}

/// A light drawn for a shadow ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Draw {
    /// Level, 0 for a virtual light itself, and index in it.
    pub level: u32,
    pub index: u32,
    /// Its geometry term, before blending.
    pub geometry: f32,
}

impl TileList {
    pub(super) fn clear(&mut self) {
        self.runs.clear();
        self.count = 0;
    }

    pub(super) fn push(&mut self, light: &TileLight) {
        if self.count.is_multiple_of(RUN) {
            let nothing = TileLight { nearest_sq: 1.0, ..TileLight::default() };
            let mut run = Run::default();
            (0..RUN).for_each(|k| run.set(k, &nothing));
            self.runs.push(run);
        }
        if let Some(run) = self.runs.last_mut() {
            run.set(self.count % RUN, light);
        }
        self.count += 1;
    }

    /// The lights, without what only culling reads.
    #[cfg(test)]
    pub(super) fn lights(&self) -> Vec<TileLight> {
        (0..self.count).map(|i| self.runs[i / RUN].at(i % RUN)).collect()
    }

    /// Sums up all lights at a row of receivers, and keeps the running weights.
    pub(super) fn walk(&mut self, row: &mut Row, d_min_sq: f32) {
        #[cfg(target_arch = "x86_64")]
        if has_fused() {
            // SAFETY: the processor has AVX2 and fused multiply-add.
            return unsafe { self.walk_fused(row, d_min_sq) };
        }
        self.walk_lanes::<false>(row, d_min_sq);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn walk_fused(&mut self, row: &mut Row, d_min_sq: f32) {
        self.walk_lanes::<true>(row, d_min_sq);
    }

    #[inline(always)]
    fn walk_lanes<const FUSED: bool>(&mut self, row: &mut Row, d_min_sq: f32) {
        let (position, normal) = (row.position, row.normal);
        let (mut sum, mut evals, mut weight) = (row.sum, row.evals, [0.0; LANES]);
        self.weights.clear();
        self.weights.reserve(self.runs.len());
        for run in &self.runs {
            for k in 0..RUN {
                let light = run.at(k);
                for i in 0..LANES {
                    let offset = std::array::from_fn(|a| light.position[a] - position[a][i]);
                    let n = [normal[0][i], normal[1][i], normal[2][i]];
                    let share = light.blend::<FUSED>(offset)
                        * contribution::geometry::<FUSED>(&light, offset, n, d_min_sq);
                    sum[0][i] += light.intensity[0] * share;
                    sum[1][i] += light.intensity[1] * share;
                    sum[2][i] += light.intensity[2] * share;
                    evals[i] += if share > 0.0 { 1.0 } else { 0.0 };
                    weight[i] += light.shadow_weight * share;
                }
            }
            self.weights.push(weight);
        }
        (row.sum, row.evals) = (sum, evals);
    }

    /// Total shadow weight of a lane after a walk.
    pub(super) fn total_weight(&self, lane: usize) -> f32 {
        self.weights.last().map_or(0.0, |w| w[lane])
    }

    /// The light at which the running shadow weight of a lane, whose receiver has position `p` and
    /// normal `n`, passes `target`.
    ///
    /// Cost: binary search over the runs, then one run
    pub(super) fn draw(
        &self,
        target: f32,
        receiver: [[f32; 3]; 2],
        lane: usize,
        d_min_sq: f32,
    ) -> Option<Draw> {
        let last = self.runs.len().checked_sub(1)?;
        let at = self.weights.partition_point(|w| w[lane] <= target).min(last);
        let before = if at == 0 { 0.0 } else { self.weights[at - 1][lane] };
        let [weights, geometries] = shares_of(&self.runs[at], receiver, d_min_sq);
        let mut left = target - before;
        let mut drawn = None;
        // Rounding may leave a rest behind the last light: it goes to the last one with a weight.
        for (k, &weight) in weights.iter().enumerate() {
            if weight > 0.0 {
                drawn = Some(k);
                if left < weight {
                    break;
                }
                left -= weight;
            }
        }
        let run = &self.runs[at];
        drawn.map(|k| Draw { level: run.level[k], index: run.index[k], geometry: geometries[k] })
    }
}

/// Whether the processor has AVX2 and fused multiply-add.
#[cfg(target_arch = "x86_64")]
fn has_fused() -> bool {
    std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
}

/// Shadow weights and geometry terms of a run at one receiver.
fn shares_of(run: &Run, receiver: [[f32; 3]; 2], d_min_sq: f32) -> [Eight; 2] {
    #[cfg(target_arch = "x86_64")]
    if has_fused() {
        // SAFETY: the processor has AVX2 and fused multiply-add.
        return unsafe { shares_fused(run, receiver, d_min_sq) };
    }
    shares_lanes::<false>(run, receiver, d_min_sq)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn shares_fused(run: &Run, receiver: [[f32; 3]; 2], d_min_sq: f32) -> [Eight; 2] {
    shares_lanes::<true>(run, receiver, d_min_sq)
}

#[inline(always)]
fn shares_lanes<const FUSED: bool>(run: &Run, [p, n]: [[f32; 3]; 2], d_min_sq: f32) -> [Eight; 2] {
    let (mut weights, mut geometries) = ([0.0; RUN], [0.0; RUN]);
    for k in 0..RUN {
        let light = run.at(k);
        let offset = std::array::from_fn(|a| light.position[a] - p[a]);
        geometries[k] = contribution::geometry::<FUSED>(&light, offset, n, d_min_sq);
        // Rounded as in the walk.
        let share = light.blend::<FUSED>(offset) * geometries[k];
        weights[k] = light.shadow_weight * share;
    }
    [weights, geometries]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Sequence, hash_u32, uniform_sphere, unit_f32};
    use glam::Vec3;

    /// Lights all around a receiver, many of them behind it or out of their shell.
    fn lights(count: u32) -> Vec<TileLight> {
        (0..count)
            .map(|i| {
                let mut s = Sequence::new(21, i);
                let position = uniform_sphere(s.next_2d()) * (0.2 + 4.0 * s.next_1d());
                let normal = uniform_sphere(s.next_2d()) * s.next_1d();
                let variance = Vec3::new(s.next_1d(), s.next_1d(), 0.0) * 0.05;
                TileLight {
                    position: position.to_array(),
                    normal: normal.to_array(),
                    variance_4: (4.0 * variance).to_array(),
                    nearest_sq: contribution::nearest_sq(variance.element_sum()),
                    far: contribution::far(variance.element_sum()),
                    normal_spread_3: 3.0 * contribution::normal_spread(normal),
                    intensity: [1.0; 3],
                    shadow_weight: s.next_1d().powi(3),
                    rise: [2.0, -1.0],
                    fall: [-0.5, 2.0],
                    index: i,
                    ..TileLight::default()
                }
            })
            .collect()
    }

    #[test]
    fn picks_follow_the_weights() {
        const PICKS: u32 = 100_000;
        let lights = lights(137);
        let mut list = TileList::default();
        lights.iter().for_each(|light| list.push(light));
        let (position, ns) = (Vec3::new(0.1, -0.2, 0.05), Vec3::new(0.6, 0.0, 0.8));
        let receiver = [position.to_array(), ns.to_array()];
        let lane = 3;
        let mut row = Row::default();
        for axis in 0..3 {
            row.position[axis][lane] = position[axis];
            row.normal[axis][lane] = ns[axis];
        }
        list.walk(&mut row, 0.01);
        let expected = lights.iter().map(|light| {
            let offset = (Vec3::from(light.position) - position).to_array();
            let geometry = contribution::geometry::<false>(light, offset, ns.to_array(), 0.01);
            light.shadow_weight * light.blend::<false>(offset) * geometry
        });
        let expected: Vec<f32> = expected.collect();
        let total: f32 = expected.iter().sum();
        assert!((list.total_weight(lane) / total - 1.0).abs() < 1e-5);
        let mut counts = vec![0u32; lights.len()];
        for i in 0..PICKS {
            // Independent picks: the χ² law holds.
            let u = unit_f32(hash_u32(i));
            let pick = list.draw(u * total, receiver, lane, 0.01).expect("pick");
            counts[pick.index as usize] += 1;
        }
        let (mut chi_sq, mut bins) = (0.0, 0);
        for (count, weight) in counts.iter().zip(&expected) {
            let expected = f64::from(weight / total) * f64::from(PICKS);
            assert!(expected > 0.0 || *count == 0, "a light without weight was picked");
            if expected >= 5.0 {
                chi_sq += (f64::from(*count) - expected).powi(2) / expected;
                bins += 1;
            }
        }
        // χ² of n bins has mean n and deviation √(2n): five of those is beyond chance.
        let n = f64::from(bins);
        assert!(bins > 20 && chi_sq < n + 5.0 * (2.0 * n).sqrt(), "χ² {chi_sq} of {bins}");
    }
}
