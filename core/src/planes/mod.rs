//! Planes by orthogonal distance regression: the normal is the eigenvector of the smallest eigenvalue of the points'
//! covariance. Source: the paper, section 4.4, Figure 12 and Table 2.

mod eigen;
mod scatter;

pub use eigen::{Eigen, MAX_TILT_DEG, MIN_RELATIVE_GAP, SymmetricMatrix3};
pub use scatter::Scatter;
