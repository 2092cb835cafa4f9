//! The sending side: from a scan to its frames.

use heapless::{Vec, VecView};

use crate::error::{ConfigError, ConfigProblem};
use crate::ground::GroundPlane;
use crate::health::{Health, HealthLevel};
use crate::map::{Cell, MapGeometry, SectorDistances};
use crate::work::{self, Loop};

use super::address::{Address, Message};
use super::config::{FrameFormat, WireConfig};
use super::frame::{Frame, MAX_DATA};
use super::load::FIXED_FRAMES_PER_SCAN;
use super::message::{
    CellsRepr, EndRepr, GroundRepr, HeaderRepr, HeartbeatRepr, NodeState, PROTOCOL_VERSION, Run, SectorsRepr, scan_low,
};
use super::protect::{ScanCrc, next_counter, protect};
use super::select::select;

/// What one call of the detector has to say on the bus.
#[derive(Clone, Copy, Debug)]
pub struct Scan<'a> {
    /// Index of the scan; rises by one from scan to scan and wraps.
    pub scan_index: u16,
    /// Time since exposure, nanoseconds.
    pub age_ns: u64,
    /// How far the cells can be trusted.
    pub health: Health,
    /// Where the cells lie.
    pub geometry: &'a MapGeometry,
    /// The cells in the order of [`MapGeometry::index`]; cells that are missing at the end are unknown.
    pub cells: &'a [Cell],
    /// Nearest obstacle by direction.
    pub sectors: &'a SectorDistances,
    /// The ground plane, if there is one.
    pub ground: Option<&'a GroundPlane>,
}

/// What a node says about itself in its heartbeat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// What the node is doing.
    pub state: NodeState,
    /// How far the cells can be trusted, and why.
    pub health: Health,
    /// Index of the newest scan; `None` before the first.
    pub last_scan: Option<u16>,
}

/// What became of a scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EncodeReport {
    /// Frames added to the output.
    pub frames: usize,
    /// Cells in them.
    pub cells: u16,
    /// Known cells that found no room: a reason for
    /// [`HealthReason::MapTruncated`](crate::health::HealthReason::MapTruncated).
    pub dropped_cells: u32,
}

/// The output has no room for the frames that every scan has, [`FIXED_FRAMES_PER_SCAN`]; nothing was added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutputFull;

/// Turns scans and states of one node into protected frames. Holds up to `RUNS` runs of cells, 4 bytes each, and the
/// counters of the messages.
#[derive(Clone, Debug)]
pub struct ScanEncoder<const RUNS: usize> {
    config: WireConfig,
    counters: Counters,
    runs: Vec<Run, RUNS, u16>,
}

impl<const RUNS: usize> ScanEncoder<RUNS> {
    /// An encoder whose counters begin at 0.
    ///
    /// # Errors
    /// [`ConfigProblem::OverCapacity`] if `config` allows more runs than `RUNS`.
    pub const fn new(config: WireConfig) -> Result<Self, ConfigError> {
        const { assert!(RUNS <= u16::MAX as usize, "the table of runs is counted in 16 bits") };
        if config.max_runs() > RUNS {
            let problem = ConfigProblem::OverCapacity {
                needed: config.max_cell_frames() as usize,
                capacity: RUNS / config.format().runs_per_frame(),
            };
            return Err(ConfigError::new("wire.max_cell_frames", problem));
        }
        Ok(Self { config, counters: Counters::new(config.address()), runs: Vec::new() })
    }

    /// The settings.
    pub const fn config(&self) -> &WireConfig {
        &self.config
    }

    /// Adds the frames of `scan` to `out`: header, cells, sectors, ground, end.
    ///
    /// Obstacles come first, then free cells, the nearest first in both. What does not fit into the configured number of cell
    /// frames, or into `out`, is left out from the end of that order, counted, and said in the end frame; the header then
    /// says degraded at least.
    ///
    /// # Errors
    /// [`OutputFull`]
    ///
    /// # Bound
    /// The cells once; for each run of cells the logarithm of the runs that can be sent, twice; the frames of a scan, see
    /// [`max_frames_per_scan`](super::max_frames_per_scan).
    pub fn encode(&mut self, scan: &Scan<'_>, out: &mut VecView<Frame>) -> Result<EncodeReport, OutputFull> {
        encode(&self.config, &mut self.counters, self.runs.as_mut_view(), scan, out)
    }

