//! Where frames come from: an interface or a log.

use std::path::Path;

#[cfg(target_os = "linux")]
use fencepost_hal::can::{BusError, BusErrorKind, CanBus, CanInterface, SocketCan};
use fencepost_hal::{
    can::{BusCondition, CanFrame, parse_candump},
    clock::monotonic_ns,
};

use crate::error::Failure;

/// Frames as they come.
#[derive(Debug)]
pub enum Source {
    /// An interface of this machine.
    #[cfg(target_os = "linux")]
    Bus(Box<BusSource>),
    /// A log, played.
    Log(LogSource),
}

/// How a source stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SourceState {
    /// Frames come, if there are any.
    Open,
    /// The interface cannot be used now.
    Trouble {
        /// What is wrong.
        what: String,
        /// What to do.
        mend: String,
    },
    /// Held by the user.
    Paused,
    /// The log is at its end.
    Ended,
}

/// An interface of this machine.
#[cfg(target_os = "linux")]
#[derive(Debug)]
pub struct BusSource {
    bus: SocketCan,
    state: SourceState,
    bitrate: Option<u32>,
    /// When the interface is asked for its bit rate again; it may have been set up since.
    look_ns: u64,
}

/// A log, played by its times.
#[derive(Debug)]
pub struct LogSource {
    frames: Vec<(u64, CanFrame)>,
    next: usize,
    unreadable: usize,
    /// Of the recorded time in that of the clock; infinite: everything at once.
    speed: f64,
    /// Recorded time at the moment `since_ns` of the clock.
    at_ns: u64,
    since_ns: u64,
    paused: bool,
}

impl Source {
    /// Listens to an interface. It need not be there yet.
    #[cfg(target_os = "linux")]
    pub fn bus(interface: &str) -> Self {
        let bus = SocketCan::new(interface, false);
        Self::Bus(Box::new(BusSource { bus, state: SourceState::Open, bitrate: None, look_ns: 0 }))
    }

    /// The next frame that has come, and when.
    pub fn next_frame(&mut self) -> Option<(u64, CanFrame)> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Bus(bus) => bus.next_frame(),
            Self::Log(log) => log.next_frame(monotonic_ns()),
        }
    }

    /// The time by which the frames' times go.
    pub fn now_ns(&self) -> u64 {
        match self {
            #[cfg(target_os = "linux")]
            Self::Bus(_) => monotonic_ns(),
            Self::Log(log) => log.now_ns(monotonic_ns()),
        }
    }

    /// How it stands.
    pub fn state(&self) -> SourceState {
        match self {
            #[cfg(target_os = "linux")]
            Self::Bus(bus) => bus.state.clone(),
            Self::Log(log) if log.next >= log.frames.len() => SourceState::Ended,
            Self::Log(LogSource { paused: true, .. }) => SourceState::Paused,
            Self::Log(_) => SourceState::Open,
        }
    }

    /// Whether the interface cannot be used now.
    pub const fn is_in_trouble(&self) -> bool {
        match self {
            #[cfg(target_os = "linux")]
            Self::Bus(bus) => matches!(bus.state, SourceState::Trouble { .. }),
            Self::Log(_) => false,
        }
    }

    /// Bit rate of the interface, bits per second, where it has one.
    pub fn bitrate(&self) -> Option<u32> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Bus(bus) => bus.bitrate,
            Self::Log(_) => None,
        }
    }

    /// What the controller of the interface tells.
    pub fn condition(&self) -> BusCondition {
        match self {
            #[cfg(target_os = "linux")]
            Self::Bus(bus) => bus.bus.condition(),
            Self::Log(_) => BusCondition::default(),
        }
    }

    /// Lines of the log that could not be read.
    pub const fn unreadable(&self) -> usize {
        match self {
            #[cfg(target_os = "linux")]
            Self::Bus(_) => 0,
            Self::Log(log) => log.unreadable,
        }
    }

    /// Sends a frame on the interface; says whether it was taken. Nothing is sent on a log.
    pub fn send(&mut self, frame: &CanFrame) -> bool {
        match self {
            #[cfg(target_os = "linux")]
            Self::Bus(bus) => bus.bus.send(frame, monotonic_ns()).is_ok(),
            Self::Log(_) => {
                let _ = frame;
                false
            }
        }
    }

    /// The log, if it is one.
    pub const fn log_mut(&mut self) -> Option<&mut LogSource> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Bus(_) => None,
            Self::Log(log) => Some(log),
        }
    }

    /// The log, if it is one.
    pub const fn as_log(&self) -> Option<&LogSource> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Bus(_) => None,
            Self::Log(log) => Some(log),
        }
    }
}

