//! What a configuration file says of a pair of cameras: the section `[pair.camera]` of `rig.toml`.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::format::PixelFormat;

/// A pair of cameras as it is written in a file. [`CameraSettings::check`] says whether it can be used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSettings {
    /// Device of the left camera, with `right`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left: Option<PathBuf>,
    /// Device of the right camera, with `left`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub right: Option<PathBuf>,
    /// Device that delivers both pictures in one, with `layout`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<PathBuf>,
    /// How the two pictures of `device` lie in its one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layout: Option<PackedLayout>,
    /// Width of each of the two pictures, px.
    pub width: u32,
    /// Height of each of the two pictures, px.
    pub height: u32,
    /// Pixel format; the most welcome one that the camera offers if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub format: Option<PixelFormat>,
    /// Pictures per second; as the camera stands if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f32>,
    /// Buffers that each device fills in turn.
    #[serde(default = "default_buffers")]
    pub buffers: u32,
    /// Largest difference between the exposures of a left and a right picture that are a pair, milliseconds.
    #[serde(default = "default_pairing_tolerance_ms")]
    pub pairing_tolerance_ms: f32,
    /// Longest wait for a pair before it is missing, milliseconds; see [`CameraSettings::timeout_ms`] for what holds if left
    /// out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timeout_ms: Option<u32>,
    /// Takes the newest pair and passes over older ones that wait, so that the pictures are never older than need be; with
    /// `false` every pair is taken.
    #[serde(default = "default_newest_only")]
    pub newest_only: bool,
    /// Exposure time of both cameras, microseconds; turns their automatic exposure off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure_us: Option<u32>,
    /// Gain of both cameras in the driver's own unit; turns their automatic gain off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<i32>,
}

/// How two pictures lie in one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PackedLayout {
    /// The left picture on the left, the right one on the right.
    SideBySide,
    /// The left picture above, the right one below.
    TopBottom,
}

/// The devices of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraDevices<'a> {
    /// A device for each picture.
    Two {
        /// Left camera.
        left: &'a Path,
        /// Right camera.
        right: &'a Path,
    },
    /// One device that delivers both pictures in one.
    One {
        /// The device.
        device: &'a Path,
        /// How they lie in it.
        layout: PackedLayout,
    },
}

/// A setting that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameraSettingsError {
    /// Name of the setting within the section.
    pub field: &'static str,
    /// What is wrong with it, and the mend.
    pub problem: String,
}

impl CameraSettings {
    /// Two devices with pictures of this size, everything else by default.
    pub fn two(left: impl Into<PathBuf>, right: impl Into<PathBuf>, width: u32, height: u32) -> Self {
        Self { left: Some(left.into()), right: Some(right.into()), ..Self::none(width, height) }
    }

    /// One device that delivers both pictures, each of this size, everything else by default.
    pub fn one(device: impl Into<PathBuf>, layout: PackedLayout, width: u32, height: u32) -> Self {
        Self { device: Some(device.into()), layout: Some(layout), ..Self::none(width, height) }
    }

