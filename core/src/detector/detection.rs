//! What one pair of pictures says.

use heapless::Vec;

use crate::{
    arch::Chosen,
    disparity::DisparityPicture,
    ground::GroundPlane,
    health::{Health, HealthLevel},
    map::{CellState, Doubt, ObstacleMap, SectorDistances},
    methods::Detectors,
    obstacles::Obstacle,
    surfaces::{Surface, SurfaceClass, SurfaceReport},
};

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
    /// Cells that the checking detector says the opposite of: obstacles that it calls free, and cells that would be free if it did
    /// not call them obstacles.
    pub cells_disputed: u32,
    /// Obstacle and free cells that the checking detector does not know.
    pub cells_unconfirmed: u32,
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
    /// The detector that found all this, and the one that checked it.
    pub detectors: Detectors,
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

impl<const OBSTACLES: usize, const CELLS: usize> Detection<OBSTACLES, CELLS> {
    /// Nothing seen.
    pub const fn new() -> Self {
        Self {
            map: ObstacleMap::EMPTY,
            sectors: SectorDistances::UNSET,
            ground: None,
            obstacles: Vec::new(),
            health: Health { level: HealthLevel::Ok, reasons: 0 },
            statistics: Statistics::NONE,
            detectors: Detectors::DEFAULT,
        }
    }

    /// Forgets what was seen, without moving the tables.
    pub(super) fn clear(&mut self) {
        self.map.cells.clear();
        self.sectors = SectorDistances::default();
        self.ground = None;
        self.obstacles.clear();
        self.health = Health::OK;
        self.statistics = Statistics::NONE;
    }
}

impl<const OBSTACLES: usize, const CELLS: usize> Default for Detection<OBSTACLES, CELLS> {
    fn default() -> Self {
        Self::new()
    }
}

impl Statistics {
    const NONE: Self = Self {
        pixels_with_disparity: 0,
        pixels_without: [0; 7],
        surfaces: 0,
        surfaces_dropped: 0,
        surfaces_horizontal: 0,
        surfaces_vertical: 0,
        obstacles_dropped: 0,
        cells_obstacle: 0,
        cells_free: 0,
        cells_disputed: 0,
        cells_unconfirmed: 0,
    };

    /// Share of the pixels that have a disparity.
    pub fn coverage(&self) -> f32 {
        let all =
            self.pixels_without.iter().fold(self.pixels_with_disparity, |sum, pixels| sum.saturating_add(*pixels));
        self.pixels_with_disparity as f32 / all.max(1) as f32
    }

    pub(super) fn count<const CELLS: usize>(
        &mut self,
        (picture, chosen): (DisparityPicture<'_>, Chosen),
        report: SurfaceReport,
        surfaces: &[Surface],
        map: &ObstacleMap<CELLS>,
    ) {
        let (with, without) = picture.counts(chosen);
        (self.pixels_with_disparity, self.pixels_without) = (with, without);
        self.surfaces = surfaces.len() as u32;
        self.surfaces_dropped = report.dropped;
        for surface in surfaces {
            match surface.class {
                SurfaceClass::Ground | SurfaceClass::Horizontal => one_more(&mut self.surfaces_horizontal),
                SurfaceClass::Vertical | SurfaceClass::Obstacle => one_more(&mut self.surfaces_vertical),
                SurfaceClass::Slanted | SurfaceClass::Undefined => {}
            }
        }
        self.count_cells(map);
    }

    /// Counts the cells anew.
    pub(super) fn count_cells<const CELLS: usize>(&mut self, map: &ObstacleMap<CELLS>) {
        (self.cells_obstacle, self.cells_free, self.cells_disputed, self.cells_unconfirmed) = (0, 0, 0, 0);
        for cell in &map.cells {
            match cell.state {
                CellState::Obstacle => one_more(&mut self.cells_obstacle),
                CellState::Free => one_more(&mut self.cells_free),
                CellState::Unknown(_) => {}
            }
            match cell.doubt {
                Doubt::None => {}
                Doubt::Unconfirmed => one_more(&mut self.cells_unconfirmed),
                Doubt::Disputed => one_more(&mut self.cells_disputed),
            }
        }
    }
}

/// Counts one more of what a table has room for, which is less than 2^32.
const fn one_more(count: &mut u32) {
    *count = count.wrapping_add(1);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverage_is_the_share_of_all_pixels() {
        let share = |pixels_with_disparity, pixels_without| {
            Statistics { pixels_with_disparity, pixels_without, ..Statistics::NONE }.coverage()
        };
        assert_eq!(share(0, [0; 7]), 0.0);
        assert_eq!(share(7, [0; 7]), 1.0);
        assert_eq!(share(0, [1; 7]), 0.0);
        assert_eq!(share(72, [1, 2, 3, 4, 5, 6, 3]), 0.75);
    }
}
