//! Pictures of what the detector sees.

mod birdseye;
mod canvas;
mod colours;
mod figures;
mod labels;

pub use birdseye::{birdseye, mark_cells, true_map};
pub use canvas::{Canvas, grey8_png, grey16_png};
pub use colours::{CALLED_FREE, GROUND, MISSED, NO_VALUE, NOT_THERE, OBSTACLE, hex, reason_colour, value_colour};
pub use figures::{Figures, classes, disparity16};
