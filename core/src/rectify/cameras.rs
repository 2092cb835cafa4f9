//! The rectified cameras: taken from the calibration, or chosen.

use crate::{
    error::{ConfigError, ConfigProblem},
    geometry::{CameraModel, RawPair, Rectification, RectifiedPair},
};

use super::lens::Lens;

/// Orthonormal to this: files give rotations with four digits and more.
const ROTATION_TOLERANCE: f32 = 1.0e-3;

/// Points tried along each side of the raw picture for the field of view that both cameras fill.
const SIDE_POINTS: u16 = 33;

/// A side is taken this far inside the picture, px: between the points tried it may bulge inwards.
const SIDE_INSET_PX: f32 = 0.5;

/// No lens of this model sees more than 83 degrees to each side; more comes of sides that its polynomial does not reach.
const MAX_EXTENT: f32 = 16.0;

type Matrix = [[f32; 3]; 3];

/// The way from a pixel of the rectified picture to its place in the raw one.
#[derive(Clone, Copy, Debug)]
pub(super) struct CameraMap {
    raw: CameraModel,
    lens: Lens,
    /// Turns the raw camera's frame into the rectified one.
    rotation: Matrix,
    focal_px: f32,
    cx: f32,
    cy: f32,
}

impl CameraMap {
    pub(super) const fn none() -> Self {
        let raw = CameraModel {
            width: 0,
            height: 0,
            fx: 0.0,
            fy: 0.0,
            cx: 0.0,
            cy: 0.0,
            distortion: crate::geometry::Distortion([0.0; 8]),
        };
        Self { raw, lens: Lens::ideal(), rotation: [[0.0; 3]; 3], focal_px: 0.0, cx: 0.0, cy: 0.0 }
    }

    /// Both maps of a pair.
    ///
    /// # Errors
    /// The first value that cannot be used.
    pub(super) fn pair(raw: &RawPair) -> Result<(RectifiedPair, [Self; 2]), ConfigError> {
        check(raw)?;
        let lenses = [Lens::new(&raw.left.distortion), Lens::new(&raw.right.distortion)];
        let chosen = match &raw.rectification {
            Some(given) => {
                check_rotation("calibration.rectification.left_rotation", &given.left_rotation)?;
                check_rotation("calibration.rectification.right_rotation", &given.right_rotation)?;
                *given
            }
            None => choose(raw, &lenses)?,
        };
        let Rectification { left_rotation, right_rotation, pair } = chosen;
        pair.check()?;
        let map = |model: CameraModel, lens, rotation, cx| Self {
            raw: model,
            lens,
            rotation,
            focal_px: pair.focal_px,
            cx,
            cy: pair.cy,
        };
        let [left_lens, right_lens] = lenses;
        let left = map(raw.left, left_lens, left_rotation, pair.cx);
        let right = map(raw.right, right_lens, right_rotation, pair.cx + pair.disparity_offset_px);
        Ok((pair, [left, right]))
    }

    pub(super) const fn rotation(&self) -> &Matrix {
        &self.rotation
    }

    pub(super) const fn raw_size(&self) -> (usize, usize) {
        (self.raw.width as usize, self.raw.height as usize)
    }

    /// Place in the raw picture, px, that shows what belongs at `(u, v)` of the rectified one; it may lie outside of the
    /// picture. `None` where the lens model does not hold or the ray points backwards.
    pub(super) fn source(&self, u: f32, v: f32) -> Option<[f32; 2]> {
        let ray = [(u - self.cx) / self.focal_px, (v - self.cy) / self.focal_px, 1.0];
        let [x, y, z] = turn_back(&self.rotation, ray);
        if z.is_nan() || z <= 0.0 {
            return None;
        }
        let [x, y] = self.lens.distort([x / z, y / z])?;
        let place = [self.raw.fx * x + self.raw.cx, self.raw.fy * y + self.raw.cy];
        place.iter().all(|p| p.is_finite()).then_some(place)
    }
}

