//! Settings of the live loop, `[run]` and `[bus]` in a rig's file.

use fencepost_core::{bands::MAX_BANDS, error::ConfigError};
use serde::{Deserialize, Serialize};

use super::realtime::check_cpu;

/// Most pairs of cameras in a rig.
pub const MAX_PAIRS: usize = 4;

/// `[run]`: deadlines, time-outs and what the operating system is asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RunSettings {
    /// From exposure to the last CAN frame of the scan, milliseconds. What takes longer is late.
    pub deadline_ms: u32,
    /// Pictures whose exposure is longer ago than this say nothing any more, milliseconds.
    pub stale_ms: u32,
    /// What went wrong is said for this long after it was last seen, milliseconds.
    pub hold_ms: u32,
    /// With several pairs, how long the pictures of one wait for those of the others, milliseconds.
    pub merge_wait_ms: u32,
    /// Speed and yaw rate that are older than this are not known, milliseconds.
    pub command_timeout_ms: u32,
    /// The controller must echo one of the scans of this time, milliseconds.
    pub echo_timeout_ms: u32,
    /// Whether a controller that was never heard is missing.
    pub controller_required: bool,
    /// Real-time priority (`SCHED_FIFO`) of the pairs' threads, 1 to 98; 0 for none. The bus thread has
    /// one more.
    pub priority: u8,
    /// Whether memory is locked.
    pub lock_memory: bool,
    /// Processor of the bus thread; any if not set.
    pub bus_cpu: Option<u16>,
    /// Threads that work on each picture of a pair, 1 to [`MAX_BANDS`]. One leaves the other processors to other work, and takes the
    /// least time in all.
    pub threads_per_pair: u8,
}

impl Default for RunSettings {
    fn default() -> Self {
        Self {
            deadline_ms: 150,
            stale_ms: 300,
            hold_ms: 500,
            merge_wait_ms: 20,
            command_timeout_ms: 300,
            echo_timeout_ms: 1000,
            controller_required: false,
            priority: 50,
            lock_memory: true,
            bus_cpu: None,
            threads_per_pair: 1,
        }
    }
}

impl RunSettings {
    /// Priority of the bus thread: above that of the pairs' threads.
    pub(super) const fn bus_priority(&self) -> u8 {
        if self.priority == 0 { 0 } else { self.priority.saturating_add(1) }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used, named `run.*`.
    pub fn check(&self) -> Result<(), ConfigError> {
        ConfigError::check("run.deadline_ms", self.deadline_ms as f32, 1.0, 60_000.0)?;
        ConfigError::check("run.stale_ms", self.stale_ms as f32, 1.0, 60_000.0)?;
        ConfigError::check("run.hold_ms", self.hold_ms as f32, 0.0, 60_000.0)?;
        ConfigError::check("run.merge_wait_ms", self.merge_wait_ms as f32, 0.0, 1000.0)?;
        ConfigError::check("run.command_timeout_ms", self.command_timeout_ms as f32, 1.0, 60_000.0)?;
        ConfigError::check("run.echo_timeout_ms", self.echo_timeout_ms as f32, 1.0, 60_000.0)?;
        ConfigError::check("run.priority", f32::from(self.priority), 0.0, 98.0)?;
        ConfigError::check("run.threads_per_pair", f32::from(self.threads_per_pair), 1.0, MAX_BANDS as f32)?;
        self.bus_cpu.map_or(Ok(()), |cpu| check_cpu("run.bus_cpu", cpu))
    }
}

/// `[bus]`: where the CAN frames go.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BusSettings {
    /// Network interface of the bus; [`BusSettings::NONE`] for no bus.
    pub interface: String,
    /// Bit rate, to tell the load of the bus. The interface itself is set up outside (`ip link`).
    pub bitrate: u32,
}

impl BusSettings {
    /// The interface's name for "no bus", to try a rig without one.
    pub const NONE: &str = "none";
    /// Bytes of an interface's name in Linux, its closing zero among them.
    const NAME_BYTES: usize = 16;

    /// Checks every value.
    ///
    /// # Errors
    /// The first value that cannot be used: its name, and what is wrong with it.
    pub fn check(&self) -> Result<(), (&'static str, String)> {
        let name = &self.interface;
        if name.is_empty() || name.len() >= Self::NAME_BYTES || name.contains(['/', ' ', ':']) {
            return Err(("bus.interface", format!("`{name}` is no name of a network interface, such as can0")));
        }
        if !(10_000..=1_000_000).contains(&self.bitrate) {
            return Err(("bus.bitrate", format!("{} is not within 10000 to 1000000 bit/s", self.bitrate)));
        }
        Ok(())
    }
}

impl Default for BusSettings {
    fn default() -> Self {
        Self { interface: "can0".to_string(), bitrate: 500_000 }
    }
}
