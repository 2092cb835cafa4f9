//! planes.

mod eigen;

pub use eigen::{Eigen, MAX_TILT_DEG, MIN_RELATIVE_GAP, SymmetricMatrix3};
