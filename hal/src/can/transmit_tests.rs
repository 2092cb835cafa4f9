//! A bus that says no at every place, in every way, against what a receiver makes of the frames that got through.

use fencepost_core::{
    health::Health,
    map::{Cell, CellState, MapGeometry, SectorDistances},
    wire::{
        Message, NodeState, Received, ReceiverConfig, Run, Scan, ScanEncoder, ScanReceiver, Status, WireConfig,
        WireSettings,
    },
};

use super::*;
use crate::can::{BusCondition, VirtualBus};

/// What the bus says to the next frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    Taken,
    Full,
    Down,
    Gone,
    /// Down, and the frames still in the interface's queue are lost.
    Flushed,
    Other,
}

#[derive(Debug)]
struct Refusal(BusErrorKind);

impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.0)
    }
}

impl std::error::Error for Refusal {}

impl BusError for Refusal {
    fn kind(&self) -> BusErrorKind {
        self.0
    }
}

/// Answers by a script and takes everything once that has ended.
#[derive(Debug, Default)]
struct ScriptedBus {
    script: Vec<Answer>,
    asked: usize,
    taken: Vec<CanFrame>,
    condition: BusCondition,
    no_fd: bool,
    receive: Option<BusErrorKind>,
}

impl ScriptedBus {
    fn new(script: &[Answer]) -> Self {
        Self { script: script.to_vec(), ..Self::default() }
    }
}

impl CanBus for ScriptedBus {
    type Error = Refusal;

    fn send(&mut self, frame: &CanFrame, _: u64) -> Result<(), Refusal> {
        let answer = self.script.get(self.asked).copied().unwrap_or(Answer::Taken);
        self.asked += 1;
        match answer {
            Answer::Taken if frame.is_fd() && self.no_fd => return Err(Refusal(BusErrorKind::Refused)),
            Answer::Taken => self.taken.push(*frame),
            Answer::Full => return Err(Refusal(BusErrorKind::Full)),
            Answer::Down => return Err(Refusal(BusErrorKind::Down)),
            Answer::Gone => return Err(Refusal(BusErrorKind::Gone)),
            Answer::Flushed => {
                self.taken.truncate(self.taken.len().saturating_sub(3));
                return Err(Refusal(BusErrorKind::Down));
            }
            Answer::Other => return Err(Refusal(BusErrorKind::Other)),
        }
        Ok(())
    }

    fn receive(&mut self) -> Result<Option<(u64, CanFrame)>, Refusal> {
        self.receive.take().map_or(Ok(None), |kind| Err(Refusal(kind)))
    }

    fn condition(&self) -> BusCondition {
        self.condition
    }
}

const CELL_FRAMES: usize = 2;
const FRAMES: usize = 8 + CELL_FRAMES;

/// A node that makes scans of which no two have a cell in common, and heartbeats.
struct Node {
    encoder: ScanEncoder<400>,
    scans: u16,
}

impl Node {
    fn new() -> Self {
        Self { encoder: ScanEncoder::new(WireConfig::default()).unwrap(), scans: 0 }
    }

    /// Row `scan_index` of the map: every other cell an obstacle, so that each is a run of its own.
    fn scan(&mut self) -> Vec<Frame> {
        let scan_index = self.scans;
        self.scans += 1;
        let geometry =
            MapGeometry { x_first: scan_index as i16 - 60, x_count: 1, y_count: 4, ..MapGeometry::default() };
        let states = [CellState::Obstacle, CellState::Free, CellState::Obstacle, CellState::Free];
        let cells = states.map(|state| Cell { state, ..Cell::default() });
        let scan = Scan {
            scan_index,
            age_ns: 0,
            health: Health::OK,
            geometry: &geometry,
            cells: &cells,
            sectors: &SectorDistances::default(),
            ground: None,
        };
        let mut frames = heapless::Vec::<Frame, FRAMES>::new();
        self.encoder.encode(&scan, &mut frames).unwrap();
        assert_eq!(frames.len(), FRAMES);
        frames.to_vec()
    }

