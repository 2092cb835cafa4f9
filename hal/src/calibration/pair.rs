//! From the numbers of a file to a checked pair. All in f64; the core's f32 come last.

use std::path::Path;

use fencepost_core::geometry::{CameraModel, Distortion, RawPair, Rectification, RectifiedPair};
use nalgebra::{Matrix3, Vector3};

use super::error::{CalibrationError, CalibrationProblem, CalibrationWarning};

/// Largest deviation of a rotation matrix that rounding in a file explains.
const ROTATION_TOLERANCE: f64 = 1.0e-3;
/// Largest difference between a rectification and its pose that rounding in a file explains.
const POSE_TOLERANCE: f64 = 1.0e-3;
/// Baselines above this are not a robot's: most likely millimetres or centimetres. Metres.
const LONG_BASELINE_M: f64 = 5.0;
/// Baselines above this are none in any unit: 100 m in millimetres.
const MAX_BASELINE: f64 = 1.0e5;
/// Baselines below this cannot be told from none. Metres.
const SHORT_BASELINE_M: f64 = 1.0e-3;
/// Relative difference of focal lengths that is rounding.
const SAME_FOCAL: f64 = 1.0e-4;

/// Where a value stands: file and field, for the errors.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    pub(super) file: &'a Path,
    pub(super) field: &'a str,
}

impl Place<'_> {
    pub(super) fn error(self, problem: CalibrationProblem) -> CalibrationError {
        CalibrationError::new(self.file, self.field, problem)
    }

    fn range(self, value: f64, min: f64, max: f64) -> Result<f64, CalibrationError> {
        if !value.is_finite() {
            return Err(self.error(CalibrationProblem::NotFinite));
        }
        if value < min || value > max {
            return Err(self.error(CalibrationProblem::OutOfRange { value, min, max }));
        }
        Ok(value)
    }
}

/// Size of a picture, px; refused where nothing can be done with it.
pub(super) fn size(place: Place<'_>, width: f64, height: f64) -> Result<(u32, u32), CalibrationError> {
    let width = place.range(width, 16.0, 8192.0)?;
    let height = place.range(height, 16.0, 8192.0)?;
    Ok((width as u32, height as u32))
}

/// The size in the file if it says one, else that of the pictures.
pub(super) fn size_or_pictures(
    place: Place<'_>,
    in_file: Option<(u32, u32)>,
    pictures: Option<(u32, u32)>,
) -> Result<(u32, u32), CalibrationError> {
    match (in_file, pictures) {
        (Some(file), Some(pictures)) if file != pictures => {
            Err(place.error(CalibrationProblem::SizeDiffers { file, pictures }))
        }
        (Some(size), _) | (None, Some(size)) => Ok(size),
        (None, None) => Err(place.error(CalibrationProblem::SizeUnknown)),
    }
}

/// The size that both cameras have.
pub(super) fn same_size(
    place: Place<'_>,
    left: &CameraModel,
    right: &CameraModel,
) -> Result<(u32, u32), CalibrationError> {
    let (left, right) = ((left.width, left.height), (right.width, right.height));
    if left == right { Ok(left) } else { Err(place.error(CalibrationProblem::SizesDiffer { left, right })) }
}

/// A camera from its matrix, row by row.
pub(super) fn camera(
    place: Place<'_>,
    k: [f64; 9],
    (width, height): (u32, u32),
) -> Result<CameraModel, CalibrationError> {
    let [fx, skew, cx, _, fy, cy, ..] = k;
    // A skew that matters is a camera matrix stored column by column, or a model that is not ours.
    place.range(skew, -1.0e-3, 1.0e-3)?;
    Ok(CameraModel {
        width,
        height,
        fx: focal(place, fx)?,
        fy: focal(place, fy)?,
        cx: place.range(cx, -1.0e5, 1.0e5)? as f32,
        cy: place.range(cy, -1.0e5, 1.0e5)? as f32,
        distortion: Distortion::default(),
    })
}

fn focal(place: Place<'_>, value: f64) -> Result<f32, CalibrationError> {
    if !value.is_finite() {
        return Err(place.error(CalibrationProblem::NotFinite));
    }
    if value <= 0.0 {
        return Err(place.error(CalibrationProblem::FocalLength(value)));
    }
    place.range(value, 1.0, 1.0e5).map(|value| value as f32)
}

