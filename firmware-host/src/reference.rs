//! Detectors outside the core, to compare with: too slow or too hungry for a robot, but a measure of what can be had.

use std::fmt;

use fencepost_core::{
    map::{Cell, CellState},
    surfaces::SurfaceClass,
};

use crate::{
    detector::{CELLS, OBSTACLES},
    error::Failure,
    view::FrameView,
};

/// Looks at a frame that the core has rectified and matched, and says in its own way what is ground and what is in the way.
pub trait Reference: fmt::Debug {
    /// Looks at a frame.
    ///
    /// # Errors
    /// When it cannot say anything about the frame.
    fn look(&self, view: &FrameView<'_>) -> Result<Seen, Failure>;
}

/// What a [`Reference`] sees in a frame.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Class of each pixel of the left rectified picture, row by row.
    pub classes: Vec<SurfaceClass>,
    /// The cells, in the order of [`fencepost_core::map::MapGeometry::index`] of the view's map.
    pub cells: Vec<Cell>,
    /// Most memory that it held at once, bytes.
    pub memory_bytes: usize,
}

type Detection = fencepost_core::detector::Detection<OBSTACLES, CELLS>;

impl Seen {
    /// What the core says of the frame, with these cells in place of its own and no list of obstacles.
    pub fn over(&self, detection: &Detection) -> Box<Detection> {
        let mut own = Box::new(detection.clone());
        own.obstacles.clear();
        for (to, from) in own.map.cells.iter_mut().zip(&self.cells) {
            *to = *from;
        }
        let count = |state| own.map.cells.iter().filter(|cell| cell.state == state).count() as u32;
        (own.statistics.cells_obstacle, own.statistics.cells_free) =
            (count(CellState::Obstacle), count(CellState::Free));
        own
    }

    /// Class of the pixel at column `x` and row `y` of a picture of this `width`.
    pub fn class_at(&self, x: usize, y: usize, width: usize) -> Option<SurfaceClass> {
        (x < width).then(|| self.classes.get(y * width + x).copied()).flatten()
    }
}