    fn heartbeat(&mut self) -> Frame {
        let status = Status { state: NodeState::Running, health: Health::OK, last_scan: self.scans.checked_sub(1) };
        self.encoder.heartbeat(&status)
    }
}

/// The scans that a receiver takes over. Each of them must be one of the node's, with its cells and no others, and they must
/// rise.
fn taken_over(frames: &[CanFrame]) -> Vec<u16> {
    let mut receiver = ScanReceiver::<8>::new(ReceiverConfig::new(WireConfig::default().address()));
    let mut scans = Vec::new();
    for frame in frames {
        let embedded_can::Id::Standard(id) = frame.id() else { panic!("{frame}") };
        let Ok(Received::Scan { scan_index }) = receiver.receive(id, frame.data(), 0) else { continue };
        let scan = receiver.scan(0).expect("a heartbeat went before everything");
        let mut runs: Vec<Run> = scan.runs.to_vec();
        runs.sort_by_key(|run| run.j);
        let expected = [true, false, true, false];
        assert_eq!(runs.iter().map(|run| run.obstacle).collect::<Vec<_>>(), expected);
        assert!(
            runs.iter().all(|run| i16::from(run.i) == scan_index as i16 - 60 && run.length == 1),
            "mixed: {runs:?}"
        );
        assert_eq!(scan.scan_index, scan_index);
        scans.push(scan_index);
    }
    assert!(scans.is_sorted());
    scans
}

/// What the rule says of the order of frames, told without a receiver: between two headers lies the beginning of one scan, and
/// nothing else but heartbeats.
fn assert_never_mixed(frames: &[CanFrame], scans: &[Vec<Frame>]) {
    let same =
        |frame: &CanFrame, of: &Frame| frame.raw_id() == u32::from(of.id().as_raw()) && frame.data() == of.data();
    let address = WireConfig::default().address();
    let is = |frame: &CanFrame, message| frame.raw_id() == u32::from(address.raw_id(message));
    let mut rest: Option<&[Frame]> = None;
    for frame in frames.iter().filter(|frame| !is(frame, Message::Heartbeat)) {
        if is(frame, Message::Header) {
            rest = scans.iter().find(|scan| same(frame, &scan[0])).map(|scan| &scan[1..]);
        } else {
            let (next, behind) = rest.and_then(<[_]>::split_first).expect("a frame behind the end of its scan");
            assert!(same(frame, next), "{frame} is not the next frame of its scan");
            rest = Some(behind);
        }
    }
}

/// Sends three scans, a new one every `pumps` calls of pump, and a heartbeat before each; then pumps until nothing waits.
fn run(script: &[Answer], pumps: usize) -> (ScriptedBus, TransmitCounters, Vec<Vec<Frame>>) {
    let mut node = Node::new();
    let mut transmitter = Transmitter::new(ScriptedBus::new(script), FRAMES);
    let mut scans = Vec::new();
    for _ in 0..3 {
        scans.push(node.scan());
        transmitter.heartbeat(&node.heartbeat());
        transmitter.scan(&scans[scans.len() - 1]).unwrap();
        for _ in 0..pumps {
            let _ = transmitter.pump(0);
        }
    }
    for _ in 0..=script.len() {
        let _ = transmitter.pump(0);
    }
    assert_eq!(transmitter.waiting(), 0, "{script:?}");
    let counters = *transmitter.counters();
    (transmitter.into_inner(), counters, scans)
}

