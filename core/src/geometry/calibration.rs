//! The calibration of a stereo pair.

use crate::error::{ConfigError, ConfigProblem};

/// Radial-tangential lens distortion in OpenCV's order of coefficients: k1, k2, p1, p2, k3, k4, k5, k6.
///
/// The model with 4 coefficients has k3 to k6 zero, the one with 5 has k4 to k6 zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion(pub [f32; 8]);

/// One pinhole camera with its lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraModel {
    /// Width of the picture, px.
    pub width: u32,
    /// Height of the picture, px.
    pub height: u32,
    /// Focal length along the row, px.
    pub fx: f32,
    /// Focal length along the column, px.
    pub fy: f32,
    /// Principal point, px from the centre of the first pixel of a row.
    pub cx: f32,
    /// Principal point, px from the centre of the first pixel of a column.
    pub cy: f32,
    /// Lens.
    pub distortion: Distortion,
}

/// A pair whose pictures are rectified already: the same point lies in the same row of both.
///
/// Distance of a point with disparity `d`: `focal_px * baseline_m / (d + disparity_offset_px)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RectifiedPair {
    /// Width of both pictures, px.
    pub width: u32,
    /// Height of both pictures, px.
    pub height: u32,
    /// Focal length of both cameras, px.
    pub focal_px: f32,
    /// Principal point of the left camera, px.
    pub cx: f32,
    /// Principal point of the left camera, px.
    pub cy: f32,
    /// Distance from the left to the right camera, metres.
    pub baseline_m: f32,
    /// Principal point of the right camera minus that of the left one, px; 0 for most pairs.
    pub disparity_offset_px: f32,
}

/// The rectified cameras that a calibration tool has chosen (OpenCV's `R1`, `R2`, `P1`, `P2`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectification {
    /// Turns the raw left camera's frame into the rectified one, row by row.
    pub left_rotation: [[f32; 3]; 3],
    /// Turns the raw right camera's frame into the rectified one, row by row.
    pub right_rotation: [[f32; 3]; 3],
    /// The rectified pair.
    pub pair: RectifiedPair,
}

/// A raw pair: `x_right = rotation * x_left + translation_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawPair {
    /// Left camera.
    pub left: CameraModel,
    /// Right camera.
    pub right: CameraModel,
    /// Turns the left camera's frame into the right one, row by row.
    pub rotation: [[f32; 3]; 3],
    /// Origin of the left camera in the right camera's frame, metres.
    pub translation_m: [f32; 3],
    /// The rectified cameras, where the calibration brings them; chosen by the rectifier otherwise.
    pub rectification: Option<Rectification>,
}

/// What is known of a pair of cameras.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is no heap to put the larger one on, and one value per pair of cameras"
)]
pub enum StereoCalibration {
    /// The pictures arrive rectified.
    Rectified(RectifiedPair),
    /// The pictures arrive as the cameras took them.
    Raw(RawPair),
}

impl RectifiedPair {
    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `calibration.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check("calibration.width", self.width as f32, 16.0, 8192.0)?;
        ConfigError::check("calibration.height", self.height as f32, 16.0, 8192.0)?;
        ConfigError::check("calibration.focal_px", self.focal_px, 1.0, 1.0e5)?;
        ConfigError::check("calibration.cx", self.cx, -1.0e5, 1.0e5)?;
        ConfigError::check("calibration.cy", self.cy, -1.0e5, 1.0e5)?;
        ConfigError::check("calibration.disparity_offset_px", self.disparity_offset_px, -1.0e4, 1.0e4)?;
        if self.baseline_m < 0.0 {
            return Err(ConfigError::new("calibration.baseline_m", ConfigProblem::Exchanged));
        }
        ConfigError::check("calibration.baseline_m", self.baseline_m, 1.0e-3, 100.0)
    }

    /// Distance along the optical axis of a point with disparity `disparity_px`, metres; infinite where the rays do not meet.
    ///
    /// Source: the paper, Table 1.
    pub fn distance_m(&self, disparity_px: f32) -> f32 {
        let disparity = disparity_px + self.disparity_offset_px;
        if disparity > 0.0 { self.focal_px * self.baseline_m / disparity } else { f32::INFINITY }
    }

    /// Disparity of a point `distance_m` along the optical axis, px.
    pub fn disparity_px(&self, distance_m: f32) -> f32 {
        self.focal_px * self.baseline_m / distance_m - self.disparity_offset_px
    }
}
