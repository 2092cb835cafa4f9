//! The truth of a recording, read when it is asked for.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

use fencepost_hal::{
    calibration::LidarCalibration,
    recording::{Recording, TrueDisparity, Truth},
};

use super::{TrueCells, true_cells};

/// The truth of a recording. Cells that were worked out once are kept: several detectors are judged by them.
#[derive(Debug)]
pub struct RecordedTruth {
    files: Truth,
    lidar: Option<LidarCalibration>,
    picture_size: (u32, u32),
    cells: Mutex<BTreeMap<(u32, u16), Arc<TrueCells>>>,
}

impl RecordedTruth {
    /// The truth beside the pictures of a recording, if there is any, and what is odd about it.
    pub fn of(recording: &Recording) -> (Option<Self>, Option<String>) {
        let files = recording.truth.clone();
        let (lidar, complaint) = match (&files.lidar, LidarCalibration::read(&recording.folder)) {
            (Some(_), Ok(Some(lidar))) => (Some(lidar), None),
            (Some(sweeps), Ok(None)) => (
                None,
                Some(format!(
                    "{}: is not used, because nothing says how the lidar sits to the cameras; add `Tr:` to calib.txt",
                    sweeps.display()
                )),
            ),
            (Some(_), Err(error)) => (None, Some(format!("{error}; the sweeps are not used"))),
            (None, _) => (None, None),
        };
        if lidar.is_none() && files.disparity.is_none() {
            return (None, complaint);
        }
        let truth = Self { files, lidar, picture_size: recording.picture_size(), cells: Mutex::default() };
        (Some(truth), complaint)
    }

    /// Whether there are lidar sweeps to judge cells by.
    pub const fn has_lidar(&self) -> bool {
        self.lidar.is_some()
    }

    /// What is really in the cells of a frame, where there is a sweep of it.
    ///
    /// # Errors
    /// A sentence with file and mend.
    pub fn cells_of(&self, frame: u32, cell_size_mm: u16) -> Result<Option<Arc<TrueCells>>, String> {
        let Some(lidar) = &self.lidar else { return Ok(None) };
        let key = (frame, cell_size_mm);
        let known = || self.cells.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(cells) = known().get(&key) {
            return Ok(Some(cells.clone()));
        }
        let Some(sweep) = self.files.sweep_of(frame).map_err(|error| not_judged(&error))? else { return Ok(None) };
        let cells = true_cells(&sweep, lidar, self.picture_size, cell_size_mm).map_err(|no_road| {
            not_judged(&format_args!("frame {frame}: the sweep {no_road}; check `Tr:` in calib.txt, or take it away"))
        })?;
        let cells = Arc::new(cells);
        known().insert(key, cells.clone());
        Ok(Some(cells))
    }

    /// What the disparity of a frame really is, where there is a file of it.
    ///
    /// # Errors
    /// A sentence with file and mend.
    pub fn disparity_of(&self, frame: u32) -> Result<Option<TrueDisparity>, String> {
        self.files.disparity_of(frame).map_err(|error| not_judged(&error))
    }
}

fn not_judged(what: &dyn std::fmt::Display) -> String {
    format!("{what} (without it this frame is not scored)")
}
