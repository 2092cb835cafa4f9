//! The guest itself: commands, waiting.

use std::{
    fs,
    path::Path,
    process::Command,
    thread,
    time::{Duration, Instant},
};

use rustix::thread::{CpuSet, sched_setaffinity};

/// Time between two looks at what is waited for. Short against a frame period, long against a look.
const LOOK_AGAIN: Duration = Duration::from_millis(2);

/// Fails unless this is the guest: nothing here may load modules or take interfaces down anywhere else.
///
/// # Panics
/// When it is not.
pub fn assert_guest() {
    let command_line = fs::read_to_string("/proc/cmdline").unwrap_or_default();
    assert!(
        command_line.split_whitespace().any(|word| word == "fencepost_guest"),
        "this is not the guest: run these tests with tests/guest/run"
    );
}

/// Runs a command in the guest and returns what it printed. Words are separated by blanks; there is no quoting.
///
/// # Panics
/// When it fails.
pub fn run(command: &str) -> String {
    try_run(command).unwrap_or_else(|error| panic!("{error}"))
}

/// As [`run`]; what the command complained of is the error.
///
/// # Errors
/// When the command cannot be run or fails.
pub fn try_run(command: &str) -> Result<String, String> {
    assert_guest();
    let mut words = command.split_whitespace();
    let program = words.next().unwrap_or_default();
    let output = Command::new(program).args(words).output().map_err(|error| format!("`{command}`: {error}"))?;
    let said = String::from_utf8_lossy(&output.stdout);
    if output.status.success() {
        Ok(said.into_owned())
    } else {
        let complained = String::from_utf8_lossy(&output.stderr);
        Err(format!("`{command}`: {}\n{said}{complained}", output.status))
    }
}

/// Writes to a file below `/sys`.
///
/// # Panics
/// When it cannot be written.
pub fn write_sys(path: &Path, text: &str) {
    assert_guest();
    fs::write(path, text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
}

/// Asks `look` until it finds something, for `limit` at most.
pub fn wait_for<T>(limit: Duration, mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let start = Instant::now();
    loop {
        if let Some(found) = look() {
            return Some(found);
        }
        if start.elapsed() >= limit {
            return None;
        }
        thread::sleep(LOOK_AGAIN);
    }
}

/// Runs the calling thread, and those that it starts from now on, on the first processor, which takes the interrupts of all
/// devices.
///
/// # Panics
/// When the system does not let it.
pub fn on_first_processor() {
    let mut first = CpuSet::new();
    first.set(0);
    sched_setaffinity(None, &first).unwrap_or_else(|error| panic!("the first processor: {error}"));
}

/// Prints a line past the test runner's capture.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => {
        $crate::machine::say(format_args!($($text)*))
    };
}

/// Prints a line past the test runner's capture; [`crate::say!`].
pub fn say(text: std::fmt::Arguments<'_>) {
    use std::io::Write;
    // Nobody listens: nothing to be done about it, and no reason for a test to fail.
    let _ = writeln!(std::io::stderr().lock(), "    {text}");
}
