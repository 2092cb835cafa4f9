//! The loop when nothing is wrong.

use std::{path::Path, time::Duration};

use fencepost::live::{self, Plan, RunSettings};
use fencepost_core::{
    geometry::Mount,
    wire::{Message, NodeState, WireConfig},
};
use fencepost_hal::{
    camera::{Camera, MemoryCamera, StereoPair},
    can::{CanBus, CanFrame, VirtualBus},
    clock::{Clock, VirtualClock},
    recording::{Recording, RecordingWriter},
    scene::Scene,
};

use crate::{
    listener::{Listener, address, now_ns},
    rig::{OrderedCamera, memory, options, pair, patient, start, take_turn},
};

/// A frame without what depends on the time at which it was sent: the age in a header, and the checksum over it.
fn timeless(frame: &CanFrame) -> (u32, Vec<u8>) {
    let mut data = frame.data().to_vec();
    let is_header =
        matches!(frame.id(), embedded_can::Id::Standard(id) if address().message(id) == Some(Message::Header));
    if is_header {
        data[0] = 0;
        data[7] = 0;
    }
    (frame.raw_id(), data)
}

fn is_of_a_scan(frame: &CanFrame) -> bool {
    frame.raw_id() != u32::from(address().id(Message::Heartbeat).as_raw())
}

