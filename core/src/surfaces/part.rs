//! Rows of tiles of a picture: the whole of it, or what one of several threads works on.

use core::ops::Range;

use heapless::Vec;

use super::{
    CODES, KeepRule, MAX_SURFACES, Surface, SurfaceClass, SurfaceSettings, Tile, moments::Moments, tile::TileUnion,
};
use crate::{
    disparity::DisparityPixel,
    geometry::{DepthTable, Rays},
};

/// What is worked with while the surfaces of one tile are found and measured.
pub(crate) struct TileWork {
    pub(super) union: TileUnion,
    pub(super) moments: [Moments; MAX_SURFACES],
    pub(super) shifts: [u8; MAX_SURFACES],
}

impl TileWork {
    pub(crate) const fn new() -> Self {
        Self { union: TileUnion::new(), moments: [Moments::ZERO; MAX_SURFACES], shifts: [0; MAX_SURFACES] }
    }
}

/// Cosines of the limits of the classes.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    pub(super) least_dot_of_horizontal: f32,
    pub(super) most_dot_of_vertical: f32,
}

impl Limits {
    pub(super) const UNSET: Self = Self { least_dot_of_horizontal: 0.0, most_dot_of_vertical: 0.0 };

    pub(super) fn new(settings: &SurfaceSettings) -> Self {
        Self {
            least_dot_of_horizontal: libm::cosf(settings.horizontal_deg.to_radians()),
            most_dot_of_vertical: libm::cosf(settings.vertical_deg.to_radians()),
        }
    }
}

/// Rows of tiles, from row `top` of the picture on; rows and tiles are counted from there, and so are pixels that are given.
pub(super) struct Part<'a> {
    pub(super) settings: &'a SurfaceSettings,
    pub(super) limits: &'a Limits,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) top: usize,
    pub(super) labels: &'a mut [u8],
    pub(super) union: &'a mut TileUnion,
    pub(super) moments: &'a mut [Moments; MAX_SURFACES],
    pub(super) shifts: &'a mut [u8; MAX_SURFACES],
}

impl Part<'_> {
    /// Finds the surfaces of all tiles; returns how many there are.
    #[inline(always)]
    pub(super) fn label_tiles<const CODED: bool>(&mut self, pixels: &[DisparityPixel], covered: &Range<u16>) -> u32 {
        let mut found = 0u32;
        for tile in Tile::all(self.width, self.height) {
            let Self { union, settings, labels, width, .. } = self;
            let tile = union.label::<CODED>(pixels, *width, tile, settings, covered, labels);
            found = found.saturating_add(u32::from(tile));
        }
        found
    }

    /// Measures the surfaces of all tiles and appends those that are kept to `table`.
    #[inline(always)]
    pub(super) fn measure_tiles<const DISPARITIES: usize, const CODED: bool>(
        &mut self,
        pixels: &[DisparityPixel],
        depth: &DepthTable<DISPARITIES>,
        rays: &Rays,
        keep: &mut KeepRule,
        classes: &[SurfaceClass; CODES],
        table: &mut impl Table,
    ) {
        for tile in Tile::all(self.width, self.height) {
            table.begin_tile();
            let given = if CODED { Some(self.take_classes(tile, classes)) } else { None };
            self.measure(pixels, tile, depth, rays, keep, given.as_ref(), table);
        }
    }
}

/// Where surfaces are written to, tile by tile.
pub(super) trait Table {
    /// What follows belongs to the next tile.
    fn begin_tile(&mut self);
    /// Appends a surface; says whether there was room.
    fn push(&mut self, surface: Surface) -> bool;
}

/// The tables of the whole picture, which grow.
pub(super) struct Growing<'a, const SURFACES: usize> {
    pub(super) tiles: &'a mut Vec<u16, SURFACES, u16>,
    pub(super) table: &'a mut Vec<Surface, SURFACES, u16>,
}

impl<const SURFACES: usize> Table for Growing<'_, SURFACES> {
    #[inline(always)]
    fn begin_tile(&mut self) {
        // Cannot fail: `configure` made sure that there is room for every tile.
        let _ = self.tiles.push(self.table.len() as u16);
    }

    #[inline(always)]
    fn push(&mut self, surface: Surface) -> bool {
        self.table.push(surface).is_ok()
    }
}
