//! What can go wrong with a camera, and the mend.

use std::io;
use std::path::Path;
use std::sync::Arc;

use crate::camera::pixels::PixelError;
use crate::camera::{CameraError, CameraErrorKind, CameraSettingsError};

/// An error of a camera: which device, what, and the mend.
#[derive(Debug)]
pub struct V4l2Error {
    /// The device; of two the one that the error is of.
    pub device: Arc<Path>,
    /// What is wrong with it.
    pub problem: V4l2Problem,
}

/// What is wrong with a camera.
#[derive(Debug)]
pub enum V4l2Problem {
    /// A setting cannot be used.
    Setting(CameraSettingsError),
    /// The device is not there.
    Absent,
    /// The device may not be opened by this user.
    Forbidden,
    /// Another program has the device.
    Busy,
    /// The device is no camera.
    NoCamera {
        /// What it says of itself.
        card: String,
    },
    /// The device cannot deliver such pictures.
    Format {
        /// What is asked for.
        wanted: String,
        /// What the device offers.
        offers: String,
    },
    /// A call to the driver failed while the device was made ready.
    Setup {
        /// The call.
        call: &'static str,
        /// What the system says.
        error: io::Error,
    },
    /// The device is gone, or its driver gave up.
    Gone {
        /// The call that told it.
        call: &'static str,
        /// What the system says.
        error: io::Error,
    },
    /// The device was lost, and it is not yet time to try again.
    NotBack,
    /// No picture within the time-out.
    NoPicture {
        /// The time-out, milliseconds.
        timeout_ms: u32,
    },
    /// Pictures come from both devices, but none within the pairing tolerance of another.
    NoPartner {
        /// The time-out, milliseconds.
        timeout_ms: u32,
    },
    /// The driver says that the picture is damaged.
    Flagged,
    /// The picture cannot be used.
    Picture(PixelError),
}

impl V4l2Error {
    pub(super) fn new(device: &Arc<Path>, problem: V4l2Problem) -> Self {
        Self { device: Arc::clone(device), problem }
    }

    /// Of opening the device.
    pub(super) fn open(device: &Arc<Path>, error: io::Error) -> Self {
        let problem = match error.kind() {
            io::ErrorKind::NotFound => V4l2Problem::Absent,
            io::ErrorKind::PermissionDenied => V4l2Problem::Forbidden,
            io::ErrorKind::ResourceBusy => V4l2Problem::Busy,
            _ => V4l2Problem::Setup { call: "open", error },
        };
        Self::new(device, problem)
    }

    /// Of a call while the device is made ready.
    pub(super) fn setup(device: &Arc<Path>, call: &'static str, error: io::Error) -> Self {
        let problem = match error.kind() {
            io::ErrorKind::ResourceBusy => V4l2Problem::Busy,
            _ => V4l2Problem::Setup { call, error },
        };
        Self::new(device, problem)
    }

    /// Of a call while pictures are taken.
    pub(super) fn gone(device: &Arc<Path>, call: &'static str, error: io::Error) -> Self {
        Self::new(device, V4l2Problem::Gone { call, error })
    }
}

impl CameraError for V4l2Error {
    fn kind(&self) -> CameraErrorKind {
        match self.problem {
            V4l2Problem::Setting(_) | V4l2Problem::NoCamera { .. } | V4l2Problem::Format { .. } => {
                CameraErrorKind::Unusable
            }
            V4l2Problem::Absent
            | V4l2Problem::Forbidden
            | V4l2Problem::Busy
            | V4l2Problem::Setup { .. }
            | V4l2Problem::Gone { .. }
            | V4l2Problem::NotBack => CameraErrorKind::Lost,
            V4l2Problem::NoPicture { .. } | V4l2Problem::NoPartner { .. } => CameraErrorKind::NoPicture,
            V4l2Problem::Flagged | V4l2Problem::Picture(_) => CameraErrorKind::Damaged,
        }
    }
}

