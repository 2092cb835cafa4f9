//! A controller that recovers and does not say so.

use crate::can::ControllerState;

/// No word of trouble for so long, nanoseconds.
const QUIET_NS: u64 = 2_000_000_000;

/// Every frame that goes out takes one from the controller's error counter (ISO 11898-1, fault confinement): so many bring it from
/// its largest value, 255, below the limit of a warning, 96.
const FRAMES_OUT: u64 = 255 - 95;

/// Time between two looks at how many frames have gone out.
const LOOK_NS: u64 = 1_000_000_000;

/// Takes a state back that a controller has told and never takes back by itself: some drivers (`mcp251x` for one) tell of the way
/// up only.
///
/// The frames counted are those that were acknowledged on the bus. That the kernel has taken them into its queue would not do: it
/// does so for a bus on which nobody answers as well, until the queue is full.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Recovery {
    /// When trouble was told last, and how many frames had gone out by then, as soon as that is known.
    told_ns: u64,
    out_then: Option<u64>,
    look_ns: u64,
}

impl Recovery {
    /// Notes that the controller has told of trouble.
    pub(super) const fn told(&mut self, now_ns: u64) {
        *self = Self { told_ns: now_ns, out_then: None, look_ns: now_ns };
    }

    /// Whether it is time to say how many frames have gone out.
    pub(super) const fn is_due(&self, state: ControllerState, now_ns: u64) -> bool {
        matches!(state, ControllerState::Warning | ControllerState::ErrorPassive) && now_ns >= self.look_ns
    }

    /// Whether the controller must have recovered, now that `out` frames have gone out since the machine started.
    pub(super) fn look(&mut self, out: u64, now_ns: u64) -> bool {
        self.look_ns = now_ns.saturating_add(LOOK_NS);
        let then = *self.out_then.get_or_insert(out);
        if out < then {
            // The driver was loaded anew.
            self.out_then = Some(out);
            return false;
        }
        now_ns.saturating_sub(self.told_ns) >= QUIET_NS && out - then >= FRAMES_OUT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    /// Seconds from the last word of trouble until the state is taken back, with `rate` frames going out in each.
    fn recovers_after(rate: u64) -> Option<u64> {
        let mut recovery = Recovery::default();
        recovery.told(50 * SECOND);
        (0..100).find(|second| recovery.look(7000 + rate * second, (50 + second) * SECOND))
    }

    #[test]
    fn a_state_is_taken_back_after_enough_frames_and_two_quiet_seconds() {
        assert_eq!(recovers_after(0), None, "nobody acknowledges");
        assert_eq!(recovers_after(10), Some(16), "heartbeats only");
        assert_eq!(recovers_after(159), Some(2));
        assert_eq!(recovers_after(5000), Some(2), "never sooner");
    }

    #[test]
    fn every_word_of_trouble_begins_anew() {
        let mut recovery = Recovery::default();
        for second in 0..20 {
            recovery.told(second * SECOND);
            assert!(!recovery.look(1000 * second, second * SECOND));
            assert!(!recovery.look(1000 * second + 999, (second + 1) * SECOND));
        }
        assert!(recovery.look(40_000, 21 * SECOND));
    }

    #[test]
    fn counters_that_begin_anew_are_no_frames() {
        let mut recovery = Recovery::default();
        recovery.told(0);
        assert!(!recovery.look(u64::MAX, SECOND));
        assert!(!recovery.look(3, 5 * SECOND));
        assert!(!recovery.look(162, 6 * SECOND));
        assert!(recovery.look(163, 7 * SECOND));
    }

    #[test]
    fn only_states_that_can_pass_are_looked_at_and_once_a_second() {
        let mut recovery = Recovery::default();
        assert!(!recovery.is_due(ControllerState::ErrorActive, SECOND));
        assert!(!recovery.is_due(ControllerState::BusOff, SECOND), "that needs a restart");
        assert!(recovery.is_due(ControllerState::Warning, SECOND));
        assert!(!recovery.look(1, SECOND));
        assert!(!recovery.is_due(ControllerState::ErrorPassive, 2 * SECOND - 1));
        assert!(recovery.is_due(ControllerState::ErrorPassive, 2 * SECOND));
    }
}
