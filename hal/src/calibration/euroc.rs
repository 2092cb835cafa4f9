//! EuRoC's `sensor.yaml`, one for each camera.

use fencepost_core::geometry::{CameraModel, RawPair};
use nalgebra::{Matrix3, Vector3};

use super::document::Document;
use super::error::{CalibrationError, CalibrationProblem, CalibrationWarning};
use super::pair::{self, Place};

/// The pair of two documents.
pub(super) fn parse(
    documents: [&Document<'_>; 2],
    pictures: Option<(u32, u32)>,
    warnings: &mut Vec<CalibrationWarning>,
) -> Result<RawPair, CalibrationError> {
    let left = camera(documents[0], pictures)?;
    let right = camera(documents[1], pictures)?;
    pair::same_size(Place { file: documents[1].file, field: "resolution" }, &left, &right)?;
    let (left_rotation, left_origin) = pose(documents[0])?;
    let (right_rotation, right_origin) = pose(documents[1])?;
    // T_BS turns camera coordinates into body coordinates; right from left goes through the body.
    let rotation = right_rotation.transpose() * left_rotation;
    let translation = right_rotation.transpose() * (left_origin - right_origin);
    let place = Place { file: documents[1].file, field: "T_BS" };
    pair::raw(place, (left, right), rotation, translation, None, warnings)
}

fn camera(document: &Document<'_>, pictures: Option<(u32, u32)>) -> Result<CameraModel, CalibrationError> {
    let file = document.file;
    if let Some((field, node)) = document.find(&["camera_model"])
        && node.text() != Some("pinhole")
    {
        let model = node.text().unwrap_or_default().to_owned();
        return Err(document.error(field, CalibrationProblem::LensModel(model)));
    }
    let size = match document.find(&["resolution"]) {
        Some((field, node)) => {
            let [width, height] = document.array(field, node, (1, 2), "width and height")?;
            Some(pair::size(Place { file, field }, width, height)?)
        }
        None => None,
    };
    let size = pair::size_or_pictures(Place { file, field: "resolution" }, size, pictures)?;
    let (field, node) = document.need(&["intrinsics"])?;
    let [fx, fy, cx, cy] = document.array(field, node, (1, 4), "4 values: fu, fv, cu, cv")?;
    let mut camera = pair::camera(Place { file, field }, [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], size)?;
    let (field, node) = document.need(&["distortion_model"])?;
    let model = node.text().unwrap_or_default();
    if !matches!(model, "radial-tangential" | "radtan" | "none" | "plumb_bob" | "rational_polynomial") {
        return Err(document.error(field, CalibrationProblem::LensModel(model.to_owned())));
    }
    let (field, node) = document.need(&["distortion_coefficients"])?;
    camera.distortion = pair::distortion(Place { file, field }, &document.numbers(field, node)?)?;
    Ok(camera)
}

fn pose(document: &Document<'_>) -> Result<(Matrix3<f64>, Vector3<f64>), CalibrationError> {
    let (field, node) = document.need(&["T_BS"])?;
    let t: [f64; 16] = document.array(field, node, (4, 4), "4x4 = 16 values")?;
    let place = Place { file: document.file, field };
    let rotation = pair::rotation(place, [t[0], t[1], t[2], t[4], t[5], t[6], t[8], t[9], t[10]])?;
    let last = [t[12], t[13], t[14], t[15]];
    if last != [0.0, 0.0, 0.0, 1.0] {
        let found = format!("{last:?} as the last row");
        return Err(place.error(CalibrationProblem::Shape { wanted: "0, 0, 0, 1 as the last row", found }));
    }
    Ok((rotation, Vector3::new(t[3], t[7], t[11])))
}
