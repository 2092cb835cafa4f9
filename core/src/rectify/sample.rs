//! Reads a raw picture along the segments of a row.

use core::ops::Range;

use crate::{
    arch::Steps,
    picture::Picture,
    work::{self, Loop},
};

use super::grid::{Grid, PLACE_SHIFT, STEP, Segment};

/// Fraction bits of the bilinear weights: 1/64 px, which moves an edge by less than the map's own error, and small enough
/// that sums fit 16 bits.
pub(super) const WEIGHT_SHIFT: u32 = 6;
const WEIGHT_ONE: u16 = 1 << WEIGHT_SHIFT;

/// Bits dropped between both directions, so that the second still fits 16 bits: quarters of a grey level remain.
const DROPPED: u32 = 4;

/// Bits dropped at last.
const LAST: u32 = 2 * WEIGHT_SHIFT - DROPPED;

/// Columns and rows that the pixels of one segment are read from, at most.
const TILE_COLUMNS: usize = 16;
const TILE_ROWS: usize = 4;

/// Added to a place, so that cutting it to the weight's bits rounds it.
pub(super) const HALF_WEIGHT: i32 = 1 << (PLACE_SHIFT - WEIGHT_SHIFT - 1);

/// Fills a row and finds its longest run of pixels whose source lies in the picture; the others are 0.
pub(super) struct SampleRow<'a, const NODES: usize> {
    pub(super) grid: &'a Grid<NODES>,
    pub(super) source: Source<'a>,
    /// The row of the rectified picture.
    pub(super) y: usize,
    pub(super) out: &'a mut [u8],
    pub(super) longest: &'a mut Range<usize>,
}

impl<const NODES: usize> Steps for SampleRow<'_, NODES> {
    #[inline(always)]
    fn run(self) {
        let Self { grid, source, y, out, longest } = self;
        let width = out.len();
        let mut runs = Runs::default();
        let mut segments = grid.segments(y);
        let (chunks, rest) = out.as_chunks_mut::<STEP>();
        work::count(Loop::RectifySegments, chunks.len().saturating_add(1));
        let mut begin = 0usize;
        for chunk in chunks {
            // None beyond the last: the row is longer than the rectified picture.
            let segment = segments.next().flatten();
            let Some(segment) = segment else {
                chunk.fill(0);
                runs.end_at(begin);
                begin = begin.wrapping_add(STEP);
                runs.start = begin;
                continue;
            };
            let place = step(segment.start, [HALF_WEIGHT; 2]);
            let whole = source.fill_plain(place, segment.slope, chunk);
            if !whole && !source.fill_inside(place, segment.slope, chunk) {
                source.fill_each(segment, begin, chunk, &mut runs);
            }
            // Within the row.
            begin = begin.wrapping_add(STEP);
        }
        match segments.next().flatten() {
            Some(segment) => source.fill_each(segment, begin, rest, &mut runs),
            None => {
                rest.fill(0);
                runs.end_at(begin);
                runs.start = width;
            }
        }
        runs.end_at(width);
        *longest = runs.longest;
        if let Some(before) = out.get_mut(..longest.start) {
            before.fill(0);
        }
        if let Some(after) = out.get_mut(longest.end..) {
            after.fill(0);
        }
    }
}

fn step(place: [i32; 2], slope: [i32; 2]) -> [i32; 2] {
    [place[0].wrapping_add(slope[0]), place[1].wrapping_add(slope[1])]
}

/// The longest run so far, and where the one under way began.
#[derive(Default)]
struct Runs {
    start: usize,
    longest: Range<usize>,
}

impl Runs {
    fn end_at(&mut self, end: usize) {
        if end.saturating_sub(self.start) > self.longest.len() {
            self.longest = self.start..end;
        }
    }
}

/// A raw picture with the places in it, each with half a weight added.
pub(super) struct Source<'a> {
    data: &'a [u8],
    stride: usize,
    /// Last column and row that is there, `[x, y]`.
    last: [i32; 2],
}

impl<'a> Source<'a> {
    /// `size` is what the calibration says; of a smaller picture there is less.
    pub(super) fn new(picture: &Picture<'a>, size: (usize, usize)) -> Self {
        let (width, height) = (picture.width().min(size.0), picture.height().min(size.1));
        let last = [width, height].map(|n| n.clamp(1, 1 << 15) as i32 - 1);
        Self { data: picture.data(), stride: picture.stride(), last }
    }

    /// Fills a segment pixel by pixel; `begin` is the column of the first.
    fn fill_each(&self, segment: Segment, begin: usize, out: &mut [u8], runs: &mut Runs) {
        work::count(Loop::RectifyPixels, out.len());
        let mut place = step(segment.start, [HALF_WEIGHT; 2]);
        let mut column = begin;
        for pixel in out {
            let next = column.wrapping_add(1);
            if let Some(value) = self.at(place) {
                *pixel = value;
            } else {
                *pixel = 0;
                runs.end_at(column);
                runs.start = next;
            }
            column = next;
            place = step(place, segment.slope);
        }
    }

