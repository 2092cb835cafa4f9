//! A detector that has its pictures looked at by several threads.

mod rows;

use heapless::Vec;

use super::{DetectError, Detection, Detector, Probe, Stage, interpreter::Hands};
use crate::{
    bands::{MAX_BANDS, Workers, collected, cut, run_all},
    disparity::DisparityPicture,
    geometry::{DepthTable, Rays},
    ground::Terrain,
    health::{Exposure, Ordinals, RowLooks, unit_of_bands},
    map::{MapBuilder, ObstacleMap, View, Votes},
    matching::Matcher,
    picture::Picture,
    surfaces::{SurfaceReport, Surfaces, TileWork},
    validate::SurfaceSize,
};
use rows::{BandRows, MatchBand};

/// What one more thread needs to work on pictures of a [`Detector`] of the same `WIDTH`, `DISPARITIES` and `CELLS`.
///
/// Nothing is to be configured, and nothing is kept from picture to picture: all that a band knows it is told anew. All zero at first.
pub struct Band<const WIDTH: usize, const DISPARITIES: usize, const CELLS: usize> {
    rows: [[u8; WIDTH]; 2],
    matcher: Matcher<WIDTH, DISPARITIES>,
    looks: RowLooks<WIDTH>,
    ordinals: Ordinals,
    surface_size: SurfaceSize<WIDTH>,
    tiles: TileWork,
    votes: Votes<CELLS>,
}

impl<const WIDTH: usize, const DISPARITIES: usize, const CELLS: usize> Band<WIDTH, DISPARITIES, CELLS> {
    /// Room for a band.
    pub const fn new() -> Self {
        Self {
            rows: [[0; WIDTH]; 2],
            matcher: Matcher::new(),
            looks: RowLooks::new(),
            ordinals: Vec::new(),
            surface_size: SurfaceSize::new(),
            tiles: TileWork::new(),
            votes: Votes::new(),
        }
    }
}

impl<const WIDTH: usize, const DISPARITIES: usize, const CELLS: usize> Default for Band<WIDTH, DISPARITIES, CELLS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<
    const PIXELS: usize,
    const WIDTH: usize,
    const DISPARITIES: usize,
    const GRID: usize,
    const SURFACES: usize,
    const OBSTACLES: usize,
    const CELLS: usize,
