//! What a vehicle's controller says to a node: how the vehicle moves, and which scan it has taken over.

use embedded_can::StandardId;

use super::address::{Address, Message};
use super::encoder::Counters;
use super::frame::Frame;
use super::message::{ScanEchoRepr, VehicleMotionRepr};
use super::protect::{CounterCheck, Packet, PacketError, Step};
use super::receiver::{ReceiveError, count};

/// The controller's side: turns motion and echoes into protected frames.
#[derive(Clone, Debug)]
pub struct CommandEncoder {
    counters: Counters,
}

impl CommandEncoder {
    /// An encoder for the node at `address`, whose counters begin at 0.
    pub const fn new(address: Address) -> Self {
        Self { counters: Counters::new(address) }
    }

    /// The frame for `motion`.
    pub fn vehicle_motion(&mut self, motion: &VehicleMotionRepr) -> Frame {
        self.counters.frame(Message::VehicleMotion, |data| motion.emit(data))
    }

    /// The frame that says that scan `scan_index` was taken over as a whole.
    pub fn scan_echo(&mut self, scan_index: u16) -> Frame {
        self.counters.frame(Message::ScanEcho, |data| ScanEchoRepr { scan_index }.emit(data))
    }
}

/// What a frame brought to a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Nothing: not a message for this node.
    NotOurs,
    /// The same message once more; ignored, and what is known does not become younger by it.
    Repeated,
    /// How the vehicle moves.
    VehicleMotion(VehicleMotionRepr),
    /// The scan that the controller has taken over.
    ScanEcho(ScanEchoRepr),
}

/// What went wrong so far. Counts stay at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CommandStatistics {
    /// Messages missing by their counters: at least that many.
    pub lost: u32,
    /// Messages that came more than once.
    pub repeated: u32,
    /// Messages whose checksum did not fit.
    pub crc_errors: u32,
    /// Messages that were refused for another reason.
    pub refused: u32,
}

/// The node's side: takes the frames for one node and keeps the newest motion and echo. The first state is "not known".
#[derive(Clone, Debug)]
pub struct CommandReceiver {
    address: Address,
    timeout_ns: u64,
    motion: Option<(VehicleMotionRepr, u64)>,
    echo: Option<(ScanEchoRepr, u64)>,
    motion_counter: CounterCheck,
    echo_counter: CounterCheck,
    statistics: CommandStatistics,
}

impl CommandReceiver {
    /// A receiver for the node at `address` that believes what it heard for `timeout_ns`.
    pub const fn new(address: Address, timeout_ns: u64) -> Self {
        let statistics = CommandStatistics { lost: 0, repeated: 0, crc_errors: 0, refused: 0 };
        Self {
            address,
            timeout_ns,
            motion: None,
            echo: None,
            motion_counter: CounterCheck::NEW,
            echo_counter: CounterCheck::NEW,
            statistics,
        }
    }

    /// Takes a frame that came at `now_ns` of a clock that does not go back. Frames of others may be passed as well.
    ///
    /// # Errors
    /// [`ReceiveError`] if the frame is for this node, but cannot be used.
    ///
    /// # Bound
    /// The bytes of one frame.
    pub fn receive(&mut self, id: StandardId, data: &[u8], now_ns: u64) -> Result<Command, ReceiveError> {
        let result = self.take(id, data, now_ns);
        match &result {
            Ok(Command::Repeated) => count(&mut self.statistics.repeated, 1),
            Ok(_) => {}
            Err(ReceiveError::Packet(PacketError::WrongCrc)) => count(&mut self.statistics.crc_errors, 1),
            Err(_) => count(&mut self.statistics.refused, 1),
        }
        result
    }

    /// How the vehicle moves; `None` if that was not said within the time-out before `now_ns`.
    pub fn vehicle_motion(&self, now_ns: u64) -> Option<VehicleMotionRepr> {
        self.fresh(self.motion, now_ns)
    }

    /// The newest scan that the controller has taken over; `None` if it said nothing within the time-out before `now_ns`.
    pub fn scan_echo(&self, now_ns: u64) -> Option<u16> {
        self.fresh(self.echo, now_ns).map(|echo| echo.scan_index)
    }

    /// What went wrong so far.
    pub const fn statistics(&self) -> &CommandStatistics {
        &self.statistics
    }

    fn take(&mut self, id: StandardId, data: &[u8], now_ns: u64) -> Result<Command, ReceiveError> {
        let counter = match self.address.message(id) {
            Some(Message::VehicleMotion) => &mut self.motion_counter,
            Some(Message::ScanEcho) => &mut self.echo_counter,
            _ => return Ok(Command::NotOurs),
        };
        let Some(checked) = Packet::check(self.address, id, data) else { return Ok(Command::NotOurs) };
        let packet = checked?;
        match counter.step(&packet) {
            Step::Repeated => return Ok(Command::Repeated),
            Step::Lost(messages) => count(&mut self.statistics.lost, u32::from(messages)),
            Step::First | Step::Next => {}
        }
        if packet.message() == Message::VehicleMotion {
            let motion = VehicleMotionRepr::parse(packet.data())?;
            self.motion = Some((motion, now_ns));
            return Ok(Command::VehicleMotion(motion));
        }
        let echo = ScanEchoRepr::parse(packet.data())?;
        self.echo = Some((echo, now_ns));
        Ok(Command::ScanEcho(echo))
    }

    fn fresh<T>(&self, value: Option<(T, u64)>, now_ns: u64) -> Option<T> {
        let (value, received_ns) = value?;
        (now_ns.saturating_sub(received_ns) <= self.timeout_ns).then_some(value)
    }
}
