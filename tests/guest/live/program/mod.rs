//! The program as a user runs it, from real V4L2 devices to real CAN drivers.

mod buses;
mod cameras;
mod parity;
mod pictures;

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use fencepost_core::{
    health::{Health, HealthLevel, HealthReason},
    picture::Picture,
    wire::{HeartbeatRepr, NodeState},
};
use fencepost_guest_tests::{bus::Listener, device::Writer, loopback, machine::wait_for, program::Program, say};
use fencepost_hal::{
    camera::{Camera, FaultyCamera, MemoryCamera, PacedCamera, StereoPair},
    clock::monotonic_ns,
    recording::Recording,
};

/// Longest wait for anything under emulation; never a result.
const PATIENCE: Duration = Duration::from_secs(20);
/// Size of the pictures of the committed recording.
const SIZE: (u32, u32) = (320, 240);

/// The committed recording of the scene renderer.
fn trail() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../recordings/trail")
}

fn trail_pictures() -> MemoryCamera {
    MemoryCamera::fill(&mut Recording::open(trail()).unwrap().into_camera())
}

/// Cameras of a rig: two loopback devices.
const LOOPBACK: &str =
    "left = \"/dev/video10\"\nright = \"/dev/video11\"\nwidth = 320\nheight = 240\npairing_tolerance_ms = 60.0";

/// Writes the file of a rig with the mount and the calibration of the committed recording.
fn rig(interface: &str, sections: &str, camera: &str) -> String {
    rig_with(interface, sections, camera, &trail().join("calib.txt"))
}

fn rig_with(interface: &str, sections: &str, camera: &str, calibration: &Path) -> String {
    let text = format!(
        "[bus]\ninterface = \"{interface}\"\n{sections}\n[[pair]]\ncalibration = [\"{}\"]\n[pair.mount]\nheight_m = 1.1\n\
         pitch_down_deg = 10.0\n[pair.camera]\n{camera}\n",
        calibration.display()
    );
    let path = "/tmp/rig.toml";
    fs::write(path, text).unwrap();
    path.to_string()
}

/// A rig that plays the committed recording without any camera: where it is the bus that is tried.
fn recorded_rig(interface: &str, sections: &str, repeat: bool) -> String {
    let path = "/tmp/recorded_rig.toml";
    let text = format!(
        "[bus]\ninterface = \"{interface}\"\n{sections}\n[[pair]]\n[pair.recording]\npath = \"{}\"\nrepeat = {repeat}\n\
         rate_hz = 2.5\n",
        trail().display()
    );
    fs::write(path, text).unwrap();
    path.to_string()
}

fn start(rig: &str) -> Program {
    Program::start(&format!("run --config {rig} -v"))
}

/// A grey pair before which nothing can be seen: a loopback device must have been written to before it can be read.
fn write_nothing(writers: &mut [Writer; 2]) {
    let grey = vec![128; writers[0].size()];
    writers.iter_mut().for_each(|writer| writer.write(&grey));
}

fn open_writers() -> [Writer; 2] {
    [loopback::LEFT, loopback::RIGHT].map(|path| Writer::open(path, *b"GREY", SIZE.0, SIZE.1))
}

fn write_pair(writers: &mut [Writer; 2], pair: &StereoPair<'_>) {
    let pixels =
        |picture: &Picture<'_>| (0..picture.height()).flat_map(|y| picture.row(y)).copied().collect::<Vec<_>>();
    writers[0].write(&pixels(&pair.left));
    writers[1].write(&pixels(&pair.right));
}

type Faulty = FaultyCamera<PacedCamera<MemoryCamera>>;
type Order = Box<dyn FnOnce(&mut Faulty) + Send>;

