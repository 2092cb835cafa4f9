//! Stereo cameras: whatever delivers pairs of pictures.

use fencepost_core::picture::Picture;

/// A pair of pictures, lent for the time of one call.
#[derive(Clone, Copy, Debug)]
pub struct StereoPair<'a> {
    /// Left picture.
    pub left: Picture<'a>,
    /// Right picture.
    pub right: Picture<'a>,
    /// Time of exposure, nanoseconds of a monotonic clock.
    pub timestamp_ns: u64,
    /// Number of the pair, from 0; gaps are frames that were lost.
    pub sequence: u32,
}

/// A source of stereo pairs: a device, a recording, the scene renderer, all alike.
pub trait Camera {
    /// What can go wrong. Says what, where and the mend.
    type Error: core::error::Error;

    /// Waits for the next pair and lends it to `consume`; `None` when no further pair will come.
    ///
    /// # Errors
    /// When the pair cannot be had; the next call tries the one after it.
    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error>;
}
