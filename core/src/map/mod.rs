//! The map: square cells on the ground around the robot, and distances by sector.

mod cells;
mod sectors;

pub use cells::{Cell, CellState, MapGeometry, ObstacleMap, UnknownReason};
pub use sectors::{SECTOR_CLEAR_DM, SECTOR_COUNT, SECTOR_UNKNOWN, SectorDistances};

/// Settings of the map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct MapSettings {
    /// Where the cells lie.
    pub geometry: MapGeometry,
}
