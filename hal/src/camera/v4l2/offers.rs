//! What a device offers: formats, sizes, rates, controls.

use std::fs::File;

use v4l2r::bindings::{v4l2_frmivalenum, v4l2_frmsizeenum, v4l2_queryctrl};
use v4l2r::ioctl::{
    self, Capabilities, Capability, CtrlId, FormatIterator, FrmIvalTypes, FrmSizeTypes, QueryCtrlFlags,
};
use v4l2r::nix::errno::Errno;
use v4l2r::{PixelFormat as FourCc, QueueType};

use crate::camera::{OfferedControl, OfferedFormat, OfferedSize, PixelFormat};

/// More of anything than this is not a list that ends.
const MOST: u32 = 256;

/// Controls of exposure and gain, as the kernel numbers them (`v4l2-controls.h`).
pub(super) mod id {
    pub(in crate::camera::v4l2) const AUTOGAIN: u32 = 0x0098_0912;
    pub(in crate::camera::v4l2) const GAIN: u32 = 0x0098_0913;
    pub(in crate::camera::v4l2) const EXPOSURE: u32 = 0x0098_0911;
    pub(in crate::camera::v4l2) const EXPOSURE_AUTO: u32 = 0x009A_0901;
    pub(in crate::camera::v4l2) const EXPOSURE_ABSOLUTE: u32 = 0x009A_0902;
    pub(in crate::camera::v4l2) const ANALOGUE_GAIN: u32 = 0x009E_0903;
}

/// The interface by which a device delivers pictures, or its name where it does not.
pub(super) fn queue(file: &File) -> Result<QueueType, String> {
    let capability: Capability = ioctl::querycap(file).map_err(|_| "it is no V4L2 device".to_owned())?;
    let offered = capability.device_caps();
    if !offered.contains(Capabilities::STREAMING) {
        return Err(capability.card);
    }
    if offered.contains(Capabilities::VIDEO_CAPTURE) {
        Ok(QueueType::VideoCapture)
    } else if offered.contains(Capabilities::VIDEO_CAPTURE_MPLANE) {
        Ok(QueueType::VideoCaptureMplane)
    } else {
        Err(capability.card)
    }
}

/// Every format with its sizes.
pub(super) fn formats(file: &File, queue: QueueType) -> Vec<OfferedFormat> {
    let descriptions = FormatIterator::new(file, queue).take(MOST as usize);
    let format = |description: ioctl::FmtDesc| {
        let fourcc: [u8; 4] = description.pixelformat.into();
        OfferedFormat {
            fourcc: name(fourcc),
            description: description.description,
            format: PixelFormat::from_fourcc(fourcc),
            sizes: sizes(file, description.pixelformat),
        }
    };
    descriptions.map(format).collect()
}

/// The four characters as text. A format with its bytes the other way round has the highest bit set.
fn name([a, b, c, d]: [u8; 4]) -> String {
    let characters = [a, b, c, d & 0x7F];
    let order = if d & 0x80 == 0 { "" } else { "-BE" };
    format!("{}{order}", String::from_utf8_lossy(&characters).trim_end())
}

/// Every rate of pictures of one size.
pub(super) fn rates_hz(file: &File, format: FourCc, (width, height): (u32, u32)) -> Vec<f32> {
    let mut rates = Vec::new();
    let hz = |fraction: &v4l2r::bindings::v4l2_fract| fraction.denominator as f32 / fraction.numerator.max(1) as f32;
    for index in 0..MOST {
        let interval: Result<v4l2_frmivalenum, _> = ioctl::enum_frame_intervals(file, index, format, width, height);
        match interval.as_ref().ok().and_then(|interval| interval.intervals()) {
            Some(FrmIvalTypes::Discrete(interval)) => rates.push(hz(interval)),
            Some(FrmIvalTypes::StepWise(range)) => {
                rates.extend([hz(&range.max), hz(&range.min)]);
                break;
            }
            None => break,
        }
    }
    rates
}

/// The controls of exposure and gain that the device has.
pub(super) fn controls(file: &File) -> Vec<OfferedControl> {
    use id::{ANALOGUE_GAIN, AUTOGAIN, EXPOSURE, EXPOSURE_ABSOLUTE, EXPOSURE_AUTO, GAIN};
    let known = [EXPOSURE_AUTO, EXPOSURE_ABSOLUTE, EXPOSURE, AUTOGAIN, GAIN, ANALOGUE_GAIN];
    known.into_iter().filter_map(|id| control(file, id)).collect()
}

/// A control, if the device has it.
pub(super) fn control(file: &File, id: u32) -> Option<OfferedControl> {
    /// The device shows it, but has it not.
    const DISABLED: u32 = 1;
    let query: v4l2_queryctrl = ioctl::queryctrl(file, CtrlId::new(id).ok()?, QueryCtrlFlags::empty()).ok()?;
    if query.flags & DISABLED != 0 {
        return None;
    }
    let name = query.name.split(|byte| *byte == 0).next().unwrap_or_default();
    Some(OfferedControl {
        name: String::from_utf8_lossy(name).into_owned(),
        id,
        min: query.minimum,
        max: query.maximum,
        default: query.default_value,
        value: ioctl::g_ctrl(file, id).ok(),
    })
}

fn sizes(file: &File, format: FourCc) -> Vec<OfferedSize> {
    let mut sizes = Vec::new();
    for index in 0..MOST {
        let size: Result<v4l2_frmsizeenum, Errno> = ioctl::enum_frame_sizes(file, index, format).map_err(Errno::from);
        match size.as_ref().ok().and_then(|size| size.size()) {
            Some(FrmSizeTypes::Discrete(size)) => {
                let size = (size.width, size.height);
                sizes.push(OfferedSize { min: size, max: size, step: (1, 1), rates_hz: rates_hz(file, format, size) });
            }
            Some(FrmSizeTypes::StepWise(range)) => {
                let max = (range.max_width, range.max_height);
                sizes.push(OfferedSize {
                    min: (range.min_width, range.min_height),
                    max,
                    step: (range.step_width.max(1), range.step_height.max(1)),
                    rates_hz: rates_hz(file, format, max),
                });
                break;
            }
            None => break,
        }
    }
    sizes
}
