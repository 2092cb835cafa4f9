//! One run of the detector over a source of pictures, with everything that is written for each frame.

use std::time::{Duration, Instant};

use fencepost_core::{
    detector::{DetectError, Statistics},
    health::{Health, HealthLevel, HealthReason},
    map::{CellState, MapGeometry},
    picture::Picture,
    rectify::Side,
    settings::Settings,
    wire::{WireConfig, WireSettings},
};
use fencepost_hal::camera::StereoPair;

use crate::{
    can_log::{CanCounts, CanLog},
    cli::Output,
    config::Config,
    console::Console,
    detector::{self, ProgramDetector},
    error::Failure,
    normalized_cuts::NormalizedCutSettings,
    output::{CellRow, OutputFolder, Tables},
    paint,
    reference::Reference,
    report::{Painter, Shown},
    score::{CellCounts, Scorer, Scores},
    source::{Input, Source},
    stopwatch::{FrameTimes, Stopwatch, milliseconds},
    view::FrameView,
    words,
};

/// Everything a run needs besides its pictures.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    /// Where to write.
    pub folder: &'a OutputFolder,
    /// What to write.
    pub write: &'a [Output],
    /// Most frames that are painted for a report.
    pub show: usize,
    /// Settings of the detector.
    pub settings: Settings,
    /// Settings of the detector outside the core, where that has the last word.
    pub normalized_cuts: Option<NormalizedCutSettings>,
    /// Settings of the bus.
    pub wire: WireSettings,
    /// The configuration file, for errors.
    pub config: &'a Config,
}

/// What a run found, frame by frame.
#[derive(Clone, Debug, Default)]
pub struct Log {
    /// Frames that were looked at.
    pub frames: Vec<FrameRecord>,
    /// Frames that could not be used.
    pub failures: Vec<FrameFailure>,
    /// What went on the bus.
    pub can: CanCounts,
    /// What it is worth, where the recording brings the truth.
    pub scores: Option<Scores>,
}

/// What is kept of each frame.
#[derive(Clone, Debug)]
pub struct FrameRecord {
    /// Its number.
    pub number: u32,
    /// Time of exposure, nanoseconds.
    pub timestamp_ns: u64,
    /// Times of the stages.
    pub times: FrameTimes,
    /// How far it can be trusted.
    pub health: Health,
    /// The ground.
    pub ground: Option<fencepost_core::ground::GroundPlane>,
    /// Counts of the detector.
    pub statistics: Statistics,
    /// Obstacles.
    pub obstacles: usize,
    /// Distance from the vehicle's origin to the centre of the nearest obstacle cell, metres.
    pub nearest_m: Option<f32>,
    /// What the cells are worth, where there is truth of them.
    pub cell_counts: Option<CellCounts>,
}

/// A frame that could not be used.
#[derive(Clone, Debug)]
pub struct FrameFailure {
    /// Its number, where it is known.
    pub number: Option<u32>,
    /// Its time, where it is known.
    pub timestamp_ns: Option<u64>,
    /// Why.
    pub failure: Failure,
}

/// Runs the detector over every frame of `input`. A frame that cannot be used is said, counted and left out.
///
/// # Errors
/// When the calibration, the mount or the settings cannot be used, or the output cannot be written.
pub fn run<S: Source, P: Painter>(
    input: &mut Input<S>,
    job: &Job<'_>,
    painter: P,
    console: &mut Console,
    progress: &'static str,
) -> Result<(Log, Shown<P>), Failure> {
    let mut detector = detector::lock();
    detector
        .configure(&job.settings, &input.calibration, &input.mount)
        .map_err(|error| Failure::config(error, job.config.file.as_deref()))?;
    let mut pipeline = Pipeline::start(job, painter, &detector, input)?;
    console.start_progress(input.frames, progress);
    let result = pipeline.play(input, &mut detector, console);
    console.end_progress();
    // Whatever happened, the bus is told that the node stops, and what was found so far is handed on.
    let Pipeline { can, mut log, shown, scorer, .. } = pipeline;
    log.can = can.finish()?;
    log.scores = scorer.and_then(|scorer| scorer.scores());
    result?;
    Ok((log, shown))
}

struct Pipeline<'a, P: Painter> {
    job: &'a Job<'a>,
    tables: Option<Tables>,
    can: CanLog,
    shown: Shown<P>,
    scorer: Option<Scorer>,
    reference: Option<Reference>,
    log: Log,
    /// The left rectified picture, where pictures are wanted.
    left: Vec<u8>,
}

