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
        let mut seen = [Seen::NOTHING; SECTOR_COUNT];
        work::count(Loop::HealthPixels, map.cells.len());
        for (index, cell) in map.cells.iter().enumerate() {
            let (i, j) = map.geometry.cell_at(index);
            let (x, y) = map.geometry.centre_m(i, j);
            let place = (sectors.left_deg - libm::atan2f(y, x).to_degrees()) / sectors.width_deg;
            if place.is_nan() || place < 0.0 || place >= SECTOR_COUNT as f32 {
                continue;
            }
            let Some(seen) = seen.get_mut(place as usize) else { continue };
            match cell.state {
                CellState::Obstacle => seen.nearest_m = seen.nearest_m.min(libm::sqrtf(x * x + y * y)),
                CellState::Free => seen.free = seen.free.saturating_add(1),
                CellState::Unknown(UnknownReason::OutsideView | UnknownReason::TooFar | UnknownReason::TooNear) => {
                    continue;
                }
                CellState::Unknown(_) => {}
            }
            seen.in_view = seen.in_view.saturating_add(1);
        }
        for (distance_dm, seen) in sectors.distance_dm.iter_mut().zip(&seen) {
            *distance_dm = if seen.nearest_m.is_finite() {
                libm::roundf(seen.nearest_m * 10.0).min(f32::from(SECTOR_CLEAR_DM - 1)) as u8
            } else if seen.free > 0 && seen.free >= seen.in_view.saturating_sub(seen.free) {
                SECTOR_CLEAR_DM
            } else {
                SECTOR_UNKNOWN
            };
        }
        sectors
    }
}

/// What the cells of a sector say.
#[derive(Clone, Copy)]
struct Seen {
    nearest_m: f32,
    /// Free cells, and all in view.
    free: u16,
    in_view: u16,
}

impl Seen {
    const NOTHING: Self = Self { nearest_m: f32::INFINITY, free: 0, in_view: 0 };
}
