//! The map: square cells on the ground around the robot, and distances by sector.

mod bands;
mod builder;
mod cells;
mod merge;
mod sectors;
mod settings;
mod shadow;
mod smear;
mod votes;

pub(crate) use bands::Votes;
pub(crate) use builder::{Evidence, Vote};
pub use builder::{MapBuilder, View};
pub use cells::{Cell, CellState, Doubt, MapGeometry, ObstacleMap, UnknownReason};
pub use merge::{Merged, OtherCells};
pub use sectors::{SECTOR_CLEAR_DM, SECTOR_COUNT, SECTOR_UNKNOWN, SectorDistances};
pub use settings::MapSettings;

#[cfg(test)]
mod tests;
