//! KITTI's `calib.txt`: a line `NAME: values` for each matrix.

use std::path::Path;

use super::document::number;
use super::error::{CalibrationError, CalibrationProblem, CalibrationWarning};
use super::pair;
use fencepost_core::geometry::RectifiedPair;

/// The pair of `P0` and `P1`; other lines are left alone.
pub(super) fn parse(
    file: &Path,
    text: &str,
    pictures: Option<(u32, u32)>,
    warnings: &mut Vec<CalibrationWarning>,
) -> Result<RectifiedPair, CalibrationError> {
    let fields = ["P0", "P1"];
    let [left, right] = fields.map(|field| matrix(file, text, field));
    let place = pair::Place { file, field: "picture size" };
    let size = pair::size_or_pictures(place, None, pictures);
    pair::rectified(file, fields, [left?, right?], size?, warnings)
}

/// The 3 x 4 matrix of the line `FIELD: values`, row by row.
pub(super) fn matrix(file: &Path, text: &str, field: &str) -> Result<[f64; 12], CalibrationError> {
    let error = |problem| CalibrationError::new(file, field, problem);
    let line = text.lines().find_map(|line| line.trim_start().strip_prefix(field)?.trim_start().strip_prefix(':'));
    let words = line.ok_or_else(|| error(CalibrationProblem::Missing))?.split_whitespace();
    let values = words.map(number).collect::<Result<Vec<_>, _>>().map_err(error)?;
    let found = format!("{} values", values.len());
    values.try_into().map_err(|_| error(CalibrationProblem::Shape { wanted: "3x4 = 12 values", found }))
}
