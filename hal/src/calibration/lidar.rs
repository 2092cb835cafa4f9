//! The lidar beside the left camera, as KITTI's `calib.txt` has it.

use std::path::Path;

use super::error::{CalibrationError, CalibrationProblem};
use super::{kitti, read};

/// How points of a lidar appear in the left picture of a rectified pair.
///
/// In double precision, unlike the calibration that the detector works with: what is compared with the detector must not lean on
/// the same rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LidarCalibration {
    /// Focal length, px.
    pub focal_px: f64,
    /// Column of the principal point of the left camera, px.
    pub cx: f64,
    /// Row of the principal point of the left camera, px.
    pub cy: f64,
    /// From the left to the right camera, metres.
    pub baseline_m: f64,
    /// From a point of the lidar, with a 1 behind it, to the left camera's frame (x right, y down, z forward), metres: `Tr`.
    pub to_camera: [[f64; 4]; 3],
}

impl LidarCalibration {
    /// Reads `P0`, `P1` and `Tr` of the `calib.txt` in `folder`; `None` where there is no such file or no `Tr` in it.
    ///
    /// # Errors
    /// [`CalibrationError`] where one of them cannot be used.
    pub fn read(folder: &Path) -> Result<Option<Self>, CalibrationError> {
        let file = folder.join("calib.txt");
        if !file.is_file() {
            return Ok(None);
        }
        let text = read(&file)?;
        let matrix = |field| kitti::matrix(&file, &text, field);
        let tr = match matrix("Tr") {
            Err(CalibrationError { problem: CalibrationProblem::Missing, .. }) => return Ok(None),
            other => other?,
        };
        let (left, right) = (matrix("P0")?, matrix("P1")?);
        for (field, focal_px) in [("P0", left[0]), ("P1", right[0])] {
            if focal_px <= 0.0 {
                return Err(CalibrationError::new(&file, field, CalibrationProblem::FocalLength(focal_px)));
            }
        }
        let [a, b, c, d, e, f, g, h, i, j, k, l] = tr;
        Ok(Some(Self {
            focal_px: left[0],
            cx: left[2],
            cy: left[6],
            baseline_m: -right[3] / right[0],
            to_camera: [[a, b, c, d], [e, f, g, h], [i, j, k, l]],
        }))
    }
}
