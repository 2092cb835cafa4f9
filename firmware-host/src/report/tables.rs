//! The tables of the page.

use fencepost_core::{
    geometry::{CameraModel, StereoCalibration},
    health::{HealthLevel, HealthReason},
};
use serde::Serialize;
use serde_json::Value;

use crate::{
    pipeline::Log,
    score::{CELL_FIGURES, DISPARITY_FIGURES, Figure},
    summary::{self, StageTimes},
    words,
};

#[derive(Serialize)]
pub(super) struct StageRow {
    name: &'static str,
    words: &'static str,
    median: String,
    p99: String,
    max: String,
    bar_percent: f64,
    tick_percent: f64,
}

#[derive(Serialize)]
pub(super) struct HealthRow {
    level: &'static str,
    words: &'static str,
    frames: usize,
    percent: f64,
}

#[derive(Serialize)]
pub(super) struct StripPart {
    level: &'static str,
    title: String,
}

#[derive(Serialize)]
pub(super) struct Setting {
    name: String,
    value: String,
}

/// A score on the page.
#[derive(Serialize)]
pub(super) struct ScoreTable {
    title: &'static str,
    basis: String,
    rows: Vec<ScoreRow>,
}

#[derive(Serialize)]
struct ScoreRow {
    title: &'static str,
    words: &'static str,
    value: String,
}

/// What the run is worth; empty without truth.
pub(super) fn scores(log: &Log) -> Vec<ScoreTable> {
    fn rows<S>(figures: &[Figure<S>], score: &S) -> Vec<ScoreRow> {
        let row = |f: &Figure<S>| ScoreRow { title: f.title, words: f.words, value: f.text(score) };
        figures.iter().map(row).collect()
    }
    let scores = log.scores.clone().unwrap_or_default();
    let cells = scores.cells.map(|score| ScoreTable {
        title: "Cells against lidar",
        basis: format!(
            "{} obstacle cells and {} free ones in {} frames",
            score.truth_obstacle_cells, score.truth_free_cells, score.frames
        ),
        rows: rows(&CELL_FIGURES, &score),
    });
    let disparity = scores.disparity.map(|score| ScoreTable {
        title: "Disparity against truth",
        basis: format!("{} pixels with truth", score.pixels),
        rows: rows(&DISPARITY_FIGURES, &score),
    });
    cells.into_iter().chain(disparity).collect()
}

pub(super) fn stage_rows(stages: &[StageTimes]) -> Vec<StageRow> {
    // The bars of the stages share a scale; the sum would dwarf them and goes without a bar.
    let parts = || stages.iter().filter(|s| s.name != "total");
    let largest = parts().map(|s| s.times.max_ms).fold(1.0e-9, f64::max);
    let text = |ms: f64| if ms < 0.1 { format!("{ms:.3}") } else { format!("{ms:.2}") };
    stages
        .iter()
        .map(|stage| StageRow {
            name: stage.name,
            words: stage.words,
            median: text(stage.times.median_ms),
            p99: text(stage.times.p99_ms),
            max: text(stage.times.max_ms),
            bar_percent: if stage.name == "total" { 0.0 } else { 100.0 * stage.times.median_ms / largest },
            tick_percent: if stage.name == "total" { 0.0 } else { 100.0 * stage.times.max_ms / largest },
        })
        .collect()
}

/// A part for each frame, or for as many frames as give 300 parts, coloured by the worst of them.
pub(super) fn strip(log: &Log) -> Vec<StripPart> {
    const PARTS: usize = 300;
    let mut frames: Vec<(Option<u32>, HealthLevel, String)> = log
        .frames
        .iter()
        .map(|f| (Some(f.number), f.health.level, words::reason_names(f.health, ", ")))
        .chain(log.failures.iter().map(|f| (f.number, HealthLevel::Blind, "missing_picture".to_string())))
        .collect();
    frames.sort_by_key(|(number, ..)| *number);
    let size = frames.len().div_ceil(PARTS).max(1);
    let worst = |part: &[(Option<u32>, HealthLevel, String)]| {
        let (number, level, reasons) = part.iter().max_by_key(|(_, level, _)| *level)?;
        let number = number.map_or_else(|| "?".to_string(), |n| n.to_string());
        let level = words::level_name(*level);
        Some(StripPart { level, title: format!("frame {number}: {level} {reasons}") })
    };
    frames.chunks(size).filter_map(worst).collect()
}