#[cfg(target_os = "linux")]
impl BusSource {
    fn next_frame(&mut self) -> Option<(u64, CanFrame)> {
        let now_ns = monotonic_ns();
        if now_ns >= self.look_ns {
            self.look_ns = now_ns.saturating_add(1_000_000_000);
            let interface = CanInterface::look(self.bus.interface()).ok();
            self.bitrate = interface.and_then(|interface| interface.timing).map(|timing| timing.bitrate);
        }
        match self.bus.receive() {
            Ok(frame) => {
                self.state = SourceState::Open;
                frame
            }
            // Only sending meets a full queue.
            Err(error) if error.kind() == BusErrorKind::Full => None,
            Err(error) => {
                self.state = SourceState::Trouble { what: error.what(), mend: error.mend() };
                None
            }
        }
    }
}

impl LogSource {
    /// Reads a log; of `interface` only, if that is given.
    ///
    /// # Errors
    /// When the file cannot be read, or holds no frame.
    pub fn open(path: &Path, interface: Option<&str>, speed: f64) -> Result<Self, Failure> {
        let place = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|error| {
            Failure::work(format!("the CAN log cannot be read: {error}"))
                .at(&place)
                .mend("give a log in candump’s format: `candump -L can0 > can.log`")
        })?;
        let log = Self::new(&bytes, interface, speed);
        if log.frames.is_empty() {
            let of = interface.map_or_else(String::new, |interface| format!(" of {interface}"));
            return Err(Failure::work(format!(
                "the CAN log holds no frame{of}; {} lines cannot be read",
                log.unreadable
            ))
            .at(&place)
            .mend("give a log in candump’s format: `candump -L can0 > can.log`"));
        }
        Ok(log)
    }

    /// Takes the lines of a log.
    pub fn new(bytes: &[u8], interface: Option<&str>, speed: f64) -> Self {
        let (mut frames, mut unreadable, mut newest_ns) = (Vec::new(), 0, 0);
        for line in parse_candump(bytes) {
            match line {
                Ok(line) if interface.is_none_or(|interface| interface == line.interface) => {
                    // A clock that was set back while the log was written does not lead back.
                    newest_ns = line.timestamp_ns.max(newest_ns);
                    frames.push((newest_ns, line.frame));
                }
                Ok(_) => {}
                Err(_) => unreadable += 1,
            }
        }
        let at_ns = frames.first().map_or(0, |(at_ns, _)| *at_ns);
        Self { frames, next: 0, unreadable, speed, at_ns, since_ns: monotonic_ns(), paused: false }
    }

    /// Recorded time since the beginning and in all, nanoseconds.
    pub fn progress(&self) -> (u64, u64) {
        self.progress_at(monotonic_ns())
    }

    fn progress_at(&self, clock_ns: u64) -> (u64, u64) {
        let first = self.frames.first().map_or(0, |(at_ns, _)| *at_ns);
        let last = self.frames.last().map_or(0, |(at_ns, _)| *at_ns);
        (self.now_ns(clock_ns).saturating_sub(first), last.saturating_sub(first))
    }

    /// Of the recorded time in that of the clock.
    pub const fn speed(&self) -> f64 {
        self.speed
    }

    /// Plays faster or slower from here on.
    pub fn set_speed(&mut self, speed: f64) {
        self.hold_time();
        self.speed = speed;
    }

    /// Holds, or goes on.
    pub fn pause(&mut self) {
        self.hold_time();
        self.paused = !self.paused;
    }

    /// Plays again from the beginning.
    pub fn restart(&mut self) {
        self.next = 0;
        self.at_ns = self.frames.first().map_or(0, |(at_ns, _)| *at_ns);
        self.since_ns = monotonic_ns();
        self.paused = false;
    }

    fn hold_time(&mut self) {
        let clock_ns = monotonic_ns();
        self.at_ns = self.now_ns(clock_ns);
        self.since_ns = clock_ns;
    }

    fn next_frame(&mut self, clock_ns: u64) -> Option<(u64, CanFrame)> {
        let (at_ns, frame) = self.frames.get(self.next).copied()?;
        if self.speed.is_finite() && at_ns > self.now_ns(clock_ns) {
            return None;
        }
        self.next += 1;
        Some((at_ns, frame))
    }

    /// The recorded time at `clock_ns`; it stands still behind the last frame.
    fn now_ns(&self, clock_ns: u64) -> u64 {
        let last_ns = self.frames.last().map_or(0, |(at_ns, _)| *at_ns);
        if !self.speed.is_finite() {
            let newest = self.next.checked_sub(1).and_then(|index| self.frames.get(index));
            return newest.map_or(self.at_ns, |(at_ns, _)| *at_ns);
        }
        if self.paused {
            return self.at_ns.min(last_ns);
        }
        let passed_ns = clock_ns.saturating_sub(self.since_ns) as f64 * self.speed;
        self.at_ns.saturating_add(passed_ns as u64).min(last_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOG: &[u8] =
        b"(10.000000) can0 400#01\n(10.500000) can1 401#\nwhat\n(10.400000) can0 402#\n(12.000000) can0 403#\n";

    fn ids(log: &mut LogSource, clock_ns: u64) -> Vec<u32> {
        std::iter::from_fn(|| log.next_frame(clock_ns)).map(|(_, frame)| frame.raw_id()).collect()
    }

    #[test]
    fn a_log_is_played_by_its_times_at_any_speed() {
        let mut log = LogSource::new(LOG, None, 2.0);
        assert_eq!(log.unreadable, 1);
        log.since_ns = 0;
        assert_eq!(ids(&mut log, 0), [0x400]);
        assert_eq!(ids(&mut log, 249_000_000), [] as [u32; 0]);
        // The third line was written when the clock had been set back.
        assert_eq!(ids(&mut log, 250_000_000), [0x401, 0x402]);
        assert_eq!(log.progress_at(500_000_000), (1_000_000_000, 2_000_000_000));
        assert_eq!(ids(&mut log, 1_000_000_000), [0x403]);
        assert_eq!(log.now_ns(u64::MAX), 12_000_000_000, "time stands still at the end");
    }

    #[test]
    fn at_once_means_at_once_and_an_interface_can_be_picked() {
        let mut log = LogSource::new(LOG, Some("can0"), f64::INFINITY);
        let times: Vec<u64> = std::iter::from_fn(|| log.next_frame(0)).map(|(at_ns, _)| at_ns / 1_000_000).collect();
        assert_eq!(times, [10_000, 10_400, 12_000]);
        assert_eq!(Source::Log(log).state(), SourceState::Ended);
    }

    #[test]
    fn a_log_can_be_held_and_begun_anew() {
        let mut log = LogSource::new(LOG, None, 1.0);
        log.pause();
        let held_ns = log.now_ns(u64::MAX);
        assert!(held_ns >= 10_000_000_000 && ids(&mut log, u64::MAX).len() < 4);
        log.pause();
        assert_eq!(ids(&mut log, u64::MAX).last(), Some(&0x403));
        log.restart();
        assert_eq!(ids(&mut log, u64::MAX), [0x400, 0x401, 0x402, 0x403]);
    }
}
