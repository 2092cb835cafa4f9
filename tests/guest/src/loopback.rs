//! Recorded pictures through real V4L2 devices: two loopbacks, each with a program that writes at one end and one that
//! captures at the other.

use std::{io::Write, time::Duration};

use v4l::{Device, Format, FourCC, video::Output};

use crate::{machine::wait_for, modules::Module};

/// Device of the left camera.
pub const LEFT: &str = "/dev/video10";
/// Device of the right camera.
pub const RIGHT: &str = "/dev/video11";

/// Two loopback devices, [`LEFT`] and [`RIGHT`]. To be loaded anew by each test: the devices keep the format of whoever wrote
/// to them first.
#[derive(Debug)]
pub struct Loopback {
    _module: Module,
}

impl Loopback {
    /// Loads the driver.
    ///
    /// # Panics
    /// When the devices do not appear.
    pub fn load() -> Self {
        let module = Module::load("v4l2loopback", "devices=2 video_nr=10,11 exclusive_caps=0,0 max_buffers=8");
        let there = || [LEFT, RIGHT].iter().all(|path| std::path::Path::new(path).exists());
        assert!(wait_for(Duration::from_secs(5), || there().then_some(())).is_some(), "no loopback devices");
        Self { _module: module }
    }
}

/// The end of a loopback at which pictures are written. When it is dropped the other end starves.
pub struct Producer {
    device: Device,
    size: usize,
}

impl Producer {
    /// Opens `path` and fixes the format of its pictures. Whoever captures must open the device after the first picture was
    /// written.
    ///
    /// # Panics
    /// When the device takes another format only.
    pub fn open(path: &str, fourcc: &[u8; 4], width: u32, height: u32) -> Self {
        let device = Device::with_path(path).unwrap_or_else(|error| panic!("{path}: {error}"));
        let wanted = Format::new(width, height, FourCC::new(fourcc));
        let set = Output::set_format(&device, &wanted).unwrap_or_else(|error| panic!("{path}: {error}"));
        assert_eq!((set.width, set.height, set.fourcc), (width, height, wanted.fourcc), "{path} takes another format");
        Self { device, size: set.size as usize }
    }

    /// Bytes of a picture.
    pub const fn size(&self) -> usize {
        self.size
    }

    /// Hands a picture to whoever captures, stamped with the time of now.
    ///
    /// # Panics
    /// When it has another size than the format, or the device does not take it.
    pub fn write(&mut self, picture: &[u8]) {
        assert_eq!(picture.len(), self.size, "bytes of a picture");
        let written = self.device.write(picture).expect("the device takes the picture");
        assert_eq!(written, picture.len(), "the device takes the whole picture");
    }
}

impl std::fmt::Debug for Producer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Producer").field("size", &self.size).finish_non_exhaustive()
    }
}
