//! The program's detector: one for every camera up to 2048 x 1536, in memory that is there from the start.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::live::MAX_PAIRS;
use fencepost_core::{detector::Detector, rectify::grid_nodes};

/// Most pixels of a picture.
pub const PIXELS: usize = 2048 * 1536;
/// Largest width of a picture, px.
pub const WIDTH: usize = 2048;
/// Most disparities searched.
pub const DISPARITIES: usize = 256;
/// Nodes of the rectification map of each camera.
pub const GRID: usize = grid_nodes(2048, 1536);
/// Most surfaces of a frame.
pub const SURFACES: usize = 32768;
/// Most obstacles of a frame.
pub const OBSTACLES: usize = 256;
/// Most cells of a map: as many as the bus can name.
pub const CELLS: usize = 16384;

/// The program's detector.
pub type ProgramDetector = Detector<PIXELS, WIDTH, DISPARITIES, GRID, SURFACES, OBSTACLES, CELLS>;

/// One for each pair of a rig. All zero until they are configured: pages that smaller pictures do not touch never become
/// memory.
static DETECTORS: [Mutex<ProgramDetector>; MAX_PAIRS] = [const { Mutex::new(ProgramDetector::new()) }; MAX_PAIRS];

/// The first detector, for one run at a time.
pub fn lock() -> MutexGuard<'static, ProgramDetector> {
    lock_one(0)
}

/// The detector of the pair `index`, below [`MAX_PAIRS`], for one run at a time.
pub fn lock_one(index: usize) -> MutexGuard<'static, ProgramDetector> {
    // `configure` forgets everything, so what a run that panicked left behind does no harm.
    DETECTORS[index].lock().unwrap_or_else(PoisonError::into_inner)
}

/// Largest picture, for people.
pub fn capacity_in_words() -> String {
    format!("{WIDTH} px width and {PIXELS} pixels, such as {WIDTH} x {}", PIXELS / WIDTH)
}
