//! One V4L2 device: opened, told what to deliver, its buffers mapped, streaming.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::Arc;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::OFlags;
use v4l2r::QueueType;
use v4l2r::bindings::{v4l2_buffer, v4l2_requestbuffers};
use v4l2r::ioctl::{self, BufferFlags, IoctlConvertError, PlaneMapping, QueryBuffer, V4l2Buffer};
use v4l2r::memory::MemoryType;
use v4l2r::nix::errno::Errno;

use super::error::{V4l2Error, V4l2Problem};
use super::times::Times;
use super::{offers, setup};
use crate::camera::pairing::Stamp;
use crate::camera::pixels::PixelError;
use crate::camera::{CameraSettings, PixelFormat};
use crate::clock::monotonic_ns;

/// A device that streams.
///
/// The fields are dropped in this order: the buffers are unmapped before the device is closed.
pub(super) struct Device {
    pub(super) path: Arc<Path>,
    queue: QueueType,
    pub(super) pictures: Pictures,
    pub(super) times: Times,
    /// When the last picture came, or the stream began.
    pub(super) alive_ns: u64,
    buffers: Vec<PlaneMapping>,
    file: File,
}

/// What a device delivers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pictures {
    pub(super) format: PixelFormat,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) stride: usize,
    /// Fewest bytes of a picture.
    pub(super) needed: usize,
}

/// A buffer that the driver has filled and that is not given back yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    index: u32,
    start: usize,
    end: usize,
}

/// What the driver had.
pub(super) enum Taken {
    /// No picture yet.
    Nothing,
    /// A picture.
    Picture(Stamp, Frame),
    /// A picture that cannot be used. Its buffer is given back already.
    Damaged(Stamp, V4l2Problem),
}

impl Device {
    /// Opens the device and lets it stream.
    pub(super) fn open(
        path: &Arc<Path>,
        settings: &CameraSettings,
        warnings: &mut Vec<String>,
    ) -> Result<Self, V4l2Error> {
        let (mut file, queue) = open(path)?;
        let pictures = setup::set_format(&mut file, queue, path, settings)?;
        if let Some(rate_hz) = settings.rate_hz {
            setup::set_rate(&file, queue, path, (&pictures, rate_hz), warnings);
        }
        setup::set_controls(&file, path, settings, warnings);
        let failed = |call, error| V4l2Error::setup(path, call, error);
        let granted: v4l2_requestbuffers = ioctl::reqbufs(&file, queue, MemoryType::Mmap, settings.buffers)
            .map_err(|error| failed("VIDIOC_REQBUFS", os(error)))?;
        let mut device = Self {
            path: Arc::clone(path),
            queue,
            pictures,
            times: Times::new(monotonic_ns()),
            alive_ns: monotonic_ns(),
            buffers: Vec::new(),
            file,
        };
        for index in 0..granted.count {
            device.map(index)?;
            device.give_back(index).map_err(|error| failed("VIDIOC_QBUF", error))?;
        }
        ioctl::streamon(&device.file, queue).map_err(|error| failed("VIDIOC_STREAMON", os(error)))?;
        Ok(device)
    }

    /// Waits until the device has a picture or `deadline_ns` has come. Watches `other` for the case that it goes, and with
    /// `either` for a picture as well.
    pub(super) fn wait(&self, other: Option<&Self>, either: bool, deadline_ns: u64) -> Result<bool, V4l2Error> {
        const GONE: PollFlags = PollFlags::ERR.union(PollFlags::HUP).union(PollFlags::NVAL);
        loop {
            let left_ns = deadline_ns.saturating_sub(monotonic_ns());
            let timeout =
                Timespec { tv_sec: (left_ns / 1_000_000_000) as i64, tv_nsec: (left_ns % 1_000_000_000) as _ };
            let second = other.map_or(&self.file, |other| &other.file);
            let of_second = if either { PollFlags::IN } else { PollFlags::empty() };
            let mut watched = [PollFd::new(&self.file, PollFlags::IN), PollFd::new(second, of_second)];
            let count = if other.is_some() { 2 } else { 1 };
            match poll(watched.get_mut(..count).unwrap_or_default(), Some(&timeout)) {
                Ok(0) => return Ok(false),
                Ok(_) => {
                    let [own, second] = watched.map(|watched| watched.revents());
                    if let Some(other) = other
                        && second.intersects(GONE)
                    {
                        return Err(V4l2Error::gone(&other.path, "poll", io::ErrorKind::BrokenPipe.into()));
                    }
                    if own.intersects(PollFlags::IN) || other.is_some() && second.intersects(PollFlags::IN) {
                        return Ok(true);
                    }
                    return Err(V4l2Error::gone(&self.path, "poll", io::ErrorKind::BrokenPipe.into()));
                }
                Err(rustix::io::Errno::INTR) => {}
                Err(error) => return Err(V4l2Error::gone(&self.path, "poll", error.into())),
            }
        }
    }

