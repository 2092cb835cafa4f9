//! The whole live loop on virtual devices and in virtual time, with a schedule of faults of the cameras and the bus and of what a
//! controller says.

use std::{
    cell::{Cell, RefCell},
    rc::Rc,
    sync::{Mutex, OnceLock, PoisonError},
    time::Duration,
};

use fencepost::{
    detector::{CELLS, OBSTACLES},
    live::{self, PairPlan, Plan, RunReport, RunSettings, Sight},
};
use fencepost_core::{
    detector::{DetectError, Detection, Detector},
    health::{Health, HealthLevel, HealthReason},
    map::MapGeometry,
    picture::Picture,
    rectify::grid_nodes,
    settings::Settings,
    wire::{
        AGE_STEP_MS, Address, CommandEncoder, Frame, HeaderRepr, HeartbeatRepr, Message, NodeState, Packet, Received,
        ReceiverConfig, ScanReceiver, VehicleMotionRepr, WireConfig,
    },
};
use fencepost_hal::{
    camera::{Camera, FaultyCamera, FaultyError, MemoryCamera, Sides, StereoPair},
    can::{BusFaultControl, BusFaultInjector, CanBus, CanFrame, VirtualBus, VirtualNode},
    clock::{Clock, VirtualClock},
    scene::{Scene, SceneOptions},
};

use crate::Source;

const SIZE: (u32, u32) = (48, 36);
/// More than a run has, most of the time: a camera that shows again what it has shown is told.
const PAIRS: u32 = 12;
const DISPARITIES: usize = 8;
/// A detector for pictures of that size, with tables as the loop has them.
type SmallDetector =
    Detector<{ (SIZE.0 * SIZE.1) as usize }, { SIZE.0 as usize }, DISPARITIES, GRID, 256, OBSTACLES, CELLS>;
const GRID: usize = grid_nodes(SIZE.0 as usize, SIZE.1 as usize);
/// One in so many runs looks at the pictures. Nine tenths of the time of a run would be the detector's, which has targets of its own.
const LOOKS: u64 = 32;
/// Calls of the cameras in one run at most.
const CALLS: usize = 12;
/// When a run begins, so that pictures can be older than that.
const START_NS: u64 = 1 << 40;
const MS: u64 = 1_000_000;
/// Steps of the age in a scan, and the largest.
const AGE_STEP_NS: u64 = AGE_STEP_MS as u64 * MS;
const OLDEST_NS: u64 = 255 * AGE_STEP_NS;
/// A heartbeat comes at least so often.
const HEARTBEAT_NS: u64 = 100 * MS;
/// What is new is said by the heartbeat within so long: they come at 20 Hz at most, and the loop looks every 5 ms.
const NEWS_NS: u64 = 55 * MS;

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

/// Pictures small, with few cells: what is tried is the loop.
fn detector_settings() -> Settings {
    let mut settings = Settings::default();
    settings.matching.disparities = DISPARITIES as u16;
    settings.map.geometry = MapGeometry { cell_size_mm: 500, x_first: 0, x_count: 16, y_first: -8, y_count: 16 };
    settings
}

/// What a pair looks with.
struct Eye {
    detector: SmallDetector,
    /// What it has seen in each of the undisturbed pictures.
    memory: Vec<Detection<OBSTACLES, CELLS>>,
}

/// In memory that is there from the start, for one run at a time.
static EYES: Mutex<[Eye; 2]> = Mutex::new([const { Eye { detector: SmallDetector::new(), memory: Vec::new() } }; 2]);

impl Eye {
    /// Makes it ready to look or to remember.
    fn open(&mut self, remembers: bool) {
        let Self { detector, memory } = self;
        if remembers && !memory.is_empty() {
            return;
        }
        let options = options();
        detector.configure(&detector_settings(), &options.calibration(), &options.mount()).expect("settings");
        if remembers {
            let mut camera = pictures();
            let mut look = || camera.next_pair(|pair| detector.detect(&pair.left, &pair.right, &mut ()).cloned());
            memory.extend(std::iter::from_fn(|| look().expect("pictures").map(|seen| seen.expect("a picture"))));
        }
    }
}

