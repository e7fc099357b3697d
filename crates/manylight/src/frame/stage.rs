//! Timing and progress of the stages.

use std::sync::Mutex;
use std::time::Instant;

/// Called with a stage's name and the share of it that is done, 0…1.
pub type Progress<'a> = &'a (dyn Fn(&str, f64) + Sync);

/// What one stage took.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// Name.
    pub name: &'static str,
    /// Wall time, ms; summed where a stage ran more than once.
    pub time_ms: f64,
    /// What it made: receivers, lights, evaluations, paths.
    pub count: u64,
}

/// Collects stages in order.
pub(super) struct Clock<'a> {
    progress: Progress<'a>,
    stages: Vec<Stage>,
}

impl<'a> Clock<'a> {
    pub(super) fn new(progress: Progress<'a>) -> Self {
        Self { progress, stages: Vec::new() }
    }

    /// Runs a stage that returns its result and its count.
    pub(super) fn run<T>(&mut self, name: &'static str, stage: impl FnOnce() -> (T, u64)) -> T {
        (self.progress)(name, 0.0);
        let start = Instant::now();
        let (result, count) = stage();
        let time_ms = start.elapsed().as_secs_f64() * 1e3;
        match self.stages.iter_mut().find(|s| s.name == name) {
            Some(stage) => {
                stage.time_ms += time_ms;
                stage.count += count;
            }
            None => self.stages.push(Stage { name, time_ms, count }),
        }
        result
    }

    /// Runs a long stage over rows; it calls its argument with the rows it finished.
    pub(super) fn run_rows<T>(
        &mut self,
        name: &'static str,
        rows: usize,
        stage: impl FnOnce(&(dyn Fn(f64) + Sync)) -> (T, u64),
    ) -> T {
        let progress = self.progress;
        let done = Mutex::new(0.0f64);
        let tick = |finished: f64| {
            let Ok(mut done) = done.lock() else { return };
            let before = (*done).floor();
            *done += finished;
            if done.floor() > before {
                progress(name, *done / rows as f64);
            }
        };
        self.run(name, || stage(&tick))
    }

    pub(super) fn finish(self) -> Vec<Stage> {
        self.stages
    }
}
