//! Settings of the ground plane.

use crate::error::ConfigError;

/// Settings of the ground plane.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct GroundSettings {
    /// Largest tilt against the vehicle's horizontal, degrees.
    pub max_tilt_deg: f32,
    /// Largest difference between the height of the camera above the plane and that of the mount, metres, where the
    /// height of the mount is known.
    pub height_tolerance_m: f32,
    /// Surfaces whose middle lies within this distance of the plane are those that it is fitted to, metres. Not wider: kerbs
    /// and verges would tilt it.
    pub fit_tolerance_m: f32,
    /// The error of a disparity moves a point along its ray, down when it moves away, and would tilt the plane away from the camera:
    /// it is taken out of their spread, as far as they show it, and never more than this, px: points lie off their planes for other
    /// reasons, too.
    pub fit_noise_max_px: f32,
    /// How much larger the error of a disparity is than the surfaces' points show, because their own planes follow it: this many
    /// times as much as they lie off their planes is taken out.
    pub fit_noise_factor: f32,
    /// A surface whose points lie this many times as far off its plane as those of the surfaces in the mean has something else on it,
    /// as the foot of a wall: it has no say in the plane.
    pub fit_roughness: f32,
    /// A surface belongs to the ground if its middle lies within this distance of the plane, metres.
    pub surface_tolerance_m: f32,
    /// Allowance on top of it for each metre of range, metres: distances are less certain there, and the ground bends.
    pub surface_tolerance_per_m: f32,
    /// Surfaces farther away say nothing about the plane, metres: roads bend there, and their heights are uncertain.
    pub max_range_m: f32,
    /// Surfaces this far to the side count half, metres: the plane is that of the ground ahead, not that of the verges.
    pub corridor_m: f32,
    /// Edge of the patches that the ground is followed with, metres: bends within a patch are not seen.
    pub terrain_patch_m: f32,
    /// Steepest ground that is followed, degrees: what rises faster stands on it.
    pub terrain_max_slope_deg: f32,
    /// Error of a disparity that must be expected, px: what rises less than this makes it is still followed.
    pub terrain_noise_px: f32,
    /// How much of what is known of the ground in one patch counts in the next: with 0 each patch stands on its own.
    pub terrain_share: f32,
    /// Least number of pixels that must support the plane, per 1000 pixels of the picture.
    pub min_support_permille: f32,
    /// If there is no ground at the height that the mount promises, a plane at another height is taken for the ground if this many of
    /// 1000 pixels support it and hardly anything lies below it; with more than 1000 none is.
    pub other_height_support_permille: f32,
    /// Frames for which the last plane is held when a frame has none; with 0 each frame stands on its own.
    pub hold_frames: u16,
}

impl GroundSettings {
    /// All zero, for a stage that is not configured.
    pub(crate) const UNSET: Self = Self {
        max_tilt_deg: 0.0,
        height_tolerance_m: 0.0,
        fit_tolerance_m: 0.0,
        fit_noise_max_px: 0.0,
        fit_noise_factor: 0.0,
        fit_roughness: 0.0,
        surface_tolerance_m: 0.0,
        surface_tolerance_per_m: 0.0,
        max_range_m: 0.0,
        corridor_m: 0.0,
        terrain_patch_m: 0.0,
        terrain_max_slope_deg: 0.0,
        terrain_noise_px: 0.0,
        terrain_share: 0.0,
        min_support_permille: 0.0,
        other_height_support_permille: 0.0,
        hold_frames: 0,
    };

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `ground.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check("ground.max_tilt_deg", self.max_tilt_deg, 0.0, 45.0)?;
        ConfigError::check("ground.height_tolerance_m", self.height_tolerance_m, 0.0, 20.0)?;
        ConfigError::check("ground.fit_tolerance_m", self.fit_tolerance_m, 0.001, 2.0)?;
        ConfigError::check("ground.fit_noise_max_px", self.fit_noise_max_px, 0.0, 4.0)?;
        ConfigError::check("ground.fit_noise_factor", self.fit_noise_factor, 0.0, 10.0)?;
        ConfigError::check("ground.fit_roughness", self.fit_roughness, 1.0, 1000.0)?;
        ConfigError::check("ground.surface_tolerance_m", self.surface_tolerance_m, 0.001, 2.0)?;
        ConfigError::check("ground.surface_tolerance_per_m", self.surface_tolerance_per_m, 0.0, 0.5)?;
        ConfigError::check("ground.max_range_m", self.max_range_m, 1.0, 1000.0)?;
        ConfigError::check("ground.corridor_m", self.corridor_m, 0.1, 1000.0)?;
        ConfigError::check("ground.terrain_patch_m", self.terrain_patch_m, 0.05, 100.0)?;
        ConfigError::check("ground.terrain_max_slope_deg", self.terrain_max_slope_deg, 0.0, 60.0)?;
        ConfigError::check("ground.terrain_noise_px", self.terrain_noise_px, 0.0, 16.0)?;
        ConfigError::check("ground.terrain_share", self.terrain_share, 0.0, 0.9)?;
        ConfigError::check("ground.min_support_permille", self.min_support_permille, 0.0, 1000.0)?;
        ConfigError::check("ground.other_height_support_permille", self.other_height_support_permille, 0.0, 2000.0)?;
        ConfigError::check("ground.hold_frames", f32::from(self.hold_frames), 0.0, 1000.0)
    }
}

impl Default for GroundSettings {
    fn default() -> Self {
        Self {
            max_tilt_deg: 20.0,
            height_tolerance_m: 0.5,
            fit_tolerance_m: 0.05,
            fit_noise_max_px: 0.7,
            fit_noise_factor: 1.5,
            fit_roughness: 1.5,
            surface_tolerance_m: 0.06,
            surface_tolerance_per_m: 0.01,
            max_range_m: 25.0,
            corridor_m: 1.0,
            terrain_patch_m: 0.75,
            terrain_max_slope_deg: 20.0,
            terrain_noise_px: 0.4,
            terrain_share: 0.15,
            min_support_permille: 2.0,
            other_height_support_permille: 20.0,
            hold_frames: 10,
        }
    }
}
