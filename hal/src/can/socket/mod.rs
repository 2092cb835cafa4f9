//! The CAN buses of Linux.

mod error;
mod error_frame;
mod interface;
mod recovery;

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use embedded_can::{Frame as _, StandardId};
use socketcan::{
    CanAddr, CanAnyFrame, CanDataFrame, CanFdFrame, CanFdSocket, CanRemoteFrame, Frame as _, Socket as _,
    SocketOptions as _,
    id::FdFlags,
    socket::{CAN_RAW_FILTER, SOL_CAN_RAW},
};

use super::{BusCondition, BusErrorKind, CanBus, CanFrame, ControllerState};
use crate::clock::monotonic_ns;

use recovery::Recovery;

pub use error::{SocketCanError, SocketCanProblem};
pub use interface::{BitTiming, CanInterface, can_interfaces};

/// Time between two attempts to open an interface.
const RETRY_NS: u64 = 50_000_000;
/// Time after which a controller that is said to be off the bus is looked at once more, in case the word of its restart was
/// lost.
const BUS_OFF_LOOK_NS: u64 = 1_000_000_000;
/// Error frames that one call of `receive` reads.
const ERROR_FRAMES_PER_CALL: usize = 64;
/// Bytes of received frames that the kernel keeps until they are read; it gives less where it is told to.
const RECEIVE_BUFFER: usize = 1 << 20;
/// Longest time that a received frame can have waited in the kernel; a longer one means that the clock of the day was set.
const LONGEST_WAIT: Duration = Duration::from_secs(1);
/// Flags of an identifier in the kernel's format (linux/can.h): extended, remote, error.
const EXTENDED_FLAG: u32 = 0x8000_0000;
const REMOTE_FLAG: u32 = 0x4000_0000;

/// A node on a CAN interface of Linux: real controllers, `vcan` and `vxcan`.
///
/// Opens the interface by itself and opens it again when it was down or gone, at most every 50 ms; until then, every call says
/// [`Down`](BusErrorKind::Down) or [`Gone`](BusErrorKind::Gone) without asking the kernel. Sending, receiving and opening again
/// take no memory and never wait.
///
/// # The kernel's queue
/// Frames go through the queue of the interface, 10 frames by default (`txqueuelen`), and a few more places in the controller.
/// When it is full, the kernel says ENOBUFS, which is [`Full`](BusErrorKind::Full): that is no fault, and the frame can be sent
/// later. What is in that queue cannot be taken back, so that a heartbeat waits for it; a queue longer than a scan only makes
/// what is sent older.
///
/// # Error frames
/// What the controller tells of the bus is not handed out as frames, but goes into the [condition](CanBus::condition). While a
/// controller is off the bus (bus-off) the kernel throws frames away without an error.
#[derive(Debug)]
pub struct SocketCan {
    interface: Arc<str>,
    carrier_file: Option<PathBuf>,
    sent_file: Option<PathBuf>,
    recovery: Recovery,
    fd: bool,
    /// In the kernel's form, so that opening again takes no memory.
    filters: Vec<u8>,
    link: Link,
    condition: BusCondition,
    /// When a controller that is off the bus is looked at once more.
    bus_off_look_ns: u64,
    newest_ns: u64,
}

#[derive(Debug)]
enum Link {
    Open(CanFdSocket),
    Closed { problem: SocketCanProblem, retry_ns: u64 },
}

/// Which data frames with 11-bit identifiers are received: those that agree with `id` in the bits of `mask`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdFilter {
    id: u16,
    mask: u16,
}

impl IdFilter {
    /// This identifier only.
    pub fn exactly(id: StandardId) -> Self {
        Self { id: id.as_raw(), mask: 0x7FF }
    }

    /// Every identifier that agrees with `id` in the bits of `mask`.
    pub fn masked(id: StandardId, mask: u16) -> Self {
        Self { id: id.as_raw(), mask: mask & 0x7FF }
    }

