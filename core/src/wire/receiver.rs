//! The receiving side for a controller that drives by the scans of a node.

use embedded_can::StandardId;
use heapless::Vec;

use crate::health::HealthLevel;
use crate::map::SectorDistances;

use super::address::Address;
use super::assembly::{Assembly, Committed, Outcome};
use super::message::{HeartbeatRepr, MeaninglessValue, NodeState, PROTOCOL_VERSION, Run, WireGround};
use super::protect::{PacketError, Step};

/// Whom a receiver listens to, and for how long it believes what it heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReceiverConfig {
    /// The node.
    pub address: Address,
    /// Longest time between heartbeats, nanoseconds.
    pub heartbeat_timeout_ns: u64,
    /// Highest age of a scan since its exposure, nanoseconds.
    pub max_age_ns: u64,
}

impl ReceiverConfig {
    /// Listens to `address`; heartbeats may be 300 ms apart, that is two may be missing, and scans 500 ms old.
    pub const fn new(address: Address) -> Self {
        Self { address, heartbeat_timeout_ns: 300_000_000, max_age_ns: 500_000_000 }
    }
}

/// What a frame brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// Nothing: not a message that this receiver listens to.
    NotOurs,
    /// A heartbeat.
    Heartbeat,
    /// A part of a scan.
    Part,
    /// The last part of a scan: it is whole and now the newest.
    Scan {
        /// Its index.
        scan_index: u16,
    },
    /// The same message once more; ignored.
    Repeated,
    /// A part of a scan whose header was not seen, or that was abandoned; ignored.
    Waiting,
    /// The header of a scan that is not newer than the newest; the scan is ignored.
    Old,
    /// The scan that was being received is given up. A header begins the next one nevertheless.
    Abandoned(Abandoned),
}

/// Why a scan was given up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Abandoned {
    /// The counter says that messages are missing.
    Lost,
    /// Not the message that has to follow.
    OutOfOrder,
    /// A part of another scan.
    OtherScan,
    /// Not the number of cells that the header promised.
    WrongCellCount,
    /// The checksum over all cells does not fit.
    WrongScanCrc,
    /// More runs of cells than there is room for.
    TooLarge,
}

/// A message of the node that cannot be used. If it was part of a scan, that scan will not become whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReceiveError {
    /// The protection does not hold.
    Packet(PacketError),
    /// A value has no meaning.
    Value(MeaninglessValue),
}

/// Why there is no scan to drive by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoScan {
    /// No heartbeat yet, or none for too long.
    NoHeartbeat,
    /// The node speaks another version of the messages.
    OtherVersion(u8),
    /// The node is not running.
    NotRunning(NodeState),
    /// No scan yet.
    None,
    /// The newest scan is too old.
    TooOld,
}

/// What went wrong so far. Counts stay at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReceiverStatistics {
    /// Scans that became whole.
    pub scans: u32,
    /// Scans that were given up.
    pub abandoned_scans: u32,
    /// Scans whose header was not newer than the newest scan.
    pub old_scans: u32,
    /// Parts of scans that were not being received: their header is missing, or they were given up.
    pub stray_parts: u32,
    /// Scans missing between whole ones, by their indices.
    pub missed_scans: u32,
    /// Messages missing by their counters: at least that many.
    pub lost: u32,
    /// Messages that came more than once.
    pub repeated: u32,
    /// Messages whose checksum did not fit.
    pub crc_errors: u32,
    /// Messages that were refused for another reason.
    pub refused: u32,
}

/// The newest whole scan.
#[derive(Clone, Copy, Debug)]
pub struct ReceivedScan<'a> {
    /// Index of the scan.
    pub scan_index: u16,
    /// Time since exposure, nanoseconds, up to the moment of asking. The time that the header waited for the bus is not in it.
    pub age_ns: u64,
    /// How far the cells can be trusted; the reasons are in the heartbeat.
    pub health: HealthLevel,
    /// Edge of a cell, millimetres.
    pub cell_size_mm: u16,
    /// Cells that were left out, up to 4095.
    pub dropped_cells: u16,
    /// The cells that are not unknown: obstacles before free cells, near before far.
    pub runs: &'a [Run],
    /// Nearest obstacle by direction.
    pub sectors: SectorDistances,
    /// The ground plane, if there is one.
    pub ground: Option<WireGround>,
}

/// Takes the frames of one node and keeps the newest whole scan.
///
/// The first state is "no data". A scan counts only when its header, every cell frame, the sectors, the ground and the end
/// have come in their order, with right checksums and counters, and agree with each other. Until then, and whenever
/// something is missing, the one before stays, and its age grows until it is refused.
///
/// Two tables of `RUNS` runs, 4 bytes each, are held: one for the newest scan, one for the next.
#[derive(Clone, Debug)]
pub struct ScanReceiver<const RUNS: usize> {
    config: ReceiverConfig,
    heartbeat: Option<(HeartbeatRepr, u64)>,
    assembly: Assembly,
    newest: Option<Committed>,
    tables: [Vec<Run, RUNS, u16>; 2],
    /// Which of the tables belongs to the newest scan.
    second_is_newest: bool,
    statistics: ReceiverStatistics,
}

