//! What is true of the scan and not of a picture: too old, too late, too large. And nothing of it leaves anything behind.

use std::{fs, path::Path, time::Duration};

use fencepost_core::health::HealthReason;
use fencepost_guest_tests::{
    bus::{Listener, Word},
    loopback::Loopback,
    net::Interface,
    say,
};
use fencepost_hal::{camera::Sides, clock::monotonic_ns};

use super::{
    Feeder, LOOPBACK, PATIENCE, assert_no_free_cell, assert_said_in_time, open_writers, recorded_rig, rig, rig_with,
    start, synthetic, wait_for_heartbeat, wait_until_healthy,
};

/// Long enough for the detector on an emulated machine.
const PERIOD: Duration = Duration::from_millis(400);

/// The producer stops, and the camera is patient: it is the loop that finds that what it has is too old.
#[test]
fn pictures_that_grow_old_are_said_before_the_camera_gives_up() {
    const STALE: Duration = Duration::from_millis(1000);
    let settings = "[run]\ndeadline_ms = 10000\nstale_ms = 1000\npriority = 0\nhold_ms = 100\n";
    let bus = Interface::virtual_bus("vcan0");
    let _loopback = Loopback::load();
    let listener = Listener::open(bus.name());
    let feeder = Feeder::start(open_writers(), PERIOD);
    let camera = format!("{LOOPBACK}\ntimeout_ms = 4000");
    let program = start(&rig(bus.name(), settings, &camera));
    wait_until_healthy(&listener, &program, 0);
    // It writes its last pair before it ends.
    feeder.end();
    let old_ns = monotonic_ns() + STALE.as_nanos() as u64;
    let said_ns = assert_said_in_time(&listener, &program, HealthReason::StalePicture, (old_ns, PERIOD));
    std::thread::sleep(2 * PERIOD);
    assert_no_free_cell(&listener, said_ns, monotonic_ns(), "stale");
    let missing = listener.heard().words.iter().any(|(at_ns, word)| {
        let asked = (old_ns..=said_ns).contains(at_ns);
        matches!(word, Word::Heartbeat(heartbeat) if asked && heartbeat.health.has(HealthReason::MissingPicture))
    });
    assert!(!missing, "the camera has not given up yet: {}", program.said());
    let feeder = Feeder::start(open_writers(), PERIOD);
    wait_until_healthy(&listener, &program, monotonic_ns());
    program.stop(PATIENCE);
    feeder.end();
}

/// A bus on which scans take longer than they may, then one on which they do not; and a computer that is always too slow.
#[test]
fn scans_that_come_out_after_their_deadline_are_said() {
    const DEADLINE: Duration = Duration::from_millis(1500);
    let settings =
        |deadline_ms| format!("[run]\ndeadline_ms = {deadline_ms}\nstale_ms = 10000\npriority = 0\nhold_ms = 100\n");
    let bus = Interface::virtual_bus("vcan0");
    let listener = Listener::open(bus.name());
    let program = start(&recorded_rig(bus.name(), &settings(DEADLINE.as_millis()), true));
    wait_until_healthy(&listener, &program, 0);
    bus.disturb("delay 100ms limit 3");
    // Nothing can be late before its deadline is over.
    let due_ns = monotonic_ns() + DEADLINE.as_nanos() as u64;
    wait_for_heartbeat(&listener, &program, "late", due_ns - DEADLINE.as_nanos() as u64, |heartbeat| {
        heartbeat.health.has(HealthReason::Late)
    });
    assert_said_in_time(&listener, &program, HealthReason::Late, (due_ns, PERIOD));
    bus.undisturb();
    wait_until_healthy(&listener, &program, monotonic_ns());
    program.stop(PATIENCE);
    drop(listener);

    let listener = Listener::open(bus.name());
    let program = start(&recorded_rig(bus.name(), &settings(20), true));
    let first = wait_for_heartbeat(&listener, &program, "late is better than never", 0, |heartbeat| {
        heartbeat.last_scan.is_some()
    });
    let first_ns = first.as_nanos() as u64;
    assert_said_in_time(&listener, &program, HealthReason::Late, (first_ns, PERIOD));
    program.stop(PATIENCE);
}

