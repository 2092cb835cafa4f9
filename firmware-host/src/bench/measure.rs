//! The measuring itself: a warm detector, frame after frame.

use std::{
    path::Path,
    sync::{
        Barrier,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
    time::Instant,
};

use fencepost_core::{
    arch::Backend,
    bands::MAX_BANDS,
    settings::Settings,
    wire::{Frame, Scan, ScanEncoder, WireConfig},
};
use heapless::Vec as FixedVec;

use super::{BenchPictures, Pair};
use crate::{
    can_log::{FRAMES, RUNS},
    crew::Crew,
    detector::{self, ProgramDetector},
    error::Failure,
    live::MAX_PAIRS,
    stopwatch::{FrameTimes, Stopwatch, milliseconds},
};

/// Frames that are looked at before the first that is measured: caches, branch predictors and clocks are warm, and the ground is
/// found.
const WARM_UP: usize = 5;

/// How long each frame took.
#[derive(Clone, Debug, Default)]
pub struct Measurement {
    /// Threads, each with a detector of its own.
    pub threads: usize,
    /// Bands that each picture was cut into, with a thread each.
    pub bands: usize,
    /// The frames of all threads.
    pub frames: Vec<FrameTimes>,
}

/// What is to be measured.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// Settings of the detector.
    pub settings: &'a Settings,
    /// Settings of the bus.
    pub wire: WireConfig,
    /// Whose instructions the matching is made of; the fastest that the processor has if there is none.
    pub backend: Option<Backend>,
    /// The configuration file, for errors.
    pub file: Option<&'a Path>,
    /// Threads that work at the same time, at most [`MAX_PAIRS`]: so many detectors the program has.
    pub threads: usize,
    /// Bands that each picture is cut into, at most [`MAX_BANDS`], with a thread for each; 1 for none.
    pub bands: usize,
    /// Frames on each thread.
    pub frames: usize,
}

/// Measures how long the frames take.
///
/// Every thread has a detector of its own and looks at the same pictures. A thread that has measured all of its frames goes on until
/// the last one has, so that no frame is measured beside an idle processor.
///
/// # Errors
/// When the detector does not take calibration, mount, settings or pictures.
pub fn measure(pictures: &BenchPictures, job: &Job<'_>) -> Result<Measurement, Failure> {
    let threads = job.threads.clamp(1, MAX_PAIRS);
    let (start, busy) = (Barrier::new(threads), AtomicUsize::new(threads));
    let work = |index: usize| -> Result<Vec<FrameTimes>, Failure> {
        let mut detector = detector::lock_one(index);
        let prepared = Worker::new(index, &mut detector, pictures, job);
        // Every thread comes here, also one that cannot go on: the others wait for it.
        start.wait();
        let measured = prepared.and_then(|mut worker| {
            let measured = worker.frames(pictures, job.frames);
            busy.fetch_sub(1, Ordering::Relaxed);
            while measured.is_ok() && busy.load(Ordering::Relaxed) > 0 {
                worker.frames(pictures, 1)?;
            }
            measured
        });
        if measured.is_err() {
            // Nobody is kept waiting for what will not come.
            busy.store(0, Ordering::Relaxed);
        }
        measured
    };
    let results: Vec<_> = thread::scope(|scope| {
        let work = &work;
        let running: Vec<_> = (0..threads).map(|index| scope.spawn(move || work(index))).collect();
        running.into_iter().map(|thread| thread.join()).collect()
    });
    let mut all = Vec::new();
    for result in results {
        all.extend(result.map_err(|_| Failure::work("a thread of the measurement broke off"))??);
    }
    Ok(Measurement { threads, bands: job.bands.clamp(1, MAX_BANDS), frames: all })
}

/// One detector, and what makes CAN payloads of what it finds.
struct Worker<'a> {
    detector: &'a mut ProgramDetector,
    crew: Crew,
    encoder: Box<ScanEncoder<RUNS>>,
    payloads: Box<FixedVec<Frame, FRAMES>>,
    next: usize,
}

impl<'a> Worker<'a> {
    fn new(
        index: usize,
        detector: &'a mut ProgramDetector,
        pictures: &BenchPictures,
        job: &Job<'_>,
    ) -> Result<Self, Failure> {
        let failure = |error| Failure::config(error, job.file);
        detector.set_backend(job.backend.unwrap_or_else(Backend::fastest));
        detector.configure(job.settings, &pictures.calibration, &pictures.mount).map_err(failure)?;
        let encoder = ScanEncoder::new(job.wire).map_err(failure)?;
        let crew = Crew::new(index, job.bands, || ())?;
        let mut worker = Self { detector, crew, encoder: Box::new(encoder), payloads: Box::default(), next: 0 };
        worker.frames(pictures, WARM_UP)?;
        Ok(worker)
    }

    /// Looks at the next `count` pairs, over and over from the first.
    fn frames(&mut self, pictures: &BenchPictures, count: usize) -> Result<Vec<FrameTimes>, Failure> {
        let mut times = Vec::with_capacity(count);
        for pair in pictures.pairs.iter().cycle().skip(self.next % pictures.pairs.len().max(1)).take(count) {
            times.push(self.frame(pair)?);
            self.next += 1;
        }
        Ok(times)
    }

    fn frame(&mut self, pair: &Pair) -> Result<FrameTimes, Failure> {
        let (left, right) = pair.views();
        let mut watch = Stopwatch::default();
        let start = Instant::now();
        self.crew
            .detect(self.detector, &left, &right, &mut watch)
            .map_err(|error| Failure::work(format!("the pictures cannot be used: {error:?}")))?;
        let mut times = watch.finish(start.elapsed());
        let detection = self.detector.detection();
        let scan = Scan {
            scan_index: self.next as u16,
            age_ns: 0,
            health: detection.health,
            geometry: &detection.map.geometry,
            cells: &detection.map.cells,
            sectors: &detection.sectors,
            ground: detection.ground.as_ref(),
        };
        self.payloads.clear();
        let start = Instant::now();
        self.encoder
            .encode(&scan, self.payloads.as_mut_view())
            .map_err(|error| Failure::work(format!("the scan cannot be sent: {error}")))?;
        times.wire_ms = milliseconds(start.elapsed());
        times.total_ms += times.wire_ms;
        Ok(times)
    }
}