fn assert_rule(script: &[Answer], pumps: usize) -> (Vec<u16>, TransmitCounters) {
    let (bus, counters, scans) = run(script, pumps);
    if !script.contains(&Answer::Flushed) {
        assert_never_mixed(&bus.taken, &scans);
        assert_eq!(counters.frames as usize, bus.taken.len());
    }
    assert_eq!(counters.scans + counters.abandoned_scans, 3, "{script:?}");
    assert_eq!(counters.heartbeats + counters.lost_heartbeats, 3, "{script:?}");
    let over = taken_over(&bus.taken);
    if !script.contains(&Answer::Flushed) {
        assert_eq!(over.len() as u64, counters.scans, "{script:?}");
    }
    (over, counters)
}

#[test]
fn a_free_bus_takes_everything_at_once_heartbeat_first() {
    let mut node = Node::new();
    let mut transmitter = Transmitter::new(ScriptedBus::default(), FRAMES);
    let (scan, heartbeat) = (node.scan(), node.heartbeat());
    transmitter.scan(&scan).unwrap();
    transmitter.heartbeat(&heartbeat);
    assert_eq!(transmitter.waiting(), FRAMES + 1);
    let pump = transmitter.pump(0);
    assert_eq!(pump, Pump { sent: FRAMES + 1, scan_finished: Some(0), waiting: 0, trouble: None });
    let sent: Vec<u32> = transmitter.bus().taken.iter().map(CanFrame::raw_id).collect();
    assert_eq!(sent, [0x400, 0x401, 0x402, 0x402, 0x404, 0x404, 0x404, 0x404, 0x404, 0x405, 0x406]);
    assert_eq!(transmitter.pump(1), Pump::default());
    assert!(transmitter.error().is_none());
}

#[test]
fn a_full_bus_at_any_frame_for_any_time_loses_nothing_before_the_next_scan_comes() {
    for at in 0..=FRAMES {
        for times in 1..4 {
            let mut script = vec![Answer::Taken; at];
            script.extend(vec![Answer::Full; times]);
            let (over, counters) = assert_rule(&script, times + 1);
            assert_eq!(over, [0, 1, 2], "full {times} times at frame {at}");
            assert_eq!((counters.full, counters.abandoned_scans), (times as u64, 0));
        }
    }
}

#[test]
fn the_next_scan_ends_the_one_that_a_full_bus_kept() {
    for at in 1..=FRAMES {
        let mut script = vec![Answer::Taken; at];
        script.extend([Answer::Full; 2]);
        // The first scan meets a full bus once, the second one's heartbeat once more.
        let (over, counters) = assert_rule(&script, 1);
        assert_eq!(over, [2], "full at frame {at}: the second scan waits behind its heartbeat, the third replaces it");
        assert_eq!(counters.abandoned_scans, 2);
        assert_eq!(counters.abandoned_frames as usize, (FRAMES + 1 - at) + FRAMES);
        assert_eq!(counters.lost_heartbeats, 1, "the second heartbeat was replaced by the third");
    }
}

#[test]
fn trouble_at_any_frame_costs_that_scan_and_no_other() {
    for trouble in [Answer::Down, Answer::Gone, Answer::Flushed, Answer::Other] {
        for at in 0..=FRAMES {
            let mut script = vec![Answer::Taken; at];
            script.push(trouble);
            let (over, counters) = assert_rule(&script, 3);
            assert_eq!(over, [1, 2], "{trouble:?} at frame {at}");
            assert_eq!(counters.abandoned_scans, 1);
            let sent_of_scan = at.saturating_sub(1);
            assert_eq!(counters.abandoned_frames as usize, FRAMES - sent_of_scan);
        }
    }
}

