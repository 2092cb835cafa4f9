//! What cameras a machine has, what they offer, and which of them make a pair.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{CameraSettings, PackedLayout, PixelFormat};

/// Rates above this are no use to a detector, Hz.
const FAST_ENOUGH_HZ: f32 = 30.0;

/// Sizes that are tried where a device offers a range, px.
const USUAL_SIZES: [(u32, u32); 4] = [(640, 480), (752, 480), (512, 384), (320, 240)];

/// A device that takes pictures, and what it offers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ListedDevice {
    /// The device.
    pub device: PathBuf,
    /// Names that stay the same over a restart and another socket, as far as the system gives them.
    pub names: Vec<PathBuf>,
    /// What it is.
    pub card: String,
    /// Its driver.
    pub driver: String,
    /// Where it is plugged in.
    pub bus: String,
    /// Formats, sizes, rates.
    pub formats: Vec<OfferedFormat>,
    /// Controls of exposure and gain.
    pub controls: Vec<OfferedControl>,
    /// Why nothing more is known, where it cannot be opened.
    pub problem: Option<String>,
}

/// A format that a device offers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfferedFormat {
    /// Its four characters, without blanks at the end.
    pub fourcc: String,
    /// The driver's name for it.
    pub description: String,
    /// The format, where it is one that pictures are taken from.
    pub format: Option<PixelFormat>,
    /// Sizes of pictures.
    pub sizes: Vec<OfferedSize>,
}

/// A size of pictures, or a range of them where largest and smallest differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfferedSize {
    /// Smallest width and height, px.
    pub min: (u32, u32),
    /// Largest width and height, px.
    pub max: (u32, u32),
    /// Step of width and height, px.
    pub step: (u32, u32),
    /// Pictures per second at this size (at the largest one of a range), slowest and fastest of a range.
    pub rates_hz: Vec<f32>,
}

/// A control that a device has.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct OfferedControl {
    /// The driver's name for it.
    pub name: String,
    /// Identifier.
    pub id: u32,
    /// Smallest value.
    pub min: i32,
    /// Largest value.
    pub max: i32,
    /// Value at the start.
    pub default: i32,
    /// Value now, where it can be read.
    pub value: Option<i32>,
}

/// Pairs of cameras among `devices`, as they are written in a file: two of the same kind with a size in common, and single
/// ones whose pictures are so wide or so high that there must be two in each. Pictures of at most `most_pixels` each.
pub fn proposals(devices: &[ListedDevice], most_pixels: u64) -> Vec<CameraSettings> {
    let fits = |(width, height): (u32, u32)| u64::from(width) * u64::from(height) <= most_pixels;
    let mut found = Vec::new();
    for (index, left) in devices.iter().enumerate() {
        for right in devices.iter().skip(index + 1) {
            let same_kind = (&left.card, &left.driver) == (&right.card, &right.driver) && !left.card.is_empty();
            if same_kind && let Some((format, size, rates)) = best(left, Some(right), fits) {
                let two = CameraSettings::two(left.lasting_name(), right.lasting_name(), size.0, size.1);
                found.push(with(two, format, &rates));
            }
        }
        // Nobody's single picture is wider than 21 : 9.
        let wide = |(width, height): (u32, u32)| 3 * width >= 7 * height && width % 2 == 0 && fits((width / 2, height));
        let high = |(width, height): (u32, u32)| height > width && height % 2 == 0 && fits((width, height / 2));
        if let Some((format, size, rates)) = best_fixed(left, wide) {
            let one = CameraSettings::one(left.lasting_name(), PackedLayout::SideBySide, size.0 / 2, size.1);
            found.push(with(one, format, &rates));
        } else if let Some((format, size, rates)) = best_fixed(left, high) {
            let one = CameraSettings::one(left.lasting_name(), PackedLayout::TopBottom, size.0, size.1 / 2);
            found.push(with(one, format, &rates));
        }
    }
    found
}

/// With format and rate.
fn with(settings: CameraSettings, format: PixelFormat, rates_hz: &[f32]) -> CameraSettings {
    CameraSettings { format: Some(format), rate_hz: rate(rates_hz), ..settings }
}

type Choice = (PixelFormat, (u32, u32), Vec<f32>);

