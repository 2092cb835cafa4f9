//! A stereo camera over a made-up rural scene, that also knows the exact truth.
//!
//! The scene is a trail through a meadow with trees, bushes, rocks, a fence and a plastered wall, lit by the sun, and is
//! seen from a vehicle that drives slowly along the trail. It is what the program shows where there is no recording. All of
//! it is computed, with whole numbers and with operations that IEEE 754 rounds correctly or that `libm` computes in
//! software: the same options give the same bytes on every machine and with any number of threads.
//!
//! ```
//! use fencepost_hal::camera::Camera;
//! use fencepost_hal::scene::{Scene, SceneOptions};
//!
//! let options = SceneOptions { width: 64, height: 48, focal_px: 52.0, frames: 1, ..SceneOptions::default() };
//! let mut camera = Scene::new(options)?.into_camera();
//! camera.next_pair(|pair| assert_eq!(pair.left.width(), 64))?;
//! let truth = camera.scene().truth(0);
//! assert_eq!(truth.disparity.len(), 64 * 48);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bvh;
mod camera;
mod ground;
mod layout;
mod light;
mod materials;
mod mesh;
mod noise;
mod optics;
mod options;
mod parallel;
mod render;
mod score;
mod sensor;
mod sky;
#[cfg(test)]
mod tests;
mod truth;
mod vector;

use fencepost_core::error::ConfigError;
use fencepost_core::geometry::{Mount, StereoCalibration, VehicleFrame};

pub use camera::SceneCamera;
pub use layout::{COURSE, CourseThing};
pub use options::{Content, Misalignment, SceneOptions};
pub use score::{Score, score};
pub use truth::{Truth, TruthCell, TruthCells};

use bvh::Bvh;
use ground::Ground;
use light::Light;
use mesh::{Mesh, Object, Skin};
use optics::{Eye, Pose};

/// A scene: the ground, what stands on it, and the light.
#[derive(Debug)]
pub struct Scene {
    options: SceneOptions,
    frame: VehicleFrame,
    ground: Ground,
    bvh: Bvh,
    skins: Vec<Skin>,
    objects: Vec<Object>,
    light: Light,
    /// Places where something is higher than a vehicle can drive over, in steps of [`truth::MARK_M`] of the world's x and y.
    high: Vec<(i16, i16)>,
}

/// Both pictures of a pair, with their own pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RenderedPair {
    /// Left picture, row by row.
    pub left: Vec<u8>,
    /// Right picture, row by row.
    pub right: Vec<u8>,
}

impl Scene {
    /// Builds the scene.
    ///
    /// # Errors
    /// The first of the options that cannot be used, as [`SceneOptions::check`].
    ///
    /// # Bound
    /// About 1.2 million nodes of ground and 200,000 shapes, whatever the options.
    pub fn new(options: SceneOptions) -> Result<Self, ConfigError> {
        options.check()?;
        let ground = Ground::new(&options);
        let mesh = layout::furnish(&options, &ground);
        Self::of(options, ground, mesh)
    }

    fn of(options: SceneOptions, ground: Ground, mesh: Mesh) -> Result<Self, ConfigError> {
        let frame = VehicleFrame::new(&options.mount())?;
        let light = Light::new(&mesh, &ground);
        let high = truth::high_places(&mesh, &ground);
        let Mesh { shapes, skins, objects } = mesh;
        Ok(Self { options, frame, ground, bvh: Bvh::new(shapes), skins, objects, light, high })
    }

    /// The options that the scene was built with.
    pub const fn options(&self) -> &SceneOptions {
        &self.options
    }

    /// The exact calibration; see [`SceneOptions::calibration`].
    pub fn calibration(&self) -> StereoCalibration {
        self.options.calibration()
    }

    /// How the left camera sits on the vehicle.
    pub fn mount(&self) -> Mount {
        self.options.mount()
    }

    /// A camera that drives through the scene.
    pub fn into_camera(self) -> SceneCamera {
        SceneCamera::new(self)
    }

    /// Time of exposure of a frame, nanoseconds from the first.
    pub fn timestamp_ns(&self, frame: u32) -> u64 {
        let period_ns = (1.0e9 / f64::from(self.options.rate_hz)) as u64;
        u64::from(frame) * period_ns
    }

    fn pose(&self, frame: u32) -> Pose {
        Pose::new(&self.ground, self.options.speed_m_s * (frame as f32 / self.options.rate_hz))
    }

    fn eyes(&self, frame: u32) -> [Eye; 2] {
        Eye::pair(&self.options, &self.frame, self.pose(frame))
    }
}