    /// The heartbeat for `status`.
    pub fn heartbeat(&mut self, status: &Status) -> Frame {
        let Status { state, health, last_scan } = *status;
        let repr = HeartbeatRepr { state, health, protocol_version: PROTOCOL_VERSION, last_scan };
        self.counters.frame(Message::Heartbeat, |data| repr.emit(data))
    }
}

/// The counters of the messages that one node sends.
#[derive(Clone, Debug)]
pub(super) struct Counters {
    address: Address,
    next: [u8; 16],
}

impl Counters {
    pub(super) const fn new(address: Address) -> Self {
        Self { address, next: [0; 16] }
    }

    /// The next frame of `message`, whose signals `emit` writes.
    pub(super) fn frame(&mut self, message: Message, emit: impl FnOnce(&mut [u8])) -> Frame {
        let id = self.address.id(message);
        work::count(Loop::WireFrames, 1);
        let mut data = [0; MAX_DATA];
        if let Some(data) = data.get_mut(..message.data_len()) {
            emit(data);
            if let Some(counter) = self.next.get_mut(message as usize) {
                protect(id.as_raw(), *counter, data);
                *counter = next_counter(*counter);
            }
        }
        Frame::of_message(id, message, data)
    }
}

fn encode(
    config: &WireConfig,
    counters: &mut Counters,
    runs: &mut VecView<Run, u16>,
    scan: &Scan<'_>,
    out: &mut VecView<Frame>,
) -> Result<EncodeReport, OutputFull> {
    let room = out.capacity().saturating_sub(out.len()).checked_sub(FIXED_FRAMES_PER_SCAN).ok_or(OutputFull)?;
    let runs_per_frame = config.format().runs_per_frame();
    let max_frames = room.min(usize::from(config.max_cell_frames()));
    let selection = select(scan.geometry, scan.cells, max_frames.saturating_mul(runs_per_frame), runs);
    let frame_count = runs.len().div_ceil(runs_per_frame);

    let first = out.len();
    let mut add = |frame| out.push(frame).map_err(|_| OutputFull);
    let truncated = if selection.dropped > 0 { HealthLevel::Degraded } else { HealthLevel::Ok };
    let header = HeaderRepr {
        scan_index: scan.scan_index,
        cell_count: selection.cells,
        health: scan.health.level.max(truncated),
        frame_count: frame_count as u8,
        age_steps: HeaderRepr::age_steps(scan.age_ns),
    };
    add(counters.frame(Message::Header, |data| header.emit(data)))?;

    let scan_low = scan_low(scan.scan_index);
    let message = match config.format() {
        FrameFormat::Classic => Message::Cells,
        FrameFormat::Fd => Message::CellsFd,
    };
    let mut scan_crc = ScanCrc::START;
    for (chunk, sequence) in runs.chunks(runs_per_frame).zip((0..=0xF).cycle()) {
        let mut cells = CellsRepr { scan_low, sequence, runs: [None; CellsRepr::FD_RUNS] };
        cells.runs.iter_mut().zip(chunk).for_each(|(to, run)| *to = Some(*run));
        let frame = counters.frame(message, |data| cells.emit(data));
        scan_crc.add(frame.data().get(2..).unwrap_or(&[]));
        add(frame)?;
    }
    for part in 0..SectorsRepr::PARTS {
        let sectors = SectorsRepr::of(scan.sectors, scan_low, part);
        add(counters.frame(Message::Sectors, |data| sectors.emit(data)))?;
    }
    let ground = GroundRepr::of(scan.ground, scan_low);
    add(counters.frame(Message::Ground, |data| ground.emit(data)))?;
    let end = EndRepr {
        scan_index: scan.scan_index,
        cell_size_mm: scan.geometry.cell_size_mm,
        dropped_cells: selection.dropped.min(EndRepr::DROPPED_CELLS.max()) as u16,
        scan_crc: scan_crc.get(),
    };
    add(counters.frame(Message::End, |data| end.emit(data)))?;

    Ok(EncodeReport {
        frames: out.len().saturating_sub(first),
        cells: selection.cells,
        dropped_cells: selection.dropped,
    })
}

impl core::fmt::Display for OutputFull {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "the output has no room for a scan's {FIXED_FRAMES_PER_SCAN} fixed frames")
    }
}

impl core::error::Error for OutputFull {}
