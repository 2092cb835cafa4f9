//! How a picture is exposed.

use crate::picture::Picture;

/// Grey values up to this are dark: what is there drowns in the noise of a cheap sensor.
const DARK: u8 = 12;

/// Grey values from this on are bright: the sensor is at its end.
const BRIGHT: u8 = 250;

/// Every so manieth row and column is looked at.
const STEP: usize = 4;

/// How a picture is exposed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exposure {
    /// Mean grey value.
    pub mean: f32,
    /// Share of the pixels that are nearly black, percent.
    pub dark_percent: f32,
    /// Share of the pixels that are nearly white, percent.
    pub bright_percent: f32,
}

impl Exposure {
    /// Looks at a sixteenth of the pixels.
    ///
    /// # Bound
    /// `width x height / 16` steps.
    pub fn of(picture: &Picture<'_>) -> Self {
        let (mut sum, mut dark, mut bright, mut count) = (0u32, 0u32, 0u32, 0u32);
        for y in (0..picture.height()).step_by(STEP) {
            for &grey in picture.row(y).iter().step_by(STEP) {
                sum = sum.saturating_add(u32::from(grey));
                dark += u32::from(grey <= DARK);
                bright += u32::from(grey >= BRIGHT);
                count += 1;
            }
        }
        let each = 1.0 / count.max(1) as f32;
        Self {
            mean: sum as f32 * each,
            dark_percent: 100.0 * dark as f32 * each,
            bright_percent: 100.0 * bright as f32 * each,
        }
    }
}
