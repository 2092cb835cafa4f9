//! The scene as a source of stereo pairs.

use core::convert::Infallible;

use fencepost_core::picture::{Picture, PictureError};

use super::Scene;
use crate::camera::{Camera, StereoPair};

/// A camera that drives through a scene.
#[derive(Debug)]
pub struct SceneCamera {
    scene: Scene,
    next: u32,
}

impl SceneCamera {
    /// A camera at the first frame of `scene`.
    pub const fn new(scene: Scene) -> Self {
        Self { scene, next: 0 }
    }

    /// The scene.
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Gives the scene back.
    pub fn into_inner(self) -> Scene {
        self.scene
    }
}

impl Camera for SceneCamera {
    type Error = Infallible;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Infallible> {
        if self.next >= self.scene.options.frames {
            return Ok(None);
        }
        let sequence = self.next;
        self.next += 1;
        let pictures = self.scene.render(sequence);
        let (width, height) = (self.scene.options.width as usize, self.scene.options.height as usize);
        let see = |pixels| -> Result<Picture<'_>, PictureError> { Picture::packed(pixels, width, height) };
        // The options were checked and the pictures made to size: neither can fail, and a scene that ends is not wrong.
        let (Ok(left), Ok(right)) = (see(&pictures.left), see(&pictures.right)) else { return Ok(None) };
        let timestamp_ns = self.scene.timestamp_ns(sequence);
        Ok(Some(consume(&StereoPair { left, right, timestamp_ns, skew_ns: 0, sequence, missed: 0 })))
    }
}
