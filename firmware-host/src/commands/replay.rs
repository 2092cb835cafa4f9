//! `replay`: from a recording to cells.

use super::{Ending, detect_and_write};
use crate::{cli::ReplayArgs, config::Config, console::Console, error::Failure, source::Input};

/// Detects obstacles in a recording.
///
/// # Errors
/// When the recording, the configuration or the output folder cannot be used. A broken frame is no error: it is said,
/// counted, and told by [`Ending::InputBad`].
pub fn replay(args: &ReplayArgs, console: &mut Console) -> Result<Ending, Failure> {
    let config = Config::load(&args.detector)?;
    let mut input = Input::recording(&args.recording, &args.frames.0)?;
    detect_and_write(&mut input, &config, (&args.out, &args.write), console, "replay")
}
