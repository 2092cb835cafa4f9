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

/// Settings of the ground plane.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct GroundSettings {
    /// Largest tilt against the vehicle's horizontal, degrees.
    pub max_tilt_deg: f32,
    /// Largest difference between the height of the camera above the plane and that of the mount, metres, where the
    /// height of the mount is known.
    pub height_tolerance_m: f32,
    /// Least number of pixels that must support the plane, per 1000 pixels of the picture.
    pub min_support_permille: f32,
    /// Frames for which the last plane is held when a frame has none.
    pub hold_frames: u16,
}

impl Default for GroundSettings {
    fn default() -> Self {
        Self { max_tilt_deg: 20.0, height_tolerance_m: 0.5, min_support_permille: 5.0, hold_frames: 10 }
    }
}
