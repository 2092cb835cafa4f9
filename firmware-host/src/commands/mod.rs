//! What the program does, a module for each command.

mod bench;
mod cameras;
mod can;
mod check;
mod compare;
mod demo;
mod listen;
mod optics;
mod record;
mod replay;
mod run;

pub use bench::bench;
pub use cameras::cameras;
pub use can::decode;
pub use check::check;
pub use compare::compare;
pub use demo::demo;
pub use listen::listen;
pub use record::record_rig;
pub use replay::replay;
pub use run::run;

use std::{path::Path, time::Instant};

use crate::{
    cli::Output,
    config::Config,
    console::Console,
    error::{Failure, FailureKind},
    output::OutputFolder,
    pipeline::{self, Job},
    report::{self, FramePainter, PageInput},
    source::{Input, Source},
    summary,
};

/// How a command ended, where it went to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Everything worked.
    Good,
    /// The work was done, but some of the input could not be used.
    InputBad,
}

impl Ending {
    /// Exit status of the program.
    pub const fn exit_status(self) -> u8 {
        match self {
            Self::Good => 0,
            Self::InputBad => FailureKind::Work.exit_status(),
        }
    }
}

/// Detects in every frame of `input` and writes everything that is wanted to `out`.
fn detect_and_write<S: Source>(
    input: &mut Input<S>,
    config: &Config,
    (out, write): (&Path, &[Output]),
    console: &mut Console,
    progress: &'static str,
) -> Result<Ending, Failure> {
    let start = Instant::now();
    let folder = OutputFolder::open(out)?;
    for warning in std::mem::take(&mut input.warnings) {
        console.warn(warning);
    }
    if let Some(mount) = config.mount {
        input.mount = mount;
    }
    let settings = config.settings_for(input.picture_size().0);
    let show = if write.contains(&Output::Report) { report::SHOWN } else { 0 };
    let job = Job { folder: &folder, write, show, settings, normalized_cuts: None, wire: config.wire, config };
    console.note(format_args!("{}: {} frames, {}", input.name, input.frames, input.description));
    let (log, report) = pipeline::run(input, &job, FramePainter, console, progress)?;

    let summary = summary::summary(input, &job, &log, console.warnings());
    summary::write(&folder, "summary.json", &summary)?;
    if write.contains(&Output::Report) {
        let page = report.page(&PageInput {
            name: &input.name,
            description: &input.description,
            log: &log,
            warnings: console.warnings(),
            settings: &summary["settings"],
            calibration: &input.calibration,
            mount: &input.mount,
        })?;
        folder.write("report.html", page.as_bytes())?;
    }
    console.result(summary::table(&log));
    console.result(format_args!("\nwritten to  {} in {}", out.display(), pipeline::seconds(start.elapsed())));
    if write.contains(&Output::Report) {
        console.result(format_args!("report      {}", out.join("report.html").display()));
    }
    if !log.failures.is_empty() {
        console.error(format_args!(
            "{} of {} frames could not be used; what was written of the others is complete",
            log.failures.len(),
            log.failures.len() + log.frames.len()
        ));
        return Ok(Ending::InputBad);
    }
    Ok(Ending::Good)
}