/// The largest size that both devices offer in the same format, in the most welcome of those formats.
fn best(left: &ListedDevice, right: Option<&ListedDevice>, fits: impl Fn((u32, u32)) -> bool) -> Option<Choice> {
    let mut best: Option<Choice> = None;
    for format in PixelFormat::ALL {
        let Some(offered) = left.format(format) else { continue };
        for size in &offered.sizes {
            let candidates = if size.min == size.max { vec![size.min] } else { USUAL_SIZES.to_vec() };
            for (width, height) in candidates {
                let both = size.holds(width, height) && right.is_none_or(|right| right.offers(format, width, height));
                let area = |(width, height): (u32, u32)| u64::from(width) * u64::from(height);
                let larger = best.as_ref().is_none_or(|(_, size, _)| area((width, height)) > area(*size));
                if both && larger && fits((width, height)) {
                    best = Some((format, (width, height), size.rates_hz.clone()));
                }
            }
        }
    }
    best
}

/// As [`best`], of one device that offers nothing but fixed sizes: one that scales its pictures makes them as wide as asked.
fn best_fixed(device: &ListedDevice, fits: impl Fn((u32, u32)) -> bool) -> Option<Choice> {
    let fixed = device.formats.iter().flat_map(|format| &format.sizes).all(|size| size.min == size.max);
    if fixed { best(device, None, fits) } else { None }
}

/// The fastest of the rates that a detector can use; the slowest where all are faster.
fn rate(rates_hz: &[f32]) -> Option<f32> {
    let usable = rates_hz.iter().copied().filter(|rate| *rate <= FAST_ENOUGH_HZ + 0.5);
    usable.max_by(f32::total_cmp).or_else(|| rates_hz.iter().copied().min_by(f32::total_cmp))
}

impl ListedDevice {
    /// The name that stays the same over a restart: the user's own, that of its serial number, or that of its socket.
    pub fn lasting_name(&self) -> &Path {
        let named = |part: &str| self.names.iter().find(|name| name.to_string_lossy().contains(part));
        let own = self.names.iter().find(|name| name.parent() == Some(Path::new("/dev")));
        own.or_else(|| named("/by-id/")).or_else(|| named("/by-path/")).unwrap_or(&self.device)
    }

    /// A format, if the device offers it.
    pub fn format(&self, format: PixelFormat) -> Option<&OfferedFormat> {
        self.formats.iter().find(|offered| offered.format == Some(format))
    }

    /// Whether the device offers pictures of this format and size.
    pub fn offers(&self, format: PixelFormat, width: u32, height: u32) -> bool {
        self.format(format).is_some_and(|offered| offered.sizes.iter().any(|size| size.holds(width, height)))
    }
}

impl OfferedSize {
    /// Whether pictures of this size are within it.
    pub const fn holds(&self, width: u32, height: u32) -> bool {
        let (min, max, step) = (self.min, self.max, self.step);
        width >= min.0
            && width <= max.0
            && height >= min.1
            && height <= max.1
            && (width - min.0).is_multiple_of(step.0)
            && (height - min.1).is_multiple_of(step.1)
    }
}

impl core::fmt::Display for OfferedSize {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} x {}", self.min.0, self.min.1)?;
        if self.min != self.max {
            write!(f, " to {} x {}", self.max.0, self.max.1)?;
        }
        Ok(())
    }
}

