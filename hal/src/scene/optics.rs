//! Which way each pixel looks.

use fencepost_core::geometry::{CameraModel, Distortion, StereoCalibration, VehicleFrame};

use super::ground::Ground;
use super::options::SceneOptions;
use super::vector::{V3, v3};

/// Where the vehicle stands: a frame with x forward, y left, z up, on the ground below the left camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose {
    pub(crate) origin: V3,
    pub(crate) forward: V3,
    pub(crate) left: V3,
    pub(crate) up: V3,
}

impl Pose {
    pub(crate) fn new(ground: &Ground, x: f32) -> Self {
        let y = ground.trail.y(x);
        let (s, c) = libm::sincosf(ground.trail.bearing(x));
        // The vehicle tilts with the hill, not with every bump.
        let [rise, rise_aside] = ground.base_rise(x, y);
        let forward = v3(c, s, rise * c + rise_aside * s).unit();
        let level = v3(-s, c, 0.0);
        let left = if rise == 0.0 && rise_aside == 0.0 {
            level
        } else {
            let leaning = level + V3::UP * (rise_aside * c - rise * s);
            (leaning - forward * leaning.dot(forward)).unit()
        };
        Self { origin: v3(x, y, ground.height(x, y)), forward, left, up: forward.cross(left) }
    }

    pub(crate) fn to_world(self, v: V3) -> V3 {
        self.forward * v.x + self.left * v.y + self.up * v.z
    }

    /// A point of the world in the vehicle frame.
    pub(crate) fn to_vehicle(self, p: V3) -> V3 {
        let q = p - self.origin;
        v3(q.dot(self.forward), q.dot(self.left), q.dot(self.up))
    }
}

/// A camera in the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Eye {
    pub(crate) origin: V3,
    /// The camera's x, y and z axes.
    axes: [V3; 3],
    model: CameraModel,
    distorted: bool,
}

impl Eye {
    /// The left and the right camera on a vehicle at `pose`, as the calibration describes them.
    pub(crate) fn pair(options: &SceneOptions, frame: &VehicleFrame, pose: Pose) -> [Self; 2] {
        let (ideal, _) = Self::ideal_pair(options, frame, pose);
        match options.calibration() {
            StereoCalibration::Rectified(_) => [ideal, ideal.shifted(options.baseline_m)],
            StereoCalibration::Raw(raw) => {
                let mut right = ideal.shifted(options.baseline_m);
                // A row of the rotation is an axis of the right camera, seen in the left one's frame.
                right.axes = raw.rotation.map(|r| ideal.axes[0] * r[0] + ideal.axes[1] * r[1] + ideal.axes[2] * r[2]);
                [ideal.with(raw.left), right.with(raw.right)]
            }
        }
    }

    /// The pair without distortion and misalignment.
    pub(crate) fn ideal_pair(options: &SceneOptions, frame: &VehicleFrame, pose: Pose) -> (Self, Self) {
        let ideal = options.ideal_pair();
        let axis = |c: [f32; 3]| pose.to_world(V3::from(frame.direction(c)));
        let left = Self {
            origin: pose.origin + pose.up * frame.camera_height_m(),
            axes: [axis([1.0, 0.0, 0.0]), axis([0.0, 1.0, 0.0]), axis([0.0, 0.0, 1.0])],
            model: CameraModel {
                width: ideal.width,
                height: ideal.height,
                fx: ideal.focal_px,
                fy: ideal.focal_px,
                cx: ideal.cx,
                cy: ideal.cy,
                distortion: Distortion::default(),
            },
            distorted: false,
        };
        (left, left.shifted(options.baseline_m))
    }

    fn shifted(mut self, right_m: f32) -> Self {
        self.origin += self.axes[0] * right_m;
        self
    }

    fn with(mut self, model: CameraModel) -> Self {
        self.model = model;
        self.distorted = model.distortion != Distortion::default();
        self
    }

    pub(crate) const fn focal_px(&self) -> f32 {
        self.model.fx
    }

    /// Direction in which the picture's point `(px, py)` looks, 1 long along the optical axis: lengths along it are depths.
    pub(crate) fn look(&self, px: f32, py: f32) -> V3 {
        let x = (px - self.model.cx) / self.model.fx;
        let y = (py - self.model.cy) / self.model.fy;
        let (x, y) = if self.distorted { undistort(&self.model.distortion, x, y) } else { (x, y) };
        self.axes[0] * x + self.axes[1] * y + self.axes[2]
    }

    /// Column, row and depth at which an ideal camera sees a point.
    pub(crate) fn project(&self, p: V3) -> (f32, f32, f32) {
        let q = p - self.origin;
        let (x, y, z) = (q.dot(self.axes[0]), q.dot(self.axes[1]), q.dot(self.axes[2]));
        (self.model.fx * x / z + self.model.cx, self.model.fy * y / z + self.model.cy, z)
    }
}

/// Where light that arrives at the distorted point came from: the lens model, solved by fixed-point iteration.
///
/// # Bound
/// 12 rounds; for the strength of distortion that the options allow the rest is far below a hundredth of a pixel.
fn undistort(lens: &Distortion, xd: f32, yd: f32) -> (f32, f32) {
    let [k1, k2, p1, p2, ..] = lens.0;
    let (mut x, mut y) = (xd, yd);
    for _ in 0..12 {
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * k2);
        let dx = 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
        let dy = p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
        (x, y) = ((xd - dx) / radial, (yd - dy) / radial);
    }
    (x, y)
}
