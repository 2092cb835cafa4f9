//! The rows under the window, as they come in.

use super::{MatchCost, MatchSettings, census, prefilter};

/// Filtered rows that are kept: the window, and the one that leaves it.
pub(super) const KEPT: usize = MatchSettings::MAX_WINDOW as usize + 1;

/// Grey rows that are kept for the filters.
const GREY: usize = census::ROWS;

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
    /// Census codes; all 0 where absolute differences are compared.
    pub(super) left_codes: &'a [u8],
    pub(super) right_codes: &'a [u8],
}

impl<'a> FilteredRow<'a> {
    /// What absolute differences are taken of, left and right.
    pub(super) const fn grey(self) -> (&'a [u8], &'a [u8]) {
        (self.left, self.right)
    }

    /// What Hamming distances are taken of, left and right.
    pub(super) const fn codes(self) -> (&'a [u8], &'a [u8]) {
        (self.left_codes, self.right_codes)
    }
}

#[derive(Clone, Copy)]
struct Kept<const WIDTH: usize> {
    left: [u8; WIDTH],
    right: [u8; WIDTH],
    texture: [u8; WIDTH],
    saturated: [u8; WIDTH],
    left_codes: [u8; WIDTH],
    right_codes: [u8; WIDTH],
    spans: (ValidSpan, ValidSpan),
}

/// Rings of grey and filtered rows. A filtered row is complete when the grey rows below that it needs have come.
pub(super) struct Rows<const WIDTH: usize> {
    grey_left: [[u8; WIDTH]; GREY],
    grey_right: [[u8; WIDTH]; GREY],
    grey_spans: [(ValidSpan, ValidSpan); GREY],
    kept: [Kept<WIDTH>; KEPT],
    pushed: usize,
    /// Rows above and below that a filtered row is made from.
    reach: usize,
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
                left_codes: [0; WIDTH],
                right_codes: [0; WIDTH],
                spans: (ValidSpan::EMPTY, ValidSpan::EMPTY),
            }; KEPT],
            pushed: 0,
            reach: 0,
        }
    }

    /// Starts a picture whose filtered rows are made from `reach` rows above and below.
    pub(super) fn begin(&mut self, reach: usize) {
        self.pushed = 0;
        self.reach = reach.min(census::REACH);
    }

    /// Number of grey rows that have come.
    pub(super) const fn pushed(&self) -> usize {
        self.pushed
    }

    /// Number of the first row that is filtered: those above it have too few rows above them.
    pub(super) const fn first_filtered(&self) -> usize {
        self.reach
    }

    /// Number of the newest filtered row.
    pub(super) fn newest_filtered(&self) -> Option<usize> {
        self.pushed.checked_sub(self.reach + 1).filter(|&y| y >= self.reach)
    }

    pub(super) fn push(
        &mut self,
        left: &[u8],
        right: &[u8],
        left_span: ValidSpan,
        right_span: ValidSpan,
        settings: &MatchSettings,
    ) {
        let slot = self.pushed % GREY;
        let width = left.len();
        self.grey_left[slot][..width].copy_from_slice(left);
        self.grey_right[slot][..width].copy_from_slice(right);
        self.grey_spans[slot] = (left_span, right_span);
        self.pushed += 1;
        let Some(y) = self.newest_filtered() else { return };
        let Self { grey_left, grey_right, grey_spans, kept, reach, .. } = self;
        let kept = &mut kept[y % KEPT];
        for (grey, filtered, codes) in [
            (&*grey_left, &mut kept.left[..width], &mut kept.left_codes[..width]),
            (&*grey_right, &mut kept.right[..width], &mut kept.right_codes[..width]),
        ] {
            // The ring holds rows y - 3 to y + 3; those that a filter does not reach may be missing.
            let rows: [&[u8]; GREY] = core::array::from_fn(|i| &grey[(y + GREY + i - census::REACH) % GREY][..width]);
            let [_, _, above, middle, below, _, _] = rows;
            prefilter::filter(settings.prefilter, above, middle, below, filtered);
            if settings.cost == MatchCost::Census {
                census::codes(rows, codes);
            }
        }
        for (out, grey) in kept.saturated[..width].iter_mut().zip(&grey_left[y % GREY][..width]) {
            *out = u8::from(SATURATED.contains(grey));
        }
        let before = core::iter::once(&kept.left[0]).chain(&kept.left[..width]);
        for ((out, &filtered), &before) in kept.texture[..width].iter_mut().zip(&kept.left[..width]).zip(before) {
            *out = prefilter::response(settings.prefilter, filtered, before);
        }
        kept.spans = (y - *reach..=y + *reach).map(|y| grey_spans[y % GREY]).fold(EVERYTHING, both);
    }

    /// Filtered row `y`, which must be among the last [`KEPT`].
    pub(super) fn filtered(&self, y: usize, width: usize) -> FilteredRow<'_> {
        let kept = &self.kept[y % KEPT];
        FilteredRow {
            left: &kept.left[..width],
            right: &kept.right[..width],
            texture: &kept.texture[..width],
            saturated: &kept.saturated[..width],
            left_codes: &kept.left_codes[..width],
            right_codes: &kept.right_codes[..width],
        }
    }

    /// Columns that are valid in all filtered rows within `radius - 1` of row `y`, left and right.
    pub(super) fn spans(&self, y: usize, radius: usize) -> (ValidSpan, ValidSpan) {
        let first = (y + 1).saturating_sub(radius);
        (first..y + radius).map(|y| self.kept[y % KEPT].spans).fold(EVERYTHING, both)
    }
}

/// Spans of the left and right row that take nothing away.
const EVERYTHING: (ValidSpan, ValidSpan) =
    (ValidSpan { start: 0, end: u16::MAX }, ValidSpan { start: 0, end: u16::MAX });

fn both(all: (ValidSpan, ValidSpan), row: (ValidSpan, ValidSpan)) -> (ValidSpan, ValidSpan) {
    (all.0.intersect(row.0), all.1.intersect(row.1))
}
