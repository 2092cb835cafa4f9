//! `can.log`: every frame as it would go on the bus, in candump's log format.
//!
//! A recording has no clock of its own: the frames of a scan carry the time of exposure of its pictures and an age of zero,
//! so that the same recording gives the same bytes every time.

use std::{
    io::Write as _,
    time::{Duration, Instant},
};

use fencepost_core::{
    health::{Health, HealthLevel, HealthReason},
    map::CellState,
    wire::{
        CellsRepr, FIXED_FRAMES_PER_SCAN, Frame, HEARTBEAT_RATE_HZ, Message, NodeState, Scan, ScanEncoder, Status,
        WireConfig,
    },
};
use fencepost_hal::can::{CanFrame, CandumpLine};
use heapless::Vec as FixedVec;

use crate::{
    error::Failure,
    output::{CellRow, OutputFolder, WriteFile},
    view::FrameView,
};

/// Name of the interface in the log.
pub const INTERFACE: &str = "can0";

const HEARTBEAT_NS: u64 = 1_000_000_000 / HEARTBEAT_RATE_HZ as u64;
/// Pictures that do not come for so long are said to be stale.
const STALE_NS: u64 = 500_000_000;
/// Longest gap between pictures that is filled with heartbeats; what is longer is a mistake in the times.
const LONGEST_GAP_NS: u64 = 600_000_000_000;
/// Most runs of cells in a scan: 255 frames of 8.
pub(crate) const RUNS: usize = 255 * CellsRepr::FD_RUNS;
/// ... and most frames.
pub(crate) const FRAMES: usize = 255 + FIXED_FRAMES_PER_SCAN;

/// One node on the bus: scans as they come, heartbeats at 10 Hz between them.
#[derive(Debug)]
pub struct CanLog {
    file: Option<WriteFile>,
    encoder: Box<ScanEncoder<RUNS>>,
    frames: Box<FixedVec<Frame, FRAMES>>,
    status: Status,
    clock: Option<Clock>,
    counts: CanCounts,
}

#[derive(Clone, Copy, Debug)]
struct Clock {
    now_ns: u64,
    next_heartbeat_ns: u64,
}

/// What went on the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct CanCounts {
    /// Scans.
    pub scans: u64,
    /// Heartbeats.
    pub heartbeats: u64,
    /// Frames, heartbeats among them.
    pub frames: u64,
    /// Most frames of one scan.
    pub most_frames_per_scan: u64,
    /// Known cells that found no room in their scan.
    pub dropped_cells: u64,
}

/// A scan that went on the bus.
#[derive(Clone, Debug, Default)]
pub struct SentScan {
    /// The cells that the frames say, in the order of the frames.
    pub cells: Vec<CellRow>,
    /// Known cells that found no room.
    pub dropped_cells: u32,
    /// Time that making the frames took, without writing them.
    pub encoding: Duration,
}

impl CanLog {
    /// Starts the log. With no `folder` the frames are made, as the tables need them, but not written.
    ///
    /// # Errors
    /// When the file cannot be written or the settings ask for more than there is room for.
    pub fn create(folder: Option<&OutputFolder>, config: WireConfig) -> Result<Self, Failure> {
        let encoder = ScanEncoder::new(config).map_err(|error| Failure::config(error, None))?;
        Ok(Self {
            file: folder.map(|folder| folder.create("can.log")).transpose()?,
            encoder: Box::new(encoder),
            frames: Box::default(),
            status: Status { state: NodeState::Starting, health: Health::default(), last_scan: None },
            clock: None,
            counts: CanCounts::default(),
        })
    }

