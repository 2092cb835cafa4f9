//! Tells a device what to deliver.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use v4l2r::bindings::{v4l2_captureparm, v4l2_fract, v4l2_streamparm, v4l2_streamparm__bindgen_ty_1};
use v4l2r::{Format, PixelFormat as FourCc, QueueType, ioctl};

use super::device::{Pictures, os};
use super::error::{V4l2Error, V4l2Problem};
use super::offers::{self, id};
use crate::camera::{CameraSettings, PixelFormat, formats_in_words};

/// `V4L2_EXPOSURE_MANUAL`.
const EXPOSURE_MANUAL: i32 = 1;

/// Microseconds in a step of `V4L2_CID_EXPOSURE_ABSOLUTE`.
const EXPOSURE_STEP_US: u32 = 100;

/// Sets format and size: exactly as the settings say, or nothing.
pub(super) fn set_format(
    file: &mut File,
    queue: QueueType,
    path: &Arc<Path>,
    settings: &CameraSettings,
) -> Result<Pictures, V4l2Error> {
    let (width, height) = settings.device_size();
    let offered = offers::formats(file, queue);
    // A device that lists nothing may deliver something nevertheless.
    let listed = |format: &PixelFormat| offered.is_empty() || offered.iter().any(|o| o.format == Some(*format));
    let wanted = match settings.format {
        Some(format) => vec![format],
        None => PixelFormat::ALL.into_iter().filter(listed).collect(),
    };
    for format in wanted {
        let name = offered.iter().find(|offered| offered.format == Some(format)).map(|offered| &offered.fourcc);
        let fourcc = if name.is_some_and(|name| name == "JPEG") { *b"JPEG" } else { format.fourcc() };
        let asked = Format { width, height, pixelformat: FourCc::from(&fourcc), plane_fmt: Vec::new() };
        let got: Format = match ioctl::s_fmt(file, (queue, &asked)) {
            Ok(got) => got,
            Err(ioctl::SFmtError::InvalidBufferType) => continue,
            Err(error) => return Err(V4l2Error::setup(path, "VIDIOC_S_FMT", os(error))),
        };
        let same = (got.width, got.height) == (width, height) && got.pixelformat == asked.pixelformat;
        if let [plane] = got.plane_fmt.as_slice()
            && same
        {
            let (width, height) = (width as usize, height as usize);
            let stride = match plane.bytesperline as usize {
                0 => format.row_bytes(width),
                stride => stride,
            };
            let needed = format.needed_bytes(width, height, stride);
            let needed = needed.map_err(|error| V4l2Error::new(path, V4l2Problem::Picture(error)))?;
            return Ok(Pictures { format, width, height, stride, needed });
        }
    }
    let name = settings.format.map_or("any format that can be used", PixelFormat::name);
    let wanted = format!("{name} of {width} x {height} px");
    Err(V4l2Error::new(path, V4l2Problem::Format { wanted, offers: formats_in_words(&offered) }))
}

/// Sets the rate to the nearest one that the device offers.
pub(super) fn set_rate(
    file: &File,
    queue: QueueType,
    path: &Path,
    (pictures, rate_hz): (&Pictures, f32),
    warnings: &mut Vec<String>,
) {
    let format = FourCc::from(&pictures.format.fourcc());
    let offered = offers::rates_hz(file, format, (pictures.width as u32, pictures.height as u32));
    let asked = v4l2_captureparm {
        timeperframe: v4l2_fract { numerator: 1000, denominator: (rate_hz * 1000.0).round() as u32 },
        ..Default::default()
    };
    let asked = v4l2_streamparm { type_: queue as u32, parm: v4l2_streamparm__bindgen_ty_1 { capture: asked } };
    let set: Result<v4l2_streamparm, _> = ioctl::s_parm(file, asked);
    let path = path.display();
    if let Err(error) = set {
        warnings.push(format!("{path}: rate_hz: cannot be set ({}); leave it out", os(error)));
        return;
    }
    let slowest = offered.iter().copied().fold(f32::INFINITY, f32::min);
    let fastest = offered.iter().copied().fold(0.0, f32::max);
    // Two rates may be the ends of a range; a rate in between is set to the nearest one.
    let near = |offered: &f32| (offered - rate_hz).abs() < 0.02 * rate_hz;
    let within = offered.len() == 2 && (slowest..=fastest).contains(&rate_hz);
    if !offered.is_empty() && !within && !offered.iter().any(near) {
        let offered: Vec<String> = offered.iter().map(ToString::to_string).collect();
        warnings.push(format!(
            "{path}: rate_hz: {rate_hz} is not offered, the camera takes the nearest one; choose from {}",
            offered.join(", ")
        ));
    }
}

/// Sets exposure and gain, where the settings say them and the device has them.
pub(super) fn set_controls(file: &File, path: &Path, settings: &CameraSettings, warnings: &mut Vec<String>) {
    if let Some(exposure_us) = settings.exposure_us {
        let steps = i32::try_from(exposure_us.div_ceil(EXPOSURE_STEP_US)).unwrap_or(i32::MAX);
        if offers::control(file, id::EXPOSURE_AUTO).is_some() {
            set(file, path, ("exposure_us", id::EXPOSURE_AUTO), EXPOSURE_MANUAL, warnings);
        }
        if offers::control(file, id::EXPOSURE_ABSOLUTE).is_some() {
            set(file, path, ("exposure_us", id::EXPOSURE_ABSOLUTE), steps, warnings);
        } else {
            warnings.push(missing(path, "exposure_us", "an exposure time in microseconds"));
        }
    }
    if let Some(gain) = settings.gain {
        if offers::control(file, id::AUTOGAIN).is_some() {
            set(file, path, ("gain", id::AUTOGAIN), 0, warnings);
        }
        match [id::GAIN, id::ANALOGUE_GAIN].into_iter().find(|id| offers::control(file, *id).is_some()) {
            Some(id) => set(file, path, ("gain", id), gain, warnings),
            None => warnings.push(missing(path, "gain", "a gain")),
        }
    }
}

fn set(file: &File, path: &Path, (setting, id): (&str, u32), value: i32, warnings: &mut Vec<String>) {
    let path = path.display();
    // Drivers take the nearest value that they can, and say which one; others refuse what is out of range.
    let taken = ioctl::s_ctrl(file, id, value);
    let range = || {
        let range = offers::control(file, id).map(|control| format!(" ({} to {})", control.min, control.max));
        range.unwrap_or_default()
    };
    match taken {
        Ok(taken) if taken == value => {}
        Ok(taken) => {
            warnings.push(format!("{path}: {setting}: the camera takes {taken} in place of {value}{}", range()));
        }
        Err(error) => {
            let error = os(error);
            warnings.push(format!("{path}: {setting}: {value} cannot be set ({error}); keep to its range{}", range()));
        }
    }
}

fn missing(path: &Path, setting: &str, what: &str) -> String {
    format!(
        "{}: {setting}: the camera has no control for {what}; set it by the camera's own tools, the same on both sides, and \
         leave {setting} out",
        path.display()
    )
}
