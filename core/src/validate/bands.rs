//! Small surfaces taken out by several threads, each in rows of its own.
//!
//! A surface that lies within a band is that band's alone. One that touches the rows at a seam may go on behind it: those are looked
//! at first, each from the seam on until it is gone through or known to be large enough. The bands then leave what touches a seam as
//! it is. Surfaces do not share pixels, so that it does not matter in which order they are taken out.

use heapless::Vec;

use super::{MAX_SURFACE_PX, Rows, Step, SurfaceSize};
use crate::{
    arch,
    bands::{Work, Workers, cut, run_all},
    disparity::{DisparityPixel, Reason},
};

/// Rows that bands are cut between multiples of.
const UNIT: usize = 8;

impl<const WIDTH: usize> SurfaceSize<WIDTH> {
    /// As [`Self::run`], with the same result to the bit, in as many bands as there are `stages` and one more.
    pub(crate) fn run_in_bands(
        &mut self,
        picture: &mut [DisparityPixel],
        stages: &mut [&mut Self],
        workers: &mut impl Workers,
    ) {
        if self.settings.min_surface_px <= 1 || self.width == 0 {
            return;
        }
        let height = picture.len() / self.width.max(1);
        let bands = cut(height, stages.len().saturating_add(1), UNIT);
        for rows in bands.clone().filter(|rows| !rows.is_empty()) {
            // The first band has no seam above it.
            let (seam, Some(above)) = (rows.start, rows.start.checked_sub(1)) else { continue };
            self.settle_row(picture, above, None);
            self.settle_row(picture, seam, Some(above));
        }
        for stage in stages.iter_mut() {
            (stage.settings, stage.width, stage.chosen) = (self.settings, self.width, self.chosen);
        }
        let width = self.width;
        let mut rest = picture;
        let stages = core::iter::once(self).chain(stages.iter_mut().map(|stage| &mut **stage));
        let jobs = bands.zip(stages).map(|(rows, stage)| {
            let picture = rest.split_off_mut(..rows.len().saturating_mul(width)).unwrap_or_default();
            RowsOfBand { stage, picture, seams: [rows.start > 0, rows.end < height] }
        });
        run_all(workers, jobs);
    }

    /// Takes out the small surfaces that touch row `y`. Of those in `settled`, a row beside it, what is left is known to be large.
    ///
    /// # Bound
    /// For each run of the row as many pixels as the smallest surface that is kept has.
    fn settle_row(&mut self, picture: &mut [DisparityPixel], y: usize, settled: Option<usize>) {
        let (width, reach) = (self.width, self.settings.step_sixteenths);
        let steps_at = |picture: &[DisparityPixel], x: usize, y: usize| {
            picture.get(place_of(x, y, width)).map_or(0, |p| p.steps())
        };
        let near = |a: u16, b: u16| a != 0 && b != 0 && a.abs_diff(b) <= reach;
        let mut start = 0;
        while start < width {
            let (mut last, mut end) = (start, start.saturating_add(1));
            while end < width && near(steps_at(picture, last, y), steps_at(picture, end, y)) {
                (last, end) = (end, end.saturating_add(1));
            }
            let large = end.saturating_sub(start) >= usize::from(self.settings.min_surface_px)
                || settled.is_some_and(|above| {
                    (start..end).any(|x| near(steps_at(picture, x, above), steps_at(picture, x, y)))
                });
            if steps_at(picture, start, y) != 0 && !large {
                self.settle(picture, (start as u16, y as u16));
            }
            start = end;
        }
    }

    /// Takes out the surface of a pixel if it is small.
    fn settle(&mut self, picture: &mut [DisparityPixel], (x, y): (u16, u16)) {
        let (width, reach) = (self.width, self.settings.step_sixteenths);
        let enough = usize::from(self.settings.min_surface_px);
        let none = DisparityPixel::none(Reason::SmallSurface);
        let walk = &mut self.walk;
        walk.clear();
        let mut visit = |walk: &mut Vec<Step, MAX_SURFACE_PX>, x: u16, y: u16, from: Option<u16>| {
            let (column, row) = (usize::from(x), usize::from(y));
            let Some(pixel) = picture.get_mut(place_of(column, row, width)).filter(|_| column < width) else { return };
            let steps = pixel.steps();
            if steps != 0
                && from.is_none_or(|from| steps.abs_diff(from) <= reach)
                && walk.push(Step { x, y, steps }).is_ok()
            {
                *pixel = none;
            }
        };
        visit(walk, x, y, None);
        let mut next = 0;
        // All that was visited is kept, to be put back.
        while let Some(&Step { x, y, steps }) = walk.get(next).filter(|_| walk.len() < enough) {
            next = next.saturating_add(1);
            visit(walk, x.saturating_add(1), y, Some(steps));
            visit(walk, x, y.saturating_add(1), Some(steps));
            if let Some(x) = x.checked_sub(1) {
                visit(walk, x, y, Some(steps));
            }
            if let Some(y) = y.checked_sub(1) {
                visit(walk, x, y, Some(steps));
            }
        }
        if walk.len() >= enough {
            for &Step { x, y, steps } in walk.iter() {
                if let Some(pixel) = picture.get_mut(place_of(usize::from(x), usize::from(y), width)) {
                    *pixel = DisparityPixel::from_steps(steps);
                }
            }
        }
    }
}

/// Place of a pixel in a picture of rows of `width`.
const fn place_of(x: usize, y: usize, width: usize) -> usize {
    y.saturating_mul(width).saturating_add(x)
}

/// The rows of a band, whose surfaces at a seam are settled.
struct RowsOfBand<'a, const WIDTH: usize> {
    stage: &'a mut SurfaceSize<WIDTH>,
    picture: &'a mut [DisparityPixel],
    seams: [bool; 2],
}

impl<const WIDTH: usize> Work for RowsOfBand<'_, WIDTH> {
    fn work(&mut self) {
        let Self { stage, picture, seams } = self;
        arch::compiled(stage.chosen, Rows { stage, picture, seams: *seams });
    }
}

#[cfg(test)]
#[path = "bands_tests.rs"]
mod tests;
