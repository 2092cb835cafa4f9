//! `summary.json`, and the table that the terminal shows.

use std::collections::BTreeMap;

use fencepost_core::{
    detector::Stage,
    disparity::Reason,
    geometry::{CameraModel, Mount, RectifiedPair, StereoCalibration},
    health::HealthReason,
};
use serde::Serialize;
use serde_json::{Value, json};

use crate::{
    console::WarningCount,
    error::Failure,
    output::OutputFolder,
    pipeline::{FrameRecord, Job, Log},
    source::Input,
    stopwatch::TimeSummary,
    words,
};

/// Times of a stage.
#[derive(Clone, Debug, Serialize)]
pub struct StageTimes {
    /// Name of the stage, `wire` or `total`.
    pub name: &'static str,
    /// What it does.
    #[serde(skip)]
    pub words: &'static str,
    /// Its times.
    #[serde(flatten)]
    pub times: TimeSummary,
}

/// Times of each stage, of the wire and of the whole, in the order in which they run.
pub fn stage_times(frames: &[FrameRecord]) -> Vec<StageTimes> {
    let stage = |stage: Stage| StageTimes {
        name: stage.name(),
        words: words::stage_words(stage),
        times: TimeSummary::of(frames.iter().map(|frame| frame.times.stages_ms[stage as usize])),
    };
    let mut stages: Vec<_> = Stage::ALL.into_iter().map(stage).collect();
    if frames.iter().any(|frame| frame.times.reference_ms > 0.0) {
        stages.push(StageTimes {
            name: "reference",
            words: "segments the picture by normalized cuts, outside the core",
            times: TimeSummary::of(frames.iter().map(|frame| frame.times.reference_ms)),
        });
    }
    stages.push(StageTimes {
        name: "wire",
        words: "packs the scan into CAN frames",
        times: TimeSummary::of(frames.iter().map(|frame| frame.times.wire_ms)),
    });
    stages.push(StageTimes {
        name: "total",
        words: "from the pair of pictures to the CAN frames",
        times: TimeSummary::of(frames.iter().map(|frame| frame.times.total_ms)),
    });
    stages
}

/// Number of frames at each level, and with each reason.
pub fn health_counts(log: &Log) -> (BTreeMap<&'static str, usize>, BTreeMap<&'static str, usize>) {
    let mut levels: BTreeMap<_, _> = words::LEVELS.map(|level| (words::level_name(level), 0)).into();
    let mut reasons: BTreeMap<_, _> = HealthReason::ALL.map(|reason| (reason.name(), 0)).into();
    for frame in &log.frames {
        *levels.entry(words::level_name(frame.health.level)).or_default() += 1;
        for reason in HealthReason::ALL.into_iter().filter(|reason| frame.health.has(*reason)) {
            *reasons.entry(reason.name()).or_default() += 1;
        }
    }
    // A frame that could not be used is blind: the heartbeat said so.
    *levels.entry("blind").or_default() += log.failures.len();
    *reasons.entry(HealthReason::MissingPicture.name()).or_default() += log.failures.len();
    (levels, reasons)
}

/// The summary as it is written.
pub fn summary<S>(input: &Input<S>, job: &Job<'_>, log: &Log, warnings: &[WarningCount]) -> Value {
    let (levels, reasons) = health_counts(log);
    let stages: serde_json::Map<_, _> =
        stage_times(&log.frames).into_iter().map(|stage| (stage.name.to_string(), json!(stage.times))).collect();
    let failures: Vec<_> = log
        .failures
        .iter()
        .map(|f| json!({"frame": f.number, "what": f.failure.what, "where": f.failure.place, "mend": f.failure.mend}))
        .collect();
    json!({
        "program": concat!("fencepost ", env!("CARGO_PKG_VERSION")),
        "recording": {"name": input.name, "description": input.description},
        "detector": job.settings.detector,
        "cross_check": job.settings.cross_check,
        "frames": {
            "detected": log.frames.len(),
            "failed": log.failures.len(),
            "first": log.frames.first().map(|f| f.number),
            "last": log.frames.last().map(|f| f.number),
            "duration_s": duration_s(&log.frames),
        },
        "stages": stages,
        "counts": counts(log),
        "ground": ground(&log.frames),
        "health": {"levels": levels, "reasons": reasons},
        "can": log.can,
        "score": log.scores,
        "warnings": warnings,
        "failures": failures,
        "settings": job.settings,
        "wire": job.wire,
        "mount": input.mount,
        "calibration": calibration(&input.calibration),
    })
}

