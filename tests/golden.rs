//! The small recording that every clone has: `tests/recordings/trail`, rendered, with the bus log that belongs to it.

use std::path::{Path, PathBuf};

use fencepost_hal::{
    camera::Camera,
    recording::RecordingWriter,
    scene::{Scene, SceneOptions},
};

use crate::at_hand::ROOT;

/// How goldens are renewed; for messages of tests.
pub const HOW_TO_BLESS: &str = "If the change is meant, run `BLESS=1 cargo test -p fencepost-tests golden` and commit the files \
                                that change, saying why. See docs/testing.md.";

/// The folder of the recording.
pub fn recording() -> PathBuf {
    Path::new(ROOT).join("tests/recordings/trail")
}

/// The bus log of the recording.
pub fn can_log() -> PathBuf {
    Path::new(ROOT).join("tests/recordings/trail.can.log")
}

/// Whether goldens are to be renewed.
pub fn blesses() -> bool {
    std::env::var_os("BLESS").is_some_and(|value| value == "1")
}

/// The scene of the recording: that of the demonstration, in a size that does not burden the repository.
pub fn options() -> SceneOptions {
    SceneOptions { width: 320, height: 240, focal_px: 262.5, frames: 6, rate_hz: 5.0, ..SceneOptions::default() }
}

/// Renders the recording into `folder`, which must not hold one.
///
/// # Panics
/// When the folder cannot be written.
pub fn render(folder: &Path) {
    let scene = Scene::new(options()).unwrap_or_else(|error| panic!("the scene cannot be built: {error}"));
    let fail = |error| -> ! { panic!("{error}") };
    let mut writer =
        RecordingWriter::create(folder, &scene.calibration(), &scene.mount()).unwrap_or_else(|error| fail(error));
    let mut camera = scene.into_camera();
    while let Some(written) = camera.next_pair(|pair| writer.write_pair(pair)).unwrap_or_else(|never| match never {}) {
        written.unwrap_or_else(|error| fail(error));
    }
}