/// An eye in a run: either it looks, or it sees what it has seen before, in an order that the pictures decide, with the health that the
/// schedule says.
struct Looking<'a> {
    eye: &'a mut Eye,
    remembers: bool,
    newest: usize,
    world: Rc<World>,
}

impl<'a> Looking<'a> {
    fn new(eye: &'a mut Eye, remembers: bool, world: &Rc<World>) -> Self {
        eye.open(remembers);
        Self { eye, remembers, newest: 0, world: world.clone() }
    }
}

impl Sight for Looking<'_> {
    fn look(&mut self, left: &Picture<'_>, right: &Picture<'_>) -> Result<(), DetectError> {
        let Eye { detector, memory } = &mut *self.eye;
        if !self.remembers {
            return detector.look(left, right);
        }
        let sum: usize = left.row(0).iter().chain(right.row(0)).map(|pixel| usize::from(*pixel)).sum();
        self.newest = sum % memory.len();
        memory[self.newest].health = self.world.health.get();
        Ok(())
    }

    fn seen(&self) -> &Detection<OBSTACLES, CELLS> {
        if self.remembers { &self.eye.memory[self.newest] } else { self.eye.detector.seen() }
    }

    fn forget(&mut self) {
        if !self.remembers {
            Sight::forget(&mut self.eye.detector);
        }
    }
}

/// What an input says.
#[derive(Clone, Debug)]
struct Schedule {
    settings: RunSettings,
    pairs: usize,
    seed: u64,
    /// Whether the pictures are not looked at.
    remembers: bool,
    /// An order before each call of a camera.
    orders: Vec<[u8; 2]>,
}

impl Schedule {
    fn new(source: &mut Source<'_>) -> Self {
        let settings = RunSettings {
            hold_ms: u32::from(source.byte()),
            deadline_ms: 1 + u32::from(source.byte()) * 8,
            stale_ms: 1 + u32::from(source.byte()) * 8,
            ..RunSettings::default()
        };
        let seed = source.byte();
        let mut orders = Vec::new();
        while orders.len() < CALLS && !source.is_empty() {
            orders.push([source.byte(), source.byte()]);
        }
        let pairs = if seed < 192 { 1 } else { 2 };
        Self { settings, pairs, seed: u64::from(seed), remembers: !source.seldom(LOOKS), orders }
    }

    /// Whether frames may be held up or lost.
    fn spoils_the_bus(&self) -> bool {
        self.orders.iter().any(|[order, _]| matches!(order % 32, 13..=18 | 20))
    }
}

/// What the cameras of a run share: the schedule, and what came of it.
struct World {
    clock: VirtualClock,
    bus: BusFaultControl,
    controller: RefCell<VirtualNode>,
    commands: RefCell<CommandEncoder>,
    address: Address,
    orders: RefCell<std::vec::IntoIter<[u8; 2]>>,
    /// How long the cameras take until their next picture, and how old a picture is when it comes.
    pace: Cell<Duration>,
    age_ns: Cell<u64>,
    /// What is seen in pictures that are not looked at.
    health: Cell<Health>,
    /// When pictures came, and when they were exposed.
    delivered: RefCell<Vec<(u64, u64)>>,
    /// When no picture came, or one that is of no use.
    troubles: RefCell<Vec<u64>>,
}

impl World {
    const PACE: Duration = Duration::from_millis(100);
    const AGE_NS: u64 = 20 * MS;

    fn say(&self, frame: &Frame, spoil: impl FnOnce(&mut [u8])) {
        let frame = CanFrame::new(frame.id(), frame.data(), frame.is_fd()).expect("a frame").map_data(spoil);
        self.controller.borrow_mut().send(&frame, self.clock.now_ns()).expect("a bus in memory");
    }