    /// As the kernel reads it: `struct can_filter` of linux/can.h.
    fn for_kernel(self) -> [u8; 8] {
        let mask = u32::from(self.mask) | EXTENDED_FLAG | REMOTE_FLAG;
        let ([a, b, c, d], [e, f, g, h]) = (u32::from(self.id).to_ne_bytes(), mask.to_ne_bytes());
        [a, b, c, d, e, f, g, h]
    }
}

impl SocketCan {
    /// A node on `interface` (`can0`). `fd` says whether CAN FD frames will be sent; they are received in any case.
    ///
    /// The interface need not be there yet; [`open_now`](Self::open_now) says whether it is.
    pub fn new(interface: &str, fd: bool) -> Self {
        let mut bus = Self {
            interface: interface.into(),
            carrier_file: interface::carrier_file(interface),
            sent_file: interface::sent_file(interface),
            recovery: Recovery::default(),
            fd,
            filters: Vec::new(),
            link: Link::Closed { problem: SocketCanProblem::NotThere, retry_ns: 0 },
            condition: BusCondition::default(),
            bus_off_look_ns: 0,
            newest_ns: 0,
        };
        // A controller tells of changes only.
        if let Some(controller) = CanInterface::look(interface).ok().and_then(|interface| interface.controller) {
            bus.condition.controller = controller;
        }
        bus
    }

    /// Receives only what one of `filters` lets through; everything if there is none.
    #[must_use]
    pub fn with_filters(mut self, filters: &[IdFilter]) -> Self {
        self.filters = filters.iter().flat_map(|filter| filter.for_kernel()).collect();
        self.link = Link::Closed { problem: SocketCanProblem::NotThere, retry_ns: 0 };
        self
    }

    /// Name of the interface.
    pub fn interface(&self) -> &str {
        &self.interface
    }

    /// Opens the interface now, if it is not open.
    ///
    /// # Errors
    /// Why it cannot be used now.
    pub fn open_now(&mut self) -> Result<(), SocketCanError> {
        if let Link::Closed { retry_ns, .. } = &mut self.link {
            *retry_ns = 0;
        }
        self.ready()
    }

    /// Whether the interface is open: as of the last call of `send`, `receive` or [`open_now`](Self::open_now).
    pub const fn is_open(&self) -> bool {
        matches!(self.link, Link::Open(_))
    }

    /// Opens the interface if it is closed and the time has come.
    fn ready(&mut self) -> Result<(), SocketCanError> {
        let Link::Closed { problem, retry_ns } = self.link else { return Ok(()) };
        let now_ns = monotonic_ns();
        if now_ns < retry_ns {
            return Err(SocketCanError::new(Arc::clone(&self.interface), problem));
        }
        match open(&self.interface, &self.filters) {
            Ok(socket) => {
                self.link = Link::Open(socket);
                Ok(())
            }
            Err(problem) => Err(self.close(problem)),
        }
    }

    /// Lets go of the interface until the next attempt. One that was down or gone starts its controller afresh when it comes up
    /// again; after another error the controller is as it was.
    fn close(&mut self, problem: SocketCanProblem) -> SocketCanError {
        self.link = Link::Closed { problem, retry_ns: monotonic_ns().saturating_add(RETRY_NS) };
        if matches!(problem.kind(), BusErrorKind::Down | BusErrorKind::Gone) {
            self.condition.controller = ControllerState::ErrorActive;
        }
        SocketCanError::new(Arc::clone(&self.interface), problem)
    }

    fn failed(&mut self, error: &io::Error, fd: bool) -> SocketCanError {
        let error = SocketCanError::of(&self.interface, error, fd);
        match error.problem().kind() {
            BusErrorKind::Full | BusErrorKind::Refused => error,
            BusErrorKind::Down | BusErrorKind::Gone | BusErrorKind::Other => self.close(error.problem()),
        }
    }

