//! Whether left and right show the same moment.

use super::profile::{Profile, Signature};

/// Frames that are remembered: a picture that is late by this many is still recognised.
const FRAMES: usize = 5;

/// Rows by which the pictures of one moment may be out of line.
const ROWS: usize = 4;

/// A picture this much like the one before shows nothing that moves, and from `SAME` on it is the same picture. Pictures from
/// vehicles that drive are alike up to 0.89 from one to the next, those from standing ones from 0.92 on.
const STILL: f32 = 0.9;
const SAME: f32 = 0.9995;

/// Likeness is counted up to this: beyond it the last digits would decide.
const MOST_ALIKE: f32 = 0.999;

/// The signatures of the newest pictures of both sides.
#[derive(Clone, Debug)]
pub(super) struct Pairing {
    /// Left and right, the newest frame last written at `newest`.
    frames: [[Signature; 2]; FRAMES],
    now: [Signature; 2],
    newest: usize,
    known: usize,
}

/// How the pictures of different moments fit each other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PairingSign {
    /// By how many standard errors the best pair of pictures of different moments is more alike than the pair that came; below
    /// zero if that one is the most alike.
    pub advantage_sigmas: f32,
    /// How alike the best pair of different moments is, -1 to 1.
    pub likeness: f32,
    /// Frames that the right picture of the best pair is behind the left one; negative if the left one is behind.
    pub lag_frames: i8,
}

impl Pairing {
    pub(super) const fn new() -> Self {
        Self { frames: [const { [Signature::NONE; 2] }; FRAMES], now: [Signature::NONE; 2], newest: 0, known: 0 }
    }

    /// Forgets all frames.
    pub(super) fn clear(&mut self) {
        self.known = 0;
    }

    /// Compares the newest pictures with each other and with those of the frames before, and remembers them.
    ///
    /// If one side is late by some frames, its picture is like that of the other side from back then, and less like the one
    /// that came with it, as soon as something has moved up or down in the picture: all that comes nearer does, up above the
    /// horizon and down below it, and so not like rows that are out of line. Where nothing
    /// moves all are alike, and nothing is said. The difference is told in standard errors, because few rows say less than
    /// many (Fisher: the inverse hyperbolic tangent of a correlation of n values has a standard error of 1 / sqrt(n - 3)).
    ///
    /// # Bound
    /// `(2 x FRAMES + 4 x ROWS + 3) x 2 x BANDS` steps.
    pub(super) fn compare(&mut self, profiles: &[Profile; 2]) -> PairingSign {
        for (profile, signature) in profiles.iter().zip(&mut self.now) {
            profile.sign(signature);
        }
        let [left, right] = &self.now;
        // Rows that are out of line are another matter: the pair that came may be laid in line.
        let reach = 2 * profiles[0].bands_in(ROWS) as isize;
        let as_given = (-reach..=reach).map(|halves| left.likeness(right, halves)).fold(-1.0, f32::max);
        // A picture of a scene in which nothing moves is as good as one of another moment, and cannot be late. The very same
        // picture may be.
        let before = self.frames.get(self.newest).filter(|_| self.known > 0);
        let is_still = |side: usize| {
            before.is_some_and(|before| (STILL..SAME).contains(&self.now[side].likeness(&before[side], 0)))
        };
        let still = [is_still(0), is_still(1)];
        let mut best = (f32::NEG_INFINITY, 0);
        for age in 0..self.known {
            // A ring, and the age is less than its length.
            let place = (self.newest % FRAMES + FRAMES).wrapping_sub(age) % FRAMES;
            let Some([left_then, right_then]) = self.frames.get(place) else {
                continue;
            };
            let frames = (age as i8).wrapping_add(1);
            for (late, likeness, lag) in
                [(1, left_then.likeness(right, 0), frames), (0, left.likeness(right_then, 0), frames.wrapping_neg())]
            {
                if !still[late] && likeness > best.0 {
                    best = (likeness, lag);
                }
            }
        }
        let sign = if best.1 != 0 {
            let bands = profiles[0].bands() as f32;
            let advantage_sigmas = (fisher(best.0) - fisher(as_given)) * libm::sqrtf((bands - 3.0).max(0.0));
            PairingSign { advantage_sigmas, likeness: best.0, lag_frames: best.1 }
        } else {
            PairingSign::default()
        };
        self.newest = self.newest.wrapping_add(1) % FRAMES;
        if let Some(frame) = self.frames.get_mut(self.newest) {
            for (old, new) in frame.iter_mut().zip(&self.now) {
                old.clone_from(new);
            }
        }
        self.known = self.known.saturating_add(1).min(FRAMES);
        sign
    }
}

fn fisher(correlation: f32) -> f32 {
    libm::atanhf(correlation.clamp(-MOST_ALIKE, MOST_ALIKE))
}

#[cfg(test)]
#[path = "pairing_tests.rs"]
mod tests;
