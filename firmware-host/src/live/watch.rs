//! Reasons that only the loop can know: what is missing, late or lost on the way.

use fencepost_core::health::{Health, HealthLevel, HealthReason};

/// Levels that a reason may have, from ok to fault.
const LEVELS: [HealthLevel; 4] = [HealthLevel::Ok, HealthLevel::Degraded, HealthLevel::Blind, HealthLevel::Fault];

/// What was seen lately. A reason is said at once, and for some time after it was last seen, so that what comes and goes is
/// said without a break. Each level is held by itself: a milder case neither hides a worse one nor keeps it alive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watch {
    hold_ns: u64,
    /// When each reason was last seen with each level.
    seen_ns: [[Option<u64>; LEVELS.len()]; HealthReason::ALL.len()],
}

impl Watch {
    pub(super) const fn new(hold_ns: u64) -> Self {
        Self { hold_ns, seen_ns: [[None; LEVELS.len()]; HealthReason::ALL.len()] }
    }

    /// The reason is there now.
    pub(super) fn see(&mut self, reason: HealthReason, level: HealthLevel, now_ns: u64) {
        if let Some(seen_ns) = self.seen_ns.get_mut(reason as usize).and_then(|levels| levels.get_mut(level as usize)) {
            *seen_ns = Some(now_ns);
        }
    }

    /// The reasons of now, each with the worst level that is held.
    pub(super) fn health(&self, now_ns: u64) -> Health {
        let held =
            |seen_ns: &Option<u64>| seen_ns.is_some_and(|seen_ns| now_ns.saturating_sub(seen_ns) <= self.hold_ns);
        let mut health = Health::OK;
        for (reason, levels) in HealthReason::ALL.into_iter().zip(&self.seen_ns) {
            for (level, _) in LEVELS.into_iter().zip(levels).filter(|(_, seen_ns)| held(seen_ns)) {
                health.raise(reason, level);
            }
        }
        health
    }
}

/// Scans whose time of sending is known. More are not sent within any sensible time-out.
const SENT: usize = 128;

/// Whether the controller at the other end takes scans over.
#[derive(Clone, Copy, Debug)]
pub(super) struct EchoWatch {
    timeout_ns: u64,
    /// Whether there must be a controller. Once one was heard, there must.
    expected: bool,
    newest_sent: Option<u16>,
    /// When the last scans were sent, by their index modulo the length.
    sent_ns: [u64; SENT],
    newest_echo: Option<u16>,
    /// Since when scans wait for an echo.
    waiting_since_ns: Option<u64>,
}

impl EchoWatch {
    pub(super) const fn new(timeout_ns: u64, expected: bool) -> Self {
        let (newest_sent, newest_echo, waiting_since_ns) = (None, None, None);
        Self { timeout_ns, expected, newest_sent, sent_ns: [0; SENT], newest_echo, waiting_since_ns }
    }

    /// The last frame of a scan was sent.
    pub(super) fn sent(&mut self, scan_index: u16, now_ns: u64) {
        self.newest_sent = Some(scan_index);
        self.sent_ns[usize::from(scan_index) % SENT] = now_ns;
        self.waiting_since_ns.get_or_insert(now_ns);
    }

    /// An echo came. Only that of a scan which was sent lately is a sign of life, and only once: a controller that hangs repeats
    /// itself.
    pub(super) fn echo(&mut self, scan_index: u16, now_ns: u64) {
        self.expected = true;
        let Some(newest) = self.newest_sent else { return };
        let behind = newest.wrapping_sub(scan_index);
        let sent_ns = self.sent_ns[usize::from(scan_index) % SENT];
        let lately = usize::from(behind) < SENT && now_ns.saturating_sub(sent_ns) <= self.timeout_ns;
        // The newest one is good however long ago it was sent: there may have been none since.
        if self.newest_echo != Some(scan_index) && (behind == 0 || lately) {
            self.newest_echo = Some(scan_index);
            self.waiting_since_ns = if behind == 0 { None } else { Some(now_ns) };
        }
    }

    /// Whether an echo is overdue.
    pub(super) fn is_missing(&self, now_ns: u64) -> bool {
        self.expected && self.waiting_since_ns.is_some_and(|since| now_ns.saturating_sub(since) > self.timeout_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_said_at_once_and_held() {
        let mut watch = Watch::new(100);
        assert_eq!(watch.health(0), Health::OK);
        watch.see(HealthReason::Late, HealthLevel::Degraded, 1000);
        assert!(watch.health(1000).has(HealthReason::Late));
        watch.see(HealthReason::MissingPicture, HealthLevel::Fault, 1050);
        watch.see(HealthReason::MissingPicture, HealthLevel::Degraded, 1080);
        let health = watch.health(1100);
        assert_eq!(health.level, HealthLevel::Fault, "the worst of what is held");
        assert!(health.has(HealthReason::Late) && health.has(HealthReason::MissingPicture));
        assert!(!watch.health(1101).has(HealthReason::Late));
        assert_eq!(watch.health(1181), Health::OK);
    }

    #[test]
    fn a_milder_case_that_goes_on_does_not_keep_a_worse_one_alive() {
        let mut watch = Watch::new(100);
        watch.see(HealthReason::MissingPicture, HealthLevel::Fault, 0);
        for now_ns in (0..1000).step_by(10) {
            watch.see(HealthReason::MissingPicture, HealthLevel::Degraded, now_ns);
        }
        assert_eq!(watch.health(100).level, HealthLevel::Fault);
        assert_eq!(watch.health(101).level, HealthLevel::Degraded);
        assert_eq!(watch.health(1000).level, HealthLevel::Degraded);
    }

    #[test]
    fn an_echo_is_missing_when_scans_go_out_and_none_is_taken_over() {
        let mut watch = EchoWatch::new(100, false);
        watch.sent(65534, 0);
        assert!(!watch.is_missing(1000), "nobody was ever heard");
        watch.echo(65534, 1000);
        assert!(!watch.is_missing(5000), "no scan waits");
        watch.sent(65535, 5000);
        watch.sent(0, 5050);
        assert!(!watch.is_missing(5100));
        watch.echo(65535, 5100);
        assert!(!watch.is_missing(5200), "one of them was taken over");
        assert!(watch.is_missing(5201));
        watch.echo(65535, 5201);
        assert!(watch.is_missing(5202), "the same one again is no sign of life");
        watch.echo(7, 5202);
        assert!(watch.is_missing(5203), "7 was never sent");
        watch.echo(0, 5203);
        assert!(!watch.is_missing(9000));
        // Silent for so many scans that the index has gone round half its way: the next echo counts nevertheless.
        for scan in 1..=40_000 {
            watch.sent(scan, 10_000 + u64::from(scan));
        }
        assert!(watch.is_missing(60_000));
        watch.echo(39_800, 60_000);
        assert!(watch.is_missing(60_000), "that one was sent too long ago");
        watch.echo(40_000, 60_000);
        assert!(!watch.is_missing(60_000));
        let mut required = EchoWatch::new(100, true);
        required.sent(0, 0);
        assert!(required.is_missing(101));
    }
}
