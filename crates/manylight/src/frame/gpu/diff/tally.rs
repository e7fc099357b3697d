//! Counting what differs, and by how much.

use glam::Vec3;

/// How far something that a stage makes on the device is from what the processor makes of the same
/// inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct StageDifference {
    /// Stage of the frame.
    pub stage: &'static str,
    /// What of it was compared.
    pub what: &'static str,
    /// Items that were compared.
    pub compared: u64,
    /// Items whose difference is above the tolerance.
    pub different: u64,
    /// Items that may differ: those at a border that rounding moves.
    pub allowed: u64,
    /// Largest difference of an item; NaN where one is no number on one side.
    pub largest: f64,
    /// Difference up to which an item is the same; 0 for what is counted.
    pub tolerance: f64,
    /// What the two are measured in.
    pub unit: &'static str,
}

impl StageDifference {
    /// Whether no more differs than may.
    pub fn agrees(&self) -> bool {
        self.different <= self.allowed
    }
}

/// A comparison under way.
pub(super) struct Tally(StageDifference);

impl Tally {
    /// With a tolerance in a unit.
    pub fn new(stage: [&'static str; 2], (tolerance, unit): (f64, &'static str)) -> Self {
        let [stage, what] = stage;
        let (compared, different, allowed, largest) = (0, 0, 0, 0.0);
        Self(StageDifference {
            stage,
            what,
            compared,
            different,
            allowed,
            largest,
            tolerance,
            unit,
        })
    }

    /// Counts an item by its difference.
    pub fn add(&mut self, difference: f64) {
        let row = &mut self.0;
        row.compared += 1;
        if difference.is_nan() || difference > row.tolerance {
            row.different += 1;
        }
        if difference.is_nan() || difference > row.largest {
            row.largest = difference;
        }
    }

    /// Counts an item of which there is one of both.
    pub fn add_same(&mut self, is_same: bool) {
        self.add(f64::from(u8::from(!is_same)));
    }

    /// Counts items that the other side does not have.
    pub fn add_lone(&mut self, count: usize) {
        (0..count).for_each(|_| self.add_same(false));
    }

    /// The end: a share of the items may differ; at least one, unless none may.
    pub fn allow(mut self, share: f64) -> StageDifference {
        self.0.allowed = (share * self.0.compared as f64).ceil() as u64;
        self.0
    }
}

/// Compares the numbers of things that are counted at many places: what is more or less on one side
/// differs.
pub(super) fn counts(
    stage: [&'static str; 2],
    pairs: impl Iterator<Item = (u32, u32)>,
    unit: &'static str,
    allowed: f64,
) -> StageDifference {
    let mut tally = Tally::new(stage, (0.0, unit));
    for (a, b) in pairs {
        let difference = u64::from(a.abs_diff(b));
        tally.0.compared += u64::from(a.max(b));
        tally.0.different += difference;
        tally.0.largest = tally.0.largest.max(difference as f64);
    }
    tally.allow(allowed)
}

/// Difference of two numbers.
pub(super) fn apart(a: f32, b: f32) -> f64 {
    if a == b { 0.0 } else { (f64::from(a) - f64::from(b)).abs() }
}

/// Largest difference of two vectors along an axis.
pub(super) fn apart_by_axis(a: Vec3, b: Vec3) -> f64 {
    most(a.to_array().into_iter().zip(b.to_array()).map(|(a, b)| apart(a, b)))
}

/// The largest of some differences; NaN if one is.
pub(super) fn most(differences: impl Iterator<Item = f64>) -> f64 {
    differences.fold(0.0, |most, d| if most.is_nan() || most >= d { most } else { d })
}

/// Compares colors, relative to their largest channel and to 1 % of the mean at least.
pub(super) fn colors(
    stage: [&'static str; 2],
    pairs: impl Iterator<Item = (Vec3, Vec3)> + Clone,
    tolerance: f64,
    allowed: f64,
) -> StageDifference {
    let brightness = |v: Vec3| f64::from(v.abs().max_element());
    let sum: f64 = pairs.clone().map(|(a, _)| brightness(a)).sum();
    let least = (0.01 * sum / pairs.clone().count().max(1) as f64).max(1e-30);
    let mut tally = Tally::new(stage, (tolerance, "of the color"));
    pairs.for_each(|(a, b)| tally.add(apart_by_axis(a, b) / brightness(a).max(least)));
    tally.allow(allowed)
}

/// Compares numbers by their plain difference.
pub(super) fn numbers(
    stage: [&'static str; 2],
    pairs: impl Iterator<Item = (f32, f32)>,
    tolerance: (f64, &'static str),
    allowed: f64,
) -> StageDifference {
    let mut tally = Tally::new(stage, tolerance);
    pairs.for_each(|(a, b)| tally.add(apart(a, b)));
    tally.allow(allowed)
}
