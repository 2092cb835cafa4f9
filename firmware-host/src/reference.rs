//! The detector outside the core, to compare with: too slow and too hungry for a robot, but a measure of what can be had.

use fencepost_core::{
    geometry::Mount,
    health::HealthLevel,
    map::{Cell, CellState, UnknownReason},
    rectify::Side,
    settings::Settings,
    surfaces::{Surface, SurfaceClass},
};

use crate::{
    detector::{CELLS, OBSTACLES, ProgramDetector},
    error::Failure,
    normalized_cuts::{NormalizedCutSettings, NormalizedCuts, Segmentation},
    view::FrameView,
};

type Detection = fencepost_core::detector::Detection<OBSTACLES, CELLS>;

/// Looks at frames that the core has rectified and matched, and has the last word about them.
#[derive(Debug)]
pub struct Reference {
    cuts: NormalizedCuts,
}

/// What it sees in a frame.
#[derive(Debug)]
pub struct Seen {
    segmentation: Segmentation,
}

impl Reference {
    /// For the cameras that `detector` is configured for.
    ///
    /// # Errors
    /// The first setting that cannot be used.
    pub fn new(
        cuts: &NormalizedCutSettings,
        settings: &Settings,
        detector: &ProgramDetector,
        mount: &Mount,
    ) -> Result<Self, Failure> {
        let pair = detector.pair().ok_or_else(|| Failure::work("the detector is not configured"))?;
        let rotation = detector.rectifier().rotation(Side::Left).copied();
        let cuts = NormalizedCuts::new(cuts, settings, pair, mount, rotation);
        Ok(Self { cuts: cuts.map_err(|error| Failure::config(error, None))? })
    }

    /// Looks at a frame. Health and counts of pixels are of the cameras: the core's are kept.
    pub fn look(&self, view: &FrameView<'_>) -> Seen {
        let mut segmentation = self.cuts.run(&view.left, view.disparity);
        let classes = segmentation.segments.iter().map(|segment| segment.surface.class);
        let count = |wanted: SurfaceClass| classes.clone().filter(|class| *class == wanted).count() as u32;
        let mut statistics = view.detection.statistics;
        statistics.surfaces = segmentation.segments.len() as u32;
        statistics.surfaces_dropped = 0;
        statistics.surfaces_horizontal = count(SurfaceClass::Horizontal);
        statistics.surfaces_vertical = count(SurfaceClass::Vertical);
        statistics.obstacles_dropped = 0;

        let detection = &mut segmentation.detection;
        detection.health = view.detection.health;
        if detection.health.level >= HealthLevel::Blind {
            withhold_free(detection);
        }
        let cells = |state| detection.map.cells.iter().filter(|cell| cell.state == state).count() as u32;
        (statistics.cells_obstacle, statistics.cells_free) = (cells(CellState::Obstacle), cells(CellState::Free));
        detection.statistics = statistics;
        Seen { segmentation }
    }
}

impl Seen {
    /// Cells, ground and obstacles.
    pub fn detection(&self) -> &Detection {
        &self.segmentation.detection
    }

    /// The piece of a segment that a pixel belongs to.
    pub fn surface_at(&self, x: usize, y: usize) -> Option<Surface> {
        self.segmentation.surface_at(x, y)
    }
}

/// Nothing is free in a picture that cannot be trusted, whoever says so.
fn withhold_free(detection: &mut Detection) {
    for cell in detection.map.cells.iter_mut().filter(|cell| cell.state == CellState::Free) {
        *cell = Cell { state: CellState::Unknown(UnknownReason::NotTrusted), ..Cell::default() };
    }
}
