//! Recorded pictures through real V4L2 devices: two loopbacks, each with a [`Writer`](crate::device::Writer) at one end and the
//! program at the other.

use std::{path::Path, time::Duration};

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
        let there = || [LEFT, RIGHT].iter().all(|path| Path::new(path).exists());
        assert!(wait_for(Duration::from_secs(5), || there().then_some(())).is_some(), "no loopback devices");
        Self { _module: module }
    }
}
