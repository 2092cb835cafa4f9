//! A few filtered rows of both pictures, for a closer look than the matching takes.

use super::{Matcher, rows::KEPT, rows::ValidSpan};

/// `ROWS` filtered rows of both pictures, lent while the matcher still holds them.
#[derive(Clone, Copy)]
pub(crate) struct Strip<'a, const ROWS: usize> {
    pub(crate) left: [&'a [u8]; ROWS],
    pub(crate) right: [&'a [u8]; ROWS],
    /// Columns that are valid in all of the rows.
    pub(crate) left_span: ValidSpan,
    pub(crate) right_span: ValidSpan,
}

impl<const WIDTH: usize, const DISPARITIES: usize> Matcher<WIDTH, DISPARITIES> {
    /// Whether filtered row `y` has come.
    pub(crate) fn has_filtered(&self, y: usize) -> bool {
        self.rows.newest_filtered().is_some_and(|newest| newest >= y)
    }

    /// The `ROWS` filtered rows around row `y`; `None` if one of them has not come yet, is no longer held or has no filtered
    /// row.
    pub(crate) fn strip<const ROWS: usize>(&self, y: usize) -> Option<Strip<'_, ROWS>> {
        let first = y.checked_sub(ROWS / 2).filter(|&first| first >= self.rows.first_filtered())?;
        let newest = self.rows.newest_filtered()?;
        if newest + 1 < first + ROWS || newest >= first + KEPT {
            return None;
        }
        let rows: [_; ROWS] = core::array::from_fn(|i| self.rows.filtered(first + i, self.width));
        let (left_span, right_span) = self.rows.spans(y, ROWS / 2 + 1);
        Some(Strip { left: rows.map(|(left, _)| left), right: rows.map(|(_, right)| right), left_span, right_span })
    }
}
