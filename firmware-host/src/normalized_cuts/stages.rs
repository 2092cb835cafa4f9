//! From segments to cells, by the core's own stages.

use std::sync::{Mutex, MutexGuard, PoisonError};

use fencepost_core::{
    disparity::{DisparityPicture, DisparityPixel, Reason},
    error::ConfigError,
    geometry::DepthTable,
    ground::{GroundFinder, GroundPlane, Terrain},
    map::{MapBuilder, SectorDistances, View},
    obstacles::ObstacleFinder,
    surfaces::{Regions, Surfaces},
};

use super::{NormalizedCuts, Segmentation};
use crate::detector::{CELLS, DISPARITIES, PIXELS, SURFACES};

/// The stages of the core that come after the classes of surfaces.
pub(super) struct Stages {
    depth: DepthTable<DISPARITIES>,
    surfaces: Surfaces<PIXELS, SURFACES>,
    regions: Regions<SURFACES>,
    ground: GroundFinder,
    obstacles: ObstacleFinder,
    map: MapBuilder<CELLS>,
}

/// As large as the program's detector, so in memory that is there from the start, as that is.
static STAGES: Mutex<Stages> = Mutex::new(Stages {
    depth: DepthTable::new(),
    surfaces: Surfaces::new(),
    regions: Regions::new(),
    ground: GroundFinder::new(),
    obstacles: ObstacleFinder::new(),
    map: MapBuilder::new(),
});

/// The stages, for one picture at a time.
pub(super) fn lock() -> MutexGuard<'static, Stages> {
    // `configure` forgets everything, so what a run that panicked left behind does no harm.
    STAGES.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Stages {
    pub(super) fn configure(&mut self, cuts: &NormalizedCuts) -> Result<(), ConfigError> {
        let NormalizedCuts { core, pair, frame, height_known, .. } = cuts;
        let (width, height) = (pair.width as usize, pair.height as usize);
        self.depth.configure(pair, core.matching.min_disparity, core.matching.disparities);
        self.surfaces.configure(&core.surfaces, width, height)?;
        self.ground.configure(&core.ground, frame, *height_known, width * height)?;
        self.obstacles.configure(&core.obstacles)?;
        self.map.configure(&core.map, (core.obstacles.min_height_m, core.obstacles.clearance_m))
    }

    /// Finds ground, obstacles and cells. Each picture stands by itself.
    pub(super) fn run(&mut self, cuts: &NormalizedCuts, picture: DisparityPicture<'_>, result: &mut Segmentation) {
        // Another one may have been configured since; this one's values were good then.
        if self.configure(cuts).is_err() {
            return;
        }
        // Cut along the borders of segments, no surface of a tile is part of two of them.
        let (width, height) = result.size;
        let apart = |i: usize, other: usize| result.labels[i] != result.labels[other];
        let cut_pixel = |(i, pixel): (usize, &DisparityPixel)| {
            let (x, y) = (i % width, i / width);
            let at_border = (x + 1 < width && apart(i, i + 1)) || (y + 1 < height && apart(i, i + width));
            if at_border { DisparityPixel::none(Reason::SmallSurface) } else { *pixel }
        };
        let cut: Vec<DisparityPixel> = picture.pixels().iter().enumerate().map(cut_pixel).collect();
        let cut = DisparityPicture::new(&cut, width);

        self.surfaces.run(cut, &self.depth, &cuts.rays);
        for (i, label) in result.labels.iter().enumerate() {
            if let Some(place) = self.surfaces.place_at(i % width, i / width) {
                if let Some(surface) = self.surfaces.table_mut().get_mut(place) {
                    surface.class = result.segments[usize::from(*label)].surface.class;
                }
            }
        }
        let ground = self.ground.run(&mut self.surfaces, &mut self.regions, cut);
        let terrain = match ground {
            Some(plane) => self.ground.terrain(plane, self.surfaces.table()),
            None => Terrain::flat(GroundPlane::of_mount(&cuts.frame)),
        };
        let NormalizedCuts { core, pair, frame, place, rays, .. } = cuts;
        let detection = &mut result.detection;
        let found = &mut detection.obstacles;
        self.obstacles.run(&mut self.surfaces, &mut self.regions, cut, &terrain, place, found);
        // The last disparity has no neighbour to interpolate with and is never reported.
        let largest = f32::from(core.matching.min_disparity) + f32::from(core.matching.disparities) - 2.0;
        let view = View { pair, frame, place, rays, depth: &self.depth, nearest_m: pair.distance_m(largest) };
        self.map.run(&self.surfaces, picture, &view, &terrain, ground.is_some(), &mut detection.map);
        detection.ground = ground.map(|plane| plane.moved(place));
        detection.sectors = SectorDistances::of(&detection.map, core.map.sector_width_deg);
        result.table = self.surfaces.table().to_vec();
        let place_of = |i: usize| self.surfaces.place_at(i % width, i / width);
        result.places = (0..width * height).map(|i| place_of(i).map_or(u16::MAX, |place| place as u16)).collect();
    }
}
