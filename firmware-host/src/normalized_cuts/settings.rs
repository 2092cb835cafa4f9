//! Settings of the normalized cuts.

use fencepost_core::error::ConfigError;
use serde::{Deserialize, Serialize};

/// Settings of the normalized cuts: how the picture becomes a graph, and when it is cut no further.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NormalizedCutSettings {
    /// The picture is shrunk by a whole number to at most this width, px: the time grows faster than the number of pixels.
    pub width_px: u32,
    /// Pixels of the shrunk picture up to this far apart have an affinity, px.
    pub radius_px: u32,
    /// Difference of grey values at which the affinity has fallen to 1/e.
    pub grey_scale: f64,
    /// Difference of disparities at which it has fallen to 1/e, px of the whole picture.
    pub disparity_scale_px: f64,
    /// Distance of places at which it has fallen to 1/e, px of the shrunk picture.
    pub place_scale_px: f64,
    /// A segment is cut if the best normalized cut of it is below this: 0 for parts that have nothing in common, 2 for parts that
    /// have more in common with each other than within.
    pub max_cut: f64,
    /// No segment gets smaller than this, px of the shrunk picture.
    pub min_pixels: u32,
    /// Greatest number of segments.
    pub max_segments: u32,
}

impl NormalizedCutSettings {
    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `normalized_cuts.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        let check = |field, value: f64, low, high| ConfigError::check(field, value as f32, low, high);
        check("normalized_cuts.width_px", f64::from(self.width_px), 16.0, 640.0)?;
        check("normalized_cuts.radius_px", f64::from(self.radius_px), 1.0, 16.0)?;
        check("normalized_cuts.grey_scale", self.grey_scale, 0.1, 1000.0)?;
        check("normalized_cuts.disparity_scale_px", self.disparity_scale_px, 0.01, 1000.0)?;
        check("normalized_cuts.place_scale_px", self.place_scale_px, 0.1, 1000.0)?;
        check("normalized_cuts.max_cut", self.max_cut, 0.0, 2.0)?;
        check("normalized_cuts.min_pixels", f64::from(self.min_pixels), 1.0, 1.0e5)?;
        check("normalized_cuts.max_segments", f64::from(self.max_segments), 1.0, 1000.0)
    }
}

impl Default for NormalizedCutSettings {
    fn default() -> Self {
        Self {
            width_px: 160,
            radius_px: 5,
            grey_scale: 15.0,
            disparity_scale_px: 1.0,
            place_scale_px: 4.0,
            max_cut: 0.06,
            min_pixels: 40,
            max_segments: 60,
        }
    }
}
