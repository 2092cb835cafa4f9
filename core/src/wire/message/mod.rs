//! The messages: a plain struct for each, with `parse` and `emit`, and where its signals lie.

mod cells;
mod command;
mod end;
mod ground;
mod header;
mod heartbeat;
mod sectors;

pub use cells::{CELL_INDEX_MAX, CELL_INDEX_MIN, CellsRepr, MAX_RUN_LENGTH, Run};
pub use command::{ScanEchoRepr, VehicleMotionRepr};
pub use end::EndRepr;
pub use ground::{GroundRepr, WireGround};
pub use header::{AGE_STEP_MS, HeaderRepr};
pub use heartbeat::{HeartbeatRepr, NodeState, PROTOCOL_VERSION};
pub use sectors::{SECTORS_PER_PART, SectorLayout, SectorsRepr};

use crate::health::HealthLevel;

use super::signal::Signal;

/// A signal with a value that has no meaning: its name in the DBC file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeaninglessValue(pub &'static str);

impl core::fmt::Display for MeaninglessValue {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} has a value without a meaning", self.0)
    }
}

impl core::error::Error for MeaninglessValue {}

/// Low bits of the scan index in every message of a scan but header and end.
pub const SCAN_LOW: Signal = Signal::new(16, 4);

/// The bits of `scan_index` that go into [`SCAN_LOW`].
pub const fn scan_low(scan_index: u16) -> u8 {
    (scan_index & 0xF) as u8
}

const fn health_level(code: u32) -> HealthLevel {
    match code {
        0 => HealthLevel::Ok,
        1 => HealthLevel::Degraded,
        2 => HealthLevel::Blind,
        _ => HealthLevel::Fault,
    }
}