impl core::fmt::Display for V4l2Error {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let device = self.device.display();
        match &self.problem {
            V4l2Problem::Setting(error) => write!(f, "camera.{error}"),
            V4l2Problem::Absent => write!(
                f,
                "{device}: is not there; plug the camera in, or give the right device (`fencepost cameras` lists them)"
            ),
            V4l2Problem::Forbidden => write!(
                f,
                "{device}: may not be opened; add the user to the group video (`usermod -aG video USER`, then log in anew)"
            ),
            V4l2Problem::Busy => {
                write!(f, "{device}: is used by another program; end that one (`fuser -v {device}` names it)")
            }
            V4l2Problem::NoCamera { card } => write!(
                f,
                "{device}: takes no pictures ({card}); give a device that does (`fencepost cameras` lists them)"
            ),
            V4l2Problem::Format { wanted, offers } => {
                write!(f, "{device}: does not deliver {wanted}; choose from what it offers: {offers}")
            }
            V4l2Problem::Setup { call, error } => write!(
                f,
                "{device}: cannot be made ready ({call}: {error}); see what the kernel says (`dmesg`), unplug the camera and \
                 plug it in again"
            ),
            V4l2Problem::Gone { call, error } => write!(
                f,
                "{device}: is gone ({call}: {error}); check cable and power supply, it is opened again as soon as it is back"
            ),
            V4l2Problem::NotBack => write!(f, "{device}: is gone, and not back yet; check cable and power supply"),
            V4l2Problem::NoPicture { timeout_ms } => write!(
                f,
                "{device}: has delivered no picture for {timeout_ms} ms; check cable, power supply and trigger, or set \
                 timeout_ms above the time between two pictures"
            ),
            V4l2Problem::NoPartner { timeout_ms } => write!(
                f,
                "{device}: has delivered no picture of the same moment as the other camera for {timeout_ms} ms; trigger both \
                 cameras together, or set pairing_tolerance_ms higher"
            ),
            V4l2Problem::Flagged => {
                write!(
                    f,
                    "{device}: the driver says that the picture is damaged; check the cable and the load of the bus"
                )
            }
            V4l2Problem::Picture(error) => write!(f, "{device}: {error}; check the cable and the load of the bus"),
        }
    }
}

impl core::error::Error for V4l2Error {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_the_system_get_their_meaning_and_mend() {
        let device: Arc<Path> = Path::new("/dev/video7").into();
        let os = io::Error::from_raw_os_error;
        // ENOENT, EACCES, EBUSY, ENODEV, EIO
        for (error, kind, words) in [
            (V4l2Error::open(&device, os(2)), CameraErrorKind::Lost, "is not there; plug the camera in"),
            (V4l2Error::open(&device, os(13)), CameraErrorKind::Lost, "group video"),
            (V4l2Error::open(&device, os(16)), CameraErrorKind::Lost, "fuser -v /dev/video7"),
            (V4l2Error::setup(&device, "VIDIOC_S_FMT", os(16)), CameraErrorKind::Lost, "another program"),
            (V4l2Error::setup(&device, "VIDIOC_REQBUFS", os(5)), CameraErrorKind::Lost, "VIDIOC_REQBUFS"),
            (V4l2Error::gone(&device, "VIDIOC_DQBUF", os(19)), CameraErrorKind::Lost, "opened again"),
            (V4l2Error::new(&device, V4l2Problem::Flagged), CameraErrorKind::Damaged, "cable"),
            (V4l2Error::new(&device, V4l2Problem::NoPicture { timeout_ms: 100 }), CameraErrorKind::NoPicture, "100 ms"),
            (
                V4l2Error::new(&device, V4l2Problem::Format { wanted: "Y10".into(), offers: "GREY".into() }),
                CameraErrorKind::Unusable,
                "choose from what it offers: GREY",
            ),
        ] {
            assert_eq!(error.kind(), kind, "{error}");
            let text = error.to_string();
            assert!(text.starts_with("/dev/video7: ") && text.contains(words) && text.contains("; "), "{text}");
        }
    }
}
