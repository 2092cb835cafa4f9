//! The detectors that the paper tells of besides its final one: what came before it, and what it was measured by.
//!
//! All of them work on the same validated disparity picture and give the same things: a ground plane, surfaces with a class,
//! obstacles, cells. Where they differ is in how they come to the classes.
//!
//! ```text
//!                      ground                          classes                             cells
//! surface-normals      level surfaces                  a normal for each tile's surface    votes of classified pixels
//! cost-map             flat columns                    height band of each pixel           number of points in the column
//! ground-deviation     consensus of the disparities    off the ground's disparity          votes of classified pixels
//! disparity-segments   the mount's level               size and height of segments         votes of whole segments
//! pixel-normals        level surfaces                  a normal for each pixel             votes of classified pixels
//! ```
//!
//! The classes of pixels lie where the numbers of their surfaces will lie, so none of this takes memory for a picture of its own.

mod cost_map;
mod cross_check;
mod disparity_plane;
mod disparity_segments;
mod ground_deviation;
mod kind;
mod pixel_normals;
mod points;
mod settings;
mod window;

pub(crate) use cost_map::CLASSES as COST_MAP_CLASSES;
pub use cost_map::CostMap;
pub use cross_check::OtherMap;
pub use disparity_segments::DisparitySegments;
pub(crate) use ground_deviation::CLASSES as GROUND_DEVIATION_CLASSES;
pub use ground_deviation::GroundDeviation;
pub use kind::{DetectorKind, Detectors};
pub(crate) use pixel_normals::CLASSES as PIXEL_NORMAL_CLASSES;
pub use pixel_normals::PixelNormals;
pub use settings::{
    ConfidenceSettings, CostMapSettings, DisparitySegmentSettings, GroundDeviationSettings, PixelNormalSettings,
};
