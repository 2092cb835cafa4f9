//! The nearest obstacle in each direction.

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
        Self { left_deg: 50.0, width_deg: 5.0, distance_dm: [SECTOR_UNKNOWN; SECTOR_COUNT] }
    }
}