    /// Carries out an order that is not for a camera.
    fn carry_out(&self, order: u8, value: u8) {
        let lasts_ns = u64::from(value) * MS;
        let mut commands = self.commands.borrow_mut();
        let mut motion = || {
            let speed_mm_per_s = Some(i16::from(value as i8) * 100);
            commands.vehicle_motion(&VehicleMotionRepr { speed_mm_per_s, yaw_rate_cdeg_per_s: None })
        };
        match order {
            13 => self.bus.full_for(u32::from(value)),
            14 => self.bus.down_for(lasts_ns),
            15 => self.bus.gone_for(lasts_ns),
            16 => self.bus.passive_for(lasts_ns),
            17 => self.bus.bus_off_for(lasts_ns),
            18 => self.bus.recover(),
            20 => self.bus.set_full_chance(u32::from(value), 3),
            21 => self.pace.set(Duration::from_millis(4 * u64::from(value))),
            22 => self.age_ns.set(lasts_ns),
            23 => self.say(&motion(), |_| ()),
            24 => self.say(&commands.scan_echo(u16::from(value % 8)), |_| ()),
            25 => self.say(&motion(), |data| data[usize::from(value) % 8] ^= value | 1),
            26 => {
                let id = self.address.id(Message::Heartbeat);
                let frame = CanFrame::new(id, &[value; 8], false).expect("a frame");
                self.controller.borrow_mut().send(&frame, self.clock.now_ns()).expect("a bus in memory");
            }
            27 => {
                let mut health = self.health.get();
                let levels = [HealthLevel::Ok, HealthLevel::Degraded, HealthLevel::Blind, HealthLevel::Fault];
                let reason = HealthReason::ALL[usize::from(value / 4) % HealthReason::ALL.len()];
                health.raise(reason, levels[usize::from(value % 4)]);
                self.health.set(health);
            }
            28.. => {
                self.pace.set(Self::PACE);
                self.age_ns.set(Self::AGE_NS);
                self.health.set(Health::OK);
            }
            _ => {}
        }
    }
}

/// Pictures that were exposed just now.
struct Stamped {
    pictures: MemoryCamera,
    world: Rc<World>,
}

impl Camera for Stamped {
    type Error = std::convert::Infallible;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error> {
        let timestamp_ns = self.world.clock.now_ns().saturating_sub(self.world.age_ns.get());
        self.pictures.next_pair(|pair| consume(&StereoPair { timestamp_ns, ..*pair }))
    }
}

/// A camera that carries out the schedule, an order before each pair.
struct Scheduled {
    camera: FaultyCamera<Stamped>,
    world: Rc<World>,
}

impl Camera for Scheduled {
    type Error = FaultyError<std::convert::Infallible>;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error> {
        let Self { camera, world } = self;
        let Some([order, value]) = world.orders.borrow_mut().next() else { return Ok(None) };
        let sides = [Sides::None, Sides::Left, Sides::Right, Sides::Both][usize::from(value) % 4];
        let calls = u32::from(value % 4);
        match order % 32 {
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
            19 => camera.set_time_offset(i64::from(value as i8) << 55),
            28.. => camera.heal(),
            _ => {}
        }
        world.carry_out(order % 32, value);
        let now_ns = world.clock.now_ns();
        let result = camera.next_pair(|pair| {
            world.delivered.borrow_mut().push((now_ns, pair.timestamp_ns));
            consume(pair)
        });
        if result.is_err() {
            world.troubles.borrow_mut().push(now_ns);
        }
        result
    }
}

/// A run, and what was heard of it.
struct Heard {
    report: RunReport,
    world: Rc<World>,
    frames: Vec<(u64, CanFrame)>,
}

