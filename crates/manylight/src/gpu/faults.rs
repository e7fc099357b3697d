//! Numbers that no stage may leave behind: in debug builds every frame looks through its lists.

use super::{Buf, Constant, GROUP, Gpu, MAX_GROUPS, Recorder, Value, kernel, record, take_record};
use crate::error::Error;

/// Most lists of a frame.
const MOST_LISTS: usize = 32;
const CONSTANTS: &[Constant] = &[Constant { name: "MAX_GROUPS", value: Value::U32(MAX_GROUPS) }];

record! {
    /// One list.
    pub struct FaultParams {
        /// Words.
        pub count: u32,
        /// Words of a record.
        pub stride: u32,
        /// A bit for each word of a record that is no `f32`.
        pub other_words: u32,
        /// Where its faults are counted: those that are not finite, then those below zero.
        pub place: u32,
    }
}

kernel! {
    /// Counts faults of one list.
    struct CountFaults = "gpu/count_faults", [GROUP, 1, 1], [CONSTANTS];
    uniform params: FaultParams, read words: u32, write faults: u32
}

/// Every kernel of this file.
#[cfg(test)]
pub(super) const KERNELS: &[&super::KernelInfo] = &[&CountFaults::INFO];

/// A list to look through.
#[derive(Debug)]
pub struct Suspect {
    words: Buf<u32>,
    stride: u32,
    other_words: u32,
    is_light: bool,
}

impl Suspect {
    /// One of which every word is an `f32`.
    pub fn new<T: super::Record>(list: &Buf<T>) -> Self {
        let stride = size_of::<T>() / size_of::<u32>();
        let words = list.reused(list.name(), list.len() * stride);
        Self { words, stride: stride as u32, other_words: 0, is_light: false }
    }

    /// One in which nothing may be below zero.
    pub fn light<T: super::Record>(list: &Buf<T>) -> Self {
        Self { is_light: true, ..Self::new(list) }
    }

    /// The same, but for words of each record that are no `f32`.
    pub fn without(self, words: &[u32]) -> Self {
        Self { other_words: words.iter().fold(0, |bits, word| bits | 1 << word), ..self }
    }
}

/// Faults of the last frame.
#[derive(Debug)]
pub struct Faults(Buf<[u32; 2]>);

impl Faults {
    /// None yet.
    ///
    /// Errors: more than the device has left
    pub fn new(gpu: &Gpu) -> Result<Self, Error> {
        gpu.buffer("faults", MOST_LISTS).map(Self)
    }

    /// Looks through lists once all that was recorded before is done.
    ///
    /// Panics: with more than 32
    pub fn record(&self, rec: &mut Recorder<'_>, lists: &[Suspect]) {
        assert!(lists.len() <= MOST_LISTS, "{} lists", lists.len());
        rec.encoder().clear_buffer(self.0.raw(), 0, None);
        rec.stage("faults");
        let faults = self.0.reused("faults", 2 * MOST_LISTS);
        for (place, list) in (0..).step_by(2).zip(lists) {
            let Suspect { words, stride, other_words, .. } = list;
            let (count, stride, other_words) = (words.len() as u32, *stride, *other_words);
            let params = rec.uniform(&FaultParams { count, stride, other_words, place });
            rec.dispatch_items(&CountFaults { params, words, faults: &faults }, words.len());
        }
    }

    /// What has to be read back.
    pub fn raw(&self) -> &wgpu::Buffer {
        self.0.raw()
    }

    /// Takes the faults of some lists off the front of what came back.
    ///
    /// Errors: a list has some
    pub fn check(gpu: &Gpu, lists: &[Suspect], bytes: &mut &[u8]) -> Result<(), Error> {
        let found: [[u32; 2]; MOST_LISTS] = std::array::from_fn(|_| take_record(bytes));
        for (list, [endless, below]) in lists.iter().zip(found) {
            let below = if list.is_light { below } else { 0 };
            if endless > 0 || below > 0 {
                let name = list.words.name();
                return Err(gpu.problem(&format!(
                    "{endless} numbers of the list of {name} are not finite and {below} are below \
                     zero; one of its shaders is wrong"
                )));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::testing::device;

    #[test]
    fn numbers_that_are_not_finite_are_counted_and_light_below_zero() {
        let Some(gpu) = device() else { return };
        let faults = Faults::new(gpu).expect("room");
        let problem = |lists: &[Suspect]| {
            let mut rec = gpu.record(None);
            faults.record(&mut rec, lists);
            let later = rec.read_later(&[faults.raw()]);
            rec.submit().wait().expect("done");
            let bytes = later.bytes(gpu).expect("bytes");
            Faults::check(gpu, lists, &mut &bytes[..]).err().map(|e| e.to_string())
        };
        let list = |values: &[[f32; 2]]| gpu.upload("tries", values).expect("list");
        let good = list(&[[0.0, -0.0], [1.0, f32::MAX], [f32::MIN_POSITIVE, 1e-45]]);
        let below = list(&[[1.0, 0.0], [-1e-45, -2.0]]);
        let endless = list(&[[f32::NAN, 0.0], [f32::NEG_INFINITY, -1.0], [f32::INFINITY, 2.0]]);
        assert_eq!(problem(&[Suspect::light(&good), Suspect::new(&below)]), None);
        let light = problem(&[Suspect::new(&good), Suspect::light(&below)]).expect("below zero");
        assert!(light.contains("0 numbers of the list of tries are not finite and 2"), "{light}");
        let all = problem(&[Suspect::light(&endless)]).expect("not finite");
        assert!(all.contains("3 numbers of the list of tries are not finite and 1"), "{all}");
        assert_eq!(problem(&[Suspect::light(&endless).without(&[0, 1])]), None);
        let second = problem(&[Suspect::new(&endless).without(&[0])]);
        assert_eq!(second, None);
    }
}
