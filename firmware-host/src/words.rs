//! Names of things as they are written in files and reports.

use fencepost_core::{
    detector::Stage,
    disparity::Reason,
    health::{Health, HealthLevel, HealthReason},
    map::Doubt,
    methods::{DetectorKind, Detectors},
    wire::NodeState,
};

/// Name of a level as it is written in files.
pub const fn level_name(level: HealthLevel) -> &'static str {
    match level {
        HealthLevel::Ok => "ok",
        HealthLevel::Degraded => "degraded",
        HealthLevel::Blind => "blind",
        HealthLevel::Fault => "fault",
    }
}

/// Every level, from good to bad.
pub const LEVELS: [HealthLevel; 4] = [HealthLevel::Ok, HealthLevel::Degraded, HealthLevel::Blind, HealthLevel::Fault];

/// Names of the reasons of `health`, joined by `separator`.
pub fn reason_names(health: Health, separator: &str) -> String {
    let names: Vec<_> = HealthReason::ALL.into_iter().filter(|r| health.has(*r)).map(HealthReason::name).collect();
    names.join(separator)
}

/// Why a pixel has no disparity, in words.
pub const fn reason_words(reason: Reason) -> &'static str {
    match reason {
        Reason::OutsideValidArea => "outside the valid area",
        Reason::LowTexture => "too little texture",
        Reason::NotUnique => "not unique",
        Reason::LeftRightMismatch => "left and right disagree",
        Reason::SmallSurface => "surface too small",
        Reason::Saturated => "saturated",
        Reason::OutOfRange => "out of the disparity range",
    }
}

/// Why a cell is less than certain, as it is written in files; empty where nobody doubts it.
pub const fn doubt_name(doubt: Doubt) -> &'static str {
    match doubt {
        Doubt::None => "",
        Doubt::Unconfirmed => "unconfirmed",
        Doubt::Disputed => "disputed",
    }
}

/// How a detector works, in words.
pub const fn detector_words(kind: DetectorKind) -> &'static str {
    match kind {
        DetectorKind::SurfaceNormals => "surfaces inside tiles, told apart by their normals",
        DetectorKind::CostMap => "points above the ground counted in columns",
        DetectorKind::GroundDeviation => "deviations from the disparity of the ground",
        DetectorKind::DisparitySegments => "contiguous segments of disparity, judged by size and height",
        DetectorKind::PixelNormals => "segments of pixels, told apart by the normal around each",
    }
}

/// The detectors of a frame for people.
pub fn detectors(detectors: Detectors) -> String {
    let main = detectors.main().name();
    detectors.cross_check().map_or_else(|| main.to_string(), |check| format!("{main}, checked by {}", check.name()))
}

/// What a stage does, in words.
pub const fn stage_words(stage: Stage) -> &'static str {
    match stage {
        Stage::Rectify => "brings the rows of left and right in line",
        Stage::Match => "finds each pixel of the left picture in the right one",
        Stage::Validate => "drops surfaces too small to be believed",
        Stage::Surfaces => "joins pixels to surfaces and fits a plane to each",
        Stage::Ground => "joins level surfaces and fits the ground plane",
        Stage::Obstacles => "joins upright surfaces and measures them",
        Stage::Map => "sorts everything into cells",
        Stage::Health => "judges how far all this can be trusted",
    }
}

/// What a node is doing.
pub const fn state_name(state: NodeState) -> &'static str {
    match state {
        NodeState::Starting => "starting",
        NodeState::Running => "running",
        NodeState::Stopping => "stopping",
        NodeState::Fault => "fault",
    }
}

/// Degrees of a tilt on the wire, which is in twentieths of a degree.
pub fn tilt_deg(value: i16) -> f64 {
    f64::from(value) / 20.0
}

/// A number of bytes for people.
pub fn bytes(count: usize) -> String {
    const KIB: f64 = 1024.0;
    if count < 1024 {
        return format!("{count} B");
    }
    let count = count as f64;
    if count >= KIB * KIB { format!("{:.1} MiB", count / (KIB * KIB)) } else { format!("{:.0} KiB", count / KIB) }
}

/// The reasons of `health`, each in words.
pub fn reasons_in_words(health: Health) -> Vec<&'static str> {
    HealthReason::ALL.into_iter().filter(|r| health.has(*r)).map(HealthReason::describe).collect()
}