#[test]
fn a_live_rig_says_what_replay_writes_for_the_same_pictures() {
    let options = options(256, 192, 5);
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("recording");
    let scene = Scene::new(options).unwrap();
    let mut writer = RecordingWriter::create(&recording, &scene.calibration(), &scene.mount()).unwrap();
    let mut camera = scene.into_camera();
    while camera.next_pair(|pair: &StereoPair<'_>| writer.write_pair(pair).unwrap()).unwrap().is_some() {}

    let out = folder.path().join("out");
    assert_cmd::Command::new(env!("CARGO_BIN_EXE_fencepost"))
        .args(["replay", "--write", "can", "--disparities", "32", "--out"])
        .args([&out, &recording])
        .assert()
        .success();
    let log = std::fs::read(out.join("can.log")).unwrap();
    let replayed = fencepost_hal::can::parse_candump(&log).map(|line| line.unwrap().frame);
    let replayed: Vec<_> = replayed.filter(is_of_a_scan).map(|frame| timeless(&frame)).collect();

    // With threads that help, and without.
    for threads_per_pair in [1, 2] {
        live_is_as_replayed(&recording, &replayed, threads_per_pair);
    }
    simulated_is_as_replayed(&recording, &replayed);
}

/// In virtual time the loop says the same, at the times at which it is due.
fn simulated_is_as_replayed(recording: &Path, replayed: &[(u32, Vec<u8>)]) {
    let options = options(256, 192, 5);
    let bus = VirtualBus::new(10_000);
    let mut listener = bus.attach();
    let recorded = Recording::open(recording).unwrap();
    let (calibration, mount) = (recorded.calibration.stereo, recorded.mount);
    let memory = MemoryCamera::fill(&mut recorded.into_camera());
    let mut plan = pair("front", memory, &options, mount);
    plan.calibration = calibration;
    let plan = Plan { pairs: vec![plan], wire: WireConfig::default(), settings: patient(), sector_width_deg: 5.0 };
    let pace = Duration::from_millis(100);
    let _turn = take_turn();
    let clock = VirtualClock::new(0);
    let mut detector = fencepost::detector::lock();
    detector.configure(&plan.pairs[0].settings, &plan.pairs[0].calibration, &mount).unwrap();
    let sights = std::slice::from_mut(&mut *detector);
    let report = live::simulate(plan, sights, bus.attach(), &clock, |_| pace, |event| println!("{event:?}")).unwrap();
    assert_eq!((report.bus.scans, report.bus.overtaken, report.bus.sent.whole_scans), (5, 0, 5), "{report:?}");
    let frames: Vec<_> = std::iter::from_fn(|| listener.receive().unwrap()).collect();
    let (times, scans): (Vec<_>, Vec<_>) =
        frames.iter().filter(|(_, frame)| is_of_a_scan(frame)).map(|(at_ns, frame)| (*at_ns, timeless(frame))).unzip();
    assert_eq!(scans, replayed);
    let mut times: Vec<u64> = times.iter().map(|at_ns| at_ns / 1_000_000).collect();
    times.dedup();
    assert_eq!(times, [100, 200, 300, 400, 500], "a step takes no time");
    assert_eq!(clock.now_ns(), 600_000_000, "the camera ends when the next picture would be due");
}

fn live_is_as_replayed(recording: &Path, replayed: &[(u32, Vec<u8>)], threads_per_pair: u8) {
    let options = options(256, 192, 5);
    let bus = VirtualBus::new(10_000);
    let mut listener = Listener::on(&bus);
    let recorded = Recording::open(recording).unwrap();
    let (calibration, mount) = (recorded.calibration.stereo, recorded.mount);
    let memory = MemoryCamera::fill(&mut recorded.into_camera());
    // Slow enough for every pair to be sent before the next is seen, whatever else the machine does.
    let camera = fencepost_hal::camera::PacedCamera::new(memory, Some(Duration::from_millis(300)));
    let mut plan = pair("front", camera, &options, mount);
    plan.calibration = calibration;
    let report = start(vec![plan], RunSettings { threads_per_pair, ..patient() }, &bus).wait();
    assert_eq!((report.bus.scans, report.bus.overtaken, report.bus.sent.whole_scans), (5, 0, 5), "{report:?}");
    let statistics = listener.finish();
    let live: Vec<_> = listener.frames().iter().filter(|frame| is_of_a_scan(frame)).map(timeless).collect();
    assert!(live.len() > 5 * 8, "{} frames", live.len());
    assert_eq!(live, replayed);
    assert_eq!((statistics.scans, statistics.abandoned_scans, statistics.lost), (5, 0, 0));
}

#[test]
fn the_first_heartbeat_says_starting_and_the_last_one_stopping() {
    let options = options(160, 120, 4);
    let bus = VirtualBus::new(10_000);
    let mut listener = Listener::on(&bus);
    let camera = OrderedCamera::new(memory(options).repeated(u32::MAX), (160, 120), Some(Duration::from_millis(50)));
    let running = start(vec![pair("front", camera, &options, options.mount())], patient(), &bus);
    listener.wait_until_healthy(0);
    let report = running.stop();
    listener.finish();
    let heartbeats = listener.heartbeats();
    assert_eq!(heartbeats.first().unwrap().1.state, NodeState::Starting);
    assert!(heartbeats.iter().any(|(_, heartbeat)| heartbeat.state == NodeState::Running));
    let (_, last) = heartbeats.last().unwrap();
    assert_eq!(last.state, NodeState::Stopping);
    let frames = listener.frames();
    assert!(!is_of_a_scan(frames.last().unwrap()), "nothing comes after the last heartbeat");
    assert_eq!(report.bus.sent.frames, frames.len() as u64);
    assert_eq!(report.bus.latency.count, report.bus.sent.whole_scans);
}

#[test]
fn pairs_that_look_to_different_sides_make_one_map() {
    let options = options(160, 120, 4);
    let mounts = [0.0, 90.0, 180.0, -90.0].map(|yaw_left_deg| Mount { yaw_left_deg, ..options.mount() });
    let bus = VirtualBus::new(10_000);
    let listener = Listener::on(&bus);
    let pairs = mounts.into_iter().enumerate().map(|(index, mount)| {
        let camera =
            OrderedCamera::new(memory(options).repeated(u32::MAX), (160, 120), Some(Duration::from_millis(60)));
        let mut plan = pair(&format!("pair{index}"), camera, &options, mount);
        plan.settings.map.geometry.x_first = -50;
        plan.settings.map.geometry.x_count = 100;
        plan.settings.map.geometry.y_first = -50;
        plan.settings.map.geometry.y_count = 100;
        plan
    });
    let running = start(pairs.collect(), patient(), &bus);
    let healthy_ns = listener.wait_until_healthy(0);
    std::thread::sleep(Duration::from_millis(600));
    let report = running.stop();
    assert_eq!(report.pairs.len(), 4);
    assert!(report.pairs.iter().all(|pair| pair.frames > 5), "{report:?}");
    let scans = listener.scans(healthy_ns, now_ns());
    let to_a_side = |cells: &[(i8, i8)]| {
        // Ahead, left, behind, right.
        let mut counts = [0; 4];
        for (i, j) in cells {
            let side = if i.unsigned_abs() >= j.unsigned_abs() {
                if *i < 0 { 2 } else { 0 }
            } else if *j > 0 {
                1
            } else {
                3
            };
            counts[side] += 1;
        }
        counts
    };
    let scan = scans.iter().max_by_key(|scan| scan.free.len()).unwrap();
    let free = to_a_side(&scan.free);
    println!("free cells ahead, left, behind, right: {free:?}; obstacles {:?}", to_a_side(&scan.obstacles));
    assert!(free.iter().all(|count| *count > 5), "{free:?}");
    // All four see the same scene: what they see is alike but for the cells that are cut differently.
    let (least, most) = (free.iter().min().unwrap(), free.iter().max().unwrap());
    assert!(2 * least > *most, "{free:?}");
}
