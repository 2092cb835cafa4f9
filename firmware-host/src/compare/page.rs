//! `report.html` of a comparison.

use fencepost_core::methods::DetectorKind;
use serde::Serialize;

use super::{Method, Outcome, SidePictures, pictures::mistake_colour};
use crate::{
    console::WarningCount,
    error::Failure,
    paint,
    report::{self, Embedded},
    score::{CELL_FIGURES, DISPARITY_FIGURES, Figure, Mistake},
    source::Input,
    summary::{self, StageTimes},
    words,
};

const TEMPLATE: &str = include_str!("compare.html");

/// What the template is given.
#[derive(Serialize)]
struct Page<'a> {
    name: &'a str,
    description: &'a str,
    version: &'static str,
    warnings: &'a [WarningCount],
    failures: Vec<String>,
    frame_count: usize,
    detectors: Vec<Detector>,
    scores: Vec<ScoreTable>,
    frames: Vec<Frame<'a>>,
    stages: Vec<StageRow>,
    health: Vec<HealthRow>,
    ground_colour: String,
    obstacle_colour: String,
    mistakes: Vec<MistakeKey>,
    has_costs: bool,
}

/// What the frame around a cell means.
#[derive(Serialize)]
struct MistakeKey {
    words: &'static str,
    colour: String,
}

#[derive(Serialize)]
struct Detector {
    name: &'static str,
    words: &'static str,
    total_ms: String,
    p99_ms: String,
    bar_percent: f64,
    memory: String,
    own_memory: String,
}

/// One kind of score: a row for each detector, a column for each figure.
#[derive(Serialize)]
struct ScoreTable {
    title: &'static str,
    basis: String,
    columns: Vec<Column>,
    rows: Vec<ScoreRow>,
}

#[derive(Serialize)]
struct Column {
    title: &'static str,
    words: &'static str,
}

#[derive(Serialize)]
struct ScoreRow {
    name: String,
    values: Vec<Value>,
}

#[derive(Serialize)]
struct Value {
    text: String,
    best: bool,
}

/// A frame: the truth, and what each detector makes of it.
#[derive(Serialize)]
struct Frame<'a> {
    number: u32,
    left: &'a Embedded,
    truth: Option<&'a Embedded>,
    sides: Vec<Side<'a>>,
}

#[derive(Serialize)]
struct Side<'a> {
    name: &'static str,
    facts: String,
    pictures: &'a SidePictures,
}

#[derive(Serialize)]
struct StageRow {
    name: &'static str,
    words: &'static str,
    times: Vec<Option<StageTime>>,
}

#[derive(Serialize)]
struct StageTime {
    median: String,
    p99: String,
}

#[derive(Serialize)]
struct HealthRow {
    name: &'static str,
    levels: Vec<(&'static str, usize)>,
    ground_seen: usize,
}

/// The page.
///
/// # Errors
/// When the template does not fit what it is given, which is a mistake of the program.
pub fn page<S>(input: &Input<S>, outcomes: &[Outcome], warnings: &[WarningCount]) -> Result<String, Failure> {
    let first = outcomes.first();
    let failures = first.map_or(&[][..], |outcome| &outcome.log.failures);
    report::fill(
        TEMPLATE,
        Page {
            name: &input.name,
            description: &input.description,
            version: env!("CARGO_PKG_VERSION"),
            warnings,
            failures: failures.iter().map(|f| f.failure.to_string().replace("\n  ", " — ")).collect(),
            frame_count: first.map_or(0, |outcome| outcome.log.frames.len()),
            detectors: detectors(outcomes),
            scores: scores(outcomes),
            frames: frames(outcomes),
            stages: stages(outcomes),
            health: outcomes.iter().map(health).collect(),
            ground_colour: paint::hex(paint::GROUND),
            obstacle_colour: paint::hex(paint::OBSTACLE),
            mistakes: mistake_keys(outcomes),
            has_costs: outcomes.iter().any(|o| o.method == Method::Core(DetectorKind::CostMap)),
        },
    )
}

/// Only where there is truth of the cells.
fn mistake_keys(outcomes: &[Outcome]) -> Vec<MistakeKey> {
    let key = |(mistake, words)| MistakeKey { words, colour: paint::hex(mistake_colour(mistake)) };
    let keys = [
        (Mistake::Missed, "an obstacle that is not reported"),
        (Mistake::CalledFree, "one that is called free"),
        (Mistake::NotThere, "a reported one that is not there"),
    ];
    let has_truth = outcomes.iter().flat_map(|outcome| &outcome.pictures).any(|pictures| pictures.truth.is_some());
    keys.map(key).into_iter().filter(|_| has_truth).collect()
}

fn detectors(outcomes: &[Outcome]) -> Vec<Detector> {
    let total =
        |outcome: &Outcome| summary::stage_times(&outcome.log.frames).pop().map(|s| s.times).unwrap_or_default();
    // One that no robot would run would dwarf the bars of the others and goes without.
    let has_bar = |outcome: &Outcome| outcome.memory_bytes.is_some();
    let longest_ms =
        outcomes.iter().filter(|o| has_bar(o)).map(|outcome| total(outcome).median_ms).fold(1.0e-9, f64::max);
    let detector = |outcome: &Outcome| {
        let times = total(outcome);
        Detector {
            name: outcome.method.name(),
            words: outcome.method.words(),
            total_ms: milliseconds(times.median_ms),
            p99_ms: milliseconds(times.p99_ms),
            bar_percent: if has_bar(outcome) { 100.0 * times.median_ms / longest_ms } else { 0.0 },
            memory: memory(outcome.memory_bytes),
            own_memory: memory(outcome.own_memory_bytes),
        }
    };
    outcomes.iter().map(detector).collect()
}

fn scores(outcomes: &[Outcome]) -> Vec<ScoreTable> {
    let scores = |outcome: &Outcome| outcome.log.scores.clone().unwrap_or_default();
    let cells: Vec<_> = outcomes.iter().filter_map(|o| Some((o.method.name(), scores(o).cells?))).collect();
    let disparity: Vec<_> = outcomes.iter().filter_map(|o| Some((o.method.name(), scores(o).disparity?))).collect();
    let mut tables = Vec::new();
    if let Some((_, score)) = cells.first() {
        let basis = format!(
            "{} obstacle cells and {} free ones in {} frames, from lidar sweeps, 4 to 20 m ahead and up to 10 m to either \
             side; a cell of slack is allowed in every direction.",
            score.truth_obstacle_cells, score.truth_free_cells, score.frames
        );
        tables.push(score_table("Cells against lidar", basis, &CELL_FIGURES, &cells));
    }
    if let Some((_, score)) = disparity.first() {
        let basis = format!("{} pixels whose disparity is known.", score.pixels);
        // Detectors that work on the same disparities have the same figures.
        let alike = disparity.len() > 1 && disparity.iter().all(|(_, other)| other == score);
        let rows = if alike { vec![("every detector", *score)] } else { disparity };
        tables.push(score_table("Disparity against truth", basis, &DISPARITY_FIGURES, &rows));
    }
    tables
}

fn score_table<S>(title: &'static str, basis: String, figures: &[Figure<S>], rows: &[(&'static str, S)]) -> ScoreTable {
    let value = |figure: &Figure<S>, score: &S| Value {
        text: figure.text(score),
        best: rows.len() > 1 && figure.is_best(score, rows.iter().map(|(_, score)| score)),
    };
    let row = |(name, score): &(&'static str, S)| ScoreRow {
        name: (*name).to_string(),
        values: figures.iter().map(|figure| value(figure, score)).collect(),
    };
    ScoreTable {
        title,
        basis,
        columns: figures.iter().map(|f| Column { title: f.title, words: f.words }).collect(),
        rows: rows.iter().map(row).collect(),
    }
}

