//! The nearest obstacle in each direction.

use super::{CellState, ObstacleMap, UnknownReason};
use crate::work::{self, Loop};

/// Number of sectors.
pub const SECTOR_COUNT: usize = 20;

/// Stands for "seen, and no obstacle within the range of the map" in [`SectorDistances`].
pub const SECTOR_CLEAR_DM: u8 = 254;

/// Stands for "not seen" in [`SectorDistances`].
pub const SECTOR_UNKNOWN: u8 = 255;

/// Distance from the vehicle's origin to the nearest obstacle by direction, from left to right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SectorDistances {
    /// Bearing of the left edge of the first sector, degrees, positive to the left.
    pub left_deg: f32,
    /// Width of a sector, degrees.
    pub width_deg: f32,
    /// Decimetres, or [`SECTOR_CLEAR_DM`] or [`SECTOR_UNKNOWN`].
    pub distance_dm: [u8; SECTOR_COUNT],
}

impl Default for SectorDistances {
    fn default() -> Self {
        Self::unknown(SectorDistances::WIDTH_DEG)
    }
}

impl SectorDistances {
    /// All zero, for a map that was not made yet.
    pub(crate) const UNSET: Self = Self { left_deg: 0.0, width_deg: 0.0, distance_dm: [0; SECTOR_COUNT] };

    /// Width of a sector unless somebody chose another, degrees: 50 degrees to either side, what a pair of cameras sees.
    pub const WIDTH_DEG: f32 = 5.0;

    /// Nothing seen in any direction. Sectors lie evenly around straight ahead; 18 degrees each are a full circle.
    pub fn unknown(width_deg: f32) -> Self {
        let left_deg = 0.5 * SECTOR_COUNT as f32 * width_deg;
        Self { left_deg, width_deg, distance_dm: [SECTOR_UNKNOWN; SECTOR_COUNT] }
    }

    /// The distances that a map holds, by sectors of `width_deg`.
    ///
    /// A sector is clear if at least half of its cells in view were seen to be free and none is an obstacle.
    ///
    /// # Bound
    /// One pass over the cells.
    pub fn of<const CELLS: usize>(map: &ObstacleMap<CELLS>, width_deg: f32) -> Self {
        let mut sectors = Self::unknown(width_deg);
        let mut nearest_m = [f32::INFINITY; SECTOR_COUNT];
        let (mut free, mut in_view) = ([0u16; SECTOR_COUNT], [0u16; SECTOR_COUNT]);
        work::count(Loop::HealthPixels, map.cells.len());
        for (index, cell) in map.cells.iter().enumerate() {
            let (i, j) = map.geometry.cell_at(index);
            let (x, y) = map.geometry.centre_m(i, j);
            let place = (sectors.left_deg - libm::atan2f(y, x).to_degrees()) / sectors.width_deg;
            if place.is_nan() || place < 0.0 || place >= SECTOR_COUNT as f32 {
                continue;
            }
            let place = place as usize;
            match cell.state {
                CellState::Obstacle => nearest_m[place] = nearest_m[place].min(libm::sqrtf(x * x + y * y)),
                CellState::Free => free[place] += 1,
                CellState::Unknown(UnknownReason::OutsideView | UnknownReason::TooFar | UnknownReason::TooNear) => {
                    continue;
                }
                CellState::Unknown(_) => {}
            }
            in_view[place] += 1;
        }
        for (place, distance_dm) in sectors.distance_dm.iter_mut().enumerate() {
            *distance_dm = if nearest_m[place].is_finite() {
                libm::roundf(nearest_m[place] * 10.0).min(f32::from(SECTOR_CLEAR_DM - 1)) as u8
            } else if free[place] > 0 && free[place] >= in_view[place].div_ceil(2) {
                SECTOR_CLEAR_DM
            } else {
                SECTOR_UNKNOWN
            };
        }
        sectors
    }
}
