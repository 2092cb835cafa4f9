//! The live loop takes no memory after its start. In a program of its own: every thread of it is counted.

use std::{
    alloc::System,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
};

use fencepost::live::{self, PairPlan, Plan, RunSettings};
use fencepost_core::{settings::Settings, wire::WireConfig};
use fencepost_hal::{
    camera::{Camera, MemoryCamera, PacedCamera, StereoPair},
    can::{CanBus, VirtualBus},
    scene::{Scene, SceneOptions},
};
use stats_alloc::{INSTRUMENTED_SYSTEM, Stats, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// By then everything has happened once.
const WARM: u32 = 100;

/// Counts at two of its pairs.
struct Counting {
    camera: PacedCamera<MemoryCamera>,
    /// Takes a little memory with every pair, to see that it is noticed.
    planted: bool,
    last: u32,
    counts: Arc<Mutex<[Option<Stats>; 2]>>,
}

impl Camera for Counting {
    type Error = std::convert::Infallible;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error> {
        let Self { camera, planted, last, counts } = self;
        camera.next_pair(|pair| {
            if *planted {
                std::hint::black_box(Box::new(pair.sequence));
            }
            let place = match pair.sequence {
                WARM => Some(0),
                sequence if sequence == *last => Some(1),
                _ => None,
            };
            if let Some(place) = place {
                counts.lock().unwrap()[place] = Some(ALLOCATOR.stats());
            }
            consume(pair)
        })
    }
}

/// In place of the usual harness, which takes memory after a minute to say that a test takes long.
fn main() {
    const NAME: &str = "frames_take_no_memory_and_it_is_noticed_if_they_do";
    let mut filters = std::env::args().skip(1).filter(|argument| !argument.starts_with('-')).peekable();
    let is_meant = filters.peek().is_none() || filters.any(|filter| NAME.contains(&filter));
    println!("running {} test", u8::from(is_meant));
    if is_meant {
        frames_take_no_memory_and_it_is_noticed_if_they_do();
        println!("test {NAME} ... ok");
    }
    let [passed, filtered_out] = [is_meant, !is_meant].map(u8::from);
    println!("test result: ok. {passed} passed; 0 failed; 0 ignored; 0 measured; {filtered_out} filtered out");
}

/// Both in one: tests that run side by side would count each other's memory.
fn frames_take_no_memory_and_it_is_noticed_if_they_do() {
    for threads_per_pair in [1, 3] {
        let before_and_after = run(10_000, threads_per_pair, false);
        assert_eq!(before_and_after.allocations, 0, "something was allocated with {threads_per_pair} threads");
        assert_eq!(before_and_after.reallocations, 0, "something was allocated anew with {threads_per_pair} threads");
    }
    assert!(run(50, 1, true).allocations >= 50, "what was planted is not seen");
}

/// Runs the loop for `frames` pairs after it is warm, and tells what was allocated meanwhile.
fn run(frames: u32, threads_per_pair: u8, planted: bool) -> Stats {
    let options = SceneOptions { width: 96, height: 72, focal_px: 79.0, frames: 20, ..SceneOptions::default() };
    let memory = MemoryCamera::fill(&mut Scene::new(options).unwrap().into_camera());
    let counts = Arc::new(Mutex::new([None; 2]));
    let last = WARM + frames;
    let camera = PacedCamera::new(memory.repeated(last / 20 + 1), Some(std::time::Duration::ZERO));
    let mut settings = Settings::default();
    settings.matching.disparities = 16;
    let pair = PairPlan {
        name: "front".to_string(),
        camera: Counting { camera, planted, last, counts: Arc::clone(&counts) },
        calibration: options.calibration(),
        mount: options.mount(),
        settings,
        cpu: None,
        patience: std::time::Duration::from_secs(30),
    };
    let bus = VirtualBus::new(4000);
    let (node, mut listener) = (bus.attach(), bus.attach());
    let stop = AtomicBool::new(false);
    let done = AtomicBool::new(false);
    let settings = RunSettings { priority: 0, lock_memory: false, threads_per_pair, ..RunSettings::default() };
    let plan = Plan { pairs: vec![pair], wire: WireConfig::default(), settings, sector_width_deg: 5.0 };
    let (report, heard) = std::thread::scope(|scope| {
        let listening = scope.spawn(|| {
            let mut heard = 0_u64;
            loop {
                match listener.receive().unwrap() {
                    Some(_) => heard += 1,
                    None if done.load(Ordering::Relaxed) => return heard,
                    None => std::thread::sleep(std::time::Duration::from_millis(1)),
                }
            }
        });
        let report = live::run(plan, node, &stop, |_| ()).unwrap();
        done.store(true, Ordering::Relaxed);
        (report, listening.join().unwrap())
    });
    let [Some(before), Some(after)] = *counts.lock().unwrap() else { panic!("the frames did not come") };
    println!("{} scans, {heard} frames; {before:?} and {after:?}", report.bus.scans);
    assert!(report.pairs[0].frames > u64::from(frames));
    assert!(report.bus.scans > 0 && heard == report.bus.sent.frames);
    after - before
}