    /// Takes over the oldest picture that the driver has, without waiting.
    pub(super) fn take(&mut self) -> Result<Taken, V4l2Error> {
        let gone = |error| Err(V4l2Error::gone(&self.path, "VIDIOC_DQBUF", error));
        let buffer: V4l2Buffer = match ioctl::dqbuf(&self.file, self.queue) {
            Ok(buffer) => buffer,
            Err(IoctlConvertError::IoctlError(ioctl::DqBufIoctlError::NotReady)) => {
                self.times.empty(monotonic_ns());
                return Ok(Taken::Nothing);
            }
            Err(IoctlConvertError::IoctlError(error)) => return gone(os(error)),
            // The buffer's number is not told: it is lost until the device is opened again.
            Err(IoctlConvertError::ConversionError(error)) => return gone(io::Error::other(error)),
        };
        let now_ns = monotonic_ns();
        self.alive_ns = now_ns;
        let raw: &v4l2_buffer = buffer.as_v4l2_buffer();
        #[allow(clippy::useless_conversion, reason = "of 32 bits on some machines")]
        let driver_ns = nanoseconds(raw.timestamp.tv_sec.into(), raw.timestamp.tv_usec.into());
        let timestamp_ns = self.times.exposed_ns(buffer.flags(), driver_ns, now_ns);
        let stamp = Stamp { timestamp_ns, sequence: raw.sequence };
        let index = raw.index;
        let plane = buffer.get_first_plane();
        let start = plane.data_offset.map_or(0, |offset| *offset as usize);
        let end = (*plane.bytesused as usize).min(self.buffers.get(index as usize).map_or(0, |buffer| buffer.len()));
        let problem = if buffer.flags().contains(BufferFlags::ERROR) {
            Some(V4l2Problem::Flagged)
        } else if end.saturating_sub(start) < self.pictures.needed {
            let (found, needed) = (end.saturating_sub(start), self.pictures.needed);
            Some(V4l2Problem::Picture(PixelError::TooShort { found, needed }))
        } else {
            None
        };
        let frame = Frame { index, start, end };
        match problem {
            None => Ok(Taken::Picture(stamp, frame)),
            Some(problem) => {
                self.put_back(frame)?;
                Ok(Taken::Damaged(stamp, problem))
            }
        }
    }

    /// The bytes of a picture that was taken over.
    pub(super) fn bytes(&self, frame: Frame) -> &[u8] {
        let buffer = self.buffers.get(frame.index as usize);
        buffer.and_then(|buffer| buffer.get(frame.start..frame.end)).unwrap_or_default()
    }

    /// Gives a picture's buffer back to the driver, to be filled again.
    pub(super) fn put_back(&mut self, frame: Frame) -> Result<(), V4l2Error> {
        self.give_back(frame.index).map_err(|error| V4l2Error::gone(&self.path, "VIDIOC_QBUF", error))
    }

    /// How many pictures can wait in the driver.
    pub(super) const fn room(&self) -> usize {
        self.buffers.len()
    }

    fn map(&mut self, index: u32) -> Result<(), V4l2Error> {
        let query: QueryBuffer = ioctl::querybuf(&self.file, self.queue, index as usize)
            .map_err(|error| V4l2Error::setup(&self.path, "VIDIOC_QUERYBUF", convert(error)))?;
        let layout = match query.planes.as_slice() {
            [plane] => plane,
            planes => {
                let wanted = format!("{} in one plane", self.pictures.format);
                let offers = format!("{} planes; choose another format", planes.len());
                return Err(V4l2Error::new(&self.path, V4l2Problem::Format { wanted, offers }));
            }
        };
        let mapping = ioctl::mmap(&self.file, layout.mem_offset, layout.length)
            .map_err(|error| V4l2Error::setup(&self.path, "mmap", os(error)))?;
        self.buffers.push(mapping);
        Ok(())
    }

    fn give_back(&self, index: u32) -> io::Result<()> {
        let buffer = V4l2Buffer::new(self.queue, index, MemoryType::Mmap);
        ioctl::qbuf::<_, ()>(&self.file, buffer).map_err(convert)
    }
}

/// A device that is gone takes nothing any more, which is no matter then.
impl Drop for Device {
    fn drop(&mut self) {
        let _ = ioctl::streamoff(&self.file, self.queue);
    }
}

/// Opens a device that takes pictures, and says by which of the two interfaces.
pub(super) fn open(path: &Arc<Path>) -> Result<(File, QueueType), V4l2Error> {
    // Without waiting: a driver that has no picture says so.
    let flags = OFlags::NONBLOCK.bits().cast_signed();
    let file = OpenOptions::new().read(true).write(true).custom_flags(flags).open(path);
    let file = file.map_err(|error| V4l2Error::open(path, error))?;
    let queue = offers::queue(&file).map_err(|card| V4l2Error::new(path, V4l2Problem::NoCamera { card }))?;
    Ok((file, queue))
}

/// The error of the system behind one of the crate's.
pub(super) fn os(error: impl Into<Errno>) -> io::Error {
    io::Error::from_raw_os_error(error.into() as i32)
}

fn convert<I, C>(error: IoctlConvertError<I, C>) -> io::Error
where
    I: std::fmt::Debug + Into<Errno>,
    C: std::fmt::Debug,
{
    match error {
        IoctlConvertError::IoctlError(error) => os(error),
        IoctlConvertError::ConversionError(error) => io::Error::other(format!("{error:?}")),
    }
}

/// Drivers may make times wrap, so this does.
const fn nanoseconds(seconds: i64, microseconds: i64) -> u64 {
    let whole = seconds.cast_unsigned().wrapping_mul(1_000_000_000);
    whole.wrapping_add(microseconds.cast_unsigned().wrapping_mul(1000))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_and_microseconds() {
        assert_eq!(nanoseconds(12, 345_678), 12_345_678_000);
        // One microsecond before a driver's clock wraps, and after.
        assert_eq!(nanoseconds(-1, 999_999).wrapping_add(1000), nanoseconds(0, 0));
        let _ = nanoseconds(i64::MIN, i64::MAX);
    }
}
