//! The cameras of a rig, whatever they are.

use std::{fmt, time::Duration};

use fencepost_hal::{
    camera::{Camera, CameraError, CameraErrorKind, MemoryCamera, PacedCamera, StereoPair},
    recording::{RecordedCamera, Recording, RecordingError},
};

use crate::{
    config::{RecordingSettings, RigPair, RigSource, build_scene},
    error::Failure,
};

/// A pair of cameras of a rig.
#[derive(Debug)]
pub enum RigCamera {
    /// Real cameras.
    #[cfg(all(feature = "v4l", target_os = "linux"))]
    V4l2(Box<fencepost_hal::camera::v4l2::V4l2Camera>),
    /// A recording, played as if it were live.
    Recording(Box<PlayedRecording>),
    /// Rendered pictures.
    Scene(PacedCamera<MemoryCamera>),
}

/// A recording that may begin anew at its end.
#[derive(Debug)]
pub struct PlayedRecording {
    camera: PacedCamera<RecordedCamera>,
    repeat: bool,
}

/// What can go wrong with a camera of a rig.
#[derive(Debug)]
pub enum RigCameraError {
    /// A real camera.
    #[cfg(all(feature = "v4l", target_os = "linux"))]
    V4l2(fencepost_hal::camera::v4l2::V4l2Error),
    /// A recording.
    Recording(RecordingError),
}

impl RigCamera {
    /// Opens the pictures of `pair`, which may be the only one that there is.
    ///
    /// # Errors
    /// When there will never be any. A camera that is not there now may come.
    pub fn open(pair: &RigPair, only: bool) -> Result<Self, Failure> {
        let rate = |rate_hz: f32| Duration::from_secs_f32(1.0 / rate_hz);
        match &pair.source {
            RigSource::Camera(settings) => open_camera(settings, only),
            RigSource::Recording(RecordingSettings { path, repeat, rate_hz }) => {
                let camera = PacedCamera::new(Recording::open(path)?.into_camera(), rate_hz.map(rate));
                Ok(Self::Recording(Box::new(PlayedRecording { camera, repeat: *repeat })))
            }
            RigSource::Scene(settings) => {
                let scene = build_scene(settings).map_err(|error| Failure::config(error, None))?;
                let rounds = if settings.repeat { u32::MAX } else { 1 };
                let memory = MemoryCamera::fill(&mut scene.into_camera()).repeated(rounds);
                Ok(Self::Scene(PacedCamera::new(memory, Some(rate(settings.rate_hz)))))
            }
        }
    }
}

#[cfg(all(feature = "v4l", target_os = "linux"))]
fn open_camera(settings: &fencepost_hal::camera::CameraSettings, only: bool) -> Result<RigCamera, Failure> {
    use fencepost_hal::camera::v4l2::V4l2Camera;

    // A camera that is not there may come: the loop waits for it and says so. One that cannot do what is asked of it never
    // will, which is an error where it is the only one.
    let camera = match V4l2Camera::open(settings) {
        Err(error) if error.kind() == CameraErrorKind::Lost || !only => V4l2Camera::closed(settings),
        opened => opened,
    };
    let camera = camera.map_err(|error| Failure::work(error.to_string()))?;
    Ok(RigCamera::V4l2(Box::new(camera)))
}

#[cfg(not(all(feature = "v4l", target_os = "linux")))]
fn open_camera(_: &fencepost_hal::camera::CameraSettings, _: bool) -> Result<RigCamera, Failure> {
    Err(no_v4l())
}

/// What to do where the program was built without real cameras.
#[cfg(not(all(feature = "v4l", target_os = "linux")))]
pub(crate) fn no_v4l() -> Failure {
    Failure::usage("this program was built without V4L2 cameras").mend(
        "on Debian: apt install libclang-dev linux-libc-dev, then cargo build --release --features v4l (docs/deploy.md)",
    )
}

impl RigCamera {
    /// What was odd when the cameras were opened.
    pub fn take_warnings(&mut self) -> Vec<String> {
        match self {
            #[cfg(all(feature = "v4l", target_os = "linux"))]
            Self::V4l2(camera) => camera.take_warnings(),
            Self::Recording(_) | Self::Scene(_) => Vec::new(),
        }
    }
}

impl Camera for RigCamera {
    type Error = RigCameraError;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, RigCameraError> {
        match self {
            #[cfg(all(feature = "v4l", target_os = "linux"))]
            Self::V4l2(camera) => camera.next_pair(consume).map_err(RigCameraError::V4l2),
            Self::Recording(played) => {
                let recorded = played.camera.inner_mut();
                if recorded.upcoming().is_none() && played.repeat {
                    recorded.seek(0);
                }
                played.camera.next_pair(consume).map_err(RigCameraError::Recording)
            }
            Self::Scene(camera) => match camera.next_pair(consume) {
                Ok(result) => Ok(result),
            },
        }
    }

    fn take_warning(&mut self) -> Option<String> {
        match self {
            #[cfg(all(feature = "v4l", target_os = "linux"))]
            Self::V4l2(camera) => camera.take_warning(),
            Self::Recording(played) => played.camera.take_warning(),
            Self::Scene(_) => None,
        }
    }
}

impl CameraError for RigCameraError {
    fn kind(&self) -> CameraErrorKind {
        match self {
            #[cfg(all(feature = "v4l", target_os = "linux"))]
            Self::V4l2(error) => error.kind(),
            Self::Recording(error) => error.kind(),
        }
    }
}

impl fmt::Display for RigCameraError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            #[cfg(all(feature = "v4l", target_os = "linux"))]
            Self::V4l2(error) => error.fmt(f),
            Self::Recording(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for RigCameraError {}
