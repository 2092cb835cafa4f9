//! Everything that is learnt of the pictures while their rectified rows go by.

use super::{
    pairing::{Pairing, PairingSign},
    profile::Profile,
    row_error::{MARGIN, RowSign, STRIPS, SearchRange, SparseMatches},
    tiles::{Covering, Tiles},
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
    tiles: [Tiles<WIDTH>; 2],
    profiles: [Profile; 2],
    pairing: Pairing,
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
        Self {
            tiles: [const { Tiles::new() }; 2],
            profiles: [const { Profile::new() }; 2],
            pairing: Pairing::new(),
            sparse: SparseMatches::new(),
            height: 0,
            range: SearchRange { first: 0, last: 0 },
            next_strip: 0,
            chosen: Chosen::PLAIN,
        }
    }

    /// Has rows looked at with the instructions of a backend.
    pub(crate) const fn choose(&mut self, chosen: Chosen) {
        self.chosen = chosen;
        self.sparse.choose(chosen);
    }

    /// Forgets the pictures of before.
    pub(crate) fn clear(&mut self) {
        self.pairing.clear();
    }

    /// Starts a pair of pictures.
    pub(crate) fn begin(&mut self, width: usize, height: usize, range: SearchRange) {
        self.tiles.iter_mut().for_each(|tiles| tiles.begin(width, height));
        self.profiles.iter_mut().for_each(|profile| profile.begin(height));
        self.sparse.begin();
        self.height = height;
        self.range = range;
        self.next_strip = 0;
    }

    /// Takes row `y` of both rectified pictures.
    ///
    /// # Bound
    /// Three passes over each of the rows.
    pub(crate) fn push(&mut self, y: usize, rows: [&[u8]; 2], spans: [ValidSpan; 2]) {
        arch::compiled(self.chosen, PushRow { content: self, y, rows, spans });
    }

    #[inline(always)]
    fn take(&mut self, y: usize, rows: [&[u8]; 2], spans: [ValidSpan; 2]) {
        work::count(Loop::HealthRows, rows.iter().map(|row| row.len()).sum());
        for (side, (row, span)) in rows.into_iter().zip(spans).enumerate() {
            if let (Some(tiles), Some(profile)) = (self.tiles.get_mut(side), self.profiles.get_mut(side)) {
                tiles.push(y, row, span);
                profile.push(y, row, span);
            }
        }
    }

    /// Looks for sparse matches in the strips for which `matcher` has all rows now; `disparity` is the picture so far, rows of
    /// `width`, `done` of them.
    ///
    /// # Bound
    /// [`SparseMatches::look`], [`STRIPS`] times for each picture.
    pub(crate) fn look<const DISPARITIES: usize>(
        &mut self,
        matcher: &Matcher<WIDTH, DISPARITIES>,
        disparity: &[DisparityPixel],
        width: usize,
        done: usize,
    ) {
        while self.next_strip < STRIPS {
            let y = self.height * (self.next_strip + 1) / (STRIPS + 1);
            if done <= y {
                return;
            }
            // Near the upper and lower edge there are not enough rows, and there never will be.
            if y > MARGIN && y + MARGIN + 1 < self.height {
                if !matcher.has_filtered(y + MARGIN) {
                    return;
                }
                let row = disparity.get(y * width..(y + 1) * width).unwrap_or_default();
                if let Some(strip) = matcher.strip(y) {
                    self.sparse.look(&strip, row, self.range, 2 * y >= self.height);
                }
            }
            self.next_strip += 1;
        }
    }

    /// What the pair says, and what it says beside those of before.
    ///
    /// # Bound
    /// That of [`Pairing::compare`], [`Tiles::lacks`] and [`SparseMatches::sign`].
    pub(crate) fn signs(&mut self, structure_grey: f32) -> ContentSigns {
        let [left, right] = &self.tiles;
        let last = self.range.last;
        ContentSigns {
            coverings: [left.lacks(right, (last, 0), structure_grey), right.lacks(left, (0, last), structure_grey)],
            pairing: self.pairing.compare(&self.profiles),
            rows: self.sparse.sign(),
        }
    }
}

/// A row of both pictures.
struct PushRow<'a, const WIDTH: usize> {
    content: &'a mut Content<WIDTH>,
    y: usize,
    rows: [&'a [u8]; 2],
    spans: [ValidSpan; 2],
}

impl<const WIDTH: usize> Steps for PushRow<'_, WIDTH> {
    #[inline(always)]
    fn run(self) {
        self.content.take(self.y, self.rows, self.spans);
    }
}

#[cfg(test)]
#[path = "content_tests.rs"]
mod tests;
