//! From when on something is said.

use crate::error::ConfigError;

/// From when on something is said.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct HealthSettings {
    /// A picture is underexposed from this share of nearly black pixels on, percent.
    pub dark_percent: f32,
    /// ... and shows nothing from this share on, percent.
    pub dark_blind_percent: f32,
    /// A picture is overexposed from this share of nearly white pixels on, percent.
    pub bright_percent: f32,
    /// ... and shows nothing from this share on, percent.
    pub bright_blind_percent: f32,
    /// Left and right are exposed differently if their mean grey values differ by more than this factor.
    pub exposure_ratio: f32,
    /// Disparities are too few below this share of the pixels, percent.
    pub low_coverage_percent: f32,
    /// Nothing can be told below this share of the pixels, percent.
    pub blind_coverage_percent: f32,
    /// The near zone is blocked from this share of the lower half of the picture on whose match lies at the end of the
    /// disparity range, percent.
    pub near_zone_percent: f32,
    /// Below this share of pixels with a disparity, a few rows are matched the other way round, to see whether left and right
    /// are exchanged, percent.
    pub exchange_test_percent: f32,
    /// A part of a picture has structure if the means of neighbouring 4 x 4 pixels differ by this on average, grey values; it is
    /// flat below half of that. The noise of a sensor makes a fifth of it.
    pub structure_grey: f32,
    /// A lens is partly covered if this share of the parts that have structure in the other picture is flat, percent.
    pub covered_percent: f32,
    /// ... and nothing can be told from this share on, percent.
    pub covered_blind_percent: f32,
    /// A lens is covered if this share of its picture is flat, whatever the other one shows, percent.
    pub flat_percent: f32,
    /// A lens is partly covered if its picture has more flat parts than the other one by this share of all, percent. What only
    /// one of them sees is no more than the search range, an eighth of the width by default.
    pub flat_excess_percent: f32,
    /// Left and right show different moments if the rows of pictures of other moments are more alike by this many standard
    /// errors.
    pub pairing_sigmas: f32,
    /// ... and at least this alike, as a correlation.
    pub pairing_likeness: f32,
    /// Rows are out of line from this distance on, px.
    pub row_error_px: f32,
    /// ... and nothing can be told from this distance on, px.
    pub row_error_blind_px: f32,
    /// Reasons that are estimated are told when as many frames in a row have found them.
    pub trigger_frames: u8,
    /// Reasons are told until as many frames in a row have not found them.
    pub release_frames: u8,
}

impl HealthSettings {
    /// All zero, for a detector that is not configured.
    pub(crate) const UNSET: Self = Self {
        dark_percent: 0.0,
        dark_blind_percent: 0.0,
        bright_percent: 0.0,
        bright_blind_percent: 0.0,
        exposure_ratio: 0.0,
        low_coverage_percent: 0.0,
        blind_coverage_percent: 0.0,
        near_zone_percent: 0.0,
        exchange_test_percent: 0.0,
        structure_grey: 0.0,
        covered_percent: 0.0,
        covered_blind_percent: 0.0,
        flat_percent: 0.0,
        flat_excess_percent: 0.0,
        pairing_sigmas: 0.0,
        pairing_likeness: 0.0,
        row_error_px: 0.0,
        row_error_blind_px: 0.0,
        trigger_frames: 0,
        release_frames: 0,
    };

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `health.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check("health.dark_percent", self.dark_percent, 0.0, 101.0)?;
        ConfigError::check("health.dark_blind_percent", self.dark_blind_percent, 0.0, 101.0)?;
        ConfigError::check("health.bright_percent", self.bright_percent, 0.0, 101.0)?;
        ConfigError::check("health.bright_blind_percent", self.bright_blind_percent, 0.0, 101.0)?;
        ConfigError::check("health.exposure_ratio", self.exposure_ratio, 1.0, 1000.0)?;
        ConfigError::check("health.low_coverage_percent", self.low_coverage_percent, 0.0, 100.0)?;
        ConfigError::check("health.blind_coverage_percent", self.blind_coverage_percent, 0.0, 100.0)?;
        ConfigError::check("health.near_zone_percent", self.near_zone_percent, 0.0, 101.0)?;
        ConfigError::check("health.exchange_test_percent", self.exchange_test_percent, 0.0, 100.0)?;
        ConfigError::check("health.structure_grey", self.structure_grey, 0.1, 100.0)?;
        ConfigError::check("health.covered_percent", self.covered_percent, 1.0, 101.0)?;
        ConfigError::check("health.covered_blind_percent", self.covered_blind_percent, 1.0, 101.0)?;
        ConfigError::check("health.flat_percent", self.flat_percent, 1.0, 101.0)?;
        ConfigError::check("health.flat_excess_percent", self.flat_excess_percent, 1.0, 101.0)?;
        ConfigError::check("health.pairing_sigmas", self.pairing_sigmas, 1.0, 1000.0)?;
        ConfigError::check("health.pairing_likeness", self.pairing_likeness, 0.0, 1.0)?;
        ConfigError::check("health.row_error_px", self.row_error_px, 0.1, 100.0)?;
        ConfigError::check("health.row_error_blind_px", self.row_error_blind_px, 0.1, 100.0)?;
        ConfigError::check("health.trigger_frames", f32::from(self.trigger_frames), 1.0, 2.0)?;
        ConfigError::check("health.release_frames", f32::from(self.release_frames), 1.0, 100.0)
    }
}

impl Default for HealthSettings {
    fn default() -> Self {
        Self {
            dark_percent: 80.0,
            dark_blind_percent: 95.0,
            bright_percent: 50.0,
            bright_blind_percent: 80.0,
            exposure_ratio: 2.0,
            low_coverage_percent: 8.0,
            blind_coverage_percent: 1.0,
            near_zone_percent: 40.0,
            exchange_test_percent: 15.0,
            structure_grey: 3.0,
            covered_percent: 10.0,
            covered_blind_percent: 30.0,
            flat_percent: 95.0,
            flat_excess_percent: 25.0,
            pairing_sigmas: 3.5,
            pairing_likeness: 0.5,
            row_error_px: 1.0,
            row_error_blind_px: 2.0,
            trigger_frames: 2,
            release_frames: 5,
        }
    }
}
