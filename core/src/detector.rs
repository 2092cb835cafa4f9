//! The whole detector: one call from a pair of pictures to obstacle cells.

use heapless::Vec;

use crate::{
    disparity::DisparityPicture,
    error::ConfigError,
    geometry::{Mount, RectifiedPair, StereoCalibration, VehicleFrame},
    ground::GroundPlane,
    health::Health,
    map::{ObstacleMap, SectorDistances},
    obstacles::Obstacle,
    picture::Picture,
    settings::Settings,
    surfaces::Surface,
};

/// The stages, in the order in which they run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[expect(missing_docs, reason = "the names are those of the modules")]
pub enum Stage {
    Rectify = 0,
    Match = 1,
    Validate = 2,
    Surfaces = 3,
    Ground = 4,
    Obstacles = 5,
    Map = 6,
}

impl Stage {
    /// Every stage in order.
    pub const ALL: [Self; 7] =
        [Self::Rectify, Self::Match, Self::Validate, Self::Surfaces, Self::Ground, Self::Obstacles, Self::Map];

    /// Name as it is written in summaries.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rectify => "rectify",
            Self::Match => "match",
            Self::Validate => "validate",
            Self::Surfaces => "surfaces",
            Self::Ground => "ground",
            Self::Obstacles => "obstacles",
            Self::Map => "map",
        }
    }
}

/// Watches the stages go by. The core reads no clock: a program that wants times brings one here.
///
/// Rectification and matching take turns row by row, so `enter` is called up to twice for each row.
pub trait Probe {
    /// The work that follows belongs to `stage`.
    fn enter(&mut self, stage: Stage);
}

/// Watches nothing.
impl Probe for () {
    fn enter(&mut self, _stage: Stage) {}
}

/// Counts that say how a frame went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Pixels with a disparity.
    pub pixels_with_disparity: u32,
    /// Pixels without, by [`crate::disparity::Reason`].
    pub pixels_without: [u32; 7],
    /// Surfaces found in the tiles.
    pub surfaces: u32,
    /// Surfaces left out because the table was full.
    pub surfaces_dropped: u32,
    /// Surfaces within the horizontal limit.
    pub surfaces_horizontal: u32,
    /// Surfaces beyond the vertical limit.
    pub surfaces_vertical: u32,
    /// Obstacles left out because the table was full.
    pub obstacles_dropped: u32,
    /// Obstacle cells.
    pub cells_obstacle: u32,
    /// Free cells.
    pub cells_free: u32,
}

/// All that one pair of pictures says.
#[derive(Clone, Debug)]
pub struct Detection<const OBSTACLES: usize, const CELLS: usize> {
    /// Cells around the robot.
    pub map: ObstacleMap<CELLS>,
    /// Nearest obstacle by direction.
    pub sectors: SectorDistances,
    /// The ground, if it was seen or is still held.
    pub ground: Option<GroundPlane>,
    /// Obstacles, nearest first.
    pub obstacles: Vec<Obstacle, OBSTACLES, u16>,
    /// How far this can be trusted.
    pub health: Health,
    /// Counts.
    pub statistics: Statistics,
}

/// Why a pair of pictures was not looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DetectError {
    /// `configure` was not called, or failed.
    NotConfigured,
    /// A picture has another size than the calibration says.
    WrongSize {
        /// Width and height of the picture.
        found: (usize, usize),
        /// Width and height of the calibration.
        expected: (usize, usize),
    },
}

/// The detector. `PIXELS` bounds width x height, `WIDTH` the width, `DISPARITIES` the search range; `GRID` is the number
/// of nodes of the rectification map; `SURFACES`, `OBSTACLES` and `CELLS` are the capacities of the tables.
pub struct Detector<
    const PIXELS: usize,
    const WIDTH: usize,
    const DISPARITIES: usize,
    const GRID: usize,
    const SURFACES: usize,
    const OBSTACLES: usize,
    const CELLS: usize,
> {
    detection: Detection<OBSTACLES, CELLS>,
    pair: Option<RectifiedPair>,
}
