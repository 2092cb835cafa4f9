//! A CAN bus in memory.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{CanBus, CanFrame};

/// A bus that joins the nodes attached to it, in one thread or in several.
///
/// A frame that one node sends arrives at every other node. Frames sent at the same time by different nodes arrive in the
/// order of arbitration; those of one node stay in the order in which it sent them.
#[derive(Clone, Debug)]
pub struct VirtualBus {
    shared: Arc<Mutex<Vec<Option<Queue>>>>,
    capacity: usize,
}

/// A node of a [`VirtualBus`]; leaves the bus when dropped.
#[derive(Debug)]
pub struct VirtualNode {
    bus: VirtualBus,
    index: usize,
}

/// What has arrived at a node and was not fetched yet.
#[derive(Debug, Default)]
struct Queue {
    entries: VecDeque<Entry>,
    dropped: u64,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    sent_ns: u64,
    sender: usize,
    frame: CanFrame,
}

impl VirtualBus {
    /// A bus without nodes, each of which will hold at most `capacity` frames that were not fetched.
    pub fn new(capacity: usize) -> Self {
        Self { shared: Arc::default(), capacity }
    }

    /// Attaches a node. It sees the frames that are sent from now on.
    pub fn attach(&self) -> VirtualNode {
        let mut nodes = self.lock();
        let index = nodes.iter().position(Option::is_none).unwrap_or(nodes.len());
        if index == nodes.len() {
            nodes.push(None);
        }
        // All the memory that it will ever need: nobody who sends waits for more.
        nodes[index] = Some(Queue { entries: VecDeque::with_capacity(self.capacity), dropped: 0 });
        VirtualNode { bus: self.clone(), index }
    }

    /// A panic elsewhere leaves whole queues behind, so the lock stays usable.
    fn lock(&self) -> MutexGuard<'_, Vec<Option<Queue>>> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl VirtualNode {
    /// Frames that were lost because this node did not fetch them in time.
    pub fn dropped(&self) -> u64 {
        self.bus.lock().get(self.index).and_then(Option::as_ref).map_or(0, |queue| queue.dropped)
    }

    /// Frames that wait to be fetched.
    pub fn waiting(&self) -> usize {
        self.bus.lock().get(self.index).and_then(Option::as_ref).map_or(0, |queue| queue.entries.len())
    }
}

/// # Bound
/// Sending looks at no more than `capacity` frames of each node.
impl CanBus for VirtualNode {
    type Error = Infallible;

    fn send(&mut self, frame: &CanFrame, now_ns: u64) -> Result<(), Infallible> {
        let entry = Entry { sent_ns: now_ns, sender: self.index, frame: *frame };
        let mut nodes = self.bus.lock();
        let others = nodes.iter_mut().enumerate().filter(|(index, _)| *index != self.index);
        for queue in others.filter_map(|(_, queue)| queue.as_mut()) {
            queue.insert(entry, self.bus.capacity);
        }
        Ok(())
    }

    fn receive(&mut self) -> Result<Option<(u64, CanFrame)>, Infallible> {
        let mut nodes = self.bus.lock();
        let queue = nodes.get_mut(self.index).and_then(Option::as_mut);
        Ok(queue.and_then(|queue| queue.entries.pop_front()).map(|entry| (entry.sent_ns, entry.frame)))
    }
}

impl Drop for VirtualNode {
    fn drop(&mut self) {
        if let Some(queue) = self.bus.lock().get_mut(self.index) {
            *queue = None;
        }
    }
}

impl Queue {
    /// Puts the frame where arbitration would have let it through: behind its sender's own frames, and then before the first
    /// frame of the same time that would lose against it.
    fn insert(&mut self, entry: Entry, capacity: usize) {
        if self.entries.len() >= capacity {
            self.dropped = self.dropped.saturating_add(1);
            return;
        }
        let mut place = self.entries.len();
        let key = entry.frame.arbitration_key();
        for (index, earlier) in self.entries.iter().enumerate().rev() {
            if earlier.sent_ns != entry.sent_ns || earlier.sender == entry.sender {
                break;
            }
            if earlier.frame.arbitration_key() > key {
                place = index;
            }
        }
        self.entries.insert(place, entry);
    }
}

