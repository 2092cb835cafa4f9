//! Everything that is learnt of the pictures while their rectified rows go by.

use core::ops::Range;

use super::{
    pairing::{Pairing, PairingSign},
    profile::Profile,
    row_error::{MARGIN, Ordinals, RowSign, STRIPS, SearchRange, SparseMatches},
    tiles::{BLOCK, Covering, Tiles},
};
use crate::{
    arch::{self, Chosen, Steps},
    disparity::DisparityPixel,
    matching::{Matcher, ValidSpan},
    work::{self, Loop},
};

/// What the pictures of one moment say about the cameras, for pictures up to `WIDTH` wide.
///
/// Takes 15 KiB and 4 bytes for each pixel of a row.
#[derive(Clone, Debug)]
pub(crate) struct Content<const WIDTH: usize> {
    pub(crate) looks: RowLooks<WIDTH>,
    pairing: Pairing,
}

/// What the rows of a pair of pictures say as they go by: all of them, or those of a band.
#[derive(Clone, Debug)]
pub(crate) struct RowLooks<const WIDTH: usize> {
    tiles: [Tiles<WIDTH>; 2],
    profiles: [Profile; 2],
    sparse: SparseMatches,
    height: usize,
    range: SearchRange,
    next_strip: usize,
    chosen: Chosen,
}

/// The signs that lie in the pictures themselves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContentSigns {
    /// What the left and the right picture lack that the other one has.
    pub coverings: [Covering; 2],
    /// How pictures of different moments fit each other.
    pub pairing: PairingSign,
    /// Rows and near zone.
    pub rows: RowSign,
}

impl ContentSigns {
    /// All zero, for a detector that has not seen a picture yet.
    pub(crate) const UNSET: Self = Self {
        coverings: [Covering { covered: 0, judged: 0, flat_percent: 0.0 }; 2],
        pairing: PairingSign { advantage_sigmas: 0.0, likeness: 0.0, lag_frames: 0 },
        rows: RowSign { error_px: 0.0, matches: 0, near_percent: 0.0 },
    };
}

impl<const WIDTH: usize> Content<WIDTH> {
    pub(crate) const fn new() -> Self {
        Self { looks: RowLooks::new(), pairing: Pairing::new() }
    }

    /// Has rows looked at with the instructions of a backend.
    pub(crate) const fn choose(&mut self, chosen: Chosen) {
        self.looks.choose(chosen);
    }

    /// Forgets the pictures of before.
    pub(crate) fn clear(&mut self) {
        self.pairing.clear();
    }

    /// Starts a pair of pictures.
    pub(crate) fn begin(&mut self, width: usize, height: usize, range: SearchRange) {
        self.looks.begin(width, height, range);
    }

    /// Takes row `y` of both rectified pictures.
    ///
    /// # Bound
    /// Three passes over each of the rows.
    pub(crate) fn push(&mut self, y: usize, rows: [&[u8]; 2], spans: [ValidSpan; 2]) {
        self.looks.push(y, rows, spans);
    }

    /// [`RowLooks::look`] for all rows: `disparity` is the picture so far, rows of `width`, `done` of them.
    pub(crate) fn look<const DISPARITIES: usize>(
        &mut self,
        matcher: &Matcher<WIDTH, DISPARITIES>,
        disparity: &[DisparityPixel],
        width: usize,
        done: usize,
    ) {
        self.looks.look((matcher, 0), (disparity, 0), width, done, None);
    }

    /// What the pair says, and what it says beside those of before.
    ///
    /// # Bound
    /// That of [`Pairing::compare`], [`Tiles::lacks`] and [`SparseMatches::sign`].
    pub(crate) fn signs(&mut self, structure_grey: f32) -> ContentSigns {
        let RowLooks { tiles, profiles, sparse, range, .. } = &mut self.looks;
        let ([left, right], last) = (&*tiles, range.last);
        ContentSigns {
            coverings: [left.lacks(right, (last, 0), structure_grey), right.lacks(left, (0, last), structure_grey)],
            pairing: self.pairing.compare(profiles),
            rows: sparse.sign(),
        }
    }
}

impl<const WIDTH: usize> RowLooks<WIDTH> {
    pub(crate) const fn new() -> Self {
        Self {
            tiles: [const { Tiles::new() }; 2],
            profiles: [const { Profile::new() }; 2],
            sparse: SparseMatches::new(),
            height: 0,
            range: SearchRange { first: 0, last: 0 },
            next_strip: 0,
            chosen: Chosen::PLAIN,
        }
    }

    const fn choose(&mut self, chosen: Chosen) {
        self.chosen = chosen;
        self.sparse.choose(chosen);
    }

    fn begin(&mut self, width: usize, height: usize, range: SearchRange) {
        self.tiles.iter_mut().for_each(|tiles| tiles.begin(width, height));
        self.profiles.iter_mut().for_each(|profile| profile.begin(height));
        self.sparse.begin();
        self.height = height;
        self.range = range;
        self.next_strip = 0;
    }

