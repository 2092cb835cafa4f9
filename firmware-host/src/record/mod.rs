//! Records what a pair of cameras sees, without loss, for as long as there is room on the disk.
//!
//! ```text
//!  camera ──> filled pictures ──> writer thread ──> recording, record.json
//!     ^                                │
//!     └────────── empty pictures <─────┘
//! ```
//! The pictures in between are taken from the heap at the start. When all of them are filled, because the disk is too slow, a
//! pair is dropped and counted: the camera never waits for the disk.

mod queue;
mod report;

pub use report::{RecordEnd, RecordReport};

use std::{
    path::{Path, PathBuf},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use fencepost_core::geometry::{Mount, StereoCalibration};
use fencepost_hal::{
    camera::{Camera, CameraError, CameraErrorKind},
    recording::{RecordingError, RecordingWriter},
};

use crate::error::Failure;
use queue::{Filler, Next, Offer, Stored, queue};

/// How often it is said how it goes, here and in `record.json`.
const STATUS: Duration = Duration::from_secs(1);

/// Shortest time between two calls of a camera that fails.
const LEAST_FAILING: Duration = Duration::from_millis(10);

/// What to record, and how much of it.
#[derive(Clone, Debug)]
pub struct RecordPlan {
    /// Folder of the recording.
    pub folder: PathBuf,
    /// What the pair is called.
    pub pair: String,
    /// Calibration of the cameras.
    pub calibration: StereoCalibration,
    /// Files of the calibration, where it comes from files.
    pub calibration_files: Vec<PathBuf>,
    /// How the left camera sits.
    pub mount: Mount,
    /// Pairs of pictures in memory, between camera and disk.
    pub queue_pairs: usize,
    /// End after so many pairs.
    pub frames: Option<u64>,
    /// End after so long.
    pub duration: Option<Duration>,
    /// End when the camera has given nothing for so long.
    pub patience: Duration,
}

/// Something to tell whoever waits.
#[derive(Debug)]
pub enum RecordEvent<'a> {
    /// The camera fails, or fails in another way than before.
    Trouble(&'a dyn std::error::Error),
    /// The camera delivers again.
    Mended,
    /// The camera has found something odd.
    Odd(&'a str),
    /// How it goes.
    Status(&'a RecordReport),
}

/// Records from `camera` until `stop` is set, the plan is fulfilled, the camera ends or is gone, or the disk is full. The
/// recording can be read at any moment, however this ends.
///
/// # Errors
/// When the folder cannot be written at all. What goes wrong later is in the report.
pub fn record<C: Camera>(
    camera: &mut C,
    plan: &RecordPlan,
    stop: &AtomicBool,
    mut observe: impl FnMut(RecordEvent<'_>),
) -> Result<RecordReport, Failure> {
    let writer =
        RecordingWriter::create_with_files(&plan.folder, &plan.calibration, &plan.mount, &plan.calibration_files)?;
    let (width, height) = size(&plan.calibration);
    let (filler, stored) = queue(plan.queue_pairs, (width as usize, height as usize));
    let mut report = RecordReport::new(&plan.pair);
    report.save(&plan.folder)?;
    let failed = AtomicBool::new(false);
    let latest = Mutex::new(None);
    let end = thread::scope(|scope| {
        let disk = scope.spawn(|| write_all(writer, stored, &latest, &failed));
        let mut camera_loop =
            CameraLoop { plan, stop, disk_failed: &failed, filler, latest: &latest, report: &mut report };
        let end = camera_loop.run(camera, &mut observe);
        // The writer ends when it has written what is left.
        drop(camera_loop);
        let Ok(Written { frames, error }) = disk.join() else {
            return RecordEnd::Disk("the thread that writes has ended".to_string());
        };
        report.written = frames;
        match error {
            Some(error) => RecordEnd::Disk(error.to_string()),
            None => end,
        }
    });
    report.end = end;
    // On a full disk this may fail as well; the last one that was saved is whole.
    let saved = report.save(&plan.folder);
    if !matches!(report.end, RecordEnd::Disk(_)) {
        saved?;
    }
    Ok(report)
}

/// The camera's side.
struct CameraLoop<'a> {
    plan: &'a RecordPlan,
    stop: &'a AtomicBool,
    disk_failed: &'a AtomicBool,
    filler: Filler,
    /// For the writer.
    latest: &'a Mutex<Option<RecordReport>>,
    report: &'a mut RecordReport,
}

impl CameraLoop<'_> {
    fn run<C: Camera>(&mut self, camera: &mut C, observe: &mut impl FnMut(RecordEvent<'_>)) -> RecordEnd {
        let start = Instant::now();
        let (mut last_good, mut last_status) = (start, start);
        let mut trouble: Option<CameraErrorKind> = None;
        let mut last_ns: Option<u64> = None;
        loop {
            if self.stop.load(Ordering::Relaxed) {
                return RecordEnd::Asked;
            }
            if self.disk_failed.load(Ordering::Relaxed) {
                // What the disk said is told by the writer.
                return RecordEnd::Running;
            }
            if self.plan.frames.is_some_and(|frames| self.report.recorded >= frames)
                || self.plan.duration.is_some_and(|duration| start.elapsed() >= duration)
            {
                return RecordEnd::Enough;
            }
            let called = Instant::now();
            let filler = &mut self.filler;
            let taken = camera.next_pair(|pair| {
                let rises = last_ns.is_none_or(|last_ns| pair.timestamp_ns > last_ns);
                let offer = if rises { filler.offer(pair) } else { Offer::NotRising };
                (offer, pair.timestamp_ns, pair.missed)
            });
            match taken {
                Ok(None) => return RecordEnd::SourceEnded,
                Ok(Some((offer, timestamp_ns, missed))) => {
                    last_good = Instant::now();
                    self.count(offer, missed);
                    if matches!(offer, Offer::Taken) {
                        last_ns = Some(timestamp_ns);
                    }
                    if trouble.take().is_some() {
                        observe(RecordEvent::Mended);
                    }
                }
                Err(error) => {
                    let kind = error.kind();
                    self.report.count_error(kind);
                    if trouble.replace(kind) != Some(kind) {
                        observe(RecordEvent::Trouble(&error));
                    }
                    if kind == CameraErrorKind::Unusable || last_good.elapsed() >= self.plan.patience {
                        return RecordEnd::Camera(error.to_string());
                    }
                    thread::sleep(LEAST_FAILING.saturating_sub(called.elapsed()));
                }
            }
            while let Some(odd) = camera.take_warning() {
                observe(RecordEvent::Odd(&odd));
            }
            if last_status.elapsed() >= STATUS {
                last_status = Instant::now();
                self.report.seconds = start.elapsed().as_secs_f64();
                observe(RecordEvent::Status(self.report));
                // One that is not written yet has been overtaken.
                *self.latest.lock().unwrap_or_else(PoisonError::into_inner) = Some(self.report.clone());
            }
            self.report.seconds = start.elapsed().as_secs_f64();
        }
    }

    fn count(&mut self, offer: Offer, missed: u32) {
        self.report.missed += u64::from(missed);
        match offer {
            Offer::Taken => self.report.recorded += 1,
            Offer::Full => self.report.dropped += 1,
            Offer::NotRising => self.report.times_not_rising += 1,
            Offer::WrongSize => self.report.wrong_size += 1,
            // Why is told by the writer.
            Offer::Ended => {}
        }
    }
}

/// What the disk has taken.
struct Written {
    frames: u64,
    error: Option<RecordingError>,
}

/// The disk's side: writes what comes until nothing more does, or the disk takes no more.
fn write_all(
    mut writer: RecordingWriter,
    stored: Stored,
    latest: &Mutex<Option<RecordReport>>,
    failed: &AtomicBool,
) -> Written {
    let mut error = None;
    loop {
        let next = stored.next(STATUS);
        // Taken out first: the camera must not wait for the disk at this lock.
        let report = latest.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(report) = report {
            // A disk that does not take this does not take the next picture either, and that is told.
            let _ = report.save(writer.folder());
        }
        let filled = match next {
            Next::Pair(filled) => filled,
            Next::NoneYet => continue,
            Next::Ended => break,
        };
        let written = filled.view(|pair| writer.write_pair(pair));
        stored.give_back(filled);
        if let Some(Err(wrong)) = written {
            error = Some(wrong);
            failed.store(true, Ordering::Relaxed);
            break;
        }
    }
    Written { frames: u64::from(writer.frames()), error }
}

const fn size(calibration: &StereoCalibration) -> (u32, u32) {
    match calibration {
        StereoCalibration::Rectified(pair) => (pair.width, pair.height),
        StereoCalibration::Raw(pair) => (pair.left.width, pair.left.height),
    }
}

/// Where `record.json` lies.
fn report_path(folder: &Path) -> PathBuf {
    folder.join("record.json")
}

#[cfg(test)]
mod tests;
