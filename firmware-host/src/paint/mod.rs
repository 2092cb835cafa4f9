//! Pictures of what the detector sees.

mod birdseye;
mod canvas;
mod colours;
mod figures;
mod labels;

pub use birdseye::{birdseye, true_map};
pub use canvas::{Canvas, grey8_png, grey16_png};
pub use colours::{GROUND, NO_VALUE, OBSTACLE, hex, reason_colour, value_colour};
pub use figures::{Figures, classes, disparity16};
