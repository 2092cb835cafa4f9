//! Contiguous surfaces inside one tile.

use super::{SurfaceSettings, TILE};
use crate::disparity::DisparityPixel;

/// Pixels of a tile.
const AREA: usize = TILE * TILE;

/// Smallest value of [`super::SurfaceSettings::min_pixels`].
pub(super) const MIN_PIXELS: u16 = 16;

/// Most surfaces that one tile can hold.
pub(super) const MAX_SURFACES: usize = AREA / MIN_PIXELS as usize;

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
                width: TILE.min(width - x),
                height: TILE.min(height - y),
            })
        })
    }
}

/// Union-find over the pixels of one tile.
pub(super) struct TileUnion {
    parent: [u16; AREA],
    pixels: [u16; AREA],
}

impl TileUnion {
    pub(super) const fn new() -> Self {
        Self { parent: [0; AREA], pixels: [0; AREA] }
    }

    /// Numbers the surfaces of a tile from 1 in the order of their first pixels and writes the numbers to `labels`, 0 where
    /// there is none; returns how many there are. `covers` says which disparities are points. Of the settings the step and
    /// the least number of pixels count here.
    ///
    /// If `CODED`, `labels` holds a class below [`CODES`] for each pixel: only pixels of one class make a surface, and the class
    /// is left beside the number, [`CODE_SHIFT`] bits up.
    ///
    /// # Bound
    /// Three passes over the tile.
    pub(super) fn label<const CODED: bool>(
        &mut self,
        picture: &[DisparityPixel],
        stride: usize,
        tile: Tile,
        settings: &SurfaceSettings,
        covers: impl Fn(u16) -> bool,
        labels: &mut [u8],
    ) -> u8 {
        let SurfaceSettings { step_sixteenths: step, min_pixels, .. } = *settings;
        let row = |y: usize| &picture[(tile.y + y) * stride + tile.x..][..tile.width];
        let steps_of =
            |pixel: &DisparityPixel| Some(pixel.steps()).filter(|&steps| steps != 0 && covers(steps)).unwrap_or(0);
        for y in 0..tile.height {
            let here = row(y);
            let above = row(y.saturating_sub(1));
            let codes = |y: usize| &labels[(tile.y + y) * stride + tile.x..][..tile.width];
            let (codes_here, codes_above) = (codes(y), codes(y.saturating_sub(1)));
            let mut left = 0u16;
            for x in 0..tile.width {
                let place = y * TILE + x;
                let steps = steps_of(&here[x]);
                self.pixels[place] = 0;
                self.parent[place] = place as u16;
                if steps != 0 {
                    if left != 0 && left.abs_diff(steps) <= step && (!CODED || codes_here[x - 1] == codes_here[x]) {
                        self.parent[place] = self.parent[place - 1];
                    }
                    let up = if y > 0 { steps_of(&above[x]) } else { 0 };
                    if up != 0 && up.abs_diff(steps) <= step && (!CODED || codes_above[x] == codes_here[x]) {
                        self.join(place, place - TILE);
                    }
                }
                left = steps;
            }
        }
        for y in 0..tile.height {
            for (x, pixel) in row(y).iter().enumerate() {
                if steps_of(pixel) != 0 {
                    let root = self.root(y * TILE + x);
                    self.pixels[root] += 1;
                }
            }
        }
        // The count of a surface makes room for its number as soon as the number is known.
        let most = if CODED { usize::from(NUMBER_MASK) } else { MAX_SURFACES };
        let mut found = 0u8;
        for y in 0..tile.height {
            let labels = &mut labels[(tile.y + y) * stride + tile.x..][..tile.width];
            for ((x, pixel), label) in row(y).iter().enumerate().zip(labels) {
                let code = *label;
                *label = 0;
                if steps_of(pixel) == 0 {
                    continue;
                }
                let root = self.root(y * TILE + x);
                let pixels = &mut self.pixels[root];
                if *pixels & NUMBERED == 0 {
                    let enough = *pixels >= min_pixels && usize::from(found) < most;
                    found += u8::from(enough);
                    *pixels = NUMBERED | if enough { u16::from(found) } else { 0 };
                }
                *label = (*pixels & !NUMBERED) as u8;
                if CODED && *label != 0 {
                    *label |= code << CODE_SHIFT;
                }
            }
        }
        found
    }

    /// Room for a count by size, while no tile is being labelled.
    pub(super) fn scratch(&mut self) -> &mut [u16] {
        &mut self.pixels
    }

    fn root(&mut self, mut place: usize) -> usize {
        loop {
            let parent = usize::from(self.parent[place]);
            if parent == place {
                return place;
            }
            self.parent[place] = self.parent[parent];
            place = usize::from(self.parent[place]);
        }
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b)] = a.min(b) as u16;
    }
}

/// Marks the count of a surface that has become its number.
const NUMBERED: u16 = 0x8000;