fn simulate(schedule: &Schedule) -> Heard {
    let bus = VirtualBus::new(8000);
    let node: BusFaultInjector<VirtualNode> = BusFaultInjector::new(bus.attach(), schedule.seed);
    let wire = WireConfig::default();
    let world = Rc::new(World {
        clock: VirtualClock::new(START_NS),
        bus: node.control(),
        controller: RefCell::new(bus.attach()),
        commands: RefCell::new(CommandEncoder::new(wire.address())),
        address: wire.address(),
        orders: RefCell::new(schedule.orders.clone().into_iter()),
        pace: Cell::new(World::PACE),
        age_ns: Cell::new(World::AGE_NS),
        health: Cell::new(Health::OK),
        delivered: RefCell::default(),
        troubles: RefCell::default(),
    });
    let options = options();
    let size = (SIZE.0 as usize, SIZE.1 as usize);
    let pair = |index: usize| {
        let pictures = pictures().repeated(u32::MAX);
        let stamped = Stamped { pictures, world: world.clone() };
        PairPlan {
            name: format!("pair {index}"),
            camera: Scheduled {
                camera: FaultyCamera::new(stamped, size, 4, schedule.seed + index as u64),
                world: world.clone(),
            },
            calibration: options.calibration(),
            mount: options.mount(),
            settings: detector_settings(),
            cpu: None,
            patience: Duration::from_secs(60),
        }
    };
    let pairs = (0..schedule.pairs).map(pair).collect();
    let plan = Plan { pairs, wire, settings: schedule.settings.clone(), sector_width_deg: 5.0 };
    let mut eyes = EYES.lock().unwrap_or_else(PoisonError::into_inner);
    let looking = eyes.iter_mut().take(schedule.pairs).map(|eye| Looking::new(eye, schedule.remembers, &world));
    let mut looking: Vec<Looking<'_>> = looking.collect();
    let report = live::simulate(plan, &mut looking, node, &world.clock, |_| world.pace.get(), |_| ());
    let report = report.expect("a rig that can run");
    let mut controller = world.controller.borrow_mut();
    let frames = std::iter::from_fn(|| controller.receive().ok().flatten()).collect();
    assert_eq!(controller.dropped(), 0, "the listener has room for all");
    drop(controller);
    Heard { report, world, frames }
}

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let mut source = Source::new(bytes);
    let schedule = Schedule::new(&mut source);
    if schedule.settings.check().is_err() {
        return;
    }
    let heard = simulate(&schedule);
    let Heard { report, world, frames } = &heard;

    let of_pairs = report.pairs.iter().map(|pair| pair.frames + pair.no_picture + pair.damaged + pair.lost);
    assert_eq!(of_pairs.sum::<u64>(), schedule.orders.len() as u64, "one outcome of each call: {report:?}");
    let looked_at: u64 = report.pairs.iter().map(|pair| pair.frames).sum();
    assert!(report.bus.scans <= looked_at, "{report:?}");
    // A controller that goes off the bus loses what it had taken.
    let (count, taken) = (frames.len() as u64, report.bus.sent.frames);
    let bus_fails = schedule.spoils_the_bus();
    assert!(count == taken || (bus_fails && count < taken), "{count} of {taken} frames that the bus took");
    let heartbeats = check_frames(frames, world, &schedule);
    if !bus_fails {
        check_heartbeats(&heartbeats, world, &schedule.settings);
    }
    if source.seldom(16) {
        assert_eq!(simulate(&schedule).frames, *frames, "the same schedule gives the same frames at the same times");
    }
}

/// Heartbeats come in time, say at once that pictures are missing, and close with the word that the node stops.
fn check_heartbeats(heartbeats: &[(u64, HeartbeatRepr)], world: &World, settings: &RunSettings) {
    let times = || heartbeats.iter().map(|(at_ns, _)| *at_ns);
    let longest = times().zip(times().skip(1)).map(|(before_ns, at_ns)| at_ns - before_ns).max();
    assert!(longest <= Some(HEARTBEAT_NS), "{longest:?} ns without a heartbeat");
    let state = |heartbeat: Option<&(u64, HeartbeatRepr)>| heartbeat.map(|(_, heartbeat)| heartbeat.state);
    assert_eq!(state(heartbeats.first()), Some(NodeState::Starting));
    assert_eq!(state(heartbeats.last()), Some(NodeState::Stopping));
    if u64::from(settings.hold_ms) * MS < NEWS_NS {
        return;
    }
    for trouble_ns in world.troubles.borrow().iter() {
        let heard = heartbeats.iter().rev().find(|(at_ns, _)| *at_ns <= trouble_ns + NEWS_NS);
        let said = heard.is_some_and(|(_, heartbeat)| heartbeat.health.has(HealthReason::MissingPicture));
        assert!(said, "no picture at {trouble_ns}, which was not said: {heartbeats:?}");
    }
}

