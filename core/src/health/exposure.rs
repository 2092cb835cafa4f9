//! How a picture is exposed, and whether it is one that came before.

use core::num::NonZeroU64;

use crate::{
    picture::Picture,
    work::{self, Loop},
};

/// Grey values up to this are dark: what is there drowns in the noise of a cheap sensor.
const DARK: u8 = 12;

/// Grey values from this on are bright: the sensor is at its end.
const BRIGHT: u8 = 250;

/// Every so manieth row and column is looked at.
const STEP: usize = 4;

/// Frames that a picture is compared with.
///
/// A driver whose ring of buffers stands still hands out the same old pictures in turn: rings of up to this many show. Longer ones
/// do not: a short recording that is played over and over, four frames and more, looks just like that and is to be looked at.
const REMEMBERED: usize = 3;

/// The fingerprints of the newest pictures of both sides, newest first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RecentPictures {
    fingerprints: [[Option<NonZeroU64>; REMEMBERED]; 2],
}

/// How a picture is exposed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exposure {
    /// Mean grey value.
    pub mean: f32,
    /// Share of the pixels that are nearly black, percent.
    pub dark_percent: f32,
    /// Share of the pixels that are nearly white, percent.
    pub bright_percent: f32,
    /// Stands for the values of all pixels that were looked at; `None` if they are all the same, which says nothing.
    ///
    /// The noise of a sensor makes two pictures of the same thing different somewhere, so that the same number twice means the
    /// same picture twice. Source: FNV-1a (Fowler, Noll, Vo), 64 bits.
    pub fingerprint: Option<NonZeroU64>,
}

impl Exposure {
    /// Looks at a sixteenth of the pixels.
    ///
    /// # Bound
    /// `width x height / 16` steps.
    pub fn of(picture: &Picture<'_>) -> Self {
        let (mut sum, mut dark, mut bright, mut count) = (0u32, 0u32, 0u32, 0u32);
        let (mut least, mut most, mut hash) = (u8::MAX, u8::MIN, 0xcbf2_9ce4_8422_2325_u64);
        for y in (0..picture.height()).step_by(STEP) {
            for &grey in picture.row(y).iter().step_by(STEP) {
                sum = sum.saturating_add(u32::from(grey));
                // No count exceeds that of the pixels of a picture, which is less than 2^32.
                dark = dark.wrapping_add(u32::from(grey <= DARK));
                bright = bright.wrapping_add(u32::from(grey >= BRIGHT));
                (least, most) = (least.min(grey), most.max(grey));
                hash = (hash ^ u64::from(grey)).wrapping_mul(0x0000_0100_0000_01b3);
                count = count.wrapping_add(1);
            }
        }
        work::count(Loop::HealthPixels, count as usize);
        let each = 1.0 / count.max(1) as f32;
        Self {
            mean: sum as f32 * each,
            dark_percent: 100.0 * dark as f32 * each,
            bright_percent: 100.0 * bright as f32 * each,
            fingerprint: NonZeroU64::new(hash).filter(|_| least < most),
        }
    }
}

impl RecentPictures {
    /// No picture came yet.
    pub(crate) const NONE: Self = Self { fingerprints: [[None; REMEMBERED]; 2] };

    /// Whether the left and the right picture are, to the bit, among those of the newest frames; remembers them.
    ///
    /// # Bound
    /// `2 x REMEMBERED` comparisons.
    pub(crate) fn came_again(&mut self, exposures: &[Exposure; 2]) -> [bool; 2] {
        let mut again = [false; 2];
        for ((again, recent), now) in again.iter_mut().zip(&mut self.fingerprints).zip(exposures) {
            *again = now.fingerprint.is_some() && recent.contains(&now.fingerprint);
            recent.rotate_right(1);
            recent[0] = now.fingerprint;
        }
        again
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    /// The exposure of a picture of which these pixels are looked at, row by row; all others are `other`.
    fn exposure(rows: &[&[u8]], other: u8) -> Exposure {
        let (width, height) = (rows[0].len() * STEP - 1, rows.len() * STEP - 2);
        let pixel =
            |y: usize, x: usize| if y.is_multiple_of(4) && x.is_multiple_of(4) { rows[y / 4][x / 4] } else { other };
        let pixels: Vec<u8> = (0..height).flat_map(|y| (0..width).map(move |x| pixel(y, x))).collect();
        Exposure::of(&Picture::packed(&pixels, width, height).unwrap())
    }

    #[test]
    fn every_fourth_pixel_of_every_fourth_row_counts() {
        for other in [0, 100, 255] {
            let found = exposure(&[&[0, 12, 13, 100, 249], &[250, 255, 251, 20, 50]], other);
            assert_eq!(found.mean, 120.0);
            assert!((found.dark_percent - 20.0).abs() < 1.0e-5 && (found.bright_percent - 30.0).abs() < 1.0e-5);
        }
        let black = Exposure::of(&Picture::packed(&[0; 64], 8, 8).unwrap());
        assert_eq!((black.mean, black.dark_percent, black.bright_percent), (0.0, 100.0, 0.0));
    }

    #[test]
    fn fingerprints_are_those_published_for_fnv_1a() {
        // Noll, FNV test suite, 64 bits.
        assert_eq!(exposure(&[b"foobar"], 7).fingerprint, NonZeroU64::new(0x8594_4171_f739_67e8));
        assert_eq!(exposure(&[b"foo", b"bar"], 9).fingerprint, NonZeroU64::new(0x8594_4171_f739_67e8));
        // All the same says nothing, however many they are.
        assert_eq!(exposure(&[b"a"], 7).fingerprint, None);
        assert_eq!(exposure(&[b"zzz", b"zzz"], 7).fingerprint, None);
    }

    #[test]
    fn a_picture_of_the_newest_three_has_come_again() {
        let of = |number: u64| Exposure { fingerprint: NonZeroU64::new(number), ..Exposure::default() };
        let mut recent = RecentPictures::NONE;
        // Left and right apart; 0 stands for a picture that says nothing.
        for (left, right, again) in [
            (1, 11, [false, false]),
            (2, 1, [false, false]),
            (3, 11, [false, true]),
            (1, 12, [true, false]),
            (4, 1, [false, true]),
            (2, 13, [false, false]),
            (0, 0, [false, false]),
            (0, 13, [false, true]),
        ] {
            assert_eq!(recent.came_again(&[of(left), of(right)]), again, "{left}, {right}");
        }
    }
}