    /// Encodes the scan of a frame, writes the heartbeats that were due before it, and the scan.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn scan(&mut self, view: &FrameView<'_>) -> Result<SentScan, Failure> {
        self.advance(view.timestamp_ns)?;
        self.due_heartbeats(view.timestamp_ns, true)?;
        let detection = view.detection;
        // Counts the scans and not the frames: a gap would tell a receiver that it has missed something.
        let scan_index = self.counts.scans as u16;
        let scan = Scan {
            scan_index,
            age_ns: 0,
            health: view.health,
            geometry: &detection.map.geometry,
            cells: &detection.map.cells,
            sectors: &detection.sectors,
            ground: detection.ground.as_ref(),
        };
        self.frames.clear();
        let start = Instant::now();
        let report = self
            .encoder
            .encode(&scan, self.frames.as_mut_view())
            .map_err(|error| Failure::work(format!("the scan cannot be sent: {error}")))?;
        let encoding = start.elapsed();
        self.status = Status { state: NodeState::Running, health: view.health, last_scan: Some(scan_index) };
        if report.dropped_cells > 0 {
            self.status.health.raise(HealthReason::MapTruncated, HealthLevel::Degraded);
        }
        let now_ns = self.now_ns();
        for frame in self.frames.iter() {
            write_frame(self.file.as_mut(), frame, now_ns)?;
        }
        if self.counts.scans == 0 {
            // A receiver takes no scan from a node that is not running: it hears at once that this one is.
            self.heartbeat(now_ns)?;
        }
        self.flush()?;
        let frames = self.frames.len() as u64;
        self.counts.scans += 1;
        self.counts.frames += frames;
        self.counts.most_frames_per_scan = self.counts.most_frames_per_scan.max(frames);
        self.counts.dropped_cells += u64::from(report.dropped_cells);
        Ok(SentScan { cells: self.sent_cells(view), dropped_cells: report.dropped_cells, encoding })
    }

    /// A frame did not come, or could not be used: says so at once, besides the regular heartbeats.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn missing(&mut self, timestamp_ns: Option<u64>) -> Result<(), Failure> {
        let now_ns = timestamp_ns.unwrap_or_else(|| self.now_ns());
        self.advance(now_ns)?;
        let mut health = Health::OK;
        health.raise(HealthReason::MissingPicture, HealthLevel::Blind);
        self.status.health = health;
        self.heartbeat(self.now_ns())?;
        if let Some(clock) = &mut self.clock {
            clock.next_heartbeat_ns = clock.now_ns + HEARTBEAT_NS;
        }
        self.flush()
    }

    /// Ends the log with a heartbeat that says so, and tells what was sent.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn finish(mut self) -> Result<CanCounts, Failure> {
        if self.clock.is_some() {
            self.status.state = NodeState::Stopping;
            self.heartbeat(self.now_ns())?;
        }
        self.flush()?;
        Ok(self.counts)
    }

    /// How far the newest scan can be trusted, with what the bus had to add.
    pub const fn health(&self) -> Health {
        self.status.health
    }

    fn now_ns(&self) -> u64 {
        self.clock.map_or(0, |clock| clock.now_ns)
    }

    /// Goes on to `to_ns`, with the heartbeats that were due before. The clock of a bus never goes back, whatever the times
    /// of a recording do.
    fn advance(&mut self, to_ns: u64) -> Result<(), Failure> {
        let Some(clock) = &mut self.clock else {
            self.clock = Some(Clock { now_ns: to_ns, next_heartbeat_ns: to_ns });
            return Ok(());
        };
        let since_ns = clock.now_ns;
        if to_ns.saturating_sub(since_ns) > LONGEST_GAP_NS {
            clock.next_heartbeat_ns = to_ns;
        }
        let health = self.status.health;
        self.due_heartbeats_since(since_ns, to_ns, false)?;
        self.status.health = health;
        if let Some(clock) = &mut self.clock {
            clock.now_ns = clock.now_ns.max(to_ns);
        }
        Ok(())
    }

    fn due_heartbeats(&mut self, until_ns: u64, inclusive: bool) -> Result<(), Failure> {
        self.due_heartbeats_since(until_ns, until_ns, inclusive)
    }

    fn due_heartbeats_since(&mut self, since_ns: u64, until_ns: u64, inclusive: bool) -> Result<(), Failure> {
        while let Some(clock) = self.clock {
            let at_ns = clock.next_heartbeat_ns;
            if at_ns > until_ns || (at_ns == until_ns && !inclusive) {
                break;
            }
            if at_ns.saturating_sub(since_ns) > STALE_NS {
                self.status.health.raise(HealthReason::StalePicture, HealthLevel::Blind);
            }
            self.heartbeat(at_ns)?;
            self.clock = Some(Clock { next_heartbeat_ns: at_ns.saturating_add(HEARTBEAT_NS), ..clock });
        }
        Ok(())
    }

    fn heartbeat(&mut self, at_ns: u64) -> Result<(), Failure> {
        let frame = self.encoder.heartbeat(&self.status);
        self.counts.heartbeats += 1;
        self.counts.frames += 1;
        write_frame(self.file.as_mut(), &frame, at_ns)
    }

    /// The cells as the frames say them: what the tables hold is what a receiver gets, by construction.
    fn sent_cells(&self, view: &FrameView<'_>) -> Vec<CellRow> {
        let map = &view.detection.map;
        let address = self.encoder.config().address();
        let is_cells = |frame: &&Frame| matches!(address.message(frame.id()), Some(Message::Cells | Message::CellsFd));
        let runs = self.frames.iter().filter(is_cells).filter_map(|frame| CellsRepr::parse(frame.data()).ok());
        let runs = runs.flat_map(|cells| cells.runs.into_iter().flatten());
        let cells = runs.flat_map(|run| run.cells().map(move |cell| (cell, run.obstacle)));
        cells
            .map(|((i, j), obstacle)| {
                let cell = (i16::from(i), i16::from(j));
                let known = map.geometry.index(cell.0, cell.1).and_then(|index| map.cells.get(index));
                let mut content = known.copied().unwrap_or_default();
                content.state = if obstacle { CellState::Obstacle } else { CellState::Free };
                CellRow { cell, content }
            })
            .collect()
    }

    fn flush(&mut self) -> Result<(), Failure> {
        match &mut self.file {
            Some(file) => file.flush().map_err(|error| Failure::cannot_write(file.path(), &error)),
            None => Ok(()),
        }
    }
}

fn write_frame(file: Option<&mut WriteFile>, frame: &Frame, timestamp_ns: u64) -> Result<(), Failure> {
    let Some(file) = file else { return Ok(()) };
    let Some(frame) = CanFrame::new(frame.id(), frame.data(), frame.is_fd()) else {
        return Err(Failure::work(format!("no CAN frame has {} bytes", frame.data().len())));
    };
    let line = CandumpLine { timestamp_ns, interface: INTERFACE.to_string(), frame };
    writeln!(file, "{line}").map_err(|error| Failure::cannot_write(file.path(), &error))
}