impl<'a, P: Painter> Pipeline<'a, P> {
    fn start<S>(job: &'a Job<'a>, painter: P, detector: &ProgramDetector, input: &Input<S>) -> Result<Self, Failure> {
        let config = WireConfig::new(job.wire).map_err(|e| Failure::config(e, job.config.file.as_deref()))?;
        let reference = job.normalized_cuts.as_ref();
        let reference =
            reference.map(|cuts| Reference::new(cuts, &job.settings, detector, &input.mount)).transpose()?;
        let folder = job.folder;
        let wants = |output| job.write.contains(&output);
        for (output, name) in [(Output::Disparity, "disparity"), (Output::Classes, "classes"), (Output::Map, "map")] {
            if wants(output) {
                folder.picture_folder(name)?;
            }
        }
        let (width, height) = detector.pair().map_or((0, 0), |pair| (pair.width as usize, pair.height as usize));
        Ok(Self {
            job,
            tables: if wants(Output::Cells) { Some(Tables::create(folder)?) } else { None },
            can: CanLog::create(wants(Output::Can).then_some(folder), config)?,
            shown: Shown::new(painter, job.show, input.frames),
            reference,
            scorer: input.truth.clone().map(|truth| Scorer::new(truth, job.settings.map.geometry)),
            log: Log::default(),
            left: vec![0; width * height],
        })
    }

    fn play<S: Source>(
        &mut self,
        input: &mut Input<S>,
        detector: &mut ProgramDetector,
        console: &mut Console,
    ) -> Result<(), Failure> {
        loop {
            let upcoming = input.source.upcoming();
            let result = input.source.next_pair(|pair| self.frame(pair, detector));
            for warning in input.source.take_warnings() {
                console.warn(warning);
            }
            for complaint in self.scorer.iter_mut().flat_map(Scorer::take_complaints) {
                console.warn_of_kind("truth", complaint);
            }
            match result {
                Ok(None) => return Ok(()),
                Ok(Some(Ok(health))) => say_health(console, self.log.frames.last(), health),
                Ok(Some(Err(FrameError::Output(failure)))) => return Err(failure),
                Ok(Some(Err(FrameError::Frame(failure)))) => self.missing(upcoming, failure, console)?,
                Err(error) => self.missing(upcoming, error.into(), console)?,
            }
            console.progress();
        }
    }

    fn missing(
        &mut self,
        upcoming: Option<(u32, u64)>,
        failure: Failure,
        console: &mut Console,
    ) -> Result<(), Failure> {
        console.error_once(&failure);
        let (number, timestamp_ns) = upcoming.unzip();
        self.can.missing(timestamp_ns)?;
        self.shown.skipped();
        if let (Some(scorer), Some(number)) = (&mut self.scorer, number) {
            scorer.missing(number);
        }
        self.log.failures.push(FrameFailure { number, timestamp_ns, failure });
        Ok(())
    }

    fn frame(&mut self, pair: &StereoPair<'_>, detector: &mut ProgramDetector) -> Result<Health, FrameError> {
        let mut watch = Stopwatch::default();
        let start = Instant::now();
        let detected = detector.detect(&pair.left, &pair.right, &mut watch).map(|_| ());
        let mut times = watch.finish(start.elapsed());
        detected.map_err(|error| FrameError::Frame(not_looked_at(error, pair.sequence)))?;

        if self.needs_left() {
            rectify_left(detector, &pair.left, &mut self.left);
        }
        let (Some(rectified), Some(vehicle)) = (detector.pair(), detector.frame()) else {
            return Err(FrameError::Frame(not_looked_at(DetectError::NotConfigured, pair.sequence)));
        };
        let left = Picture::packed(&self.left, rectified.width as usize, rectified.height as usize)
            .map_err(|error| FrameError::Frame(Failure::work(error.to_string())))?;
        let detection = detector.detection();
        let surface_at = |x: usize, y: usize| detector.surface_at(x, y).copied();
        let mut view = FrameView {
            number: pair.sequence,
            timestamp_ns: pair.timestamp_ns,
            left,
            disparity: detector.disparity(),
            detection,
            health: detection.health,
            pair: rectified,
            vehicle,
            surface_at: &surface_at,
        };
        let start = Instant::now();
        let seen = self.reference.as_ref().map(|reference| reference.look(&view));
        let seen_at = |x: usize, y: usize| seen.as_ref().and_then(|seen| seen.surface_at(x, y));
        if let Some(seen) = &seen {
            times.reference_ms = milliseconds(start.elapsed());
            times.total_ms += times.reference_ms;
            view.detection = seen.detection();
            view.surface_at = &seen_at;
        }
        let detection = view.detection;
        let sent = self.can.scan(&view)?;
        view.health = self.can.health();
        times.wire_ms = milliseconds(sent.encoding);
        times.total_ms += times.wire_ms;
        if let Some(tables) = &mut self.tables {
            tables.frame(&view, &sent.cells)?;
        }
        self.pictures(&view)?;
        let score = |scorer: &mut Scorer| scorer.frame(view.number, &sent.cells, view.disparity);
        let cell_counts = self.scorer.as_mut().and_then(score);
        let record = FrameRecord {
            number: view.number,
            timestamp_ns: view.timestamp_ns,
            times,
            health: view.health,
            ground: detection.ground,
            statistics: detection.statistics,
            obstacles: detection.obstacles.len(),
            nearest_m: nearest_cell_m(&sent.cells, &detection.map.geometry),
            cell_counts,
        };
        self.log.frames.push(record);
        self.shown.frame(&view, &self.job.settings);
        Ok(view.health)
    }

