//! Times of exposure: which of a driver's are to be trusted.

use v4l2r::ioctl::BufferFlags;

/// A time later than now by more than this is of another clock, nanoseconds. A driver that works its times out of the
/// camera's own may be a little off.
const FURTHEST_AHEAD_NS: u64 = 1_000_000;

/// A picture takes no longer than this from its exposure to the driver's queue, nanoseconds.
const LONGEST_DELAY_NS: u64 = 1_000_000_000;

/// A clock that was wrong is trusted again after so many good times in a row.
const GOOD_AGAIN: u32 = 100;

/// Follows the times of one device.
///
/// Each one is looked at: a driver may make its times wrap, take another clock (`uvcvideo clock=realtime`), or copy those of a
/// producer that changes its clock. A time in the future would make every picture seem new for ever.
#[derive(Clone, Copy, Debug)]
pub(super) struct Times {
    /// When the driver last had no picture: what it has now has come since.
    empty_ns: u64,
    trusted: bool,
    /// Good times since the last bad one.
    good: u32,
    odd: Option<OddTimes>,
}

/// Why the time of arrival stands in for the time of exposure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OddTimes {
    /// The driver tells none.
    None,
    /// It is in the future.
    Ahead,
    /// It is older than any picture.
    Behind,
}

impl Times {
    /// For a device that begins to stream at `now_ns`.
    pub(super) const fn new(now_ns: u64) -> Self {
        Self { empty_ns: now_ns, trusted: false, good: GOOD_AGAIN, odd: None }
    }

    /// Notes that the driver has no picture.
    pub(super) const fn empty(&mut self, now_ns: u64) {
        self.empty_ns = now_ns;
    }

    /// The time of exposure of a picture that is taken over at `now_ns`: the driver's, or the time of arrival.
    pub(super) fn exposed_ns(&mut self, flags: BufferFlags, driver_ns: u64, now_ns: u64) -> u64 {
        match odd(flags, driver_ns, now_ns, self.empty_ns) {
            Some(odd) => {
                self.odd.get_or_insert(odd);
                self.good = 0;
            }
            None => self.good = self.good.saturating_add(1),
        }
        self.trusted = self.good >= GOOD_AGAIN;
        if self.trusted { driver_ns } else { now_ns }
    }

    /// Whether the last time was the driver's. Before the first picture it is not known, and not trusted.
    pub(super) const fn trusted(&self) -> bool {
        self.trusted
    }

    /// What was the first thing wrong with the driver's times.
    pub(super) const fn odd(&self) -> Option<OddTimes> {
        self.odd
    }
}

impl OddTimes {
    /// What is wrong, in words.
    pub(super) const fn what(self) -> &'static str {
        match self {
            Self::None => "its driver does not say when a picture was exposed",
            Self::Ahead => {
                "its driver gives times of exposure in the future, of another clock than the machine's monotonic one"
            }
            Self::Behind => {
                "its driver gives times of exposure long ago, of another clock than the machine's monotonic one"
            }
        }
    }
}

/// Times that were copied from whoever wrote the picture (a loopback device) are good if they can be of this machine's clock.
fn odd(flags: BufferFlags, driver_ns: u64, now_ns: u64, empty_ns: u64) -> Option<OddTimes> {
    if !flags.intersects(BufferFlags::TIMESTAMP_MONOTONIC | BufferFlags::TIMESTAMP_COPY) || driver_ns == 0 {
        Some(OddTimes::None)
    } else if driver_ns > now_ns.saturating_add(FURTHEST_AHEAD_NS) {
        Some(OddTimes::Ahead)
    } else if driver_ns < empty_ns.min(now_ns).saturating_sub(LONGEST_DELAY_NS) {
        // Not by its age: it may have waited for a caller who was away.
        Some(OddTimes::Behind)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW_NS: u64 = 50_000_000_000;
    const MS: u64 = 1_000_000;
    const MONOTONIC: BufferFlags = BufferFlags::TIMESTAMP_MONOTONIC;

    fn first(flags: BufferFlags, driver_ns: u64) -> (bool, Option<OddTimes>) {
        let mut times = Times::new(NOW_NS - 100 * MS);
        let exposed_ns = times.exposed_ns(flags, driver_ns, NOW_NS);
        assert_eq!(exposed_ns, if times.trusted() { driver_ns } else { NOW_NS });
        (times.trusted(), times.odd())
    }

    #[test]
    fn times_that_can_be_of_this_clock_are_trusted_and_no_others() {
        for flags in [MONOTONIC, BufferFlags::TIMESTAMP_COPY] {
            assert_eq!(first(flags, NOW_NS - 20 * MS), (true, None));
            assert_eq!(first(flags, NOW_NS - 900 * MS), (true, None), "a long exposure");
            assert_eq!(first(flags, NOW_NS + MS), (true, None), "worked out of the camera's clock");
            assert_eq!(first(flags, NOW_NS + MS + 1), (false, Some(OddTimes::Ahead)));
            assert_eq!(first(flags, u64::MAX), (false, Some(OddTimes::Ahead)), "a driver that makes its times wrap");
            assert_eq!(first(flags, 1_700_000_000_000_000_000), (false, Some(OddTimes::Ahead)), "time of day");
            assert_eq!(first(flags, NOW_NS - 1101 * MS), (false, Some(OddTimes::Behind)));
            assert_eq!(first(flags, 0), (false, Some(OddTimes::None)));
        }
        assert_eq!(first(BufferFlags::empty(), NOW_NS - MS), (false, Some(OddTimes::None)));
    }

    #[test]
    fn a_picture_that_waited_for_its_caller_keeps_its_time_however_old_it_is() {
        let mut times = Times::new(0);
        times.empty(NOW_NS);
        let late_ns = NOW_NS + 30_000 * MS;
        assert_eq!(times.exposed_ns(MONOTONIC, NOW_NS + 10 * MS, late_ns), NOW_NS + 10 * MS);
        assert!(times.trusted());
        times.empty(late_ns);
        let now_ns = late_ns + 20 * MS;
        assert_eq!(times.exposed_ns(MONOTONIC, NOW_NS + 40 * MS, now_ns), now_ns, "came since, so it cannot be so old");
        assert_eq!(times.odd(), Some(OddTimes::Behind));
    }

    #[test]
    fn a_clock_that_changes_is_found_out_at_once_and_trusted_again_only_after_a_while() {
        let mut times = Times::new(NOW_NS);
        let mut now_ns = NOW_NS;
        for picture in 0..500_u64 {
            now_ns += 33 * MS;
            let ahead = (100..150).contains(&picture);
            let driver_ns = if ahead { now_ns + (1 << 60) } else { now_ns - 5 * MS };
            let exposed_ns = times.exposed_ns(MONOTONIC, driver_ns, now_ns);
            let arrival = (100..150 + u64::from(GOOD_AGAIN) - 1).contains(&picture);
            assert_eq!(exposed_ns, if arrival { now_ns } else { driver_ns }, "picture {picture}");
            assert_eq!(times.trusted(), !arrival, "picture {picture}");
            times.empty(now_ns);
        }
        assert_eq!(times.odd(), Some(OddTimes::Ahead));
    }
}
