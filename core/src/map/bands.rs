//! A map filled by several threads: each collects votes over tiles of its own, and decides on cells of its own. What a cell is told
//! is counted in whole numbers that only grow, up to where they stay: it does not matter who counted.

use super::{
    Cell, MapBuilder, MapSettings, ObstacleMap, View,
    builder::Evidence,
    votes::{Collect, Common, TileRows},
};
use crate::{
    arch::{self, Chosen},
    bands::{Work, Workers, cut, run_all},
    disparity::DisparityPicture,
    ground::Terrain,
    surfaces::{MAX_TILE_SURFACES, Surfaces},
};

/// What the pixels of one band say.
pub(crate) struct Votes<const CELLS: usize> {
    evidence: [Evidence; CELLS],
    common: [Common; MAX_TILE_SURFACES],
}

impl<const CELLS: usize> Votes<CELLS> {
    pub(crate) const fn new() -> Self {
        const NOTHING: Evidence = Evidence { obstacle: 0, ground: 0, unclear: 0, height_dm: 0 };
        Self { evidence: [NOTHING; CELLS], common: [Common::UNSET; MAX_TILE_SURFACES] }
    }
}

impl<const CELLS: usize> MapBuilder<CELLS> {
    /// As [`Self::run`], with the same result to the bit, in as many bands as there are `votes` and one more.
    #[expect(clippy::too_many_arguments, reason = "those of `run`, and who works on them")]
    pub(crate) fn run_in_bands<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize>(
        &mut self,
        surfaces: &Surfaces<PIXELS, SURFACES>,
        picture: DisparityPicture<'_>,
        view: &View<'_, DISPARITIES>,
        ground: &Terrain,
        ground_seen: bool,
        map: &mut ObstacleMap<CELLS>,
        votes: &mut [&mut Votes<CELLS>],
        workers: &mut impl Workers,
    ) {
        self.begin();
        let cells = self.settings.geometry.len();
        if (picture.width(), picture.height()) == surfaces.size() {
            let (heights, chosen) = (self.obstacle_heights_m, self.chosen);
            let Self { settings, evidence, common, .. } = self;
            let settings = &*settings;
            let bands = votes.len().saturating_add(1);
            let own = (evidence.get_mut(..cells).unwrap_or_default(), common);
            let others = votes.iter_mut().map(|votes| {
                let Votes { evidence, common } = &mut **votes;
                let evidence = evidence.get_mut(..cells).unwrap_or_default();
                evidence.fill(Evidence::default());
                (evidence, common)
            });
            let works = core::iter::once(own).chain(others);
            // Most of what votes lies in the lower rows, so that each band takes some of them.
            let rows = (0..bands).map(|first| TileRows { first, every: bands });
            let jobs = rows.zip(works).map(|(rows, (evidence, common))| CollectBand {
                chosen,
                settings,
                obstacle_heights_m: heights,
                evidence,
                common,
                surfaces,
                picture,
                view,
                ground,
                rows,
            });
            run_all(workers, jobs);
            for votes in votes.iter() {
                for (all, votes) in self.evidence.iter_mut().zip(&votes.evidence).take(cells) {
                    all.add(votes);
                }
            }
        }
        // As `finish`: each cell is decided on by itself.
        map.geometry = self.settings.geometry;
        map.cells.clear();
        // Cannot fail: `configure` made sure that there is room.
        let _ = map.cells.resize(cells, Cell::default());
        let (builder, mut rest) = (&*self, map.cells.as_mut_slice());
        let jobs = cut(cells, votes.len().saturating_add(1), 1).map(|range| {
            let cells = rest.split_off_mut(..range.len()).unwrap_or_default();
            DecideBand { builder, picture, view, ground, ground_seen, first: range.start, cells }
        });
        run_all(workers, jobs);
        self.compare_cells(view.place, map);
    }
}

impl Evidence {
    /// Adds what was counted elsewhere.
    fn add(&mut self, other: &Self) {
        self.obstacle = self.obstacle.saturating_add(other.obstacle);
        self.ground = self.ground.saturating_add(other.ground);
        self.unclear = self.unclear.saturating_add(other.unclear);
        self.height_dm = self.height_dm.max(other.height_dm);
    }
}

/// Collects the votes of a band.
struct CollectBand<'a, const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize> {
    chosen: Chosen,
    settings: &'a MapSettings,
    obstacle_heights_m: (f32, f32),
    evidence: &'a mut [Evidence],
    common: &'a mut [Common; MAX_TILE_SURFACES],
    surfaces: &'a Surfaces<PIXELS, SURFACES>,
    picture: DisparityPicture<'a>,
    view: &'a View<'a, DISPARITIES>,
    ground: &'a Terrain,
    rows: TileRows,
}

impl<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize> Work
    for CollectBand<'_, PIXELS, SURFACES, DISPARITIES>
{
    fn work(&mut self) {
        let Self { chosen, settings, obstacle_heights_m, evidence, common, surfaces, picture, view, ground, rows } =
            self;
        let collect = Collect {
            settings,
            obstacle_heights_m: *obstacle_heights_m,
            evidence,
            common,
            surfaces,
            picture: *picture,
            view,
            ground,
            rows: *rows,
        };
        arch::compiled(*chosen, collect);
    }
}

/// Decides on some of the cells.
struct DecideBand<'a, const CELLS: usize, const DISPARITIES: usize> {
    builder: &'a MapBuilder<CELLS>,
    picture: DisparityPicture<'a>,
    view: &'a View<'a, DISPARITIES>,
    ground: &'a Terrain,
    ground_seen: bool,
    /// Place in the table of the first of `cells`.
    first: usize,
    cells: &'a mut [Cell],
}

impl<const CELLS: usize, const DISPARITIES: usize> Work for DecideBand<'_, CELLS, DISPARITIES> {
    fn work(&mut self) {
        let Self { builder, picture, view, ground, ground_seen, first, cells } = self;
        let evidence = builder.evidence.get(*first..).unwrap_or_default();
        for ((cell, evidence), index) in cells.iter_mut().zip(evidence).zip(*first..usize::MAX) {
            *cell = builder.decide(index, evidence, *picture, view, ground, *ground_seen);
        }
    }
}
