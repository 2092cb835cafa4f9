//! Reads a raw picture along the segments of a row.

use core::ops::Range;

use crate::picture::Picture;

use super::grid::{PLACE_SHIFT, STEP, Segment};

/// Fraction bits of the bilinear weights: 1/64 px, which moves an edge by less than the map's own error, and small enough
/// that one direction fits 16 bits.
const WEIGHT_SHIFT: u32 = 6;
const WEIGHT_ONE: u32 = 1 << WEIGHT_SHIFT;

/// Added to a place, so that cutting it to the weight's bits rounds it.
const HALF_WEIGHT: i32 = 1 << (PLACE_SHIFT - WEIGHT_SHIFT - 1);

/// Fills a row and returns its longest run of pixels whose source lies in the picture; the others are 0.
pub(super) fn sample_row(
    segments: impl Iterator<Item = Option<Segment>>,
    source: &Source<'_>,
    out: &mut [u8],
) -> Range<usize> {
    let width = out.len();
    let mut runs = Runs::default();
    let mut chunks = out.chunks_mut(STEP);
    let mut begin = 0;
    for (segment, chunk) in segments.zip(chunks.by_ref()) {
        let Some(segment) = segment else {
            chunk.fill(0);
            runs.end_at(begin);
            begin += STEP;
            runs.start = begin;
            continue;
        };
        let mut place = segment.start.map(|p| p.wrapping_add(HALF_WEIGHT));
        if let (true, Ok(chunk)) = (source.holds_whole(place, segment.slope), <&mut [u8; STEP]>::try_from(&mut *chunk))
        {
            for pixel in chunk {
                *pixel = source.inner(place);
                place = step(place, segment.slope);
            }
        } else {
            for (index, pixel) in chunk.iter_mut().enumerate() {
                if let Some(value) = source.at(place) {
                    *pixel = value;
                } else {
                    *pixel = 0;
                    runs.end_at(begin + index);
                    runs.start = begin + index + 1;
                }
                place = step(place, segment.slope);
            }
        }
        begin += STEP;
    }
    // Fewer segments than pixels: the row is longer than the rectified picture.
    for chunk in chunks {
        chunk.fill(0);
    }
    runs.end_at(begin.min(width));
    let longest = runs.longest;
    if let Some(before) = out.get_mut(..longest.start) {
        before.fill(0);
    }
    if let Some(after) = out.get_mut(longest.end..) {
        after.fill(0);
    }
    longest
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

    /// Whether all pixels of a segment have four neighbours in the picture: those at both ends tell, as it is straight.
    fn holds_whole(&self, start: [i32; 2], slope: [i32; 2]) -> bool {
        (0..2).all(|i| {
            let end = start[i].wrapping_add(slope[i].wrapping_mul(STEP as i32 - 1));
            let limit = self.last[i] << PLACE_SHIFT;
            start[i].min(end) >= 0 && start[i].max(end) < limit
        })
    }

    /// The pixel at a place that [`Self::holds_whole`].
    ///
    /// Two neighbours share a register, 16 bits each: weighting them down the column takes one multiplication for both.
    fn inner(&self, [x, y]: [i32; 2]) -> u8 {
        let first = (y >> PLACE_SHIFT) as usize * self.stride + (x >> PLACE_SHIFT) as usize;
        let pair = |index: usize| {
            let bytes = self.data.get(index..).and_then(|rest| rest.first_chunk::<2>());
            let both = bytes.map_or(0, |b| u32::from(u16::from_le_bytes(*b)));
            (both | both << 8) & 0x00ff_00ff
        };
        let (across, down) = (weight(x), weight(y));
        let column = pair(first) * (WEIGHT_ONE - down) + pair(first + self.stride) * down;
        blend(column & 0xffff, column >> 16, across)
    }

    /// The pixel at any place, `None` outside of the picture.
    fn at(&self, [x, y]: [i32; 2]) -> Option<u8> {
        let cell = [x >> PLACE_SHIFT, y >> PLACE_SHIFT];
        let (across, down) = (weight(x), weight(y));
        // On the last column and row itself there is a pixel, beyond there is not.
        let inside = |i: usize, weight: u32| {
            cell[i] >= 0 && (cell[i] < self.last[i] || (cell[i] == self.last[i] && weight == 0))
        };
        if !inside(0, across) || !inside(1, down) {
            return None;
        }
        let pixel = |dx: i32, dy: i32| {
            let (x, y) = ((cell[0] + dx).min(self.last[0]), (cell[1] + dy).min(self.last[1]));
            self.data.get(y as usize * self.stride + x as usize).map(|p| u32::from(*p))
        };
        let column = |dx: i32| Some(pixel(dx, 0)? * (WEIGHT_ONE - down) + pixel(dx, 1)? * down);
        Some(blend(column(0)?, column(1)?, across))
    }
}

fn weight(place: i32) -> u32 {
    (place >> (PLACE_SHIFT - WEIGHT_SHIFT)) as u32 % WEIGHT_ONE
}

/// Blends two sums that carry a weight already, and rounds.
fn blend(left: u32, right: u32, across: u32) -> u8 {
    let sum = left * (WEIGHT_ONE - across) + right * across;
    ((sum + (1 << (2 * WEIGHT_SHIFT - 1))) >> (2 * WEIGHT_SHIFT)) as u8
}
