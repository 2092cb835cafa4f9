//! Buses that fail under the program, and a controller that is silent.

use std::time::Duration;

use fencepost_core::{
    health::HealthReason,
    wire::{Address, CommandEncoder, VehicleMotionRepr},
};
use fencepost_guest_tests::{
    bus::{Listener, Speaker},
    machine::{on_first_processor, run, wait_for},
    net::{ControllerPair, Interface},
    program::Program,
    say,
};
use fencepost_hal::{can::CanFrame, clock::monotonic_ns};

use super::{PATIENCE, assert_said_in_time, start, wait_for_heartbeat, wait_until_healthy};

const SETTINGS: &str = "[run]\ndeadline_ms = 10000\nstale_ms = 10000\npriority = 0\nhold_ms = 300\n";
const PERIOD: Duration = Duration::from_millis(400);

fn recorded_rig(interface: &str) -> String {
    super::recorded_rig(interface, SETTINGS, true)
}

/// The bus cannot carry the news while it is down: it hears them as soon as it is back.
fn assert_said_when_back(listener: &Listener, program: &Program, back_ns: u64, what: &str) {
    say!("{what}");
    let said_ns = assert_said_in_time(listener, program, HealthReason::BusTrouble, (back_ns, PERIOD));
    wait_until_healthy(listener, program, said_ns);
}

#[test]
fn an_interface_that_goes_down_or_away_is_told_of_when_it_is_back() {
    let bus = Interface::virtual_bus("vcan0");
    let listener = Listener::open(bus.name());
    let program = start(&recorded_rig(bus.name()));
    wait_until_healthy(&listener, &program, 0);
    for round in 0..2 {
        if round == 0 {
            bus.down()
        } else {
            bus.take_away()
        }
        std::thread::sleep(Duration::from_millis(700));
        if round == 0 {
            bus.up()
        } else {
            bus.bring_back()
        }
        let back_ns = monotonic_ns();
        assert_said_when_back(&listener, &program, back_ns, if round == 0 { "down" } else { "gone" });
    }
    program.stop(PATIENCE);
}

#[test]
fn a_controller_that_is_pulled_out_is_used_again() {
    on_first_processor();
    let pair = ControllerPair::classic();
    let listener = Listener::open(pair.b.name());
    let program = start(&recorded_rig(pair.a.name()));
    wait_until_healthy(&listener, &program, 0);
    pair.a.take_away();
    std::thread::sleep(Duration::from_millis(700));
    pair.a.bring_back();
    assert_said_when_back(&listener, &program, monotonic_ns(), "controller unbound");
    program.stop(PATIENCE);
}

#[test]
fn a_queue_that_is_full_costs_scans_and_not_heartbeats() {
    let bus = Interface::virtual_bus("vcan0");
    let listener = Listener::open(bus.name());
    let program = start(&recorded_rig(bus.name()));
    wait_until_healthy(&listener, &program, 0);
    bus.disturb("delay 100ms limit 3");
    let since_ns = monotonic_ns();
    // Heartbeats wait for the three frames in the queue at most.
    say!("full queue");
    assert_said_in_time(&listener, &program, HealthReason::BusTrouble, (since_ns, PERIOD));
    wait_for(PATIENCE, || (listener.heard().statistics().abandoned_scans > 0).then_some(()));
    let abandoned = listener.heard().statistics().abandoned_scans;
    bus.undisturb();
    wait_until_healthy(&listener, &program, monotonic_ns());
    assert!(abandoned > 0 || listener.heard().statistics().abandoned_scans > 0);
    program.stop(PATIENCE);
}

#[test]
fn frames_that_are_lost_or_doubled_on_the_way_never_make_a_wrong_scan() {
    let bus = Interface::virtual_bus("vcan0");
    let listener = Listener::open(bus.name());
    let program = start(&recorded_rig(bus.name()));
    wait_until_healthy(&listener, &program, 0);
    for rules in ["loss 10%", "duplicate 20%"] {
        bus.disturb(rules);
        std::thread::sleep(Duration::from_secs(3));
        bus.undisturb();
        wait_until_healthy(&listener, &program, monotonic_ns());
    }
    let statistics = listener.heard().statistics();
    say!("{statistics:?}");
    assert!(statistics.lost > 0 && statistics.repeated > 0, "{statistics:?}");
    assert_eq!((statistics.crc_errors, statistics.refused), (0, 0), "{statistics:?}");
    program.stop(PATIENCE);
}

