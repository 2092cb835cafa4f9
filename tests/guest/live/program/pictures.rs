//! What is wrong with the pictures themselves is said on the bus.

use std::time::Duration;

use fencepost_core::health::HealthReason;
use fencepost_guest_tests::{bus::Listener, loopback::Loopback, net::Interface};
use fencepost_hal::{
    camera::{FaultyCamera, MemoryCamera, PacedCamera, Sides},
    clock::monotonic_ns,
};

use super::{
    Feeder, LOOPBACK, assert_no_free_cell, assert_nothing_free, assert_said_in_time, feeder::Rewrite, open_writers,
    rig, start, synthetic, wait_until_healthy,
};

/// Long enough for the detector on an emulated machine.
const PERIOD: Duration = Duration::from_millis(400);
/// An emulated processor does not keep up with the pictures where it counts bits: the paper's plain matching does for these tests.
const SETTINGS: &str = "[run]\ndeadline_ms = 10000\nstale_ms = 10000\npriority = 0\nhold_ms = 100\n\
                        [matching]\ncost = \"absolute-differences\"\nwindow_width = 7\nwide_window_width = 0\n\
                        texture = 16\nuniqueness_percent = 8\n[validate]\nmin_surface_px = 200\n";

type Spoil = fn(&mut FaultyCamera<PacedCamera<MemoryCamera>>);

const SPOILT: [(HealthReason, Spoil); 8] = [
    (HealthReason::FrozenPicture, |camera| camera.set_frozen(Sides::Both)),
    (HealthReason::FrozenPicture, |camera| camera.set_frozen(Sides::Right)),
    (HealthReason::Underexposed, |camera| camera.set_dark(Sides::Both)),
    (HealthReason::Overexposed, |camera| camera.set_saturated(Sides::Both)),
    (HealthReason::Blocked, |camera| camera.set_covered(Sides::Left, 100)),
    (HealthReason::BadlyPaired, |camera| camera.set_right_lag(2)),
    (HealthReason::BadlyRectified, |camera| camera.set_row_shift(3)),
    (HealthReason::Exchanged, |camera| camera.set_exchanged(true)),
];

#[test]
fn spoilt_pictures_are_said_and_nothing_is_free_in_them() {
    let bus = Interface::virtual_bus("vcan0");
    let _loopback = Loopback::load();
    let listener = Listener::open(bus.name());
    let feeder = Feeder::start(open_writers(), PERIOD);
    let camera = format!("{LOOPBACK}\ntimeout_ms = 4000");
    let program = start(&rig(bus.name(), SETTINGS, &camera));
    let mut since_ns = 0;
    for (reason, spoil) in SPOILT {
        wait_until_healthy(&listener, &program, since_ns);
        let spoilt_ns = feeder.order(spoil);
        let said_ns = assert_said_in_time(&listener, &program, reason, (spoilt_ns, PERIOD));
        std::thread::sleep(2 * PERIOD);
        let until_ns = monotonic_ns();
        assert_nothing_free(&listener, said_ns, until_ns, reason.name());
        since_ns = feeder.order(|camera| camera.heal());
    }
    wait_until_healthy(&listener, &program, since_ns);
    program.stop(super::PATIENCE);
    feeder.end();
}

/// What no camera can be blamed for. The ground of before is held for two frames.
#[test]
fn pictures_of_which_nothing_can_be_made_are_said() {
    let bus = Interface::virtual_bus("vcan0");
    let _loopback = Loopback::load();
    let listener = Listener::open(bus.name());
    let feeder = Feeder::start(open_writers(), PERIOD);
    let camera = format!("{LOOPBACK}\ntimeout_ms = 4000");
    let settings = format!("{SETTINGS}[ground]\nhold_frames = 2\n");
    let program = start(&rig(bus.name(), &settings, &camera));
    let spoilt: [(HealthReason, Rewrite, u32); 4] = [
        (HealthReason::LowCoverage, synthetic::unlike, 0),
        (HealthReason::NearZoneBlocked, synthetic::too_near, 0),
        (HealthReason::GroundHeld, synthetic::upside_down, 0),
        (HealthReason::NoGround, synthetic::upside_down, 2),
    ];
    let mut since_ns = 0;
    for (reason, rewrite, later) in spoilt {
        wait_until_healthy(&listener, &program, since_ns);
        let spoilt_ns = feeder.rewrite(Some(rewrite)) + u64::from(later) * PERIOD.as_nanos() as u64;
        let said_ns = assert_said_in_time(&listener, &program, reason, (spoilt_ns, PERIOD));
        std::thread::sleep(2 * PERIOD);
        if reason == HealthReason::LowCoverage {
            assert_nothing_free(&listener, said_ns, monotonic_ns(), reason.name());
        }
        assert_no_free_cell(&listener, said_ns, monotonic_ns(), reason.name());
        since_ns = feeder.rewrite(None);
    }
    wait_until_healthy(&listener, &program, since_ns);
    program.stop(super::PATIENCE);
    feeder.end();
}