    /// The devices.
    ///
    /// # Errors
    /// When they are not said, or said twice.
    pub fn devices(&self) -> Result<CameraDevices<'_>, CameraSettingsError> {
        let error = |field, problem: &str| Err(CameraSettingsError { field, problem: problem.to_owned() });
        match (&self.left, &self.right, &self.device) {
            (Some(left), Some(right), None) => match self.layout {
                Some(_) => error("layout", "belongs to `device`, not to `left` and `right`; leave it out"),
                None if left == right => {
                    error("right", "is the same device as `left`; name the other camera, or give `device` and `layout`")
                }
                None => Ok(CameraDevices::Two { left, right }),
            },
            (None, None, Some(device)) => match self.layout {
                Some(layout) => Ok(CameraDevices::One { device, layout }),
                None => error("layout", "is missing; write \"side-by-side\" or \"top-bottom\""),
            },
            (Some(_), None, None) => error("right", "is missing; name the device of the right camera"),
            (None, Some(_), None) => error("left", "is missing; name the device of the left camera"),
            (None, None, None) => {
                error("left", "is missing; name the devices `left` and `right`, or one `device` and its `layout`")
            }
            (_, _, Some(_)) => {
                error("device", "stands beside `left` or `right`; keep either `left` and `right`, or `device`")
            }
        }
    }

    /// Size of the pictures that each device delivers, px: twice as wide or high where two lie in one.
    pub const fn device_size(&self) -> (u32, u32) {
        match self.layout {
            None => (self.width, self.height),
            Some(PackedLayout::SideBySide) => (self.width.saturating_mul(2), self.height),
            Some(PackedLayout::TopBottom) => (self.width, self.height.saturating_mul(2)),
        }
    }

    /// Pairing tolerance, nanoseconds.
    pub fn pairing_tolerance_ns(&self) -> u64 {
        (f64::from(self.pairing_tolerance_ms) * 1.0e6).round() as u64
    }

    /// Longest wait for a pair, milliseconds: as set, or else a little less than the time of two pictures, so that within two
    /// pictures it is known that one is missing; but not less than 90 ms, where the bus has 100 ms to say so.
    pub fn timeout_ms(&self) -> u32 {
        const LEAST_MS: f32 = 90.0;
        const PERIODS_MS: f32 = 1800.0;
        let of_rate = || (PERIODS_MS / self.rate_hz.unwrap_or(f32::INFINITY)).max(LEAST_MS).round() as u32;
        self.timeout_ms.unwrap_or_else(of_rate)
    }

    /// Every setting that cannot be used.
    pub fn mistakes(&self) -> Vec<CameraSettingsError> {
        let mut mistakes: Vec<_> = self.devices().err().into_iter().collect();
        let mut range = |field, value: Option<f64>, min: f64, max: f64, unit: &str| {
            if let Some(value) = value
                && !(min..=max).contains(&value)
            {
                let problem = format!("is {value}{unit}; set it to {min} or more, {max} at most");
                mistakes.push(CameraSettingsError { field, problem });
            }
        };
        range("width", Some(self.width.into()), 16.0, 8192.0, " px");
        range("height", Some(self.height.into()), 16.0, 8192.0, " px");
        // Slower cameras do not see an obstacle in time; and a loop that waits longer than this for one picture cannot be stopped in
        // time either.
        range("rate_hz", self.rate_hz.map(f64::from), 1.0, 1000.0, " Hz");
        // With one buffer held and one being filled none is left for the picture in between.
        range("buffers", Some(self.buffers.into()), 3.0, 32.0, "");
        range("pairing_tolerance_ms", Some(self.pairing_tolerance_ms.into()), 0.0, 1000.0, " ms");
        range("timeout_ms", self.timeout_ms.map(f64::from), 1.0, 4000.0, " ms");
        range("exposure_us", self.exposure_us.map(f64::from), 1.0, 10.0e6, " us");
        if let Some(timeout_ms) = self.timeout_ms
            && let Some(period_ms) = self.rate_hz.filter(|rate| *rate >= 0.1).map(|rate_hz| 1000.0 / rate_hz)
            && timeout_ms as f32 <= period_ms
        {
            let problem = format!(
                "is {timeout_ms} ms, and the next picture comes after {period_ms:.0} ms; set it well above that"
            );
            mistakes.push(CameraSettingsError { field: "timeout_ms", problem });
        }
        if self.format.is_some_and(PixelFormat::is_subsampled) && !self.width.is_multiple_of(2) {
            let problem = format!("is {} px; this format has an even number of pixels in a row", self.width);
            mistakes.push(CameraSettingsError { field: "width", problem });
        }
        mistakes
    }

    /// Whether everything can be used.
    ///
    /// # Errors
    /// The first setting that cannot.
    pub fn check(&self) -> Result<(), CameraSettingsError> {
        self.mistakes().into_iter().next().map_or(Ok(()), Err)
    }

    fn none(width: u32, height: u32) -> Self {
        Self {
            left: None,
            right: None,
            device: None,
            layout: None,
            width,
            height,
            format: None,
            rate_hz: None,
            buffers: default_buffers(),
            pairing_tolerance_ms: default_pairing_tolerance_ms(),
            timeout_ms: None,
            newest_only: default_newest_only(),
            exposure_us: None,
            gain: None,
        }
    }
}

const fn default_buffers() -> u32 {
    4
}

/// A robot at 2 m/s moves 1 cm in it.
const fn default_pairing_tolerance_ms() -> f32 {
    5.0
}

const fn default_newest_only() -> bool {
    true
}

impl core::fmt::Display for CameraSettingsError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}: {}", self.field, self.problem)
    }
}

