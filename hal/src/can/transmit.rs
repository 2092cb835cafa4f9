//! The queue between the encoder and a bus: never waits, never mixes scans.

use fencepost_core::wire::{Frame, HeaderRepr};

use super::{BusError, BusErrorKind, CanBus, CanFrame, ControllerState};

/// Sends the heartbeats and scans of one node on a bus.
///
/// The rule:
/// - A heartbeat goes before everything else. A newer one replaces one that still waits.
/// - A scan goes in its order, header first. When the next one comes, what is left of the one before is abandoned, so that
///   frames of two scans are never mixed; what had gone out of it looks cut short to the receiver, which is right.
/// - A frame that finds the bus full waits and is tried again at the next [`pump`](Self::pump), however long that takes.
/// - When the bus is down, gone or off (bus-off), what is left of the scan is abandoned: frames that the bus had taken already
///   may be lost, so that the rest could never be taken over. The next scan begins afresh.
/// - A frame that the bus never takes (CAN FD on a classic bus) takes its scan with it.
///
/// No memory is taken after [`new`](Self::new), and no call waits.
#[derive(Debug)]
pub struct Transmitter<B: CanBus> {
    bus: B,
    heartbeat: Option<Frame>,
    /// The newest scan; empty when there is nothing left of it to send.
    scan: Vec<Frame>,
    /// Frames of it that the bus has taken.
    taken: usize,
    capacity: usize,
    /// Restarts of the controller that are known.
    restarts: u32,
    counters: TransmitCounters,
    error: Option<B::Error>,
}

/// What one call of [`Transmitter::pump`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[must_use]
pub struct Pump {
    /// Frames that the bus took.
    pub sent: usize,
    /// Index of the scan whose last frame the bus took.
    pub scan_finished: Option<u16>,
    /// Frames that still wait.
    pub waiting: usize,
    /// What keeps frames from the bus, or kept them: [`Full`](BusErrorKind::Full) leaves them waiting.
    /// [`Down`](BusErrorKind::Down) also stands for a controller that is off the bus.
    pub trouble: Option<BusErrorKind>,
}

/// What became of heartbeats and scans. Counts stay at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TransmitCounters {
    /// Frames that the bus took.
    pub frames: u64,
    /// Heartbeats that the bus took.
    pub heartbeats: u64,
    /// Heartbeats that a newer one replaced, or that the bus never takes.
    pub lost_heartbeats: u64,
    /// Scans that the bus took whole.
    pub scans: u64,
    /// Scans that were abandoned, those of which nothing had gone out among them.
    pub abandoned_scans: u64,
    /// Frames of abandoned scans that were not sent.
    pub abandoned_frames: u64,
    /// Times that the bus was full.
    pub full: u64,
    /// Times that the bus was down, gone or off when something was to be sent.
    pub no_bus: u64,
    /// Frames that the bus never takes.
    pub refused: u64,
    /// Other errors of the bus.
    pub other_errors: u64,
}

/// A scan has more frames than the transmitter was made for. It is not sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanTooLong {
    /// Frames of the scan.
    pub frames: usize,
    /// Frames that there is room for.
    pub capacity: usize,
}

impl<B: CanBus> Transmitter<B> {
    /// A transmitter for `bus` with room for a scan of `capacity` frames:
    /// [`max_frames_per_scan`](fencepost_core::wire::max_frames_per_scan) of the settings.
    pub fn new(bus: B, capacity: usize) -> Self {
        Self {
            bus,
            heartbeat: None,
            scan: Vec::with_capacity(capacity),
            taken: 0,
            capacity,
            restarts: 0,
            counters: TransmitCounters::default(),
            error: None,
        }
    }

    /// Takes over the newest heartbeat; it is sent by the next [`pump`](Self::pump).
    pub fn heartbeat(&mut self, frame: &Frame) {
        let replaced = self.heartbeat.replace(*frame).is_some();
        count(&mut self.counters.lost_heartbeats, usize::from(replaced));
    }

    /// Takes over the newest scan, all frames of it; they are sent by the next calls of [`pump`](Self::pump).
    ///
    /// # Errors
    /// [`ScanTooLong`]; the scan before goes on then.
    pub fn scan(&mut self, frames: &[Frame]) -> Result<(), ScanTooLong> {
        if frames.len() > self.capacity {
            return Err(ScanTooLong { frames: frames.len(), capacity: self.capacity });
        }
        self.abandon_scan();
        self.scan.extend_from_slice(frames);
        Ok(())
    }

    /// Hands frames to the bus at `now_ns` until none waits or the bus takes no more.
    ///
    /// # Bound
    /// The frames that wait.
    pub fn pump(&mut self, now_ns: u64) -> Pump {
        let mut pump = Pump::default();
        pump.trouble = self.push(&mut pump, now_ns).err();
        pump.waiting = self.waiting();
        pump
    }

    /// The next frame that has arrived, as [`CanBus::receive`] gives it. To be used instead of the bus itself: an interface that
    /// is down for a moment may tell only this side of it.
    ///
    /// # Errors
    /// When the bus cannot be read. If it is down or gone, the scan that is being sent is abandoned.
    pub fn receive(&mut self) -> Result<Option<(u64, CanFrame)>, B::Error> {
        let received = self.bus.receive();
        if received.as_ref().is_err_and(|error| matches!(error.kind(), BusErrorKind::Down | BusErrorKind::Gone)) {
            self.abandon_scan();
        }
        received
    }

