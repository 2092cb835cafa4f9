//! Cameras that fail: said on the bus in time, and the program recovers by itself.

use std::{fs, path::Path, time::Duration};

use fencepost_core::{health::HealthReason, wire::HeartbeatRepr};
use fencepost_guest_tests::{
    bus::Listener,
    loopback::Loopback,
    net::Interface,
    program::Program,
    say,
    vivid::{self, Cameras, Controls},
};
use fencepost_hal::clock::monotonic_ns;

use super::{
    Feeder, LOOPBACK, PATIENCE, assert_nothing_free, assert_said_in_time, open_writers, rig, rig_with, start,
    wait_for_heartbeat, wait_until_healthy,
};

/// Tiny pictures, so that the detector keeps up with the virtual cameras on an emulated machine; of what they show nothing can
/// be made, so that only the reasons for missing pictures are looked at.
const VIVID: &str = "left = \"/dev/video0\"\nright = \"/dev/video1\"\nwidth = 64\nheight = 48\npairing_tolerance_ms = 9.0\n\
    format = \"GREY\"\ntimeout_ms = 50";
/// An emulated processor does not keep up with the pictures where it counts bits: the paper's plain matching does for these tests.
const SETTINGS: &str = "[run]\ndeadline_ms = 10000\nstale_ms = 10000\npriority = 0\nhold_ms = 100\n\
                        [matching]\ncost = \"absolute-differences\"\nwindow_width = 7\nwide_window_width = 0\n\
                        texture = 16\nuniqueness_percent = 8\n[validate]\nmin_surface_px = 200\n";
/// The cameras deliver 60 pictures a second, so that the limit is the 100 ms.
const PERIOD: Duration = Duration::from_millis(17);

/// What is done to the cameras.
type Act<'a> = &'a dyn Fn();

fn vivid_rig(interface: &str) -> String {
    let calibration = Path::new("/tmp/tiny_calib.txt");
    fs::write(calibration, "P0: 52 0 31.5 0 0 52 23.5 0 0 0 1 0\nP1: 52 0 31.5 -6.24 0 52 23.5 0 0 0 1 0\n").unwrap();
    rig_with(interface, SETTINGS, VIVID, calibration)
}

fn is_missing(heartbeat: &HeartbeatRepr) -> bool {
    heartbeat.health.has(HealthReason::MissingPicture)
}

fn wait_until_seeing(listener: &Listener, program: &Program, since_ns: u64) {
    wait_for_heartbeat(listener, program, "pictures again", since_ns, |heartbeat| {
        !is_missing(heartbeat) && heartbeat.last_scan.is_some()
    });
}

fn set_both(name: &str, value: i32) {
    for path in [vivid::LEFT, vivid::RIGHT] {
        Controls::of(path).set(name, value);
    }
}

#[test]
fn every_fault_that_a_camera_can_be_ordered_to_have_is_said_and_passes() {
    let bus = Interface::virtual_bus("vcan0");
    let cameras = Cameras::load();
    let listener = Listener::open(bus.name());
    let program = start(&vivid_rig(bus.name()));
    wait_until_seeing(&listener, &program, 0);
    let faults: [(&str, Act<'_>, Act<'_>); 6] = [
        ("damaged buffer", &|| set_both("inject_v4l2_buf_flag_error", 1), &|| ()),
        ("stall", &|| set_both("percentage_of_dropped_buffers", 100), &|| set_both("percentage_of_dropped_buffers", 0)),
        ("failure while streaming", &|| set_both("inject_fatal_streaming_error", 1), &|| ()),
        ("disconnect", &|| Controls::of(vivid::LEFT).set("disconnect", 1), &|| ()),
        ("unplug", &|| cameras.unplug(), &|| cameras.plug_in()),
        ("half of the pictures", &|| set_both("percentage_of_dropped_buffers", 50), &|| {
            set_both("percentage_of_dropped_buffers", 0)
        }),
    ];
    for (name, fault, mend) in faults {
        let since_ns = monotonic_ns();
        fault();
        say!("{name}");
        let said_ns = assert_said_in_time(&listener, &program, HealthReason::MissingPicture, (since_ns, PERIOD));
        mend();
        let mended_ns = monotonic_ns();
        assert_nothing_free(&listener, said_ns, mended_ns, name);
        wait_until_seeing(&listener, &program, mended_ns);
    }
    for control in ["wrap_sequence_number", "wrap_timestamp"] {
        set_both(control, 1);
        wait_until_seeing(&listener, &program, monotonic_ns() + 300_000_000);
    }
    program.stop(PATIENCE);
}

#[test]
fn a_producer_that_is_killed_is_missed_and_another_one_is_taken() {
    let bus = Interface::virtual_bus("vcan0");
    let _loopback = Loopback::load();
    let listener = Listener::open(bus.name());
    let period = Duration::from_millis(400);
    let feeder = Feeder::start(open_writers(), period);
    let camera = format!("{LOOPBACK}\ntimeout_ms = 600");
    let program = start(&rig(bus.name(), SETTINGS, &camera));
    wait_until_healthy(&listener, &program, 0);
    // It writes its last pair before it ends.
    feeder.end();
    let since_ns = monotonic_ns();
    let said_ns = assert_said_in_time(&listener, &program, HealthReason::MissingPicture, (since_ns, period));
    assert_nothing_free(&listener, said_ns, monotonic_ns(), "producer killed");
    let feeder = Feeder::start(open_writers(), period);
    wait_until_healthy(&listener, &program, monotonic_ns());
    program.stop(PATIENCE);
    feeder.end();
}

/// Over and over: nothing is left behind.
#[test]
fn a_camera_that_is_pulled_out_fifty_times_costs_nothing() {
    let bus = Interface::virtual_bus("vcan0");
    let cameras = Cameras::load();
    let listener = Listener::open(bus.name());
    let program = start(&vivid_rig(bus.name()));
    wait_until_seeing(&listener, &program, 0);
    let mut held = Vec::new();
    for _ in 0..50 {
        let since_ns = monotonic_ns();
        cameras.unplug();
        wait_for_heartbeat(&listener, &program, "missing", since_ns, is_missing);
        cameras.plug_in();
        wait_until_seeing(&listener, &program, monotonic_ns());
        held.push(program.resources());
    }
    let (first, last) = (held[4], held[49]);
    say!("{first:?} after 5 times, {last:?} after 50");
    assert_eq!((first.descriptors, first.threads), (last.descriptors, last.threads));
    assert!(last.resident_kib <= first.resident_kib + 256, "{first:?}, {last:?}");
    program.stop(PATIENCE);
}
