//! Settings of the matcher.

use super::census;
use crate::error::{ConfigError, ConfigProblem};

/// What is compared between the two pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Prefilter {
    /// The horizontal Sobel response, cut off at +-31: does not mind that the two cameras are exposed differently.
    #[default]
    HorizontalSobel,
    /// Plain grey values, as the paper's matcher; for cameras that share exposure and gain.
    Grey,
}

/// How two windows are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum MatchCost {
    /// Hamming distance of census codes: eight bits for each pixel say which of eight pixels around it are darker. What a
    /// pixel says does not grow with its contrast, so that weak texture, such as tarmac, still finds its match.
    #[default]
    Census,
    /// The sum of absolute differences of the prefiltered pictures, as in the paper.
    AbsoluteDifferences,
}

/// Settings of the matcher.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct MatchSettings {
    /// Number of disparities searched, px. The nearest distance seen is focal length x baseline / largest disparity.
    pub disparities: u16,
    /// Smallest disparity searched, px.
    pub min_disparity: u16,
    /// How two windows are compared.
    pub cost: MatchCost,
    /// Width of the matching window, px; odd, 5 to 21. The paper, section 2.2: 7. Wider than high, because the disparity of the
    /// ground changes from row to row and not along a row: a wide window sees more of it at one disparity, a high one does not.
    pub window_width: u16,
    /// Height of the matching window, px; odd, 5 to 21. The paper, section 2.2: 7.
    pub window_height: u16,
    /// Width of a second window, px; odd, up to 63, and not less than the first; 0 for none. It is asked where the first cannot
    /// tell one place from another because the texture is weak, as on tarmac: there are few edges that it could smear.
    pub wide_window_width: u16,
    /// Below this mean absolute prefilter response under the first window the texture is weak, 1/16 grey values. Texture above it
    /// that is not unique is repetitive, and a wider window does not help.
    pub weak_texture: u16,
    /// As `uniqueness_percent`, for the second window: its sums are larger and their noise relative to them smaller.
    pub wide_uniqueness_percent: u16,
    /// What the texture is measured on, and what absolute differences are taken of.
    pub prefilter: Prefilter,
    /// Least mean absolute prefilter response (for plain grey: horizontal difference) under the window, in 1/16 grey
    /// values; 0 turns the texture check off. Mild, since it costs ground points (the paper, section 4.2).
    pub texture: u16,
    /// A match must be better by this many percent than any other that is more than one pixel away; 0 turns the
    /// uniqueness check off. Mild, as texture.
    pub uniqueness_percent: u16,
    /// As `uniqueness_percent`, for the first window where the texture is weak and there is a second one: what the first is not
    /// sure of, the second tells better.
    pub weak_uniqueness_percent: u16,
    /// Whether a pixel loses its match if its partner in the right picture matches another one better.
    pub back_check: bool,
    /// Largest difference between the match from left to right and the one back, px.
    pub back_check_px: u16,
    /// A window with more than this share of pixels at 0 or 255 is saturated, percent; 100 turns the check off.
    pub saturated_percent: u16,
}

impl Default for MatchSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl MatchSettings {
    /// The defaults.
    pub const DEFAULT: Self = Self {
        disparities: 64,
        min_disparity: 0,
        cost: MatchCost::Census,
        window_width: 9,
        window_height: 7,
        wide_window_width: 31,
        weak_texture: 224,
        wide_uniqueness_percent: 6,
        prefilter: Prefilter::HorizontalSobel,
        texture: 32,
        uniqueness_percent: 6,
        weak_uniqueness_percent: 12,
        back_check: true,
        back_check_px: 1,
        saturated_percent: 60,
    };
    /// All zero, for a matcher that is not configured: a detector of zeros takes no room in the image of a program.
    pub(super) const UNSET: Self = Self {
        disparities: 0,
        min_disparity: 0,
        cost: MatchCost::Census,
        window_width: 0,
        window_height: 0,
        wide_window_width: 0,
        weak_texture: 0,
        wide_uniqueness_percent: 0,
        prefilter: Prefilter::HorizontalSobel,
        texture: 0,
        uniqueness_percent: 0,
        weak_uniqueness_percent: 0,
        back_check: false,
        back_check_px: 0,
        saturated_percent: 0,
    };

