//! Rectification and matching of a band of rows.

use core::ops::Range;

use crate::{
    bands::Work,
    disparity::DisparityPixel,
    health::{Exposure, Ordinals, RowLooks, rows_around},
    matching::{MatchSettings, Matcher, ValidSpan},
    picture::Picture,
    rectify::{Rectifier, Side},
};

/// The rows of a band, as they are numbered in the picture.
pub(super) struct BandRows {
    /// Rows whose disparities are wanted.
    pub(super) out: Range<usize>,
    /// Rows that the matcher sees: those and what the window and the look at the strips need around them.
    seen: Range<usize>,
}

impl BandRows {
    /// Of a picture with `height` rows.
    pub(super) fn new(out: Range<usize>, height: usize, settings: &MatchSettings) -> Self {
        let [_, margin] = settings.margins();
        let around = rows_around(height, &out, settings.reach());
        let [above, below] = around.map(|rows| rows.max(margin));
        let seen = out.start.saturating_sub(above)..out.end.saturating_add(below).min(height);
        Self { seen: if out.is_empty() { out.clone() } else { seen }, out }
    }
}

/// Rectifies and matches the rows of a band.
///
/// The matcher takes the rows that it sees for a picture of its own. They reach beyond those that are wanted by as much as the
/// disparities of these depend on, unless the picture itself ends there.
pub(super) struct MatchBand<'a, const WIDTH: usize, const DISPARITIES: usize, const GRID: usize> {
    pub(super) rectifier: &'a Rectifier<GRID>,
    pub(super) pictures: [&'a Picture<'a>; 2],
    /// Room for a row of both rectified pictures.
    pub(super) pair: &'a mut [[u8; WIDTH]; 2],
    pub(super) matcher: &'a mut Matcher<WIDTH, DISPARITIES>,
    pub(super) looks: &'a mut RowLooks<WIDTH>,
    pub(super) ordinals: Option<&'a mut Ordinals>,
    pub(super) rows: BandRows,
    pub(super) width: usize,
    /// The rows that are wanted.
    pub(super) disparity: &'a mut [DisparityPixel],
    /// How the left and the right picture are exposed, where that is for this band to see.
    pub(super) exposed: [Option<Exposure>; 2],
}

impl<const WIDTH: usize, const DISPARITIES: usize, const GRID: usize> Work for MatchBand<'_, WIDTH, DISPARITIES, GRID> {
    fn work(&mut self) {
        for (exposed, picture) in self.exposed.iter_mut().zip(self.pictures) {
            if let Some(exposed) = exposed {
                *exposed = Exposure::of(picture);
            }
        }
        let Self { rectifier, pictures, pair, matcher, looks, ordinals, rows, width, disparity, .. } = self;
        let (BandRows { out, seen }, width) = (&*rows, *width);
        matcher.set_height(seen.len());
        matcher.begin();
        let [left_row, right_row] = &mut **pair;
        let left_row = left_row.get_mut(..width).unwrap_or_default();
        let right_row = right_row.get_mut(..width).unwrap_or_default();
        let mut next = out.start;
        for y in seen.clone() {
            let left_span = rectifier.row(Side::Left, pictures[0], y, left_row);
            let right_span = rectifier.row(Side::Right, pictures[1], y, right_row);
            let spans = [ValidSpan::from(left_span), ValidSpan::from(right_span)];
            matcher.push(left_row, right_row, spans[0], spans[1]);
            while let Some(row) = row_of(disparity, next.saturating_sub(out.start), width) {
                if !matcher.pull(next.saturating_sub(seen.start), row) {
                    break;
                }
                next = next.saturating_add(1);
            }
            if out.contains(&y) {
                looks.push(y, [left_row, right_row], spans);
            }
            looks.look((matcher, seen.start), (disparity, out.start), width, next, ordinals.as_deref_mut());
        }
    }
}

/// Row `y` of a picture of rows of `width`.
fn row_of(picture: &mut [DisparityPixel], y: usize, width: usize) -> Option<&mut [DisparityPixel]> {
    let start = y.saturating_mul(width);
    picture.get_mut(start..start.saturating_add(width))
}