/// Writes a summary to a folder.
///
/// # Errors
/// When it cannot be written.
pub fn write(folder: &OutputFolder, name: &str, summary: &Value) -> Result<(), Failure> {
    let mut text = serde_json::to_string_pretty(summary)
        .map_err(|error| Failure::work(format!("the summary cannot be made: {error}")).at(name))?;
    text.push('\n');
    folder.write(name, text.as_bytes())
}

/// Time from the first to the last frame, seconds.
pub fn duration_s(frames: &[FrameRecord]) -> f64 {
    let span = frames.first().zip(frames.last());
    span.map_or(0.0, |(first, last)| last.timestamp_ns.saturating_sub(first.timestamp_ns) as f64 * 1.0e-9)
}

fn counts(log: &Log) -> Value {
    let sum = |count: &dyn Fn(&FrameRecord) -> u64| log.frames.iter().map(count).sum::<u64>();
    let without: serde_json::Map<_, _> = Reason::ALL
        .into_iter()
        .map(|reason| {
            let pixels = sum(&|f| f.statistics.pixels_without.get(reason as usize).map_or(0, |n| u64::from(*n)));
            (reason.name().to_string(), json!(pixels))
        })
        .collect();
    json!({
        "pixels_with_disparity": sum(&|f| f.statistics.pixels_with_disparity.into()),
        "pixels_without": without,
        "surfaces": sum(&|f| f.statistics.surfaces.into()),
        "surfaces_dropped": sum(&|f| f.statistics.surfaces_dropped.into()),
        "surfaces_horizontal": sum(&|f| f.statistics.surfaces_horizontal.into()),
        "surfaces_vertical": sum(&|f| f.statistics.surfaces_vertical.into()),
        "obstacles": sum(&|f| f.obstacles as u64),
        "obstacles_dropped": sum(&|f| f.statistics.obstacles_dropped.into()),
        "cells_obstacle": sum(&|f| f.statistics.cells_obstacle.into()),
        "cells_free": sum(&|f| f.statistics.cells_free.into()),
        "cells_disputed": sum(&|f| f.statistics.cells_disputed.into()),
        "cells_unconfirmed": sum(&|f| f.statistics.cells_unconfirmed.into()),
        "cells_dropped": log.can.dropped_cells,
    })
}

fn ground(frames: &[FrameRecord]) -> Value {
    let seen: Vec<_> = frames.iter().filter_map(|f| f.ground).filter(|g| g.age_frames == 0).collect();
    let held = frames.iter().filter_map(|f| f.ground).filter(|g| g.age_frames > 0).count();
    let median = |value: &dyn Fn(&fencepost_core::ground::GroundPlane) -> f32| {
        let mut values: Vec<_> = seen.iter().map(value).collect();
        values.sort_by(f32::total_cmp);
        values.get(values.len().saturating_sub(1) / 2).copied()
    };
    json!({
        "frames_seen": seen.len(),
        "frames_held": held,
        "frames_without": frames.len() - seen.len() - held,
        "camera_height_m": median(&|g| g.camera_height_m),
        "pitch_down_deg": median(&|g| g.pitch_down_rad.to_degrees()),
        "roll_deg": median(&|g| g.roll_rad.to_degrees()),
    })
}

fn calibration(calibration: &StereoCalibration) -> Value {
    match calibration {
        StereoCalibration::Rectified(pair) => json!({"kind": "rectified", "pair": rectified(pair)}),
        StereoCalibration::Raw(raw) => json!({
            "kind": "raw",
            "left": camera(&raw.left),
            "right": camera(&raw.right),
            "rotation": raw.rotation,
            "translation_m": raw.translation_m,
            "rectified": raw.rectification.map(|r| rectified(&r.pair)),
        }),
    }
}

fn rectified(pair: &RectifiedPair) -> Value {
    json!({
        "width": pair.width,
        "height": pair.height,
        "focal_px": pair.focal_px,
        "cx": pair.cx,
        "cy": pair.cy,
        "baseline_m": pair.baseline_m,
        "disparity_offset_px": pair.disparity_offset_px,
    })
}

