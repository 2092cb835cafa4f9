//! The clock by which everything is timed: cameras, buses, the loop.

use std::{
    sync::atomic::{AtomicU64, Ordering},
    thread,
    time::Duration,
};

/// A clock, and a way to let its time pass.
pub trait Clock: Sync {
    /// Nanoseconds; never goes back.
    fn now_ns(&self) -> u64;

    /// Returns when `time` has passed.
    fn sleep(&self, time: Duration);
}

/// The clock of [`monotonic_ns`].
#[derive(Clone, Copy, Debug, Default)]
pub struct MonotonicClock;

impl Clock for MonotonicClock {
    fn now_ns(&self) -> u64 {
        monotonic_ns()
    }

    fn sleep(&self, time: Duration) {
        thread::sleep(time);
    }
}

/// A clock that stands still until it is told to go on. Whoever sleeps by it moves it, so it is for one thread.
#[derive(Debug, Default)]
pub struct VirtualClock {
    now_ns: AtomicU64,
}

impl VirtualClock {
    /// A clock that shows `now_ns`.
    pub const fn new(now_ns: u64) -> Self {
        Self { now_ns: AtomicU64::new(now_ns) }
    }

    /// Lets the time pass until `now_ns`. Does nothing where that is over.
    pub fn advance_to(&self, now_ns: u64) {
        self.now_ns.fetch_max(now_ns, Ordering::Relaxed);
    }
}

impl Clock for VirtualClock {
    fn now_ns(&self) -> u64 {
        self.now_ns.load(Ordering::Relaxed)
    }

    fn sleep(&self, time: Duration) {
        let time_ns = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        self.advance_to(self.now_ns().saturating_add(time_ns));
    }
}

/// Nanoseconds of `CLOCK_MONOTONIC`: never goes back, nobody sets it, and it is the clock by which V4L2 stamps pictures.
#[cfg(unix)]
pub fn monotonic_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    // The clock begins when the machine starts, and 64 bits hold 584 years of nanoseconds.
    let whole = |value: i64| u64::try_from(value).unwrap_or(0);
    whole(now.tv_sec).saturating_mul(1_000_000_000).saturating_add(whole(now.tv_nsec))
}

/// Nanoseconds since the first call: never goes back, and nobody sets it.
#[cfg(not(unix))]
pub fn monotonic_ns() -> u64 {
    use std::{sync::OnceLock, time::Instant};

    static START: OnceLock<Instant> = OnceLock::new();
    u64::try_from(START.get_or_init(Instant::now).elapsed().as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;

    /// The standard library reads the same clock, but does not give its value away: differences lie between its own.
    #[test]
    fn it_rises_and_agrees_with_the_clock_of_the_standard_library() {
        let outer_start = Instant::now();
        let start_ns = monotonic_ns();
        let inner_start = Instant::now();
        std::thread::sleep(Duration::from_millis(5));
        let inner_end = Instant::now();
        let passed_ns = u128::from(monotonic_ns() - start_ns);
        let outer_end = Instant::now();
        assert!(passed_ns >= (inner_end - inner_start).as_nanos());
        assert!(passed_ns <= (outer_end - outer_start).as_nanos());

        let readings: Vec<u64> = (0..1000).map(|_| monotonic_ns()).collect();
        assert!(readings.is_sorted());
    }

    #[test]
    fn a_virtual_clock_moves_when_it_is_told_and_never_back() {
        let clock = VirtualClock::new(7);
        assert_eq!(clock.now_ns(), 7);
        clock.advance_to(1000);
        clock.advance_to(500);
        assert_eq!(clock.now_ns(), 1000);
        clock.sleep(Duration::from_micros(3));
        assert_eq!(clock.now_ns(), 4000);
        clock.sleep(Duration::MAX);
        assert_eq!(clock.now_ns(), u64::MAX);
    }
}
