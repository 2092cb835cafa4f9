//! Pictures made small enough to be cut.

use fencepost_core::{disparity::DisparityPicture, picture::Picture};

/// A pair of pictures shrunk by a whole number.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shrunk {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Pixels of the whole picture along the edge of one of these.
    pub(super) factor: usize,
    /// Mean grey value of each pixel.
    pub(super) grey: Vec<f64>,
    /// Median disparity of each pixel, px of the whole picture, where a quarter of its pixels has one.
    pub(super) disparity_px: Vec<Option<f64>>,
}

impl Shrunk {
    /// Shrinks to at most `width_px`. Rows and columns that do not fill a pixel make a smaller one.
    pub(super) fn new(left: &Picture<'_>, disparity: DisparityPicture<'_>, width_px: usize) -> Self {
        let (whole_width, whole_height) = (disparity.width(), disparity.height());
        let factor = whole_width.div_ceil(width_px).max(1);
        let (width, height) = (whole_width.div_ceil(factor), whole_height.div_ceil(factor));
        let mut shrunk = Self { width, height, factor, grey: Vec::new(), disparity_px: Vec::new() };
        let mut steps = Vec::with_capacity(factor * factor);
        for y in 0..height {
            for x in 0..width {
                let columns = x * factor..((x + 1) * factor).min(whole_width);
                let rows = y * factor..((y + 1) * factor).min(whole_height);
                let count = columns.len() * rows.len();
                let mut grey = 0;
                steps.clear();
                for row in rows {
                    grey += left.row(row)[columns.clone()].iter().map(|pixel| u32::from(*pixel)).sum::<u32>();
                    let seen = disparity.row(row)[columns.clone()].iter().filter(|pixel| pixel.has_value());
                    steps.extend(seen.map(|pixel| pixel.steps()));
                }
                steps.sort_unstable();
                let median = steps.get(steps.len() / 2).filter(|_| 4 * steps.len() >= count);
                shrunk.grey.push(f64::from(grey) / count as f64);
                shrunk.disparity_px.push(median.map(|steps| f64::from(*steps) / 16.0));
            }
        }
        shrunk
    }

    /// The pixel that a pixel of the whole picture went into.
    pub(super) const fn place_of(&self, x: usize, y: usize) -> usize {
        y / self.factor * self.width + x / self.factor
    }
}