    /// Frames that wait.
    pub fn waiting(&self) -> usize {
        usize::from(self.heartbeat.is_some()) + self.scan.len() - self.taken
    }

    /// What became of heartbeats and scans so far.
    pub const fn counters(&self) -> &TransmitCounters {
        &self.counters
    }

    /// The newest error of the bus, in its own words; `None` if the last [`pump`](Self::pump) that had something to send met
    /// none.
    pub const fn error(&self) -> Option<&B::Error> {
        self.error.as_ref()
    }

    /// The bus.
    pub const fn bus(&self) -> &B {
        &self.bus
    }

    /// The bus.
    pub const fn bus_mut(&mut self) -> &mut B {
        &mut self.bus
    }

    /// The bus. What still waits is not sent.
    pub fn into_inner(self) -> B {
        self.bus
    }

    fn push(&mut self, pump: &mut Pump, now_ns: u64) -> Result<(), BusErrorKind> {
        let heartbeat = self.push_heartbeat(pump, now_ns);
        // What is handed to a controller that is off the bus is thrown away in silence. The heartbeat was tried nevertheless:
        // it costs nothing, and what is known of the controller may be out of date.
        self.look_at_controller()?;
        heartbeat?;
        while let Some(frame) = self.scan.get(self.taken).copied() {
            self.send(&frame, now_ns)?;
            self.taken += 1;
            pump.sent += 1;
            if self.taken == self.scan.len() {
                pump.scan_finished = self.scan.first().and_then(scan_index);
                count(&mut self.counters.scans, 1);
                self.scan.clear();
                self.taken = 0;
            }
        }
        Ok(())
    }

    fn push_heartbeat(&mut self, pump: &mut Pump, now_ns: u64) -> Result<(), BusErrorKind> {
        let Some(heartbeat) = self.heartbeat else { return Ok(()) };
        let sent = self.send(&heartbeat, now_ns);
        match sent {
            Ok(()) => {
                self.heartbeat = None;
                pump.sent += 1;
                count(&mut self.counters.heartbeats, 1);
            }
            Err(BusErrorKind::Refused) => {
                self.heartbeat = None;
                count(&mut self.counters.lost_heartbeats, 1);
            }
            // It waits; a newer one may take its place.
            Err(_) => {}
        }
        sent
    }

    fn look_at_controller(&mut self) -> Result<(), BusErrorKind> {
        let condition = self.bus.condition();
        if condition.controller == ControllerState::BusOff {
            count(&mut self.counters.no_bus, usize::from(!self.scan.is_empty()));
            self.abandon_scan();
            return Err(BusErrorKind::Down);
        }
        // It was off the bus and is back: what it held is lost.
        if self.restarts != condition.restarts && self.taken > 0 {
            self.abandon_scan();
        }
        self.restarts = condition.restarts;
        Ok(())
    }

    fn send(&mut self, frame: &Frame, now_ns: u64) -> Result<(), BusErrorKind> {
        let sent = match CanFrame::new(frame.id(), frame.data(), frame.is_fd()) {
            Some(frame) => self.bus.send(&frame, now_ns),
            // The lengths of the core's frames are among those of the bus.
            None => return self.fail(BusErrorKind::Refused),
        };
        match sent {
            Ok(()) => {
                self.error = None;
                count(&mut self.counters.frames, 1);
                Ok(())
            }
            Err(error) => {
                let kind = error.kind();
                self.error = Some(error);
                self.fail(kind)
            }
        }
    }

    fn fail(&mut self, kind: BusErrorKind) -> Result<(), BusErrorKind> {
        let counter = match kind {
            BusErrorKind::Full => &mut self.counters.full,
            BusErrorKind::Down | BusErrorKind::Gone => &mut self.counters.no_bus,
            BusErrorKind::Refused => &mut self.counters.refused,
            BusErrorKind::Other => &mut self.counters.other_errors,
        };
        count(counter, 1);
        if kind != BusErrorKind::Full {
            self.abandon_scan();
        }
        Err(kind)
    }

    fn abandon_scan(&mut self) {
        if self.scan.is_empty() {
            return;
        }
        count(&mut self.counters.abandoned_scans, 1);
        count(&mut self.counters.abandoned_frames, self.scan.len() - self.taken);
        self.scan.clear();
        self.taken = 0;
    }
}

impl std::fmt::Display for ScanTooLong {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { frames, capacity } = self;
        write!(f, "a scan of {frames} frames, with room for {capacity}; lower wire.max_cell_frames")
    }
}

impl std::error::Error for ScanTooLong {}

fn scan_index(header: &Frame) -> Option<u16> {
    HeaderRepr::parse(header.data()).ok().map(|header| header.scan_index)
}

fn count(counter: &mut u64, more: usize) {
    *counter = counter.saturating_add(more as u64);
}

#[cfg(test)]
#[path = "transmit_tests.rs"]
mod tests;
