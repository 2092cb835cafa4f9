//! Times of the stages.

use std::time::{Duration, Instant};

use fencepost_core::detector::{Probe, Stage};

/// Number of stages that the detector has.
pub const STAGES: usize = Stage::ALL.len();

/// Adds up the time that each stage takes in a frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stopwatch {
    spent: [Duration; STAGES],
    running: Option<(Stage, Instant)>,
}

/// Time that one frame took, milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameTimes {
    /// By [`Stage`].
    pub stages_ms: [f64; STAGES],
    /// A detector outside the core; 0 without one.
    pub reference_ms: f64,
    /// From a scan to its CAN frames.
    pub wire_ms: f64,
    /// From the pair of pictures to the CAN frames.
    pub total_ms: f64,
}

/// Median, 99th percentile and largest of a series, milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct TimeSummary {
    /// Half of the frames took no longer.
    pub median_ms: f64,
    /// 99 of 100 frames took no longer.
    pub p99_ms: f64,
    /// No frame took longer.
    pub max_ms: f64,
}

impl Stopwatch {
    /// Stops and gives the times of the stages; `total` is the time of the whole call.
    pub fn finish(mut self, total: Duration) -> FrameTimes {
        self.stop(Instant::now());
        FrameTimes {
            stages_ms: self.spent.map(milliseconds),
            reference_ms: 0.0,
            wire_ms: 0.0,
            total_ms: milliseconds(total),
        }
    }

    fn stop(&mut self, now: Instant) {
        if let Some((stage, since)) = self.running.take() {
            self.spent[stage as usize] += now.duration_since(since);
        }
    }
}

impl Probe for Stopwatch {
    fn enter(&mut self, stage: Stage) {
        let now = Instant::now();
        self.stop(now);
        self.running = Some((stage, now));
    }
}

impl TimeSummary {
    /// Of the values given, in any order; zeros if there are none. Percentiles are nearest-rank.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        let rank = |percent: usize| {
            let index = (sorted.len() * percent).div_ceil(100).max(1) - 1;
            sorted.get(index).copied().unwrap_or_default()
        };
        Self { median_ms: rank(50), p99_ms: rank(99), max_ms: rank(100) }
    }
}

/// Milliseconds with all their digits.
pub fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1.0e3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_by_nearest_rank() {
        let of = |n: u32| TimeSummary::of((1..=n).rev().map(f64::from));
        assert_eq!(of(0), TimeSummary::default());
        assert_eq!(of(1), TimeSummary { median_ms: 1.0, p99_ms: 1.0, max_ms: 1.0 });
        assert_eq!(of(4), TimeSummary { median_ms: 2.0, p99_ms: 4.0, max_ms: 4.0 });
        assert_eq!(of(200), TimeSummary { median_ms: 100.0, p99_ms: 198.0, max_ms: 200.0 });
    }

    #[test]
    fn time_goes_to_the_stage_that_was_entered() {
        let mut watch = Stopwatch::default();
        for _ in 0..3 {
            watch.enter(Stage::Rectify);
            watch.enter(Stage::Match);
            std::thread::sleep(Duration::from_millis(2));
        }
        let times = watch.finish(Duration::from_millis(7));
        assert!(times.stages_ms[Stage::Match as usize] >= 6.0, "{times:?}");
        assert_eq!(times.stages_ms[Stage::Map as usize], 0.0);
        assert_eq!(times.total_ms, 7.0);
    }
}