    /// Takes note of an error frame.
    fn take_note(&mut self, class: u32, data: &[u8]) {
        let before = self.condition;
        error_frame::take_note(&mut self.condition, class, data);
        if self.condition.errors != before.errors {
            self.recovery.told(monotonic_ns());
        }
        if self.condition.controller == ControllerState::BusOff && before.controller != ControllerState::BusOff {
            self.bus_off_look_ns = monotonic_ns().saturating_add(BUS_OFF_LOOK_NS);
        }
    }

    /// Looks for what a controller may not have told.
    fn look(&mut self) {
        self.look_at_carrier();
        let now_ns = monotonic_ns();
        if self.recovery.is_due(self.condition.controller, now_ns)
            && let Some(sent) = self.sent_file.as_deref().and_then(count)
            && self.recovery.look(sent, now_ns)
        {
            self.condition.controller = ControllerState::ErrorActive;
        }
    }

    /// A controller is believed to be off the bus until it says otherwise; that word may be lost, so that its carrier is asked
    /// now and then.
    fn look_at_carrier(&mut self) {
        if self.condition.controller != ControllerState::BusOff {
            return;
        }
        let now_ns = monotonic_ns();
        if now_ns < self.bus_off_look_ns {
            return;
        }
        self.bus_off_look_ns = now_ns.saturating_add(BUS_OFF_LOOK_NS);
        if self.carrier_file.as_deref().is_some_and(has_carrier) {
            self.condition.controller = ControllerState::ErrorActive;
            self.condition.restarts = self.condition.restarts.saturating_add(1);
        }
    }

    /// When a frame arrived that the kernel stamped with the time of day; never before the one before it.
    fn arrived_ns(&mut self, stamp: Option<SystemTime>) -> u64 {
        let now_ns = monotonic_ns();
        let waited = stamp.and_then(|stamp| SystemTime::now().duration_since(stamp).ok());
        let waited = waited.filter(|waited| *waited <= LONGEST_WAIT).unwrap_or_default();
        self.newest_ns = self.newest_ns.max(now_ns.saturating_sub(waited.as_nanos() as u64));
        self.newest_ns
    }
}

impl CanBus for SocketCan {
    type Error = SocketCanError;

    fn send(&mut self, frame: &CanFrame, _: u64) -> Result<(), SocketCanError> {
        if frame.is_fd() && !self.fd {
            return Err(SocketCanError::new(Arc::clone(&self.interface), SocketCanProblem::FdNotWanted));
        }
        self.ready()?;
        self.look();
        let sent = match &self.link {
            Link::Open(socket) => write(socket, frame),
            Link::Closed { problem, .. } => return Err(SocketCanError::new(Arc::clone(&self.interface), *problem)),
        };
        sent.map_err(|error| self.failed(&error, frame.is_fd()))
    }

    /// # Bound
    /// 64 error frames; if more wait, the next call reads on.
    fn receive(&mut self) -> Result<Option<(u64, CanFrame)>, SocketCanError> {
        self.ready()?;
        self.look();
        for _ in 0..ERROR_FRAMES_PER_CALL {
            let Link::Open(socket) = &self.link else { return Ok(None) };
            let (frame, stamps) = match socket.read_frame_with_timestamps() {
                Ok(read) => read,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(None),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(self.failed(&error, false)),
            };
            if let CanAnyFrame::Error(frame) = &frame {
                self.take_note(frame.error_bits(), frame.data());
            } else if let Some(frame) = received(&frame) {
                return Ok(Some((self.arrived_ns(stamps.socket), frame)));
            }
        }
        Ok(None)
    }

    fn condition(&self) -> BusCondition {
        self.condition
    }
}

