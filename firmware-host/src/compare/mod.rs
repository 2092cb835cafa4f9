//! Detectors side by side on the same frames.
//!
//! ```text
//! recording ──> each Method in turn ──> pipeline ──> a folder: cells.csv, pictures, summary.json
//!                                          │
//!                                          └──> Outcome ──> table, compare.json, report.html
//! ```

mod method;
mod page;
mod pictures;
mod table;
mod written;

pub use method::Method;
pub use page::page;
pub use pictures::{SidePainter, SidePictures};
pub use table::table;
pub use written::written;

use fencepost_core::detector::{Capacities, memory_bytes};
use serde_json::Value;

use crate::{
    cli::Output,
    config::Config,
    console::Console,
    error::Failure,
    output::OutputFolder,
    pipeline::{self, Job, Log},
    source::{Input, Source},
    summary,
};

/// What each detector writes to its own folder, besides summary.json.
const WRITE: [Output; 4] = [Output::Cells, Output::Disparity, Output::Classes, Output::Map];

/// What a detector made of the recording.
#[derive(Debug)]
pub struct Outcome {
    /// The detector.
    pub method: Method,
    /// What it found, frame by frame.
    pub log: Log,
    /// Pictures of the frames that are shown.
    pub pictures: Vec<SidePictures>,
    /// What it holds in memory for pictures of this size, bytes; `None` where that is not bounded.
    pub memory_bytes: Option<usize>,
    /// What of that no other detector needs, bytes.
    pub own_memory_bytes: Option<usize>,
    /// Its `summary.json`.
    pub summary: Value,
}

/// Runs one detector over the frames of `input` and writes to the folder of its name.
///
/// # Errors
/// When the settings cannot be used, or the folder cannot be written.
pub fn run<S: Source>(
    method: Method,
    input: &mut Input<S>,
    config: &Config,
    (folder, show): (&OutputFolder, usize),
    console: &mut Console,
) -> Result<Outcome, Failure> {
    let folder = OutputFolder::open(&folder.path().join(method.name()))?;
    let settings = method.settings(config.settings_for(input.picture_size().0));
    let normalized_cuts = method.normalized_cuts();
    let job = Job { folder: &folder, write: &WRITE, show, settings, normalized_cuts, wire: config.wire, config };
    let painter = SidePainter { truth: input.truth.clone() };
    let (log, shown) = pipeline::run(input, &job, painter, console, method.name())?;
    let summary = summary::summary(input, &job, &log, console.warnings());
    summary::write(&folder, "summary.json", &summary)?;
    let (width, height) = input.picture_size();
    let fitting = Capacities::for_pictures(width as usize, height as usize, usize::from(settings.matching.disparities));
    let own_memory_bytes = method.own_bytes(width);
    let memory_bytes = own_memory_bytes.map(|_| memory_bytes(&fitting));
    Ok(Outcome { method, log, pictures: shown.into_frames(), memory_bytes, own_memory_bytes, summary })
}
