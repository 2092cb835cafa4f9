//! The page around the figures.

use fencepost_core::{
    geometry::{Mount, StereoCalibration},
    health::HealthLevel,
};
use minijinja::Environment;
use serde::Serialize;
use serde_json::Value;

use super::{
    ReportFrame,
    charts::{Chart, Series},
    tables::{self, HealthRow, ScoreTable, Setting, StageRow, StripPart},
};
use crate::{
    console::WarningCount,
    error::Failure,
    paint,
    pipeline::{FrameRecord, Log},
    summary,
};

const TEMPLATE: &str = include_str!("report.html");
/// The look of every page.
const STYLE: &str = include_str!("style.css");

/// Everything that the page says besides the figures.
#[derive(Debug)]
pub struct PageInput<'a> {
    /// What the recording is called.
    pub name: &'a str,
    /// Where it comes from.
    pub description: &'a str,
    /// What was found.
    pub log: &'a Log,
    /// What was odd.
    pub warnings: &'a [WarningCount],
    /// The settings, as in `summary.json`.
    pub settings: &'a Value,
    /// The pair of cameras.
    pub calibration: &'a StereoCalibration,
    /// How the left camera sits on the vehicle.
    pub mount: &'a Mount,
}

/// What the template is given.
#[derive(Serialize)]
struct Page<'a> {
    name: &'a str,
    description: &'a str,
    version: &'static str,
    key_figures: Vec<KeyFigure>,
    failures: Vec<String>,
    warnings: &'a [WarningCount],
    frames: &'a [ReportFrame],
    first_timestamp_ns: u64,
    ground_colour: String,
    obstacle_colour: String,
    ground_charts: Vec<ChartOnPage>,
    map_charts: Vec<ChartOnPage>,
    scores: Vec<ScoreTable>,
    stages: Vec<StageRow>,
    time_chart: String,
    strip: Vec<StripPart>,
    levels: Vec<HealthRow>,
    reasons: Vec<HealthRow>,
    settings: Vec<Setting>,
    calibration: Vec<Setting>,
    mount: String,
}

#[derive(Serialize)]
struct KeyFigure {
    value: String,
    unit: &'static str,
    name: &'static str,
}

#[derive(Serialize)]
struct ChartOnPage {
    title: &'static str,
    caption: String,
    svg: String,
}

pub(super) fn render(frames: &[ReportFrame], input: &PageInput<'_>) -> Result<String, Failure> {
    let records = &input.log.frames;
    // One frame makes no course of time.
    let course = if records.len() > 1 { records.as_slice() } else { &[] };
    let page = Page {
        name: input.name,
        description: input.description,
        version: env!("CARGO_PKG_VERSION"),
        key_figures: key_figures(input.log),
        failures: failures(input.log),
        warnings: input.warnings,
        frames,
        first_timestamp_ns: records.first().map_or(0, |f| f.timestamp_ns),
        ground_colour: paint::hex(paint::GROUND),
        obstacle_colour: paint::hex(paint::OBSTACLE),
        ground_charts: ground_charts(course, input.mount),
        map_charts: map_charts(course),
        scores: tables::scores(input.log),
        stages: tables::stage_rows(&summary::stage_times(records)),
        time_chart: time_chart(course),
        strip: tables::strip(input.log),
        levels: tables::level_rows(input.log),
        reasons: tables::reason_rows(input.log),
        settings: tables::settings(input.settings),
        calibration: tables::calibration(input.calibration),
        mount: summary::mount_words(input.mount),
    };
    fill(TEMPLATE, page)
}

/// Fills a template with what it is given; `style.css` is there to be included.
pub(crate) fn fill(template: &str, given: impl Serialize) -> Result<String, Failure> {
    let wrong =
        |error: minijinja::Error| Failure::work(format!("the report cannot be made: {error:#}")).at("report.html");
    let mut environment = Environment::new();
    environment.add_template("style.css", STYLE).map_err(wrong)?;
    // The name ends in `.html`, so everything that is put in is escaped.
    environment
        .template_from_named_str("report.html", template)
        .and_then(|template| template.render(minijinja::Value::from(minijinja::value::Serde(given))))
        .map_err(wrong)
}

fn key_figures(log: &Log) -> Vec<KeyFigure> {
    let count = log.frames.len();
    let mean = |value: &dyn Fn(&FrameRecord) -> f64| log.frames.iter().map(value).sum::<f64>() / count.max(1) as f64;
    let density = |f: &FrameRecord| {
        let without: u32 = f.statistics.pixels_without.iter().sum();
        let with = f.statistics.pixels_with_disparity;
        100.0 * f64::from(with) / f64::from((with + without).max(1))
    };
    let ok = log.frames.iter().filter(|f| f.health.level == HealthLevel::Ok).count();
    let ground = log.frames.iter().filter(|f| f.ground.is_some_and(|g| g.age_frames == 0)).count();
    let total = summary::stage_times(&log.frames).pop();
    let of_all = |part: usize| format!("{part} of {}", count + log.failures.len());
    vec![
        KeyFigure { value: of_all(count), unit: "", name: "frames looked at" },
        KeyFigure { value: of_all(ok), unit: "", name: "frames with nothing to say against them" },
        KeyFigure { value: of_all(ground), unit: "", name: "frames with the ground in sight" },
        KeyFigure { value: format!("{:.0}", mean(&density)), unit: "%", name: "of the pixels have a disparity" },
        KeyFigure { value: format!("{:.1}", mean(&|f| f.obstacles as f64)), unit: "", name: "obstacles in a frame" },
        KeyFigure {
            value: total.map_or_else(String::new, |t| format!("{:.1}", t.times.median_ms)),
            unit: "ms",
            name: "from pictures to CAN frames (median)",
        },
    ]
}