/// The formats in one line: those that pictures are taken from with their sizes, and how many others there are.
pub fn formats_in_words(formats: &[OfferedFormat]) -> String {
    let known = formats.iter().filter(|format| format.format.is_some());
    let mut words: Vec<String> = known
        .map(|format| {
            let sizes: Vec<String> = format.sizes.iter().map(ToString::to_string).collect();
            format!("{} {}", format.fourcc, sizes.join(", "))
        })
        .collect();
    match formats.len() - words.len() {
        0 if words.is_empty() => words.push("nothing".to_owned()),
        0 => {}
        others => words.push(format!("{others} formats that pictures cannot be taken from")),
    }
    words.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fixed(width: u32, height: u32, rates_hz: &[f32]) -> OfferedSize {
        let size = (width, height);
        OfferedSize { min: size, max: size, step: (1, 1), rates_hz: rates_hz.to_vec() }
    }

    fn format(fourcc: &str, sizes: Vec<OfferedSize>) -> OfferedFormat {
        let format = PixelFormat::ALL.into_iter().find(|format| format.name() == fourcc);
        OfferedFormat { fourcc: fourcc.to_owned(), description: String::new(), format, sizes }
    }

    fn device(number: u32, card: &str, names: &[&str], formats: Vec<OfferedFormat>) -> ListedDevice {
        ListedDevice {
            device: format!("/dev/video{number}").into(),
            names: names.iter().map(PathBuf::from).collect(),
            card: card.to_owned(),
            driver: "uvcvideo".to_owned(),
            bus: format!("usb-{number}"),
            formats,
            controls: Vec::new(),
            problem: None,
        }
    }

    const MOST: u64 = 1024 * 768;

    #[test]
    fn sizes_in_words_and_what_they_hold() {
        let small = fixed(640, 480, &[30.0]);
        let range = OfferedSize { min: (2, 1), max: (1920, 1080), step: (2, 1), rates_hz: vec![] };
        assert!(small.holds(640, 480) && !small.holds(320, 240));
        assert!(range.holds(512, 384) && !range.holds(513, 384) && !range.holds(1922, 10));
        let unknown = format("H264", vec![range.clone()]);
        let words =
            formats_in_words(&[format("GREY", vec![small.clone(), small]), unknown, format("Y16", vec![range])]);
        assert_eq!(
            words,
            "GREY 640 x 480, 640 x 480; Y16 2 x 1 to 1920 x 1080; 1 formats that pictures cannot be taken from"
        );
        assert_eq!(formats_in_words(&[]), "nothing");
    }

    #[test]
    fn two_of_a_kind_make_a_pair_in_the_largest_size_that_the_detector_takes() {
        let formats = || {
            vec![
                format("MJPG", vec![fixed(1920, 1080, &[30.0]), fixed(800, 600, &[60.0, 30.0])]),
                format("YUYV", vec![fixed(640, 480, &[30.0, 15.0]), fixed(800, 600, &[5.0, 20.0])]),
                format("H264", vec![fixed(1000, 700, &[30.0])]),
            ]
        };
        let devices = [
            device(0, "Webcam", &["/dev/v4l/by-path/pci-0", "/dev/v4l/by-id/usb-a"], formats()),
            device(2, "Other", &[], formats()),
            device(4, "Webcam", &["/dev/v4l/by-path/pci-1", "/dev/camera-right"], formats()),
        ];
        let found = proposals(&devices, MOST);
        let expected = CameraSettings {
            format: Some(PixelFormat::Yuyv),
            rate_hz: Some(20.0),
            ..CameraSettings::two("/dev/v4l/by-id/usb-a", "/dev/camera-right", 800, 600)
        };
        assert_eq!(found, [expected], "not compressed if need not be, by the names that last");
        assert!(found.iter().all(|settings| settings.check().is_ok()));
        assert!(proposals(&devices, 1000).is_empty());
    }

    #[test]
    fn a_device_with_pictures_of_double_width_or_height_is_a_pair() {
        let wide =
            device(0, "Stereo", &[], vec![format("YUYV", vec![fixed(2560, 720, &[30.0]), fixed(1280, 480, &[60.0])])]);
        let expected = CameraSettings {
            format: Some(PixelFormat::Yuyv),
            rate_hz: Some(60.0),
            ..CameraSettings::one("/dev/video0", PackedLayout::SideBySide, 640, 480)
        };
        assert_eq!(proposals(&[wide], MOST), [expected]);
        let high = device(1, "Stereo", &[], vec![format("GREY", vec![fixed(640, 800, &[]), fixed(640, 480, &[])])]);
        let expected = CameraSettings {
            format: Some(PixelFormat::Grey),
            ..CameraSettings::one("/dev/video1", PackedLayout::TopBottom, 640, 400)
        };
        assert_eq!(proposals(&[high], MOST), [expected]);
        let single = device(2, "Webcam", &[], vec![format("GREY", vec![fixed(640, 480, &[]), fixed(1280, 720, &[])])]);
        assert!(proposals(&[single], MOST).is_empty());
    }

    #[test]
    fn devices_that_scale_are_asked_for_usual_sizes() {
        let any = OfferedSize { min: (16, 16), max: (8192, 4320), step: (2, 1), rates_hz: vec![] };
        let devices = [0, 1].map(|number| device(number, "vivid", &[], vec![format("GREY", vec![any.clone()])]));
        let found = proposals(&devices, MOST);
        let expected = CameraSettings {
            format: Some(PixelFormat::Grey),
            ..CameraSettings::two("/dev/video0", "/dev/video1", 752, 480)
        };
        assert_eq!(found, [expected]);
    }

    #[test]
    fn devices_that_cannot_be_opened_make_no_pair() {
        let closed = |number| ListedDevice { problem: Some("busy".into()), ..device(number, "", &[], vec![]) };
        assert!(proposals(&[closed(0), closed(1)], MOST).is_empty());
    }
}