/// Distortion in OpenCV's order, from 0, 4, 5 or 8 coefficients; 12 and 14 if those beyond the eighth are zero.
pub(super) fn distortion(place: Place<'_>, values: &[f64]) -> Result<Distortion, CalibrationError> {
    if !matches!(values.len(), 0 | 4 | 5 | 8 | 12 | 14) {
        let found = format!("{} values", values.len());
        return Err(place.error(CalibrationProblem::Shape { wanted: "4, 5 or 8 coefficients", found }));
    }
    if values.iter().skip(8).any(|value| *value != 0.0) {
        return Err(place.error(CalibrationProblem::ExtraCoefficients { count: values.len() }));
    }
    let mut coefficients = [0.0; 8];
    for (to, from) in coefficients.iter_mut().zip(values) {
        *to = place.range(*from, -1.0e4, 1.0e4)? as f32;
    }
    Ok(Distortion(coefficients))
}

/// A rotation matrix, row by row, with the rounding of the file taken out of it.
pub(super) fn rotation(place: Place<'_>, rows: [f64; 9]) -> Result<Matrix3<f64>, CalibrationError> {
    let mut matrix = Matrix3::from_row_slice(&rows);
    if rows.iter().any(|value| !value.is_finite()) {
        return Err(place.error(CalibrationProblem::NotFinite));
    }
    let deviation = (matrix.transpose() * matrix - Matrix3::identity()).amax().max((matrix.determinant() - 1.0).abs());
    if deviation > ROTATION_TOLERANCE {
        return Err(place.error(CalibrationProblem::NotARotation { deviation }));
    }
    // Higham's iteration towards the nearest orthogonal matrix: quadratic, so from 1e-3 three steps reach the last bit.
    for _ in 0..3 {
        if let Some(inverse) = matrix.try_inverse() {
            matrix = (matrix + inverse.transpose()) * 0.5;
        }
    }
    Ok(matrix)
}

/// A raw pair with `x_right = rotation * x_left + translation`, checked.
///
/// # Errors
/// A baseline that no pair of cameras side by side has.
pub(super) fn raw(
    place: Place<'_>,
    (left, right): (CameraModel, CameraModel),
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    rectification: Option<Rectification>,
    warnings: &mut Vec<CalibrationWarning>,
) -> Result<RawPair, CalibrationError> {
    if translation.iter().any(|value| !value.is_finite()) {
        return Err(place.error(CalibrationProblem::NotFinite));
    }
    let baseline = -(rotation.transpose() * translation);
    if baseline.norm() < SHORT_BASELINE_M {
        return Err(place.error(CalibrationProblem::NoBaseline { baseline_m: baseline.x }));
    }
    if baseline.y.abs().max(baseline.z.abs()) > baseline.x.abs() {
        return Err(place.error(CalibrationProblem::NotSideBySide { baseline_m: baseline.into() }));
    }
    if baseline.x < 0.0 {
        return Err(place.error(CalibrationProblem::Exchanged { baseline_m: baseline.x }));
    }
    check_length(place, baseline.norm(), warnings)?;
    Ok(RawPair {
        left,
        right,
        rotation: rows(&rotation),
        translation_m: translation.map(|value| value as f32).into(),
        rectification,
    })
}

/// A matrix as the core keeps it.
pub(super) fn rows(matrix: &Matrix3<f64>) -> [[f32; 3]; 3] {
    std::array::from_fn(|row| std::array::from_fn(|col| matrix[(row, col)] as f32))
}

