//! The map: square cells on the ground around the robot, and distances by sector.

mod cells;
mod sectors;

pub use cells::{Cell, CellState, MapGeometry, ObstacleMap, UnknownReason};
pub use sectors::{SECTOR_CLEAR_DM, SECTOR_COUNT, SECTOR_UNKNOWN, SectorDistances};
