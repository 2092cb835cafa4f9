//! What a run did on the bus, in numbers.

use fencepost_core::wire::CommandStatistics;
use fencepost_hal::can::TransmitCounters;
use serde::Serialize;

use super::LatencySummary;

/// What went over the bus, and how late.
#[derive(Clone, Debug, Default, Serialize)]
pub struct BusReport {
    /// Scans encoded.
    pub scans: u64,
    /// Detections that a newer one of the same pair replaced before they could be sent.
    pub overtaken: u64,
    /// Scans whose last frame was handed over later than the deadline, or never.
    pub late: u64,
    /// From exposure to the last CAN frame.
    pub latency: LatencySummary,
    /// What became of heartbeats and scans.
    #[serde(flatten)]
    pub sent: SentReport,
    /// Messages of the controller that were missing, repeated, damaged or refused.
    pub commands: CommandReport,
}

/// Counts of frames.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct SentReport {
    /// Frames that the bus took.
    pub frames: u64,
    /// Heartbeats among them.
    pub heartbeats: u64,
    /// Scans that the bus took whole.
    pub whole_scans: u64,
    /// Scans that were abandoned.
    pub abandoned_scans: u64,
    /// Times that the bus was full.
    pub full: u64,
    /// Times that the bus was down, gone or off.
    pub no_bus: u64,
}

/// What was wrong with the controller's messages.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct CommandReport {
    /// Missing by their counters.
    pub lost: u32,
    /// Came more than once.
    pub repeated: u32,
    /// Checksum did not fit.
    pub crc_errors: u32,
    /// Refused for another reason.
    pub refused: u32,
}

impl From<&TransmitCounters> for SentReport {
    fn from(counters: &TransmitCounters) -> Self {
        let TransmitCounters { frames, heartbeats, scans, abandoned_scans, full, no_bus, .. } = *counters;
        Self { frames, heartbeats, whole_scans: scans, abandoned_scans, full, no_bus }
    }
}

impl From<&CommandStatistics> for CommandReport {
    fn from(statistics: &CommandStatistics) -> Self {
        let CommandStatistics { lost, repeated, crc_errors, refused } = *statistics;
        Self { lost, repeated, crc_errors, refused }
    }
}
