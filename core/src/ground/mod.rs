//! The ground plane.

/// The ground in the vehicle frame: points `p` with `normal . p = offset_m`.
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
    /// Roll of the camera against the plane, radians.
    pub roll_rad: f32,
    /// Pixels that support it.
    pub support: u32,
    /// Root mean square distance of its surfaces from the plane, metres.
    pub rms_m: f32,
    /// Frames since it was last seen; 0 if it was seen in this one.
    pub age_frames: u16,
}

impl GroundPlane {
    /// Height of a point of the vehicle frame above the plane, metres.
    pub fn height_m(&self, p: [f32; 3]) -> f32 {
        self.normal[0] * p[0] + self.normal[1] * p[1] + self.normal[2] * p[2] - self.offset_m
    }
}