/// Every script of nine answers of four kinds, with new scans in every call of pump or in every second one; two scans of ten
/// frames are under way meanwhile.
#[test]
fn no_script_mixes_scans_and_the_newest_gets_through_when_the_bus_is_free() {
    let kinds = [Answer::Taken, Answer::Full, Answer::Down, Answer::Flushed];
    const LENGTH: u32 = 9;
    for number in 0..4_u32.pow(LENGTH) {
        let script: Vec<Answer> = (0..LENGTH).map(|place| kinds[(number >> (2 * place) & 3) as usize]).collect();
        for pumps in [1, 2] {
            assert_rule(&script, pumps);
        }
    }
    // What comes after the script is taken: a scan that begins then arrives whole.
    for number in (0..4_u32.pow(LENGTH)).step_by(7) {
        let script: Vec<Answer> = (0..LENGTH).map(|place| kinds[(number >> (2 * place) & 3) as usize]).collect();
        let mut node = Node::new();
        let mut transmitter = Transmitter::new(ScriptedBus::new(&script), FRAMES);
        while transmitter.bus().asked < script.len() {
            transmitter.heartbeat(&node.heartbeat());
            transmitter.scan(&node.scan()).unwrap();
            let _ = transmitter.pump(0);
        }
        transmitter.heartbeat(&node.heartbeat());
        let newest = node.scans;
        transmitter.scan(&node.scan()).unwrap();
        let pump = transmitter.pump(0);
        assert_eq!((pump.scan_finished, pump.waiting, pump.trouble), (Some(newest), 0, None), "{script:?}");
        assert_eq!(taken_over(&transmitter.bus().taken).last(), Some(&newest), "{script:?}");
    }
}

#[test]
fn a_heartbeat_overtakes_the_scan_and_replaces_one_that_waits() {
    let mut node = Node::new();
    let script = [Answer::Taken, Answer::Taken, Answer::Full, Answer::Full];
    let mut transmitter = Transmitter::new(ScriptedBus::new(&script), FRAMES);
    transmitter.scan(&node.scan()).unwrap();
    assert_eq!(transmitter.pump(0).trouble, Some(BusErrorKind::Full));
    let (old, new) = (node.heartbeat(), node.heartbeat());
    transmitter.heartbeat(&old);
    assert_eq!(transmitter.pump(0).sent, 0);
    transmitter.heartbeat(&new);
    let pump = transmitter.pump(0);
    assert_eq!((pump.sent, pump.scan_finished), (1 + FRAMES - 2, Some(0)));
    let bus = transmitter.bus();
    assert_eq!(bus.taken[2].data(), new.data());
    assert!(bus.taken.iter().all(|frame| frame.data() != old.data()));
    assert_eq!((transmitter.counters().lost_heartbeats, transmitter.counters().full), (1, 2));
}

#[test]
fn a_controller_off_the_bus_gets_heartbeats_and_no_scans_until_it_is_back() {
    let mut node = Node::new();
    let mut transmitter = Transmitter::new(ScriptedBus::new(&[Answer::Taken; 5]), FRAMES);
    transmitter.bus_mut().script.push(Answer::Full);
    transmitter.scan(&node.scan()).unwrap();
    assert_eq!(transmitter.pump(0).waiting, FRAMES - 5);
    transmitter.bus_mut().condition.controller = ControllerState::BusOff;
    transmitter.heartbeat(&node.heartbeat());
    assert_eq!(
        transmitter.pump(0),
        Pump { sent: 1, scan_finished: None, waiting: 0, trouble: Some(BusErrorKind::Down) }
    );
    transmitter.scan(&node.scan()).unwrap();
    assert_eq!(transmitter.pump(0).trouble, Some(BusErrorKind::Down));
    assert_eq!((transmitter.counters().abandoned_scans, transmitter.counters().no_bus), (2, 2));
    // A bus that is full as well does not hide it.
    transmitter.bus_mut().script.push(Answer::Full);
    transmitter.heartbeat(&node.heartbeat());
    assert_eq!(transmitter.pump(0).trouble, Some(BusErrorKind::Down));

    transmitter.bus_mut().condition = BusCondition { restarts: 1, ..BusCondition::default() };
    transmitter.scan(&node.scan()).unwrap();
    assert_eq!(transmitter.pump(0).scan_finished, Some(2));
    assert_eq!(taken_over(&transmitter.bus().taken), [2]);
}

