//! The program `fencepost`.
#![deny(unsafe_code)]

pub mod can_log;
pub mod cli;
pub mod config;
pub mod console;
pub mod detector;
pub mod error;
pub mod output;
pub mod paint;
pub mod report;
pub mod session;
pub mod source;
pub mod stopwatch;
pub mod summary;
pub mod view;
pub mod words;

use std::{ffi::OsString, process::ExitCode};

/// Runs the program.
pub fn run(_arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    ExitCode::SUCCESS
}
