//! The figures of one frame.

use std::borrow::Cow;

use fencepost_core::{
    disparity::Reason,
    geometry::RectifiedPair,
    methods::{DetectorKind, Detectors},
    obstacles::Obstacle,
    settings::Settings,
};
use serde::Serialize;

use super::{Embedded, Painter};
use crate::{
    paint::{self, Canvas, Figures, birdseye, reason_colour, value_colour},
    view::FrameView,
    words,
};

/// Pictures wider than this are thinned for the page, px.
const WIDEST: usize = 1300;

/// One frame as the page shows it.
#[derive(Debug, Default, Serialize)]
pub struct ReportFrame {
    number: u32,
    timestamp_ns: u64,
    health: &'static str,
    health_words: Vec<&'static str>,
    figures: Vec<Figure>,
    map: Figure,
    scale: Vec<Tick>,
    reasons: Vec<Share>,
    seen_percent: f64,
    ground: Option<String>,
    obstacles: Vec<ObstacleRow>,
    obstacles_left_out: usize,
}

/// A picture with its letter.
#[derive(Debug, Default, Serialize)]
struct Figure {
    letter: &'static str,
    title: &'static str,
    caption: Cow<'static, str>,
    #[serde(flatten)]
    picture: Embedded,
}

/// A mark on the scale of the disparity picture.
#[derive(Debug, Serialize)]
struct Tick {
    percent: f32,
    disparity: String,
    distance: String,
    colour: String,
}

/// How many pixels have no disparity for one reason.
#[derive(Debug, Serialize)]
struct Share {
    words: &'static str,
    colour: String,
    percent: f64,
}

#[derive(Debug, Serialize)]
struct ObstacleRow {
    distance: String,
    place: String,
    height: String,
    length: String,
    pixels: u32,
}

/// Paints the figures of a frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct FramePainter;

impl Painter for FramePainter {
    type Painted = ReportFrame;

    fn paint(&self, view: &FrameView<'_>, settings: &Settings) -> ReportFrame {
        ReportFrame::paint(view, settings)
    }
}

impl ReportFrame {
    /// Most obstacles listed.
    const LISTED: usize = 8;

    /// Paints the figures of a frame.
    pub fn paint(view: &FrameView<'_>, settings: &Settings) -> Self {
        let figures = Figures { view, scale_px: scale_px(view), step_sixteenths: settings.surfaces.step_sixteenths };
        let statistics = &view.detection.statistics;
        let (width, height) = view.size();
        let percent = |pixels: u32| 100.0 * f64::from(pixels) / (width * height).max(1) as f64;
        let share = |reason: Reason| Share {
            words: words::reason_words(reason),
            colour: paint::hex(reason_colour(reason)),
            percent: percent(statistics.pixels_without.get(reason as usize).copied().unwrap_or_default()),
        };
        let obstacles = &view.detection.obstacles;
        Self {
            number: view.number,
            timestamp_ns: view.timestamp_ns,
            health: words::level_name(view.health.level),
            health_words: words::reasons_in_words(view.health),
            figures: camera_figures(&figures),
            map: figure("h", "Bird’s-eye map", map_caption(view.detection.detectors), &birdseye(view)),
            scale: scale(view.pair, figures.scale_px),
            reasons: Reason::ALL.map(share).into(),
            seen_percent: percent(statistics.pixels_with_disparity),
            ground: view.detection.ground.as_ref().map(|g| {
                let seen = if g.age_frames == 0 { "seen" } else { "held from an earlier frame" };
                format!(
                    "camera {:.2} m above the ground, pitched down {:.1}°, rolled {:.1}° ({seen})",
                    g.camera_height_m,
                    g.pitch_down_rad.to_degrees(),
                    g.roll_rad.to_degrees()
                )
            }),
            obstacles: obstacles.iter().take(Self::LISTED).map(row).collect(),
            obstacles_left_out: obstacles.len().saturating_sub(Self::LISTED),
        }
    }
}

const MAP_CAPTION: &str = "The robot stands at (0, 0) and looks up. Red dots are obstacle cells, light cells are free \
    ground, hatched cells are in view but not known, grey ones are out of view. Strokes show how long each obstacle is and \
    how it lies; the dashed lines bound the view of the left camera.";

