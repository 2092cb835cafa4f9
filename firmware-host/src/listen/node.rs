//! What is known of one node.

use std::collections::VecDeque;

use embedded_can::StandardId;
use fencepost_core::wire::{
    Address, Command, CommandReceiver, CommandStatistics, HeartbeatRepr, Message, NoScan, Packet, ReceiveError,
    ReceiverStatistics, VehicleMotionRepr,
};

use super::Event;
use crate::scans::{Outcome, ScanAssembly, WholeScan};

/// What the controller says counts for that long.
pub const COMMAND_TIMEOUT_NS: u64 = 500_000_000;
/// What a node says of itself counts for that long.
pub const HEARTBEAT_TIMEOUT_NS: u64 = 300_000_000;
/// Scans are counted over that time for their rate.
const RATE_WINDOW_NS: u64 = 3_000_000_000;
/// The smallest map that is shown: 10 m ahead, 5 m to either side in cells of 0.5 m.
const SMALLEST: Extent = Extent { i_last: 19, i_first: 0, j_first: -10, j_last: 9 };

/// One node, as it was heard so far.
#[derive(Debug)]
pub struct Node {
    address: Address,
    assembly: ScanAssembly,
    heartbeat: Option<(HeartbeatRepr, u64)>,
    heartbeats: u64,
    scan: Option<WholeScan>,
    scan_times: VecDeque<u64>,
    extent: Extent,
    commands: CommandReceiver,
    motion: Option<(VehicleMotionRepr, u64)>,
    echo: Option<(u16, u64)>,
}

/// The cells that a node has ever told of: they only become more, so that the map does not jump.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// First cell along x.
    pub i_first: i8,
    /// Last cell along x.
    pub i_last: i8,
    /// First cell along y.
    pub j_first: i8,
    /// Last cell along y.
    pub j_last: i8,
}

impl Node {
    /// A node that was not heard yet.
    pub fn new(address: Address) -> Self {
        Self {
            address,
            assembly: ScanAssembly::new(address),
            heartbeat: None,
            heartbeats: 0,
            scan: None,
            scan_times: VecDeque::new(),
            extent: SMALLEST,
            commands: CommandReceiver::new(address, COMMAND_TIMEOUT_NS),
            motion: None,
            echo: None,
        }
    }

    /// Takes a frame to or from the node.
    pub(super) fn take(&mut self, id: StandardId, data: &[u8], at_ns: u64) -> Option<Event> {
        let packet = Packet::check(self.address, id, data)?;
        if matches!(self.address.message(id), Some(Message::VehicleMotion | Message::ScanEcho)) {
            return self.take_command(id, data, at_ns);
        }
        let outcome = self.assembly.receive(id, data, at_ns, packet.as_ref().ok());
        let packet = match packet {
            Ok(packet) => packet,
            Err(error) => return Some(Event::Damaged(error.to_string())),
        };
        match outcome {
            Outcome::Whole(scan) => return Some(self.take_scan(scan, at_ns)),
            Outcome::GivenUp(why) => return Some(Event::GivenUp(why)),
            Outcome::Quiet => {}
        }
        (packet.message() == Message::Heartbeat).then(|| self.take_heartbeat(at_ns)).flatten()
    }

    /// The number of the node and the base.
    pub const fn address(&self) -> Address {
        self.address
    }

    /// The newest heartbeat and when it came.
    pub const fn heartbeat(&self) -> Option<&(HeartbeatRepr, u64)> {
        self.heartbeat.as_ref()
    }

    /// Heartbeats so far.
    pub const fn heartbeats(&self) -> u64 {
        self.heartbeats
    }

    /// The newest whole scan, also one that is too old.
    pub const fn scan(&self) -> Option<&WholeScan> {
        self.scan.as_ref()
    }

    /// Why a controller may not drive by the newest scan; `None` if it may.
    pub fn objection(&self, now_ns: u64) -> Option<NoScan> {
        self.assembly.receiver().scan(now_ns).err()
    }

    /// Whole scans in a second, of late; `None` before the second one.
    pub fn scans_per_s(&self, now_ns: u64) -> Option<f64> {
        let recent = self.scan_times.iter().filter(|at_ns| now_ns.saturating_sub(**at_ns) <= RATE_WINDOW_NS);
        let (first, last) = (recent.clone().min()?, recent.clone().max()?);
        let steps = recent.count() - 1;
        (steps > 0 && last > first).then(|| steps as f64 * 1.0e9 / (last - first) as f64)
    }

    /// The cells that it has ever told of.
    pub const fn extent(&self) -> Extent {
        self.extent
    }

    /// What went wrong on the way from the node.
    pub const fn statistics(&self) -> &ReceiverStatistics {
        self.assembly.receiver().statistics()
    }

