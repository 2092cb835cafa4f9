//! The rows under the window, as they come in.

use super::{MatchCost, MatchSettings, Prefilter, census, prefilter};
use crate::arch::{self, Chosen, CodeRow};

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

/// What is kept of a filtered row: one row of bytes for each kind.
#[derive(Clone, Copy)]
#[repr(usize)]
enum Kind {
    Left = 0,
    LeftCodes = 1,
    /// Census codes, or their lower four bits where the backend splits them.
    RightCodes = 2,
    /// Upper four bits of the right codes, where the backend splits them, and [`SATURATED_FLAG`] of the left picture.
    RightHigh = 3,
    Right = 4,
}

const KINDS: usize = 5;

/// Bytes in front of a row of right codes that can be read, in rows: those of the kinds before it.
pub(super) const LEAD_ROWS: usize = Kind::RightCodes as usize;

/// Set where the left grey value is saturated, in a bit that looking four bits up passes over.
pub(super) const SATURATED_FLAG: u8 = 0x10;

/// What says how much a row of the left picture can be relied on.
#[derive(Clone, Copy)]
pub(super) struct Evidence<'a> {
    filtered: &'a [u8],
    flags: &'a [u8],
    prefilter: Prefilter,
}

impl Evidence<'_> {
    /// Adds [`arch::evidence`] of every pixel to the sum of its column, or takes it away.
    #[inline(always)]
    pub(super) fn add_to(self, sums: &mut [u32], add: impl Fn(u32, u32) -> u32) {
        // The first pixel has none before it: it stands for it itself.
        let mut before = self.filtered.first().copied().unwrap_or_default();
        for (sum, (&here, &flags)) in sums.iter_mut().zip(self.filtered.iter().zip(self.flags)) {
            let response = prefilter::response(self.prefilter, here, before);
            *sum = add(*sum, arch::evidence(response, flags & SATURATED_FLAG != 0));
            before = here;
        }
    }
}

