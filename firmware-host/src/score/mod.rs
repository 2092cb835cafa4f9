//! How good cells and disparities are, where a recording brings the truth: figures to compare detectors and settings by.
//!
//! ```text
//! velodyne/, Tr in calib.txt ──> road ──> lidar ──> cells ───────┐
//!                               plane    true      recall, ...   ├──> Scores
//! disp_occ_0/ ─────────────────────────────────> disparity ──────┘
//!                                                density, ...
//! ```
//!
//! The rules are those by which the field scores such recordings with numpy, so that figures can be set beside those of others;
//! the tests hold them against an implementation there. They are no settings: other rules would be another truth.

mod cells;
mod disparity;
mod draws;
mod figures;
mod lidar;
mod mistakes;
mod road;
mod truth;

pub use cells::{CellCounts, CellScore, Said};
pub use disparity::{DisparityCounts, DisparityScore};
pub use figures::{CELL_FIGURES, DISPARITY_FIGURES, Figure};
pub use lidar::{TrueCells, true_cells};
pub use mistakes::{Mistake, mistakes};
pub use road::NoRoad;
pub use truth::RecordedTruth;

use std::sync::Arc;

use fencepost_core::{disparity::DisparityPicture, map::MapGeometry};
use serde::Serialize;

use crate::{output::CellRow, paint};

/// A cell, counted from the origin along x and y: it covers `[i, i + 1) x [j, j + 1)` times the cell size.
pub type CellIndex = (i32, i32);

/// What a run is worth against the truth of its recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Scores {
    /// Cells against lidar sweeps.
    pub cells: Option<CellScore>,
    /// Disparity against truth.
    pub disparity: Option<DisparityScore>,
}

/// Scores a run frame by frame.
#[derive(Debug)]
pub struct Scorer {
    truth: Arc<RecordedTruth>,
    geometry: MapGeometry,
    cells: CellCounts,
    disparity: DisparityCounts,
    complaints: Vec<String>,
}

impl Scorer {
    /// For a run whose map has this `geometry`.
    pub fn new(truth: Arc<RecordedTruth>, geometry: MapGeometry) -> Self {
        let (cells, disparity) = (CellCounts::default(), DisparityCounts::default());
        Self { truth, geometry, cells, disparity, complaints: Vec::new() }
    }

    /// Takes what was found in a frame: the cells that go on the bus, and the disparity. Returns the counts of its cells.
    pub fn frame(&mut self, number: u32, rows: &[CellRow], disparity: DisparityPicture<'_>) -> Option<CellCounts> {
        match self.truth.disparity_of(number) {
            Ok(Some(truth)) => {
                let found = paint::disparity16(disparity);
                let sizes = [(truth.width, truth.height), (disparity.width(), disparity.height())];
                if let Err(complaint) = self.disparity.frame(number, &truth.pixels, &found, sizes) {
                    self.complaints.push(complaint);
                }
            }
            Ok(None) => {}
            Err(complaint) => self.complaints.push(complaint),
        }
        self.take_cells(number, &Said::of(rows))
    }

    /// A frame that could not be used: nothing was said of its cells.
    pub fn missing(&mut self, number: u32) {
        self.take_cells(number, &Said::default());
    }

    fn take_cells(&mut self, number: u32, said: &Said) -> Option<CellCounts> {
        match self.truth.cells_of(number, self.geometry.cell_size_mm) {
            Ok(truth) => {
                let counts = CellCounts::of_frame(truth?.as_ref(), said);
                self.cells += counts;
                Some(counts)
            }
            Err(complaint) => {
                self.complaints.push(complaint);
                None
            }
        }
    }

    /// What was wrong with the truth since the last call: whole sentences, with file and mend.
    pub fn take_complaints(&mut self) -> Vec<String> {
        std::mem::take(&mut self.complaints)
    }

    /// The figures over all frames so far; `None` where no frame had any truth.
    pub fn scores(&self) -> Option<Scores> {
        let scores = Scores { cells: self.cells.score(), disparity: self.disparity.score() };
        (scores != Scores::default()).then_some(scores)
    }
}

fn share(part: u64, whole: u64) -> f64 {
    part as f64 / whole.max(1) as f64
}
