use crate::health::{Health, HealthLevel};

use super::{MeaninglessValue, Signal, health_level};

/// Version of the messages. A receiver refuses scans of another version.
pub const PROTOCOL_VERSION: u8 = 1;

/// What a node is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum NodeState {
    /// On its way to the first scan.
    #[default]
    Starting = 0,
    /// Sends scans.
    Running = 1,
    /// Ends in an orderly way; no scan will follow.
    Stopping = 2,
    /// Cannot work.
    Fault = 3,
}

/// Heartbeat: state and health of the node, sent ten times a second even when the cameras are gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeartbeatRepr {
    /// What the node is doing.
    pub state: NodeState,
    /// How far the cells can be trusted, and why. Only the lowest 23 reasons are sent.
    pub health: Health,
    /// Version of the messages, at most 15.
    pub protocol_version: u8,
    /// Index of the newest scan; `None` before the first.
    pub last_scan: Option<u16>,
}

impl HeartbeatRepr {
    /// `State`
    pub const STATE: Signal = Signal::new(16, 2);
    /// `Health`
    pub const HEALTH: Signal = Signal::new(18, 2);
    /// `ProtocolVersion`
    pub const PROTOCOL_VERSION: Signal = Signal::new(20, 4);
    /// `Reasons`
    pub const REASONS: Signal = Signal::new(24, 23);
    /// `LastScanValid`
    pub const LAST_SCAN_VALID: Signal = Signal::new(47, 1);
    /// `LastScan`
    pub const LAST_SCAN: Signal = Signal::new(48, 16);

    /// Reads the signals.
    ///
    /// # Errors
    /// None: every value has a meaning.
    pub fn parse(data: &[u8]) -> Result<Self, MeaninglessValue> {
        let state = match Self::STATE.get(data) {
            0 => NodeState::Starting,
            1 => NodeState::Running,
            2 => NodeState::Stopping,
            _ => NodeState::Fault,
        };
        let level: HealthLevel = health_level(Self::HEALTH.get(data));
        Ok(Self {
            state,
            health: Health { level, reasons: Self::REASONS.get(data) },
            protocol_version: Self::PROTOCOL_VERSION.get(data) as u8,
            last_scan: (Self::LAST_SCAN_VALID.get(data) != 0).then_some(Self::LAST_SCAN.get(data) as u16),
        })
    }

    /// Writes the signals.
    pub fn emit(&self, data: &mut [u8]) {
        Self::STATE.put(data, self.state as u32);
        Self::HEALTH.put(data, self.health.level as u32);
        Self::PROTOCOL_VERSION.put(data, u32::from(self.protocol_version));
        // Reasons without a bit on the wire are left out, not held at the largest value.
        Self::REASONS.put(data, self.health.reasons & Self::REASONS.max());
        Self::LAST_SCAN_VALID.put(data, u32::from(self.last_scan.is_some()));
        Self::LAST_SCAN.put(data, u32::from(self.last_scan.unwrap_or(0)));
    }
}
