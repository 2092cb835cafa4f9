//! Planes in the disparity picture.
//!
//! A plane of the world is a plane of column, row and disparity: with `d = f b / z` and a point at `z (x_r / f, y_r / f, 1)`, the
//! equation `n . p = h` becomes `d = (b / h) (n_x x_r + n_y y_r + n_z f)`. So planes can be fitted where the errors
//! of matching are the same everywhere, and by sums of small integers.

use crate::geometry::{RectifiedPair, VehicleFrame};

/// Sums over pixels: columns `u` and rows `v` from some place, disparities `d` in 1/16 px.
///
/// Exact for up to 4 x 4096 pixels within 2048 columns and rows of the place: no sum exceeds 2^45, and no product of the fit 2^60.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PlaneSums {
    pub(super) n: i64,
    pub(super) u: i64,
    pub(super) v: i64,
    pub(super) d: i64,
    pub(super) uu: i64,
    pub(super) uv: i64,
    pub(super) vv: i64,
    pub(super) ud: i64,
    pub(super) vd: i64,
    pub(super) dd: i64,
}

/// `d = at + along_u u + along_v v`, disparities in 1/16 px.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct DisparityPlane {
    /// At the place that columns and rows are counted from.
    pub(super) at: f32,
    /// From one column to the next.
    pub(super) along_u: f32,
    /// From one row to the next.
    pub(super) along_v: f32,
}

impl PlaneSums {
    /// Adds a pixel.
    pub(super) fn add(&mut self, u: i32, v: i32, steps: u16) {
        let (u, v, d) = (i64::from(u), i64::from(v), i64::from(steps));
        // Pictures of 2^16 x 2^16 pixels, and disparities of 2^15 steps, stay below 2^63.
        let add = |sum: &mut i64, more: i64| *sum = sum.wrapping_add(more);
        let product = i64::wrapping_mul;
        add(&mut self.n, 1);
        add(&mut self.u, u);
        add(&mut self.v, v);
        add(&mut self.d, d);
        add(&mut self.uu, product(u, u));
        add(&mut self.uv, product(u, v));
        add(&mut self.vv, product(v, v));
        add(&mut self.ud, product(u, d));
        add(&mut self.vd, product(v, d));
        add(&mut self.dd, product(d, d));
    }

    /// The plane with the least squares of the differences of disparity, and their mean; `None` where the pixels lie on a line.
    pub(super) fn fit(&self) -> Option<(DisparityPlane, f32)> {
        let Self { n, u, v, d, uu, uv, vv, ud, vd, dd } = *self;
        let central = |sum: i64, a: i64, b: i64| n.wrapping_mul(sum).wrapping_sub(a.wrapping_mul(b)) as f32;
        let (cuu, cuv, cvv) = (central(uu, u, u), central(uv, u, v), central(vv, v, v));
        let (cud, cvd, cdd) = (central(ud, u, d), central(vd, v, d), central(dd, d, d));
        let determinant = cuu * cvv - cuv * cuv;
        // Pixels are whole numbers: those that span a triangle leave far more than the errors of rounding.
        if n < 3 || determinant <= 1.0e-4 * cuu * cvv || determinant <= 0.0 {
            return None;
        }
        let along_u = (cud * cvv - cvd * cuv) / determinant;
        let along_v = (cvd * cuu - cud * cuv) / determinant;
        let per_pixel = 1.0 / n as f32;
        let at = (d as f32 - along_u * u as f32 - along_v * v as f32) * per_pixel;
        let squares = ((cdd - along_u * cud - along_v * cvd) * per_pixel * per_pixel).max(0.0);
        Some((DisparityPlane { at, along_u, along_v }, squares))
    }
}

impl DisparityPlane {
    /// The plane that the ground is, seen from a camera in `frame` at `camera_height_m` above it, with the `normal` of the ground
    /// upward in the frame of the pair; columns and rows from `(u0, v0)`.
    pub(super) fn of_ground(
        normal: [f32; 3],
        camera_height_m: f32,
        pair: &RectifiedPair,
        frame: &VehicleFrame,
        (u0, v0): (f32, f32),
    ) -> Self {
        // The camera's axes are x right, y down, z ahead: the normal downward points from the camera to the ground.
        let [x, y, z] = frame.to_camera(normal).map(|n| -n);
        let scale = 16.0 * pair.baseline_m / camera_height_m.max(1.0e-3);
        let at = x * (u0 - pair.cx) + y * (v0 - pair.cy) + z * pair.focal_px;
        Self { at: scale * at - 16.0 * pair.disparity_offset_px, along_u: scale * x, along_v: scale * y }
    }

    /// The plane in the world, with columns and rows from `(u0, v0)`: its normal in the frame of the pair, pointing upward, and
    /// how far below the camera it lies along it, metres. `None` where all of it is infinitely far away.
    pub(super) fn in_world(
        &self,
        pair: &RectifiedPair,
        frame: &VehicleFrame,
        (u0, v0): (f32, f32),
    ) -> Option<([f32; 3], f32)> {
        let n = self.normal(pair, (u0, v0));
        let length = libm::sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let normal = frame.direction(n.map(|n| n / length));
        let distance_m = 16.0 * pair.focal_px * pair.baseline_m / length;
        // From the camera to the plane is downward for a plane below it.
        Some(if normal[2] > 0.0 { (normal, -distance_m) } else { (normal.map(|n| -n), distance_m) })
    }

    /// A vector across the plane in the world, in the camera's frame and of any length, with columns and rows from `(u0, v0)`.
    pub(super) fn normal(&self, pair: &RectifiedPair, (u0, v0): (f32, f32)) -> [f32; 3] {
        let ahead = self.at + self.along_u * (pair.cx - u0) + self.along_v * (pair.cy - v0);
        [self.along_u * pair.focal_px, self.along_v * pair.focal_px, ahead + 16.0 * pair.disparity_offset_px]
    }

    /// The disparity at `(u, v)`, 1/16 px.
    pub(super) fn steps_at(&self, u: f32, v: f32) -> f32 {
        self.at + self.along_u * u + self.along_v * v
    }
}

#[cfg(test)]
#[path = "tests/disparity_plane.rs"]
mod tests;