/// The rectified pair of two 3 x 4 projection matrices, row by row.
///
/// # Errors
/// Focal lengths, baseline or rows that do not fit a rectified pair. `fields` names the two matrices.
pub(super) fn rectified(
    file: &Path,
    fields: [&str; 2],
    [left, right]: [[f64; 12]; 2],
    (width, height): (u32, u32),
    warnings: &mut Vec<CalibrationWarning>,
) -> Result<RectifiedPair, CalibrationError> {
    let places = fields.map(|field| Place { file, field });
    for (place, p) in places.iter().zip([&left, &right]) {
        if p.iter().any(|value| !value.is_finite()) {
            return Err(place.error(CalibrationProblem::NotFinite));
        }
        focal(*place, p[0])?;
        focal(*place, p[5])?;
        place.range(p[1], -1.0e-3, 1.0e-3)?;
        place.range(p[2], -1.0e5, 1.0e5)?;
        place.range(p[6], -1.0e5, 1.0e5)?;
        place.range(p[10], 1.0 - 1.0e-6, 1.0 + 1.0e-6)?;
    }
    let place = places[1];
    let fx = left[0];
    if (fx - right[0]).abs() > 0.01 * fx {
        return Err(place.error(CalibrationProblem::NotRectified { left: fx, right: right[0] }));
    }
    if (left[6] - right[6]).abs() > 2.0 {
        return Err(place.error(CalibrationProblem::NotRectified { left: left[6], right: right[6] }));
    }
    let mut nearly = |field: &str, left: f64, right: f64, tolerance: f64| {
        if (left - right).abs() > tolerance {
            let (file, field) = (file.to_owned(), field.to_owned());
            warnings.push(CalibrationWarning::NearlyRectified { file, field, left, right });
        }
    };
    nearly("focal length", fx, right[0], SAME_FOCAL * fx);
    nearly("principal point's row", left[6], right[6], 0.05);
    let mut focal_px = fx;
    if (fx - left[5]).abs() > SAME_FOCAL * fx {
        let focal_px_pair = (fx, left[5]);
        let field = fields[0].to_owned();
        warnings.push(CalibrationWarning::NotSquare { file: file.to_owned(), field, focal_px: focal_px_pair });
        focal_px = 0.5 * (fx + left[5]);
    }
    // P = K [I | t]: the fourth column is the camera's place in the rectified frame, times -f.
    let baseline = Vector3::new((left[3] - right[3]) / fx, (left[7] - right[7]) / left[5], left[11] - right[11]);
    if baseline.y.abs() > baseline.x.abs() && baseline.y.abs() >= SHORT_BASELINE_M {
        return Err(place.error(CalibrationProblem::NotSideBySide { baseline_m: baseline.into() }));
    }
    if baseline.x <= -SHORT_BASELINE_M {
        return Err(place.error(CalibrationProblem::Exchanged { baseline_m: baseline.x }));
    }
    if baseline.x < SHORT_BASELINE_M {
        return Err(place.error(CalibrationProblem::NoBaseline { baseline_m: baseline.x }));
    }
    check_length(place, baseline.x, warnings)?;
    Ok(RectifiedPair {
        width,
        height,
        focal_px: focal_px as f32,
        cx: left[2] as f32,
        cy: left[6] as f32,
        baseline_m: baseline.x as f32,
        disparity_offset_px: (right[2] - left[2]) as f32,
    })
}

/// Checks that a rectification belongs to the pose: `R1 = R2 R`, and `R2 T` along the row, as long as `P2` says.
///
/// # Errors
/// Of the first of `R1` and `P2` that does not.
pub(super) fn check_rectification(
    file: &Path,
    [left, right]: [&Matrix3<f64>; 2],
    (rotation, translation): (&Matrix3<f64>, &Vector3<f64>),
    baseline_m: f64,
) -> Result<(), CalibrationError> {
    let from_pose = right * rotation;
    let pairs = left.iter().zip(from_pose.iter()).map(|(value, from_pose)| ("R1", *value, *from_pose, POSE_TOLERANCE));
    let shift = right * translation;
    let expected = [-baseline_m, 0.0, 0.0];
    let shifts = expected
        .into_iter()
        .zip(shift.iter())
        .map(|(value, from_pose)| ("P2", -value, -from_pose, 10.0 * POSE_TOLERANCE * baseline_m.abs()));
    match pairs.chain(shifts).find(|(_, value, from_pose, tolerance)| (value - from_pose).abs() > *tolerance) {
        Some((field, value, from_pose, _)) => {
            Err(Place { file, field }.error(CalibrationProblem::RectificationDiffers { value, from_pose }))
        }
        None => Ok(()),
    }
}

/// Warns of a baseline that is most likely not in metres.
///
/// # Errors
/// Where it is none in any unit.
fn check_length(
    place: Place<'_>,
    baseline_m: f64,
    warnings: &mut Vec<CalibrationWarning>,
) -> Result<(), CalibrationError> {
    place.range(baseline_m, SHORT_BASELINE_M, MAX_BASELINE)?;
    let said = warnings.iter().any(|warning| matches!(warning, CalibrationWarning::LongBaseline { .. }));
    if baseline_m > LONG_BASELINE_M && !said {
        warnings.push(CalibrationWarning::LongBaseline { file: place.file.to_owned(), baseline_m });
    }
    Ok(())
}
