//! The threads of a pair of cameras: the one that asks for obstacles, and those that work on bands of the same picture.

use std::sync::{
    Mutex, MutexGuard, PoisonError,
    atomic::{AtomicBool, Ordering},
};

use fencepost_core::{
    bands::{Job, MAX_BANDS, Workers},
    detector::{Band, DetectError, Probe},
    picture::Picture,
};
use rayon_core::{ThreadPool, ThreadPoolBuilder, Yield};

use crate::{
    detector::{CELLS, DISPARITIES, ProgramDetector, WIDTH},
    error::Failure,
    live::MAX_PAIRS,
};

/// What the other threads of a pair work with.
type Bands = [Band<WIDTH, DISPARITIES, CELLS>; MAX_BANDS - 1];

/// Those of each pair, as its detector: pages that are not touched never become memory.
static BANDS: [Mutex<Bands>; MAX_PAIRS] = [const { Mutex::new([const { Band::new() }; MAX_BANDS - 1]) }; MAX_PAIRS];

/// Looks at the pictures of a pair with as many threads as it is told.
pub(crate) struct Crew {
    /// None where the thread that calls works alone.
    helpers: Option<(MutexGuard<'static, Bands>, Helpers)>,
}

impl Crew {
    /// The crew of the detector `index`, below [`MAX_PAIRS`]: the thread that calls this, and others until there are `threads`, at most
    /// [`MAX_BANDS`]. Each of the others calls `begin` first.
    ///
    /// # Errors
    /// When the operating system gives no threads.
    pub(crate) fn new(
        index: usize,
        threads: usize,
        begin: impl Fn() + Clone + Send + Sync + 'static,
    ) -> Result<Self, Failure> {
        let threads = threads.min(MAX_BANDS);
        if threads <= 1 {
            return Ok(Self { helpers: None });
        }
        let builder = || {
            let begin = begin.clone();
            ThreadPoolBuilder::new()
                .num_threads(threads)
                .thread_name(move |helper| format!("pair {index} band {helper}"))
                .start_handler(move |_| begin())
        };
        // A thread that belongs to another crew already has one more do its part.
        let pool = builder().use_current_thread().build().or_else(|_| builder().build());
        let pool =
            pool.map_err(|error| Failure::work(format!("{threads} threads for a pair cannot be had: {error}")))?;
        // Threads take some memory of their own when they look for work for the first time, which may be late: they all do so now.
        pool.broadcast(|_| ());
        let bands = BANDS[index].lock().unwrap_or_else(PoisonError::into_inner);
        Ok(Self { helpers: Some((bands, Helpers { pool, threads })) })
    }

    /// Has `detector` look at a pair of pictures; finds the same with any number of threads.
    ///
    /// # Errors
    /// Those of the detector.
    pub(crate) fn detect(
        &mut self,
        detector: &mut ProgramDetector,
        left: &Picture<'_>,
        right: &Picture<'_>,
        probe: &mut (impl Probe + Send),
    ) -> Result<(), DetectError> {
        match &mut self.helpers {
            None => detector.detect(left, right, probe).map(|_| ()),
            Some((bands, helpers)) => {
                let bands = bands.get_mut(..helpers.threads - 1).unwrap_or_default();
                helpers.awake(|| detector.detect_in_bands(left, right, bands, &mut InPool, probe).map(|_| ()))
            }
        }
    }
}

/// Threads that wait for work. Nothing is allocated for it.
struct Helpers {
    pool: ThreadPool,
    threads: usize,
}

impl Helpers {
    /// Does `work`, and lets no thread fall asleep meanwhile: what this thread does alone between two stages takes less time than to wake
    /// the others.
    fn awake<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        let done = AtomicBool::new(false);
        self.pool.install(|| {
            let worker = rayon_core::current_thread_index();
            let work = || {
                let _done = Done(&done);
                work()
            };
            // The thread that does the work comes here as well if it finds nobody else to offer this to: it must not wait for itself.
            let wait = || {
                while !done.load(Ordering::Acquire) && rayon_core::current_thread_index() != worker {
                    if rayon_core::yield_now() != Some(Yield::Executed) {
                        std::hint::spin_loop();
                    }
                }
            };
            beside(self.threads - 1, work, &wait)
        })
    }
}

/// Does `work`, and offers `wait` to as many other threads as there are.
fn beside<R: Send>(others: usize, work: impl FnOnce() -> R + Send, wait: &(impl Fn() + Sync)) -> R {
    if others == 0 { work() } else { rayon_core::join(|| beside(others - 1, work, wait), wait).0 }
}

/// Tells those who wait, even if it ends in a panic.
struct Done<'a>(&'a AtomicBool);

impl Drop for Done<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// The threads of the pool that this thread belongs to.
struct InPool;

impl Workers for InPool {
    fn run<J: Job>(&mut self, jobs: &mut [J]) {
        side_by_side(jobs);
    }
}

/// Has one half of the jobs offered to other threads while this one does the other half, and so on.
fn side_by_side<J: Job>(jobs: &mut [J]) {
    let (some, others) = jobs.split_at_mut(jobs.len().div_ceil(2));
    if others.is_empty() {
        some.iter_mut().for_each(Job::run);
        return;
    }
    // A thread that waits for another falls asleep soon, and bands end within microseconds of each other: less than waking takes.
    let (begun, done) = (AtomicBool::new(false), AtomicBool::new(false));
    let own = || {
        side_by_side(some);
        while begun.load(Ordering::Acquire) && !done.load(Ordering::Acquire) {
            std::hint::spin_loop();
        }
    };
    let offered = || {
        let _done = Done(&done);
        begun.store(true, Ordering::Release);
        side_by_side(others);
    };
    rayon_core::join(own, offered);
}
