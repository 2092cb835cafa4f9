//! What is heard on a bus, kept so that a person can look at it.
//!
//! ```text
//! source ──────> listener ──────> terminal, screen   a live view
//!  an interface   nodes, traffic  plain              a line for each event
//!  or a log          │    │
//!    ^               │ verdict    what it means, in words
//!    └─ controller <─┘            answers, if asked to act as one
//! ```

pub mod controller;
pub mod node;
pub mod plain;
pub mod screen;
pub mod session;
pub mod source;
pub mod terminal;
#[cfg(test)]
pub(crate) mod testing;
pub mod traffic;
pub mod verdict;

use std::collections::BTreeMap;

use embedded_can::Id;
use fencepost_core::wire::{Address, BaseId, HeartbeatRepr, NodeId, ScanEchoRepr, VehicleMotionRepr};
use fencepost_hal::can::CanFrame;

use crate::scans::WholeScan;
use node::Node;
pub use session::Session;
use traffic::Traffic;

/// Everything that was heard so far.
#[derive(Debug)]
pub struct Listener {
    base: BaseId,
    only: Option<NodeId>,
    nodes: BTreeMap<NodeId, Node>,
    traffic: Traffic,
    scans: u64,
}

/// What a frame brought, where it is worth a word.
#[derive(Clone, Debug)]
pub enum Event {
    /// A whole scan.
    Scan(Box<WholeScan>),
    /// A scan was given up, and why.
    GivenUp(&'static str),
    /// A heartbeat, and whether it says anything else than the one before.
    Heartbeat {
        /// What it says.
        heartbeat: HeartbeatRepr,
        /// Whether state, level or reasons changed.
        changed: bool,
    },
    /// How the vehicle moves.
    Motion(VehicleMotionRepr),
    /// A scan that the controller has taken over.
    Echo(ScanEchoRepr),
    /// A message that cannot be used, and why.
    Damaged(String),
}

impl Listener {
    /// Nothing heard yet. Listens to the nodes of `base`, or to one of them only.
    pub const fn new(base: BaseId, only: Option<NodeId>) -> Self {
        Self { base, only, nodes: BTreeMap::new(), traffic: Traffic::new(), scans: 0 }
    }

    /// Takes a frame that came at `at_ns`.
    pub fn take(&mut self, frame: &CanFrame, at_ns: u64) -> Option<(NodeId, Event)> {
        let address = self.address(frame);
        self.traffic.take(frame, at_ns, address.is_some());
        let (Some(address), Id::Standard(id)) = (address, frame.id()) else { return None };
        if self.only.is_some_and(|only| only != address.node) {
            return None;
        }
        let node = self.nodes.entry(address.node).or_insert_with(|| Node::new(address));
        let event = node.take(id, frame.data(), at_ns)?;
        self.scans += u64::from(matches!(event, Event::Scan(_)));
        Some((address.node, event))
    }

    /// The nodes that were heard, by their numbers.
    pub const fn nodes(&self) -> &BTreeMap<NodeId, Node> {
        &self.nodes
    }

    /// What goes over the bus.
    pub const fn traffic(&self) -> &Traffic {
        &self.traffic
    }

    /// First identifier of the nodes.
    pub const fn base(&self) -> BaseId {
        self.base
    }

    /// Whole scans of all nodes.
    pub const fn scans(&self) -> u64 {
        self.scans
    }

    /// The address that a message of ours has.
    fn address(&self, frame: &CanFrame) -> Option<Address> {
        let Id::Standard(id) = frame.id() else { return None };
        let node = NodeId::new((id.as_raw() >> 4 & 0xF) as u8).ok()?;
        let address = Address { base: self.base, node };
        (!frame.is_remote() && address.message(id).is_some()).then_some(address)
    }
}

#[cfg(test)]
mod tests {
    use super::testing::{Speaker, node};
    use super::*;

    #[test]
    fn scans_heartbeats_and_commands_of_several_nodes_are_kept_apart() {
        let mut listener = Listener::new(BaseId::DEFAULT, None);
        let (mut one, mut four) = (Speaker::new(1), Speaker::new(4));
        for speaker in [&mut one, &mut four] {
            speaker.heartbeat().iter().chain(&speaker.scan()).chain(&speaker.commands()).for_each(|frame| {
                listener.take(frame, 1_000);
            });
        }
        assert_eq!(listener.nodes().keys().map(|node| node.get()).collect::<Vec<_>>(), [1, 4]);
        assert_eq!(listener.scans(), 2);
        for heard in listener.nodes().values() {
            assert_eq!(heard.scan().unwrap().counts(), (8, 12));
            assert_eq!(heard.echo().unwrap().0, 0);
            assert_eq!(heard.motion().unwrap().0.speed_mm_per_s, Some(1_200));
        }
        assert_eq!((listener.traffic().frames(), listener.traffic().of_others()), (2 * 13, 0));
    }

    #[test]
    fn other_nodes_and_other_devices_are_not_listened_to_but_count_as_traffic() {
        let mut listener = Listener::new(BaseId::DEFAULT, Some(node(4)));
        let mut one = Speaker::new(1);
        assert!(one.heartbeat().iter().chain(&one.scan()).all(|frame| listener.take(frame, 0).is_none()));
        for text in ["123#01", "40D#00", "400#R", "00000400#11", "7FF##1AA"] {
            assert!(listener.take(&text.parse().unwrap(), 0).is_none(), "{text}");
        }
        assert!(listener.nodes().is_empty());
        assert_eq!((listener.traffic().frames(), listener.traffic().of_others()), (11 + 5, 5));
    }

    #[test]
    fn damage_loss_and_changes_of_health_are_events() {
        let mut listener = Listener::new(BaseId::DEFAULT, None);
        let mut speaker = Speaker::new(0);
        let changed = |event: Option<(NodeId, Event)>| match event {
            Some((_, Event::Heartbeat { changed, .. })) => changed,
            other => panic!("{other:?}"),
        };
        assert!(changed(listener.take(&speaker.heartbeat()[0], 0)));
        assert!(!changed(listener.take(&speaker.heartbeat()[0], 1)));
        speaker.degrade();
        assert!(changed(listener.take(&speaker.heartbeat()[0], 2)));

        let scan = speaker.scan();
        let damaged = scan[2].map_data(|data| data[4] ^= 1);
        let events: Vec<Event> = [scan[0], scan[1], damaged, scan[3]]
            .iter()
            .filter_map(|frame| listener.take(frame, 3))
            .map(|(_, event)| event)
            .collect();
        assert!(
            matches!(&events[..], [Event::Damaged(why), Event::GivenUp(_)] if why.contains("checksum")),
            "{events:?}"
        );
        assert_eq!(listener.scans(), 0);
    }
}
