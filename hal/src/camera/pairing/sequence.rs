//! The numbers that a driver gives its pictures.

/// Gaps longer than this are no loss, but numbers that began anew: half a minute at 30 Hz.
const LONGEST_GAP: u32 = 1000;

/// Steps back of no more than this are pictures that came twice, or out of order: drivers whose clock is emulated do that.
const LONGEST_REPEAT: u32 = 3;

/// Follows the numbers of one stream.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sequence {
    last: Option<u32>,
}

/// What the number of a picture tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Step {
    /// Pictures lost in front of it.
    pub(super) lost: u32,
    /// The numbers began anew.
    pub(super) restarted: bool,
}

impl Sequence {
    pub(super) const fn new() -> Self {
        Self { last: None }
    }

    /// Takes the number of the next picture. Numbers go round at 2^32.
    pub(super) const fn next(&mut self, number: u32) -> Step {
        let Some(last) = self.last else {
            self.last = Some(number);
            return Step { lost: 0, restarted: false };
        };
        let ahead = number.wrapping_sub(last);
        if last.wrapping_sub(number) <= LONGEST_REPEAT {
            // The next one is due after the highest so far: a step back and forth is no gap.
            return Step { lost: 0, restarted: false };
        }
        self.last = Some(number);
        if ahead > LONGEST_GAP {
            return Step { lost: 0, restarted: true };
        }
        Step { lost: ahead - 1, restarted: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lost(numbers: &[u32]) -> (u32, u32) {
        let mut sequence = Sequence::new();
        let steps: Vec<Step> = numbers.iter().map(|number| sequence.next(*number)).collect();
        (steps.iter().map(|step| step.lost).sum(), steps.iter().map(|step| u32::from(step.restarted)).sum())
    }

    #[test]
    fn gaps_repeats_wraps_and_restarts() {
        assert_eq!(lost(&[7, 8, 9, 10]), (0, 0), "the first number may be any");
        assert_eq!(lost(&[7, 9, 12]), (3, 0));
        assert_eq!(lost(&[7, 8, 8, 9, 10]), (0, 0), "repeated");
        assert_eq!(lost(&[7, 8, 10, 9, 11]), (1, 0), "skipped, and then repeated by one");
        assert_eq!(lost(&[u32::MAX - 1, u32::MAX, 0, 1]), (0, 0), "goes round");
        assert_eq!(lost(&[u32::MAX - 1, 2]), (3, 0), "lost while it goes round");
        assert_eq!(lost(&[0, u32::MAX, 1]), (0, 0), "repeated while it goes round");
        assert_eq!(lost(&[5000, 0, 1, 2]), (0, 1), "begun anew");
        assert_eq!(lost(&[0, 5000, 5001]), (0, 1), "jumped ahead");
        assert_eq!(lost(&[0, LONGEST_GAP]), (LONGEST_GAP - 1, 0));
        assert_eq!(lost(&[100, 100 - LONGEST_REPEAT, 101]), (0, 0));
        assert_eq!(lost(&[100, 99 - LONGEST_REPEAT, 100 - LONGEST_REPEAT]), (0, 1));
    }
}
