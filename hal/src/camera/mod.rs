//! Stereo cameras: whatever delivers pairs of pictures.

mod fault;
mod format;
mod listed;
mod memory;
mod paced;
pub mod pairing;
pub mod pixels;
mod settings;
#[cfg(all(feature = "v4l", target_os = "linux"))]
pub mod v4l2;

pub use fault::{FaultyCamera, FaultyCounts, FaultyError, Sides};
pub use format::PixelFormat;
pub use listed::{ListedDevice, OfferedControl, OfferedFormat, OfferedSize, formats_in_words, proposals};
pub use memory::MemoryCamera;
pub use paced::PacedCamera;
pub use settings::{CameraDevices, CameraSettings, CameraSettingsError, PackedLayout};

use fencepost_core::picture::Picture;

/// A pair of pictures, lent for the time of one call.
#[derive(Clone, Copy, Debug)]
pub struct StereoPair<'a> {
    /// Left picture.
    pub left: Picture<'a>,
    /// Right picture.
    pub right: Picture<'a>,
    /// Time of exposure of the left picture, nanoseconds of a monotonic clock.
    pub timestamp_ns: u64,
    /// Time of exposure of the right picture after that of the left one, nanoseconds.
    pub skew_ns: i64,
    /// Number of the pair, from 0; gaps are frames that were lost.
    pub sequence: u32,
    /// Pictures that were lost since the pair before, or had no partner.
    pub missed: u32,
}

/// What an error of a camera means for whoever waits for pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraErrorKind {
    /// No pair came within the camera's time-out. The next one may.
    NoPicture,
    /// This pair cannot be used. The next one may be good.
    Damaged,
    /// The device is gone. Every further call tries to open it again.
    Lost,
    /// The camera will never deliver: it cannot do what is asked of it.
    Unusable,
}

/// An error of a camera. Says what, where and the mend.
pub trait CameraError: core::error::Error {
    /// What it means for whoever waits for pictures.
    fn kind(&self) -> CameraErrorKind;
}

/// A camera without errors.
impl CameraError for core::convert::Infallible {
    fn kind(&self) -> CameraErrorKind {
        match *self {}
    }
}

/// A source of stereo pairs: a device, a recording, the scene renderer, all alike.
pub trait Camera {
    /// What can go wrong.
    type Error: CameraError;

    /// Waits for the next pair and lends it to `consume`; `None` when no further pair will come. A live camera waits no
    /// longer than its time-out.
    ///
    /// # Errors
    /// When the pair cannot be had; the next call tries the one after it.
    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error>;

    /// The oldest thing that was found odd and not asked for yet, in words; to be asked for now and then. Takes no memory while
    /// there is none.
    fn take_warning(&mut self) -> Option<String> {
        None
    }
}
