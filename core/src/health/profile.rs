//! What a picture looks like row by row: a signature that does not mind where along the row things are.

use crate::matching::ValidSpan;

/// Most bands of rows of a picture.
pub(super) const BANDS: usize = 256;

/// Bands to either side that are taken for the surroundings of a band.
const SURROUNDINGS: usize = 4;

/// Differences of neighbouring pixels count up to this, so that a few strong edges do not speak for a whole row.
const STRONGEST: u8 = 32;

/// Deviations from the surroundings count up to this many mean deviations.
const OUTSTANDING: f32 = 2.0;

/// Steps of a signature for the mean deviation.
const STEPS: f32 = 32.0;

/// Mean grey value and mean horizontal contrast of each band of rows of one picture.
#[derive(Clone, Debug)]
pub(super) struct Profile {
    grey: [f32; BANDS],
    contrast: [f32; BANDS],
    rows_per_band: usize,
    bands: usize,
}

/// A profile with its own level, slope and contrast taken out: what remains says which rows differ from those around them.
/// The rows of a rectified pair show the same things, so the signatures of both pictures of a moment are alike.
#[derive(Clone, Debug)]
pub(super) struct Signature {
    values: [[i8; BANDS]; 2],
}

impl Profile {
    pub(super) const fn new() -> Self {
        Self { grey: [0.0; BANDS], contrast: [0.0; BANDS], rows_per_band: 0, bands: 0 }
    }

    /// Starts a picture of `height` rows.
    pub(super) fn begin(&mut self, height: usize) {
        self.rows_per_band = Self::rows_of_band(height);
        self.bands = (height / self.rows_per_band.max(1)).min(BANDS);
        self.grey.fill(0.0);
        self.contrast.fill(0.0);
    }

    /// Bands of the picture.
    pub(super) const fn bands(&self) -> usize {
        self.bands
    }

    /// Whole bands in `rows` rows, one at least.
    pub(super) fn bands_in(&self, rows: usize) -> usize {
        (rows / self.rows_per_band.max(1)).max(1)
    }

    /// Takes row `y`; only what is valid in it counts.
    ///
    /// # Bound
    /// Two passes over the row.
    #[inline(always)]
    pub(super) fn push(&mut self, y: usize, row: &[u8], span: ValidSpan) {
        let valid = row.get(usize::from(span.start)..usize::from(span.end)).unwrap_or_default();
        let band = y / self.rows_per_band.max(1);
        let (Some(grey), Some(contrast)) = (self.grey.get_mut(band), self.contrast.get_mut(band)) else { return };
        let Some(after) = valid.get(2..).filter(|after| !after.is_empty()) else { return };
        // A row has fewer than 2^24 pixels: no sum is too large.
        let sum = valid.iter().fold(0u32, |sum, &grey| sum.wrapping_add(u32::from(grey)));
        let steps = after
            .iter()
            .zip(valid)
            .fold(0u32, |sum, (&after, &before)| sum.wrapping_add(u32::from(after.abs_diff(before).min(STRONGEST))));
        *grey += sum as f32 / valid.len() as f32;
        *contrast += steps as f32 / after.len() as f32;
    }

    /// Rows of a band, before and after the first picture of a size.
    pub(super) fn rows_of_band(height: usize) -> usize {
        (height.saturating_add(BANDS - 1) / BANDS).max(1)
    }

    /// Adds what was seen of other bands of the same picture: of each band one of the two knows nothing.
    pub(super) fn append(&mut self, other: &Self) {
        for (mine, other) in [(&mut self.grey, &other.grey), (&mut self.contrast, &other.contrast)] {
            for (mine, other) in mine.iter_mut().zip(other) {
                *mine += other;
            }
        }
    }

    /// Writes the signature of the picture.
    ///
    /// # Bound
    /// `10 x BANDS` steps.
    pub(super) fn sign(&self, signature: &mut Signature) {
        for (profile, values) in [&self.grey, &self.contrast].into_iter().zip(&mut signature.values) {
            values.fill(0);
            let profile = profile.get(..self.bands).unwrap_or_default();
            let mut total = 0.0;
            for band in 0..profile.len() {
                total += stands_out(profile, band).abs();
            }
            let mean = total / profile.len().max(1) as f32;
            // A picture without any structure has no signature.
            if mean <= f32::from(i8::MAX) * f32::EPSILON {
                continue;
            }
            for (band, value) in values.iter_mut().take(profile.len()).enumerate() {
                let outstanding = (stands_out(profile, band) / mean).clamp(-OUTSTANDING, OUTSTANDING);
                *value = libm::roundf(outstanding * STEPS) as i8;
            }
        }
    }
}

/// By how much a band differs from the mean of its surroundings.
fn stands_out(profile: &[f32], band: usize) -> f32 {
    let first = band.saturating_sub(SURROUNDINGS);
    let around = profile.get(first..(band + SURROUNDINGS + 1).min(profile.len())).unwrap_or_default();
    let mean = around.iter().sum::<f32>() / around.len().max(1) as f32;
    profile.get(band).map_or(0.0, |value| value - mean)
}

impl Signature {
    pub(super) const NONE: Self = Self { values: [[0; BANDS]; 2] };

    /// How alike two signatures are: their correlation, -1 to 1; 0 where one of them says nothing. `other` is taken
    /// `halves` half bands lower.
    ///
    /// # Bound
    /// `2 x BANDS` steps.
    pub(super) fn likeness(&self, other: &Self, halves: isize) -> f32 {
        let (lowered, between) = (halves.div_euclid(2), halves.rem_euclid(2) as usize);
        let (mut ab, mut aa, mut bb) = (0i32, 0i32, 0i32);
        let skip = |needed: isize| needed.max(0) as usize;
        for (mine, theirs) in self.values.iter().zip(&other.values) {
            // Half way between two bands lies the mean of both; the correlation does not mind that it is their sum here.
            let mine = mine.iter().zip(mine.iter().skip(between)).skip(skip(lowered));
            for ((&upper, &below), &b) in mine.zip(theirs.iter().skip(skip(-lowered))) {
                let (a, b) = (i32::from(upper) + i32::from(below), i32::from(b));
                // 2 x BANDS products of less than 2^16.
                ab = ab.wrapping_add(a.wrapping_mul(b));
                aa = aa.wrapping_add(a.wrapping_mul(a));
                bb = bb.wrapping_add(b.wrapping_mul(b));
            }
        }
        if aa == 0 || bb == 0 {
            return 0.0;
        }
        ab as f32 / libm::sqrtf(aa as f32 * bb as f32)
    }
}

#[cfg(test)]
#[path = "profile_tests.rs"]
mod tests;
