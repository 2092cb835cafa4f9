//! Census codes: which of eight pixels around a pixel are darker.

use core::ops::Range;

use crate::arch::{self, Chosen};

/// Pixels that the code looks at up, down, left and right.
pub(super) const REACH: usize = 3;

/// Rows that one row of codes is made from.
pub(super) const ROWS: usize = 2 * REACH + 1;

/// Codes of the middle one of seven rows. Pixels nearer to an end than [`REACH`] have code 0.
///
/// Bits are set for the darker ones of the eight neighbours at two pixels diagonally and three pixels straight: a ring wide
/// enough to see through the blur of the lens, in one byte. Source: Zabih and Woodfill, *Non-parametric local transforms for
/// computing visual correspondence*, 1994; a sparse pattern instead of their full one.
///
/// # Bound
/// Eight comparisons for each pixel.
#[inline(always)]
pub(super) fn codes(chosen: Chosen, rows: [&[u8]; ROWS], out: &mut [u8]) {
    let width = rows.iter().fold(out.len(), |width, row| width.min(row.len()));
    out.fill(0);
    let Some(inner) = width.checked_sub(2 * REACH) else { return };
    let [top, upper, _, middle, _, lower, bottom] = rows;
    // As long as the rows.
    let Some(out) = out.get_mut(REACH..).and_then(|out| out.get_mut(..inner)) else { return };
    let done = arch::census_codes(chosen, [top, upper, middle, lower, bottom], out);
    // Slices of one length, one for each neighbour, so that the loop runs without checks.
    let neighbours = [(upper, 1), (upper, 5), (lower, 1), (lower, 5), (middle, 0), (middle, 6), (top, 3), (bottom, 3)];
    let (centre, out) = (part(middle, REACH, done..inner), out.get_mut(done..).unwrap_or_default());
    for (bit, (row, x)) in neighbours.into_iter().enumerate() {
        for ((code, &centre), &neighbour) in out.iter_mut().zip(centre).zip(part(row, x, done..inner)) {
            *code |= u8::from(neighbour < centre) << bit;
        }
    }
}

/// The pixels `range` of `row`, counted from pixel `first`.
#[inline(always)]
fn part(row: &[u8], first: usize, range: Range<usize>) -> &[u8] {
    row.get(first..).and_then(|row| row.get(range)).unwrap_or_default()
}

#[cfg(test)]
#[path = "census_tests.rs"]
mod tests;
