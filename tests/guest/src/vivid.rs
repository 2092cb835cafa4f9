//! The kernel's virtual video driver: two cameras with test patterns, whose faults can be ordered.

use std::{
    collections::BTreeMap,
    fs::{File, OpenOptions},
    path::Path,
    time::Duration,
};

use v4l2r::{
    bindings::v4l2_queryctrl,
    ioctl::{self, CtrlId, QueryCtrlFlags},
};

use crate::{
    machine::{wait_for, write_sys},
    modules::Module,
};

/// Device of the left camera.
pub const LEFT: &str = "/dev/video0";
/// Device of the right camera.
pub const RIGHT: &str = "/dev/video1";

const DRIVER: &str = "/sys/bus/platform/drivers/vivid";

/// Both cameras.
#[derive(Debug)]
pub struct Cameras {
    _module: Module,
}

impl Cameras {
    /// Loads the driver with two cameras, [`LEFT`] and [`RIGHT`].
    ///
    /// # Panics
    /// When they do not appear.
    pub fn load() -> Self {
        // A capture node each; one HDMI input each, which alone of all inputs has a scaler and so any size of picture; one
        // plane per buffer.
        let parameters = "n_devs=2 node_types=0x1,0x1 num_inputs=1,1 input_types=0x3,0x3 multiplanar=1,1";
        let module = Module::load("vivid", parameters);
        let cameras = Self { _module: module };
        assert!(wait_for(Duration::from_secs(5), || are_there().then_some(())).is_some(), "no cameras");
        cameras
    }

    /// Pulls both cameras out, whoever may be capturing: their driver knows only both together.
    pub fn unplug(&self) {
        write_sys(&Path::new(DRIVER).join("unbind"), "vivid.0");
    }

    /// Plugs both cameras in again.
    ///
    /// # Panics
    /// When they do not appear.
    pub fn plug_in(&self) {
        write_sys(&Path::new(DRIVER).join("bind"), "vivid.0");
        assert!(
            wait_for(Duration::from_secs(20), || are_there().then_some(())).is_some(),
            "the cameras did not come back"
        );
    }
}

/// The controls of a camera by name, in lower case with words joined by `_`, as v4l2-ctl shows them:
/// `inject_v4l2_buf_flag_error`, `percentage_of_dropped_buffers`, `disconnect`.
#[derive(Debug)]
pub struct Controls {
    device: File,
    ids: BTreeMap<String, u32>,
}

impl Controls {
    /// Controls of the camera at `path`.
    ///
    /// # Panics
    /// When there is no such camera.
    pub fn of(path: &str) -> Self {
        let device = OpenOptions::new().read(true).write(true).open(path);
        let device = device.unwrap_or_else(|error| panic!("{path}: {error}"));
        let mut ids = BTreeMap::new();
        let mut last = 0;
        // Each call tells the control after the last one.
        while let Ok(control) = next_control(&device, last) {
            let name = control.name.split(|byte| *byte == 0).next().unwrap_or_default();
            ids.insert(plain_name(&String::from_utf8_lossy(name)), control.id);
            last = control.id;
        }
        Self { device, ids }
    }

    /// Sets a control; presses it if it is a button. A menu takes the number of the entry.
    ///
    /// # Panics
    /// When there is no such control, or it does not take the value.
    pub fn set(&self, name: &str, value: i32) {
        let Some(id) = self.ids.get(name) else { panic!("no control {name}; there are {:?}", self.ids.keys()) };
        ioctl::s_ctrl(&self.device, *id, value).unwrap_or_else(|error| panic!("{name}: {error}"));
    }
}

fn next_control(device: &File, last: u32) -> Result<v4l2_queryctrl, String> {
    let last = CtrlId::new(last).map_err(|error| error.to_string())?;
    ioctl::queryctrl(device, last, QueryCtrlFlags::NEXT).map_err(|error| error.to_string())
}

fn are_there() -> bool {
    [LEFT, RIGHT].iter().all(|path| Path::new(path).exists())
}

fn plain_name(name: &str) -> String {
    let words = name.split(|letter: char| !letter.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("_")
}