#[cfg(test)]
mod tests {
    use embedded_can::StandardId;

    use super::*;

    fn frame(id: u16, data: &[u8]) -> CanFrame {
        CanFrame::new(StandardId::new(id).unwrap(), data, false).unwrap()
    }

    fn fetch(node: &mut VirtualNode) -> Vec<(u64, CanFrame)> {
        std::iter::from_fn(|| node.receive().unwrap()).collect()
    }

    #[test]
    fn every_node_sees_the_frames_of_the_others_and_not_its_own() {
        let bus = VirtualBus::new(8);
        let mut nodes: Vec<VirtualNode> = (0..3).map(|_| bus.attach()).collect();
        for (index, node) in nodes.iter_mut().enumerate() {
            node.send(&frame(index as u16, &[index as u8]), 100 + index as u64).unwrap();
        }
        for (index, node) in nodes.iter_mut().enumerate() {
            let expected: Vec<_> =
                (0..3).filter(|other| *other != index).map(|i| (100 + i as u64, frame(i as u16, &[i as u8]))).collect();
            assert_eq!(fetch(node), expected);
        }
    }

    #[test]
    fn a_full_queue_loses_the_newest_and_counts_them() {
        let bus = VirtualBus::new(2);
        let (mut sender, mut receiver) = (bus.attach(), bus.attach());
        for i in 0..5 {
            sender.send(&frame(1, &[i]), u64::from(i)).unwrap();
        }
        assert_eq!((receiver.waiting(), receiver.dropped()), (2, 3));
        assert_eq!(fetch(&mut receiver), [(0, frame(1, &[0])), (1, frame(1, &[1]))]);
        sender.send(&frame(1, &[9]), 9).unwrap();
        assert_eq!(fetch(&mut receiver), [(9, frame(1, &[9]))]);
        assert_eq!((receiver.dropped(), sender.dropped()), (3, 0));
    }

    #[test]
    fn frames_of_the_same_time_arrive_in_the_order_of_arbitration_but_a_node_keeps_its_own_order() {
        let bus = VirtualBus::new(16);
        let (mut a, mut b, mut receiver) = (bus.attach(), bus.attach(), bus.attach());
        for id in [5, 1, 7] {
            a.send(&frame(id, &[]), 10).unwrap();
        }
        for id in [3, 6, 2] {
            b.send(&frame(id, &[]), 10).unwrap();
        }
        b.send(&frame(0, &[]), 11).unwrap();
        let ids: Vec<u32> = fetch(&mut receiver).iter().map(|(_, frame)| frame.raw_id()).collect();
        // Heads 5 and 3: 3. Then 5 and 6: 5, 1. Then 7 and 6: 6, 2. Then 7. The frame of time 11 overtakes nothing.
        assert_eq!(ids, [3, 5, 1, 6, 2, 7, 0]);
    }

    #[test]
    fn a_node_that_left_takes_no_frames_and_its_place_is_used_again() {
        let bus = VirtualBus::new(2);
        let mut a = bus.attach();
        drop(bus.attach());
        a.send(&frame(1, &[]), 0).unwrap();
        let mut c = bus.attach();
        assert_eq!(fetch(&mut c), []);
        assert_eq!(bus.lock().len(), 2);
    }

    #[test]
    fn nodes_in_several_threads_lose_nothing() {
        let bus = VirtualBus::new(4000);
        let mut receiver = bus.attach();
        std::thread::scope(|scope| {
            for id in 0..4 {
                let mut node = bus.attach();
                scope.spawn(move || (0..500).for_each(|i| node.send(&frame(id, &[i as u8]), i).unwrap()));
            }
        });
        let frames = fetch(&mut receiver);
        assert_eq!((frames.len(), receiver.dropped()), (2000, 0));
        for id in 0..4 {
            let times: Vec<u64> = frames.iter().filter(|(_, f)| f.raw_id() == id).map(|(time, _)| *time).collect();
            assert_eq!(times, (0..500).collect::<Vec<u64>>(), "node {id} keeps its order");
        }
    }
}
