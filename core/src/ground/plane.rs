//! The ground as a plane.

use crate::{
    geometry::{Place, VehicleFrame},
    planes::Scatter,
};

/// The ground: points `p` with `normal . p = offset_m`, in the frame of the pair as the stages work it out, in the vehicle
/// frame as it leaves the detector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundPlane {
    /// Unit normal, upward.
    pub normal: [f32; 3],
    /// Height of the plane at the origin along the normal, metres; 0 if the mount is right and the ground is level.
    pub offset_m: f32,
    /// Distance of the left camera from the plane, metres.
    pub camera_height_m: f32,
    /// Tilt of the optical axis below the plane, radians.
    pub pitch_down_rad: f32,
    /// Roll of the camera about its optical axis against the plane, radians; positive if the camera leans to the right.
    pub roll_rad: f32,
    /// Pixels that support it.
    pub support: u32,
    /// Root mean square distance of the points from the plane, metres.
    pub rms_m: f32,
    /// Frames since it was last seen; 0 if it was seen in this one.
    pub age_frames: u16,
}

impl GroundPlane {
    /// All zero, for a stage that is not configured.
    pub(super) const UNSET: Self = Self {
        normal: [0.0; 3],
        offset_m: 0.0,
        camera_height_m: 0.0,
        pitch_down_rad: 0.0,
        roll_rad: 0.0,
        support: 0,
        rms_m: 0.0,
        age_frames: 0,
    };

    /// The plane through a set of points; `None` where they do not define one.
    pub fn through(points: &Scatter, frame: &VehicleFrame) -> Option<Self> {
        let (normal, variance) = points.plane()?;
        Some(Self {
            support: points.weight as u32,
            rms_m: libm::sqrtf(variance),
            ..Self::new(normal, dot(normal, points.mean_m), frame)
        })
    }

    /// The plane that the mount promises: level, at the origin of the vehicle frame.
    pub fn of_mount(frame: &VehicleFrame) -> Self {
        Self::new([0.0, 0.0, 1.0], 0.0, frame)
    }

    pub(crate) fn new(normal: [f32; 3], offset_m: f32, frame: &VehicleFrame) -> Self {
        let camera_m = frame.point([0.0; 3]);
        // How far the camera's axes point below the plane.
        let [right, down, forward] =
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| -dot(normal, frame.direction(axis)));
        Self {
            normal,
            offset_m,
            camera_height_m: dot(normal, camera_m) - offset_m,
            pitch_down_rad: libm::asinf(forward.clamp(-1.0, 1.0)),
            roll_rad: libm::atan2f(right, down),
            support: 0,
            rms_m: 0.0,
            age_frames: 0,
        }
    }

    /// The plane seen in the frame that the pair's frame is turned and moved into. What it says of the camera stays.
    #[must_use]
    pub fn moved(&self, place: &Place) -> Self {
        let [x, y] = place.turn([self.normal[0], self.normal[1]]);
        let normal = [x, y, self.normal[2]];
        let [forward_m, left_m] = place.origin_m();
        Self { normal, offset_m: self.offset_m + dot(normal, [forward_m, left_m, 0.0]), ..*self }
    }

    /// Height of a point of the vehicle frame above the plane, metres.
    pub fn height_m(&self, p: [f32; 3]) -> f32 {
        dot(self.normal, p) - self.offset_m
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