    fn wants(&self, output: Output) -> bool {
        self.job.write.contains(&output)
    }

    fn needs_left(&self) -> bool {
        self.wants(Output::Classes) || self.shown.wants_frame() || self.reference.is_some()
    }

    /// The pictures of a frame; made after its times were taken.
    fn pictures(&self, view: &FrameView<'_>) -> Result<(), Failure> {
        let folder = self.job.folder;
        let (width, height) = view.size();
        if self.wants(Output::Disparity) {
            let png = paint::grey16_png(width, height, &paint::disparity16(view.disparity));
            folder.picture("disparity", view.number, &png)?;
        }
        if self.wants(Output::Classes) {
            folder.picture("classes", view.number, &paint::classes(view).png())?;
        }
        if self.wants(Output::Map) {
            folder.picture("map", view.number, &paint::birdseye(view).png())?;
        }
        Ok(())
    }
}

/// What can go wrong with a frame.
enum FrameError {
    /// The frame: the next one may be good.
    Frame(Failure),
    /// The output: no frame can be written.
    Output(Failure),
}

impl From<Failure> for FrameError {
    fn from(failure: Failure) -> Self {
        Self::Output(failure)
    }
}

fn nearest_cell_m(cells: &[CellRow], geometry: &MapGeometry) -> Option<f32> {
    let obstacles = cells.iter().filter(|row| row.content.state == CellState::Obstacle);
    let distances = obstacles.map(|row| geometry.centre_m(row.cell.0, row.cell.1)).map(|(x, y)| x.hypot(y));
    distances.reduce(f32::min)
}

fn rectify_left(detector: &ProgramDetector, raw: &Picture<'_>, out: &mut [u8]) {
    let width = detector.pair().map_or(1, |pair| pair.width.max(1) as usize);
    for (y, row) in out.chunks_exact_mut(width).enumerate() {
        detector.rectifier().row(Side::Left, raw, y, row);
    }
}

fn not_looked_at(error: DetectError, number: u32) -> Failure {
    match error {
        DetectError::NotConfigured => Failure::work(format!("frame {number}: the detector is not configured")),
        DetectError::WrongSize { found, expected } => Failure::work(format!(
            "frame {number}: the picture is {} x {}, but the calibration is for {} x {}",
            found.0, found.1, expected.0, expected.1
        ))
        .mend("use the calibration that was made at the size of the pictures"),
    }
}

/// Says how a frame went, to who asked for it, and what makes it less than true: each reason for its first frames, the rest are counted.
fn say_health(console: &mut Console, record: Option<&FrameRecord>, health: Health) {
    if let Some(FrameRecord { number, times, obstacles, .. }) = record {
        let level = words::level_name(health.level);
        console.note(format_args!("frame {number}: {obstacles} obstacles, health {level}, {:.1} ms", times.total_ms));
    }
    if health.level == HealthLevel::Ok {
        return;
    }
    let number = record.map_or(0, |record| record.number);
    for reason in HealthReason::ALL.into_iter().filter(|reason| health.has(*reason)) {
        console.warn_of_kind(reason.name(), format_args!("frame {number}: {}", reason.describe()));
    }
}

/// Time between two instants of a run, for people.
pub fn seconds(duration: Duration) -> String {
    format!("{:.1} s", duration.as_secs_f64())
}
