//! The program `fencepost`: stereo pictures in, obstacle cells on CAN out, and everything to look at what happens between.
//!
//! ```text
//! cli ──> commands ──> pipeline ──> detector (fencepost-core)
//!           demo         │  frame by frame, as a view
//!           replay       ├──> can_log    can.log
//!           compare      ├──> output     cells.csv, obstacles.csv, ground.csv
//!           check        ├──> paint      disparity/, classes/, map/
//!           can decode   ├──> score      how good it is, where a recording brings the truth
//!                        ├──> summary    summary.json
//!                        └──> report     report.html
//! ```
//!
//! Live, `run` goes another way: [`live`] leads from cameras to a bus in threads of its own. [`record`] writes down what cameras
//! see, and [`listen`] shows what is on a bus. [`mod@bench`] measures how long a frame takes.
//!
//! Everything that can go wrong is a [`error::Failure`]: what is wrong, where, and the mend. The exit status is 0 if
//! everything worked, 1 if the work failed or the input is bad, 2 if the program was called wrongly or its configuration
//! cannot be used.
#![deny(unsafe_code)]

pub mod bench;
pub mod can_log;
pub mod cli;
pub mod commands;
pub mod compare;
pub mod config;
pub mod console;
mod crew;
pub mod detector;
pub mod error;
pub mod listen;
pub mod live;
pub mod normalized_cuts;
pub mod output;
pub mod paint;
pub mod pipeline;
pub mod record;
pub mod reference;
pub mod report;
pub mod scans;
pub mod score;
pub mod source;
pub mod stopwatch;
pub mod summary;
pub mod view;
pub mod words;

use std::{ffi::OsString, process::ExitCode};

use clap::Parser;

use cli::{CanCommand, Cli, Command, DemoArgs};
use console::Console;
use error::FailureKind;

/// Runs the program with the arguments of its command line, the first of which is its own name.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are no errors and go to stdout.
            let status = if error.use_stderr() { FailureKind::Usage.exit_status() } else { 0 };
            let _ = error.print();
            return ExitCode::from(status);
        }
    };
    let mut console = Console::new(cli.quiet, cli.verbose);
    let result = match cli.command.unwrap_or_else(|| Command::Demo(DemoArgs::default())) {
        Command::Demo(args) => commands::demo(&args, &mut console),
        Command::Replay(args) => commands::replay(&args, &mut console),
        Command::Compare(args) => commands::compare(&args, &mut console),
        Command::Run(args) => commands::run(&args, &mut console),
        Command::Bench(args) => commands::bench(&args, &mut console),
        Command::Check(args) => commands::check(&args, &mut console),
        Command::Record(args) => commands::record_rig(&args, &mut console),
        Command::Cameras(args) => commands::cameras(&args, &mut console),
        Command::Can(CanCommand::Decode(args)) => commands::decode(&args, &console),
        Command::Listen(args) => commands::listen(&args, &console),
    };
    match result {
        Ok(ending) => ExitCode::from(ending.exit_status()),
        Err(failure) => {
            console.error(&failure);
            ExitCode::from(failure.kind)
        }
    }
}
