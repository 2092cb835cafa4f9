//! Settings of the matcher.

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

/// Settings of the matcher.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct MatchSettings {
    /// Number of disparities searched, px. The nearest distance seen is focal length x baseline / largest disparity.
    pub disparities: u16,
    /// Smallest disparity searched, px.
    pub min_disparity: u16,
    /// Edge of the matching window, px; odd, 5 to 21. The paper, section 2.2: 7.
    pub window: u16,
    /// What is compared.
    pub prefilter: Prefilter,
    /// Least mean absolute prefilter response (for plain grey: horizontal difference) under the window, in 1/16 grey
    /// values; 0 turns the texture check off. Mild, since it costs ground points (the paper, section 4.2).
    pub texture: u16,
    /// A match must be better by this many percent than any other that is more than one pixel away; 0 turns the
    /// uniqueness check off. Mild, as texture.
    pub uniqueness_percent: u16,
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
        window: 7,
        prefilter: Prefilter::HorizontalSobel,
        texture: 16,
        uniqueness_percent: 8,
        back_check: true,
        back_check_px: 1,
        saturated_percent: 60,
    };
    /// All zero, for a matcher that is not configured: a detector of zeros takes no room in the image of a program.
    pub(super) const UNSET: Self = Self {
        disparities: 0,
        min_disparity: 0,
        window: 0,
        prefilter: Prefilter::HorizontalSobel,
        texture: 0,
        uniqueness_percent: 0,
        back_check: false,
        back_check_px: 0,
        saturated_percent: 0,
    };

    /// Smallest window.
    pub const MIN_WINDOW: u16 = 5;
    /// Largest window: its sums still fit 16 bits.
    pub const MAX_WINDOW: u16 = 21;

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
        range("matching.window", self.window, Self::MIN_WINDOW, Self::MAX_WINDOW)?;
        if self.window.is_multiple_of(2) {
            return Err(ConfigError::new("matching.window", ConfigProblem::NotOdd));
        }
        range("matching.texture", self.texture, 0, 1000)?;
        range("matching.uniqueness_percent", self.uniqueness_percent, 0, 100)?;
        range("matching.back_check_px", self.back_check_px, 0, 64)?;
        range("matching.saturated_percent", self.saturated_percent, 1, 100)
    }
}
