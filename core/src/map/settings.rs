//! Settings of the map.

use super::{MapGeometry, SectorDistances};
use crate::error::{ConfigError, ConfigProblem};

/// Settings of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct MapSettings {
    /// Where the cells lie.
    pub geometry: MapGeometry,
    /// A cell is an obstacle if obstacle pixels cover at least this part of the area that a cell-wide piece of the least
    /// height of an obstacle takes in the picture at the distance of the cell.
    pub obstacle_cover: f32,
    /// ... and never fewer pixels than this: half of a matching window, which is what a false match of the sky makes of each of two
    /// cells that it falls on.
    pub obstacle_min_pixels: u16,
    /// A cell is free if at least this part of the area that its piece of ground takes in the picture was seen as ground.
    pub free_cover: f32,
    /// ... and never fewer pixels than this.
    pub free_min_pixels: u16,
    /// Pixels above this height speak against a free cell, metres.
    pub free_max_height_m: f32,
    /// Error of a disparity that must be expected at worst, px: what is not higher above the ground than this makes it is not told
    /// from the ground.
    pub height_noise_px: f32,
    /// How much a pixel counts for an obstacle that is too high for the ground but lies on a surface that is none, such as the top of
    /// a thing: many of them are one, a few are not.
    pub unclear_share: f32,
    /// An obstacle cell with less than this share of the pixels that lie nearer in the same direction is what the matching window
    /// smears of that; 0 for never.
    pub smear_share: f32,
    /// How many cells behind an obstacle it smears, at most 8.
    pub smear_cells: u8,
    /// Cells farther away from the camera are not told, metres.
    pub max_range_m: f32,
    /// Width of each of the sectors around straight ahead, degrees; 18 is a full circle.
    pub sector_width_deg: f32,
}

impl MapSettings {
    /// All zero, for a stage that is not configured.
    pub(super) const UNSET: Self = Self {
        geometry: MapGeometry { cell_size_mm: 0, x_first: 0, x_count: 0, y_first: 0, y_count: 0 },
        obstacle_cover: 0.0,
        obstacle_min_pixels: 0,
        free_cover: 0.0,
        free_min_pixels: 0,
        free_max_height_m: 0.0,
        height_noise_px: 0.0,
        unclear_share: 0.0,
        smear_share: 0.0,
        smear_cells: 0,
        max_range_m: 0.0,
        sector_width_deg: 0.0,
    };

    /// Checks every value. Cell numbers must fit the 7 bits that the wire has for them.
    ///
    /// # Errors
    /// The first value that cannot be used, named `map.*`.
    pub fn check(&self, capacity: usize) -> Result<(), ConfigError> {
        let geometry = &self.geometry;
        ConfigError::check("map.geometry.cell_size_mm", f32::from(geometry.cell_size_mm), 20.0, 4000.0)?;
        ConfigError::check("map.geometry.x_first", f32::from(geometry.x_first), -64.0, 63.0)?;
        ConfigError::check("map.geometry.y_first", f32::from(geometry.y_first), -64.0, 63.0)?;
        let room = |first: i16| 64.0 - f32::from(first);
        ConfigError::check("map.geometry.x_count", f32::from(geometry.x_count), 1.0, room(geometry.x_first))?;
        ConfigError::check("map.geometry.y_count", f32::from(geometry.y_count), 1.0, room(geometry.y_first))?;
        if geometry.len() > capacity {
            let problem = ConfigProblem::OverCapacity { needed: geometry.len(), capacity };
            return Err(ConfigError::new("map.geometry", problem));
        }
        ConfigError::check("map.obstacle_cover", self.obstacle_cover, 0.0, 1.0)?;
        ConfigError::check("map.obstacle_min_pixels", f32::from(self.obstacle_min_pixels), 1.0, 10_000.0)?;
        ConfigError::check("map.free_cover", self.free_cover, 0.0, 1.0)?;
        ConfigError::check("map.free_min_pixels", f32::from(self.free_min_pixels), 1.0, 10_000.0)?;
        ConfigError::check("map.free_max_height_m", self.free_max_height_m, 0.01, 2.0)?;
        ConfigError::check("map.height_noise_px", self.height_noise_px, 0.0, 16.0)?;
        ConfigError::check("map.unclear_share", self.unclear_share, 0.0, 1.0)?;
        ConfigError::check("map.smear_share", self.smear_share, 0.0, 1.0)?;
        ConfigError::check("map.smear_cells", f32::from(self.smear_cells), 0.0, 8.0)?;
        ConfigError::check("map.max_range_m", self.max_range_m, 0.1, 1000.0)?;
        ConfigError::check("map.sector_width_deg", self.sector_width_deg, 0.5, 18.0)
    }
}

impl Default for MapSettings {
    fn default() -> Self {
        Self {
            geometry: MapGeometry::default(),
            obstacle_cover: 0.1,
            obstacle_min_pixels: 32,
            free_cover: 0.03,
            free_min_pixels: 4,
            free_max_height_m: 0.2,
            height_noise_px: 0.8,
            unclear_share: 0.25,
            smear_share: 0.33,
            smear_cells: 2,
            max_range_m: 30.0,
            sector_width_deg: SectorDistances::WIDTH_DEG,
        }
    }
}