fn open(interface: &Arc<str>, filters: &[u8]) -> Result<CanFdSocket, SocketCanProblem> {
    let problem = |error: io::Error| SocketCanError::of(interface, &error, false).problem();
    let address = CanAddr::from_iface(interface).map_err(problem)?;
    let socket = CanFdSocket::open_addr(&address).map_err(|error| match problem(error) {
        // The name is known, so that it is an interface of another kind.
        SocketCanProblem::NotThere => SocketCanProblem::NotCan,
        other => other,
    })?;
    socket.set_nonblocking(true).map_err(problem)?;
    socket.set_error_filter(error_frame::ALL_CLASSES).map_err(problem)?;
    socket.set_recv_timestamp(true).map_err(problem)?;
    if !filters.is_empty() {
        socket.set_socket_option_bytes(SOL_CAN_RAW, CAN_RAW_FILTER, filters).map_err(problem)?;
    }
    // Less room is no reason not to begin.
    let _ = socket.as_raw_socket().set_recv_buffer_size(RECEIVE_BUFFER);
    // The kernel binds to an interface that is down as well, and says so here.
    match socket.as_raw_socket().take_error().map_err(problem)? {
        Some(error) => Err(problem(error)),
        None => Ok(socket),
    }
}

fn write(socket: &CanFdSocket, frame: &CanFrame) -> io::Result<()> {
    // No such frame exists: its lengths were checked when it was made.
    let refused = || io::Error::from(io::ErrorKind::InvalidInput);
    if frame.is_fd() {
        let flags = if frame.bit_rate_switch() { FdFlags::BRS } else { FdFlags::empty() };
        socket.write_frame(&CanFdFrame::with_flags(frame.id(), frame.data(), flags).ok_or_else(refused)?)
    } else if frame.is_remote() {
        socket.write_frame(&CanRemoteFrame::new_remote(frame.id(), frame.dlc()).ok_or_else(refused)?)
    } else {
        socket.write_frame(&CanDataFrame::new(frame.id(), frame.data()).ok_or_else(refused)?)
    }
}

/// `None` for an error frame.
fn received(frame: &CanAnyFrame) -> Option<CanFrame> {
    match frame {
        CanAnyFrame::Normal(frame) => CanFrame::new(frame.hal_id(), frame.data(), false),
        CanAnyFrame::Remote(frame) => <CanFrame as embedded_can::Frame>::new_remote(frame.hal_id(), frame.dlc()),
        CanAnyFrame::Fd(frame) => CanFrame::new(frame.hal_id(), frame.data(), true)
            .map(|converted| converted.with_bit_rate_switch(frame.is_brs())),
        CanAnyFrame::Error(_) => None,
    }
}

/// The count in a file of the kernel. Takes no memory.
fn count(file: &Path) -> Option<u64> {
    // 64 bits are 20 digits.
    let mut text = [0; 24];
    let length = File::open(file).and_then(|mut file| file.read(&mut text)).ok()?;
    core::str::from_utf8(text.get(..length)?).ok()?.trim_end().parse().ok()
}

/// Whether the interface has a carrier. Takes no memory.
fn has_carrier(file: &Path) -> bool {
    let mut text = [0; 1];
    File::open(file).and_then(|mut file| file.read(&mut text)).is_ok() && text == *b"1"
}

#[cfg(test)]
mod tests {
    use embedded_can::ExtendedId;

    use super::*;
    use crate::can::BusError;

    #[test]
    fn an_interface_that_is_not_there_is_said_to_be_gone_and_is_not_asked_for_again_at_once() {
        let mut bus = SocketCan::new("nothere0", true);
        let error = bus.open_now().unwrap_err();
        assert_eq!(error.kind(), BusErrorKind::Gone, "{error}");
        assert!(error.to_string().contains("nothere0"));
        let frame = CanFrame::new(StandardId::ZERO, &[], false).unwrap();
        let Link::Closed { retry_ns, .. } = bus.link else { panic!("open") };
        assert_eq!(bus.send(&frame, 0).unwrap_err(), error);
        assert_eq!(bus.receive().unwrap_err(), error);
        assert!(matches!(bus.link, Link::Closed { retry_ns: still, .. } if still == retry_ns), "asked again");
        assert_eq!(bus.condition(), BusCondition::default());
    }