impl core::error::Error for CameraSettingsError {}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> Result<CameraSettings, String> {
        let settings: CameraSettings = serde_json::from_str(json).map_err(|error| error.to_string())?;
        settings.check().map_err(|error| error.to_string())?;
        Ok(settings)
    }

    #[test]
    fn two_devices_and_one() {
        let two = read(r#"{"left": "/dev/video0", "right": "/dev/video2", "width": 640, "height": 480}"#).unwrap();
        assert_eq!(two, CameraSettings::two("/dev/video0", "/dev/video2", 640, 480));
        assert_eq!((two.buffers, two.pairing_tolerance_ns(), two.timeout_ms()), (4, 5_000_000, 90));
        let at = |rate_hz| CameraSettings { rate_hz: Some(rate_hz), ..two.clone() }.timeout_ms();
        assert_eq!([10.0, 15.0, 20.0, 60.0].map(at), [180, 120, 90, 90]);
        assert_eq!(two.device_size(), (640, 480));
        let one = read(r#"{"device": "/dev/stereo", "layout": "side-by-side", "width": 640, "height": 480}"#).unwrap();
        assert_eq!(
            one.devices(),
            Ok(CameraDevices::One { device: Path::new("/dev/stereo"), layout: PackedLayout::SideBySide })
        );
        assert_eq!(one.device_size(), (1280, 480));
        assert_eq!(CameraSettings::one("d", PackedLayout::TopBottom, 640, 480).device_size(), (640, 960));
    }

    #[test]
    fn what_is_written_is_read_again() {
        let all = CameraSettings {
            format: Some(PixelFormat::Y10),
            rate_hz: Some(15.0),
            exposure_us: Some(5000),
            gain: Some(12),
            ..CameraSettings::two("l", "r", 752, 480)
        };
        for settings in [all, CameraSettings::one("d", PackedLayout::TopBottom, 640, 480)] {
            let text = serde_json::to_string(&settings).unwrap();
            assert!(!text.contains("null"), "{text}");
            assert_eq!(read(&text), Ok(settings));
        }
    }

    #[test]
    fn every_mistake_names_its_field() {
        let size = r#""width": 640, "height": 480"#;
        let two = r#""left": "a", "right": "b", "#;
        for (json, field) in [
            (format!("{{{size}}}"), "left: is missing"),
            (format!(r#"{{"left": "a", {size}}}"#), "right: is missing"),
            (format!(r#"{{"right": "a", {size}}}"#), "left: is missing"),
            (format!(r#"{{"left": "a", "right": "a", {size}}}"#), "right: is the same"),
            (format!(r#"{{"device": "a", {size}}}"#), "layout: is missing"),
            (format!(r#"{{"device": "a", "left": "b", "layout": "top-bottom", {size}}}"#), "device: stands"),
            (format!(r#"{{{two}"layout": "top-bottom", {size}}}"#), "layout: belongs"),
            (format!(r#"{{{two}"width": 8, "height": 480}}"#), "width: is 8 px"),
            (format!(r#"{{{two}"width": 640, "height": 9000}}"#), "height: is 9000 px"),
            (format!(r#"{{{two}"width": 641, "height": 480, "format": "YUYV"}}"#), "width: is 641 px"),
            (format!(r#"{{{two}"buffers": 1, {size}}}"#), "buffers: is 1"),
            (format!(r#"{{{two}"rate_hz": 0.0, {size}}}"#), "rate_hz: is 0 Hz"),
            (format!(r#"{{{two}"timeout_ms": 0, {size}}}"#), "timeout_ms: is 0 ms"),
            (
                format!(r#"{{{two}"rate_hz": 10, "timeout_ms": 100, {size}}}"#),
                "timeout_ms: is 100 ms, and the next picture comes after 100 ms",
            ),
            (format!(r#"{{{two}"pairing_tolerance_ms": -1, {size}}}"#), "pairing_tolerance_ms: is -1 ms"),
            (format!(r#"{{{two}"exposure_us": 0, {size}}}"#), "exposure_us: is 0 us"),
            (format!(r#"{{{two}"format": "H264", {size}}}"#), "H264"),
            (format!(r#"{{{two}"colour": 1, {size}}}"#), "colour"),
            (format!(r#"{{{two}"width": 640}}"#), "height"),
        ] {
            let error = read(&json).unwrap_err();
            assert!(error.contains(field), "{json}: {error}");
        }
        let nan = CameraSettings { rate_hz: Some(f32::NAN), buffers: 99, ..CameraSettings::two("a", "b", 0, 480) };
        let fields: Vec<_> = nan.mistakes().iter().map(|mistake| mistake.field).collect();
        assert_eq!(fields, ["width", "rate_hz", "buffers"], "all of them in one go");
    }
}
