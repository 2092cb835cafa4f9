//! What a pair of cameras looks with.

use fencepost_core::{
    detector::{DetectError, Detection, Detector},
    picture::Picture,
};

use crate::{
    crew::Crew,
    detector::{CELLS, OBSTACLES, ProgramDetector},
};

/// What looks at the pictures of a pair.
pub trait Sight {
    /// Looks at a pair of pictures.
    ///
    /// # Errors
    /// Those of the detector.
    fn look(&mut self, left: &Picture<'_>, right: &Picture<'_>) -> Result<(), DetectError>;

    /// What was seen in the last pair that could be looked at.
    fn seen(&self) -> &Detection<OBSTACLES, CELLS>;

    /// Forgets what earlier pictures have shown.
    fn forget(&mut self);
}

impl<const PIXELS: usize, const WIDTH: usize, const DISPARITIES: usize, const GRID: usize, const SURFACES: usize> Sight
    for Detector<PIXELS, WIDTH, DISPARITIES, GRID, SURFACES, OBSTACLES, CELLS>
{
    fn look(&mut self, left: &Picture<'_>, right: &Picture<'_>) -> Result<(), DetectError> {
        self.detect(left, right, &mut ()).map(|_| ())
    }

    fn seen(&self) -> &Detection<OBSTACLES, CELLS> {
        self.detection()
    }

    fn forget(&mut self) {
        Self::forget(self);
    }
}

/// A detector of the program, with the threads that work for it.
pub(super) struct CrewedSight<'a> {
    pub(super) detector: &'a mut ProgramDetector,
    pub(super) crew: &'a mut Crew,
}

impl Sight for CrewedSight<'_> {
    fn look(&mut self, left: &Picture<'_>, right: &Picture<'_>) -> Result<(), DetectError> {
        self.crew.detect(self.detector, left, right, &mut ())
    }

    fn seen(&self) -> &Detection<OBSTACLES, CELLS> {
        self.detector.detection()
    }

    fn forget(&mut self) {
        self.detector.forget();
    }
}
