//! Long work in pieces: no driver loses patience, and there is progress to tell of.

use std::ops::Range;
use std::time::Duration;

/// Most rays of a dispatch inside a frame, whose time nobody waits for: .05 s on a device that
/// follows 80 million a second.
const MOST_RAYS: usize = 1 << 22;

/// Most dispatches that work inside a frame is cut into.
const MOST_PARTS: usize = 64;

/// Items of which each follows some rays, in parts that are a dispatch each: whole eights of them.
pub fn dispatches_of(items: usize, rays: usize) -> impl Iterator<Item = Range<usize>> {
    let most = (MOST_RAYS / rays.max(1)).max(items.div_ceil(MOST_PARTS)).next_multiple_of(8);
    (0..items).step_by(most).map(move |first| first..items.min(first + most))
}

/// What a submission should take, s, and so the most that a dispatch in it should; the first one,
/// and the least work there is, may take longer on a slow device.
const SUBMISSION_TIME: f64 = 0.04;
/// Fewest items along one side of the work that a dispatch gets: a few workgroups.
const LEAST: usize = 256;

/// How much work the next submission gets, by how long the last ones took.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    work: f64,
}

impl Pace {
    /// `work` for the first submission, in whatever the caller counts.
    pub fn new(work: usize) -> Self {
        Self { work: work as f64 }
    }

    /// How often `of` the next submission gets, of `most` that there is room for.
    pub fn share(&self, of: usize, most: usize) -> usize {
        ((self.work / of as f64) as usize).max(LEAST).min(most)
    }

    /// How often `of` the next submission gets; maybe not once.
    pub fn times(&self, of: usize) -> usize {
        (self.work / of as f64) as usize
    }

    /// Learns that some work took a time.
    pub fn learn(&mut self, work: usize, time: Duration) {
        let pace = SUBMISSION_TIME / time.as_secs_f64().max(1e-4);
        self.work = work as f64 * pace.clamp(0.25, 4.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dispatches_follow_a_bounded_number_of_rays() {
        let parts = |items, rays| dispatches_of(items, rays).collect::<Vec<_>>();
        assert_eq!(parts(1280 * 720, 4).len(), 1);
        let parts_of_sky = parts(3840 * 2160, 2);
        assert_eq!(parts_of_sky.len(), 4);
        assert!(parts_of_sky.windows(2).all(|w| w[0].end == w[1].start));
        assert_eq!(parts_of_sky[3].end, 3840 * 2160);
        assert_eq!(parts(17, MOST_RAYS + 1), [0..8, 8..16, 16..17]);
        assert_eq!(parts(1 << 28, 1 << 20).len(), MOST_PARTS);
        assert!(parts(0, 1).is_empty());
    }

    #[test]
    fn submissions_come_to_their_time() {
        // A device that does so many items a second.
        for rate in [1e5, 1e8, 1e11] {
            let mut pace = Pace::new(1 << 20);
            let mut last = 0.0;
            for _ in 0..40 {
                let work = pace.share(1, usize::MAX).max(1);
                last = work as f64 / rate;
                pace.learn(work, Duration::from_secs_f64(last));
            }
            assert!((0.9..1.1).contains(&(last / SUBMISSION_TIME)), "{rate}: {last} s");
        }
        assert_eq!((Pace::new(10).share(1, 100_000), Pace::new(10).share(1, 60)), (LEAST, 60));
        assert_eq!((Pace::new(10).times(3), Pace::new(10).times(11)), (3, 0));
    }
}