    /// Smallest window.
    pub const MIN_WINDOW: u16 = 5;
    /// Largest window: its sums still fit 16 bits.
    pub const MAX_WINDOW: u16 = 21;
    /// Largest width of the second window.
    pub const MAX_WIDE_WINDOW: u16 = 63;

    /// Uniqueness that the first window is asked for: where there is texture, and where it is weak.
    pub(super) const fn narrow_uniqueness_percent(&self) -> [u16; 2] {
        let weak = if self.wide_window_width > 0 { self.weak_uniqueness_percent } else { self.uniqueness_percent };
        [self.uniqueness_percent, weak]
    }

    /// Rows above and below a pixel that what is compared of it depends on.
    pub(crate) const fn reach(&self) -> usize {
        match self.cost {
            MatchCost::Census => census::REACH,
            MatchCost::AbsoluteDifferences => 1,
        }
    }

    /// Pixels around the middle of the window that must be valid: half a window, and the reach of what is compared. Left and
    /// right, then above and below.
    pub(crate) fn margins(&self) -> [usize; 2] {
        [self.window_width, self.window_height].map(|edge| usize::from(edge) / 2 + self.reach())
    }

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `matching.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        let range = |field, value: u16, min: u16, max: u16| {
            ConfigError::check(field, f32::from(value), f32::from(min), f32::from(max))
        };
        range("matching.disparities", self.disparities, 8, 1024)?;
        range("matching.min_disparity", self.min_disparity, 0, 1000)?;
        for (field, edge) in
            [("matching.window_width", self.window_width), ("matching.window_height", self.window_height)]
        {
            range(field, edge, Self::MIN_WINDOW, Self::MAX_WINDOW)?;
            if edge.is_multiple_of(2) {
                return Err(ConfigError::new(field, ConfigProblem::NotOdd));
            }
        }
        if self.wide_window_width > 0 {
            range("matching.wide_window_width", self.wide_window_width, self.window_width, Self::MAX_WIDE_WINDOW)?;
            if self.wide_window_width.is_multiple_of(2) {
                return Err(ConfigError::new("matching.wide_window_width", ConfigProblem::NotOdd));
            }
        }
        // Sums under a window have 16 bits.
        let largest = match (self.cost, self.prefilter) {
            (MatchCost::Census, _) => 8,
            (MatchCost::AbsoluteDifferences, Prefilter::HorizontalSobel) => 62,
            (MatchCost::AbsoluteDifferences, Prefilter::Grey) => 127,
        };
        let needed = usize::from(self.wide_window_width) * usize::from(self.window_height) * largest;
        let capacity = usize::from(u16::MAX);
        if needed > capacity {
            let problem = ConfigProblem::OverCapacity { needed, capacity };
            return Err(ConfigError::new("matching.wide_window_width x matching.window_height", problem));
        }
        range("matching.weak_texture", self.weak_texture, 0, 1000)?;
        range("matching.wide_uniqueness_percent", self.wide_uniqueness_percent, 0, 100)?;
        range("matching.texture", self.texture, 0, 1000)?;
        range("matching.uniqueness_percent", self.uniqueness_percent, 0, 100)?;
        range("matching.weak_uniqueness_percent", self.weak_uniqueness_percent, 0, 100)?;
        range("matching.back_check_px", self.back_check_px, 0, 64)?;
        range("matching.saturated_percent", self.saturated_percent, 1, 100)
    }
}

#[cfg(test)]
#[path = "settings_tests.rs"]
mod tests;
