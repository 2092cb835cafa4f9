//! `demo`: what the program does, without a camera or a recording.

use fencepost_hal::{
    camera::{Camera, CameraError, CameraErrorKind, StereoPair},
    recording::RecordingWriter,
    scene::{Scene, SceneCamera, SceneOptions},
};

use super::{Ending, detect_and_write};
use crate::{
    cli::{DemoArgs, Output},
    config::Config,
    console::Console,
    error::Failure,
    source::{Input, Source},
};

/// Renders a made-up scene and detects obstacles in it.
///
/// # Errors
/// When the configuration or the output folder cannot be used.
pub fn demo(args: &DemoArgs, console: &mut Console) -> Result<Ending, Failure> {
    let config = Config::load(&args.detector)?;
    let options = SceneOptions { frames: args.frames, ..SceneOptions::default() };
    let scene = Scene::new(options).map_err(|error| Failure::config(error, None))?;
    let (calibration, mount) = (scene.calibration(), scene.mount());
    let writer = match &args.record {
        Some(folder) => Some(RecordingWriter::create(folder, &calibration, &mount)?),
        None => None,
    };
    let mut input = Input {
        name: "Demo scene".to_string(),
        description: format!(
            "a rendered trail with trees, bushes, rocks, a fence and a wall; {} × {} px, {} frames",
            options.width, options.height, options.frames
        ),
        calibration,
        mount,
        frames: options.frames as usize,
        truth: None,
        warnings: Vec::new(),
        source: Recorder { camera: scene.into_camera(), writer },
    };
    let ending = detect_and_write(&mut input, &config, (&args.out, &Output::ALL), console, "demo")?;
    if let Some(folder) = &args.record {
        console.result(format_args!("recording   {}", folder.display()));
    }
    Ok(ending)
}

/// Hands the rendered pairs on, and writes them down where that is wanted.
#[derive(Debug)]
struct Recorder {
    camera: SceneCamera,
    writer: Option<RecordingWriter>,
}

/// A pair that cannot be written down.
impl CameraError for Failure {
    fn kind(&self) -> CameraErrorKind {
        CameraErrorKind::Unusable
    }
}

impl Camera for Recorder {
    type Error = Failure;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Failure> {
        let Self { camera, writer } = self;
        let Ok(pair) = camera.next_pair(|pair| {
            let written = writer.as_mut().map_or(Ok(()), |writer| writer.write_pair(pair).map(|_| ()));
            written.map(|()| consume(pair))
        });
        pair.transpose().map_err(Failure::from)
    }
}

impl Source for Recorder {
    /// A rendered frame never fails, so that nobody needs to know which one it would have been.
    fn upcoming(&self) -> Option<(u32, u64)> {
        None
    }
}