/// The caption of the map, with what is special about the detectors.
fn map_caption(detectors: Detectors) -> String {
    let mut caption = MAP_CAPTION.to_string();
    if detectors.main() == DetectorKind::CostMap {
        caption.push_str(" The lighter a cell, the higher its cost: the number of points above its ground.");
    }
    if let Some(check) = detectors.cross_check() {
        caption.push_str(&format!(
            " Cells framed in orange are disputed: {} says the opposite, and what it calls an obstacle is not free; those framed in \
             light orange it does not know.",
            check.name()
        ));
    }
    caption
}

fn camera_figures(figures: &Figures<'_>) -> Vec<Figure> {
    vec![
        figure(
            "a",
            "Left picture",
            "The left picture after rectification: rows of left and right are in line.",
            &figures.left(),
        ),
        figure(
            "b",
            "Disparity",
            "How far each pixel lies apart in the two pictures: yellow is near, blue is far, dark red has no value.",
            &figures.disparity(),
        ),
        figure(
            "b′",
            "Why a pixel has no value",
            "Each pixel without a disparity says why. Grey pixels have one.",
            &figures.reasons(),
        ),
        figure(
            "c",
            "Dot product",
            "Of each surface’s normal with the vehicle’s +Z: level ground is bright. Dark red has no surface.",
            &figures.dot(),
        ),
        figure("d", "Cross product", "√(1 − dot²): upright surfaces are bright.", &figures.cross()),
        figure(
            "e",
            "Near-horizontal surfaces",
            "Joined over the whole picture, each in its own colour. The ground plane is fitted to them.",
            &figures.horizontal(),
        ),
        figure(
            "f",
            "Near-vertical surfaces",
            "Joined over the whole picture, each in its own colour. Those that are high and large enough are obstacles.",
            &figures.vertical(),
        ),
        figure("g", "Classification", "Ground red, obstacles blue, over the left picture.", &figures.classes()),
    ]
}

fn figure(letter: &'static str, title: &'static str, caption: impl Into<Cow<'static, str>>, canvas: &Canvas) -> Figure {
    Figure { letter, title, caption: caption.into(), picture: Embedded::new(canvas, WIDEST) }
}

/// The disparities between which 98 of 100 pixels lie: the whole range searched would leave most pictures dark.
fn scale_px(view: &FrameView<'_>) -> (f32, f32) {
    let mut steps: Vec<u16> = view.disparity.pixels().iter().map(|p| p.steps()).filter(|s| *s > 0).collect();
    if steps.is_empty() {
        return (0.0, 1.0);
    }
    steps.sort_unstable();
    let at = |permille: usize| f32::from(steps[(steps.len() - 1) * permille / 1000]) / 16.0;
    let (low, high) = (at(10).floor(), at(990).ceil());
    (low, high.max(low + 1.0))
}

fn scale(pair: &RectifiedPair, (low, high): (f32, f32)) -> Vec<Tick> {
    const TICKS: usize = 6;
    let tick = |k: usize| {
        let share = k as f32 / (TICKS - 1) as f32;
        let disparity = low + (high - low) * share;
        let distance_m = pair.distance_m(disparity);
        let distance = match distance_m {
            d if !d.is_finite() => "∞".to_string(),
            d if d >= 100.0 => format!("{d:.0} m"),
            d => format!("{d:.1} m"),
        };
        let colour = paint::hex(value_colour(share));
        Tick { percent: 100.0 * share, disparity: format!("{disparity:.0} px"), distance, colour }
    };
    (0..TICKS).map(tick).collect()
}

fn row(obstacle: &Obstacle) -> ObstacleRow {
    let [x, y, _] = obstacle.mean_m;
    let side = if y >= 0.0 { "left" } else { "right" };
    ObstacleRow {
        distance: format!("{:.1}", obstacle.distance_m()),
        place: format!("{x:.1} ahead, {:.1} {side}", y.abs()),
        height: format!("{:.1}", obstacle.max_m[2]),
        length: format!("{:.1}", obstacle.length_m),
        pixels: obstacle.pixels,
    }
}
