//! Pictures for the loopback devices: the committed recording, spoilt to order.

use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use fencepost_core::picture::Picture;
use fencepost_guest_tests::{device::Writer, loopback, machine::wait_for};
use fencepost_hal::{
    camera::{Camera, FaultyCamera, MemoryCamera, PacedCamera, StereoPair},
    clock::monotonic_ns,
};

use super::{PATIENCE, SIZE, synthetic::Pixels, trail_pictures};

type Faulty = FaultyCamera<PacedCamera<MemoryCamera>>;
type Order = Box<dyn FnOnce(&mut Faulty) + Send>;

/// Changes what is about to be written, left and right.
pub(super) type Rewrite = fn(&mut [Pixels; 2], &mut u64);

/// A grey pair before which nothing can be seen: a loopback device must have been written to before it can be read.
pub(super) fn write_nothing(writers: &mut [Writer; 2]) {
    let grey = vec![128; writers[0].size()];
    writers.iter_mut().for_each(|writer| writer.write(&grey));
}

pub(super) fn open_writers() -> [Writer; 2] {
    open_writers_of(SIZE)
}

fn open_writers_of(size: (u32, u32)) -> [Writer; 2] {
    [loopback::LEFT, loopback::RIGHT].map(|path| Writer::open(path, *b"GREY", size.0, size.1))
}

pub(super) fn write_pair(writers: &mut [Writer; 2], pair: &StereoPair<'_>) {
    for (writer, picture) in writers.iter_mut().zip([&pair.left, &pair.right]) {
        writer.write(&middle(picture, (picture.width(), picture.height())).grey);
    }
}

/// Writes the committed recording to the loopback devices over and over, spoilt to order.
pub(super) struct Feeder {
    orders: Arc<Mutex<(Option<Order>, u64)>>,
    rewrite: Arc<Mutex<Option<Rewrite>>>,
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Feeder {
    /// Pictures every `period`.
    pub(super) fn start(writers: [Writer; 2], period: Duration) -> Self {
        Self::feed(writers, SIZE, period)
    }

    /// Only the middle of the pictures, `size` large.
    pub(super) fn start_small(size: (u32, u32), period: Duration) -> Self {
        Self::feed(open_writers_of(size), size, period)
    }

    fn feed(mut writers: [Writer; 2], size: (u32, u32), period: Duration) -> Self {
        write_nothing(&mut writers);
        let paced = PacedCamera::new(trail_pictures().repeated(u32::MAX), Some(period));
        let mut camera = FaultyCamera::new(paced, (SIZE.0 as usize, SIZE.1 as usize), 3, 1);
        let orders: Arc<Mutex<(Option<Order>, u64)>> = Arc::default();
        let rewrite: Arc<Mutex<Option<Rewrite>>> = Arc::default();
        let end = Arc::new(AtomicBool::new(false));
        let (taken, rewritten, ended) = (Arc::clone(&orders), Arc::clone(&rewrite), Arc::clone(&end));
        let size = (size.0 as usize, size.1 as usize);
        let thread = thread::spawn(move || {
            let mut seed = 1;
            while !ended.load(Ordering::Relaxed) {
                let order = lock(&taken).0.take();
                let ordered = order.map(|order| order(&mut camera)).is_some();
                // A pair that is kept back is an error here, and simply does not come there.
                let _ = camera.next_pair(|pair| {
                    let mut pictures = [&pair.left, &pair.right].map(|picture| middle(picture, size));
                    if let Some(rewrite) = *lock(&rewritten) {
                        rewrite(&mut pictures, &mut seed);
                    }
                    if ordered {
                        lock(&taken).1 = monotonic_ns();
                    }
                    writers.iter_mut().zip(&pictures).for_each(|(writer, picture)| writer.write(&picture.grey));
                });
            }
        });
        Self { orders, rewrite, end, thread: Some(thread) }
    }

    /// From the next pair on; returns when that pair has been written: the time just before.
    pub(super) fn order(&self, order: impl FnOnce(&mut Faulty) + Send + 'static) -> u64 {
        *lock(&self.orders) = (Some(Box::new(order)), 0);
        wait_for(PATIENCE, || Some(lock(&self.orders).1).filter(|at_ns| *at_ns > 0)).expect("the order is carried out")
    }

    /// Changes every pair from the next one on, or no longer; see [`Feeder::order`].
    pub(super) fn rewrite(&self, rewrite: Option<Rewrite>) -> u64 {
        let place = Arc::clone(&self.rewrite);
        self.order(move |_| *lock(&place) = rewrite)
    }

    /// The other end of both devices is closed.
    pub(super) fn end(mut self) {
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

fn middle(picture: &Picture<'_>, (width, height): (usize, usize)) -> Pixels {
    let (left, top) = ((picture.width() - width) / 2, (picture.height() - height) / 2);
    let rows = (top..top + height).map(|y| picture.row(y));
    Pixels { width, grey: rows.flat_map(|row| row.iter().skip(left).take(width)).copied().collect() }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
