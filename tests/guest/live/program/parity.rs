//! A recording played through real devices gives the bus what `replay` writes for it.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    time::Duration,
};

use fencepost_core::wire::{Address, Message};
use fencepost_guest_tests::{
    bus::{Listener, wait_for_reader},
    loopback::Loopback,
    machine::{on_first_processor, wait_for},
    net::{ControllerPair, Interface},
    program::Program,
    say,
};
use fencepost_hal::{
    camera::{Camera, StereoPair},
    can::{CanFrame, parse_candump},
    recording::{Recording, RecordingWriter},
};

use super::{LOOPBACK, PATIENCE, open_writers, rig, start, trail, trail_pictures, write_nothing, write_pair};

/// Nothing is late, stale or missing only because an emulated machine is slow.
const PATIENT: &str = "[run]\ndeadline_ms = 60000\nstale_ms = 60000\npriority = 0\n";

fn message(frame: &CanFrame) -> Option<Message> {
    match frame.id() {
        embedded_can::Id::Standard(id) => Address::default().message(id),
        embedded_can::Id::Extended(_) => None,
    }
}

/// The frames of scans, without what depends on when they were sent: the age in a header, and the checksum over it.
fn timeless(frames: impl IntoIterator<Item = CanFrame>) -> Vec<(u32, Vec<u8>)> {
    let of_a_scan = frames.into_iter().filter(|frame| message(frame) != Some(Message::Heartbeat));
    let timeless = of_a_scan.map(|frame| {
        let mut data = frame.data().to_vec();
        if message(&frame) == Some(Message::Header) {
            data[0] = 0;
            data[7] = 0;
        }
        (frame.raw_id(), data)
    });
    timeless.collect()
}

/// What `replay` writes for the recording, behind `grey` pairs of nothing.
fn replayed(grey: usize, fd: bool) -> Vec<(u32, Vec<u8>)> {
    let (folder, out) = ("/tmp/behind_grey", "/tmp/replayed");
    for old in [folder, out] {
        // It is there only if another test made it.
        let _ = fs::remove_dir_all(old);
    }
    let recording = Recording::open(trail()).unwrap();
    let mut writer = RecordingWriter::create(folder, &recording.calibration.stereo, &recording.mount).unwrap();
    let pixels = vec![128; (super::SIZE.0 * super::SIZE.1) as usize];
    let picture =
        fencepost_core::picture::Picture::packed(&pixels, super::SIZE.0 as usize, super::SIZE.1 as usize).unwrap();
    for sequence in 0..grey as u32 {
        let pair = StereoPair {
            left: picture,
            right: picture,
            timestamp_ns: u64::from(sequence),
            skew_ns: 0,
            sequence,
            missed: 0,
        };
        writer.write_pair(&pair).unwrap();
    }
    let mut camera = recording.into_camera();
    let write = |pair: &StereoPair<'_>| {
        writer.write_pair(&StereoPair { timestamp_ns: pair.timestamp_ns + 1_000_000_000, ..*pair }).unwrap()
    };
    let mut write = write;
    while camera.next_pair(&mut write).unwrap().is_some() {}
    let fd = if fd { "--can-fd" } else { "" };
    let ended = Program::start(&format!("replay {folder} --out {out} --write can {fd}")).wait(Duration::from_secs(60));
    assert!(ended.status.success(), "{}", ended.said);
    let log = fs::read(format!("{out}/can.log")).unwrap();
    timeless(parse_candump(&log).map(|line| line.unwrap().frame))
}

