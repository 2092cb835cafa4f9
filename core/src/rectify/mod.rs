//! Rectification: raw pictures in, rows in line out.
//!
//! Pinhole cameras with radial-tangential lenses of 4, 5 or 8 coefficients. A map of every pixel would take more memory
//! than the pictures, so it is sampled every 8 pixels and interpolated in integers, with the same bits on every processor.
//! No rectified picture is stored: rows are made as they are asked for.

mod cameras;
mod grid;
mod lens;
mod sample;

use core::ops::Range;

use crate::{
    arch::{self, Chosen},
    error::{ConfigError, ConfigProblem},
    geometry::{RectifiedPair, StereoCalibration},
    picture::Picture,
};

use cameras::CameraMap;
use grid::{Grid, side_nodes};
use sample::{SampleRow, Source};

/// One of the two cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The left camera.
    Left,
    /// The right camera.
    Right,
}

/// Nodes per camera that rectified pictures of `width x height` need: the `GRID` of a [`Rectifier`].
pub const fn grid_nodes(width: usize, height: usize) -> usize {
    side_nodes(width).saturating_mul(side_nodes(height))
}

/// Makes rectified rows from raw pictures, for rectified pictures of up to `GRID` nodes ([`grid_nodes`]).
///
/// Takes 8 bytes per node of `GRID`: 25 KiB for 512 x 384. A detector for pairs that arrive rectified does with a `GRID` of 0.
#[derive(Clone, Debug)]
pub struct Rectifier<const GRID: usize> {
    pair: RectifiedPair,
    /// Whether there is something to do: not for pictures that arrive rectified. False at first, so that a rectifier that is
    /// not configured is all zero.
    remaps: bool,
    left: Camera<GRID>,
    right: Camera<GRID>,
    chosen: Chosen,
}

#[derive(Clone, Debug)]
struct Camera<const GRID: usize> {
    map: CameraMap,
    grid: Grid<GRID>,
}

impl<const GRID: usize> Rectifier<GRID> {
    /// A rectifier without a calibration: all of its rows are empty.
    pub const fn new() -> Self {
        let pair = RectifiedPair {
            width: 0,
            height: 0,
            focal_px: 0.0,
            cx: 0.0,
            cy: 0.0,
            baseline_m: 0.0,
            disparity_offset_px: 0.0,
        };
        Self { pair, remaps: false, left: Camera::new(), right: Camera::new(), chosen: Chosen::PLAIN }
    }

    /// Takes a calibration and returns the rectified pair that the rows belong to.
    ///
    /// Where the calibration does not bring rectified cameras they are chosen as OpenCV's `stereoRectify` does (Bouguet):
    /// the rotation is split in half between both cameras and the rows are laid along the baseline; both have one
    /// principal point, the size of the left raw picture, and the largest field of view of which both fill every pixel.
    ///
    /// # Errors
    /// The first value that cannot be used, or more nodes than `GRID`. The rectifier then stays as it was.
    ///
    /// # Bound
    /// 10 evaluations of the lens model for each node of the grid, about 8000 more to choose the cameras.
    pub fn configure(&mut self, calibration: &StereoCalibration) -> Result<RectifiedPair, ConfigError> {
        match calibration {
            StereoCalibration::Rectified(pair) => {
                pair.check()?;
                self.pair = *pair;
                self.remaps = false;
            }
            StereoCalibration::Raw(raw) => {
                let (pair, [left, right]) = CameraMap::pair(raw)?;
                let (width, height) = (pair.width as usize, pair.height as usize);
                let needed = grid_nodes(width, height);
                if needed > GRID {
                    let problem = ConfigProblem::OverCapacity { needed, capacity: GRID };
                    return Err(ConfigError::new("calibration (nodes of the rectification map)", problem));
                }
                self.left.fill(left, width, height);
                self.right.fill(right, width, height);
                self.pair = pair;
                self.remaps = true;
            }
        }
        Ok(self.pair)
    }

    /// Has rows made with the instructions of a backend.
    pub(crate) const fn choose(&mut self, chosen: Chosen) {
        self.chosen = chosen;
    }

    /// The rectified pair; of width and height 0 before the first calibration.
    pub const fn pair(&self) -> &RectifiedPair {
        &self.pair
    }

    /// Width and height of the pictures as they arrive.
    pub const fn raw_size(&self, side: Side) -> (usize, usize) {
        if !self.remaps {
            return (self.pair.width as usize, self.pair.height as usize);
        }
        self.camera(side).map.raw_size()
    }

    /// The rotation from the raw camera's frame into the rectified one, row by row; none for pairs that arrive rectified.
    pub const fn rotation(&self, side: Side) -> Option<&[[f32; 3]; 3]> {
        if self.remaps { Some(self.camera(side).map.rotation()) } else { None }
    }

    /// Writes row `y` of the rectified picture to `out` and returns its valid columns: the longest run of pixels whose
    /// source lies within the raw picture. All other pixels of `out` are 0.
    ///
    /// Grey values are bilinear with weights of 1/64 px; pairs that arrive rectified are copied. Of an `out` shorter than
    /// the row only the beginning is written; below the picture the row is empty. Of a raw picture larger than the
    /// calibration says the upper left part is used.
    ///
    /// # Bound
    /// Four pixels read per pixel of the row.
    pub fn row(&self, side: Side, raw: &Picture<'_>, y: usize, out: &mut [u8]) -> Range<usize> {
        let (width, height) = (self.pair.width as usize, self.pair.height as usize);
        let (row, rest) = out.split_at_mut(out.len().min(if y < height { width } else { 0 }));
        rest.fill(0);
        if row.is_empty() {
            return 0..0;
        }
        if self.remaps {
            let camera = self.camera(side);
            let source = Source::new(raw, camera.map.raw_size());
            let mut longest = 0..0;
            arch::compiled(self.chosen, SampleRow { grid: &camera.grid, source, y, out: row, longest: &mut longest });
            return longest;
        }
        let given = if y < raw.height() { raw.row(y) } else { &[] };
        let (copied, beyond) = row.split_at_mut(row.len().min(given.len()));
        for (to, from) in copied.iter_mut().zip(given) {
            *to = *from;
        }
        beyond.fill(0);
        0..copied.len()
    }

    /// Where the raw picture shows what belongs at `(u, v)` of the rectified one, px, by the full model in f32. The place
    /// may lie outside of the picture; `None` where the lens model folds back or the ray points backwards.
    pub fn source_of(&self, side: Side, u: f32, v: f32) -> Option<(f32, f32)> {
        if !self.remaps {
            return Some((u, v));
        }
        self.camera(side).map.source(u, v).map(|[x, y]| (x, y))
    }

    const fn camera(&self, side: Side) -> &Camera<GRID> {
        match side {
            Side::Left => &self.left,
            Side::Right => &self.right,
        }
    }
}

impl<const GRID: usize> Default for Rectifier<GRID> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const GRID: usize> Camera<GRID> {
    const fn new() -> Self {
        Self { map: CameraMap::none(), grid: Grid::new() }
    }

    fn fill(&mut self, map: CameraMap, width: usize, height: usize) {
        self.map = map;
        self.grid.fill(&map, width, height);
    }
}

#[cfg(test)]
mod tests;