pub(super) fn level_rows(log: &Log) -> Vec<HealthRow> {
    let (levels, _) = summary::health_counts(log);
    let all = (log.frames.len() + log.failures.len()).max(1) as f64;
    let words = |level| match level {
        HealthLevel::Ok => "nothing to say against the cells",
        HealthLevel::Degraded => "usable with care",
        HealthLevel::Blind => "the cells carry nothing",
        HealthLevel::Fault => "the detector does not work",
    };
    let row = |level: HealthLevel| {
        let name = words::level_name(level);
        let frames = levels.get(name).copied().unwrap_or_default();
        HealthRow { level: name, words: words(level), frames, percent: 100.0 * frames as f64 / all }
    };
    words::LEVELS.map(row).into()
}

pub(super) fn reason_rows(log: &Log) -> Vec<HealthRow> {
    let (_, reasons) = summary::health_counts(log);
    let all = (log.frames.len() + log.failures.len()).max(1) as f64;
    let mut rows: Vec<_> = HealthReason::ALL
        .into_iter()
        .map(|reason| {
            let frames = reasons.get(reason.name()).copied().unwrap_or_default();
            HealthRow { level: reason.name(), words: reason.describe(), frames, percent: 100.0 * frames as f64 / all }
        })
        .filter(|row| row.frames > 0)
        .collect();
    rows.sort_by_key(|row| std::cmp::Reverse(row.frames));
    rows
}

/// Every setting with its full name, as it is written in a configuration file.
pub(super) fn settings(settings: &Value) -> Vec<Setting> {
    fn walk(prefix: &str, value: &Value, out: &mut Vec<Setting>) {
        match value {
            Value::Object(map) => {
                for (key, value) in map {
                    let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
                    walk(&name, value, out);
                }
            }
            Value::Number(number) if number.is_f64() => {
                // Settings are 32-bit: written with 64 bits, 0.1 would be 0.10000000149.
                let value = number.as_f64().unwrap_or_default() as f32;
                out.push(Setting { name: prefix.to_string(), value: value.to_string() });
            }
            Value::String(text) => out.push(Setting { name: prefix.to_string(), value: text.clone() }),
            Value::Null => out.push(Setting { name: prefix.to_string(), value: "off".to_string() }),
            other => out.push(Setting { name: prefix.to_string(), value: other.to_string() }),
        }
    }
    let mut out = Vec::new();
    walk("", settings, &mut out);
    out
}

pub(super) fn calibration(calibration: &StereoCalibration) -> Vec<Setting> {
    let setting = |name: &str, value: String| Setting { name: name.to_string(), value };
    match calibration {
        StereoCalibration::Rectified(pair) => vec![
            setting("pictures", format!("{} × {} px, arrive rectified", pair.width, pair.height)),
            setting("focal length", format!("{:.2} px", pair.focal_px)),
            setting("principal point", format!("({:.2}, {:.2}) px", pair.cx, pair.cy)),
            setting("baseline", format!("{:.4} m", pair.baseline_m)),
            setting("disparity offset", format!("{:.2} px", pair.disparity_offset_px)),
        ],
        StereoCalibration::Raw(raw) => {
            let camera = |camera: &CameraModel| {
                let CameraModel { fx, fy, cx, cy, .. } = *camera;
                format!("focal length ({fx:.2}, {fy:.2}) px, principal point ({cx:.2}, {cy:.2}) px")
            };
            let lens = |camera: &CameraModel| {
                let used = camera.distortion.0.iter().rposition(|k| *k != 0.0).map_or(0, |last| last + 1);
                let listed: Vec<_> = camera.distortion.0.iter().take(used).map(|k| format!("{k:.5}")).collect();
                if listed.is_empty() { "no distortion".to_string() } else { listed.join(", ") }
            };
            let [x, y, z] = raw.translation_m;
            vec![
                setting("pictures", format!("{} × {} px, raw", raw.left.width, raw.left.height)),
                setting("left camera", camera(&raw.left)),
                setting("left lens", lens(&raw.left)),
                setting("right camera", camera(&raw.right)),
                setting("right lens", lens(&raw.right)),
                setting("baseline", format!("{:.4} m", (x * x + y * y + z * z).sqrt())),
            ]
        }
    }
}