fn failures(log: &Log) -> Vec<String> {
    const LISTED: usize = 20;
    let mut lines: Vec<_> =
        log.failures.iter().take(LISTED).map(|f| f.failure.to_string().replace("\n  ", " — ")).collect();
    if log.failures.len() > LISTED {
        lines.push(format!("and {} more", log.failures.len() - LISTED));
    }
    lines
}

/// Seconds from the first frame on; numbers of frames where the times do not rise.
fn time_axis(records: &[FrameRecord]) -> (&'static str, Vec<f64>) {
    let first_ns = records.first().map_or(0, |f| f.timestamp_ns);
    let rising = records.windows(2).all(|w| w[1].timestamp_ns > w[0].timestamp_ns);
    if rising && records.len() > 1 {
        ("time, s", records.iter().map(|f| (f.timestamp_ns - first_ns) as f64 * 1.0e-9).collect())
    } else {
        ("frame", records.iter().map(|f| f64::from(f.number)).collect())
    }
}

const SIZE: (u32, u32) = (560, 230);
const THIRD: (u32, u32) = (370, 230);

fn ground_charts(records: &[FrameRecord], mount: &Mount) -> Vec<ChartOnPage> {
    type Value = fn(&fencepost_core::ground::GroundPlane) -> f32;
    let (x_label, times) = time_axis(records);
    let points = |value: Value, held: bool| -> Vec<(f64, f64)> {
        let of = |f: &FrameRecord| {
            f.ground.filter(|g| (g.age_frames > 0) == held).map_or(f64::NAN, |g| f64::from(value(&g)))
        };
        times.iter().copied().zip(records.iter().map(of)).collect()
    };
    let chart = |title, y_label, expected: Option<f32>, least_span, value: Value| {
        let series = vec![
            Series { colour: 0, dots: false, points: points(value, false) },
            Series { colour: 2, dots: true, points: points(value, true) },
        ];
        let expected = expected.map(f64::from);
        let caption = match expected {
            Some(value) => format!("Dashed: what the mount says, {value:.2}."),
            None => "The mount does not say it.".to_string(),
        };
        let chart = Chart { x_label, y_label, series, expected, least_span, from_zero: false };
        ChartOnPage { title, caption, svg: chart.svg(THIRD) }
    };
    [
        chart("Height of the camera", "height, m", mount.height_m, 0.2, |g| g.camera_height_m),
        chart("Pitch", "pitch down, degrees", Some(mount.pitch_down_deg), 2.0, |g| g.pitch_down_rad.to_degrees()),
        chart("Roll", "roll, degrees", Some(mount.roll_deg), 2.0, |g| g.roll_rad.to_degrees()),
    ]
    .into_iter()
    .filter(|chart| !chart.svg.is_empty())
    .collect()
}

fn map_charts(records: &[FrameRecord]) -> Vec<ChartOnPage> {
    let (x_label, times) = time_axis(records);
    let points = |value: &dyn Fn(&FrameRecord) -> f64| -> Vec<(f64, f64)> {
        times.iter().copied().zip(records.iter().map(value)).collect()
    };
    let nearest = Chart {
        x_label,
        y_label: "distance, m",
        series: vec![Series { colour: 0, dots: false, points: points(&|f| f.nearest_m.map_or(f64::NAN, f64::from)) }],
        expected: None,
        least_span: 1.0,
        from_zero: true,
    };
    let cells = Chart {
        x_label,
        y_label: "cells",
        series: vec![
            Series { colour: 0, dots: false, points: points(&|f| f64::from(f.statistics.cells_free)) },
            Series { colour: 1, dots: false, points: points(&|f| f64::from(f.statistics.cells_obstacle)) },
        ],
        expected: None,
        least_span: 1.0,
        from_zero: true,
    };
    [
        (
            "Nearest obstacle",
            "To the middle of the nearest obstacle cell, from the vehicle’s origin. A gap: no obstacle.",
            nearest,
        ),
        ("Cells on the map", "Green: free. Red: obstacle.", cells),
    ]
    .into_iter()
    .map(|(title, caption, chart)| ChartOnPage { title, caption: caption.to_string(), svg: chart.svg(SIZE) })
    .filter(|chart| !chart.svg.is_empty())
    .collect()
}

fn time_chart(records: &[FrameRecord]) -> String {
    let (x_label, times) = time_axis(records);
    let points = times.into_iter().zip(records.iter().map(|f| f.times.total_ms)).collect();
    let series = vec![Series { colour: 0, dots: false, points }];
    let y_label = "milliseconds";
    Chart { x_label, y_label, series, expected: None, least_span: 1.0, from_zero: true }.svg((1140, 220))
}
