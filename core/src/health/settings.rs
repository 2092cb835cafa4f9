//! From when on something is said.

use crate::error::ConfigError;

/// From when on something is said.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct HealthSettings {
    /// A picture is underexposed from this share of nearly black pixels on, percent.
    pub dark_percent: f32,
    /// A picture is overexposed from this share of nearly white pixels on, percent.
    pub bright_percent: f32,
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
}

impl HealthSettings {
    /// All zero, for a detector that is not configured.
    pub(crate) const UNSET: Self = Self {
        dark_percent: 0.0,
        bright_percent: 0.0,
        exposure_ratio: 0.0,
        low_coverage_percent: 0.0,
        blind_coverage_percent: 0.0,
        near_zone_percent: 0.0,
        exchange_test_percent: 0.0,
    };

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `health.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check("health.dark_percent", self.dark_percent, 0.0, 101.0)?;
        ConfigError::check("health.bright_percent", self.bright_percent, 0.0, 101.0)?;
        ConfigError::check("health.exposure_ratio", self.exposure_ratio, 1.0, 1000.0)?;
        ConfigError::check("health.low_coverage_percent", self.low_coverage_percent, 0.0, 100.0)?;
        ConfigError::check("health.blind_coverage_percent", self.blind_coverage_percent, 0.0, 100.0)?;
        ConfigError::check("health.near_zone_percent", self.near_zone_percent, 0.0, 101.0)?;
        ConfigError::check("health.exchange_test_percent", self.exchange_test_percent, 0.0, 100.0)
    }
}

impl Default for HealthSettings {
    fn default() -> Self {
        Self {
            dark_percent: 80.0,
            bright_percent: 50.0,
            exposure_ratio: 2.0,
            low_coverage_percent: 8.0,
            blind_coverage_percent: 1.0,
            near_zone_percent: 40.0,
            exchange_test_percent: 15.0,
        }
    }
}
