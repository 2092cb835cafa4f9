//! `cameras`: what cameras there are, and which would fit a rig.

use fencepost_hal::camera::{CameraSettings, ListedDevice, OfferedControl, OfferedFormat, OfferedSize, proposals};
use serde::Serialize;

use super::Ending;
use crate::{cli::CamerasArgs, console::Console, error::Failure};

/// Largest pictures that are proposed, px: more makes a small computer late.
const MOST_PIXELS: u64 = 1280 * 800;

/// Sizes of one format that are shown; the others are counted.
const MOST_SIZES: usize = 8;

/// Formats that are not used whose names are shown.
const MOST_OTHERS: usize = 12;

/// Everything that is found, for `--json`.
#[derive(Debug, Serialize)]
struct Found {
    devices: Vec<ListedDevice>,
    /// Each as `[pair.camera]` takes it.
    pairs: Vec<CameraSettings>,
}

/// Lists the cameras of this machine.
///
/// # Errors
/// When the program was built without V4L2.
pub fn cameras(args: &CamerasArgs, console: &mut Console) -> Result<Ending, Failure> {
    let devices = list()?;
    let pairs = proposals(&devices, MOST_PIXELS);
    let found = Found { devices, pairs };
    if args.json {
        let json = serde_json::to_string_pretty(&found)
            .map_err(|error| Failure::work(format!("the list cannot be made: {error}")))?;
        console.result(json);
    } else {
        console.result(in_words(&found));
    }
    Ok(Ending::Good)
}

#[cfg(all(feature = "v4l", target_os = "linux"))]
#[expect(clippy::unnecessary_wraps, reason = "without the feature there is an error")]
fn list() -> Result<Vec<ListedDevice>, Failure> {
    Ok(fencepost_hal::camera::v4l2::list())
}

#[cfg(not(all(feature = "v4l", target_os = "linux")))]
fn list() -> Result<Vec<ListedDevice>, Failure> {
    Err(crate::live::no_v4l())
}

fn in_words(found: &Found) -> String {
    let mut lines = Vec::new();
    if found.devices.is_empty() {
        lines.push("no cameras found; plug them in, and see what the kernel says of them (`dmesg`)".to_string());
    }
    for device in &found.devices {
        lines.extend(device_in_words(device));
        lines.push(String::new());
    }
    match found.pairs.as_slice() {
        [] if found.devices.is_empty() => {}
        [] => lines.push(
            "no two of them are of the same kind with a size in common, and none delivers two pictures in one"
                .to_string(),
        ),
        pairs => {
            lines.push("these would make a pair; for the rig's file, with your calibration and mount:".to_string());
            for pair in pairs {
                lines.push(format!("\n{}", section(pair)));
            }
        }
    }
    lines.join("\n").trim_end().to_string()
}

fn device_in_words(device: &ListedDevice) -> Vec<String> {
    let ListedDevice { card, driver, bus, .. } = device;
    let path = device.device.display();
    if let Some(problem) = &device.problem {
        return vec![problem.clone()];
    }
    let mut lines = vec![format!("{path}  {card} ({driver}, {bus})")];
    if !device.names.is_empty() {
        let names: Vec<String> = device.names.iter().map(|name| name.display().to_string()).collect();
        lines.push(format!("  also    {}", names.join("\n          ")));
    }
    let (known, others): (Vec<_>, Vec<_>) = device.formats.iter().partition(|format| format.format.is_some());
    lines.extend(known.iter().map(|format| format_in_words(format)));
    if known.is_empty() {
        lines.push("  no format that pictures can be taken from".to_string());
    }
    if !others.is_empty() {
        let mut names: Vec<&str> = others.iter().take(MOST_OTHERS).map(|format| format.fourcc.as_str()).collect();
        if others.len() > MOST_OTHERS {
            names.push("...");
        }
        lines.push(format!("  not used {}", names.join(", ")));
    }
    let controls: Vec<String> = device.controls.iter().map(control_in_words).collect();
    if !controls.is_empty() {
        lines.push(format!("  {}", controls.join("; ")));
    }
    lines
}

fn format_in_words(format: &OfferedFormat) -> String {
    let use_of_it = if format.format.is_some_and(|format| format.is_lent()) { "" } else { " (unpacked)" };
    let mut sizes: Vec<String> = format.sizes.iter().take(MOST_SIZES).map(size_in_words).collect();
    if format.sizes.len() > MOST_SIZES {
        sizes.push(format!("{} more", format.sizes.len() - MOST_SIZES));
    }
    format!("  {:<6}  {}{use_of_it}", format.fourcc, sizes.join("; "))
}

