//! From pixels to directions in the vehicle frame.

use super::{RectifiedPair, VehicleFrame};

/// The ray of each pixel of the left rectified picture, in the vehicle frame: a point at distance `z` along the optical axis
/// lies at `origin + z * direction(u, v)`. Directions are linear in the pixel, so a row of them is a sum.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rays {
    /// Position of the left camera in the vehicle frame, metres.
    pub origin_m: [f32; 3],
    /// Change of the direction from one pixel of a row to the next.
    pub along_row: [f32; 3],
    /// Change of the direction from one pixel of a column to the next.
    pub along_column: [f32; 3],
    /// Direction of pixel (0, 0).
    corner: [f32; 3],
}

impl Rays {
    /// Rays that all point nowhere, for what is not configured yet.
    pub const UNSET: Self = Self { origin_m: [0.0; 3], along_row: [0.0; 3], along_column: [0.0; 3], corner: [0.0; 3] };

    /// The rays of a camera on a vehicle. Source: the paper, Table 1.
    pub fn new(pair: &RectifiedPair, frame: &VehicleFrame) -> Self {
        let per_pixel = 1.0 / pair.focal_px;
        Self {
            origin_m: frame.origin_m(),
            along_row: frame.direction([per_pixel, 0.0, 0.0]),
            along_column: frame.direction([0.0, per_pixel, 0.0]),
            corner: frame.direction([-pair.cx * per_pixel, -pair.cy * per_pixel, 1.0]),
        }
    }

    /// Direction of the ray through pixel `(u, v)`, of length 1 along the optical axis.
    pub fn direction(&self, u: f32, v: f32) -> [f32; 3] {
        core::array::from_fn(|i| self.corner[i] + u * self.along_row[i] + v * self.along_column[i])
    }

    /// The point at distance `z_m` along the optical axis, seen at pixel `(u, v)`; vehicle frame, metres.
    pub fn point_m(&self, u: f32, v: f32, z_m: f32) -> [f32; 3] {
        let direction = self.direction(u, v);
        core::array::from_fn(|i| self.origin_m[i] + z_m * direction[i])
    }
}
