//! Where the cameras are and how they see: lenses, the pair, the mount on the vehicle.
//!
//! Camera frame: x right, y down, z forward. Vehicle frame: x forward, y left, z up (REP-103), its origin on the ground: below
//! the left camera, or where the mount says it is. Metres and radians.

mod calibration;
mod depth;
mod mount;
mod place;
mod rays;

pub use calibration::{CameraModel, Distortion, RawPair, Rectification, RectifiedPair, StereoCalibration};
pub use depth::DepthTable;
pub use mount::{Mount, VehicleFrame};
pub use place::Place;
pub use rays::Rays;

#[cfg(test)]
mod tests;
