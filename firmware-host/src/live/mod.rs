//! The live loop: cameras in, CAN out, for weeks.
//!
//! ```text
//!  camera ──> pair thread ──> place ─┐
//!             detector               ├──> bus thread ──> transmitter ──> bus
//!  camera ──> pair thread ──> place ─┘    joins, encodes,     ^
//!             detector                    heartbeats          └── never waits
//!                  │                          │
//!                  └────> events, progress <──┘ ──> main thread: console, systemd
//! ```
//! A thread for each pair of cameras waits for pictures and looks at them; what it saw lies in its *place*, the newest only.
//! The bus thread is woken by each of them, joins what the pairs saw into one map, and says it on the bus. It also sends the
//! heartbeats, whatever the cameras do. After the start no thread of the loop takes memory from the heap; texts for people
//! wait in a table of fixed size until the main thread says them.

mod bus;
mod event;
mod exchange;
mod latency;
mod pair;
mod realtime;
mod service;
mod settings;
mod sight;
mod simulation;
mod source;
mod watch;

pub use bus::{BusReport, CommandReport, Progress, SentReport};
pub use event::{Event, Severity};
pub use latency::{Latency, LatencySummary};
pub use pair::{PairPlan, PairReport};
pub(crate) use realtime::check_cpu;
pub use service::{Systemd, stop_at_signals};
pub use settings::{BusSettings, MAX_PAIRS, RunSettings};
pub use sight::Sight;
pub use simulation::simulate;
#[cfg(not(feature = "v4l"))]
pub(crate) use source::no_v4l;
pub use source::{RigCamera, RigCameraError};

use std::{
    sync::{
        Barrier, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc,
    },
    thread,
    time::{Duration, Instant},
};

use fencepost_core::{geometry::StereoCalibration, wire::WireConfig};
use fencepost_hal::{camera::Camera, can::CanBus, clock::MonotonicClock};
use serde::Serialize;

use crate::{crew::Crew, detector, error::Failure};
use bus::{BusLoop, BusPlan, BusShared};
use event::Events;
use exchange::{Bell, Place};
use pair::{PairLoop, PairShared};
use realtime::ThreadWishes;
use sight::CrewedSight;

/// How often the main thread says what has happened, and looks whether the others live.
const LOOK: Duration = Duration::from_millis(50);

/// A rig that is about to run.
#[derive(Clone, Debug)]
pub struct Plan<C> {
    /// The pairs of cameras, one to [`MAX_PAIRS`].
    pub pairs: Vec<PairPlan<C>>,
    /// Node and format on the bus.
    pub wire: WireConfig,
    /// Deadlines and time-outs.
    pub settings: RunSettings,
    /// Width of the sectors of the merged map, degrees.
    pub sector_width_deg: f32,
}

/// What the main thread sees of the loop.
#[derive(Debug)]
pub enum Observation<'a> {
    /// The operating system refused something; the loop runs without it.
    Refused(&'a str),
    /// All threads run.
    Started,
    /// Something happened.
    Event(&'a Event),
    /// How it goes; `alive` tells whether no thread has stood still for longer than it may.
    Look {
        /// What the bus thread last said.
        progress: Progress,
        /// Whether every thread moves.
        alive: bool,
    },
}

/// How a run went.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RunReport {
    /// Each pair of cameras.
    pub pairs: Vec<PairReport>,
    /// The bus.
    pub bus: BusReport,
    /// Events that could not be said because there were too many.
    pub events_dropped: u64,
}

