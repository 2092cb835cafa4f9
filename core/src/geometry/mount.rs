//! How the left camera sits on the vehicle.

use super::Place;
use crate::error::ConfigError;

/// Height, tilt and place of the left camera.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Mount {
    /// Height of the left camera above the ground, metres; `None` if not known.
    pub height_m: Option<f32>,
    /// Tilt of the optical axis below the horizon, degrees.
    pub pitch_down_deg: f32,
    /// Roll about the optical axis, degrees; positive if the camera leans to the right.
    pub roll_deg: f32,
    /// The left camera's place ahead of the origin of the vehicle frame, metres.
    pub forward_m: f32,
    /// The left camera's place to the left of the origin of the vehicle frame, metres.
    pub left_m: f32,
    /// Heading of the left camera against that of the vehicle, degrees, positive to the left.
    pub yaw_left_deg: f32,
}

impl Default for Mount {
    fn default() -> Self {
        Self { height_m: None, pitch_down_deg: 0.0, roll_deg: 0.0, forward_m: 0.0, left_m: 0.0, yaw_left_deg: 0.0 }
    }
}

impl Mount {
    /// Height that stands in where it is not known, metres: about that of the cameras on the LAGR robot.
    pub const ASSUMED_HEIGHT_M: f32 = 1.0;

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `mount.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        if let Some(height_m) = self.height_m {
            ConfigError::check("mount.height_m", height_m, 0.02, 20.0)?;
        }
        ConfigError::check("mount.pitch_down_deg", self.pitch_down_deg, -60.0, 89.0)?;
        ConfigError::check("mount.roll_deg", self.roll_deg, -60.0, 60.0)?;
        ConfigError::check("mount.forward_m", self.forward_m, -50.0, 50.0)?;
        ConfigError::check("mount.left_m", self.left_m, -50.0, 50.0)?;
        ConfigError::check("mount.yaw_left_deg", self.yaw_left_deg, -180.0, 180.0)
    }

    /// The same camera at the origin, looking straight ahead: its own frame on the ground.
    #[must_use]
    pub const fn without_place(&self) -> Self {
        Self { forward_m: 0.0, left_m: 0.0, yaw_left_deg: 0.0, ..*self }
    }
}

/// Turns points of the left rectified camera's frame into the vehicle frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleFrame {
    /// Rows: the vehicle's x, y and z axes, seen in the camera frame.
    rows: [[f32; 3]; 3],
    /// The camera, in the vehicle frame.
    origin_m: [f32; 3],
}

impl VehicleFrame {
    /// The frame that `mount` describes.
    ///
    /// # Errors
    /// As [`Mount::check`].
    pub fn new(mount: &Mount) -> Result<Self, ConfigError> {
        mount.check()?;
        let (sin_pitch, cos_pitch) = libm::sincosf(mount.pitch_down_deg.to_radians());
        let (sin_roll, cos_roll) = libm::sincosf(mount.roll_deg.to_radians());
        // A camera that leans to the right sees the world turned to the left: undo the roll about z, then the pitch about x,
        // then exchange the axes (camera z forward -> vehicle x, camera x right -> vehicle -y, camera y down -> vehicle -z).
        let right = [cos_roll, -sin_roll, 0.0];
        let down = [sin_roll, cos_roll, 0.0];
        let ahead = [-sin_pitch * down[0], -sin_pitch * down[1], cos_pitch];
        let aside = [-right[0], -right[1], 0.0];
        let up = [-cos_pitch * down[0], -cos_pitch * down[1], -sin_pitch];
        // At last the heading, about the vehicle's z.
        let place = Place::new(mount);
        let turned = [0, 1, 2].map(|i| place.turn([ahead[i], aside[i]]));
        let rows = [turned.map(|[x, _]| x), turned.map(|[_, y]| y), up];
        let [x, y] = place.origin_m();
        Ok(Self { rows, origin_m: [x, y, mount.height_m.unwrap_or(Mount::ASSUMED_HEIGHT_M)] })
    }

    /// The frame for a camera that was turned against the one that the mount speaks of: `rotation` takes directions of the
    /// mounted camera into the turned one, row by row. Rectification turns the left camera in this way.
    #[must_use]
    pub fn turned(&self, rotation: &[[f32; 3]; 3]) -> Self {
        let rows = self.rows.map(|axis| core::array::from_fn(|i| dot(rotation[i], axis)));
        Self { rows, ..*self }
    }

    /// Height of the camera above the origin of the vehicle frame, metres.
    pub const fn camera_height_m(&self) -> f32 {
        self.origin_m[2]
    }

    /// The camera in the vehicle frame, metres.
    pub const fn origin_m(&self) -> [f32; 3] {
        self.origin_m
    }

    /// The vehicle's x, y and z axes, seen in the camera frame.
    pub const fn rows(&self) -> &[[f32; 3]; 3] {
        &self.rows
    }

    /// Turns a direction.
    pub fn direction(&self, camera: [f32; 3]) -> [f32; 3] {
        let r = &self.rows;
        [dot(r[0], camera), dot(r[1], camera), dot(r[2], camera)]
    }

    /// Turns and moves a point.
    pub fn point(&self, camera_m: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = self.direction(camera_m);
        let origin = self.origin_m;
        [x + origin[0], y + origin[1], z + origin[2]]
    }

    /// Turns a direction of the vehicle frame back into the camera frame.
    pub fn to_camera(&self, v: [f32; 3]) -> [f32; 3] {
        let r = &self.rows;
        core::array::from_fn(|i| r[0][i] * v[0] + r[1][i] * v[1] + r[2][i] * v[2])
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
