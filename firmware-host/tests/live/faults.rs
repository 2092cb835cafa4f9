//! Every fault is said on the bus, nothing is called free meanwhile, and it passes when its cause is gone.

use std::time::Duration;

use fencepost_core::{
    health::{HealthLevel, HealthReason},
    wire::{CommandEncoder, HeartbeatRepr, VehicleMotionRepr},
};
use fencepost_hal::{
    camera::{FaultyCamera, MemoryCamera, PacedCamera, Sides},
    can::{CanBus, CanFrame, VirtualBus},
};

use crate::{
    listener::{Listener, address, now_ns},
    rig::{OrderedCamera, Orders, Running, memory, options, pair, patient, start},
};

const SIZE: (u32, u32) = (160, 120);
const PERIOD: Duration = Duration::from_millis(60);

type Spoil = fn(&mut FaultyCamera<PacedCamera<MemoryCamera>>);

/// What pictures themselves show, and what has to be said then.
pub(crate) const SPOILT: [(HealthReason, Spoil); 10] = [
    (HealthReason::FrozenPicture, |camera| camera.set_frozen(Sides::Both)),
    (HealthReason::FrozenPicture, |camera| camera.set_frozen(Sides::Left)),
    (HealthReason::FrozenPicture, |camera| camera.set_frozen(Sides::Right)),
    (HealthReason::Underexposed, |camera| camera.set_dark(Sides::Both)),
    (HealthReason::Overexposed, |camera| camera.set_saturated(Sides::Both)),
    (HealthReason::Blocked, |camera| camera.set_covered(Sides::Left, 100)),
    (HealthReason::Blocked, |camera| camera.set_covered(Sides::Right, 100)),
    (HealthReason::Blocked, |camera| camera.set_covered(Sides::Both, 100)),
    (HealthReason::BadlyRectified, |camera| camera.set_row_shift(3)),
    (HealthReason::Exchanged, |camera| camera.set_exchanged(true)),
];

struct Setup {
    bus: VirtualBus,
    listener: Listener,
    orders: Orders,
    running: Running,
    healthy_ns: u64,
}

fn healthy() -> Setup {
    healthy_with(patient())
}

fn healthy_with(settings: fencepost::live::RunSettings) -> Setup {
    let options = options(SIZE.0, SIZE.1, 8);
    let bus = VirtualBus::new(10_000);
    let listener = Listener::on(&bus);
    let camera = OrderedCamera::new(memory(options).repeated(u32::MAX), SIZE, Some(PERIOD));
    let orders = camera.orders();
    let running = start(vec![pair("front", camera, &options, options.mount())], settings, &bus);
    let healthy_ns = listener.wait_until_healthy(0);
    Setup { bus, listener, orders, running, healthy_ns }
}