    /// Fills a whole segment where the lens hardly moves it: no more than one column is left out or read twice on the way, and one
    /// row crossed. Otherwise leaves it to [`Self::fill_inside`]. Gives the same bits.
    ///
    /// Each pixel then lies among three columns and three rows that follow from its number alone, so that nothing has to be looked up:
    /// bilinear weights fall to zero one column and one row away, and what is zero may be added.
    #[inline(always)]
    fn fill_plain(&self, start: [i32; 2], slope: [i32; 2], out: &mut [u8; STEP]) -> bool {
        const ONE: i32 = 1 << PLACE_SHIFT;
        // So far pixels may drift, from one to the next, against the same picture merely moved.
        const MOST: i32 = ONE / STEP as i32;
        let drift = [slope[0].wrapping_sub(ONE), slope[1]];
        if drift.iter().any(|&drift| drift.unsigned_abs() > MOST as u32) {
            return false;
        }
        let last = STEP as i32 - 1;
        let low: [i32; 2] = [0, 1].map(|i| start[i].min(start[i].wrapping_add(drift[i].wrapping_mul(last))));
        let right = start[0].wrapping_add(slope[0].wrapping_mul(last));
        let [column, top] = low.map(|low| low >> PLACE_SHIFT);
        // Three rows are read, and of each row more than is used: at the lower edge that is left to others.
        if low[0] < 0 || low[1] < 0 || right >= self.last[0] << PLACE_SHIFT || top.saturating_add(2) > self.last[1] {
            return false;
        }
        let bytes = self.data.get(self.place(column as usize, top as usize)..).unwrap_or_default();
        let row = |down: usize| {
            bytes.get(self.stride.saturating_mul(down)..).and_then(|rest| rest.first_chunk::<TILE_COLUMNS>())
        };
        let (Some(first), Some(second), Some(third)) = (row(0), row(1), row(2)) else { return false };
        let rows = [first, second, third];
        // Weights of the three columns and rows of each pixel, from where it lies within two.
        let mut weights = [[[0u16; STEP]; 3]; 2];
        for i in 0..2 {
            let from = start[i].wrapping_sub(low[i] >> PLACE_SHIFT << PLACE_SHIFT) as u16;
            let [first, second, third] = &mut weights[i];
            for k in 0..STEP {
                let place = from.wrapping_add((drift[i] as u16).wrapping_mul(k as u16));
                let along = place >> (PLACE_SHIFT - WEIGHT_SHIFT);
                first[k] = WEIGHT_ONE.saturating_sub(along);
                third[k] = along.saturating_sub(WEIGHT_ONE);
                second[k] = WEIGHT_ONE.wrapping_sub(first[k]).wrapping_sub(third[k]);
            }
        }
        let [across, down] = &weights;
        let mut sums = [0u16; STEP];
        for (column, across) in across.iter().enumerate() {
            for k in 0..STEP {
                let grey = |row: usize| u16::from(rows[row][column + k]).wrapping_mul(down[row][k]);
                let sum = grey(0).wrapping_add(grey(1)).wrapping_add(grey(2));
                let dropped = sum.wrapping_add(1 << (DROPPED - 1)) >> DROPPED;
                sums[k] = sums[k].wrapping_add(dropped.wrapping_mul(across[k]));
            }
        }
        for k in 0..STEP {
            out[k] = (sums[k].wrapping_add(1 << (LAST - 1)) >> LAST) as u8;
        }
        true
    }

