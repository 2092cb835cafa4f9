//! Disparity pictures straight into the stages behind the matcher: for fuzzing, where no pair of pictures leads to most of them.

use super::{DetectError, Detection, Detector, Probe, Stage, interpreter::Alone, picture_of};
use crate::{disparity::DisparityPixel, map::SectorDistances};

impl<
    const PIXELS: usize,
    const WIDTH: usize,
    const DISPARITIES: usize,
    const GRID: usize,
    const SURFACES: usize,
    const OBSTACLES: usize,
    const CELLS: usize,
> Detector<PIXELS, WIDTH, DISPARITIES, GRID, SURFACES, OBSTACLES, CELLS>
{
    /// Looks at a disparity picture in place of one that is matched: rows of the width of the rectified pair, any bits. Nothing is
    /// known of the cameras then, so that the health says nothing; it is no way to drive by.
    ///
    /// # Errors
    /// [`DetectError`]; the detection is empty then.
    ///
    /// # Bound
    /// That of [`Self::detect`] without the matching.
    pub fn interpret(
        &mut self,
        pixels: &[DisparityPixel],
        probe: &mut impl Probe,
    ) -> Result<&Detection<OBSTACLES, CELLS>, DetectError> {
        self.detection.clear();
        let Some(setup) = self.setup else { return Err(DetectError::NotConfigured) };
        let (width, height) = (setup.pair.width as usize, setup.pair.height as usize);
        let disparity = self.disparity.get_mut(..width.saturating_mul(height)).unwrap_or_default();
        if pixels.len() != disparity.len() {
            let found = (width, pixels.len().checked_div(width).unwrap_or(0));
            return Err(DetectError::WrongSize { found, expected: (width, height) });
        }
        disparity.iter_mut().zip(pixels).for_each(|(to, from)| *to = *from);
        probe.enter(Stage::Validate);
        self.surface_size.run(disparity);
        let picture = picture_of(&self.disparity, width, height);
        self.interpreter.run(picture, &setup, &mut self.detection, &mut Alone, probe);
        self.detection.sectors = SectorDistances::of(&self.detection.map, setup.sector_width_deg);
        Ok(&self.detection)
    }
}
