//! Settings of the surfaces and their classes.

use super::tile::MIN_PIXELS;
use crate::error::ConfigError;

/// Settings of the surfaces and their classes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct SurfaceSettings {
    /// Neighbours belong to the same surface if their disparities differ by no more, 1/16 px.
    pub step_sixteenths: u16,
    /// Surfaces of fewer pixels are left out: no plane through them means anything.
    pub min_pixels: u16,
    /// Surfaces within this angle of horizontal may be ground, degrees. The paper, section 4.4: 30.
    pub horizontal_deg: f32,
    /// Surfaces steeper than this are vertical, degrees; what lies between is for its height to decide.
    pub vertical_deg: f32,
}

impl SurfaceSettings {
    /// All zero, for a stage that is not configured.
    pub(super) const UNSET: Self = Self { step_sixteenths: 0, min_pixels: 0, horizontal_deg: 0.0, vertical_deg: 0.0 };

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `surfaces.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check("surfaces.step_sixteenths", f32::from(self.step_sixteenths), 0.0, 1024.0)?;
        ConfigError::check("surfaces.min_pixels", f32::from(self.min_pixels), f32::from(MIN_PIXELS), 1024.0)?;
        ConfigError::check("surfaces.horizontal_deg", self.horizontal_deg, 1.0, 89.0)?;
        ConfigError::check("surfaces.vertical_deg", self.vertical_deg, self.horizontal_deg, 89.0)
    }
}

impl Default for SurfaceSettings {
    fn default() -> Self {
        Self { step_sixteenths: 16, min_pixels: 24, horizontal_deg: 30.0, vertical_deg: 45.0 }
    }
}
