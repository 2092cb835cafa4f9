//! V4L2 devices by the plainest means: format by one call, pictures by `read` and `write`.

use std::{
    fs::{File, OpenOptions},
    io::{ErrorKind, Read, Write},
    time::Duration,
};

use v4l2r::{Format, PixelFormat, QueueType, ioctl};

use crate::machine::wait_for;

/// Longest wait for a picture.
const PATIENCE: Duration = Duration::from_secs(5);

/// Takes pictures from a device, by `read`: another way than the program's.
#[derive(Debug)]
pub struct Reader {
    device: File,
    size: usize,
}

/// Hands pictures to a loopback device. When it is dropped whoever captures starves.
#[derive(Debug)]
pub struct Writer {
    device: File,
    size: usize,
}

impl Reader {
    /// Opens `path` and fixes the format of its pictures.
    ///
    /// # Panics
    /// When the device delivers another format only.
    pub fn open(path: &str, fourcc: [u8; 4], width: u32, height: u32) -> Self {
        let (device, size) = open(path, QueueType::VideoCapture, fourcc, width, height);
        Self { device, size }
    }

    /// The next picture.
    ///
    /// # Panics
    /// When none comes.
    pub fn read(&mut self) -> Vec<u8> {
        let mut picture = vec![0; self.size];
        let read = wait_for(PATIENCE, || match self.device.read(&mut picture) {
            Ok(read) => Some(read),
            Err(error) if error.kind() == ErrorKind::WouldBlock => None,
            Err(error) => panic!("a picture cannot be read: {error}"),
        });
        assert_eq!(read, Some(self.size), "bytes of a picture");
        picture
    }
}

impl Writer {
    /// Opens `path` and fixes the format of its pictures. Whoever captures must open the device after the first picture was
    /// written.
    ///
    /// # Panics
    /// When the device takes another format only.
    pub fn open(path: &str, fourcc: [u8; 4], width: u32, height: u32) -> Self {
        let (device, size) = open(path, QueueType::VideoOutput, fourcc, width, height);
        Self { device, size }
    }

    /// Bytes of a picture.
    pub const fn size(&self) -> usize {
        self.size
    }

    /// Hands a picture over, stamped with the time of now. A compressed one may be shorter than the format.
    ///
    /// # Panics
    /// When it is longer than the format, or the device does not take it.
    pub fn write(&mut self, picture: &[u8]) {
        assert!(picture.len() <= self.size, "{} bytes are more than {} of the format", picture.len(), self.size);
        let written = self.device.write(picture).expect("the device takes the picture");
        assert_eq!(written, picture.len(), "the device takes the whole picture");
    }
}

fn open(path: &str, queue: QueueType, fourcc: [u8; 4], width: u32, height: u32) -> (File, usize) {
    let device = OpenOptions::new().read(true).write(true).open(path);
    let mut device = device.unwrap_or_else(|error| panic!("{path}: {error}"));
    let asked = Format { width, height, pixelformat: PixelFormat::from(&fourcc), plane_fmt: Vec::new() };
    let set: Format = ioctl::s_fmt(&mut device, (queue, &asked)).unwrap_or_else(|error| panic!("{path}: {error}"));
    assert_eq!(
        (set.width, set.height, set.pixelformat),
        (width, height, asked.pixelformat),
        "{path} has another format"
    );
    let size = set.plane_fmt.iter().map(|plane| plane.sizeimage as usize).sum();
    (device, size)
}
