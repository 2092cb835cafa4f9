//! Frames and scans over buses that are well.

use fencepost_core::wire::{FrameFormat, WireConfig, max_frames_per_scan};
use fencepost_guest_tests::{
    bus::{Listener, Speaker},
    machine::{on_first_processor, wait_for},
    net::{ControllerPair, Interface},
    scans::NumberedScans,
};
use fencepost_hal::{
    can::{BitTiming, CanBus, CanInterface, SocketCan, Transmitter, can_interfaces},
    clock::monotonic_ns,
};

use super::{SECONDS, frame, receive};

/// What one side sends the other receives, whoever of the two is the program; with the time at which it came.
#[test]
fn frames_cross_in_both_directions() {
    let classic = ["123#0102030405060708", "1F334455#A5", "7FF#AA", "400#"];
    let fd = ["402##1000102030405060708090A0B0C0D0E0F1011121314151617", "402##0AA", "7FF#R2", "123#0102"];
    let pair = ControllerPair::classic();
    assert_crosses(pair.a.name(), pair.b.name(), false, &classic);
    drop(pair);
    let pair = ControllerPair::fd();
    assert_crosses(pair.a.name(), pair.b.name(), true, &fd);
    let bus = Interface::virtual_bus("vcan0");
    assert_crosses(bus.name(), bus.name(), true, &fd);
}

fn assert_crosses(from: &str, to: &str, fd: bool, frames: &[&str]) {
    let mut program = SocketCan::new(from, fd);
    program.open_now().unwrap();
    let (listener, speaker) = (Listener::open(to), Speaker::open(to));
    for text in frames {
        program.send(&frame(text), monotonic_ns()).unwrap();
    }
    let wanted: Vec<_> = frames.iter().map(|text| frame(text)).collect();
    assert_eq!(listener.frames(frames.len(), SECONDS), wanted, "from {from} to {to}");

    let start_ns = monotonic_ns();
    for text in frames {
        speaker.send(&frame(text)).unwrap();
    }
    let received = receive(&mut program, frames.len());
    assert_eq!(received.iter().map(|(_, frame)| *frame).collect::<Vec<_>>(), wanted, "from {to} to {from}");
    // The kernel stamps by another clock, of which the difference is taken: a microsecond is rounding.
    let now_ns = monotonic_ns();
    assert!(
        received.iter().all(|(at_ns, _)| (start_ns - 1_000..=now_ns).contains(at_ns)),
        "{received:?} since {start_ns}"
    );
    assert!(received.is_sorted_by_key(|(at_ns, _)| *at_ns));
}

/// What the program knows of an interface is what it was set to.
#[test]
fn interfaces_are_listed_with_their_bit_rates() {
    let bus = Interface::virtual_bus("vcan0");
    let classic = ControllerPair::classic();
    let fd = ControllerPair::fd();
    let mut names = [&bus, &classic.a, &classic.b, &fd.a, &fd.b].map(Interface::name);
    names.sort_unstable();
    assert_eq!(can_interfaces(), names);

    let [virtual_bus, of_classic, of_fd] = [&bus, &classic.a, &fd.a].map(|i| CanInterface::look(i.name()).unwrap());
    assert!(virtual_bus.up && virtual_bus.takes_fd() && virtual_bus.timing.is_none());
    assert!(of_classic.up && !of_classic.takes_fd());
    assert_eq!(of_classic.timing, Some(BitTiming { bitrate: 500_000, data_bitrate: None }));
    assert_eq!((of_classic.restart_ms, of_classic.tx_queue_len), (Some(100), Some(10)));
    assert!(of_fd.up && of_fd.takes_fd());
    assert_eq!(of_fd.timing, Some(BitTiming { bitrate: 500_000, data_bitrate: Some(2_000_000) }));
    classic.a.down();
    assert!(!CanInterface::look(classic.a.name()).unwrap().up);
}

/// A hundred scans, each as fast as the bus takes it: a controller's queue is full again and again, and every scan arrives.
#[test]
fn scans_arrive_whole_whatever_the_bus_is_made_of() {
    on_first_processor();
    let pair = ControllerPair::classic();
    assert_scans_arrive(pair.a.name(), pair.b.name(), FrameFormat::Classic);
    drop(pair);
    let pair = ControllerPair::fd();
    assert_scans_arrive(pair.a.name(), pair.b.name(), FrameFormat::Classic);
    assert_scans_arrive(pair.a.name(), pair.b.name(), FrameFormat::Fd);
    let bus = Interface::virtual_bus("vcan0");
    assert_scans_arrive(bus.name(), bus.name(), FrameFormat::Fd);
}

fn assert_scans_arrive(from: &str, to: &str, format: FrameFormat) {
    const SCANS: usize = 100;
    let listener = Listener::open(to);
    let bus = SocketCan::new(from, format == FrameFormat::Fd);
    let mut transmitter = Transmitter::new(bus, max_frames_per_scan(&WireConfig::default()));
    let mut scans = NumberedScans::new(format);
    for number in 1..=SCANS {
        transmitter.heartbeat(&scans.heartbeat());
        transmitter.scan(&scans.scan()).unwrap();
        let sent = wait_for(SECONDS, || (transmitter.pump(monotonic_ns()).waiting == 0).then_some(()));
        assert!(sent.is_some(), "{from}: {:?}", transmitter.error());
        let arrived = wait_for(SECONDS, || (listener.heard().scans().count() == number).then_some(()));
        assert!(arrived.is_some(), "scan {number} from {from} to {to}: {:?}", listener.heard().statistics());
    }
    assert_eq!(transmitter.counters().abandoned_scans, 0);
    let heard = listener.heard();
    for scan in heard.scans() {
        let mut cells = scan.cells.clone();
        cells.sort_unstable();
        assert_eq!(cells, scans.cells_of(scan.scan_index), "scan {}", scan.scan_index);
    }
    assert_eq!(heard.errors, []);
}