/// Every frame is a good one; a scan is whole or not there, and as old as its pictures are or older, but not stale; nothing is free in
/// pictures that are not to be trusted. Returns what the node said of itself.
fn check_frames(frames: &[(u64, CanFrame)], world: &World, schedule: &Schedule) -> Vec<(u64, HeartbeatRepr)> {
    let address = world.address;
    let config =
        ReceiverConfig { heartbeat_timeout_ns: u64::MAX, max_age_ns: u64::MAX, ..ReceiverConfig::new(address) };
    let mut receiver = ScanReceiver::<2048>::new(config);
    let stale_ns = u64::from(schedule.settings.stale_ms) * MS;
    let mut heartbeats = Vec::new();
    for &(at_ns, frame) in frames {
        let embedded_can::Id::Standard(id) = frame.id() else { panic!("{frame} has a long identifier") };
        let packet = Packet::check(address, id, frame.data());
        let packet =
            packet.unwrap_or_else(|| panic!("{frame} is not the node's")).unwrap_or_else(|e| panic!("{frame}: {e}"));
        match packet.message() {
            Message::Heartbeat => {
                heartbeats.push((at_ns, HeartbeatRepr::parse(packet.data()).expect("a heartbeat")));
            }
            Message::Header => {
                let header = HeaderRepr::parse(packet.data()).expect("a header");
                // So old that it cannot be told more exactly.
                let age_ns = header.age_ns().unwrap_or(OLDEST_NS);
                assert!(age_ns <= stale_ns.next_multiple_of(AGE_STEP_NS), "a scan of stale pictures: {age_ns} ns");
                let delivered = world.delivered.borrow();
                let exposed =
                    delivered.iter().filter(|(came_ns, _)| *came_ns <= at_ns).map(|(_, exposed_ns)| *exposed_ns);
                // Frames that wait for the bus are older than they say.
                let youngest_ns = at_ns.saturating_sub(exposed.max().expect("a scan of a picture"));
                let older = age_ns >= youngest_ns.min(OLDEST_NS);
                assert!(schedule.spoils_the_bus() || older, "{age_ns} ns, and no picture is so young");
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
    heartbeats
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pictures are small, but a loop that trusts none has nothing to lose.
    #[test]
    fn undisturbed_pictures_are_trusted_and_have_free_cells() {
        let settings = RunSettings { hold_ms: 100, ..RunSettings::default() };
        let schedule = Schedule { settings, pairs: 2, seed: 0, remembers: false, orders: vec![[31, 0]; 2 * CALLS] };
        let heard = simulate(&schedule);
        let heartbeats = check_frames(&heard.frames, &heard.world, &schedule);
        check_heartbeats(&heartbeats, &heard.world, &schedule.settings);
        assert_eq!(heartbeats.last().map(|(_, heartbeat)| heartbeat.health), Some(Health::OK));
        let scans = heard.report.bus.scans;
        assert_eq!((scans, heard.report.bus.sent.whole_scans), (CALLS as u64, CALLS as u64), "one of both pairs each");

        let mut receiver = ScanReceiver::<2048>::new(ReceiverConfig::new(heard.world.address));
        let mut free = 0;
        for (at_ns, frame) in &heard.frames {
            let embedded_can::Id::Standard(id) = frame.id() else { panic!("{frame} has a long identifier") };
            if matches!(receiver.receive(id, frame.data(), *at_ns), Ok(Received::Scan { .. })) {
                let scan = receiver.scan(*at_ns).expect("a scan to drive by");
                free += scan.runs.iter().filter(|run| !run.obstacle).count();
            }
        }
        assert!(free > 5 * CALLS, "{free} runs of free cells");
    }
}
