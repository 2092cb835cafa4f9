//! The whole system on recorded frames: what the program makes of pictures of real cameras and of the scene renderer.
//!
//! One binary, so that a recording is replayed once for all tests that read what the program wrote.

mod can_log;
mod cells;
mod detectors;
mod disparity;
mod golden;
mod ground;
mod health;
mod joining;
mod rover;
mod scoring;
mod slope;
mod steadiness;
mod stereoboard;

use std::path::Path;

/// Where the tests write.
const SCRATCH: &str = env!("CARGO_TARGET_TMPDIR");

/// The output of the program for a recording, replayed once.
fn replayed(name: &str) -> Option<std::path::PathBuf> {
    fencepost_tests::replay::replayed(name, Path::new(SCRATCH))
}