    #[test]
    fn an_interface_of_another_kind_and_fd_that_was_not_asked_for_are_refused() {
        let problem = SocketCan::new("lo", false).open_now().unwrap_err().problem();
        // Where the kernel has no CAN at all, that is what it says.
        assert!(matches!(problem, SocketCanProblem::NotCan | SocketCanProblem::NoCanInKernel), "{problem:?}");
        let frame = CanFrame::new(StandardId::ZERO, &[], true).unwrap();
        assert_eq!(SocketCan::new("can0", false).send(&frame, 0).unwrap_err().kind(), BusErrorKind::Refused);
    }

    #[test]
    fn frames_of_every_kind_are_the_same_after_going_through_the_crate() {
        let remote = |id| <CanFrame as embedded_can::Frame>::new_remote(id, 3).unwrap();
        for frame in [
            CanFrame::new(StandardId::new(0x7A1).unwrap(), &[1, 2, 3], false).unwrap(),
            CanFrame::new(ExtendedId::new(0x1ABC_DEF0).unwrap(), &[9; 8], false).unwrap(),
            CanFrame::new(StandardId::new(0x403).unwrap(), &[7; 24], true).unwrap(),
            CanFrame::new(StandardId::new(0x403).unwrap(), &[7; 64], true).unwrap().with_bit_rate_switch(false),
            remote(StandardId::new(0x12).unwrap().into()),
            remote(embedded_can::Id::Extended(ExtendedId::new(0x12).unwrap())),
        ] {
            let there: CanAnyFrame = if frame.is_fd() {
                let flags = if frame.bit_rate_switch() { FdFlags::BRS } else { FdFlags::empty() };
                CanFdFrame::with_flags(frame.id(), frame.data(), flags).unwrap().into()
            } else if frame.is_remote() {
                CanRemoteFrame::new_remote(frame.id(), frame.dlc()).unwrap().into()
            } else {
                CanDataFrame::new(frame.id(), frame.data()).unwrap().into()
            };
            assert_eq!(received(&there), Some(frame));
        }
    }

    #[test]
    fn only_an_interface_that_went_starts_its_controller_afresh() {
        use SocketCanProblem::{Down, NotAllowed, NotThere, System};
        for (problem, expected) in [
            (Down, ControllerState::ErrorActive),
            (NotThere, ControllerState::ErrorActive),
            (System(5), ControllerState::BusOff),
            (NotAllowed, ControllerState::BusOff),
        ] {
            let mut bus = SocketCan::new("nothere0", false);
            bus.condition.controller = ControllerState::BusOff;
            bus.close(problem);
            assert_eq!(bus.condition().controller, expected, "{problem:?}");
            assert!(!bus.is_open());
        }
    }

    #[test]
    fn counts_of_the_kernel_are_read() {
        assert_eq!(count(Path::new("/nowhere/tx_packets")), None);
        assert!(count(&interface::sent_file("lo").unwrap()).is_some(), "every interface has it");
    }

    #[test]
    fn stamps_become_times_of_the_monotonic_clock_and_never_go_back() {
        let mut bus = SocketCan::new("nothere0", false);
        let before_ns = monotonic_ns();
        let waited = Duration::from_millis(40);
        let stamp = SystemTime::now() - waited;
        let arrived_ns = bus.arrived_ns(Some(stamp));
        assert!(arrived_ns <= monotonic_ns() - waited.as_nanos() as u64);
        assert!(arrived_ns + 1_000_000_000 > before_ns);
        let second_ns = bus.arrived_ns(Some(stamp - waited));
        assert!(second_ns >= arrived_ns, "an older stamp does not lead back");
        // The clock of the day was set: the stamp says nothing.
        for stamp in [SystemTime::now() + Duration::from_secs(3600), SystemTime::UNIX_EPOCH] {
            let before_ns = monotonic_ns();
            assert!(bus.arrived_ns(Some(stamp)) >= before_ns);
        }
    }
}
