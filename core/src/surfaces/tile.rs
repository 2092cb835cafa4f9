//! Contiguous surfaces inside one tile.

use core::ops::Range;

use super::{SurfaceSettings, TILE};
use crate::{
    disparity::DisparityPixel,
    links::{Links, PIECE, each_bit, near, piece, same, shifted},
    work::{self, Loop},
};

const _: () = assert!(TILE == PIECE, "a row of a tile is one piece");

/// Pixels of a tile.
const AREA: usize = TILE * TILE;

/// Smallest value of [`super::SurfaceSettings::min_pixels`].
pub(super) const MIN_PIXELS: u16 = 16;

/// Most surfaces that one tile can hold.
pub(crate) const MAX_SURFACES: usize = AREA / MIN_PIXELS as usize;

/// Number of classes that a method can tell pixels apart by, before there are surfaces: two bits beside the number of a surface.
pub(crate) const CODES: usize = 4;

/// Where the class of a pixel lies beside the number of its surface, which then has the bits below.
pub(super) const CODE_SHIFT: u32 = 6;
pub(super) const NUMBER_MASK: u8 = (1 << CODE_SHIFT) - 1;

/// Place of a tile in the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tile {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Tile {
    /// Tiles of a picture, row by row; the last ones of a row or column are cut off at its edge.
    pub(super) fn all(width: usize, height: usize) -> impl Iterator<Item = Self> {
        (0..height).step_by(TILE).flat_map(move |y| {
            (0..width).step_by(TILE).map(move |x| Self {
                x,
                y,
                width: TILE.min(width.saturating_sub(x)),
                height: TILE.min(height.saturating_sub(y)),
            })
        })
    }

    /// Where row `y` of the tile lies in a picture with rows of `stride`.
    #[inline(always)]
    pub(super) const fn row(&self, y: usize, stride: usize) -> Range<usize> {
        let start = self.y.wrapping_add(y).wrapping_mul(stride).wrapping_add(self.x);
        start..start.wrapping_add(self.width)
    }
}

/// Union-find over the runs of contiguous pixels of one tile, row by row; at worst each pixel is a run.
///
/// Every number of a run is less than [`AREA`]: the remainders change nothing and say so to the compiler.
pub(super) struct TileUnion {
    parent: [u16; AREA],
    /// Pixels of the run; of the whole surface where the run stands for it.
    pixels: [u16; AREA],
}

impl TileUnion {
    pub(super) const fn new() -> Self {
        Self { parent: [0; AREA], pixels: [0; AREA] }
    }

    /// Numbers the surfaces of a tile from 1 in the order of their first pixels and writes the numbers to `labels`, 0 where
    /// there is none; returns how many there are. `covered` are the disparities that are points, 1/16 px. Of the settings the
    /// step and the least number of pixels count here.
    ///
    /// If `CODED`, `labels` holds a class below [`CODES`] for each pixel: only pixels of one class make a surface, and the class
    /// is left beside the number, [`CODE_SHIFT`] bits up. There is one number less then: the last surface of a tile that is full of
    /// the smallest is counted and gets none.
    ///
    /// # Bound
    /// Two passes over the tile, and three over its runs.
    #[inline(always)]
    pub(super) fn label<const CODED: bool>(
        &mut self,
        picture: &[DisparityPixel],
        stride: usize,
        tile: Tile,
        settings: &SurfaceSettings,
        covered: &Range<u16>,
        labels: &mut [u8],
    ) -> u8 {
        let (rows, runs) = self.join_runs::<CODED>(picture, stride, tile, settings, covered, labels);
        // What stands for a surface comes first in it.
        work::count(Loop::SurfaceStarts, runs);
        for run in 0..runs {
            let run = run % AREA;
            let root = self.parent[usize::from(self.parent[run]) % AREA];
            self.parent[run] = root;
            if usize::from(root) != run {
                let pixels = self.pixels[run];
                let all = &mut self.pixels[usize::from(root) % AREA];
                *all = all.wrapping_add(pixels);
            }
        }
        // The count of a surface makes room for its number as soon as the number is known.
        let most = if CODED { usize::from(NUMBER_MASK) } else { MAX_SURFACES };
        let (mut found, mut lost) = (0u8, 0u8);
        let mut run = 0usize;
        for (y, links) in rows.iter().enumerate().take(tile.height) {
            let Some(labels) = labels.get_mut(tile.row(y, stride)) else { break };
            let mut numbers = [0u8; TILE];
            work::count(Loop::SurfaceNumbers, links.starts().count_ones() as usize);
            for bit in each_bit(links.starts()) {
                let root = usize::from(self.parent[run % AREA]) % AREA;
                run = run.wrapping_add(1);
                let pixels = &mut self.pixels[root];
                if *pixels & NUMBERED == 0 {
                    let large = *pixels >= settings.min_pixels;
                    let enough = large && usize::from(found) < most;
                    if CODED {
                        lost = lost.wrapping_add(u8::from(large && !enough));
                    }
                    found = found.wrapping_add(u8::from(enough));
                    *pixels = NUMBERED | if enough { u16::from(found) } else { 0 };
                }
                let mut number = (*pixels & !NUMBERED) as u8;
                if number == 0 {
                    continue;
                }
                let first = bit.trailing_zeros() as usize;
                if CODED {
                    number |= labels.get(first).map_or(0, |code| code << CODE_SHIFT);
                }
                let run = numbers.get_mut(first..).unwrap_or_default().iter_mut().take(length(links.left, first));
                run.for_each(|to| *to = number);
            }
            if let Some(whole) = labels.first_chunk_mut() {
                *whole = numbers;
            } else {
                labels.iter_mut().zip(numbers).for_each(|(label, number)| *label = number);
            }
        }
        found.wrapping_add(lost)
    }

