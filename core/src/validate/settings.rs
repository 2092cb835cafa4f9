//! Settings of the validation by surface size.

use crate::error::ConfigError;

/// Settings of the validation by surface size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct ValidateSettings {
    /// Contiguous surfaces of fewer pixels are taken for false matches; 0 turns the check off. Strong, as the paper found
    /// it to remove errors and keep true readings (section 4.2).
    pub min_surface_px: u16,
    /// Neighbours belong to the same surface if their disparities differ by no more, 1/16 px.
    pub step_sixteenths: u16,
}

impl Default for ValidateSettings {
    fn default() -> Self {
        Self { min_surface_px: 120, step_sixteenths: 8 }
    }
}

impl ValidateSettings {
    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `validate.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        let largest = super::MAX_SURFACE_PX as f32;
        ConfigError::check("validate.min_surface_px", f32::from(self.min_surface_px), 0.0, largest)?;
        ConfigError::check("validate.step_sixteenths", f32::from(self.step_sixteenths), 0.0, 1024.0)
    }
}