/// Runs the loop until `stop` is set or no camera will deliver any more. `observe` is called by the calling thread.
///
/// # Errors
/// When a calibration, a mount or a setting cannot be used. Nothing was sent then.
pub fn run<C, B>(
    plan: Plan<C>,
    bus: B,
    stop: &AtomicBool,
    mut observe: impl FnMut(Observation<'_>),
) -> Result<RunReport, Failure>
where
    C: Camera + Send,
    B: CanBus<Error: Send> + Send,
{
    let Plan { pairs, wire, settings, sector_width_deg } = plan;
    check_number(&pairs)?;
    if settings.lock_memory
        && let Err(refused) = realtime::lock_memory()
    {
        observe(Observation::Refused(&refused));
    }
    let patience: Vec<Duration> = pairs.iter().map(|pair| pair.patience).collect();
    let forget_ns = u64::from(settings.stale_ms) * 1_000_000;
    let places: Vec<Place> = pairs.iter().map(|_| Place::new()).collect();
    let names: Vec<String> = pairs.iter().map(|pair| pair.name.clone()).collect();
    let (bell, events, progress, bus_alive) = (Bell::default(), Events::default(), Mutex::default(), AtomicU64::new(0));
    let clock = &MonotonicClock;
    let shared = BusShared {
        places: &places,
        bell: &bell,
        events: &events,
        stop,
        progress: &progress,
        alive: &bus_alive,
        clock,
    };
    let bus_loop = BusLoop::new(shared, bus, BusPlan { wire, settings: &settings, sector_width_deg })?;
    // Nobody starts before everybody is ready: a node must not say that it runs before it does.
    let threads = pairs.len() + 1;
    let threads_per_pair = usize::from(settings.threads_per_pair);
    let start = Barrier::new(threads + 1);
    let (called_off, bus_ended) = (AtomicBool::new(false), AtomicBool::new(false));
    let (ready_sender, ready) = mpsc::channel();

    thread::scope(|scope| {
        let mut pair_threads = Vec::new();
        for (index, (plan, place)) in pairs.into_iter().zip(&places).enumerate() {
            let wishes = ThreadWishes { cpu: plan.cpu, priority: settings.priority };
            let (ready, start, called_off) = (ready_sender.clone(), &start, &called_off);
            let (bell, events) = (&bell, &events);
            let name = &names[index];
            pair_threads.push(scope.spawn(move || {
                let PairPlan { camera, calibration, mount, settings, .. } = plan;
                let mut detector = detector::lock_one(index);
                // Those that help ask for the same priority, and are refused it as this thread is, which says so. A processor is for
                // one thread to stay on.
                let helper = ThreadWishes { cpu: None, ..wishes };
                let configured = detector
                    .configure(&settings, &calibration, &mount)
                    .map_err(|error| Failure::config(error, None))
                    .and_then(|()| Crew::new(index, threads_per_pair, move || drop(helper.ask())));
                let (told, crew) = match configured {
                    Ok(mut crew) => {
                        pair::warm_up(&mut detector, &mut crew, raw_size(&calibration));
                        // What it saw in the warm-up is forgotten.
                        let _ = detector.configure(&settings, &calibration, &mount);
                        (Ok(wishes.ask()), Some(crew))
                    }
                    Err(failure) => (Err((index, failure)), None),
                };
                let _ = ready.send(told);
                start.wait();
                match crew {
                    Some(mut crew) if !called_off.load(Ordering::Relaxed) => {
                        let mut sight = CrewedSight { detector: &mut detector, crew: &mut crew };
                        let shared = PairShared { place, bell, events, clock };
                        PairLoop::new(name, camera, forget_ns, shared).run(&mut sight, stop)
                    }
                    _ => PairReport::default(),
                }
            }));
        }
        let bus_thread = {
            // Before the detectors: a heartbeat must not wait for a picture. A FIFO thread is not interrupted by its equals.
            let wishes = ThreadWishes { cpu: settings.bus_cpu, priority: settings.bus_priority() };
            let (ready, start, called_off) = (ready_sender, &start, &called_off);
            let (bus_ended, main) = (&bus_ended, thread::current());
            scope.spawn(move || {
                let _ = ready.send(Ok(wishes.ask()));
                start.wait();
                let report = (!called_off.load(Ordering::Relaxed)).then(|| bus_loop.run());
                bus_ended.store(true, Ordering::Release);
                main.unpark();
                report
            })
        };

        let mut failure = None;
        let mut refused: Vec<String> = Vec::new();
        // The senders live as long as the threads: one message from each is all there will be.
        for message in ready.iter().take(threads) {
            match message {
                Ok(wishes) => refused.extend(wishes),
                Err((index, mut wrong)) => {
                    wrong.what = format!("pair {}: {}", names[index], wrong.what);
                    failure.get_or_insert(wrong);
                }
            }
        }
        refused.sort();
        refused.dedup();
        refused.iter().for_each(|text| observe(Observation::Refused(text)));
        called_off.store(failure.is_some(), Ordering::Relaxed);
        start.wait();
        if let Some(failure) = failure {
            return Err(failure);
        }
        observe(Observation::Started);
        let mut liveness = Liveness::new(places.iter().map(|place| &place.alive).zip(patience), &bus_alive);
        let mut broken = None;
        while !bus_ended.load(Ordering::Acquire) && !bus_thread.is_finished() {
            // The bus thread ends it when it is through.
            thread::park_timeout(LOOK);
            while let Some(event) = events.next() {
                observe(Observation::Event(&event));
            }
            // A thread that ends while its camera goes on has met a mistake of the program.
            let dead =
                pair_threads.iter().zip(&places).position(|(thread, place)| thread.is_finished() && !place.has_ended());
            if let Some(index) = dead.filter(|_| !stop.load(Ordering::Relaxed)) {
                broken = Some(index);
                stop.store(true, Ordering::Relaxed);
            }
            let progress = progress.lock().map(|progress| *progress).unwrap_or_default();
            observe(Observation::Look { progress, alive: liveness.look(|index| places[index].has_ended()) });
        }
        // Also where the bus thread met a mistake of the program: nobody works for a bus that hears nothing.
        stop.store(true, Ordering::Relaxed);
        let bus = bus_thread.join();
        let pairs: Vec<_> = pair_threads.into_iter().map(thread::ScopedJoinHandle::join).collect();
        while let Some(event) = events.next() {
            observe(Observation::Event(&event));
        }
        let whole = |what: &str| {
            Failure::work(format!("the thread of {what} has ended by a mistake of the program"))
                .mend("start it again, and report what it printed")
        };
        if let Some(index) = broken {
            return Err(whole(&format!("pair {}", names[index])));
        }
        let bus = bus.ok().flatten().ok_or_else(|| whole("the bus"))?;
        let pairs = pairs.into_iter().collect::<Result<_, _>>().map_err(|_| whole("a pair"))?;
        Ok(RunReport { pairs, bus, events_dropped: events.dropped() })
    })
}

fn check_number<C>(pairs: &[PairPlan<C>]) -> Result<(), Failure> {
    if pairs.is_empty() || pairs.len() > MAX_PAIRS {
        return Err(Failure::usage(format!("a rig has 1 to {MAX_PAIRS} pairs of cameras, not {}", pairs.len())));
    }
    Ok(())
}

/// When each thread was last seen to move.
#[derive(Debug)]
struct Liveness<'a> {
    pairs: Vec<Pulse<'a>>,
    bus: Pulse<'a>,
}