    /// Finds the runs of the tile, counts their pixels and joins those that touch; returns how the pixels of each row hang together,
    /// and how many runs there are.
    #[inline(always)]
    fn join_runs<const CODED: bool>(
        &mut self,
        picture: &[DisparityPixel],
        stride: usize,
        tile: Tile,
        settings: &SurfaceSettings,
        covered: &Range<u16>,
        labels: &[u8],
    ) -> ([Links; TILE], usize) {
        let step = settings.step_sixteenths;
        let mut rows = [Links::default(); TILE];
        let (mut above, mut codes_above, mut links_above) = ([0; TILE], [0; TILE], Links::default());
        // The first run of the row above, and the number of runs so far.
        let (mut first_above, mut runs) = (0usize, 0usize);
        for (y, row) in rows.iter_mut().enumerate().take(tile.height) {
            let here = piece(picture.get(tile.row(y, stride)).unwrap_or_default(), 0);
            let mut links = Links::of(&here, 0, covered, step);
            let mut up = links.value & links_above.value & near(&here, &above, step);
            if CODED {
                let mut codes = [0; TILE];
                codes
                    .iter_mut()
                    .zip(labels.get(tile.row(y, stride)).unwrap_or_default())
                    .for_each(|(to, from)| *to = *from);
                links.left &= same(&codes, &shifted(&codes, 0));
                up &= same(&codes, &codes_above);
                codes_above = codes;
            }
            let starts = links.starts();
            work::count(Loop::SurfaceRows, 1);
            work::count(Loop::SurfaceStarts, starts.count_ones() as usize);
            for (run, bit) in (runs..AREA).zip(each_bit(starts)) {
                self.parent[run] = run as u16;
                self.pixels[run] = length(links.left, bit.trailing_zeros() as usize) as u16;
            }
            // Where both runs go on, so does what is known of them.
            for bit in each_bit(up & !(up << 1 & links.left & links_above.left)) {
                work::count(Loop::SurfaceJoins, 1);
                let upto = bit | (bit - 1);
                let begun = |starts: u32| (starts & upto).count_ones() as usize;
                let (run, run_above) =
                    (runs.wrapping_add(begun(starts)), first_above.wrapping_add(begun(links_above.starts())));
                // Both began, as their pixels belong to them.
                self.join(run.wrapping_sub(1), run_above.wrapping_sub(1));
            }
            first_above = runs;
            runs = runs.wrapping_add(starts.count_ones() as usize);
            (above, links_above, *row) = (here, links, links);
        }
        (rows, runs)
    }

    /// Room for a count by size, while no tile is being labelled.
    pub(super) fn scratch(&mut self) -> &mut [u16] {
        &mut self.pixels
    }

    #[inline(always)]
    fn root(&mut self, mut place: usize) -> usize {
        loop {
            let here = place % AREA;
            let parent = usize::from(self.parent[here]);
            if parent == place {
                return place;
            }
            work::count(Loop::SurfaceHops, 1);
            let above = self.parent[parent % AREA];
            self.parent[here] = above;
            place = usize::from(above);
        }
    }

    #[inline(always)]
    fn join(&mut self, a: usize, b: usize) {
        let a = self.root(a);
        let b = self.root(b);
        self.parent[a.max(b) % AREA] = a.min(b) as u16;
    }
}

/// Pixels of the run that begins at pixel `first`: with it all that hang together with their left neighbour.
#[inline(always)]
const fn length(left: u32, first: usize) -> usize {
    ((left >> first >> 1).trailing_ones() as usize).wrapping_add(1)
}

/// Marks the count of a surface that has become its number.
const NUMBERED: u16 = 0x8000;
