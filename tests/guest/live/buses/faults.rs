//! Faults of buses: each is told for what it is, no scan is mixed with another, and the bus is used again when it is back.

use std::time::{Duration, Instant};

use fencepost_core::wire::{FrameFormat, WireConfig, max_frames_per_scan};
use fencepost_guest_tests::{
    bus::{Heard, Listener},
    machine::{run, wait_for},
    net::{ControllerPair, Interface},
    resources::Resources,
    scans::NumberedScans,
};
use fencepost_hal::{
    can::{BusError, BusErrorKind, CanBus, ControllerState, SocketCan, Transmitter},
    clock::monotonic_ns,
};

use super::{SECONDS, frame, send_until_taken};

/// Every kind of interface goes down and comes back.
#[test]
fn an_interface_that_is_down_is_used_again_when_it_is_up() {
    let pair = ControllerPair::classic();
    let virtual_bus = Interface::virtual_bus("vcan0");
    for (interface, to) in [(&pair.a, &pair.b), (&virtual_bus, &virtual_bus)] {
        let mut bus = SocketCan::new(interface.name(), false);
        bus.send(&frame("123#00"), 0).unwrap();
        interface.down();
        let error = bus.send(&frame("123#01"), 0).unwrap_err();
        assert_eq!(error.kind(), BusErrorKind::Down, "{error}");
        assert!(error.to_string().contains(interface.name()) && error.to_string().contains("down"), "{error}");
        interface.up();
        let listener = Listener::open(to.name());
        let start = Instant::now();
        send_until_taken(&mut bus, &frame("123#02"));
        assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
        assert_eq!(listener.frames(1, SECONDS), [frame("123#02")]);
    }
}

/// A link that is deleted, a controller that is pulled out; over and over, and nothing is left behind.
#[test]
fn an_interface_that_is_gone_is_used_again_when_it_is_back() {
    let pair = ControllerPair::classic();
    let virtual_bus = Interface::virtual_bus("vcan0");
    for (interface, rounds) in [(&pair.a, 5), (&virtual_bus, 50)] {
        let mut bus = SocketCan::new(interface.name(), false);
        let mut held = Vec::new();
        for round in 0..rounds {
            send_until_taken(&mut bus, &frame("123#00"));
            interface.take_away();
            let error = bus.send(&frame("123#01"), 0).unwrap_err();
            // The reader's side may be told first that it went down.
            let gone = wait_for(SECONDS, || {
                let error = bus.send(&frame("123#01"), 0).unwrap_err();
                (error.kind() == BusErrorKind::Gone).then_some(())
            });
            assert!(gone.is_some(), "round {round}: {error}");
            interface.bring_back();
            held.push(Resources::of(std::process::id()));
        }
        let (first, last) = (held[0], held[rounds - 1]);
        assert_eq!(first.descriptors, last.descriptors);
        assert!(last.resident_kib <= first.resident_kib + 256, "{first:?}, {last:?}");
    }
}

/// Three places in the queue, each frame a tenth of a second in it.
#[test]
fn a_full_queue_keeps_scans_apart_and_lets_heartbeats_through() {
    let pair = ControllerPair::fd();
    let listener = Listener::open(pair.b.name());
    pair.a.disturb("delay 100ms limit 3");
    let mut bus = SocketCan::new(pair.a.name(), false);
    let errors: Vec<_> = (0..8).filter_map(|_| bus.send(&frame("7FF#"), 0).err()).map(|error| error.kind()).collect();
    assert!(!errors.is_empty() && errors.iter().all(|kind| *kind == BusErrorKind::Full), "{errors:?}");

    let mut transmitter = Transmitter::new(bus, max_frames_per_scan(&WireConfig::default()));
    let mut scans = NumberedScans::new(FrameFormat::Classic);
    // A new scan every 50 ms, of which the bus takes but a frame or two.
    for _ in 0..20 {
        transmitter.heartbeat(&scans.heartbeat());
        transmitter.scan(&scans.scan()).unwrap();
        wait_for(Duration::from_millis(50), || {
            let _ = transmitter.pump(monotonic_ns());
            None::<()>
        });
    }
    assert!(
        transmitter.counters().full > 0 && transmitter.counters().abandoned_scans > 10,
        "{:?}",
        transmitter.counters()
    );
    pair.a.undisturb();
    // The next scan has the bus to itself.
    transmitter.heartbeat(&scans.heartbeat());
    let newest = scans.scan();
    transmitter.scan(&newest).unwrap();
    wait_for(SECONDS, || (transmitter.pump(monotonic_ns()).waiting == 0).then_some(()));
    let arrived = listener.first_scan(0, SECONDS, |scan| scan.scan_index == 20);
    let heard = listener.heard();
    assert!(arrived.is_some(), "{:?}", heard.statistics());
    assert_no_mixture(&heard, &scans);
    let heartbeats = heard.words.len() - heard.scans().count();
    assert!(heartbeats >= 10, "{heartbeats} heartbeats of 21");
}