#[test]
fn a_restart_that_nobody_saw_and_an_error_of_the_other_side_end_the_scan_as_well() {
    let mut node = Node::new();
    let script = [Answer::Taken, Answer::Taken, Answer::Full];
    let mut transmitter = Transmitter::new(ScriptedBus::new(&script), FRAMES);
    transmitter.scan(&node.scan()).unwrap();
    let _ = transmitter.pump(0);
    transmitter.bus_mut().condition.restarts = 1;
    assert_eq!(transmitter.pump(0), Pump::default());
    assert_eq!(transmitter.counters().abandoned_frames as usize, FRAMES - 2);

    for (kind, abandoned) in [(BusErrorKind::Other, 1), (BusErrorKind::Down, 2), (BusErrorKind::Gone, 3)] {
        transmitter.scan(&node.scan()).unwrap();
        transmitter.bus_mut().receive = Some(kind);
        assert_eq!(transmitter.receive().unwrap_err().kind(), kind);
        assert_eq!(transmitter.counters().abandoned_scans, abandoned);
        let _ = transmitter.pump(0);
    }
    assert!(transmitter.receive().unwrap().is_none());
}

#[test]
fn a_scan_that_the_bus_never_takes_goes_but_heartbeats_stay() {
    let wire = WireConfig::new(WireSettings::FD).unwrap();
    let mut encoder = ScanEncoder::<640>::new(wire).unwrap();
    let geometry = MapGeometry { x_count: 1, ..MapGeometry::default() };
    let cells = [Cell { state: CellState::Free, ..Cell::default() }; 50];
    let mut frames = heapless::Vec::<Frame, 100>::new();
    let sectors = SectorDistances::default();
    let scan = Scan {
        scan_index: 0,
        age_ns: 0,
        health: Health::OK,
        geometry: &geometry,
        cells: &cells,
        sectors: &sectors,
        ground: None,
    };
    encoder.encode(&scan, &mut frames).unwrap();
    let mut transmitter = Transmitter::new(ScriptedBus { no_fd: true, ..ScriptedBus::default() }, 100);
    for round in 1..4 {
        transmitter.heartbeat(&encoder.heartbeat(&Status::default()));
        transmitter.scan(&frames).unwrap();
        let pump = transmitter.pump(0);
        // The heartbeat and the header are classic frames.
        assert_eq!((pump.sent, pump.waiting, pump.trouble), (2, 0, Some(BusErrorKind::Refused)));
        assert_eq!(transmitter.error().map(BusError::kind), Some(BusErrorKind::Refused));
        assert_eq!((transmitter.counters().refused, transmitter.counters().heartbeats), (round, round));
    }
}

#[test]
fn a_scan_without_room_is_refused_and_the_one_before_goes_on() {
    let mut node = Node::new();
    let mut transmitter = Transmitter::new(ScriptedBus::default(), FRAMES);
    let scan = node.scan();
    transmitter.scan(&scan).unwrap();
    let long: Vec<Frame> = scan.iter().chain(&scan).copied().collect();
    let error = transmitter.scan(&long).unwrap_err();
    assert_eq!(error, ScanTooLong { frames: 2 * FRAMES, capacity: FRAMES });
    assert!(error.to_string().contains("max_cell_frames"));
    assert_eq!(transmitter.pump(0).scan_finished, Some(0));
}

#[test]
fn memory_is_taken_once() {
    let bus = VirtualBus::new(4 * FRAMES);
    let mut transmitter = Transmitter::new(bus.attach(), FRAMES);
    let place = transmitter.scan.as_ptr();
    let mut node = Node::new();
    for _ in 0..100 {
        transmitter.heartbeat(&node.heartbeat());
        transmitter.scan(&node.scan()).unwrap();
        let _ = transmitter.pump(0);
        assert_eq!((transmitter.scan.as_ptr(), transmitter.scan.capacity()), (place, FRAMES));
    }
}
