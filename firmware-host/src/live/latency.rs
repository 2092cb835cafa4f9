//! Times of the loop as histograms of fixed size.

use hdrhistogram::Histogram;
use serde::Serialize;

/// Shortest and longest time that is told apart, microseconds; what lies outside counts as the end of the range.
const RANGE_US: (u64, u64) = (1, 60_000_000);
/// Times are told apart to three decimal digits.
const DIGITS: u8 = 3;

/// A histogram of times; takes no memory after it was made.
#[derive(Clone, Debug)]
pub struct Latency(Histogram<u64>);

/// A histogram in a few numbers, milliseconds. Zeros before the first time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LatencySummary {
    /// Number of times.
    pub count: u64,
    /// Half of the times were no longer.
    pub p50_ms: f64,
    /// 99 of 100 were no longer.
    pub p99_ms: f64,
    /// 999 of 1000 were no longer.
    pub p99_9_ms: f64,
    /// None was longer.
    pub max_ms: f64,
}

impl Latency {
    /// An empty histogram.
    pub fn new() -> Self {
        let (low, high) = RANGE_US;
        // The bounds are constants that the library takes.
        Self(Histogram::new_with_bounds(low, high, DIGITS).unwrap_or_else(|_| unreachable!()))
    }

    /// Counts a time.
    pub fn record(&mut self, time_ns: u64) {
        self.0.saturating_record(time_ns.div_ceil(1000));
    }

    /// The histogram in a few numbers.
    pub fn summary(&self) -> LatencySummary {
        let at = |quantile| self.0.value_at_quantile(quantile) as f64 * 1.0e-3;
        if self.0.is_empty() {
            return LatencySummary::default();
        }
        LatencySummary {
            count: self.0.len(),
            p50_ms: at(0.5),
            p99_ms: at(0.99),
            p99_9_ms: at(0.999),
            max_ms: self.0.max() as f64 * 1.0e-3,
        }
    }
}

impl Default for Latency {
    fn default() -> Self {
        Self::new()
    }
}

impl std::fmt::Display for LatencySummary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { p50_ms, p99_ms, p99_9_ms, max_ms, .. } = self;
        write!(f, "p50 {p50_ms:.1} ms, p99 {p99_ms:.1} ms, p99.9 {p99_9_ms:.1} ms, max {max_ms:.1} ms")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_agree_with_sorted_times() {
        let mut latency = Latency::new();
        assert_eq!(latency.summary(), LatencySummary::default());
        // 1 to 10,000 ms in a mixed order: 7919 has no factor in common with 10,000.
        for i in 0..10_000_u64 {
            latency.record((1 + i * 7919 % 10_000) * 1_000_000);
        }
        let LatencySummary { count, p50_ms, p99_ms, p99_9_ms, max_ms } = latency.summary();
        assert_eq!(count, 10_000);
        for (found, exact) in [(p50_ms, 5000.0), (p99_ms, 9900.0), (p99_9_ms, 9990.0), (max_ms, 10_000.0)] {
            assert!((found / exact - 1.0_f64).abs() < 2.0e-3, "{found} is not {exact}");
        }
        latency.record(u64::MAX);
        latency.record(0);
        assert!((latency.summary().max_ms / 60_000.0 - 1.0).abs() < 2.0e-3);
    }
}