/// Plays the recording through two loopback devices into the program, and takes what it says on `sender` from `listener`.
fn live(sender: &str, receiver: &str, fd: bool) -> (usize, Vec<(u32, Vec<u8>)>) {
    let _loopback = Loopback::load();
    let listener = Listener::open(receiver);
    let mut writers = open_writers();
    write_nothing(&mut writers);
    let wire = if fd { "[wire]\nformat = \"fd\"\nmax_cell_frames = 80\n" } else { "" };
    let camera = format!("{LOOPBACK}\ntimeout_ms = 4000\nnewest_only = false");
    let program = start(&rig(sender, &format!("{PATIENT}{wire}"), &camera));
    // It says that it is there, and then perhaps what it sees in the pair that was written first.
    let there = wait_for(PATIENCE, || (!listener.heard().frames.is_empty()).then_some(()));
    assert!(there.is_some(), "{}", program.said());
    let scans = || listener.heard().statistics().scans as usize;
    std::thread::sleep(Duration::from_secs(1));
    let grey = scans();

    let mut pictures = trail_pictures();
    let mut count = grey;
    while pictures.next_pair(|pair| write_pair(&mut writers, pair)).unwrap().is_some() {
        count += 1;
        let sent = wait_for(PATIENCE, || (scans() >= count).then_some(()));
        assert!(sent.is_some(), "{} of {count} scans came; {}", scans(), program.said());
    }
    let ended = program.stop(PATIENCE);
    assert!(ended.status.success(), "{}", ended.said);
    let frames = listener.heard().frames.iter().map(|(_, frame)| *frame).collect::<Vec<_>>();
    assert_eq!(frames.last().and_then(message), Some(Message::Heartbeat), "the last word is a heartbeat");
    (grey, timeless(frames))
}

fn compare(sender: &str, receiver: &str, fd: bool) {
    let (grey, live) = live(sender, receiver, fd);
    let replayed = replayed(grey, fd);
    say!("{sender}: {} frames of scans, {grey} scans of nothing before", live.len());
    assert!(live.len() > 6 * 8);
    let first = live.iter().zip(&replayed).position(|(live, replayed)| live != replayed);
    assert_eq!(first, None, "{:X?}\n{:X?}", live[first.unwrap()], replayed[first.unwrap()]);
    assert_eq!(live.len(), replayed.len());
}

#[test]
fn a_virtual_bus_hears_what_replay_writes() {
    let bus = Interface::virtual_bus("vcan0");
    compare(bus.name(), bus.name(), false);
    compare(bus.name(), bus.name(), true);
}

#[test]
fn a_controller_hears_what_replay_writes() {
    // The emulated controllers hold but a few frames.
    on_first_processor();
    let pair = ControllerPair::classic();
    compare(pair.a.name(), pair.b.name(), false);
}

#[test]
fn a_controller_with_can_fd_hears_what_replay_writes() {
    let pair = ControllerPair::fd();
    compare(pair.a.name(), pair.b.name(), true);
}

/// What candump writes of the bus is kept for cantools, which tests/run lets decode it and compare it with the cells.
#[test]
fn candump_writes_what_is_on_the_bus() {
    let target = PathBuf::from(std::env::var_os("FENCEPOST_PROGRAM").expect("set by tests/guest/run"));
    let kept = target.parent().and_then(Path::parent).expect("the program is in a folder of the target").join("tmp");
    let bus = Interface::virtual_bus("vcan0");
    let log = fs::File::create(kept.join("guest_candump.log")).unwrap();
    let mut candump = Command::new("candump").args(["-L", "-T", "20000", bus.name()]).stdout(log).spawn().unwrap();
    wait_for_reader(bus.name());
    let program = start(&super::recorded_rig(bus.name(), PATIENT, false));
    let ended = program.wait(Duration::from_secs(60));
    assert!(ended.status.success(), "{}", ended.said);
    std::thread::sleep(Duration::from_secs(1));
    candump.kill().unwrap();
    candump.wait().unwrap();

    let out = "/tmp/replayed_for_candump";
    let replay = Program::start(&format!("replay {} --out {out} --write cells", trail().display()));
    let ended = replay.wait(Duration::from_secs(60));
    assert!(ended.status.success(), "{}", ended.said);
    fs::copy(format!("{out}/cells.csv"), kept.join("guest_candump.csv")).unwrap();
}
