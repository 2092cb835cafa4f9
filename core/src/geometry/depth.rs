//! From disparity to distance by table.

use core::ops::Range;

use super::RectifiedPair;
use crate::links::VALUES;

/// Distances of all disparities of the search range.
///
/// Distances are kept as integers, `INVERSE_ONE / disparity` with the disparity in 1/16 px, so that sums of them are exact and
/// the same on every processor; [`Self::scale_m`] turns them into metres.
pub struct DepthTable<const DISPARITIES: usize> {
    inverse: [[u32; 16]; DISPARITIES],
    /// Disparity of the first entry, 1/16 px.
    base_steps: u16,
    /// Disparities that have a distance, 1/16 px, without 0.
    covered: Range<u16>,
    scale_m: f32,
}

/// Inverse of a disparity of 1/16 px. At 128 px a step of 1/16 px still changes the inverse by 8.
const INVERSE_ONE: f32 = (1 << 25) as f32;

impl<const DISPARITIES: usize> DepthTable<DISPARITIES> {
    /// An empty table: no disparity has a distance.
    pub const fn new() -> Self {
        Self { inverse: [[0; 16]; DISPARITIES], base_steps: 0, covered: 0..0, scale_m: 0.0 }
    }

    /// Fills the table for `disparities` disparities from `min_disparity` on. Disparities whose rays do not meet in front of
    /// the camera have no distance, and neither has 0: it stands for pixels without a disparity.
    ///
    /// # Bound
    /// `16 x DISPARITIES` steps.
    pub fn configure(&mut self, pair: &RectifiedPair, min_disparity: u16, disparities: u16) {
        self.base_steps = min_disparity.saturating_mul(16);
        self.scale_m = 16.0 * pair.focal_px * pair.baseline_m / INVERSE_ONE;
        let offset_steps = pair.disparity_offset_px * 16.0;
        let used = usize::from(disparities) * 16;
        for (i, entry) in self.inverse.as_flattened_mut().iter_mut().enumerate() {
            let disparity = f32::from(self.base_steps) + i as f32;
            let steps = disparity + offset_steps;
            *entry =
                if i < used && disparity > 0.0 && steps >= 1.0 { libm::roundf(INVERSE_ONE / steps) as u32 } else { 0 };
        }
        let place = |i: usize| self.base_steps.saturating_add(u16::try_from(i).unwrap_or(u16::MAX));
        let entries = self.inverse.as_flattened();
        let first = entries.iter().position(|&inverse| inverse != 0);
        let last = entries.iter().rposition(|&inverse| inverse != 0);
        self.covered = match first.zip(last) {
            Some((first, last)) => {
                let (values, end) = (VALUES, place(last + 1));
                place(first).clamp(values.start, values.end)..end.clamp(values.start, values.end)
            }
            None => 0..0,
        };
    }

    /// The disparities of pixels that have a distance, 1/16 px: they lie side by side, because the table ends in itself and rays that
    /// do not meet belong to the smallest disparities.
    pub const fn covered(&self) -> Range<u16> {
        self.covered.start..self.covered.end
    }

    /// Distance along the optical axis at a disparity in 1/16 px, in units of [`Self::scale_m`]; 0 if it has none.
    pub fn inverse(&self, steps: u16) -> u32 {
        let place = steps.checked_sub(self.base_steps).map(usize::from);
        place.and_then(|place| self.inverse.as_flattened().get(place)).copied().unwrap_or(0)
    }

    /// Distance along the optical axis at a disparity in 1/16 px, metres; 0 if it has none.
    pub fn distance_m(&self, steps: u16) -> f32 {
        self.inverse(steps) as f32 * self.scale_m
    }

    /// [`Self::inverse`] of pixels side by side that all are [`Self::covered`]; of others it gives any of the distances.
    #[inline(always)]
    pub(crate) fn inverses<const N: usize>(&self, steps: &[u16; N]) -> [u32; N] {
        let entries = self.inverse.as_flattened();
        let mut inverses = [0; N];
        for (inverse, steps) in inverses.iter_mut().zip(steps) {
            // Of a known range, so that it is not checked once more.
            let place = usize::from(steps.wrapping_sub(self.base_steps)).min((16 * DISPARITIES).saturating_sub(1));
            *inverse = entries.get(place).copied().unwrap_or(0);
        }
        inverses
    }

    /// [`Self::distance_m`] of pixels side by side, as [`Self::inverses`].
    #[inline(always)]
    pub(crate) fn distances_m<const N: usize>(&self, steps: &[u16; N]) -> [f32; N] {
        let mut distances_m = [0.0; N];
        for (distance_m, inverse) in distances_m.iter_mut().zip(self.inverses(steps)) {
            // Below 2^31: signed numbers are what vector instructions turn into floating point.
            *distance_m = inverse as i32 as f32 * self.scale_m;
        }
        distances_m
    }

    /// Focal length times baseline, px m: the distance at a disparity of 1 px.
    pub fn focal_baseline_px_m(&self) -> f32 {
        self.scale_m * (INVERSE_ONE / 16.0)
    }

    /// Metres in one unit of [`Self::inverse`].
    pub const fn scale_m(&self) -> f32 {
        self.scale_m
    }
}

impl<const DISPARITIES: usize> Default for DepthTable<DISPARITIES> {
    fn default() -> Self {
        Self::new()
    }
}
