//! Surfaces found by several threads, each in tiles of its own.
//!
//! What is found in a tile depends on nothing outside of it, so that any cut between rows of tiles gives the same. Where the surfaces
//! of a tile lie in the table depends on how many were found in those before: surfaces are counted first, then each band measures its
//! own into its part of the table.

use heapless::Vec;

use super::{
    CODES, KeepRule, Limits, Part, Surface, SurfaceClass, SurfaceReport, SurfaceSettings, Surfaces, TILE, TileWork,
    part::Table,
};
use crate::{
    arch::{self, Chosen, Steps},
    bands::{MAX_BANDS, Work, Workers, collected, cut, run_all},
    disparity::{DisparityPicture, DisparityPixel},
    geometry::{DepthTable, Rays},
};

impl<const PIXELS: usize, const SURFACES: usize> Surfaces<PIXELS, SURFACES> {
    /// As [`Self::run`], with the same result to the bit, in as many bands as there are `works` and one more.
    pub(crate) fn run_in_bands<const DISPARITIES: usize>(
        &mut self,
        picture: DisparityPicture<'_>,
        depth: &DepthTable<DISPARITIES>,
        rays: &Rays,
        works: &mut [&mut TileWork],
        workers: &mut impl Workers,
    ) -> SurfaceReport {
        self.tiles.clear();
        self.table.clear();
        if (picture.width(), picture.height()) != (self.width, self.height) {
            return SurfaceReport::default();
        }
        let found = self.label_in_bands(picture, depth, works, workers);
        let mut counts = found.iter();
        let total = found.iter().fold(0u32, |total, &found| total.saturating_add(found));
        if total as usize > SURFACES {
            // The table has no room for all of them: which are left out is for all tiles together to say.
            arch::compiled(self.chosen, MeasureWhole { stage: self, picture, depth, rays });
            return SurfaceReport { found: total, dropped: total.saturating_sub(self.table.len() as u32) };
        }
        let (across, down) = (tiles_in(self.width), tiles_in(self.height));
        // Cannot fail: `configure` made sure that there is room for every tile, and surfaces were counted.
        let _ = self.tiles.resize(across.saturating_mul(down), 0);
        let _ = self.table.resize_default(total as usize);
        let chosen = self.chosen;
        let (mut tiles, mut table) = (self.tiles.as_mut_slice(), self.table.as_mut_slice());
        let mut before = 0;
        let parts =
            parts(&self.settings, &self.limits, (self.width, self.height), &mut self.labels, &mut self.work, works);
        run_all(
            workers,
            parts.map(|part| {
                let count = counts.next().map_or(0, |&count| count as usize);
                let own_tiles = tiles.split_off_mut(..across.saturating_mul(tiles_in(part.height))).unwrap_or_default();
                let surfaces = table.split_off_mut(..count).unwrap_or_default();
                let slots = Slots { tiles: own_tiles, surfaces, before, tile: 0, len: 0 };
                before = before.saturating_add(count);
                MeasureBand { chosen, pixels: rows_of(picture, &part), part, depth, rays, slots }
            }),
        );
        SurfaceReport { found: total, dropped: 0 }
    }

    /// Numbers the surfaces of every tile; returns how many each band found.
    fn label_in_bands<const DISPARITIES: usize>(
        &mut self,
        picture: DisparityPicture<'_>,
        depth: &DepthTable<DISPARITIES>,
        works: &mut [&mut TileWork],
        workers: &mut impl Workers,
    ) -> Vec<u32, MAX_BANDS> {
        let covered = depth.covered();
        let chosen = self.chosen;
        let parts =
            parts(&self.settings, &self.limits, (self.width, self.height), &mut self.labels, &mut self.work, works);
        let bands = parts.map(|part| LabelBand {
            chosen,
            pixels: rows_of(picture, &part),
            part,
            covered: covered.clone(),
            found: 0,
        });
        collected(run_all(workers, bands).iter().map(|band| band.work.found))
    }
}

/// Tiles that so many pixels reach into.
const fn tiles_in(pixels: usize) -> usize {
    pixels.saturating_add(TILE - 1) / TILE
}

