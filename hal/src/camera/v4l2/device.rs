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
use super::{offers, setup};
use crate::camera::pairing::Stamp;
use crate::camera::pixels::PixelError;
use crate::camera::{CameraSettings, PixelFormat};
use crate::clock::monotonic_ns;

/// A copied time further back than this is no time of this machine's monotonic clock, nanoseconds.
const LONGEST_DELAY_NS: u64 = 10_000_000_000;

/// A device that streams.
///
/// The fields are dropped in this order: the buffers are unmapped before the device is closed.
pub(super) struct Device {
    pub(super) path: Arc<Path>,
    queue: QueueType,
    pub(super) pictures: Pictures,
    clock: Clock,
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

/// Where the times of exposure come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Clock {
    /// Not known before the first picture.
    Unknown,
    /// The driver's times are those of the monotonic clock.
    Driver,
    /// The driver has none: the time when the picture is taken over stands in.
    Arrival,
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
            clock: Clock::Unknown,
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

    /// Waits until the device has a picture or `deadline_ns` has come. Watches `other` for the case that it goes.
    pub(super) fn wait(&self, other: Option<&Self>, deadline_ns: u64) -> Result<bool, V4l2Error> {
        const GONE: PollFlags = PollFlags::ERR.union(PollFlags::HUP).union(PollFlags::NVAL);
        loop {
            let left_ns = deadline_ns.saturating_sub(monotonic_ns());
            let timeout =
                Timespec { tv_sec: (left_ns / 1_000_000_000) as i64, tv_nsec: (left_ns % 1_000_000_000) as _ };
            let second = other.map_or(&self.file, |other| &other.file);
            let mut watched = [PollFd::new(&self.file, PollFlags::IN), PollFd::new(second, PollFlags::empty())];
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
                    if own.intersects(PollFlags::IN) {
                        return Ok(true);
                    }
                    return Err(V4l2Error::gone(&self.path, "poll", io::ErrorKind::BrokenPipe.into()));
                }
                Err(rustix::io::Errno::INTR) => {}
                Err(error) => return Err(V4l2Error::gone(&self.path, "poll", error.into())),
            }
        }
    }

    /// Takes over the oldest picture that the driver has, without waiting. `warnings` are told once where times come from.
    pub(super) fn take(&mut self, warnings: &mut Vec<String>) -> Result<Taken, V4l2Error> {
        let gone = |error| Err(V4l2Error::gone(&self.path, "VIDIOC_DQBUF", error));
        let buffer: V4l2Buffer = match ioctl::dqbuf(&self.file, self.queue) {
            Ok(buffer) => buffer,
            Err(IoctlConvertError::IoctlError(ioctl::DqBufIoctlError::NotReady)) => return Ok(Taken::Nothing),
            Err(IoctlConvertError::IoctlError(error)) => return gone(os(error)),
            // The buffer's number is not told: it is lost until the device is opened again.
            Err(IoctlConvertError::ConversionError(error)) => return gone(io::Error::other(error)),
        };
        let now_ns = monotonic_ns();
        self.alive_ns = now_ns;
        let raw: &v4l2_buffer = buffer.as_v4l2_buffer();
        #[allow(clippy::useless_conversion, reason = "of 32 bits on some machines")]
        let driver_ns = nanoseconds(raw.timestamp.tv_sec.into(), raw.timestamp.tv_usec.into());
        if self.clock == Clock::Unknown {
            self.clock = clock(buffer.flags(), driver_ns, now_ns);
            if self.clock == Clock::Arrival {
                warnings.push(format!(
                    "{}: its driver does not say when a picture was exposed; the time when it arrives stands in, so that the \
                     pairing of left and right and the age of the cells are less exact",
                    self.path.display()
                ));
            }
        }
        let timestamp_ns = if self.clock == Clock::Driver { driver_ns } else { now_ns };
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

/// Which times to trust. Times that were copied from whoever wrote the picture (a loopback device) are good if they can be
/// of this machine's clock.
fn clock(flags: BufferFlags, driver_ns: u64, now_ns: u64) -> Clock {
    let copied = flags.contains(BufferFlags::TIMESTAMP_COPY);
    let plausible = driver_ns <= now_ns && now_ns - driver_ns < LONGEST_DELAY_NS;
    match flags.contains(BufferFlags::TIMESTAMP_MONOTONIC) || copied && plausible {
        true => Clock::Driver,
        false => Clock::Arrival,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_trusted_as_the_flags_say() {
        let now = 50_000_000_000;
        let monotonic = BufferFlags::TIMESTAMP_MONOTONIC;
        assert_eq!(clock(monotonic, 1, now), Clock::Driver);
        assert_eq!(clock(monotonic, u64::MAX, now), Clock::Driver, "a driver that makes its times wrap");
        assert_eq!(clock(BufferFlags::TIMESTAMP_COPY, now - 1000, now), Clock::Driver);
        assert_eq!(clock(BufferFlags::TIMESTAMP_COPY, now + 1, now), Clock::Arrival, "not of this machine");
        assert_eq!(clock(BufferFlags::TIMESTAMP_COPY, 0, now), Clock::Arrival);
        assert_eq!(clock(BufferFlags::empty(), now - 1000, now), Clock::Arrival);
    }

    #[test]
    fn seconds_and_microseconds() {
        assert_eq!(nanoseconds(12, 345_678), 12_345_678_000);
        // One microsecond before a driver's clock wraps, and after.
        assert_eq!(nanoseconds(-1, 999_999).wrapping_add(1000), nanoseconds(0, 0));
        let _ = nanoseconds(i64::MIN, i64::MAX);
    }
}
