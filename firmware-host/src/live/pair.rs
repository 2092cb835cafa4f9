//! The thread of a pair of cameras: picture by picture, from the camera to what was seen.

use std::{
    fmt,
    sync::atomic::{AtomicBool, Ordering},
    time::Duration,
};

use fencepost_core::{
    detector::DetectError,
    geometry::{Mount, StereoCalibration},
    picture::Picture,
    settings::Settings,
};
use fencepost_hal::{
    camera::{Camera, CameraError, CameraErrorKind},
    clock::Clock,
};
use serde::Serialize;

use super::{
    event::{Events, Severity},
    exchange::{Bell, Place, Trouble},
    latency::{Latency, LatencySummary},
    sight::Sight,
};
use crate::{crew::Crew, detector::ProgramDetector};

/// Shortest time between two calls of a camera that fails: one that fails at once must not take the whole processor.
const LEAST_FAILING: Duration = Duration::from_millis(10);

/// A pair of cameras and everything that is known of it.
#[derive(Clone, Debug)]
pub struct PairPlan<C> {
    /// What it is called.
    pub name: String,
    /// Delivers the pictures.
    pub camera: C,
    /// Calibration of the two cameras.
    pub calibration: StereoCalibration,
    /// Where the left camera sits.
    pub mount: Mount,
    /// Settings of the detector.
    pub settings: Settings,
    /// Processor of the thread; any if `None`.
    pub cpu: Option<u16>,
    /// No call of the camera and the detector takes longer; a thread that has not moved for so long hangs.
    pub patience: Duration,
}

/// What became of a pair's pictures.
#[derive(Clone, Debug, Default, Serialize)]
pub struct PairReport {
    /// What it is called.
    pub name: String,
    /// Pairs in which was looked for obstacles.
    pub frames: u64,
    /// Pictures that were lost or had no partner.
    pub missed: u64,
    /// Time-outs.
    pub no_picture: u64,
    /// Pairs that could not be used.
    pub damaged: u64,
    /// Calls that found the camera gone.
    pub lost: u64,
    /// From exposure to the call of the detector.
    pub delivery: LatencySummary,
    /// The detector alone.
    pub detect: LatencySummary,
}

/// What a pair's thread shares with the others.
#[derive(Clone, Copy)]
pub(super) struct PairShared<'a> {
    pub(super) place: &'a Place,
    pub(super) bell: &'a Bell,
    pub(super) events: &'a Events,
    pub(super) clock: &'a dyn Clock,
}

/// What a pair's thread does, and what it knows from one pair of pictures to the next.
pub(super) struct PairLoop<'a, C> {
    shared: PairShared<'a>,
    camera: C,
    /// Pictures farther apart than this have nothing to do with each other.
    forget_ns: u64,
    last_exposure_ns: Option<u64>,
    trouble: Option<(Trouble, u64)>,
    delivery: Latency,
    detect: Latency,
    report: PairReport,
}

impl<'a, C: Camera> PairLoop<'a, C> {
    /// Takes all the memory that it will ever need.
    pub(super) fn new(name: &str, camera: C, forget_ns: u64, shared: PairShared<'a>) -> Self {
        let report = PairReport { name: name.to_owned(), ..PairReport::default() };
        let (delivery, detect) = (Latency::new(), Latency::new());
        Self { shared, camera, forget_ns, last_exposure_ns: None, trouble: None, delivery, detect, report }
    }

    /// Looks at pictures until it is told to stop or no further pictures come.
    pub(super) fn run(mut self, sight: &mut impl Sight, stop: &AtomicBool) -> PairReport {
        while !stop.load(Ordering::Relaxed)
            && let Some(rest) = self.step(sight)
        {
            self.shared.clock.sleep(rest);
        }
        self.end()
    }

