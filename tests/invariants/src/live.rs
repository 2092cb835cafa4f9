//! The whole live loop on virtual devices, with a schedule of faults of the camera and the bus.

use std::{
    sync::{Mutex, OnceLock, PoisonError, atomic::AtomicBool},
    time::Duration,
};

use fencepost::live::{self, PairPlan, Plan, RunSettings};
use fencepost_core::{
    health::HealthLevel,
    settings::Settings,
    wire::{
        Address, HeaderRepr, HeartbeatRepr, Message, NodeState, Packet, Received, ReceiverConfig, ScanReceiver,
        WireConfig,
    },
};
use fencepost_hal::{
    camera::{Camera, FaultyCamera, FaultyError, MemoryCamera, Sides, StereoPair},
    can::{BusFaultControl, BusFaultInjector, CanBus, CanFrame, VirtualBus, VirtualNode},
    scene::{Scene, SceneOptions},
};

use crate::Source;

const SIZE: (u32, u32) = (48, 36);
const PAIRS: u32 = 3;
/// Calls of the camera in one run at most.
const CALLS: usize = 24;

/// One run at a time: they share the program's detectors.
static TURN: Mutex<()> = Mutex::new(());

fn options() -> SceneOptions {
    let usual = SceneOptions::default();
    let focal_px = usual.focal_px * SIZE.0 as f32 / usual.width as f32;
    SceneOptions { width: SIZE.0, height: SIZE.1, focal_px, frames: PAIRS, ..usual }
}

fn pictures() -> MemoryCamera {
    static PICTURES: OnceLock<MemoryCamera> = OnceLock::new();
    let fill = || MemoryCamera::fill(&mut Scene::new(options()).expect("a scene").into_camera());
    PICTURES.get_or_init(fill).clone()
}

/// A camera that carries out the schedule, an order before each pair.
struct Scheduled {
    camera: FaultyCamera<MemoryCamera>,
    bus: BusFaultControl,
    orders: std::vec::IntoIter<[u8; 2]>,
}