/// Rings of grey and filtered rows. A filtered row is complete when the grey rows below that it needs have come.
pub(super) struct Rows<const WIDTH: usize> {
    grey_left: [[u8; WIDTH]; GREY],
    grey_right: [[u8; WIDTH]; GREY],
    grey_spans: [(ValidSpan, ValidSpan); GREY],
    kept: [[[u8; WIDTH]; KINDS]; KEPT],
    kept_spans: [(ValidSpan, ValidSpan); KEPT],
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
            kept: [[[0; WIDTH]; KINDS]; KEPT],
            kept_spans: [(ValidSpan::EMPTY, ValidSpan::EMPTY); KEPT],
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
        self.pushed.checked_sub(self.reach.saturating_add(1)).filter(|&y| y >= self.reach)
    }

    #[inline(always)]
    pub(super) fn push(
        &mut self,
        left: &[u8],
        right: &[u8],
        left_span: ValidSpan,
        right_span: ValidSpan,
        settings: &MatchSettings,
        chosen: Chosen,
    ) {
        let split_codes = chosen.backend().splits_codes();
        let slot = self.pushed % GREY;
        let width = left.len();
        for (kept, row) in [(&mut self.grey_left[slot], left), (&mut self.grey_right[slot], right)] {
            copy(kept, row);
        }
        self.grey_spans[slot] = (left_span, right_span);
        self.pushed = self.pushed.saturating_add(1);
        let Some(y) = self.newest_filtered() else { return };
        let Self { grey_left, grey_right, grey_spans, kept, reach, .. } = self;
        let [kept_left, left_codes, right_codes, right_high, kept_right] = &mut kept[y % KEPT];
        for (grey, filtered, codes) in
            [(&*grey_left, kept_left, left_codes), (&*grey_right, kept_right, &mut *right_codes)]
        {
            // The ring holds rows y - 3 to y + 3; those that a filter does not reach may be missing.
            let rows: [&[u8]; GREY] = core::array::from_fn(|i| {
                let slot = (y % GREY).wrapping_add(i).wrapping_add(GREY - census::REACH) % GREY;
                grey[slot].get(..width).unwrap_or_default()
            });
            let [_, _, above, middle, below, _, _] = rows;
            prefilter::filter(settings.prefilter, above, middle, below, filtered.get_mut(..width).unwrap_or_default());
            if settings.cost == MatchCost::Census {
                census::codes(chosen, rows, codes.get_mut(..width).unwrap_or_default());
            }
        }
        let grey = grey_left[y % GREY].get(..width).unwrap_or_default();
        for ((low, high), &grey) in right_codes.iter_mut().zip(right_high).zip(grey) {
            let saturated = (grey == SATURATED[0]) | (grey == SATURATED[1]);
            let upper = if split_codes { *low >> 4 } else { 0 };
            *high = upper | if saturated { SATURATED_FLAG } else { 0 };
            *low &= if split_codes { 0x0f } else { 0xff };
        }
        let around = y.saturating_sub(*reach)..y.saturating_add(*reach).saturating_add(1);
        self.kept_spans[y % KEPT] = around.map(|y| grey_spans[y % GREY]).fold(EVERYTHING, both);
    }

    /// Grey values after the filter, of row `y`, which must be among the last [`KEPT`]; left and right.
    pub(super) fn filtered(&self, y: usize, width: usize) -> (&[u8], &[u8]) {
        (self.kind(y, Kind::Left, width), self.kind(y, Kind::Right, width))
    }

    /// What row `y` adds to the sums of evidence.
    pub(super) fn evidence(&self, y: usize, width: usize, prefilter: Prefilter) -> Evidence<'_> {
        Evidence { filtered: self.kind(y, Kind::Left, width), flags: self.kind(y, Kind::RightHigh, width), prefilter }
    }

    /// Census codes of row `y`.
    pub(super) fn codes(&self, y: usize, width: usize) -> CodeRow<'_> {
        let all = self.kept.as_flattened().as_flattened();
        let from = |kind: Kind| {
            let row = (y % KEPT * KINDS).wrapping_add(kind as usize).wrapping_sub(LEAD_ROWS);
            all.get(row.wrapping_mul(WIDTH)..).unwrap_or_default()
        };
        CodeRow {
            left: self.kind(y, Kind::LeftCodes, width),
            low: from(Kind::RightCodes),
            high: from(Kind::RightHigh),
            lead: LEAD_ROWS * WIDTH,
        }
    }

    fn kind(&self, y: usize, kind: Kind, width: usize) -> &[u8] {
        self.kept[y % KEPT][kind as usize].get(..width).unwrap_or_default()
    }

    /// Columns that are valid in all filtered rows within `radius - 1` of row `y`, left and right.
    pub(super) fn spans(&self, y: usize, radius: usize) -> (ValidSpan, ValidSpan) {
        let first = y.saturating_add(1).saturating_sub(radius);
        (first..y.saturating_add(radius)).map(|y| self.kept_spans[y % KEPT]).fold(EVERYTHING, both)
    }
}

/// Copies as much of a row as there is room for; the matcher takes none that is too long.
fn copy(to: &mut [u8], from: &[u8]) {
    let length = to.len().min(from.len());
    if let (Some(to), Some(from)) = (to.get_mut(..length), from.get(..length)) {
        to.copy_from_slice(from);
    }
}

/// Spans of the left and right row that take nothing away.
const EVERYTHING: (ValidSpan, ValidSpan) =
    (ValidSpan { start: 0, end: u16::MAX }, ValidSpan { start: 0, end: u16::MAX });

fn both(all: (ValidSpan, ValidSpan), row: (ValidSpan, ValidSpan)) -> (ValidSpan, ValidSpan) {
    (all.0.intersect(row.0), all.1.intersect(row.1))
}