impl<const RUNS: usize> ScanReceiver<RUNS> {
    /// A receiver that has heard nothing yet.
    pub const fn new(config: ReceiverConfig) -> Self {
        const { assert!(RUNS <= u16::MAX as usize, "the table of runs is counted in 16 bits") };
        let statistics = ReceiverStatistics {
            scans: 0,
            abandoned_scans: 0,
            old_scans: 0,
            stray_parts: 0,
            missed_scans: 0,
            lost: 0,
            repeated: 0,
            crc_errors: 0,
            refused: 0,
        };
        Self {
            config,
            heartbeat: None,
            assembly: Assembly::new(),
            newest: None,
            tables: [Vec::new(), Vec::new()],
            second_is_newest: false,
            statistics,
        }
    }

    /// Takes a frame that came at `now_ns` of a clock that does not go back. Frames of others may be passed as well.
    ///
    /// # Errors
    /// [`ReceiveError`] if the frame is one of the node's, but cannot be used.
    ///
    /// # Bound
    /// The bytes and runs of one frame.
    pub fn receive(&mut self, id: StandardId, data: &[u8], now_ns: u64) -> Result<Received, ReceiveError> {
        let [first, second] = &mut self.tables;
        let table = if self.second_is_newest { first } else { second };
        let newest = self.newest.filter(|newest| newest.is_fresh(now_ns, self.config.max_age_ns));
        let mut outcome = Outcome::default();
        let newest_index = newest.map(|newest| newest.scan_index());
        let frame = (id, data, now_ns);
        let result = self.assembly.receive(self.config.address, newest_index, table.as_mut_view(), frame, &mut outcome);
        if let Some(heartbeat) = outcome.heartbeat {
            self.heartbeat = Some((heartbeat, now_ns));
        }
        if let Some(committed) = outcome.committed {
            let steps = newest_index.map_or(1, |newest| committed.scan_index().wrapping_sub(newest));
            count(&mut self.statistics.missed_scans, u32::from(steps.saturating_sub(1)));
            self.newest = Some(committed);
            self.second_is_newest = !self.second_is_newest;
        }
        self.take_note(&result, &outcome);
        result
    }

    /// The newest whole scan, if it may be driven by at `now_ns`.
    ///
    /// # Errors
    /// [`NoScan`] says why there is none.
    pub fn scan(&self, now_ns: u64) -> Result<ReceivedScan<'_>, NoScan> {
        let heartbeat = self.heartbeat(now_ns).ok_or(NoScan::NoHeartbeat)?;
        if heartbeat.protocol_version != PROTOCOL_VERSION {
            return Err(NoScan::OtherVersion(heartbeat.protocol_version));
        }
        if heartbeat.state != NodeState::Running {
            return Err(NoScan::NotRunning(heartbeat.state));
        }
        let newest = self.newest.ok_or(NoScan::None)?;
        if !newest.is_fresh(now_ns, self.config.max_age_ns) {
            return Err(NoScan::TooOld);
        }
        let [first, second] = &self.tables;
        let runs = if self.second_is_newest { second } else { first };
        Ok(newest.view(now_ns, runs))
    }

    /// The newest heartbeat, unless it is too old at `now_ns`.
    pub fn heartbeat(&self, now_ns: u64) -> Option<HeartbeatRepr> {
        let (heartbeat, received_ns) = self.heartbeat?;
        (now_ns.saturating_sub(received_ns) <= self.config.heartbeat_timeout_ns).then_some(heartbeat)
    }

    /// What went wrong so far.
    pub const fn statistics(&self) -> &ReceiverStatistics {
        &self.statistics
    }

    fn take_note(&mut self, result: &Result<Received, ReceiveError>, outcome: &Outcome) {
        let statistics = &mut self.statistics;
        if let Some(Step::Lost(messages)) = outcome.step {
            count(&mut statistics.lost, u32::from(messages));
        }
        count(&mut statistics.abandoned_scans, u32::from(outcome.abandoned));
        match result {
            Ok(Received::Scan { .. }) => count(&mut statistics.scans, 1),
            Ok(Received::Repeated) => count(&mut statistics.repeated, 1),
            Ok(Received::Old) => count(&mut statistics.old_scans, 1),
            Ok(Received::Waiting) => count(&mut statistics.stray_parts, 1),
            Ok(Received::NotOurs | Received::Heartbeat | Received::Part | Received::Abandoned(_)) => {}
            Err(ReceiveError::Packet(PacketError::WrongCrc)) => count(&mut statistics.crc_errors, 1),
            Err(_) => count(&mut statistics.refused, 1),
        }
    }
}

impl ReceivedScan<'_> {
    /// The cells that are not unknown, `(i, j, obstacle)`.
    pub fn cells(&self) -> impl Iterator<Item = (i8, i8, bool)> {
        self.runs.iter().flat_map(|run| run.cells().map(|(i, j)| (i, j, run.obstacle)))
    }
}

pub(super) const fn count(counter: &mut u32, more: u32) {
    *counter = counter.saturating_add(more);
}
