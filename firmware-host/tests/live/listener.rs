//! Somebody on the bus who takes every frame and believes only what a careful controller may believe.

use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use embedded_can::Id;
use fencepost_core::{
    health::{HealthLevel, HealthReason},
    wire::{
        Address, HeartbeatRepr, Message, NodeState, Received, ReceiverConfig, ReceiverStatistics, ScanReceiver,
        WireConfig,
    },
};
use fencepost_hal::{
    can::{CanBus, CanFrame, VirtualBus, VirtualNode},
    clock::monotonic_ns,
};

/// Nothing that is waited for takes so long on any machine; the time is never a result.
pub(crate) const PATIENCE: Duration = Duration::from_secs(10);

/// What was heard.
#[derive(Clone, Debug)]
pub(crate) enum Heard {
    Heartbeat { at_ns: u64, heartbeat: HeartbeatRepr },
    Scan { at_ns: u64, scan: HeardScan },
}

/// A whole scan.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HeardScan {
    pub(crate) scan_index: u16,
    pub(crate) age_ns: u64,
    pub(crate) health: HealthLevel,
    pub(crate) free: Vec<(i8, i8)>,
    pub(crate) obstacles: Vec<(i8, i8)>,
}

pub(crate) struct Listener {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<ReceiverStatistics>>,
}

#[derive(Default)]
struct Shared {
    heard: Mutex<Vec<Heard>>,
    /// Every frame, unless only what they say is kept.
    frames: Mutex<Vec<CanFrame>>,
    keep_frames: bool,
    /// Frames of the node itself that could not be used.
    bad: AtomicU64,
    stop: AtomicBool,
}

impl Listener {
    pub(crate) fn on(bus: &VirtualBus) -> Self {
        Self::start(bus, true)
    }

    /// Does not keep the frames: for many of them.
    pub(crate) fn forgetful_on(bus: &VirtualBus) -> Self {
        Self::start(bus, false)
    }

    fn start(bus: &VirtualBus, keep_frames: bool) -> Self {
        let shared = Arc::new(Shared { keep_frames, ..Shared::default() });
        let (node, seen) = (bus.attach(), Arc::clone(&shared));
        let thread = std::thread::spawn(move || listen(node, &seen));
        Self { shared, thread: Some(thread) }
    }

    pub(crate) fn frames(&self) -> Vec<CanFrame> {
        self.shared.frames.lock().unwrap().clone()
    }

    pub(crate) fn heartbeats(&self) -> Vec<(u64, HeartbeatRepr)> {
        let heartbeat = |heard: &Heard| match heard {
            Heard::Heartbeat { at_ns, heartbeat } => Some((*at_ns, *heartbeat)),
            Heard::Scan { .. } => None,
        };
        self.lock().iter().filter_map(heartbeat).collect()
    }

    /// The first heartbeat after `since_ns` that `wanted` accepts.
    pub(crate) fn wait_for(
        &self,
        what: &str,
        since_ns: u64,
        wanted: impl Fn(&HeartbeatRepr) -> bool,
    ) -> (u64, HeartbeatRepr) {
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            let found = self.heartbeats().into_iter().find(|(at_ns, h)| *at_ns >= since_ns && wanted(h));
            if let Some(found) = found {
                return found;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let last = self.heartbeats().last().map(|(_, heartbeat)| (*heartbeat, names(heartbeat)));
        panic!("{what}: no such heartbeat; the last one is {last:?}");
    }

    pub(crate) fn wait_for_reason(&self, reason: HealthReason, since_ns: u64) -> (u64, HeartbeatRepr) {
        self.wait_for(reason.name(), since_ns, |heartbeat| heartbeat.health.has(reason))
    }

    pub(crate) fn wait_until_healthy(&self, since_ns: u64) -> u64 {
        let healthy = |h: &HeartbeatRepr| {
            h.state == NodeState::Running && h.health.level == HealthLevel::Ok && h.health.reasons == 0
        };
        self.wait_for("healthy", since_ns, healthy).0
    }

    /// The scans between two times.
    pub(crate) fn scans(&self, from_ns: u64, to_ns: u64) -> Vec<HeardScan> {
        let scan = |heard: &Heard| match heard {
            Heard::Scan { at_ns, scan } if (from_ns..to_ns).contains(at_ns) => Some(scan.clone()),
            _ => None,
        };
        self.lock().iter().filter_map(scan).collect()
    }

    /// Forgets what was heard so far.
    pub(crate) fn forget(&self) {
        self.lock().clear();
    }

    /// Frames of the node that could not be used.
    pub(crate) fn bad(&self) -> u64 {
        self.shared.bad.load(Ordering::Relaxed)
    }

    /// Listens until there is nothing more to hear, and then no more: whatever was sent before is there afterwards.
    pub(crate) fn finish(&mut self) -> ReceiverStatistics {
        self.shared.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap()
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Heard>> {
        self.shared.heard.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
    }
}

pub(crate) fn names(heartbeat: &HeartbeatRepr) -> Vec<&'static str> {
    HealthReason::ALL.into_iter().filter(|r| heartbeat.health.has(*r)).map(HealthReason::name).collect()
}

pub(crate) fn address() -> Address {
    WireConfig::default().address()
}

fn listen(mut node: VirtualNode, shared: &Shared) -> ReceiverStatistics {
    let mut receiver = Box::new(ScanReceiver::<2040>::new(ReceiverConfig::new(address())));
    loop {
        let Some((at_ns, frame)) = node.receive().unwrap() else {
            if shared.stop.load(Ordering::Relaxed) {
                return *receiver.statistics();
            }
            std::thread::sleep(Duration::from_millis(1));
            continue;
        };
        if shared.keep_frames {
            shared.frames.lock().unwrap().push(frame);
        }
        let Id::Standard(id) = frame.id() else { panic!("{frame}") };
        if matches!(address().message(id), Some(Message::VehicleMotion | Message::ScanEcho)) {
            continue;
        }
        let Ok(received) = receiver.receive(id, frame.data(), at_ns) else {
            shared.bad.fetch_add(1, Ordering::Relaxed);
            continue;
        };
        let heard = match received {
            Received::Heartbeat => receiver.heartbeat(at_ns).map(|heartbeat| Heard::Heartbeat { at_ns, heartbeat }),
            Received::Scan { .. } => receiver.scan(at_ns).ok().map(|scan| {
                let cells = |obstacle| scan.runs.iter().filter(move |r| r.obstacle == obstacle).flat_map(|r| r.cells());
                let scan = HeardScan {
                    scan_index: scan.scan_index,
                    age_ns: scan.age_ns,
                    health: scan.health,
                    free: cells(false).collect(),
                    obstacles: cells(true).collect(),
                };
                Heard::Scan { at_ns, scan }
            }),
            _ => None,
        };
        shared.heard.lock().unwrap().extend(heard);
    }
}

/// Now, by the clock of the loop.
pub(crate) fn now_ns() -> u64 {
    monotonic_ns()
}