/// What is lost costs whole scans, what comes twice costs nothing; and no scan is ever heard that was not sent.
#[test]
fn loss_and_duplication_never_make_a_scan_that_was_not_sent() {
    for (rules, loses) in [("loss 2%", true), ("duplicate 20%", false), ("loss 1% duplicate 10%", true)] {
        const SCANS: usize = 50;
        let bus = Interface::virtual_bus("vcan0");
        let listener = Listener::open(bus.name());
        bus.disturb(rules);
        let node = SocketCan::new(bus.name(), false);
        let mut transmitter = Transmitter::new(node, max_frames_per_scan(&WireConfig::default()));
        let mut scans = NumberedScans::new(FrameFormat::Classic);
        for _ in 0..SCANS {
            // Three times, since it may be lost: a receiver believes in nobody without a heartbeat.
            for _ in 0..3 {
                transmitter.heartbeat(&scans.heartbeat());
                let _ = transmitter.pump(monotonic_ns());
            }
            transmitter.scan(&scans.scan()).unwrap();
            wait_for(SECONDS, || (transmitter.pump(monotonic_ns()).waiting == 0).then_some(())).unwrap();
        }
        let quiet = |listener: &Listener| listener.heard().frames.len();
        wait_for(SECONDS, || {
            let before = quiet(&listener);
            std::thread::sleep(Duration::from_millis(100));
            (before == quiet(&listener)).then_some(())
        });
        let heard = listener.heard();
        assert_no_mixture(&heard, &scans);
        let (whole, statistics) = (heard.scans().count(), heard.statistics());
        if loses {
            assert!(whole < SCANS && statistics.lost > 0, "{rules}: {whole} whole, {statistics:?}");
            assert!(whole > 0, "{rules}: {statistics:?}");
        } else {
            assert_eq!(whole, SCANS, "{rules}: {statistics:?}");
            assert!(statistics.repeated > 0, "{rules}: {statistics:?}");
        }
    }
}

fn assert_no_mixture(heard: &Heard, scans: &NumberedScans) {
    for scan in heard.scans() {
        let mut cells = scan.cells.clone();
        cells.sort_unstable();
        assert_eq!(cells, scans.cells_of(scan.scan_index), "scan {} is a mixture", scan.scan_index);
    }
}

/// As controllers send them to the kernel's listeners: see linux/can/error.h for the bits.
#[test]
fn error_frames_tell_the_condition_of_the_controller() {
    use ControllerState::{BusOff, ErrorActive, ErrorPassive, Warning};
    let interface = Interface::virtual_bus("vcan0");
    let mut bus = SocketCan::new(interface.name(), false);
    bus.open_now().unwrap();
    for (error_frame, controller) in [
        ("20000004#0008000000000000", Warning),
        ("20000004#0020000000000000", ErrorPassive),
        ("20000020#0000000000000000", ErrorPassive),
        ("20000040#0000000000000000", BusOff),
        ("20000100#0000000000000000", ErrorActive),
    ] {
        run(&format!("cansend vcan0 {error_frame}"));
        let told = wait_for(SECONDS, || {
            assert_eq!(bus.receive().unwrap(), None, "an error frame is none of the frames");
            (bus.condition().controller == controller).then_some(())
        });
        assert!(told.is_some(), "{error_frame}: {:?}", bus.condition());
    }
    let condition = bus.condition();
    assert_eq!((condition.no_acknowledgement, condition.restarts), (1, 1), "{condition:?}");
    assert_eq!(condition.errors, 4, "{condition:?}");
}
