//! Settings of the earlier detectors and of the cross-check. What they have in common with the default detector (classes by
//! angle, limits of the ground, obstacles, cells) is set where it is set for that one.

use crate::error::ConfigError;

/// Settings of [`super::DetectorKind::CostMap`]. The columns are the cells of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct CostMapSettings {
    /// A column gives ground if the heights of its points deviate from their mean by no more than this, root mean square, metres.
    /// A higher limit takes in steeper ground, and objects with it: the paper, section 4.1.
    pub max_deviation_m: f32,
    /// ... and if it has at least this many points: the deviation of fewer says little.
    pub min_points: u16,
    /// ... and if its mean lies no farther than this from the level that the mount promises, metres: roofs and table tops are
    /// flat, too.
    pub max_level_m: f32,
    /// Fewer columns give no plane; the level of the mount takes its place. On any slope some columns are cut off at the edge of the
    /// picture, and their rest is flat.
    pub min_columns: u16,
    /// Points from this height above the plane on are obstacle points, metres. The paper, section 4.1: 0.25.
    pub min_height_m: f32,
    /// ... up to this height, metres. The paper, section 4.1: 1.25.
    pub max_height_m: f32,
    /// A cell is an obstacle from this cost on, the number of obstacle points in its column.
    pub obstacle_cost: u16,
}

/// Settings of [`super::DetectorKind::GroundDeviation`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct GroundDeviationSettings {
    /// A disparity deviates if it is off that of the ground by more than this, px: errors of matching that are not noise.
    pub deviation_px: f32,
    /// ... and by more than this many standard deviations of the disparities of the ground.
    pub deviation_sigmas: f32,
    /// Disparities within this distance of a plane speak for it, px.
    pub fit_tolerance_px: f32,
    /// Planes through three pixels that are tried.
    pub hypotheses: u16,
    /// Pixels, evenly spread over the picture, that planes are tried on.
    pub samples: u16,
}

/// Settings of [`super::DetectorKind::DisparitySegments`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct DisparitySegmentSettings {
    /// A segment is ground if it lies within this distance of the level that the mount promises, on average, metres,
    pub ground_tolerance_m: f32,
    /// and an object if it reaches this height above it, metres.
    pub min_height_m: f32,
}

/// Settings of [`super::DetectorKind::PixelNormals`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct PixelNormalSettings {
    /// Edge of the window around a pixel that a plane is fitted to, px; odd. The normal of a wider one is steadier, and that of
    /// a narrower one sees smaller things.
    pub window: u16,
    /// Share of the window's pixels that must have a disparity, percent.
    pub min_filled_percent: u8,
    /// A window whose disparities are off their plane by more than this, root mean square, px, lies across an edge: its pixel
    /// takes the class of the pixel beside it on the same surface.
    pub max_rms_px: f32,
}

/// How much a disagreement of two detectors takes from the confidence in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct ConfidenceSettings {
    /// Confidence in an obstacle that the other detector calls free, percent.
    pub disputed_percent: u8,
    /// Confidence in a cell that the other detector does not know, percent.
    pub unconfirmed_percent: u8,
}