    /// What went wrong on the way to the node.
    pub const fn command_statistics(&self) -> &CommandStatistics {
        self.commands.statistics()
    }

    /// How the vehicle moves and when that was said.
    pub const fn motion(&self) -> Option<&(VehicleMotionRepr, u64)> {
        self.motion.as_ref()
    }

    /// The newest scan that the controller says it has taken over, and when it said so.
    pub const fn echo(&self) -> Option<&(u16, u64)> {
        self.echo.as_ref()
    }

    fn take_command(&mut self, id: StandardId, data: &[u8], at_ns: u64) -> Option<Event> {
        match self.commands.receive(id, data, at_ns) {
            Ok(Command::VehicleMotion(motion)) => {
                self.motion = Some((motion, at_ns));
                Some(Event::Motion(motion))
            }
            Ok(Command::ScanEcho(echo)) => {
                self.echo = Some((echo.scan_index, at_ns));
                Some(Event::Echo(echo))
            }
            Ok(Command::NotOurs | Command::Repeated) => None,
            Err(ReceiveError::Packet(error)) => Some(Event::Damaged(error.to_string())),
            Err(ReceiveError::Value(error)) => Some(Event::Damaged(error.to_string())),
        }
    }

    /// The receiver has taken it over, unless it came twice.
    fn take_heartbeat(&mut self, at_ns: u64) -> Option<Event> {
        let heartbeat = self.assembly.receiver().heartbeat(at_ns)?;
        let said = |heartbeat: HeartbeatRepr| (heartbeat.state, heartbeat.health, heartbeat.protocol_version);
        let before = self.heartbeat.replace((heartbeat, at_ns));
        self.heartbeats += 1;
        let changed = before.is_none_or(|(before, _)| said(before) != said(heartbeat));
        Some(Event::Heartbeat { heartbeat, changed })
    }

    fn take_scan(&mut self, scan: WholeScan, at_ns: u64) -> Event {
        self.scan_times.retain(|earlier_ns| at_ns.saturating_sub(*earlier_ns) <= RATE_WINDOW_NS);
        self.scan_times.push_back(at_ns);
        scan.cells.iter().for_each(|(i, j, _)| self.extent.take(*i, *j));
        self.scan = Some(scan.clone());
        Event::Scan(Box::new(scan))
    }
}

impl Extent {
    fn take(&mut self, i: i8, j: i8) {
        self.i_first = self.i_first.min(i);
        self.i_last = self.i_last.max(i);
        self.j_first = self.j_first.min(j);
        self.j_last = self.j_last.max(j);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Speaker, node};
    use super::*;
    use fencepost_core::wire::BaseId;

    fn id_of(frame: &fencepost_hal::can::CanFrame) -> StandardId {
        match frame.id() {
            embedded_can::Id::Standard(id) => id,
            embedded_can::Id::Extended(_) => panic!("{frame}"),
        }
    }

    #[test]
    fn rate_age_and_objections_go_by_the_time_that_is_given() {
        let mut heard = Node::new(Address { base: BaseId::DEFAULT, node: node(0) });
        let mut speaker = Speaker::new(0);
        for tenth in 0..30 {
            let at_ns = 1_000_000_000 + tenth * 100_000_000;
            for frame in speaker.heartbeat().iter().chain(&speaker.scan()) {
                heard.take(id_of(frame), frame.data(), at_ns);
            }
        }
        let last_ns = 3_900_000_000;
        assert!((heard.scans_per_s(last_ns).unwrap() - 10.0).abs() < 1e-6);
        assert_eq!(heard.objection(last_ns), None);
        assert_eq!(heard.scan().unwrap().age_ns(last_ns + 5_000_000), Some(50_000_000));
        assert_eq!(heard.objection(last_ns + 301_000_000), Some(NoScan::NoHeartbeat));
        assert_eq!(heard.scans_per_s(last_ns + 4_000_000_000), None);
        assert_eq!((heard.heartbeats(), heard.heartbeat().unwrap().1), (30, last_ns));
        assert_eq!(heard.extent(), Extent { i_first: 0, i_last: 19, j_first: -10, j_last: 9 });
    }

    #[test]
    fn a_heartbeat_that_comes_twice_is_no_sign_of_life() {
        let mut heard = Node::new(Address { base: BaseId::DEFAULT, node: node(0) });
        let frame = Speaker::new(0).heartbeat()[0];
        assert!(heard.take(id_of(&frame), frame.data(), 0).is_some());
        heard.take(id_of(&frame), frame.data(), 900_000_000);
        assert_eq!(heard.heartbeat().unwrap().1, 0);
        assert_eq!(heard.statistics().repeated, 1);
    }
}
