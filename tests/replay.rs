//! The program run on recordings, with its defaults.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use fencepost::{
    cli::{DetectorArgs, FrameRange, Output, ReplayArgs},
    commands::{self, Ending},
    config::Config,
    console::Console,
    detector::{self, ProgramDetector},
    source::Input,
};
use fencepost_hal::camera::{Camera, StereoPair};

use crate::at_hand;

/// What the tests read of a run: tables, bus log and disparity. Pictures for people would only take time.
const WRITE: [Output; 3] = [Output::Cells, Output::Can, Output::Disparity];

/// Runs `fencepost replay` on a recording and returns the folder with its output, or `None` where the recording is absent.
/// A recording that was replayed before by the same process is not replayed again.
///
/// # Panics
/// When a frame of the recording or the whole of it cannot be used.
pub fn replayed(name: &str, scratch: &Path) -> Option<PathBuf> {
    static DONE: Mutex<Option<HashMap<String, PathBuf>>> = Mutex::new(None);
    let recording = at_hand::recording(name)?;
    // Held while the program runs: it has one detector, so that a second run would wait anyway.
    let mut done = DONE.lock().unwrap_or_else(PoisonError::into_inner);
    let done = done.get_or_insert_default();
    if let Some(out) = done.get(name) {
        return Some(out.clone());
    }
    let out = scratch.join("replayed").join(name);
    replay(&recording, &out);
    done.insert(name.to_owned(), out.clone());
    Some(out)
}

/// Runs `fencepost replay` on a recording.
///
/// # Panics
/// When a frame of the recording or the whole of it cannot be used.
pub fn replay(recording: &Path, out: &Path) {
    replay_with(recording, out, DetectorArgs::default());
}

/// Runs `fencepost replay` on a recording with arguments of its own for the detector.
///
/// # Panics
/// When a frame of the recording or the whole of it cannot be used.
pub fn replay_with(recording: &Path, out: &Path, detector: DetectorArgs) {
    let args = ReplayArgs {
        recording: recording.to_path_buf(),
        out: out.to_path_buf(),
        write: WRITE.to_vec(),
        frames: FrameRange::default(),
        detector,
    };
    let ending = commands::replay(&args, &mut Console::new(true, false));
    let ending = ending.unwrap_or_else(|failure| panic!("{}: {failure}", recording.display()));
    assert_eq!(ending, Ending::Good, "{}", recording.display());
}

/// Looks at every pair of a recording with the program's detector and settings, and lends the detector after each.
///
/// # Panics
/// When the recording or a frame of it cannot be used.
pub fn for_each_detection(recording: &Path, mut look: impl FnMut(&ProgramDetector, &StereoPair<'_>)) {
    let place = recording.display();
    let mut input = Input::recording(recording, &FrameRange::default().0).unwrap_or_else(|e| panic!("{place}: {e}"));
    let settings = Config::default().settings_for(input.picture_size().0);
    let mut detector = detector::lock();
    detector.configure(&settings, &input.calibration, &input.mount).unwrap_or_else(|e| panic!("{place}: {e}"));
    loop {
        let seen = input.source.next_pair(|pair| {
            detector.detect(&pair.left, &pair.right, &mut ()).unwrap_or_else(|e| panic!("{place}: {e:?}"));
            look(&detector, pair);
        });
        if seen.unwrap_or_else(|e| panic!("{place}: {e}")).is_none() {
            return;
        }
    }
}