impl CostMapSettings {
    /// All zero, for a detector that is not configured.
    pub(super) const UNSET: Self = Self {
        max_deviation_m: 0.0,
        min_points: 0,
        max_level_m: 0.0,
        min_columns: 0,
        min_height_m: 0.0,
        max_height_m: 0.0,
        obstacle_cost: 0,
    };

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `cost_map.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check("cost_map.max_deviation_m", self.max_deviation_m, 0.0, 2.0)?;
        ConfigError::check("cost_map.min_points", f32::from(self.min_points), 2.0, 10_000.0)?;
        ConfigError::check("cost_map.max_level_m", self.max_level_m, 0.0, 1.2)?;
        ConfigError::check("cost_map.min_columns", f32::from(self.min_columns), 1.0, 10_000.0)?;
        ConfigError::check("cost_map.min_height_m", self.min_height_m, 0.02, 5.0)?;
        ConfigError::check("cost_map.max_height_m", self.max_height_m, self.min_height_m, 20.0)?;
        ConfigError::check("cost_map.obstacle_cost", f32::from(self.obstacle_cost), 1.0, 65_535.0)
    }
}

impl Default for CostMapSettings {
    fn default() -> Self {
        Self {
            max_deviation_m: 0.03,
            min_points: 10,
            max_level_m: 0.5,
            min_columns: 24,
            min_height_m: 0.25,
            max_height_m: 1.25,
            obstacle_cost: 20,
        }
    }
}

impl GroundDeviationSettings {
    /// All zero, for a detector that is not configured.
    pub(super) const UNSET: Self =
        Self { deviation_px: 0.0, deviation_sigmas: 0.0, fit_tolerance_px: 0.0, hypotheses: 0, samples: 0 };

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `ground_deviation.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check("ground_deviation.deviation_px", self.deviation_px, 0.0, 100.0)?;
        ConfigError::check("ground_deviation.deviation_sigmas", self.deviation_sigmas, 0.0, 100.0)?;
        ConfigError::check("ground_deviation.fit_tolerance_px", self.fit_tolerance_px, 0.0625, 16.0)?;
        ConfigError::check("ground_deviation.hypotheses", f32::from(self.hypotheses), 0.0, 1000.0)?;
        ConfigError::check("ground_deviation.samples", f32::from(self.samples), 100.0, 16_384.0)
    }
}

impl Default for GroundDeviationSettings {
    fn default() -> Self {
        Self { deviation_px: 1.0, deviation_sigmas: 3.0, fit_tolerance_px: 0.75, hypotheses: 64, samples: 4096 }
    }
}

impl DisparitySegmentSettings {
    /// All zero, for a detector that is not configured.
    pub(super) const UNSET: Self = Self { ground_tolerance_m: 0.0, min_height_m: 0.0 };

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `disparity_segments.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check("disparity_segments.ground_tolerance_m", self.ground_tolerance_m, 0.001, 5.0)?;
        ConfigError::check("disparity_segments.min_height_m", self.min_height_m, 0.02, 5.0)
    }
}

impl Default for DisparitySegmentSettings {
    fn default() -> Self {
        Self { ground_tolerance_m: 0.15, min_height_m: 0.25 }
    }
}

impl PixelNormalSettings {
    /// Largest window: sums over it are exact.
    pub const MAX_WINDOW: u16 = 21;

    /// All zero, for a detector that is not configured.
    pub(super) const UNSET: Self = Self { window: 0, min_filled_percent: 0, max_rms_px: 0.0 };

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `pixel_normals.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check("pixel_normals.window", f32::from(self.window), 3.0, f32::from(Self::MAX_WINDOW))?;
        if self.window.is_multiple_of(2) {
            return Err(ConfigError::new("pixel_normals.window", crate::error::ConfigProblem::NotOdd));
        }
        ConfigError::check("pixel_normals.min_filled_percent", f32::from(self.min_filled_percent), 0.0, 100.0)?;
        ConfigError::check("pixel_normals.max_rms_px", self.max_rms_px, 0.0, 16.0)
    }
}

impl Default for PixelNormalSettings {
    fn default() -> Self {
        Self { window: 11, min_filled_percent: 50, max_rms_px: 0.35 }
    }
}

impl ConfidenceSettings {
    /// All zero, for a detector that is not configured.
    pub(crate) const UNSET: Self = Self { disputed_percent: 0, unconfirmed_percent: 0 };

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `confidence.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check("confidence.disputed_percent", f32::from(self.disputed_percent), 0.0, 100.0)?;
        ConfigError::check("confidence.unconfirmed_percent", f32::from(self.unconfirmed_percent), 0.0, 100.0)
    }
}

impl Default for ConfidenceSettings {
    fn default() -> Self {
        Self { disputed_percent: 50, unconfirmed_percent: 80 }
    }
}

#[cfg(test)]
#[path = "tests/settings.rs"]
mod tests;