/// Of pictures that have nothing in common there is nothing to tell, and room for all of it.
#[test]
fn a_map_that_does_not_fit_is_said_as_long_as_it_does_not() {
    let settings =
        "[run]\ndeadline_ms = 10000\nstale_ms = 10000\npriority = 0\nhold_ms = 100\n[wire]\nmax_cell_frames = 2\n";
    let bus = Interface::virtual_bus("vcan0");
    let _loopback = Loopback::load();
    let listener = Listener::open(bus.name());
    let feeder = Feeder::start(open_writers(), PERIOD);
    let camera = format!("{LOOPBACK}\ntimeout_ms = 4000");
    let program = start(&rig(bus.name(), settings, &camera));
    let truncated = |heartbeat: &fencepost_core::wire::HeartbeatRepr| heartbeat.health.has(HealthReason::MapTruncated);
    wait_for_heartbeat(&listener, &program, "map_truncated", 0, truncated);
    let unlike_ns = feeder.rewrite(Some(synthetic::unlike));
    wait_for_heartbeat(&listener, &program, "it fits", unlike_ns, |heartbeat| !truncated(heartbeat));
    // For some frames more nothing is told: only then there are cells again.
    let alike_ns = feeder.rewrite(None);
    let after = wait_for_heartbeat(&listener, &program, "alike", alike_ns, |heartbeat| {
        !heartbeat.health.has(HealthReason::LowCoverage)
    });
    let seen_ns = alike_ns + after.as_nanos() as u64;
    assert_said_in_time(&listener, &program, HealthReason::MapTruncated, (seen_ns, PERIOD));
    program.stop(PATIENCE);
    feeder.end();
}

/// Tiny pictures, so that it does not take long; of what they show not much can be made, and only the one reason is looked at.
#[test]
fn a_picture_that_freezes_fifty_times_costs_nothing() {
    const SMALL: (u32, u32) = (96, 64);
    const SHORT: Duration = Duration::from_millis(50);
    let settings =
        "[run]\ndeadline_ms = 10000\nstale_ms = 10000\npriority = 0\nhold_ms = 100\n[health]\nrelease_frames = 1\n";
    let calibration = Path::new("/tmp/small_calib.txt");
    fs::write(
        calibration,
        "P0: 262.5 0 47.5 0 0 262.5 31.5 0 0 0 1 0\nP1: 262.5 0 47.5 -31.5 0 262.5 31.5 0 0 0 1 0\n",
    )
    .unwrap();
    let camera = LOOPBACK.replace("320", "96").replace("240", "64");
    let bus = Interface::virtual_bus("vcan0");
    let _loopback = Loopback::load();
    let listener = Listener::open(bus.name());
    let feeder = Feeder::start_small(SMALL, SHORT);
    let program = start(&rig_with(bus.name(), settings, &format!("{camera}\ntimeout_ms = 4000"), calibration));
    let frozen = |heartbeat: &fencepost_core::wire::HeartbeatRepr| heartbeat.health.has(HealthReason::FrozenPicture);
    wait_for_heartbeat(&listener, &program, "scans", 0, |heartbeat| {
        heartbeat.last_scan.is_some() && !frozen(heartbeat)
    });
    let mut held = Vec::new();
    for _ in 0..50 {
        let frozen_ns = feeder.order(|camera| camera.set_frozen(Sides::Both));
        wait_for_heartbeat(&listener, &program, "frozen", frozen_ns, frozen);
        let healed_ns = feeder.order(|camera| camera.heal());
        wait_for_heartbeat(&listener, &program, "moving", healed_ns, |heartbeat| !frozen(heartbeat));
        held.push(program.resources());
    }
    let (first, last) = (held[4], held[49]);
    say!("{first:?} after 5 times, {last:?} after 50");
    assert_eq!((first.descriptors, first.threads), (last.descriptors, last.threads));
    assert!(last.resident_kib <= first.resident_kib + 256, "{first:?}, {last:?}");
    program.stop(PATIENCE);
    feeder.end();
}
