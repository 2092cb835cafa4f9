//! `compare`: detectors side by side on a recording.

use std::time::Instant;

use super::Ending;
use crate::{
    cli::CompareArgs,
    compare::{self, Method, Outcome},
    config::Config,
    console::Console,
    error::Failure,
    output::OutputFolder,
    pipeline,
    source::Input,
    summary,
};

/// Runs each detector over the recording and writes one report of all.
///
/// # Errors
/// When the recording, the configuration or the output folder cannot be used. A broken frame is no error: it is said, counted, and
/// told by [`Ending::InputBad`].
pub fn compare(args: &CompareArgs, console: &mut Console) -> Result<Ending, Failure> {
    let start = Instant::now();
    if let Some(kind) = args.detector.methods.detector {
        return Err(Failure::usage("the detectors to compare are told by --detectors")
            .at(format!("--detector {}", kind.name()))
            .mend("leave it out, or name several: --detectors A,B"));
    }
    let config = Config::load(&args.detector)?;
    let mut input = Input::recording(&args.recording, &args.frames.0)?;
    let folder = OutputFolder::open(&args.out)?;
    for warning in std::mem::take(&mut input.warnings) {
        console.warn(warning);
    }
    if let Some(mount) = config.mount {
        input.mount = mount;
    }
    console.note(format_args!("{}: {} frames, {}", input.name, input.frames, input.description));
    let mut outcomes: Vec<Outcome> = Vec::new();
    for method in in_order(&args.detectors) {
        input.source.seek(0);
        let show = (&folder, usize::from(args.show));
        // What is wrong with the pictures is wrong for every detector: it is said once.
        let outcome = match outcomes.is_empty() {
            true => compare::run(method, &mut input, &config, show, console),
            false => compare::run(method, &mut input, &config, show, &mut console.muted()),
        };
        outcomes.push(outcome?);
    }
    summary::write(&folder, "compare.json", &compare::written(&input, &outcomes))?;
    folder.write("report.html", compare::page(&input, &outcomes, console.warnings())?.as_bytes())?;

    console.result(compare::table(&outcomes));
    console.result(format_args!("\nwritten to  {} in {}", args.out.display(), pipeline::seconds(start.elapsed())));
    console.result(format_args!("report      {}", args.out.join("report.html").display()));
    let failed = outcomes.first().map_or(0, |outcome| outcome.log.failures.len());
    if failed > 0 {
        console.error(format_args!(
            "{failed} of {} frames could not be used; what was written of the others is complete",
            input.frames
        ));
        return Ok(Ending::InputBad);
    }
    Ok(Ending::Good)
}

/// Each detector once, in the order in which they were asked for.
fn in_order(asked: &[Method]) -> Vec<Method> {
    let mut methods: Vec<Method> = Vec::new();
    for method in asked {
        if !methods.contains(method) {
            methods.push(*method);
        }
    }
    methods
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_detector_that_is_asked_for_twice_runs_once() {
        let method = Method::ALL[0];
        assert_eq!(in_order(&[method, method]), [method]);
    }
}