    /// Takes row `y` of both rectified pictures.
    pub(crate) fn push(&mut self, y: usize, rows: [&[u8]; 2], spans: [ValidSpan; 2]) {
        arch::compiled(self.chosen, PushRow { looks: self, y, rows, spans });
    }

    #[inline(always)]
    fn take(&mut self, y: usize, rows: [&[u8]; 2], spans: [ValidSpan; 2]) {
        rows.iter().for_each(|row| work::count(Loop::HealthRows, row.len()));
        for (side, (row, span)) in rows.into_iter().zip(spans).enumerate() {
            if let (Some(tiles), Some(profile)) = (self.tiles.get_mut(side), self.profiles.get_mut(side)) {
                tiles.push(y, row, span);
                profile.push(y, row, span);
            }
        }
    }

    /// Looks for sparse matches in the strips for which the matcher has all rows now. The matcher's first row and that of `disparity`,
    /// rows of `width`, lie in the rows of the picture that are given with them; down to row `done` there are disparities.
    ///
    /// # Bound
    /// [`SparseMatches::look`], [`STRIPS`] times for each picture.
    pub(crate) fn look<const DISPARITIES: usize>(
        &mut self,
        (matcher, top): (&Matcher<WIDTH, DISPARITIES>, usize),
        (disparity, first): (&[DisparityPixel], usize),
        width: usize,
        done: usize,
        mut ordinals: Option<&mut Ordinals>,
    ) {
        while self.next_strip < STRIPS {
            let y = strip_row(self.height, self.next_strip);
            if done <= y {
                return;
            }
            // Near the upper and lower edge there are not enough rows, and there never will be.
            if y > MARGIN && y.saturating_add(MARGIN + 1) < self.height {
                let (in_matcher, in_disparity) = (y.saturating_sub(top), y.saturating_sub(first));
                if !matcher.has_filtered(in_matcher.saturating_add(MARGIN)) {
                    return;
                }
                // Within the picture.
                let start = in_disparity.wrapping_mul(width);
                let row = disparity.get(start..start.wrapping_add(width)).unwrap_or_default();
                if let Some(strip) = matcher.strip(in_matcher) {
                    let lower = y >= self.height.saturating_sub(y);
                    self.sparse.look(&strip, row, self.range, lower, ordinals.as_deref_mut());
                }
            }
            self.next_strip = self.next_strip.wrapping_add(1);
        }
    }

    /// Starts a band of the pair of pictures that `whole` was started for, at row `first`.
    pub(crate) fn begin_band(&mut self, whole: &Self, width: usize, first: usize) {
        self.choose(whole.chosen);
        self.begin(width, whole.height, whole.range);
        // Strips lie one below the other.
        self.next_strip = (0..STRIPS).find(|&strip| strip_row(whole.height, strip) >= first).unwrap_or(STRIPS);
    }

    /// Adds what the rows of a band below said.
    ///
    /// # Bound
    /// One pass over the tables.
    pub(crate) fn append(&mut self, band: &Self, ordinals: &Ordinals) {
        self.tiles.iter_mut().zip(&band.tiles).for_each(|(all, band)| all.append(band));
        self.profiles.iter_mut().zip(&band.profiles).for_each(|(all, band)| all.append(band));
        self.sparse.append(&band.sparse, ordinals);
    }
}

/// Row of the picture in the middle of a strip.
const fn strip_row(height: usize, strip: usize) -> usize {
    height.saturating_mul(strip.saturating_add(1)) / (STRIPS + 1)
}

/// Bands of the pictures must be cut between multiples of so many rows: blocks and the rows of a profile are seen as a whole.
pub(crate) fn unit_of_bands(height: usize) -> usize {
    let rows = Profile::rows_of_band(height);
    match rows % BLOCK {
        0 => rows,
        2 => rows.saturating_mul(2),
        _ => rows.saturating_mul(BLOCK),
    }
}

/// Rows that a matcher which begins with a band needs above and below the rows `band`, so that the strips among them can be looked
/// at; `reach` rows around a filtered one are needed for that.
pub(crate) fn rows_around(height: usize, band: &Range<usize>, reach: usize) -> [usize; 2] {
    let around = MARGIN.saturating_add(reach);
    let strips = (0..STRIPS).map(|strip| strip_row(height, strip)).filter(|y| band.contains(y));
    strips.fold([0, 0], |[above, below], y| {
        let there = [y.saturating_sub(band.start), band.end.saturating_sub(1).saturating_sub(y)];
        let lacking = there.map(|there| around.saturating_sub(there));
        [above.max(lacking[0]), below.max(lacking[1])]
    })
}

/// A row of both pictures.
struct PushRow<'a, const WIDTH: usize> {
    looks: &'a mut RowLooks<WIDTH>,
    y: usize,
    rows: [&'a [u8]; 2],
    spans: [ValidSpan; 2],
}

impl<const WIDTH: usize> Steps for PushRow<'_, WIDTH> {
    #[inline(always)]
    fn run(self) {
        self.looks.take(self.y, self.rows, self.spans);
    }
}

#[cfg(test)]
#[path = "content_tests.rs"]
mod tests;