/// Checks every value of a raw pair but its rectification.
fn check(pair: &RawPair) -> Result<(), ConfigError> {
    check_camera(
        &pair.left,
        [
            "calibration.left.width",
            "calibration.left.height",
            "calibration.left.fx",
            "calibration.left.fy",
            "calibration.left.cx",
            "calibration.left.cy",
            "calibration.left.distortion",
        ],
    )?;
    check_camera(
        &pair.right,
        [
            "calibration.right.width",
            "calibration.right.height",
            "calibration.right.fx",
            "calibration.right.fy",
            "calibration.right.cx",
            "calibration.right.cy",
            "calibration.right.distortion",
        ],
    )?;
    check_rotation("calibration.rotation", &pair.rotation)?;
    for component in pair.translation_m {
        ConfigError::check("calibration.translation_m", component, -100.0, 100.0)?;
    }
    let length = libm::sqrtf(dot(pair.translation_m, pair.translation_m));
    ConfigError::check("calibration.translation_m", length, 1.0e-3, 100.0)
}

fn check_camera(camera: &CameraModel, names: [&'static str; 7]) -> Result<(), ConfigError> {
    let [width, height, fx, fy, cx, cy, distortion] = names;
    ConfigError::check(width, camera.width as f32, 16.0, 8192.0)?;
    ConfigError::check(height, camera.height as f32, 16.0, 8192.0)?;
    ConfigError::check(fx, camera.fx, 1.0, 1.0e5)?;
    ConfigError::check(fy, camera.fy, 1.0, 1.0e5)?;
    ConfigError::check(cx, camera.cx, -1.0e5, 1.0e5)?;
    ConfigError::check(cy, camera.cy, -1.0e5, 1.0e5)?;
    camera.distortion.0.iter().try_for_each(|k| ConfigError::check(distortion, *k, -1.0e6, 1.0e6))
}

fn check_rotation(name: &'static str, m: &Matrix) -> Result<(), ConfigError> {
    if m.iter().flatten().any(|e| !e.is_finite()) {
        return Err(ConfigError::new(name, ConfigProblem::NotFinite));
    }
    let [x, y, z] = *m;
    let lengths = [x, y, z].iter().all(|row| (libm::sqrtf(dot(*row, *row)) - 1.0).abs() <= ROTATION_TOLERANCE);
    let angles = [dot(x, y), dot(y, z), dot(z, x)].iter().all(|product| product.abs() <= ROTATION_TOLERANCE);
    // A mirror image is orthonormal too.
    let orthonormal = lengths && angles && dot(cross(x, y), z) > 0.0;
    if orthonormal { Ok(()) } else { Err(ConfigError::new(name, ConfigProblem::NotARotation)) }
}

/// Chooses the rectified cameras.
///
/// The rotation between the cameras is split in half, so that both pictures are bent alike, and both are then turned the
/// shortest way that lays the rows along the baseline (Bouguet's method, as OpenCV's `stereoRectify`). Both get one
/// principal point, so that the disparity of infinity is 0, and the size of the left picture. Focal length and principal
/// point are those with the largest field of view of which both cameras fill every pixel: a robot loses the least, and no
/// window looks at a black border.
fn choose(raw: &RawPair, lenses: &[Lens; 2]) -> Result<Rectification, ConfigError> {
    let half = half_rotation(&raw.rotation);
    // Origin of the left camera, seen from the right one, in the frame half way between both.
    let to_left = turn_back(&half, raw.translation_m);
    let baseline_m = libm::sqrtf(dot(to_left, to_left));
    if to_left[0] > 0.5 * baseline_m {
        return Err(ConfigError::new("calibration.translation_m", ConfigProblem::Exchanged));
    }
    // Cameras one above the other, or one behind the other, have no rows in common.
    let aside_m = -to_left[0];
    ConfigError::check("calibration.translation_m along the row", aside_m, 0.5 * baseline_m, 100.0)?;
    let align = shortest_rotation_to_x(to_left.map(|t| -t / baseline_m));
    let left_rotation = product(&align, &half);
    let right_rotation = product(&align, &transposed(&half));

    let mut view = View { low: [f32::MIN; 2], high: [f32::MAX; 2] };
    view.cut(&raw.left, &lenses[0], &left_rotation);
    view.cut(&raw.right, &lenses[1], &right_rotation);
    let last = [raw.left.width as f32 - 1.0, raw.left.height as f32 - 1.0];
    let extent = [view.high[0] - view.low[0], view.high[1] - view.low[1]];
    let (focal_px, middle) = if extent.iter().all(|e| (0.01..MAX_EXTENT).contains(e)) {
        let focal_px = (last[0] / extent[0]).max(last[1] / extent[1]);
        (focal_px, [0, 1].map(|i| 0.5 * (view.low[i] + view.high[i])))
    } else {
        // The cameras have no rectangle in common. The raw focal length at least shows how little that is.
        (0.5 * (raw.left.fx + raw.right.fx), [0.0, 0.0])
    };
    let [cx, cy] = [0, 1].map(|i| 0.5 * last[i] - focal_px * middle[i]);
    let (width, height) = (raw.left.width, raw.left.height);
    let pair = RectifiedPair { width, height, focal_px, cx, cy, baseline_m, disparity_offset_px: 0.0 };
    Ok(Rectification { left_rotation, right_rotation, pair })
}

/// The rectangle of directions that both cameras see, in units of the focal length.
struct View {
    low: [f32; 2],
    high: [f32; 2],
}

impl View {
    /// Moves each side inwards to where the raw picture's side lies.
    fn cut(&mut self, camera: &CameraModel, lens: &Lens, rotation: &Matrix) {
        let low = SIDE_INSET_PX;
        let high = [camera.width as f32 - 1.0 - SIDE_INSET_PX, camera.height as f32 - 1.0 - SIDE_INSET_PX];
        let direction = |px: [f32; 2]| {
            let point = [(px[0] - camera.cx) / camera.fx, (px[1] - camera.cy) / camera.fy];
            let [x, y] = lens.undistort(point)?;
            let [x, y, z] = rotation.map(|row| dot(row, [x, y, 1.0]));
            (z > 0.0).then(|| [x / z, y / z])
        };
        for axis in 0..2 {
            // The mask says to the compiler that it is one of two.
            let axis = axis & 1;
            let [here, beside] = if axis == 0 { high } else { [high[1], high[0]] };
            let along = |step: u16, across: f32| {
                let t = f32::from(step) / f32::from(SIDE_POINTS - 1);
                let place = low + t * (beside - low);
                direction(if axis == 0 { [across, place] } else { [place, across] })
            };
            for step in 0..SIDE_POINTS {
                if let Some(found) = along(step, low) {
                    self.low[axis] = self.low[axis].max(found[axis]);
                }
                if let Some(found) = along(step, here) {
                    self.high[axis] = self.high[axis].min(found[axis]);
                }
            }
        }
    }
}

/// The rotation about the same axis by half of the angle: the quaternion half way to that of no rotation.
fn half_rotation(m: &Matrix) -> Matrix {
    let [w, x, y, z] = quaternion(m);
    from_quaternion([w + 1.0, x, y, z])
}

/// The unit quaternion with `w >= 0` (Shepperd, *Quaternion from rotation matrix*, 1978).
fn quaternion(m: &Matrix) -> [f32; 4] {
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = *m;
    let trace = xx + yy + zz;
    let [w, x, y, z] = if trace >= xx.max(yy).max(zz) {
        [1.0 + trace, zy - yz, xz - zx, yx - xy]
    } else if xx >= yy.max(zz) {
        [zy - yz, 1.0 + xx - yy - zz, xy + yx, xz + zx]
    } else if yy >= zz {
        [xz - zx, xy + yx, 1.0 + yy - xx - zz, yz + zy]
    } else {
        [yx - xy, xz + zx, yz + zy, 1.0 + zz - xx - yy]
    };
    let length = libm::sqrtf(w * w + x * x + y * y + z * z);
    let scale = if w < 0.0 { -1.0 / length } else { 1.0 / length };
    [w, x, y, z].map(|c| c * scale)
}

/// The rotation of a quaternion of any length but zero.
fn from_quaternion([w, x, y, z]: [f32; 4]) -> Matrix {
    let s = 2.0 / (w * w + x * x + y * y + z * z);
    [
        [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
        [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)],
        [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)],
    ]
}

/// The shortest rotation that takes a unit vector with positive x to the x axis.
fn shortest_rotation_to_x([x, y, z]: [f32; 3]) -> Matrix {
    // The quaternion of twice the half-way turn is (1 + a.b, a x b).
    from_quaternion([1.0 + x, 0.0, z, -y])
}

fn transposed(m: &Matrix) -> Matrix {
    let [a, b, c] = *m;
    [[a[0], b[0], c[0]], [a[1], b[1], c[1]], [a[2], b[2], c[2]]]
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let columns = transposed(b);
    a.map(|row| columns.map(|column| dot(row, column)))
}

/// The inverse rotation of a vector.
fn turn_back(rotation: &Matrix, v: [f32; 3]) -> [f32; 3] {
    transposed(rotation).map(|row| dot(row, v))
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
#[path = "cameras_tests.rs"]
mod tests;
