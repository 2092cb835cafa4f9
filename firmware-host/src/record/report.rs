//! How a recording goes and went: `record.json` beside its pictures.

use std::path::Path;

use fencepost_hal::camera::CameraErrorKind;
use serde::Serialize;

use super::report_path;
use crate::error::Failure;

/// Counts of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordReport {
    /// The program.
    pub program: String,
    /// The pair of cameras.
    pub pair: String,
    /// Time since the start, seconds.
    pub seconds: f64,
    /// Pairs that were taken over from the camera to be written.
    pub recorded: u64,
    /// Pairs that are whole on the disk; counted at the end.
    pub written: u64,
    /// Pairs that were dropped because the disk was too slow.
    pub dropped: u64,
    /// Pictures that the camera lost, or that had no partner.
    pub missed: u64,
    /// Pairs that were dropped because their time was not after the last one's.
    pub times_not_rising: u64,
    /// Pairs that were dropped because of their size.
    pub wrong_size: u64,
    /// Pairs that came damaged.
    pub damaged: u64,
    /// Times that no picture came within the camera's time-out.
    pub no_picture: u64,
    /// Times that the camera was gone.
    pub lost: u64,
    /// How it ended.
    pub end: RecordEnd,
}

/// How a recording ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RecordEnd {
    /// Not at all: it runs, or was stopped from outside.
    Running,
    /// As many pairs or seconds as were asked for.
    Enough,
    /// By a signal.
    Asked,
    /// There were no further pictures.
    SourceEnded,
    /// The camera is gone; says what it said.
    Camera(String),
    /// The disk takes no more; says what it said.
    Disk(String),
}

impl RecordReport {
    pub(super) fn new(pair: &str) -> Self {
        Self {
            program: format!("fencepost {}", env!("CARGO_PKG_VERSION")),
            pair: pair.to_string(),
            seconds: 0.0,
            recorded: 0,
            written: 0,
            dropped: 0,
            missed: 0,
            times_not_rising: 0,
            wrong_size: 0,
            damaged: 0,
            no_picture: 0,
            lost: 0,
            end: RecordEnd::Running,
        }
    }

    /// What is not in the recording although the camera was to deliver it, in words; none where nothing is missing.
    pub fn losses(&self) -> Option<String> {
        let losses = [
            (self.dropped, "pairs dropped because the disk was too slow"),
            (self.missed, "pictures lost by the camera or without a partner"),
            (self.damaged, "pairs damaged"),
            (self.times_not_rising, "pairs dropped because their time did not rise"),
            (self.wrong_size, "pairs dropped because of their size"),
            (self.no_picture, "time-outs"),
            (self.lost, "calls that found the camera gone"),
        ];
        let words: Vec<String> =
            losses.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect();
        (!words.is_empty()).then(|| words.join(", "))
    }

    pub(super) fn count_error(&mut self, kind: CameraErrorKind) {
        match kind {
            CameraErrorKind::NoPicture => self.no_picture += 1,
            CameraErrorKind::Damaged => self.damaged += 1,
            CameraErrorKind::Lost | CameraErrorKind::Unusable => self.lost += 1,
        }
    }

    /// Writes `record.json`; it appears under its name only when it is whole.
    pub(super) fn save(&self, folder: &Path) -> Result<(), Failure> {
        let path = report_path(folder);
        let part = path.with_extension("part");
        let mut text = serde_json::to_string_pretty(self)
            .map_err(|error| Failure::work(format!("the report cannot be made: {error}")))?;
        text.push('\n');
        let written = std::fs::write(&part, text).and_then(|()| std::fs::rename(&part, &path));
        if written.is_err() {
            let _ = std::fs::remove_file(&part);
        }
        written.map_err(|error| Failure::cannot_write(&path, &error))
    }
}