    /// Fills a whole segment, if all of its pixels have four neighbours in the picture and lie in a tile; otherwise leaves
    /// it to [`Self::at`]. Gives the same bits.
    ///
    /// With the neighbours in a tile of fixed size, nothing has to be checked per pixel and all eight are blended at once.
    #[inline]
    fn fill_inside(&self, start: [i32; 2], slope: [i32; 2], out: &mut [u8; STEP]) -> bool {
        // A segment is straight: its ends tell.
        let last = STEP as i32 - 1;
        let end =
            [start[0].wrapping_add(slope[0].wrapping_mul(last)), start[1].wrapping_add(slope[1].wrapping_mul(last))];
        let (low, high) = ([start[0].min(end[0]), start[1].min(end[1])], [start[0].max(end[0]), start[1].max(end[1])]);
        let inside = |i: usize| low[i] >= 0 && high[i] < self.last[i] << PLACE_SHIFT;
        if !inside(0) || !inside(1) {
            return false;
        }
        let (left, top) = ((low[0] >> PLACE_SHIFT) as usize, (low[1] >> PLACE_SHIFT) as usize);
        let (right, bottom) = ((high[0] >> PLACE_SHIFT) as usize, (high[1] >> PLACE_SHIFT) as usize);
        // The neighbours to the right and below belong to it.
        if right.wrapping_sub(left) >= TILE_COLUMNS - 1 || bottom.wrapping_sub(top) >= TILE_ROWS - 1 {
            return false;
        }
        // The room behind lets the neighbours of any pixel be read without a check.
        let mut tile = [0; TILE_COLUMNS * TILE_ROWS + TILE_COLUMNS + 2];
        // Always all rows: a branch on how many are needed would be guessed wrong too often.
        for (down, to) in (0..TILE_ROWS).zip(tile.as_chunks_mut::<TILE_COLUMNS>().0.iter_mut()) {
            let row = top.saturating_add(down).min(self.last[1] as usize);
            let bytes = self.data.get(self.place(left, row)..).and_then(|rest| rest.first_chunk());
            let Some(bytes) = bytes else { return false };
            *to = *bytes;
        }

        // Arrays of 16-bit numbers, one step at a time: this becomes vector instructions. Loops, because `map` and `from_fn` become
        // calls where the compiler does not inline all of them. Places in the tile fit 16 bits.
        let from =
            [start[0].wrapping_sub((left as i32) << PLACE_SHIFT), start[1].wrapping_sub((top as i32) << PLACE_SHIFT)];
        let (mut places, mut firsts) = ([[0u16; STEP]; 2], [0u16; STEP]);
        for (axis, (from, slope)) in places.iter_mut().zip(from.into_iter().zip(slope)) {
            for (place, k) in axis.iter_mut().zip(0u16..) {
                *place = (from as u16).wrapping_add((slope as u16).wrapping_mul(k));
            }
        }
        for k in 0..STEP {
            firsts[k] = (places[1][k] >> PLACE_SHIFT) * TILE_COLUMNS as u16 + (places[0][k] >> PLACE_SHIFT);
        }
        let pairs = |offset: usize| {
            let pair = |k: usize| {
                // The remainder changes nothing; it says to the compiler that the index lies in the tile.
                let index = usize::from(firsts[k]) % (TILE_COLUMNS * TILE_ROWS) + offset;
                u16::from_le_bytes([tile[index], tile[index + 1]])
            };
            // Written out, the pairs go straight into a vector register; `map` would take them through memory.
            [pair(0), pair(1), pair(2), pair(3), pair(4), pair(5), pair(6), pair(7)]
        };
        let (upper, lower) = (pairs(0), pairs(TILE_COLUMNS));
        for k in 0..STEP {
            let weight = |place: u16| place >> (PLACE_SHIFT - WEIGHT_SHIFT) & (WEIGHT_ONE - 1);
            let (upper, lower) = ([upper[k] & 0xff, upper[k] >> 8], [lower[k] & 0xff, lower[k] >> 8]);
            out[k] = blend(upper, lower, weight(places[0][k]), weight(places[1][k]));
        }
        true
    }

    /// Where the byte at a column and row of the picture lies; any place for what is not in it.
    #[inline(always)]
    const fn place(&self, column: usize, row: usize) -> usize {
        row.wrapping_mul(self.stride).wrapping_add(column)
    }

    /// The pixel at any place, `None` outside of the picture.
    pub(super) fn at(&self, [x, y]: [i32; 2]) -> Option<u8> {
        let cell = [x >> PLACE_SHIFT, y >> PLACE_SHIFT];
        let (across, down) = (weight(x), weight(y));
        // On the last column and row itself there is a pixel, beyond there is not.
        let inside = |i: usize, weight: u16| {
            cell[i] >= 0 && (cell[i] < self.last[i] || (cell[i] == self.last[i] && weight == 0))
        };
        if !inside(0, across) || !inside(1, down) {
            return None;
        }
        let pixel = |dx: i32, dy: i32| {
            let at = |i: usize, more: i32| cell[i].saturating_add(more).min(self.last[i]) as usize;
            self.data.get(self.place(at(0, dx), at(1, dy))).map(|p| u16::from(*p))
        };
        Some(blend([pixel(0, 0)?, pixel(1, 0)?], [pixel(0, 1)?, pixel(1, 1)?], across, down))
    }
}

fn weight(place: i32) -> u16 {
    (place >> (PLACE_SHIFT - WEIGHT_SHIFT)) as u16 % WEIGHT_ONE
}

/// Blends four neighbours, left and right of two rows, rounding twice. No sum exceeds 65408.
#[inline(always)]
fn blend(upper: [u16; 2], lower: [u16; 2], across: u16, down: u16) -> u8 {
    let column = |upper: u16, lower: u16| {
        let sum = upper.wrapping_mul(WEIGHT_ONE - down).wrapping_add(lower.wrapping_mul(down));
        sum.wrapping_add(1 << (DROPPED - 1)) >> DROPPED
    };
    let (left, right) = (column(upper[0], lower[0]), column(upper[1], lower[1]));
    let sum = left.wrapping_mul(WEIGHT_ONE - across).wrapping_add(right.wrapping_mul(across));
    (sum.wrapping_add(1 << (LAST - 1)) >> LAST) as u8
}

#[cfg(test)]
#[path = "sample_tests.rs"]
mod tests;
