//! OpenCV's FileStorage, YAML or XML, with the names that users of `stereoCalibrate` give.
//!
//! One file with both cameras, or `intrinsics.yml` and `extrinsics.yml` as OpenCV's `stereo_calib` example saves them.

use std::path::Path;

use fencepost_core::geometry::{CameraModel, RawPair, Rectification};
use nalgebra::{Matrix3, Vector3};

use super::document::{Document, Node};
use super::error::{CalibrationError, CalibrationProblem, CalibrationWarning};
use super::pair::{self, Place};

const MATRIX: [&[&str]; 2] = [
    &[
        "M1",
        "K1",
        "cameraMatrix1",
        "camera_matrix_1",
        "cameraMatrixL",
        "left_camera_matrix",
        "camera_matrix_left",
        "mtxL",
        "K_left",
        "KL",
        "K_l",
    ],
    &[
        "M2",
        "K2",
        "cameraMatrix2",
        "camera_matrix_2",
        "cameraMatrixR",
        "right_camera_matrix",
        "camera_matrix_right",
        "mtxR",
        "K_right",
        "KR",
        "K_r",
    ],
];
const DISTORTION: [&[&str]; 2] = [
    &[
        "D1",
        "distCoeffs1",
        "dist_coeffs_1",
        "distCoeffsL",
        "left_distortion_coefficients",
        "left_dist_coeffs",
        "dist_coeffs_left",
        "distortion_coefficients_left",
        "distL",
        "D_left",
        "DL",
        "D_l",
    ],
    &[
        "D2",
        "distCoeffs2",
        "dist_coeffs_2",
        "distCoeffsR",
        "right_distortion_coefficients",
        "right_dist_coeffs",
        "dist_coeffs_right",
        "distortion_coefficients_right",
        "distR",
        "D_right",
        "DR",
        "D_r",
    ],
];
const ROTATION: &[&str] = &["R", "rotation_matrix", "rotation", "Rotation", "R_stereo"];
const TRANSLATION: &[&str] = &["T", "translation_vector", "translation", "Translation", "T_stereo", "t"];
const SIZE: &[&str] = &["image_size", "imageSize", "img_size", "size", "resolution"];
const WIDTH: &[&str] = &["image_width", "imageWidth", "width"];
const HEIGHT: &[&str] = &["image_height", "imageHeight", "height"];

/// Whether the document has any of the matrices that are looked for.
pub(super) fn is_opencv(document: &Document<'_>) -> bool {
    MATRIX.iter().chain(&[ROTATION, TRANSLATION]).any(|keys| document.find(keys).is_some())
}

/// The pair of one document, or of one with the cameras and one with the pose, in either order.
pub(super) fn parse(
    documents: &[Document<'_>],
    pictures: Option<(u32, u32)>,
    warnings: &mut Vec<CalibrationWarning>,
) -> Result<RawPair, CalibrationError> {
    let source = Source { documents };
    let in_file = source.size()?;
    let place = Place { file: in_file.map_or_else(|| source.first(), |(file, _)| file), field: "image_size" };
    let size = pair::size_or_pictures(place, in_file.map(|(_, size)| size), pictures)?;
    let [left, right] = [source.camera(0, size), source.camera(1, size)];
    let (left, right) = (left?, right?);
    let (document, field, node) = source.need(ROTATION)?;
    let rotation = matrix(document, field, node)?;
    let (document, field, node) = source.need(TRANSLATION)?;
    let translation: [f64; 3] = document.array(field, node, (3, 1), "3x1 = 3 values")?;
    let place = Place { file: document.file, field };
    // The pose before the rectification: of the two it is the one that a user can mend.
    let translation = Vector3::from(translation);
    let pair = pair::raw(place, (left, right), rotation, translation, None, warnings)?;
    let rectification = source.rectification(size, (&rotation, &translation), warnings)?;
    Ok(RawPair { rectification, ..pair })
}

/// A size and the file that says it.
type SizeInFile<'d> = (&'d Path, (u32, u32));

/// Several documents searched as one.
struct Source<'a, 'd> {
    documents: &'a [Document<'d>],
}

