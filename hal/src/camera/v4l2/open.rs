//! The devices of a pair while they stream.

use std::path::Path;
use std::sync::Arc;

use super::device::{self, Device, Frame, Taken};
use super::{V4l2Error, V4l2Problem};
use crate::camera::pairing::{Paired, Pairing, Side, Stamp};
use crate::camera::pixels::{self, Unpacker};
use crate::camera::{CameraSettings, PackedLayout, StereoPair};

/// The devices while they stream.
pub(super) struct Open {
    pub(super) left: Lens,
    /// None where one device delivers both.
    pub(super) right: Option<Lens>,
}

/// A device and what makes grey pictures of its own.
pub(super) struct Lens {
    pub(super) device: Device,
    unpacker: Unpacker,
}

/// What became of one attempt to take a picture.
pub(super) struct Attempt {
    pub(super) taken: bool,
    pub(super) pair: Option<Paired<Frame>>,
}

impl Open {
    pub(super) fn new(
        settings: &CameraSettings,
        [left, right]: [&Arc<Path>; 2],
        layout: Option<PackedLayout>,
        warnings: &mut Vec<String>,
    ) -> Result<Self, V4l2Error> {
        // While one of two is away, the other one is not opened in vain.
        for path in [left, right] {
            std::fs::metadata(path).map_err(|error| V4l2Error::open(path, error))?;
        }
        let left = Lens::new(left, settings, warnings)?;
        let right = match layout {
            None => Some(Lens::new(right, settings, warnings)?),
            Some(_) => None,
        };
        Ok(Self { left, right })
    }

    pub(super) fn lens(&mut self, side: Side) -> &mut Lens {
        match (side, &mut self.right) {
            (Side::Right, Some(right)) => right,
            _ => &mut self.left,
        }
    }

    pub(super) fn wait(&self, side: Side, either: bool, deadline_ns: u64) -> Result<bool, V4l2Error> {
        match (side, &self.right) {
            (Side::Right, Some(right)) => right.device.wait(Some(&self.left.device), either, deadline_ns),
            (_, right) => self.left.device.wait(right.as_ref().map(|right| &right.device), either, deadline_ns),
        }
    }

    /// Whether the time of arrival stands in for the time of exposure, on either side.
    pub(super) fn by_arrival(&self) -> bool {
        let trusted = |lens: &Lens| lens.device.times.trusted();
        !(trusted(&self.left) && self.right.as_ref().is_none_or(trusted))
    }

    /// Passes over what waits in the drivers, as long as times are those of arrival.
    ///
    /// # Bound
    /// As many pictures as can wait.
    pub(super) fn pass_over_waiting(&mut self, pairing: &mut Pairing<Frame>) -> Result<(), V4l2Error> {
        let both = self.right.is_none();
        for side in [Side::Left, Side::Right].into_iter().take(if both { 1 } else { 2 }) {
            for _ in 0..self.lens(side).device.room() {
                let device = &mut self.lens(side).device;
                if device.times.trusted() {
                    break;
                }
                let (stamp, note): (_, fn(&mut Pairing<Frame>, Side, Stamp)) = match device.take()? {
                    Taken::Nothing => break,
                    Taken::Damaged(stamp, _) => (stamp, Pairing::damaged),
                    Taken::Picture(stamp, frame) => {
                        device.put_back(frame)?;
                        (stamp, Pairing::pass_over)
                    }
                };
                note(pairing, side, stamp);
                if both {
                    note(pairing, Side::Right, stamp);
                }
            }
        }
        Ok(())
    }

    /// Takes the next picture of `side`, without waiting; with `newest` the newest that is there.
    pub(super) fn take(
        &mut self,
        side: Side,
        pairing: &mut Pairing<Frame>,
        newest: bool,
    ) -> Result<Attempt, V4l2Error> {
        let both = self.right.is_none();
        let lens = self.lens(side);
        let mut found = None;
        loop {
            match lens.device.take()? {
                Taken::Nothing => break,
                Taken::Picture(stamp, frame) => {
                    if let Some((older, frame)) = found.replace((stamp, frame)) {
                        pairing.pass_over(side, older);
                        if both {
                            pairing.pass_over(Side::Right, older);
                        }
                        lens.device.put_back(frame)?;
                    }
                    if !newest {
                        break;
                    }
                }
                // A good one in front of it is older than need be, but good.
                Taken::Damaged(stamp, _) if found.is_some() => {
                    pairing.damaged(side, stamp);
                    if both {
                        pairing.damaged(Side::Right, stamp);
                    }
                }
                Taken::Damaged(stamp, problem) => {
                    pairing.damaged(side, stamp);
                    if both {
                        pairing.damaged(Side::Right, stamp);
                    }
                    return Err(V4l2Error::new(&lens.device.path, problem));
                }
            }
        }
        let Some((stamp, frame)) = found else { return Ok(Attempt { taken: false, pair: None }) };
        let mut dropped = [None, None];
        let mut drop = |side: Side, frame| dropped[usize::from(side == Side::Right)] = Some((side, frame));
        let mut pair = pairing.push(side, stamp, frame, &mut drop);
        if both {
            pair = pairing.push(Side::Right, stamp, frame, &mut drop);
        }
        self.put_back(dropped)?;
        Ok(Attempt { taken: true, pair })
    }

    pub(super) fn put_back(&mut self, frames: [Option<(Side, Frame)>; 2]) -> Result<(), V4l2Error> {
        // Both are tried, whatever becomes of the first.
        let results = frames.map(|frame| frame.map_or(Ok(()), |(side, frame)| self.lens(side).device.put_back(frame)));
        results.into_iter().collect()
    }

    /// Lends the pictures of a pair.
    pub(super) fn lend<R>(
        &mut self,
        pair: &Paired<Frame>,
        layout: Option<PackedLayout>,
        consume: impl FnOnce(&StereoPair<'_>) -> R,
    ) -> Result<R, V4l2Error> {
        let Paired { timestamp_ns, skew_ns, sequence, missed, .. } = *pair;
        let path = &self.left.device.path;
        let wrong = |path: &Arc<Path>, error| V4l2Error::new(path, V4l2Problem::Picture(error));
        let left = self.left.unpacker.picture(self.left.device.bytes(pair.left));
        let left = left.map_err(|error| wrong(path, error))?;
        let (left, right) = match (&mut self.right, layout) {
            (Some(lens), _) => {
                let right = lens.unpacker.picture(lens.device.bytes(pair.right));
                (left, right.map_err(|error| wrong(&lens.device.path, error))?)
            }
            (None, layout) => {
                let layout = layout.unwrap_or(PackedLayout::SideBySide);
                pixels::split(left, layout).map_err(|error| wrong(path, error))?
            }
        };
        Ok(consume(&StereoPair { left, right, timestamp_ns, skew_ns, sequence, missed }))
    }
}

impl Lens {
    fn new(path: &Arc<Path>, settings: &CameraSettings, warnings: &mut Vec<String>) -> Result<Self, V4l2Error> {
        let device = Device::open(path, settings, warnings)?;
        let device::Pictures { format, width, height, stride, .. } = device.pictures;
        let unpacker = Unpacker::new(format, width, height, stride);
        let unpacker = unpacker.map_err(|error| V4l2Error::new(path, V4l2Problem::Picture(error)))?;
        Ok(Self { device, unpacker })
    }
}
