//! From the disparity picture to cells: the stages that depend on the method.

use super::{Detection, MemoryPart, Probe, Setup, Stage};
use crate::{
    arch::Chosen,
    disparity::DisparityPicture,
    error::ConfigError,
    geometry::{DepthTable, Rays},
    ground::{GroundFinder, GroundPlane, Terrain},
    map::{Evidence, MapBuilder, ObstacleMap, View},
    methods::{
        COST_MAP_CLASSES, ConfidenceSettings, CostMap, DetectorKind, Detectors, DisparitySegments,
        GROUND_DEVIATION_CLASSES, GroundDeviation, OtherMap, PIXEL_NORMAL_CLASSES, PixelNormals,
    },
    obstacles::ObstacleFinder,
    settings::Settings,
    surfaces::{Regions, SurfaceReport, Surfaces},
};

/// Runs the detector that was chosen, and the one that checks it. Both use the same tables, one after the other; the one that
/// checks comes first and leaves nothing but a byte for each cell.
pub(super) struct Interpreter<
    const PIXELS: usize,
    const WIDTH: usize,
    const DISPARITIES: usize,
    const SURFACES: usize,
    const CELLS: usize,
> {
    detectors: Detectors,
    confidence: ConfidenceSettings,
    pub(super) depth: DepthTable<DISPARITIES>,
    pub(super) surfaces: Surfaces<PIXELS, SURFACES>,
    regions: Regions<SURFACES>,
    ground: GroundFinder,
    /// The ground that the checking detector holds: each of the two has its own.
    ground_of_check: Option<GroundPlane>,
    obstacles: ObstacleFinder,
    map: MapBuilder<CELLS>,
    cost_map: CostMap,
    ground_deviation: GroundDeviation,
    segments: DisparitySegments,
    pixel_normals: PixelNormals<WIDTH>,
    other: OtherMap<CELLS>,
}

/// Who does the stages that can be cut into bands.
pub(super) trait Hands<const CELLS: usize> {
    /// Finds the surfaces: [`Surfaces::run`].
    fn find_surfaces<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize>(
        &mut self,
        surfaces: &mut Surfaces<PIXELS, SURFACES>,
        picture: DisparityPicture<'_>,
        depth: &DepthTable<DISPARITIES>,
        rays: &Rays,
    ) -> SurfaceReport;

    /// Fills the map: [`MapBuilder::run`].
    #[expect(clippy::too_many_arguments, reason = "those of `MapBuilder::run`")]
    fn fill_map<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize>(
        &mut self,
        builder: &mut MapBuilder<CELLS>,
        surfaces: &Surfaces<PIXELS, SURFACES>,
        picture: DisparityPicture<'_>,
        view: &View<'_, DISPARITIES>,
        terrain: &Terrain,
        ground_seen: bool,
        map: &mut ObstacleMap<CELLS>,
    );
}

/// The thread that calls.
pub(super) struct Alone;

impl<const CELLS: usize> Hands<CELLS> for Alone {
    fn find_surfaces<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize>(
        &mut self,
        surfaces: &mut Surfaces<PIXELS, SURFACES>,
        picture: DisparityPicture<'_>,
        depth: &DepthTable<DISPARITIES>,
        rays: &Rays,
    ) -> SurfaceReport {
        surfaces.run(picture, depth, rays)
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
        builder.run(surfaces, picture, view, terrain, ground_seen, map);
    }
}

/// Which of the two detectors of a frame runs.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Turn {
    Main,
    Check,
}