fn wait_for(what: &str, mut condition: impl FnMut() -> bool) {
    let start = std::time::Instant::now();
    while !condition() {
        assert!(start.elapsed() < crate::listener::PATIENCE, "{what} did not happen");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn pictures_that_do_not_come_are_missing_and_then_stale() {
    let Setup { listener, orders, running, .. } =
        healthy_with(fencepost::live::RunSettings { stale_ms: 400, ..patient() });
    for kind in ["stall", "lost", "damaged"] {
        let before_ns = now_ns();
        orders.give(move |camera| match kind {
            "stall" => camera.set_stall(20),
            "lost" => camera.set_lost(20),
            _ => camera.set_damaged(20),
        });
        let (at_ns, heartbeat) = listener.wait_for_reason(HealthReason::MissingPicture, before_ns);
        let expected = if kind == "lost" { HealthLevel::Fault } else { HealthLevel::Blind };
        assert_eq!(heartbeat.health.level, expected, "{kind}");
        let (stale_ns, _) = listener.wait_for_reason(HealthReason::StalePicture, at_ns);
        assert_eq!(listener.scans(at_ns, stale_ns), [], "{kind}: nothing new was seen");
        listener.wait_until_healthy(stale_ns);
    }
    let report = running.stop();
    assert_eq!((report.pairs[0].no_picture, report.pairs[0].lost, report.pairs[0].damaged), (20, 20, 20));
}

#[test]
fn a_frame_that_takes_too_long_is_late() {
    let settings = fencepost::live::RunSettings { deadline_ms: 1000, ..patient() };
    let Setup { listener, running, healthy_ns, orders, .. } = healthy_with(settings);
    // Exposed so long before they arrive that they are late, but not stale.
    orders.give(|camera| camera.set_time_offset(-1_400_000_000));
    listener.wait_for_reason(HealthReason::Late, healthy_ns);
    orders.give(|camera| camera.heal());
    let healed_ns = now_ns();
    listener.wait_until_healthy(healed_ns);
    let report = running.stop();
    assert!(report.bus.late > 0);
}

#[test]
fn a_full_queue_abandons_scans_but_lets_every_heartbeat_through() {
    let Setup { mut listener, running, .. } = healthy();
    let before_ns = now_ns();
    running.bus.full_for(3000);
    let (trouble_ns, _) = listener.wait_for_reason(HealthReason::BusTrouble, before_ns);
    listener.wait_until_healthy(trouble_ns);
    let report = running.stop();
    println!("{:?}", report.bus);
    assert!(report.bus.sent.abandoned_scans > 0);
    let statistics = listener.finish();
    assert_eq!((statistics.crc_errors, statistics.refused), (0, 0));
    assert_eq!(u64::from(statistics.scans), report.bus.sent.whole_scans, "no mixed scan was taken over");
}

#[test]
fn a_bus_that_goes_and_comes_is_told_of_when_it_is_back() {
    let Setup { listener, running, .. } = healthy();
    for fault in ["down", "gone", "passive", "bus-off"] {
        let before_ns = now_ns();
        let lasts_ns = 200_000_000;
        match fault {
            "down" => running.bus.down_for(lasts_ns),
            "gone" => running.bus.gone_for(lasts_ns),
            "passive" => running.bus.passive_for(lasts_ns),
            _ => running.bus.bus_off_for(lasts_ns),
        }
        let (trouble_ns, _) = listener.wait_for_reason(HealthReason::BusTrouble, before_ns);
        println!("{fault}: said after {:.0} ms", (trouble_ns - before_ns) as f64 * 1.0e-6);
        listener.wait_until_healthy(trouble_ns);
    }
    running.stop();
}

#[test]
fn a_controller_that_stops_is_missed() {
    // So long that a controller that works is never missed, however slowly this thread gets on.
    let settings = fencepost::live::RunSettings { command_timeout_ms: 1500, echo_timeout_ms: 2000, ..patient() };
    let Setup { bus, listener, running, healthy_ns, .. } = healthy_with(settings);
    let mut controller = bus.attach();
    let mut encoder = CommandEncoder::new(address());
    let mut send = |frame: fencepost_core::wire::Frame, damaged: bool| {
        let can = CanFrame::new(frame.id(), frame.data(), false).unwrap();
        let can = if damaged { can.map_data(|data| data[2] ^= 1) } else { can };
        controller.send(&can, now_ns()).unwrap();
    };
    let motion = VehicleMotionRepr { speed_mm_per_s: Some(500), yaw_rate_cdeg_per_s: Some(0) };
    let newest = || listener.heartbeats().last().and_then(|(_, heartbeat)| heartbeat.last_scan).unwrap();
    let mut speak = |echo: u16| {
        send(encoder.vehicle_motion(&motion), false);
        send(encoder.scan_echo(echo), false);
        std::thread::sleep(Duration::from_millis(25));
    };
    // A controller that works.
    for _ in 0..40 {
        speak(newest());
    }
    let spoke_ns = now_ns();
    let spoken = listener.heartbeats().into_iter().filter(|(at_ns, _)| (healthy_ns..spoke_ns).contains(at_ns));
    for (_, heartbeat) in spoken {
        assert!(!heartbeat.health.has(HealthReason::EchoMissing), "{heartbeat:?}");
    }
    let said = |since_ns: u64, wanted: &dyn Fn(&HeartbeatRepr) -> bool| {
        listener.heartbeats().iter().any(|(at_ns, heartbeat)| *at_ns >= since_ns && wanted(heartbeat))
    };
    // It repeats its last echo: that is no sign of life.
    let last = newest();
    let hangs_ns = now_ns();
    wait_for("a missing echo", || {
        speak(last);
        said(hangs_ns, &|heartbeat| heartbeat.health.has(HealthReason::EchoMissing))
    });
    // It is silent.
    let silent_ns = now_ns();
    listener.wait_for_reason(HealthReason::CommandTrouble, silent_ns);
    // It is back, and goes on speaking.
    let back_ns = now_ns();
    wait_for("health after it is back", || {
        speak(newest());
        said(back_ns, &|heartbeat| heartbeat.health.level == HealthLevel::Ok)
    });
    // A damaged message.
    let damaged_ns = now_ns();
    send(encoder.vehicle_motion(&motion), true);
    listener.wait_for_reason(HealthReason::CommandTrouble, damaged_ns);
    let report = running.stop();
    assert_eq!(report.bus.commands.crc_errors, 1);
}

/// Content faults: what the pictures themselves show.
#[test]
fn spoilt_pictures_are_said_and_nothing_is_free_in_them() {
    let Setup { listener, orders, running, .. } = healthy();
    for (reason, spoil) in SPOILT {
        let before_ns = now_ns();
        orders.give(spoil);
        let (said_ns, _) = listener.wait_for_reason(reason, before_ns);
        let ordered_ns = orders.carried_out_ns().unwrap();
        // The first spoilt picture comes with the order; two frames are allowed until it is said.
        let unsaid = listener.scans(ordered_ns, said_ns);
        println!("{}: said after {} scans", reason.name(), unsaid.len());
        assert!(unsaid.len() <= 2, "{}: {} scans went out before it was said", reason.name(), unsaid.len());
        std::thread::sleep(3 * PERIOD);
        let until_ns = now_ns();
        for scan in listener.scans(said_ns, until_ns) {
            assert_eq!(scan.free, [], "{}: free cells in scan {}", reason.name(), scan.scan_index);
            assert!(scan.health >= HealthLevel::Blind, "{}: {:?}", reason.name(), scan.health);
        }
        orders.give(|camera| camera.heal());
        listener.wait_until_healthy(until_ns);
    }
    running.stop();
}