#[derive(Debug)]
struct Pulse<'a> {
    count: &'a AtomicU64,
    before: u64,
    moved: Instant,
    patience: Duration,
}

/// The bus thread waits for nothing longer than a few milliseconds.
const BUS_PATIENCE: Duration = Duration::from_secs(1);

impl<'a> Liveness<'a> {
    fn new(pairs: impl Iterator<Item = (&'a AtomicU64, Duration)>, bus: &'a AtomicU64) -> Self {
        let pulse = |(count, patience)| Pulse { count, before: 0, moved: Instant::now(), patience };
        Self { pairs: pairs.map(pulse).collect(), bus: pulse((bus, BUS_PATIENCE)) }
    }

    /// Whether no thread has stood still for longer than it may. One that has ended in order need not move.
    fn look(&mut self, ended: impl Fn(usize) -> bool) -> bool {
        let bus = self.bus.is_alive();
        self.pairs.iter_mut().enumerate().fold(bus, |all, (index, pulse)| (pulse.is_alive() || ended(index)) && all)
    }
}

impl Pulse<'_> {
    fn is_alive(&mut self) -> bool {
        let now = self.count.load(Ordering::Relaxed);
        if std::mem::replace(&mut self.before, now) != now {
            self.moved = Instant::now();
        }
        self.moved.elapsed() <= self.patience
    }
}

const fn raw_size(calibration: &StereoCalibration) -> (u32, u32) {
    match calibration {
        StereoCalibration::Rectified(pair) => (pair.width, pair.height),
        StereoCalibration::Raw(pair) => (pair.left.width, pair.left.height),
    }
}
