//! The part of a vehicle's controller that a node wants to hear, for bringing a node up without a vehicle.

use std::collections::BTreeMap;

use fencepost_core::wire::{CommandEncoder, Frame, NodeId, VEHICLE_MOTION_RATE_HZ, VehicleMotionRepr};
use fencepost_hal::can::CanFrame;

use super::{Event, Listener, source::Source};

/// Time between two messages that tell how the vehicle moves.
const MOTION_NS: u64 = 1_000_000_000 / VEHICLE_MOTION_RATE_HZ as u64;

/// Echoes the scans of every node that is heard, and tells it how the vehicle moves.
#[derive(Debug)]
pub struct Controller {
    motion: VehicleMotionRepr,
    encoders: BTreeMap<NodeId, CommandEncoder>,
    next_motion_ns: u64,
    sent: u64,
    failed: u64,
}

impl Controller {
    /// A controller of a vehicle that moves like `motion`.
    pub const fn new(motion: VehicleMotionRepr) -> Self {
        Self { motion, encoders: BTreeMap::new(), next_motion_ns: 0, sent: 0, failed: 0 }
    }

    /// Messages that were sent, and those that the interface did not take.
    pub const fn counts(&self) -> (u64, u64) {
        (self.sent, self.failed)
    }

    /// Answers what `node` has said.
    pub fn answer(&mut self, node: NodeId, event: &Event, source: &mut Source, listener: &mut Listener) {
        let Event::Scan(scan) = event else { return };
        if let Some(encoder) = self.encoder(node, listener) {
            let frame = encoder.scan_echo(scan.header.scan_index);
            self.send(&frame, source, listener);
        }
    }

    /// Tells every node that was heard how the vehicle moves, if it is time to.
    pub fn tell_motion(&mut self, source: &mut Source, listener: &mut Listener) {
        let now_ns = source.now_ns();
        if now_ns < self.next_motion_ns {
            return;
        }
        // Messages that were missed are not made up for.
        self.next_motion_ns = self.next_motion_ns.saturating_add(MOTION_NS).max(now_ns);
        let nodes: Vec<NodeId> = listener.nodes().keys().copied().collect();
        for node in nodes {
            let motion = self.motion;
            if let Some(encoder) = self.encoder(node, listener) {
                let frame = encoder.vehicle_motion(&motion);
                self.send(&frame, source, listener);
            }
        }
    }

    fn encoder(&mut self, node: NodeId, listener: &Listener) -> Option<&mut CommandEncoder> {
        let address = listener.nodes().get(&node)?.address();
        Some(self.encoders.entry(node).or_insert_with(|| CommandEncoder::new(address)))
    }

    /// What we send does not come back to us, so that the listener is told.
    fn send(&mut self, frame: &Frame, source: &mut Source, listener: &mut Listener) {
        let Some(frame) = CanFrame::new(frame.id(), frame.data(), frame.is_fd()) else { return };
        if source.send(&frame) {
            self.sent += 1;
            listener.take(&frame, source.now_ns());
        } else {
            self.failed += 1;
        }
    }
}