impl<const PIXELS: usize, const WIDTH: usize, const DISPARITIES: usize, const SURFACES: usize, const CELLS: usize>
    Interpreter<PIXELS, WIDTH, DISPARITIES, SURFACES, CELLS>
{
    /// All zero.
    pub(super) const fn new() -> Self {
        Self {
            detectors: Detectors::DEFAULT,
            confidence: ConfidenceSettings::UNSET,
            depth: DepthTable::new(),
            surfaces: Surfaces::new(),
            regions: Regions::new(),
            ground: GroundFinder::new(),
            ground_of_check: None,
            obstacles: ObstacleFinder::new(),
            map: MapBuilder::new(),
            cost_map: CostMap::new(),
            ground_deviation: GroundDeviation::new(),
            segments: DisparitySegments::new(),
            pixel_normals: PixelNormals::new(),
            other: OtherMap::new(),
        }
    }

    /// What its size is made of; see [`Detector::memory_parts`](super::Detector::memory_parts).
    pub(super) const fn memory_parts() -> [MemoryPart; 9] {
        [
            MemoryPart::of::<DepthTable<DISPARITIES>>("triangulate"),
            MemoryPart::of::<Surfaces<PIXELS, SURFACES>>("surfaces"),
            MemoryPart::of::<Regions<SURFACES>>("regions"),
            MemoryPart::of::<GroundFinder>("ground").and::<Option<GroundPlane>>(),
            MemoryPart::of::<ObstacleFinder>("obstacles"),
            MemoryPart::of::<MapBuilder<CELLS>>("map"),
            MemoryPart::of::<CostMap>("other_methods").and::<GroundDeviation>().and::<DisparitySegments>(),
            MemoryPart::of::<PixelNormals<WIDTH>>("pixel_normals"),
            MemoryPart::of::<OtherMap<CELLS>>("cross_check"),
        ]
    }

    /// Takes the settings of all detectors, so that a mistake in any of them is told whichever is chosen.
    pub(super) fn configure(
        &mut self,
        settings: &Settings,
        setup: &Setup,
        height_known: bool,
    ) -> Result<(), ConfigError> {
        let Setup { pair, frame, .. } = setup;
        let (width, height) = (pair.width as usize, pair.height as usize);
        let pixels = width.saturating_mul(height);
        settings.check_detectors()?;
        settings.confidence.check()?;
        self.surfaces.configure(&settings.surfaces, width, height)?;
        self.depth.configure(pair, settings.matching.min_disparity, settings.matching.disparities);
        self.ground.configure(&settings.ground, frame, height_known, pixels)?;
        self.ground_of_check = None;
        self.obstacles.configure(&settings.obstacles, pair.focal_px)?;
        self.map.configure(&settings.map, (settings.obstacles.min_height_m, settings.obstacles.clearance_m))?;
        self.cost_map.configure(&settings.cost_map, &settings.ground, pixels)?;
        self.ground_deviation.configure(&settings.ground_deviation, &settings.ground, pair, frame, height_known)?;
        self.segments.configure(&settings.disparity_segments, &settings.ground, pixels)?;
        self.pixel_normals.configure(&settings.pixel_normals, &settings.surfaces, width)?;
        self.detectors = Detectors::new(settings.detector, settings.cross_check);
        self.confidence = settings.confidence;
        Ok(())
    }

    /// Has the stages run with the instructions of a backend.
    pub(super) const fn choose(&mut self, chosen: Chosen) {
        self.surfaces.choose(chosen);
        self.ground.choose(chosen);
        self.map.choose(chosen);
    }

    /// Forgets the ground of earlier frames.
    pub(super) fn forget(&mut self) {
        self.ground.forget();
        self.ground_of_check = None;
    }

    /// Finds ground, obstacles and cells in a disparity picture. `detection` is empty before.
    pub(super) fn run<const OBSTACLES: usize>(
        &mut self,
        picture: DisparityPicture<'_>,
        setup: &Setup,
        detection: &mut Detection<OBSTACLES, CELLS>,
        hands: &mut impl Hands<CELLS>,
        probe: &mut impl Probe,
    ) {
        let cross_check = self.detectors.cross_check();
        if let Some(kind) = cross_check {
            self.find(kind, Turn::Check, picture, setup, detection, hands, probe);
            self.other.keep(&detection.map);
            detection.clear();
        }
        let report = self.find(self.detectors.main(), Turn::Main, picture, setup, detection, hands, probe);
        detection.detectors = self.detectors;
        if cross_check.is_some() {
            self.other.check(&mut detection.map, &self.confidence);
        }
        detection.statistics.count((picture, self.map.chosen()), report, self.surfaces.table(), &detection.map);
    }

    /// Runs one detector.
    #[expect(clippy::too_many_arguments, reason = "what a frame has, input and output")]
    fn find<const OBSTACLES: usize>(
        &mut self,
        kind: DetectorKind,
        turn: Turn,
        picture: DisparityPicture<'_>,
        setup: &Setup,
        detection: &mut Detection<OBSTACLES, CELLS>,
        hands: &mut impl Hands<CELLS>,
        probe: &mut impl Probe,
    ) -> SurfaceReport {
        let (report, ground) = match kind {
            DetectorKind::SurfaceNormals => {
                probe.enter(Stage::Surfaces);
                let report = hands.find_surfaces(&mut self.surfaces, picture, &self.depth, &setup.rays);
                (report, self.level_surfaces(turn, picture, setup, probe))
            }
            DetectorKind::PixelNormals => {
                probe.enter(Stage::Surfaces);
                let Setup { pair, frame, rays, .. } = setup;
                self.pixel_normals.classify(picture, pair, frame, &self.depth, self.surfaces.codes_mut());
                let report = self.surfaces.run_coded(picture, &self.depth, rays, &PIXEL_NORMAL_CLASSES);
                (report, self.level_surfaces(turn, picture, setup, probe))
            }
            DetectorKind::CostMap => self.columns(picture, setup, probe),
            DetectorKind::GroundDeviation => self.deviations(picture, setup, probe),
            DetectorKind::DisparitySegments => {
                probe.enter(Stage::Surfaces);
                let report = hands.find_surfaces(&mut self.surfaces, picture, &self.depth, &setup.rays);
                probe.enter(Stage::Ground);
                (report, self.segments.run(&mut self.surfaces, &mut self.regions, picture, &setup.frame))
            }
        };
        let bends = matches!(kind, DetectorKind::SurfaceNormals | DetectorKind::PixelNormals);
        if !bends {
            self.ground.flatten(ground.unwrap_or_else(|| GroundPlane::of_mount(&setup.frame)));
        }
        let terrain = self.ground.terrain();

        probe.enter(Stage::Obstacles);
        let found = &mut detection.obstacles;
        detection.statistics.obstacles_dropped =
            self.obstacles.run(&mut self.surfaces, &mut self.regions, picture, terrain, &setup.place, found);

        probe.enter(Stage::Map);
        let view = view(setup, &self.depth);
        let (ground_seen, map) = (ground.is_some(), &mut detection.map);
        match kind {
            DetectorKind::CostMap => {
                let verdict = |counted: &Evidence, cell| self.cost_map.verdict(counted, cell, ground_seen);
                self.map.finish(picture, &view, terrain, ground_seen, map, verdict);
            }
            DetectorKind::DisparitySegments => {
                self.map.begin();
                self.segments.vote(&self.surfaces, picture, &view, &mut self.map);
                self.map.finish(picture, &view, terrain, ground_seen, map, |_, cell| cell);
            }
            DetectorKind::SurfaceNormals | DetectorKind::PixelNormals | DetectorKind::GroundDeviation => {
                hands.fill_map(&mut self.map, &self.surfaces, picture, &view, terrain, ground_seen, map);
            }
        }
        detection.ground = ground.map(|plane| plane.moved(&setup.place));
        report
    }

    /// The ground by its level surfaces, or that of an earlier frame.
    fn level_surfaces(
        &mut self,
        turn: Turn,
        picture: DisparityPicture<'_>,
        setup: &Setup,
        probe: &mut impl Probe,
    ) -> Option<GroundPlane> {
        probe.enter(Stage::Ground);
        if turn == Turn::Check {
            self.ground.exchange(&mut self.ground_of_check);
        }
        let found = self.ground.run(&mut self.surfaces, &mut self.regions, picture, (&self.depth, &setup.rays));
        if turn == Turn::Check {
            self.ground.exchange(&mut self.ground_of_check);
        }
        found
    }

    /// The ground by flat columns, and pixels by their height above it.
    fn columns(
        &mut self,
        picture: DisparityPicture<'_>,
        setup: &Setup,
        probe: &mut impl Probe,
    ) -> (SurfaceReport, Option<GroundPlane>) {
        let view = view(setup, &self.depth);
        probe.enter(Stage::Ground);
        let ground = self.cost_map.ground(picture, &view, &mut self.map);
        probe.enter(Stage::Surfaces);
        let plane = ground.unwrap_or_else(|| GroundPlane::of_mount(&setup.frame));
        self.cost_map.count(picture, &view, &plane, &mut self.map, self.surfaces.codes_mut());
        (self.surfaces.run_coded(picture, &self.depth, &setup.rays, &COST_MAP_CLASSES), ground)
    }

    /// The ground by consensus of the disparities, and pixels by their deviation from it.
    fn deviations(
        &mut self,
        picture: DisparityPicture<'_>,
        setup: &Setup,
        probe: &mut impl Probe,
    ) -> (SurfaceReport, Option<GroundPlane>) {
        probe.enter(Stage::Ground);
        let found = self.ground_deviation.ground(picture);
        probe.enter(Stage::Surfaces);
        let codes = self.surfaces.codes_mut();
        codes.fill(0);
        if let Some(ground) = found.map(|(ground, _)| ground).or_else(|| self.ground_deviation.of_mount()) {
            self.ground_deviation.classify(picture, &ground, codes);
        }
        let report = self.surfaces.run_coded(picture, &self.depth, &setup.rays, &GROUND_DEVIATION_CLASSES);
        (report, found.map(|(_, plane)| plane))
    }
}

fn view<'a, const DISPARITIES: usize>(setup: &'a Setup, depth: &'a DepthTable<DISPARITIES>) -> View<'a, DISPARITIES> {
    let Setup { pair, frame, place, rays, nearest_m, .. } = setup;
    View { pair, frame, place, rays, depth, nearest_m: *nearest_m }
}

#[cfg(test)]
#[path = "interpreter_tests.rs"]
mod tests;