> Detector<PIXELS, WIDTH, DISPARITIES, GRID, SURFACES, OBSTACLES, CELLS>
{
    /// As [`Self::detect`], with the same result to the bit, by several threads: the picture is cut into one band more than there are
    /// `bands`, at most [`MAX_BANDS`], and `workers` work on them side by side.
    ///
    /// Rectification, matching, the look at the rows for the health, the validation, the surfaces, and the votes of the map
    /// and the cells are cut; the ground and the obstacles are not. `probe` is told of rectification, matching and health as
    /// [`Stage::Match`], since they run at the same time; what other stages take is the time of all threads together.
    ///
    /// # Errors
    /// [`DetectError`]; the detection is empty then.
    ///
    /// # Bound
    /// That of [`Self::detect`]; each seam between bands has some 20 rows rectified twice and made ready for matching.
    pub fn detect_in_bands(
        &mut self,
        left: &Picture<'_>,
        right: &Picture<'_>,
        bands: &mut [Band<WIDTH, DISPARITIES, CELLS>],
        workers: &mut impl Workers,
        probe: &mut impl Probe,
    ) -> Result<&Detection<OBSTACLES, CELLS>, DetectError> {
        let setup = self.begin(left, right)?;
        let (width, height) = (setup.pair.width as usize, setup.pair.height as usize);
        let others = bands.len().min(MAX_BANDS - 1);
        let bands = bands.get_mut(..others).unwrap_or_default();

        probe.enter(Stage::Match);
        let exposures = self.match_bands([left, right], (width, height), bands, workers);

        probe.enter(Stage::Validate);
        let disparity = self.disparity.get_mut(..width.saturating_mul(height)).unwrap_or_default();
        {
            let mut stages = collected(bands.iter_mut().map(|band| &mut band.surface_size));
            self.surface_size.run_in_bands(disparity, &mut stages, workers);
        }

        let picture = DisparityPicture::new(disparity, width);
        self.interpreter.run(picture, &setup, &mut self.detection, &mut Many { bands, workers }, probe);

        probe.enter(Stage::Health);
        Ok(self.judge(left, right, &setup, exposures))
    }

    /// Rectifies and matches, each band row by row; returns how the pictures are exposed.
    fn match_bands(
        &mut self,
        pictures: [&Picture<'_>; 2],
        (width, height): (usize, usize),
        bands: &mut [Band<WIDTH, DISPARITIES, CELLS>],
        workers: &mut impl Workers,
    ) -> [Exposure; 2] {
        self.content.begin(width, height, self.search_range());
        for band in bands.iter_mut() {
            band.matcher.configure_as(&self.matcher);
        }
        let count = bands.len().saturating_add(1);
        let all = cut(height, count, unit_of_bands(height));
        for (band, rows) in bands.iter_mut().zip(all.clone().skip(1)) {
            band.looks.begin_band(&self.content.looks, width, rows.start);
            band.ordinals.clear();
        }
        let Self { rectifier, rows, matcher, content, disparity, .. } = self;
        let rectifier = &*rectifier;
        let own = (rows, matcher, &mut content.looks, None);
        let others = bands.iter_mut().map(|band| {
            let Band { rows, matcher, looks, ordinals, .. } = band;
            (rows, matcher, looks, Some(ordinals))
        });
        let mut rest = disparity.get_mut(..width.saturating_mul(height)).unwrap_or_default();
        let rooms = (0..count).zip(core::iter::once(own).chain(others));
        let jobs = all.zip(rooms).map(|(rows, (index, room))| {
            let (pair, matcher, looks, ordinals) = room;
            let rows = BandRows::new(rows, height, matcher.settings());
            let disparity = rest.split_off_mut(..rows.out.len().saturating_mul(width)).unwrap_or_default();
            // The first band sees to how the left picture is exposed, the last one to the right one.
            let exposed = [0, count.saturating_sub(1)].map(|band| (band == index).then_some(Exposure::default()));
            MatchBand { rectifier, pictures, pair, matcher, looks, ordinals, rows, width, disparity, exposed }
        });
        let mut exposed = [Exposure::default(); 2];
        for done in run_all(workers, jobs).iter() {
            for (exposed, seen) in exposed.iter_mut().zip(done.work.exposed) {
                *exposed = seen.unwrap_or(*exposed);
            }
        }
        self.matcher.set_height(height);
        for band in bands.iter() {
            self.content.looks.append(&band.looks, &band.ordinals);
        }
        exposed
    }
}

/// The bands and those who work on them, for the stages behind the matching.
struct Many<'a, W, const WIDTH: usize, const DISPARITIES: usize, const CELLS: usize> {
    bands: &'a mut [Band<WIDTH, DISPARITIES, CELLS>],
    workers: &'a mut W,
}

impl<W: Workers, const WIDTH: usize, const BAND_DISPARITIES: usize, const CELLS: usize> Hands<CELLS>
    for Many<'_, W, WIDTH, BAND_DISPARITIES, CELLS>
{
    fn find_surfaces<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize>(
        &mut self,
        surfaces: &mut Surfaces<PIXELS, SURFACES>,
        picture: DisparityPicture<'_>,
        depth: &DepthTable<DISPARITIES>,
        rays: &Rays,
    ) -> SurfaceReport {
        let mut works = collected(self.bands.iter_mut().map(|band| &mut band.tiles));
        surfaces.run_in_bands(picture, depth, rays, &mut works, self.workers)
    }

    fn fill_map<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize>(
        &mut self,
        builder: &mut MapBuilder<CELLS>,
        surfaces: &Surfaces<PIXELS, SURFACES>,
        picture: DisparityPicture<'_>,
        view: &View<'_, DISPARITIES>,
        terrain: &Terrain,
        ground_seen: bool,
        map: &mut ObstacleMap<CELLS>,
    ) {
        let mut votes = collected(self.bands.iter_mut().map(|band| &mut band.votes));
        builder.run_in_bands(surfaces, picture, view, terrain, ground_seen, map, &mut votes, self.workers);
    }
}

#[cfg(test)]
mod tests;