/// The parts of a picture, one for each band.
fn parts<'a>(
    settings: &'a SurfaceSettings,
    limits: &'a Limits,
    (width, height): (usize, usize),
    labels: &'a mut [u8],
    own: &'a mut TileWork,
    works: &'a mut [&mut TileWork],
) -> impl Iterator<Item = Part<'a>> {
    let bands = works.len().saturating_add(1).min(MAX_BANDS);
    let mut rest = labels.get_mut(..width.saturating_mul(height)).unwrap_or_default();
    let works = core::iter::once(own).chain(works.iter_mut().map(|work| &mut **work));
    cut(height, bands, TILE).zip(works).map(move |(rows, work)| {
        let labels = rest.split_off_mut(..rows.len().saturating_mul(width)).unwrap_or_default();
        let TileWork { union, moments, shifts } = work;
        Part { settings, limits, width, height: rows.len(), top: rows.start, labels, union, moments, shifts }
    })
}

/// The pixels of a part.
fn rows_of<'a>(picture: DisparityPicture<'a>, part: &Part<'_>) -> &'a [DisparityPixel] {
    let first = part.top.saturating_mul(part.width);
    let end = first.saturating_add(part.height.saturating_mul(part.width));
    picture.pixels().get(first..end).unwrap_or_default()
}

/// Numbers the surfaces of a band.
struct LabelBand<'a> {
    chosen: Chosen,
    pixels: &'a [DisparityPixel],
    part: Part<'a>,
    covered: core::ops::Range<u16>,
    found: u32,
}

impl Work for LabelBand<'_> {
    fn work(&mut self) {
        arch::compiled(self.chosen, LabelTiles(self));
    }
}

struct LabelTiles<'a, 'b>(&'a mut LabelBand<'b>);

impl Steps for LabelTiles<'_, '_> {
    #[inline(always)]
    fn run(self) {
        let LabelBand { pixels, part, covered, found, .. } = self.0;
        *found = part.label_tiles::<false>(pixels, covered);
    }
}

/// Measures the surfaces of a band.
struct MeasureBand<'a, const DISPARITIES: usize> {
    chosen: Chosen,
    pixels: &'a [DisparityPixel],
    part: Part<'a>,
    depth: &'a DepthTable<DISPARITIES>,
    rays: &'a Rays,
    slots: Slots<'a>,
}

impl<const DISPARITIES: usize> Work for MeasureBand<'_, DISPARITIES> {
    fn work(&mut self) {
        arch::compiled(self.chosen, MeasureTiles(self));
    }
}

struct MeasureTiles<'a, 'b, const DISPARITIES: usize>(&'a mut MeasureBand<'b, DISPARITIES>);

impl<const DISPARITIES: usize> Steps for MeasureTiles<'_, '_, DISPARITIES> {
    #[inline(always)]
    fn run(self) {
        let MeasureBand { pixels, part, depth, rays, slots, .. } = self.0;
        let mut keep = KeepRule::everything();
        let classes = [SurfaceClass::Undefined; CODES];
        part.measure_tiles::<DISPARITIES, false>(pixels, depth, rays, &mut keep, &classes, slots);
    }
}

/// Measures the surfaces of all tiles, whose numbers are known, and keeps the largest.
struct MeasureWhole<'a, const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize> {
    stage: &'a mut Surfaces<PIXELS, SURFACES>,
    picture: DisparityPicture<'a>,
    depth: &'a DepthTable<DISPARITIES>,
    rays: &'a Rays,
}

impl<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize> Steps
    for MeasureWhole<'_, PIXELS, SURFACES, DISPARITIES>
{
    #[inline(always)]
    fn run(self) {
        let (mut part, mut grown) = self.stage.whole();
        let mut keep = part.keep_largest::<false>(SURFACES);
        let classes = [SurfaceClass::Undefined; CODES];
        let pixels = self.picture.pixels();
        part.measure_tiles::<DISPARITIES, false>(pixels, self.depth, self.rays, &mut keep, &classes, &mut grown);
    }
}

/// The places in the tables for what a band finds: as many as it has found.
struct Slots<'a> {
    tiles: &'a mut [u16],
    surfaces: &'a mut [Surface],
    /// Surfaces of the bands before.
    before: usize,
    /// Tiles and surfaces so far.
    tile: usize,
    len: usize,
}

impl Table for Slots<'_> {
    fn begin_tile(&mut self) {
        if let Some(first) = self.tiles.get_mut(self.tile) {
            *first = self.before.saturating_add(self.len) as u16;
        }
        self.tile = self.tile.saturating_add(1);
    }

    fn push(&mut self, surface: Surface) -> bool {
        let Some(slot) = self.surfaces.get_mut(self.len) else { return false };
        *slot = surface;
        self.len = self.len.saturating_add(1);
        true
    }
}
