//! What tests need and a clone does not bring: recordings of real cameras, scoring tools, and a Python with cantools.
//!
//! Where one of them is absent the test says so loudly and ends; with the environment variable `CI` set to `true` it fails.

use std::{
    ffi::OsStr,
    fmt,
    io::Write,
    path::{Path, PathBuf},
    process::Command,
};

/// The workspace.
pub const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Every recording that the tests know, by the name of its folder.
pub const RECORDINGS: [&str; 12] = [
    "bridge",
    "eth3d-terrace",
    "euroc-room",
    "inria-grenoble",
    "k10-rover",
    "kitti-rural",
    "kitti-urban",
    "kitti15-road",
    "middlebury-cones",
    "stereoboard-take1",
    "stereoboard-take18",
    "stereoboard-take21",
];

/// A recording of a real camera by the name of its folder.
///
/// # Panics
/// In CI, where it is absent.
pub fn recording(name: &str) -> Option<PathBuf> {
    let folder = recordings_folder().join(name);
    present(folder, |what| {
        format!(
            "no recording at {what}: set FENCEPOST_RECORDINGS to a folder that holds it; docs/testing.md says where such \
             recordings come from"
        )
    })
}

/// A tool that scores what the program wrote, by its file name.
///
/// # Panics
/// In CI, where it is absent.
pub fn scoring_tool(name: &str) -> Option<PathBuf> {
    let beside = || recordings_folder().join("../scoring");
    let folder = std::env::var_os("FENCEPOST_SCORING").map_or_else(beside, PathBuf::from);
    present(folder.join(name), |what| {
        format!("no tool at {what}: set FENCEPOST_SCORING to a folder that holds it; see docs/testing.md")
    })
}

/// A Python interpreter with the packages of `tests/python/requirements.txt`.
///
/// # Panics
/// In CI, where it is absent.
pub fn python() -> Option<PathBuf> {
    let Some(python) = std::env::var_os("FENCEPOST_PYTHON").map(PathBuf::from) else {
        return absent("no Python: run `tests/run`, or set FENCEPOST_PYTHON to one with tests/python/requirements.txt");
    };
    present(python, |what| format!("FENCEPOST_PYTHON is {what}, which is not there"))
}

/// Runs a Python script and returns what it printed.
///
/// # Panics
/// When it cannot be run or fails; the message holds what it said.
pub fn run_python(python: &Path, script: &Path, arguments: &[&OsStr]) -> String {
    let output = Command::new(python).arg(script).args(arguments).output();
    let output = output.unwrap_or_else(|error| panic!("{} cannot be run: {error}", python.display()));
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (said, complained) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success(), "{}: {}\n{said}{complained}", script.display(), output.status);
    said
}

/// Prints a line past the test runner's capture; [`crate::say!`].
pub fn say(text: fmt::Arguments<'_>) {
    // Nobody listens: nothing to be done about it, and no reason for a test to fail.
    let _ = writeln!(std::io::stderr().lock(), "    {text}");
}

fn recordings_folder() -> PathBuf {
    let beside = || Path::new(ROOT).join("../shared/recordings");
    std::env::var_os("FENCEPOST_RECORDINGS").map_or_else(beside, PathBuf::from)
}

fn present(path: PathBuf, complaint: impl FnOnce(std::path::Display<'_>) -> String) -> Option<PathBuf> {
    if path.exists() { Some(path) } else { absent(&complaint(path.display())) }
}

fn absent(complaint: &str) -> Option<PathBuf> {
    assert_ne!(std::env::var("CI").as_deref(), Ok("true"), "in CI everything must be there: {complaint}");
    let test = std::thread::current().name().unwrap_or("a test").to_owned();
    say(format_args!("NOT RUN: {test}: {complaint}"));
    None
}
