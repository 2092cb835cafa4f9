//! The host's side of `bounds/image/run`: pictures for the image of a microcontroller, and what the host says of them.
//!
//! ```sh
//! image_cases make CASES                 # writes rendered pictures, and recorded ones that are at hand, shrunk, into one file
//! image_cases check CASES SAID IMAGE     # holds what the image said of them against the host, and against what it may take
//! ```
#![deny(unsafe_code)]

#[path = "../../bounds/image/src/case.rs"]
mod case;
mod check;
mod counts;
mod pictures;
#[path = "../../bounds/image/src/robot.rs"]
mod robot;
mod said;
mod shrink;

use std::{ffi::OsString, path::Path, process::ExitCode};

fn main() -> ExitCode {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let arguments: Vec<&Path> = arguments.iter().map(Path::new).collect();
    let result = match arguments[..] {
        [command, cases] if command == Path::new("make") => pictures::make(cases),
        [command, cases, said, image] if command == Path::new("check") => check::check(cases, said, image),
        _ => {
            eprintln!("usage: image_cases make CASES | check CASES SAID IMAGE");
            return ExitCode::from(2);
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