fn size_in_words(size: &OfferedSize) -> String {
    let rates: Vec<String> = size.rates_hz.iter().map(|rate| format!("{}", (rate * 100.0).round() / 100.0)).collect();
    if rates.is_empty() { size.to_string() } else { format!("{size} at {} Hz", rates.join(", ")) }
}

fn control_in_words(control: &OfferedControl) -> String {
    let OfferedControl { name, min, max, value, .. } = control;
    let now = value.map_or_else(String::new, |value| format!(", now {value}"));
    format!("{name} {min} to {max}{now}")
}

/// The section of a rig's file. What is as by default is left out.
fn section(pair: &CameraSettings) -> String {
    let usual = toml::Table::try_from(CameraSettings::two("", "", 0, 0)).unwrap_or_default();
    let mut table = toml::Table::try_from(pair).unwrap_or_default();
    table.retain(|name, value| usual.get(name) != Some(value));
    format!("[[pair]]\ncalibration = [\"left.yaml\", \"right.yaml\"]\n[pair.camera]\n{table}").trim_end().to_string()
}

#[cfg(test)]
mod tests {
    use fencepost_hal::camera::{PackedLayout, PixelFormat};

    use super::*;

    fn device(path: &str) -> ListedDevice {
        let size = |width, height| OfferedSize {
            min: (width, height),
            max: (width, height),
            step: (1, 1),
            rates_hz: vec![30.0, 14.999],
        };
        let format = |fourcc: &str, format| OfferedFormat {
            fourcc: fourcc.to_string(),
            description: String::new(),
            format,
            sizes: vec![size(640, 480), size(320, 240)],
        };
        ListedDevice {
            device: path.into(),
            names: vec!["/dev/v4l/by-path/pci-1".into()],
            card: "Global shutter".to_string(),
            driver: "uvcvideo".to_string(),
            bus: "usb-1".to_string(),
            formats: vec![format("GREY", Some(PixelFormat::Grey)), format("H264", None)],
            controls: vec![OfferedControl {
                name: "Gain".to_string(),
                id: 1,
                min: 0,
                max: 100,
                default: 10,
                value: Some(16),
            }],
            problem: None,
        }
    }

    #[test]
    fn devices_and_the_pair_that_they_make_are_shown() {
        let devices = vec![device("/dev/video0"), device("/dev/video2")];
        let pairs = proposals(&devices, MOST_PIXELS);
        let words = in_words(&Found { devices, pairs });
        for line in [
            "/dev/video0  Global shutter (uvcvideo, usb-1)",
            "  also    /dev/v4l/by-path/pci-1",
            "  GREY    640 x 480 at 30, 15 Hz; 320 x 240 at 30, 15 Hz",
            "  not used H264",
            "  Gain 0 to 100, now 16",
            "[pair.camera]",
            "width = 640",
        ] {
            assert!(words.lines().any(|found| found == line), "{line} is not in\n{words}");
        }
        assert!(in_words(&Found { devices: vec![], pairs: vec![] }).starts_with("no cameras found"));
        let one = vec![device("/dev/video0")];
        assert!(in_words(&Found { devices: one, pairs: vec![] }).contains("no two of them"));
        let busy = ListedDevice { problem: Some("/dev/video4: is used".to_string()), ..device("/dev/video4") };
        assert!(in_words(&Found { devices: vec![busy], pairs: vec![] }).starts_with("/dev/video4: is used\n"));
    }

    #[test]
    fn a_section_holds_what_is_not_the_default_and_is_read_as_it_was_meant() {
        #[derive(serde::Deserialize)]
        struct File {
            pair: Vec<Pair>,
        }
        #[derive(serde::Deserialize)]
        struct Pair {
            camera: CameraSettings,
        }
        let settings = CameraSettings {
            format: Some(PixelFormat::Y10),
            rate_hz: Some(15.0),
            ..CameraSettings::one("/dev/stereo", PackedLayout::TopBottom, 640, 400)
        };
        let text = section(&settings);
        assert!(!text.contains("buffers") && !text.contains("timeout_ms"), "{text}");
        let file: File = toml::from_str(&text).unwrap();
        assert_eq!(file.pair[0].camera, settings);
    }
}
