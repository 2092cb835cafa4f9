//! `demo`: what the program does, without a camera or a recording.

use fencepost_hal::scene::{Scene, SceneOptions};

use super::{Ending, detect_and_write};
use crate::{
    cli::{DemoArgs, Output},
    config::Config,
    console::Console,
    error::Failure,
    source::Input,
};

/// Renders a made-up scene and detects obstacles in it.
///
/// # Errors
/// When the configuration or the output folder cannot be used.
pub fn demo(args: &DemoArgs, console: &mut Console) -> Result<Ending, Failure> {
    let config = Config::load(&args.detector)?;
    let options = SceneOptions { frames: args.frames, ..SceneOptions::default() };
    let scene = Scene::new(options).map_err(|error| Failure::config(error, None))?;
    let mut input = Input {
        name: "Demo scene".to_string(),
        description: format!(
            "a rendered trail with trees, bushes, rocks, a fence and a wall; {} × {} px, {} frames",
            options.width, options.height, options.frames
        ),
        calibration: scene.calibration(),
        mount: scene.mount(),
        frames: options.frames as usize,
        warnings: Vec::new(),
        source: scene.into_camera(),
    };
    detect_and_write(&mut input, &config, (&args.out, &Output::ALL), console, "demo")
}
