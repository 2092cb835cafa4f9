//! `record`: what the cameras of a rig see, without loss, to replay it.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use signal_hook::consts::SIGXFSZ;

use super::Ending;
use crate::{
    cli::RecordArgs,
    config::{Config, Rig, RigPair, RigSource},
    console::Console,
    error::Failure,
    live::{RigCamera, stop_at_signals},
    record::{RecordEnd, RecordEvent, RecordPlan, RecordReport, record},
};

/// A camera that has given nothing for so long is not waited for any longer.
const PATIENCE: Duration = Duration::from_secs(5);

/// Memory for pairs between camera and disk where nobody chose another number of them, bytes.
const QUEUE_BYTES: usize = 64 << 20;

/// Records a pair of a rig until SIGTERM or SIGINT, or as much as is asked for.
///
/// # Errors
/// When the configuration, the camera or the folder cannot be used.
pub fn record_rig(args: &RecordArgs, console: &mut Console) -> Result<Ending, Failure> {
    let config = Config::read_rig(&args.config)?;
    let mut pair = choose(&config.rig, args)?.clone();
    if let RigSource::Camera(settings) = &mut pair.source {
        // What is passed over is lost for good.
        settings.newest_only = false;
    }
    for warning in &pair.warnings {
        console.warn(format_args!("pair {}: {warning}", pair.name));
    }
    let mut camera = RigCamera::open(&pair, true)?;
    for warning in camera.take_warnings() {
        console.warn(format_args!("pair {}: {warning}", pair.name));
    }
    let (width, height) = pair.picture_size();
    let bytes = 2 * width as usize * height as usize;
    let plan = RecordPlan {
        folder: args.out.clone(),
        pair: pair.name.clone(),
        calibration: pair.calibration,
        calibration_files: pair.calibration_files.clone(),
        mount: pair.mount,
        queue_pairs: args.queue.unwrap_or_else(|| (QUEUE_BYTES / bytes.max(1)).clamp(8, 120)),
        frames: args.frames,
        duration: args.seconds.map(Duration::from_secs_f64),
        patience: PATIENCE,
    };
    let stop = stop_at_signals_and_limits()?;
    console.note(format_args!("pair {}: {}, to {}", pair.name, pair.source.describe(), args.out.display()));
    let mut said = Instant::now();
    let report = record(&mut camera, &plan, &stop, |event| match event {
        RecordEvent::Trouble(error) => console.event(format_args!("warning: {error}")),
        RecordEvent::Odd(odd) => console.event(format_args!("warning: {odd}")),
        RecordEvent::Mended => console.event("pictures again"),
        RecordEvent::Status(report) => {
            if said.elapsed() >= Duration::from_secs(2) {
                said = Instant::now();
                console.note(format_args!("{} pairs in {:.0} s", report.recorded, report.seconds));
            }
        }
    })?;
    tell(&report, args, console)
}

fn choose<'a>(rig: &'a Rig, args: &RecordArgs) -> Result<&'a RigPair, Failure> {
    let names = || rig.pairs.iter().map(|pair| pair.name.as_str()).collect::<Vec<_>>().join(", ");
    let place = args.config.display().to_string();
    match (&args.pair, rig.pairs.as_slice()) {
        (None, [only]) => Ok(only),
        (None, _) => Err(Failure::usage("the rig has more than one pair of cameras")
            .at(place)
            .mend(format!("choose one: --pair NAME, of {}", names()))),
        (Some(name), pairs) => pairs.iter().find(|pair| pair.name == *name).ok_or_else(|| {
            Failure::usage(format!("the rig has no pair `{name}`")).at(place).mend(format!("choose from {}", names()))
        }),
    }
}

fn stop_at_signals_and_limits() -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    let caught = stop_at_signals(&stop).and_then(|()| {
        // Where a file becomes larger than is allowed, the write fails and tells so: no reason to be killed.
        signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))
    });
    caught.map_err(|error| Failure::work(format!("signals cannot be caught: {error}")))?;
    debug_assert!(!stop.load(Ordering::Relaxed));
    Ok(stop)
}

fn tell(report: &RecordReport, args: &RecordArgs, console: &mut Console) -> Result<Ending, Failure> {
    let folder = args.out.display();
    console.result(format_args!("{} pairs in {:.1} s, written to {folder}", report.written, report.seconds));
    if let Some(losses) = report.losses() {
        console.warn(format_args!("missing in the recording: {losses}"));
    }
    let kept = match report.written {
        0 => "nothing was recorded".to_string(),
        written => format!("the {written} pairs before it can be replayed: fencepost replay {folder} --out DIR"),
    };
    match &report.end {
        RecordEnd::Camera(error) => Err(Failure::work(format!("the camera delivers nothing any more: {error}"))
            .at(format!("pair {}", report.pair))
            .mend(format!("mend the camera and record again; {kept}"))),
        RecordEnd::Disk(error) => Err(Failure::work(format!("the recording ends here: {error}"))
            .at(folder.to_string())
            .mend(format!("make room on the disk; {kept}"))),
        RecordEnd::Running | RecordEnd::Enough | RecordEnd::Asked | RecordEnd::SourceEnded => Ok(Ending::Good),
    }
}