impl Camera for Scheduled {
    type Error = FaultyError<std::convert::Infallible>;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error> {
        let Some([order, value]) = self.orders.next() else { return Ok(None) };
        let (camera, bus) = (&mut self.camera, &self.bus);
        let sides = [Sides::None, Sides::Left, Sides::Right, Sides::Both][usize::from(value) % 4];
        let (calls, lasts_ns) = (u32::from(value % 4), u64::from(value) * 20_000);
        match order % 24 {
            0 => camera.set_stall(calls),
            1 => camera.set_lost(calls),
            2 => camera.set_damaged(calls),
            3 => camera.set_drop_chance(value % 101),
            4 => camera.set_damage_chance(value % 101),
            5 => camera.set_frozen(sides),
            6 => camera.set_dark(sides),
            7 => camera.set_saturated(sides),
            8 => camera.set_covered(sides, value),
            9 => camera.set_right_lag(usize::from(value % 3)),
            10 => camera.set_row_shift(i32::from(value as i8)),
            11 => camera.set_exchanged(value % 2 == 1),
            12 => camera.set_time_offset(i64::from(value as i8) * 1_000_000_000),
            13 => bus.full_for(u32::from(value)),
            14 => bus.down_for(lasts_ns),
            15 => bus.gone_for(lasts_ns),
            16 => bus.passive_for(lasts_ns),
            17 => bus.bus_off_for(lasts_ns),
            18 => bus.recover(),
            19 => camera.set_time_offset(i64::from(value as i8) << 55),
            20 => bus.set_full_chance(u32::from(value), 3),
            _ => camera.heal(),
        }
        camera.next_pair(consume)
    }
}

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let mut source = Source::new(bytes);
    let options = options();
    let size = (SIZE.0 as usize, SIZE.1 as usize);
    let settings = RunSettings {
        priority: 0,
        lock_memory: false,
        hold_ms: u32::from(source.byte()),
        deadline_ms: 1 + u32::from(source.byte()) * 8,
        stale_ms: 1 + u32::from(source.byte()) * 8,
        ..RunSettings::default()
    };
    if settings.check().is_err() {
        return;
    }
    let seed = u64::from(source.byte());
    let mut orders: Vec<[u8; 2]> = Vec::new();
    while orders.len() < CALLS && !source.is_empty() {
        orders.push([source.byte(), source.byte()]);
    }
    let calls = orders.len() as u64;
    let bus_fails = orders.iter().any(|[order, _]| (13..=20).contains(&(order % 24)));

    let bus = VirtualBus::new(8000);
    let mut listener = bus.attach();
    let node: BusFaultInjector<VirtualNode> = BusFaultInjector::new(bus.attach(), seed);
    let camera = Scheduled {
        camera: FaultyCamera::new(pictures().repeated(u32::MAX), size, 4, seed),
        bus: node.control(),
        orders: orders.into_iter(),
    };
    let mut detector = Settings::default();
    detector.matching.disparities = 16;
    let pair = PairPlan {
        name: "front".to_owned(),
        camera,
        calibration: options.calibration(),
        mount: options.mount(),
        settings: detector,
        cpu: None,
        patience: Duration::from_secs(60),
    };
    let wire = WireConfig::default();
    let plan = Plan { pairs: vec![pair], wire, settings, sector_width_deg: 5.0 };
    let report = live::run(plan, node, &AtomicBool::new(false), |_| {}).expect("a rig that can run");

    let front = &report.pairs[0];
    let told = front.frames + front.no_picture + front.damaged + front.lost;
    assert!(told <= calls + 1, "{told} of {calls} calls: {front:?}");
    assert!(report.bus.scans <= front.frames + 1, "{report:?}");
    assert_eq!(listener.dropped(), 0, "the listener is slow");
    let frames = std::iter::from_fn(|| listener.receive().ok().flatten());
    let (heard, last_state) = check_bus(frames.map(|(_, frame)| frame), wire.address());
    // A controller that goes off the bus loses what it had taken.
    let taken = report.bus.sent.frames;
    assert!(heard == taken || (bus_fails && heard < taken), "{heard} of {taken} frames that the bus took");
    let starting = last_state == Some(NodeState::Starting);
    assert!(bus_fails || report.bus.scans == 0 || !starting, "the last word of a node that ran");
}

/// Every frame is a good one; a scan is whole or not there; nothing is free in pictures that are not to be trusted.
/// Returns how many there were, and what the node said of itself at last.
fn check_bus(frames: impl Iterator<Item = CanFrame>, address: Address) -> (u64, Option<NodeState>) {
    let config =
        ReceiverConfig { heartbeat_timeout_ns: u64::MAX, max_age_ns: u64::MAX, ..ReceiverConfig::new(address) };
    let mut receiver = ScanReceiver::<2048>::new(config);
    let (mut count, mut last_state) = (0, None);
    for frame in frames {
        count += 1;
        let embedded_can::Id::Standard(id) = frame.id() else { panic!("{frame} has a long identifier") };
        let packet = Packet::check(address, id, frame.data());
        let packet =
            packet.unwrap_or_else(|| panic!("{frame} is not the node's")).unwrap_or_else(|e| panic!("{frame}: {e}"));
        match packet.message() {
            Message::Heartbeat => {
                last_state = HeartbeatRepr::parse(packet.data()).ok().map(|heartbeat| heartbeat.state)
            }
            Message::Header => {
                HeaderRepr::parse(packet.data()).expect("a header");
            }
            _ => {}
        }
        let result = receiver.receive(id, frame.data(), 0).unwrap_or_else(|error| panic!("{frame}: {error}"));
        if matches!(result, Received::Scan { .. })
            && let Ok(scan) = receiver.scan(0)
            && scan.health >= HealthLevel::Blind
        {
            assert!(scan.runs.iter().all(|run| run.obstacle), "free in a scan that is {:?}", scan.health);
        }
    }
    (count, last_state)
}
