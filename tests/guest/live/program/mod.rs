//! The program as a user runs it, from real V4L2 devices to real CAN drivers.

mod buses;
mod cameras;
mod feeder;
mod limits;
mod parity;
mod pictures;
mod service;
mod synthetic;

use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use fencepost_core::{
    health::{Health, HealthLevel, HealthReason},
    wire::{HeartbeatRepr, NodeState},
};
use fencepost_guest_tests::{
    bus::{Heard, HeardScan, Listener, Word},
    program::Program,
    say,
};
use fencepost_hal::{camera::MemoryCamera, recording::Recording};

use feeder::{Feeder, open_writers, write_nothing, write_pair};

/// Longest wait for anything under emulation; never a result.
const PATIENCE: Duration = Duration::from_secs(20);
/// Size of the pictures of the committed recording.
const SIZE: (u32, u32) = (320, 240);

/// The committed recording of the scene renderer.
fn trail() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../recordings/trail")
}

fn trail_pictures() -> MemoryCamera {
    MemoryCamera::fill(&mut Recording::open(trail()).unwrap().into_camera())
}

/// Cameras of a rig: two loopback devices.
const LOOPBACK: &str =
    "left = \"/dev/video10\"\nright = \"/dev/video11\"\nwidth = 320\nheight = 240\npairing_tolerance_ms = 60.0";

/// Writes the file of a rig with the mount and the calibration of the committed recording.
fn rig(interface: &str, sections: &str, camera: &str) -> String {
    rig_with(interface, sections, camera, &trail().join("calib.txt"))
}

fn rig_with(interface: &str, sections: &str, camera: &str, calibration: &Path) -> String {
    let text = format!(
        "[bus]\ninterface = \"{interface}\"\n{sections}\n[[pair]]\ncalibration = [\"{}\"]\n[pair.mount]\nheight_m = 1.1\n\
         pitch_down_deg = 10.0\n[pair.camera]\n{camera}\n",
        calibration.display()
    );
    let path = "/tmp/rig.toml";
    fs::write(path, text).unwrap();
    path.to_string()
}

/// A rig that plays the committed recording without any camera: where it is the bus that is tried.
fn recorded_rig(interface: &str, sections: &str, repeat: bool) -> String {
    let path = "/tmp/recorded_rig.toml";
    let text = format!(
        "[bus]\ninterface = \"{interface}\"\n{sections}\n[[pair]]\n[pair.recording]\npath = \"{}\"\nrepeat = {repeat}\n\
         rate_hz = 2.5\n",
        trail().display()
    );
    fs::write(path, text).unwrap();
    path.to_string()
}

fn start(rig: &str) -> Program {
    Program::start(&format!("run --config {rig} -v"))
}

fn is_healthy(heartbeat: &HeartbeatRepr) -> bool {
    heartbeat.state == NodeState::Running && heartbeat.health == Health::OK
}

fn names(health: Health) -> String {
    let names: Vec<_> = HealthReason::ALL.into_iter().filter(|r| health.has(*r)).map(HealthReason::name).collect();
    names.join(" ")
}

/// Waits for a heartbeat; says what was heard instead if none comes.
fn wait_for_heartbeat(
    listener: &Listener,
    program: &Program,
    what: &str,
    since_ns: u64,
    wanted: impl Fn(&HeartbeatRepr) -> bool,
) -> Duration {
    listener.first_heartbeat(since_ns, PATIENCE, wanted).unwrap_or_else(|| {
        let heard = listener.heard();
        let last = heard.words.iter().rev().find_map(|(_, word)| match word {
            Word::Heartbeat(heartbeat) => Some(*heartbeat),
            _ => None,
        });
        let reasons = last.map(|last| names(last.health));
        panic!("{what}: not said; the last heartbeat is {last:?} ({reasons:?}); the program said:\n{}", program.said())
    })
}

fn wait_until_healthy(listener: &Listener, program: &Program, since_ns: u64) -> Duration {
    wait_for_heartbeat(listener, program, "healthy", since_ns, is_healthy)
}

/// The reason must be said within two frame periods or 100 ms, whichever is longer, of the guest's time; and from then on no
/// scan calls anything free, until `until_ns`.
fn assert_said_in_time(
    listener: &Listener,
    program: &Program,
    reason: HealthReason,
    (since_ns, period): (u64, Duration),
) -> u64 {
    let took = wait_for_heartbeat(listener, program, reason.name(), since_ns, |heartbeat| heartbeat.health.has(reason));
    let limit = (2 * period).max(Duration::from_millis(100));
    say!("{}: said after {} ms of {} allowed", reason.name(), took.as_millis(), limit.as_millis());
    assert!(took <= limit, "{}: said after {took:?}, {limit:?} is allowed", reason.name());
    since_ns + took.as_nanos() as u64
}

/// Nothing is free, and the level says that nothing can be told.
fn assert_nothing_free(listener: &Listener, from_ns: u64, until_ns: u64, what: &str) {
    assert_no_free_cell(listener, from_ns, until_ns, what);
    for scan in scans_within(&listener.heard(), from_ns, until_ns) {
        assert!(scan.health >= HealthLevel::Blind, "{what}: scan {} is {:?}", scan.scan_index, scan.health);
    }
}

fn assert_no_free_cell(listener: &Listener, from_ns: u64, until_ns: u64, what: &str) {
    for scan in scans_within(&listener.heard(), from_ns, until_ns) {
        let free = scan.cells.iter().filter(|(_, _, obstacle)| !obstacle).count();
        assert_eq!(free, 0, "{what}: {free} cells are free in scan {}", scan.scan_index);
    }
}

fn scans_within(heard: &Heard, from_ns: u64, until_ns: u64) -> impl Iterator<Item = &HeardScan> {
    heard.words.iter().filter(move |(at_ns, _)| (from_ns..until_ns).contains(at_ns)).filter_map(
        |(_, word)| match word {
            Word::Scan(scan) => Some(scan),
            _ => None,
        },
    )
}
