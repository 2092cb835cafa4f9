//! What kind of scene is wanted, and what kind of cameras look at it.

use fencepost_core::error::ConfigError;
use fencepost_core::geometry::{
    CameraModel, Distortion, Mount, RawPair, Rectification, RectifiedPair, StereoCalibration,
};
use fencepost_core::map::MapGeometry;

/// What stands on the ground.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Content {
    /// Trees, bushes, rocks, a fence and a wall along a trail.
    #[default]
    Rural,
    /// Nothing higher than grass.
    OpenGround,
    /// Crates and posts, nothing else higher than grass, at the places of [`COURSE`](super::COURSE).
    Course,
}

/// How the right camera is turned against the left one, degrees about the camera's own axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Misalignment {
    /// About the x axis: positive looks further up.
    pub about_x_deg: f32,
    /// About the y axis: positive looks further to the right.
    pub about_y_deg: f32,
    /// About the optical axis: positive turns the camera clockwise as it sees the world.
    pub about_z_deg: f32,
}

/// Settings of a scene and its cameras. The default is the demonstration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneOptions {
    /// Chooses the place, shape and texture of everything, and the noise.
    pub seed: u32,
    /// What stands on the ground.
    pub content: Content,
    /// Width of the pictures, px.
    pub width: u32,
    /// Height of the pictures, px.
    pub height: u32,
    /// Focal length, px.
    pub focal_px: f32,
    /// Distance from the left to the right camera, metres.
    pub baseline_m: f32,
    /// Height of the left camera above the ground, metres.
    pub mount_height_m: f32,
    /// Tilt of the cameras below the horizon, degrees.
    pub pitch_down_deg: f32,
    /// Roll of the cameras, degrees; positive leans to the right.
    pub roll_deg: f32,
    /// Slope of the ground ahead, degrees; positive rises.
    pub slope_deg: f32,
    /// Tilt of the slope to the side, degrees; positive rises to the left. Where the ground does not slope ahead the whole of
    /// it is tilted.
    pub slope_aside_deg: f32,
    /// Where the slope begins, metres ahead of the place of the first frame; from -20 down the whole ground slopes. A slope
    /// that is tilted to the side begins there on the x axis, and along an oblique line.
    pub slope_start_m: f32,
    /// Length of the slope, metres.
    pub slope_length_m: f32,
    /// Slope of the ground beyond it, degrees: negative behind a positive slope for a crest, the other way round for a dip.
    pub slope_after_deg: f32,
    /// Height of the bumps of the ground over that of the default: 0 for a smooth ground.
    pub roughness: f32,
    /// Noise of the cameras, grey values (standard deviation); 0 for none.
    pub noise_sigma: f32,
    /// Exposure of the right camera over that of the left one.
    pub exposure_ratio: f32,
    /// Lens distortion k1, k2, p1, p2, of which the right lens has nine tenths; `None` for an ideal lens.
    pub distortion: Option<[f32; 4]>,
    /// How the right camera is turned; `None` for an ideal mount.
    pub misalignment: Option<Misalignment>,
    /// Number of pairs.
    pub frames: u32,
    /// Pairs per second.
    pub rate_hz: f32,
    /// Speed of the vehicle along the trail, m/s.
    pub speed_m_s: f32,
    /// Cells for which the truth is told.
    pub map: MapGeometry,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            content: Content::Rural,
            width: 512,
            height: 384,
            focal_px: 420.0,
            baseline_m: 0.12,
            mount_height_m: 1.1,
            pitch_down_deg: 10.0,
            roll_deg: 0.0,
            slope_deg: 0.0,
            slope_aside_deg: 0.0,
            slope_start_m: 2.5,
            slope_length_m: 34.0,
            slope_after_deg: 0.0,
            roughness: 1.0,
            noise_sigma: 1.2,
            exposure_ratio: 1.08,
            distortion: None,
            misalignment: None,
            frames: 8,
            rate_hz: 10.0,
            speed_m_s: 1.0,
            map: MapGeometry::default(),
        }
    }
}

impl SceneOptions {
    /// The distortion of a common 6 mm lens, for [`SceneOptions::distortion`].
    pub const USUAL_DISTORTION: [f32; 4] = [-0.21, 0.07, 0.0006, -0.0004];