/// Writes the committed recording to the loopback devices over and over, spoilt to order.
struct Feeder {
    orders: Arc<Mutex<(Option<Order>, u64)>>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Feeder {
    /// Pictures every `period`.
    fn start(mut writers: [Writer; 2], period: Duration) -> Self {
        write_nothing(&mut writers);
        let paced = PacedCamera::new(trail_pictures().repeated(u32::MAX), Some(period));
        let mut camera = FaultyCamera::new(paced, (SIZE.0 as usize, SIZE.1 as usize), 3, 1);
        let orders: Arc<Mutex<(Option<Order>, u64)>> = Arc::default();
        let end = Arc::new(AtomicBool::new(false));
        let (taken, ended) = (Arc::clone(&orders), Arc::clone(&end));
        let thread = thread::spawn(move || {
            while !ended.load(Ordering::Relaxed) {
                let order = lock(&taken).0.take();
                let ordered = order.map(|order| order(&mut camera)).is_some();
                // A pair that is kept back is an error here, and simply does not come there.
                let _ = camera.next_pair(|pair| {
                    if ordered {
                        lock(&taken).1 = monotonic_ns();
                    }
                    write_pair(&mut writers, pair);
                });
            }
        });
        Self { orders, end, thread: Some(thread) }
    }

    /// From the next pair on; returns when that pair has been written: the time just before.
    fn order(&self, order: impl FnOnce(&mut Faulty) + Send + 'static) -> u64 {
        *lock(&self.orders) = (Some(Box::new(order)), 0);
        wait_for(PATIENCE, || Some(lock(&self.orders).1).filter(|at_ns| *at_ns > 0)).expect("the order is carried out")
    }

    /// The other end of both devices is closed.
    fn end(mut self) {
        self.finish();
    }

    fn finish(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // What it panicked with was printed already.
            let _ = thread.join();
        }
    }
}

impl Drop for Feeder {
    fn drop(&mut self) {
        self.finish();
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn is_healthy(heartbeat: &HeartbeatRepr) -> bool {
    heartbeat.state == NodeState::Running && heartbeat.health == Health::OK
}

fn names(health: Health) -> String {
    let names: Vec<_> = HealthReason::ALL.into_iter().filter(|r| health.has(*r)).map(HealthReason::name).collect();
    names.join(" ")
}

/// Waits for a heartbeat; says what was heard instead if none comes.
fn wait_for_heartbeat(
    listener: &Listener,
    program: &Program,
    what: &str,
    since_ns: u64,
    wanted: impl Fn(&HeartbeatRepr) -> bool,
) -> Duration {
    listener.first_heartbeat(since_ns, PATIENCE, wanted).unwrap_or_else(|| {
        let heard = listener.heard();
        let last = heard.words.iter().rev().find_map(|(_, word)| match word {
            fencepost_guest_tests::bus::Word::Heartbeat(heartbeat) => Some(*heartbeat),
            _ => None,
        });
        let reasons = last.map(|last| names(last.health));
        panic!("{what}: not said; the last heartbeat is {last:?} ({reasons:?}); the program said:\n{}", program.said())
    })
}

fn wait_until_healthy(listener: &Listener, program: &Program, since_ns: u64) -> Duration {
    wait_for_heartbeat(listener, program, "healthy", since_ns, is_healthy)
}

/// The reason must be said within two frame periods or 100 ms, whichever is longer, of the guest's time; and from then on no
/// scan calls anything free, until `until_ns`.
fn assert_said_in_time(
    listener: &Listener,
    program: &Program,
    reason: HealthReason,
    (since_ns, period): (u64, Duration),
) -> u64 {
    let took = wait_for_heartbeat(listener, program, reason.name(), since_ns, |heartbeat| heartbeat.health.has(reason));
    let limit = (2 * period).max(Duration::from_millis(100));
    say!("{}: said after {} ms of {} allowed", reason.name(), took.as_millis(), limit.as_millis());
    assert!(took <= limit, "{}: said after {took:?}, {limit:?} is allowed", reason.name());
    since_ns + took.as_nanos() as u64
}

fn assert_nothing_free(listener: &Listener, from_ns: u64, until_ns: u64, what: &str) {
    let heard = listener.heard();
    for (at_ns, word) in heard.words.iter().filter(|(at_ns, _)| (from_ns..until_ns).contains(at_ns)) {
        if let fencepost_guest_tests::bus::Word::Scan(scan) = word {
            let free = scan.cells.iter().filter(|(_, _, obstacle)| !obstacle).count();
            assert_eq!(free, 0, "{what}: {free} cells are free in scan {} at {at_ns}", scan.scan_index);
            assert!(scan.health >= HealthLevel::Blind, "{what}: scan {} is {:?}", scan.scan_index, scan.health);
        }
    }
}
