//! The health apart from the other stages, in whose rows it looks otherwise: for `fencepost-bounds`, which finds out what each stage
//! takes by itself.

use super::{Detection, Detector};
use crate::{health::Exposure, matching::ValidSpan, picture::Picture};

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
    /// Begins to look at a pair of pictures, as [`Self::detect`] does.
    ///
    /// # Bound
    /// The clearing of some tables.
    pub fn begin_health(&mut self, width: usize, height: usize) {
        self.content.begin(width, height, self.search_range());
    }

    /// Looks at row `y` of both rectified pictures, as [`Self::detect`] does; down to row `done` there are disparities, rows of `width`.
    ///
    /// # Bound
    /// Three passes over each of the rows, and in all of them together the matches of all strips.
    pub fn look_at_rows(&mut self, y: usize, rows: [&[u8]; 2], spans: [ValidSpan; 2], (width, done): (usize, usize)) {
        self.content.push(y, rows, spans);
        self.content.look(&self.matcher, &self.disparity, width, done);
    }

    /// Says how far what was found can be trusted, as [`Self::detect`] does; `None` before [`Self::configure`].
    ///
    /// # Bound
    /// A sixteenth of both pictures, half of the disparity picture, and the matching of a few strips.
    pub fn judge_health(&mut self, left: &Picture<'_>, right: &Picture<'_>) -> Option<&Detection<OBSTACLES, CELLS>> {
        let setup = self.setup?;
        let exposures = [Exposure::of(left), Exposure::of(right)];
        Some(self.judge(left, right, &setup, exposures))
    }
}
