//! Settings of the obstacles.

use crate::error::ConfigError;

/// Settings of the obstacles.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct ObstacleSettings {
    /// An obstacle reaches at least this height above the ground, metres. The paper, section 4.1: 0.25.
    pub min_height_m: f32,
    /// Near-horizontal surfaces from this height on belong to obstacles, metres: below it they may be ground of another
    /// level, above it no vehicle climbs.
    pub platform_height_m: f32,
    /// What begins above this height can be driven under, metres.
    pub clearance_m: f32,
    /// An obstacle has at least this many pixels.
    pub min_pixels: u16,
    /// ... and shows at least this much of itself, square metres: the pixels that take it are fewer the farther away it is, while
    /// false matches are as large everywhere.
    pub min_area_m2: f32,
    /// An obstacle is at least this long, wide or high, metres.
    pub min_size_m: f32,
    /// Surfaces farther away take no part, metres: there, what hangs together in the picture may lie far apart.
    pub max_range_m: f32,
}

impl ObstacleSettings {
    /// All zero, for a stage that is not configured.
    pub(super) const UNSET: Self = Self {
        min_height_m: 0.0,
        platform_height_m: 0.0,
        clearance_m: 0.0,
        min_pixels: 0,
        min_area_m2: 0.0,
        min_size_m: 0.0,
        max_range_m: 0.0,
    };

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `obstacles.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check("obstacles.min_height_m", self.min_height_m, 0.02, 5.0)?;
        ConfigError::check("obstacles.platform_height_m", self.platform_height_m, self.min_height_m, 5.0)?;
        ConfigError::check("obstacles.clearance_m", self.clearance_m, self.min_height_m, 20.0)?;
        ConfigError::check("obstacles.min_pixels", f32::from(self.min_pixels), 0.0, 10_000.0)?;
        ConfigError::check("obstacles.min_area_m2", self.min_area_m2, 0.0, 10.0)?;
        ConfigError::check("obstacles.min_size_m", self.min_size_m, 0.0, 5.0)?;
        ConfigError::check("obstacles.max_range_m", self.max_range_m, 0.1, 1000.0)
    }
}

impl Default for ObstacleSettings {
    fn default() -> Self {
        Self {
            min_height_m: 0.25,
            platform_height_m: 0.6,
            clearance_m: 2.5,
            min_pixels: 40,
            min_area_m2: 0.02,
            min_size_m: 0.15,
            max_range_m: 40.0,
        }
    }
}