impl<'a, 'd> Source<'a, 'd> {
    fn first(&self) -> &'d Path {
        self.documents.first().map_or(Path::new(""), |document| document.file)
    }

    fn find<'k>(&self, keys: &[&'k str]) -> Option<(&'a Document<'d>, &'k str, &'a Node)> {
        self.documents.iter().find_map(|document| document.find(keys).map(|(key, node)| (document, key, node)))
    }

    fn need<'k>(&self, keys: &[&'k str]) -> Result<(&'a Document<'d>, &'k str, &'a Node), CalibrationError> {
        let first = keys.first().copied().unwrap_or_default();
        self.find(keys).ok_or_else(|| {
            // In two files a pose is missed in the one that has no cameras.
            let pose = keys == ROTATION || keys == TRANSLATION;
            let file = self.documents.iter().find(|document| document.find(MATRIX[0]).is_none() == pose);
            CalibrationError::new(
                file.map_or_else(|| self.first(), |document| document.file),
                first,
                CalibrationProblem::Missing,
            )
        })
    }

    fn size(&self) -> Result<Option<SizeInFile<'d>>, CalibrationError> {
        if let Some((document, field, node)) = self.find(SIZE) {
            let [width, height] = match (node.get("width"), node.get("height")) {
                (Some(width), Some(height)) => [document.scalar(field, width)?, document.scalar(field, height)?],
                _ => document.array(field, node, (1, 2), "width and height")?,
            };
            let size = pair::size(Place { file: document.file, field }, width, height)?;
            return Ok(Some((document.file, size)));
        }
        let (Some((document, field, width)), Some((_, _, height))) = (self.find(WIDTH), self.find(HEIGHT)) else {
            return Ok(None);
        };
        let (width, height) = (document.scalar(field, width)?, document.scalar(field, height)?);
        Ok(Some((document.file, pair::size(Place { file: document.file, field }, width, height)?)))
    }

    fn camera(&self, side: usize, size: (u32, u32)) -> Result<CameraModel, CalibrationError> {
        let (document, field, node) = self.need(MATRIX[side])?;
        let k = document.array(field, node, (3, 3), "3x3 = 9 values")?;
        let mut camera = pair::camera(Place { file: document.file, field }, k, size)?;
        let (document, field, node) = self.need(DISTORTION[side])?;
        let values = document.numbers(field, node)?;
        camera.distortion = pair::distortion(Place { file: document.file, field }, &values)?;
        Ok(camera)
    }

    /// `R1`, `R2`, `P1` and `P2`, if all of them are there.
    fn rectification(
        &self,
        size: (u32, u32),
        pose: (&Matrix3<f64>, &Vector3<f64>),
        warnings: &mut Vec<CalibrationWarning>,
    ) -> Result<Option<Rectification>, CalibrationError> {
        const KEYS: [&str; 4] = ["R1", "R2", "P1", "P2"];
        let found = KEYS.map(|key| self.find(&[key]));
        let [Some(r1), Some(r2), Some(p1), Some(p2)] = found else {
            let missing = KEYS.iter().zip(&found).find(|(_, found)| found.is_none());
            if let (Some((missing, _)), Some((document, ..))) = (missing, found.iter().flatten().next()) {
                let (file, missing) = (document.file.to_owned(), (*missing).to_owned());
                warnings.push(CalibrationWarning::RectificationIncomplete { file, missing });
            }
            return Ok(None);
        };
        let [left, right] = [r1, r2].map(|(document, field, node)| matrix(document, field, node));
        let [p1, p2] = [p1, p2].map(|(document, field, node)| document.array(field, node, (3, 4), "3x4 = 12 values"));
        let (left, right, p1, p2) = (left?, right?, p1?, p2?);
        let pair = pair::rectified(r1.0.file, ["P1", "P2"], [p1, p2], size, warnings)?;
        pair::check_rectification(r1.0.file, [&left, &right], pose, (p1[3] - p2[3]) / p1[0])?;
        Ok(Some(Rectification { left_rotation: pair::rows(&left), right_rotation: pair::rows(&right), pair }))
    }
}

/// A rotation: a matrix, or the three numbers of a rotation vector as `Rodrigues` makes them.
fn matrix(document: &Document<'_>, field: &str, node: &Node) -> Result<Matrix3<f64>, CalibrationError> {
    let place = Place { file: document.file, field };
    let values = document.numbers(field, node)?;
    if let Ok(vector) = <[f64; 3]>::try_from(values.as_slice()) {
        return Ok(*nalgebra::Rotation3::new(Vector3::from(vector)).matrix());
    }
    pair::rotation(place, document.array(field, node, (3, 3), "3x3 = 9 values")?)
}
