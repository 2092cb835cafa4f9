//! The detector `normalized-cuts`: what a segmentation of the whole picture at once makes of it. For comparison only.
//!
//! Source: J. Shi and J. Malik, *Normalized Cuts and Image Segmentation*, IEEE PAMI 22(8), 2000, the paper's reference for
//! methods that are too slow for a robot. The picture is shrunk and becomes a graph: pixels near each other have the more in
//! common the more alike their grey values, disparities and places are. The graph is cut in two where the least is lost compared
//! with what each part keeps, which the second smallest eigenvector of its normalized Laplacian tells, and so on with the parts.
//!
//! A plane through the points of each segment gives its class, as the surfaces of a tile get theirs; ground, obstacles and cells
//! then come about by the core's own stages. So what differs from `surface-normals` is the segments alone.
//!
//! ```text
//! left, disparity ─> shrink ─> graph ─> cut <─> eigen    segments
//!                                        └─> a plane each ─> ground ─> obstacles ─> map (core)
//! ```
//!
//! It takes seconds for a picture and memory from the heap, so it is not in the core and nothing drives by it. The eigenvectors
//! are those of `faer`'s Krylov-Schur solver: the smallest pairs of a sparse matrix of tens of thousands of rows, and no
//! compiler but Rust's.

mod cut;
mod eigen;
mod graph;
mod segments;
mod settings;
mod shrink;
mod stages;
#[cfg(test)]
mod tests;

pub use segments::{Segment, Segmentation};
pub use settings::NormalizedCutSettings;

use fencepost_core::{
    disparity::DisparityPicture,
    error::ConfigError,
    geometry::{Mount, Place, Rays, RectifiedPair, VehicleFrame},
    picture::Picture,
    settings::Settings,
};

use graph::Graph;
use shrink::Shrunk;

/// The name of this detector, beside those of the core.
pub const NAME: &str = "normalized-cuts";

/// Segments pictures by normalized cuts, and tells what the segments are.
#[derive(Clone, Debug)]
pub struct NormalizedCuts {
    settings: NormalizedCutSettings,
    core: Settings,
    pair: RectifiedPair,
    frame: VehicleFrame,
    place: Place,
    rays: Rays,
    height_known: bool,
}

impl NormalizedCuts {
    /// For the rectified cameras `pair` on a vehicle. `left_rotation` is how rectification turned the left camera
    /// (`Rectifier::rotation`), if it did. Of `core` the search range and the settings of surfaces, ground, obstacles and map count.
    ///
    /// # Errors
    /// The first value that cannot be used.
    pub fn new(
        settings: &NormalizedCutSettings,
        core: &Settings,
        pair: &RectifiedPair,
        mount: &Mount,
        left_rotation: Option<[[f32; 3]; 3]>,
    ) -> Result<Self, ConfigError> {
        settings.check()?;
        pair.check()?;
        let frame = VehicleFrame::new(&mount.without_place())?;
        let frame = left_rotation.map_or(frame, |rotation| frame.turned(&rotation));
        let this = Self {
            settings: *settings,
            core: *core,
            pair: *pair,
            frame,
            place: Place::new(mount),
            rays: Rays::new(pair, &frame),
            height_known: mount.height_m.is_some(),
        };
        stages::lock().configure(&this)?;
        Ok(this)
    }

    /// Looks at a rectified left picture and its validated disparities. The same pictures give the same result: there is no
    /// chance in it, and one thread.
    ///
    /// # Panics
    /// When the pictures have another size than the pair.
    pub fn run(&self, left: &Picture<'_>, disparity: DisparityPicture<'_>) -> Segmentation {
        let size = (self.pair.width as usize, self.pair.height as usize);
        assert_eq!((left.width(), left.height()), size, "the left picture has the size of the pair");
        assert_eq!((disparity.width(), disparity.height()), size, "the disparity picture has the size of the pair");
        let shrunk = Shrunk::new(left, disparity, self.settings.max_pixels as usize);
        let graph = Graph::of(&shrunk, &self.settings);
        let numbers = cut::segments(&graph, &self.settings);
        let mut segmentation = Segmentation::of(&shrunk, &numbers, disparity, self);
        stages::lock().run(self, disparity, &mut segmentation);
        segmentation
    }
}
