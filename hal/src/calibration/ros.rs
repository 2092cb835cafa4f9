//! ROS `camera_info` files as `camera_calibration_parsers` reads them, one for each camera.

use fencepost_core::geometry::{CameraModel, RawPair, Rectification};
use nalgebra::{Matrix3, Vector3};

use super::document::Document;
use super::error::{CalibrationError, CalibrationProblem, CalibrationWarning};
use super::pair::{self, Place};

/// Whether the document is a `camera_info`: OpenCV's own single-camera files have no such distortion model.
pub(super) fn is_ros(document: &Document<'_>) -> bool {
    document.find(&["projection_matrix", "distortion_model"]).is_some() && document.find(&["T_BS"]).is_none()
}

/// The pair of two documents.
pub(super) fn parse(
    documents: [&Document<'_>; 2],
    pictures: Option<(u32, u32)>,
    warnings: &mut Vec<CalibrationWarning>,
) -> Result<RawPair, CalibrationError> {
    let [left, right] = documents;
    let (left_camera, left_rotation, left_projection) = camera(left, pictures)?;
    let (right_camera, right_rotation, right_projection) = camera(right, pictures)?;
    let size = pair::same_size(Place { file: right.file, field: "image_width" }, &left_camera, &right_camera)?;
    let projections = [left_projection, right_projection];
    let field = "projection_matrix";
    let rectified = pair::rectified(right.file, [field, field], projections, size, warnings)?;
    // Both rotations lead into the same rectified frame, where the right camera lies at (baseline, 0, 0).
    let rotation = right_rotation.transpose() * left_rotation;
    let baseline = (left_projection[3] - right_projection[3]) / left_projection[0];
    let translation = right_rotation.transpose() * Vector3::new(-baseline, 0.0, 0.0);
    let rectification = Rectification {
        left_rotation: pair::rows(&left_rotation),
        right_rotation: pair::rows(&right_rotation),
        pair: rectified,
    };
    let place = Place { file: right.file, field };
    // `rectified` has said already what there is to say of the baseline's length.
    pair::raw(place, (left_camera, right_camera), rotation, translation, Some(rectification), &mut Vec::new())
}

type Parts = (CameraModel, Matrix3<f64>, [f64; 12]);

fn camera(document: &Document<'_>, pictures: Option<(u32, u32)>) -> Result<Parts, CalibrationError> {
    let file = document.file;
    let (field, width) = document.need(&["image_width"])?;
    let (height_field, height) = document.need(&["image_height"])?;
    let size = (document.scalar(field, width)?, document.scalar(height_field, height)?);
    let place = Place { file, field };
    let size = pair::size_or_pictures(place, Some(pair::size(place, size.0, size.1)?), pictures)?;
    let (field, node) = document.need(&["camera_matrix"])?;
    let mut camera = pair::camera(Place { file, field }, document.array(field, node, (3, 3), "3x3 = 9 values")?, size)?;
    let (field, node) = document.need(&["distortion_model"])?;
    let model = node.text().unwrap_or_default();
    if !matches!(model, "plumb_bob" | "rational_polynomial") {
        return Err(document.error(field, CalibrationProblem::LensModel(model.to_owned())));
    }
    let (field, node) = document.need(&["distortion_coefficients"])?;
    camera.distortion = pair::distortion(Place { file, field }, &document.numbers(field, node)?)?;
    let (field, node) = document.need(&["rectification_matrix"])?;
    let rotation = pair::rotation(Place { file, field }, document.array(field, node, (3, 3), "3x3 = 9 values")?)?;
    let (field, node) = document.need(&["projection_matrix"])?;
    Ok((camera, rotation, document.array(field, node, (3, 4), "3x4 = 12 values")?))
}
