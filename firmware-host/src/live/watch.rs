//! Reasons that only the loop can know: what is missing, late or lost on the way.

use fencepost_core::health::{Health, HealthLevel, HealthReason};

/// What was seen lately. A reason is said at once, and for some time after it was last seen, so that what comes and goes is
/// said without a break.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watch {
    hold_ns: u64,
    seen: [Option<Seen>; HealthReason::ALL.len()],
}

#[derive(Clone, Copy, Debug)]
struct Seen {
    at_ns: u64,
    level: HealthLevel,
}

impl Watch {
    pub(super) const fn new(hold_ns: u64) -> Self {
        Self { hold_ns, seen: [None; HealthReason::ALL.len()] }
    }

    /// The reason is there now.
    pub(super) fn see(&mut self, reason: HealthReason, level: HealthLevel, now_ns: u64) {
        if let Some(seen) = self.seen.get_mut(reason as usize) {
            // A milder case does not make a worse one that is still held look milder.
            let held = seen.filter(|seen| now_ns.saturating_sub(seen.at_ns) <= self.hold_ns);
            let level = held.map_or(level, |held| level.max(held.level));
            *seen = Some(Seen { at_ns: now_ns, level });
        }
    }

    /// The reasons of now.
    pub(super) fn health(&self, now_ns: u64) -> Health {
        let mut health = Health::OK;
        for (reason, seen) in HealthReason::ALL.into_iter().zip(self.seen) {
            if let Some(seen) = seen.filter(|seen| now_ns.saturating_sub(seen.at_ns) <= self.hold_ns) {
                health.raise(reason, seen.level);
            }
        }
        health
    }
}

/// Both together.
pub(super) fn joined(a: Health, b: Health) -> Health {
    Health { level: a.level.max(b.level), reasons: a.reasons | b.reasons }
}

/// Whether the controller at the other end takes scans over.
#[derive(Clone, Copy, Debug)]
pub(super) struct EchoWatch {
    timeout_ns: u64,
    /// Whether there must be a controller. Once one was heard, there must.
    expected: bool,
    newest_sent: Option<u16>,
    newest_echo: Option<u16>,
    /// Since when scans wait for an echo.
    waiting_since_ns: Option<u64>,
}

impl EchoWatch {
    pub(super) const fn new(timeout_ns: u64, expected: bool) -> Self {
        Self { timeout_ns, expected, newest_sent: None, newest_echo: None, waiting_since_ns: None }
    }

    /// The last frame of a scan was sent.
    pub(super) fn sent(&mut self, scan_index: u16, now_ns: u64) {
        self.newest_sent = Some(scan_index);
        self.waiting_since_ns.get_or_insert(now_ns);
    }

    /// An echo came. Only one that is newer than the one before is a sign of life: a controller that hangs repeats itself.
    pub(super) fn echo(&mut self, scan_index: u16, now_ns: u64) {
        self.expected = true;
        let newer = self.newest_echo.is_none_or(|before| (1..0x8000).contains(&scan_index.wrapping_sub(before)));
        let behind = self.newest_sent.map(|sent| sent.wrapping_sub(scan_index));
        // What was not sent cannot have been taken over.
        let possible = behind.is_some_and(|behind| behind < 0x8000);
        if newer && possible {
            self.newest_echo = Some(scan_index);
            self.waiting_since_ns = if behind == Some(0) { None } else { Some(now_ns) };
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
        let mut required = EchoWatch::new(100, true);
        required.sent(0, 0);
        assert!(required.is_missing(101));
    }
}
