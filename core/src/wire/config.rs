//! Settings of the wire.

use crate::error::{ConfigError, ConfigProblem};
use crate::map::MapGeometry;

use super::address::{Address, BaseId, NodeId};
use super::message::{CELL_INDEX_MAX, CELL_INDEX_MIN, CellsRepr, EndRepr, HeaderRepr};

/// Which frames carry the cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum FrameFormat {
    /// Classic CAN: 8 bytes, two runs of cells.
    #[default]
    Classic,
    /// CAN FD: 24 bytes, eight runs of cells. All other messages stay classic.
    Fd,
}

impl FrameFormat {
    /// Runs of cells in a frame.
    pub const fn runs_per_frame(self) -> usize {
        match self {
            Self::Classic => CellsRepr::CLASSIC_RUNS,
            Self::Fd => CellsRepr::FD_RUNS,
        }
    }
}

/// The settings as they are written in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct WireSettings {
    /// First identifier of all nodes, see [`BaseId`].
    pub base_id: u16,
    /// This node, see [`NodeId`].
    pub node: u8,
    /// Which frames carry the cells.
    pub format: FrameFormat,
    /// Most cell frames in a scan, 1 to 255. What does not fit is left out, the farthest free cells first.
    pub max_cell_frames: u8,
}

impl WireSettings {
    /// Classic CAN: 400 runs of cells in a scan, below 60 % of a bus with 500 kbit/s at ten scans a second.
    pub const CLASSIC: Self =
        Self { base_id: BaseId::DEFAULT.get(), node: 0, format: FrameFormat::Classic, max_cell_frames: 200 };

    /// CAN FD: 640 runs of cells in a scan, below 60 % of a bus with 500 kbit/s that does not even switch its bit rate.
    pub const FD: Self = Self { format: FrameFormat::Fd, max_cell_frames: 80, ..Self::CLASSIC };
}

impl Default for WireSettings {
    fn default() -> Self {
        Self::CLASSIC
    }
}

/// Checked settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WireConfig {
    address: Address,
    format: FrameFormat,
    max_cell_frames: u8,
}

impl WireConfig {
    /// Checks `settings`.
    ///
    /// # Errors
    /// The first value that cannot be used, named `wire.*`.
    pub const fn new(settings: WireSettings) -> Result<Self, ConfigError> {
        let base = match BaseId::new(settings.base_id) {
            Ok(base) => base,
            Err(error) => return Err(error),
        };
        let node = match NodeId::new(settings.node) {
            Ok(node) => node,
            Err(error) => return Err(error),
        };
        if settings.max_cell_frames == 0 {
            let problem = ConfigProblem::OutOfRange { min: 1.0, max: 255.0 };
            return Err(ConfigError::new("wire.max_cell_frames", problem));
        }
        let address = Address { base, node };
        Ok(Self { address, format: settings.format, max_cell_frames: settings.max_cell_frames })
    }

    /// What this node is called on its bus.
    pub const fn address(&self) -> Address {
        self.address
    }

    /// Which frames carry the cells.
    pub const fn format(&self) -> FrameFormat {
        self.format
    }

    /// Most cell frames in a scan.
    pub const fn max_cell_frames(&self) -> u8 {
        self.max_cell_frames
    }

    /// Most runs of cells in a scan.
    pub const fn max_runs(&self) -> usize {
        self.max_cell_frames as usize * self.format.runs_per_frame()
    }
}

impl Default for WireConfig {
    fn default() -> Self {
        const CONFIG: WireConfig = match WireConfig::new(WireSettings::CLASSIC) {
            Ok(config) => config,
            Err(_) => panic!("the default settings are valid"),
        };
        CONFIG
    }
}

/// Checks that every cell of `geometry` can be said on the bus: indices from -64 to 63, at most 16383 cells of at most
/// 4095 mm. Cells that cannot are dropped and counted by the encoder, so that a map of another shape is truncated and not
/// wrong.
///
/// # Errors
/// Named `map.*`.
pub fn check_geometry(geometry: &MapGeometry) -> Result<(), ConfigError> {
    let max_size = EndRepr::CELL_SIZE.max() as f32;
    ConfigError::check("map.cell_size_mm", f32::from(geometry.cell_size_mm), 1.0, max_size)?;
    check_axis("map.x_first", "map.x_count", geometry.x_first, geometry.x_count)?;
    check_axis("map.y_first", "map.y_count", geometry.y_first, geometry.y_count)?;
    let capacity = HeaderRepr::CELL_COUNT.max() as usize;
    if geometry.len() > capacity {
        return Err(ConfigError::new("map.x_count", ConfigProblem::OverCapacity { needed: geometry.len(), capacity }));
    }
    Ok(())
}

fn check_axis(first_field: &'static str, count_field: &'static str, first: i16, count: u16) -> Result<(), ConfigError> {
    let (min, max) = (f32::from(CELL_INDEX_MIN), f32::from(CELL_INDEX_MAX));
    ConfigError::check(first_field, f32::from(first), min, max)?;
    ConfigError::check(count_field, f32::from(count), 0.0, max + 1.0 - f32::from(first))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_that_cannot_be_used_name_their_field() {
        let field = |settings| WireConfig::new(settings).unwrap_err().field;
        assert_eq!(field(WireSettings { base_id: 0x410, ..WireSettings::CLASSIC }), "wire.base_id");
        assert_eq!(field(WireSettings { node: 16, ..WireSettings::CLASSIC }), "wire.node");
        assert_eq!(field(WireSettings { max_cell_frames: 0, ..WireSettings::CLASSIC }), "wire.max_cell_frames");
        assert_eq!(WireConfig::new(WireSettings::CLASSIC), Ok(WireConfig::default()));
        assert_eq!(WireConfig::new(WireSettings::FD).unwrap().max_runs(), 640);
    }

    #[test]
    fn geometry_must_fit_seven_signed_bits() {
        let geometry =
            |x_first, x_count, y_first, y_count| MapGeometry { cell_size_mm: 500, x_first, x_count, y_first, y_count };
        assert_eq!(check_geometry(&MapGeometry::default()), Ok(()));
        assert_eq!(check_geometry(&geometry(-64, 127, -64, 128)), Ok(()));
        assert_eq!(check_geometry(&geometry(-64, 128, -64, 128)).unwrap_err().field, "map.x_count");
        assert_eq!(check_geometry(&geometry(-65, 1, 0, 1)).unwrap_err().field, "map.x_first");
        assert_eq!(check_geometry(&geometry(0, 65, 0, 1)).unwrap_err().field, "map.x_count");
        assert_eq!(check_geometry(&geometry(0, 1, 60, 5)).unwrap_err().field, "map.y_count");
        let huge = MapGeometry { cell_size_mm: 4096, ..MapGeometry::default() };
        assert_eq!(check_geometry(&huge).unwrap_err().field, "map.cell_size_mm");
    }
}
