//! A rig of virtual devices: rendered pictures from memory, paced, spoilt to order.

use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::JoinHandle,
    time::Duration,
};

use fencepost::live::{self, PairPlan, Plan, RunReport, RunSettings};
use fencepost_core::{geometry::Mount, settings::Settings, wire::WireConfig};
use fencepost_hal::{
    camera::{Camera, FaultyCamera, FaultyError, MemoryCamera, PacedCamera, StereoPair},
    can::{BusFaultControl, BusFaultInjector, VirtualBus, VirtualNode},
    clock::monotonic_ns,
    scene::{Scene, SceneOptions},
};

/// Lag that can be asked for, pairs.
pub(crate) const MOST_LAG: usize = 6;

/// One run at a time: they share the program's detectors, and each wants the machine for itself.
static TURN: Mutex<()> = Mutex::new(());

pub(crate) fn take_turn() -> MutexGuard<'static, ()> {
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Small pictures of the rural scene.
pub(crate) fn options(width: u32, height: u32, frames: u32) -> SceneOptions {
    let usual = SceneOptions::default();
    let focal_px = usual.focal_px * width as f32 / usual.width as f32;
    SceneOptions { width, height, focal_px, frames, ..usual }
}

pub(crate) fn memory(options: SceneOptions) -> MemoryCamera {
    MemoryCamera::fill(&mut Scene::new(options).unwrap().into_camera())
}

type Faulty<C> = FaultyCamera<PacedCamera<C>>;
type Order = Box<dyn FnOnce(&mut Faulty<MemoryCamera>) + Send>;

/// A camera that carries out orders before it delivers the next pair.
pub(crate) struct OrderedCamera {
    camera: Faulty<MemoryCamera>,
    orders: Orders,
}

/// The other end: gives orders, and knows since when they are carried out.
#[derive(Clone, Default)]
pub(crate) struct Orders {
    slot: Arc<Mutex<(Option<Order>, u64)>>,
    delivered: Arc<AtomicU64>,
}

impl OrderedCamera {
    pub(crate) fn new(memory: MemoryCamera, size: (u32, u32), period: Option<Duration>) -> Self {
        let size = (size.0 as usize, size.1 as usize);
        let camera = FaultyCamera::new(PacedCamera::new(memory, period), size, MOST_LAG, 1);
        Self { camera, orders: Orders::default() }
    }

    pub(crate) fn orders(&self) -> Orders {
        self.orders.clone()
    }
}

impl Orders {
    pub(crate) fn give(&self, order: impl FnOnce(&mut Faulty<MemoryCamera>) + Send + 'static) {
        let mut slot = self.lock();
        slot.0 = Some(Box::new(order));
        slot.1 = u64::MAX;
    }

    /// When the first pair came that the newest order was carried out on, nanoseconds; `None` if it did not yet.
    pub(crate) fn carried_out_ns(&self) -> Option<u64> {
        let at_ns = self.lock().1;
        (at_ns != u64::MAX).then_some(at_ns)
    }

    /// Pairs that were delivered.
    pub(crate) fn delivered(&self) -> u64 {
        self.delivered.load(Ordering::Relaxed)
    }

    fn lock(&self) -> MutexGuard<'_, (Option<Order>, u64)> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Camera for OrderedCamera {
    type Error = FaultyError<std::convert::Infallible>;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error> {
        let Self { camera, orders } = self;
        let order = orders.lock().0.take();
        let ordered = order.map(|order| order(camera)).is_some();
        camera.next_pair(|pair| {
            orders.delivered.fetch_add(1, Ordering::Relaxed);
            if ordered {
                orders.lock().1 = monotonic_ns();
            }
            consume(pair)
        })
    }
}

/// A loop that runs in a thread of its own.
pub(crate) struct Running {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<RunReport>>,
    pub(crate) bus: BusFaultControl,
    _turn: MutexGuard<'static, ()>,
}

pub(crate) fn pair<C>(name: &str, camera: C, options: &SceneOptions, mount: Mount) -> PairPlan<C> {
    let mut settings = Settings::default();
    settings.matching.disparities = 32;
    PairPlan {
        name: name.to_string(),
        camera,
        calibration: options.calibration(),
        mount,
        settings,
        cpu: None,
        patience: std::time::Duration::from_secs(30),
    }
}

/// Settings under which nothing but what a test does makes a frame late or stale, on a machine that has other work.
pub(crate) fn patient() -> RunSettings {
    RunSettings {
        priority: 0,
        lock_memory: false,
        deadline_ms: 2000,
        stale_ms: 2000,
        hold_ms: 300,
        ..RunSettings::default()
    }
}

/// Starts the loop at `bus`.
pub(crate) fn start<C: Camera<Error: Send> + Send + 'static>(
    pairs: Vec<PairPlan<C>>,
    settings: RunSettings,
    bus: &VirtualBus,
) -> Running {
    let turn = take_turn();
    let node: BusFaultInjector<VirtualNode> = BusFaultInjector::new(bus.attach(), 1);
    let control = node.control();
    let stop = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&stop);
    let thread = std::thread::spawn(move || {
        let plan = Plan { pairs, wire: WireConfig::default(), settings, sector_width_deg: 5.0 };
        live::run(plan, node, &seen, |observation| {
            if let live::Observation::Event(event) = observation {
                println!("  event: {}", event.text);
            }
        })
        .unwrap()
    });
    Running { stop, thread: Some(thread), bus: control, _turn: turn }
}

impl Running {
    pub(crate) fn stop(self) -> RunReport {
        self.stop.store(true, Ordering::Relaxed);
        self.wait()
    }

    /// Until the cameras have nothing more to deliver.
    pub(crate) fn wait(mut self) -> RunReport {
        self.thread.take().unwrap().join().unwrap()
    }
}

/// A test that fails does not leave its loop behind.
impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