#[test]
fn error_frames_are_understood() {
    let bus = Interface::virtual_bus("vcan0");
    let listener = Listener::open(bus.name());
    let program = start(&recorded_rig(bus.name()));
    wait_until_healthy(&listener, &program, 0);
    // As the kernel has them (linux/can/error.h): controller error-passive, no acknowledgement, and bus-off with its restart.
    for (name, frames) in [
        ("error-passive", &["20000004#0020000000000000", "20000004#0040000000000000"][..]),
        ("no acknowledgement", &["20000020#0000000000000000"]),
        ("bus-off", &["20000040#0000000000000000", "20000100#0000000000000000"]),
    ] {
        let since_ns = monotonic_ns();
        for frame in frames {
            run(&format!("cansend {} {frame}", bus.name()));
        }
        say!("{name}");
        let said_ns = assert_said_in_time(&listener, &program, HealthReason::BusTrouble, (since_ns, PERIOD));
        wait_until_healthy(&listener, &program, said_ns);
    }
    program.stop(PATIENCE);
}

#[test]
fn a_controller_that_stops_to_echo_is_missed() {
    let bus = Interface::virtual_bus("vcan0");
    let listener = Listener::open(bus.name());
    // Patient enough for whoever echoes on an emulated machine.
    let settings = format!("{SETTINGS}echo_timeout_ms = 3000\n");
    let program = start(&super::recorded_rig(bus.name(), &settings, true));
    wait_until_healthy(&listener, &program, 0);
    let speaker = Speaker::open(bus.name());
    let mut encoder = CommandEncoder::new(Address::default());
    let motion = VehicleMotionRepr { speed_mm_per_s: Some(500), yaw_rate_cdeg_per_s: Some(0) };
    let send = |frame: fencepost_core::wire::Frame| {
        speaker.send(&CanFrame::new(frame.id(), frame.data(), false).unwrap()).unwrap();
    };
    let start_ns = monotonic_ns();
    for _ in 0..60 {
        send(encoder.vehicle_motion(&motion));
        let newest = listener.heard().scans().last().map(|scan| scan.scan_index);
        if let Some(newest) = newest {
            send(encoder.scan_echo(newest));
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    let end_ns = monotonic_ns();
    let silent = |heartbeat: &fencepost_core::wire::HeartbeatRepr| heartbeat.health.has(HealthReason::EchoMissing);
    let before = listener.first_heartbeat(start_ns, Duration::ZERO, silent);
    assert!(before.is_none_or(|after| start_ns + after.as_nanos() as u64 > end_ns), "not missed while it speaks");
    let took = wait_for_heartbeat(&listener, &program, "echo_missing", end_ns, silent);
    say!("echo missed after {} ms", took.as_millis());
    let took = wait_for_heartbeat(&listener, &program, "command_trouble", end_ns, |heartbeat| {
        heartbeat.health.has(HealthReason::CommandTrouble)
    });
    say!("commands missed after {} ms", took.as_millis());
    program.stop(PATIENCE);
}

#[test]
fn a_bus_that_goes_fifty_times_costs_nothing() {
    let bus = Interface::virtual_bus("vcan0");
    let listener = Listener::open(bus.name());
    let program = start(&recorded_rig(bus.name()));
    wait_until_healthy(&listener, &program, 0);
    let mut held = Vec::new();
    for round in 0..50 {
        if round % 2 == 0 {
            bus.down()
        } else {
            bus.take_away()
        }
        std::thread::sleep(Duration::from_millis(100));
        if round % 2 == 0 {
            bus.up()
        } else {
            bus.bring_back()
        }
        let back_ns = monotonic_ns();
        wait_for_heartbeat(&listener, &program, "back", back_ns, |_| true);
        held.push(program.resources());
    }
    let (first, last) = (held[4], held[49]);
    say!("{first:?} after 5 times, {last:?} after 50");
    assert_eq!((first.descriptors, first.threads), (last.descriptors, last.threads));
    assert!(last.resident_kib <= first.resident_kib + 256, "{first:?}, {last:?}");
    wait_until_healthy(&listener, &program, monotonic_ns());
    program.stop(PATIENCE);
}