/// The frames that every detector shows.
fn frames(outcomes: &[Outcome]) -> Vec<Frame<'_>> {
    let Some((first, _)) = outcomes.split_first() else { return Vec::new() };
    let side = |outcome: &'_ Outcome, number: u32| {
        let index = outcome.pictures.iter().position(|pictures| pictures.number == number)?;
        Some((outcome.method.name(), facts(outcome, number), index))
    };
    first
        .pictures
        .iter()
        .map(|shown| {
            let of = |outcome| {
                let (name, facts, index) = side(outcome, shown.number)?;
                let outcome: &Outcome = outcome;
                Some(Side { name, facts, pictures: outcome.pictures.get(index)? })
            };
            let sides = outcomes.iter().filter_map(of).collect();
            Frame { number: shown.number, left: &shown.left, truth: shown.truth.as_ref(), sides }
        })
        .collect()
}

/// What a frame of a detector is like, in a line.
fn facts(outcome: &Outcome, number: u32) -> String {
    let Some(record) = outcome.log.frames.iter().find(|record| record.number == number) else { return String::new() };
    let cells = format!("{} obstacle cells, {} free", record.statistics.cells_obstacle, record.statistics.cells_free);
    let score = record.cell_counts.and_then(|counts| counts.score()).map_or_else(String::new, |score| {
        format!(
            " · F1 {:.3}, false alarms {:.4}, called free {:.4}, free found {:.3}",
            score.f1, score.false_alarm, score.missed_free, score.free_found
        )
    });
    format!("{cells}{score}")
}

/// A row for each stage that any detector has, in the order in which they run.
fn stages(outcomes: &[Outcome]) -> Vec<StageRow> {
    let all: Vec<Vec<StageTimes>> = outcomes.iter().map(|o| summary::stage_times(&o.log.frames)).collect();
    let Some(longest) = all.iter().max_by_key(|stages| stages.len()) else { return Vec::new() };
    let time = |stages: &Vec<StageTimes>, name: &str| {
        let times = stages.iter().find(|stage| stage.name == name)?.times;
        // What a detector does not do takes no time at all.
        (times.max_ms > 0.0)
            .then(|| StageTime { median: milliseconds(times.median_ms), p99: milliseconds(times.p99_ms) })
    };
    let row = |stage: &StageTimes| StageRow {
        name: stage.name,
        words: stage.words,
        times: all.iter().map(|stages| time(stages, stage.name)).collect(),
    };
    longest.iter().map(row).collect()
}

fn health(outcome: &Outcome) -> HealthRow {
    let (levels, _) = summary::health_counts(&outcome.log);
    let level = |name| (name, levels.get(name).copied().unwrap_or_default());
    HealthRow {
        name: outcome.method.name(),
        levels: words::LEVELS.map(words::level_name).map(level).into(),
        ground_seen: outcome.log.frames.iter().filter(|f| f.ground.is_some_and(|g| g.age_frames == 0)).count(),
    }
}

fn memory(bytes: Option<usize>) -> String {
    bytes.map_or_else(|| "heap".to_string(), words::bytes)
}

fn milliseconds(ms: f64) -> String {
    if ms < 0.1 { format!("{ms:.3}") } else { format!("{ms:.2}") }
}