    /// A right camera that was mounted without great care, for [`SceneOptions::misalignment`].
    pub const USUAL_MISALIGNMENT: Misalignment =
        Misalignment { about_x_deg: 0.35, about_y_deg: -0.5, about_z_deg: 0.4 };

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `scene.*`, or `calibration.*` and `mount.*` where these say more.
    pub fn check(&self) -> Result<(), ConfigError> {
        self.ideal_pair().check()?;
        self.mount().check()?;
        ConfigError::check("scene.width", self.width as f32, 32.0, 4096.0)?;
        ConfigError::check("scene.height", self.height as f32, 32.0, 4096.0)?;
        ConfigError::check("scene.mount_height_m", self.mount_height_m, 0.2, 4.0)?;
        ConfigError::check("scene.slope_deg", self.slope_deg, -30.0, 30.0)?;
        ConfigError::check("scene.slope_aside_deg", self.slope_aside_deg, -30.0, 30.0)?;
        ConfigError::check("scene.slope_length_m", self.slope_length_m, 1.0, 1.0e3)?;
        ConfigError::check("scene.slope_after_deg", self.slope_after_deg, -30.0, 30.0)?;
        ConfigError::check("scene.slope_start_m", self.slope_start_m, -1.0e4, 1.0e4)?;
        ConfigError::check("scene.roughness", self.roughness, 0.0, 4.0)?;
        ConfigError::check("scene.noise_sigma", self.noise_sigma, 0.0, 50.0)?;
        ConfigError::check("scene.exposure_ratio", self.exposure_ratio, 0.1, 10.0)?;
        ConfigError::check("scene.rate_hz", self.rate_hz, 0.01, 1000.0)?;
        ConfigError::check("scene.speed_m_s", self.speed_m_s, 0.0, 10.0)?;
        ConfigError::check("scene.map.cell_size_mm", f32::from(self.map.cell_size_mm), 50.0, 5000.0)?;
        for k in self.distortion.unwrap_or_default() {
            ConfigError::check("scene.distortion", k, -0.4, 0.4)?;
        }
        let turn = self.misalignment.unwrap_or_default();
        for angle_deg in [turn.about_x_deg, turn.about_y_deg, turn.about_z_deg] {
            ConfigError::check("scene.misalignment", angle_deg, -5.0, 5.0)?;
        }
        Ok(())
    }

    /// How the left camera sits on the vehicle.
    pub fn mount(&self) -> Mount {
        let Self { mount_height_m, pitch_down_deg, roll_deg, .. } = *self;
        Mount { height_m: Some(mount_height_m), pitch_down_deg, roll_deg, ..Mount::default() }
    }

    /// The exact calibration. With distortion or misalignment the pair is raw, and its rectified cameras are those of
    /// [`SceneOptions::ideal_pair`], so that the mount holds for the rectified left camera.
    pub fn calibration(&self) -> StereoCalibration {
        let pair = self.ideal_pair();
        if self.distortion.is_none() && self.misalignment.is_none() {
            return StereoCalibration::Rectified(pair);
        }
        let k = self.distortion.unwrap_or_default();
        let lens = |part: f32| {
            let mut all = [0.0; 8];
            for (a, b) in all.iter_mut().zip(k) {
                *a = b * part;
            }
            CameraModel {
                width: self.width,
                height: self.height,
                fx: self.focal_px,
                fy: self.focal_px,
                cx: pair.cx,
                cy: pair.cy,
                distortion: Distortion(all),
            }
        };
        let rotation = rotation(self.misalignment.unwrap_or_default());
        let translation_m = rotation.map(|row| -row[0] * self.baseline_m);
        let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let back = core::array::from_fn(|i| core::array::from_fn(|j| rotation[j][i]));
        let rectification = Some(Rectification { left_rotation: identity, right_rotation: back, pair });
        StereoCalibration::Raw(RawPair { left: lens(1.0), right: lens(0.9), rotation, translation_m, rectification })
    }

    /// The pair without distortion and misalignment.
    pub fn ideal_pair(&self) -> RectifiedPair {
        RectifiedPair {
            width: self.width,
            height: self.height,
            focal_px: self.focal_px,
            cx: (self.width as f32 - 1.0) * 0.5,
            cy: (self.height as f32 - 1.0) * 0.5,
            baseline_m: self.baseline_m,
            disparity_offset_px: 0.0,
        }
    }
}

/// Turns directions of the left camera's frame into that of the right one.
fn rotation(turn: Misalignment) -> [[f32; 3]; 3] {
    let (sx, cx) = libm::sincosf(turn.about_x_deg.to_radians());
    let (sy, cy) = libm::sincosf(turn.about_y_deg.to_radians());
    let (sz, cz) = libm::sincosf(turn.about_z_deg.to_radians());
    // The axes of the turned camera, Rz Ry Rx, are the columns; what it sees is turned the other way: the transpose.
    [
        [cz * cy, sz * cy, -sy],
        [cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx],
        [cz * sy * cx + sz * sx, sz * sy * cx - cz * sx, cy * cx],
    ]
}