    /// Waits for a pair of pictures and looks at it. Returns how long to wait before the next call, or `None` where no further
    /// pictures come.
    pub(super) fn step(&mut self, sight: &mut impl Sight) -> Option<Duration> {
        let PairShared { place, bell, events, clock } = self.shared;
        let called_ns = clock.now_ns();
        let result = self.camera.next_pair(|pair| {
            let start_ns = clock.now_ns();
            self.delivery.record(start_ns.saturating_sub(pair.timestamp_ns));
            // Ground that was seen long ago may lie elsewhere by now.
            let step_ns = self.last_exposure_ns.map(|last| pair.timestamp_ns.saturating_sub(last));
            if step_ns.is_some_and(|step_ns| step_ns > self.forget_ns) {
                sight.forget();
            }
            self.last_exposure_ns = Some(pair.timestamp_ns);
            sight.look(&pair.left, &pair.right)?;
            self.detect.record(clock.now_ns().saturating_sub(start_ns));
            place.publish(pair.timestamp_ns, pair.missed, clock.now_ns(), sight.seen());
            Ok(pair.missed)
        });
        place.count_alive();
        while let Some(warning) = self.camera.take_warning() {
            let text = format_args!("pair {}: {warning}", self.report.name);
            events.tell(clock.now_ns(), Severity::Warning, text);
        }
        let found = match result {
            Ok(None) => {
                place.fail(Trouble::Ended);
                bell.ring();
                return None;
            }
            Ok(Some(Ok(missed))) => {
                self.report.frames += 1;
                self.report.missed += u64::from(missed);
                None
            }
            Ok(Some(Err(error))) => {
                self.report.damaged += 1;
                self.say(Trouble::NotLookedAt, &NotLookedAt(error));
                Some(Trouble::NotLookedAt)
            }
            Err(error) => {
                let kind = error.kind();
                match kind {
                    CameraErrorKind::NoPicture => self.report.no_picture += 1,
                    CameraErrorKind::Damaged => self.report.damaged += 1,
                    CameraErrorKind::Lost | CameraErrorKind::Unusable => self.report.lost += 1,
                }
                self.say(Trouble::Camera(kind), &error);
                Some(Trouble::Camera(kind))
            }
        };
        match found {
            None => self.say_mended(),
            Some(found) => place.fail(found),
        }
        bell.ring();
        let took = Duration::from_nanos(clock.now_ns().saturating_sub(called_ns));
        Some(found.map_or(Duration::ZERO, |_| LEAST_FAILING.saturating_sub(took)))
    }

    /// Sums up.
    pub(super) fn end(self) -> PairReport {
        PairReport { delivery: self.delivery.summary(), detect: self.detect.summary(), ..self.report }
    }

    /// Says trouble when it begins or changes, not with every picture.
    fn say(&mut self, found: Trouble, what: &dyn fmt::Display) {
        let now_ns = self.shared.clock.now_ns();
        if self.trouble.is_none_or(|(before, _)| before != found) {
            let text = format_args!("pair {}: {what}", self.report.name);
            self.shared.events.tell(now_ns, Severity::Warning, text);
        }
        let since_ns = self.trouble.map_or(now_ns, |(_, since_ns)| since_ns);
        self.trouble = Some((found, since_ns));
    }

    fn say_mended(&mut self) {
        if let Some((_, since_ns)) = self.trouble.take() {
            let now_ns = self.shared.clock.now_ns();
            let seconds = now_ns.saturating_sub(since_ns) as f64 * 1.0e-9;
            let text = format_args!("pair {}: pictures again after {seconds:.1} s", self.report.name);
            self.shared.events.tell(now_ns, Severity::Note, text);
        }
    }
}

/// A pair that was not looked at, in words; takes no memory.
struct NotLookedAt(DetectError);

impl fmt::Display for NotLookedAt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            DetectError::NotConfigured => f.write_str("the detector is not configured"),
            DetectError::WrongSize { found: (w, h), expected: (width, height) } => write!(
                f,
                "the pictures are {w} x {h}, the calibration is for {width} x {height}; set the camera to the size it was \
                 calibrated with"
            ),
        }
    }
}

/// Touches all memory that pictures of the configured size use, so that no frame has to wait for it, and forgets what it saw.
pub(super) fn warm_up(detector: &mut ProgramDetector, crew: &mut Crew, size: (u32, u32)) {
    let (width, height) = (size.0 as usize, size.1 as usize);
    // Something to match and to make surfaces of.
    let pixels: Vec<u8> = (0..width * height).map(|i| ((i * 2_654_435_761) >> 24) as u8).collect();
    if let Ok(picture) = Picture::packed(&pixels, width, height) {
        let _ = crew.detect(detector, &picture, &picture, &mut ());
    }
}
