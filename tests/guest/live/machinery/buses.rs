//! CAN: a virtual bus, and two kinds of controllers.

use std::{
    io::Read as _,
    process::{Command, Stdio},
    time::Duration,
};

use fencepost_guest_tests::{
    bus::{Listener, Speaker, wait_for_reader},
    machine::run,
    net::{ControllerPair, Interface},
};
use fencepost_hal::can::{CanFrame, parse_candump};

const SECONDS: Duration = Duration::from_secs(5);

fn frame(text: &str) -> CanFrame {
    text.parse().unwrap_or_else(|error| panic!("{text}: {error}"))
}

/// What can-utils sends is heard, and what is sent can-utils hear.
#[test]
fn a_virtual_bus_carries_every_kind_of_frame() {
    let frames = ["123#0102", "1F334455#A5", "123#R4", "321##1AABBCCDD", "007##00011223344556677889900AA", "7FF#"];
    let bus = Interface::virtual_bus("vcan0");
    let listener = Listener::open(bus.name());
    for text in frames {
        run(&format!("cansend vcan0 {text}"));
    }
    let heard = listener.frames(frames.len(), SECONDS);
    assert_eq!(heard, frames.map(frame));
    drop(listener);

    let count = frames.len().to_string();
    let mut candump = Command::new("candump");
    candump.args(["-L", "-n", &count, "vcan0"]).stdout(Stdio::piped());
    let mut candump = candump.spawn().expect("candump starts");
    wait_for_reader("vcan0");
    let speaker = Speaker::open(bus.name());
    for text in frames {
        speaker.send(&frame(text)).unwrap();
    }
    let mut log = Vec::new();
    candump.stdout.take().expect("a pipe").read_to_end(&mut log).unwrap();
    let dumped: Vec<CanFrame> = parse_candump(&log).map(|line| line.unwrap().frame).collect();
    assert_eq!(dumped, frames.map(frame));
    assert!(candump.wait().unwrap().success());
}

#[test]
fn classic_frames_cross_between_two_controllers() {
    let pair = ControllerPair::classic();
    assert_carries(&pair, &["400#0102030405060708", "47F#00", "1FFFFFFF#FFFFFFFFFFFFFFFF", "000#"]);
}

#[test]
fn fd_frames_of_64_bytes_cross_between_two_controllers() {
    let pair = ControllerPair::fd();
    let longest = format!("402##1{}", (0..64).map(|byte| format!("{byte:02X}")).collect::<String>());
    assert_carries(
        &pair,
        &[&longest, "402##1000102030405060708090A0B0C0D0E0F1011121314151617", "402##000", "400#0102"],
    );
}

/// What a controller that is pulled out means for whoever sends and for whoever listens, and that it comes back.
#[test]
fn a_controller_can_be_pulled_out_and_put_back() {
    const ENXIO: i32 = 6;
    let ControllerPair { a, b, .. } = &ControllerPair::classic();
    let listener = Listener::open(b.name());
    let speaker = Speaker::open(a.name());
    a.take_away();
    let error = speaker.send(&frame("123#00")).unwrap_err();
    assert_eq!(error.raw_os_error(), Some(ENXIO), "{error}");
    a.bring_back();
    Speaker::open(a.name()).send(&frame("123#01")).unwrap();
    assert_eq!(listener.frames(1, SECONDS), [frame("123#01")]);
}

fn assert_carries(pair: &ControllerPair, frames: &[&str]) {
    for (from, to) in [(&pair.a, &pair.b), (&pair.b, &pair.a)] {
        let listener = Listener::open(to.name());
        let speaker = Speaker::open(from.name());
        for text in frames {
            speaker.send(&frame(text)).unwrap();
        }
        let wanted: Vec<CanFrame> = frames.iter().map(|text| frame(text)).collect();
        assert_eq!(listener.frames(frames.len(), SECONDS), wanted, "from {} to {}", from.name(), to.name());
        assert_eq!(listener.heard().errors, [], "error frames");
    }
}
