//! The rows under the window, as they come in.

use super::{MatchSettings, Prefilter, prefilter};

/// Filtered rows that are kept: the window, and the one that leaves it.
pub(super) const KEPT: usize = MatchSettings::MAX_WINDOW as usize + 1;

/// Grey rows that are kept for the filter.
const GREY: usize = 3;

/// Grey values that the camera cannot be trusted to have measured.
pub(super) const SATURATED: [u8; 2] = [0, 255];

/// Columns of a rectified row that show something: `start..end`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ValidSpan {
    /// First valid column.
    pub start: u16,
    /// One past the last valid column.
    pub end: u16,
}

impl ValidSpan {
    /// Nothing valid.
    pub const EMPTY: Self = Self { start: 0, end: 0 };

    /// What is valid in both.
    pub fn intersect(self, other: Self) -> Self {
        Self { start: self.start.max(other.start), end: self.end.min(other.end) }
    }
}

impl From<core::ops::Range<usize>> for ValidSpan {
    fn from(span: core::ops::Range<usize>) -> Self {
        let place = |x: usize| x.min(usize::from(u16::MAX)) as u16;
        Self { start: place(span.start), end: place(span.end) }
    }
}

/// One filtered row of the pair.
#[derive(Clone, Copy)]
pub(super) struct FilteredRow<'a> {
    pub(super) left: &'a [u8],
    pub(super) right: &'a [u8],
    /// Response of the left filter: texture.
    pub(super) texture: &'a [u8],
    /// 1 where the left grey value is saturated.
    pub(super) saturated: &'a [u8],
}

#[derive(Clone, Copy)]
struct Kept<const WIDTH: usize> {
    left: [u8; WIDTH],
    right: [u8; WIDTH],
    texture: [u8; WIDTH],
    saturated: [u8; WIDTH],
    spans: (ValidSpan, ValidSpan),
}

/// Rings of grey and filtered rows. A filtered row is complete when the grey row below it has come.
pub(super) struct Rows<const WIDTH: usize> {
    grey_left: [[u8; WIDTH]; GREY],
    grey_right: [[u8; WIDTH]; GREY],
    grey_spans: [(ValidSpan, ValidSpan); GREY],
    kept: [Kept<WIDTH>; KEPT],
    pushed: usize,
}

impl<const WIDTH: usize> Rows<WIDTH> {
    pub(super) const fn new() -> Self {
        Self {
            grey_left: [[0; WIDTH]; GREY],
            grey_right: [[0; WIDTH]; GREY],
            grey_spans: [(ValidSpan::EMPTY, ValidSpan::EMPTY); GREY],
            kept: [Kept {
                left: [0; WIDTH],
                right: [0; WIDTH],
                texture: [0; WIDTH],
                saturated: [0; WIDTH],
                spans: (ValidSpan::EMPTY, ValidSpan::EMPTY),
            }; KEPT],
            pushed: 0,
        }
    }

    pub(super) fn begin(&mut self) {
        self.pushed = 0;
    }

    /// Number of grey rows that have come.
    pub(super) const fn pushed(&self) -> usize {
        self.pushed
    }

    /// Number of the newest filtered row. Row 0 has no row above it and is never filtered.
    pub(super) fn newest_filtered(&self) -> Option<usize> {
        self.pushed.checked_sub(2).filter(|&y| y > 0)
    }

    pub(super) fn push(
        &mut self,
        left: &[u8],
        right: &[u8],
        left_span: ValidSpan,
        right_span: ValidSpan,
        kind: Prefilter,
    ) {
        let slot = self.pushed % GREY;
        let width = left.len();
        self.grey_left[slot][..width].copy_from_slice(left);
        self.grey_right[slot][..width].copy_from_slice(right);
        self.grey_spans[slot] = (left_span, right_span);
        self.pushed += 1;
        let Some(y) = self.newest_filtered() else { return };
        let kept = &mut self.kept[y % KEPT];
        let [above, middle, below] = [(y - 1) % GREY, y % GREY, (y + 1) % GREY];
        let grey = &self.grey_left;
        prefilter::filter(
            kind,
            &grey[above][..width],
            &grey[middle][..width],
            &grey[below][..width],
            &mut kept.left[..width],
        );
        for (out, grey) in kept.saturated[..width].iter_mut().zip(&grey[middle][..width]) {
            *out = u8::from(SATURATED.contains(grey));
        }
        let grey = &self.grey_right;
        prefilter::filter(
            kind,
            &grey[above][..width],
            &grey[middle][..width],
            &grey[below][..width],
            &mut kept.right[..width],
        );
        let before = core::iter::once(&kept.left[0]).chain(&kept.left[..width]);
        for ((out, &filtered), &before) in kept.texture[..width].iter_mut().zip(&kept.left[..width]).zip(before) {
            *out = prefilter::response(kind, filtered, before);
        }
        let [a, m, b] = [self.grey_spans[above], self.grey_spans[middle], self.grey_spans[below]];
        kept.spans = (a.0.intersect(m.0).intersect(b.0), a.1.intersect(m.1).intersect(b.1));
    }

    /// Filtered row `y`, which must be among the last [`KEPT`].
    pub(super) fn filtered(&self, y: usize, width: usize) -> FilteredRow<'_> {
        let kept = &self.kept[y % KEPT];
        FilteredRow {
            left: &kept.left[..width],
            right: &kept.right[..width],
            texture: &kept.texture[..width],
            saturated: &kept.saturated[..width],
        }
    }

    /// Columns that are valid in all filtered rows within `radius - 1` of row `y`, left and right.
    pub(super) fn spans(&self, y: usize, radius: usize) -> (ValidSpan, ValidSpan) {
        let first = (y + 1).saturating_sub(radius);
        (first..y + radius)
            .map(|y| self.kept[y % KEPT].spans)
            .fold((ValidSpan { start: 0, end: u16::MAX }, ValidSpan { start: 0, end: u16::MAX }), |all, row| {
                (all.0.intersect(row.0), all.1.intersect(row.1))
            })
    }
}