fn camera(camera: &CameraModel) -> Value {
    json!({
        "width": camera.width,
        "height": camera.height,
        "fx": camera.fx,
        "fy": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
        "distortion": camera.distortion.0,
    })
}

/// The mount in words.
pub fn mount_words(mount: &Mount) -> String {
    let height = match mount.height_m {
        Some(height_m) => format!("{height_m:.2} m above the ground"),
        None => format!("height not known, {:.2} m assumed", Mount::ASSUMED_HEIGHT_M),
    };
    let Mount { pitch_down_deg, roll_deg, forward_m, left_m, yaw_left_deg, .. } = mount;
    let tilt = format!("{height}, pitched down {pitch_down_deg:.1}°, rolled {roll_deg:.1}°");
    if mount.without_place() == *mount {
        return tilt;
    }
    format!(
        "{tilt}, {forward_m:.2} m ahead and {left_m:.2} m to the left of the origin, looking {yaw_left_deg:.1}° to the left"
    )
}

/// The table for the terminal.
pub fn table(log: &Log) -> String {
    let mut lines = vec![format!("{:<11} {:>10} {:>10} {:>10}", "stage", "median ms", "p99 ms", "max ms")];
    for stage in stage_times(&log.frames) {
        let TimeSummary { median_ms, p99_ms, max_ms } = stage.times;
        lines.push(format!("{:<11} {median_ms:>10.2} {p99_ms:>10.2} {max_ms:>10.2}", stage.name));
    }
    let frames = log.frames.len().max(1) as f64;
    let pixels = |f: &FrameRecord| {
        let without: u32 = f.statistics.pixels_without.iter().sum();
        f64::from(f.statistics.pixels_with_disparity) / f64::from((f.statistics.pixels_with_disparity + without).max(1))
    };
    let mean = |value: &dyn Fn(&FrameRecord) -> f64| log.frames.iter().map(value).sum::<f64>() / frames;
    let (levels, _) = health_counts(log);
    let levels: Vec<_> = words::LEVELS
        .map(words::level_name)
        .into_iter()
        .filter_map(|name| levels.get(name).filter(|n| **n > 0).map(|n| format!("{n} {name}")))
        .collect();
    let ground = ground(&log.frames);
    let figure = |name: &str| ground.get(name).and_then(Value::as_f64);
    lines.push(String::new());
    lines.push(format!("frames      {} detected, {} failed", log.frames.len(), log.failures.len()));
    lines.push(format!(
        "health      {}",
        if levels.is_empty() { "nothing seen".to_string() } else { levels.join(", ") }
    ));
    lines.push(format!("disparity   {:.0} % of the pixels", 100.0 * mean(&pixels)));
    lines.push(match (figure("camera_height_m"), figure("pitch_down_deg")) {
        (Some(height), Some(pitch)) => {
            format!("ground      camera {height:.2} m above it, pitched down {pitch:.1}° (median)")
        }
        _ => "ground      not seen".to_string(),
    });
    lines.push(format!(
        "map         {:.1} obstacles, {:.0} obstacle cells and {:.0} free cells in a frame",
        mean(&|f| f.obstacles as f64),
        mean(&|f| f64::from(f.statistics.cells_obstacle)),
        mean(&|f| f64::from(f.statistics.cells_free)),
    ));
    lines.push(format!(
        "CAN         {} frames: {} scans of at most {} frames, {} heartbeats",
        log.can.frames, log.can.scans, log.can.most_frames_per_scan, log.can.heartbeats
    ));
    lines.extend(score_lines(log));
    lines.join("\n")
}

/// What the scores say, for the terminal.
fn score_lines(log: &Log) -> Vec<String> {
    let scores = log.scores.clone().unwrap_or_default();
    let cells = scores.cells.map(|s| {
        format!(
            "truth       cells: F1 {:.3}, false alarms {:.4}, obstacles called free {:.4}, free cells found {:.3} ({} frames \
             with lidar)",
            s.f1, s.false_alarm, s.missed_free, s.free_found, s.frames
        )
    });
    let disparity = scores.disparity.map(|s| {
        format!(
            "truth       disparity: density {:.3}, off by more than 3 px {:.4}, by more than 1 px {:.4}",
            s.density, s.bad3, s.bad1
        )
    });
    cells.into_iter().chain(disparity).collect()
}
