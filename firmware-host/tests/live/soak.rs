//! An hour of pictures at ten a second, as fast as they can be looked at, with faults at random from a seed: every fault is
//! said, nothing hangs, nothing is lost on the way, and the end is as good as the beginning.

use std::time::Duration;

use fencepost::live::RunSettings;
use fencepost_core::health::{HealthLevel, HealthReason};
use fencepost_hal::can::VirtualBus;

use crate::{
    faults::SPOILT,
    listener::{Listener, names, now_ns},
    rig::{OrderedCamera, memory, options, pair, patient, start},
};

const SEED: u64 = 20_261_122;
/// An hour at ten pairs a second.
const FRAMES: u64 = 36_000;
const SIZE: (u32, u32) = (96, 72);

/// SplitMix64 (Steele, Lea, Flood 2014).
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) % limit
    }
}

/// Resident memory in KiB and open descriptors of this process.
#[cfg(target_os = "linux")]
fn resources() -> (u64, usize) {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    let kib = resident.trim().trim_end_matches(" kB").parse().unwrap();
    (kib, std::fs::read_dir("/proc/self/fd").unwrap().count())
}

#[cfg(not(target_os = "linux"))]
fn resources() -> (u64, usize) {
    (0, 0)
}

#[test]
fn an_hour_of_pictures_with_faults_at_random() {
    println!("seed {SEED}");
    let mut random = Random(SEED);
    let options = options(SIZE.0, SIZE.1, 40);
    // All of it is in use long before the memory is looked at.
    let bus = VirtualBus::new(4000);
    let mut listener = Listener::forgetful_on(&bus);
    // No pause between the pairs.
    let camera = OrderedCamera::new(memory(options).repeated(u32::MAX), SIZE, Some(Duration::ZERO));
    let orders = camera.orders();
    // Held for some heartbeats, so that one of them goes out meanwhile whatever else the machine does.
    let settings = RunSettings { hold_ms: 150, ..patient() };
    let mut plan = pair("front", camera, &options, options.mount());
    plan.settings.matching.disparities = 16;
    let running = start(vec![plan], settings, &bus);
    listener.wait_until_healthy(0);

    let mut said = std::collections::BTreeMap::<&str, u32>::new();
    let mut before = None;
    while orders.delivered() < FRAMES {
        listener.forget();
        // A while without faults.
        std::thread::sleep(Duration::from_millis(50 + random.below(400)));
        let fault_ns = now_ns();
        let reason = match random.below(8) {
            0 => {
                running.bus.down_for(5_000_000 + random.below(60_000_000));
                HealthReason::BusTrouble
            }
            1 => {
                running.bus.gone_for(5_000_000 + random.below(60_000_000));
                HealthReason::BusTrouble
            }
            2 => {
                // Frames go into it in silence: so long that somebody looks at the controller meanwhile, on a busy machine as well.
                running.bus.bus_off_for(200_000_000 + random.below(200_000_000));
                HealthReason::BusTrouble
            }
            kind @ 3..=5 => {
                let calls = 5 + random.below(20) as u32;
                orders.give(move |camera| match kind {
                    3 => camera.set_stall(calls),
                    4 => camera.set_lost(calls),
                    _ => camera.set_damaged(calls),
                });
                HealthReason::MissingPicture
            }
            _ => {
                let (reason, spoil) = SPOILT[random.below(SPOILT.len() as u64) as usize];
                orders.give(spoil);
                reason
            }
        };
        let (said_ns, _) = listener.wait_for_reason(reason, fault_ns);
        *said.entry(reason.name()).or_default() += 1;
        orders.give(|camera| camera.heal());
        listener.wait_until_healthy(said_ns);
        // By then everything that is needed has been taken.
        if before.is_none() && orders.delivered() > FRAMES / 10 {
            before = Some(resources());
        }
    }
    let after = resources();
    let (_, last) = *listener.heartbeats().last().unwrap();
    assert_eq!(last.health.level, HealthLevel::Ok, "{:?}", names(&last));
    assert_eq!(listener.bad(), 0);
    let report = running.stop();
    let statistics = listener.finish();
    println!("{} pairs; faults said: {said:?}\n{:?}\n{statistics:?}", orders.delivered(), report.bus);
    assert!(report.pairs[0].frames >= FRAMES);
    assert_eq!(u64::from(statistics.scans), report.bus.sent.whole_scans);
    let (kib, descriptors) = before.unwrap();
    println!("memory {kib} KiB before, {} KiB after; descriptors {descriptors} and {}", after.0, after.1);
    assert!(after.0 <= kib + 2048, "memory grows");
    assert_eq!(after.1, descriptors, "descriptors are left open");
}
