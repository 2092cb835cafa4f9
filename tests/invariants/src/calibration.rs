//! The text of calibration files: KITTI, EuRoC, OpenCV in YAML and XML, ROS.

use std::path::Path;

use fencepost_core::{
    geometry::{CameraModel, RawPair, RectifiedPair, StereoCalibration},
    rectify::Rectifier,
};
use fencepost_hal::calibration::{Calibration, CalibrationFormat};

/// Names that files have; the first byte of an input chooses.
const NAMES: [[&str; 2]; 4] = [
    ["calib.txt", "other.txt"],
    ["left.yaml", "right.yaml"],
    ["calib.yml", "extrinsics.yml"],
    ["calib.xml", "extrinsics.xml"],
];

/// Stands between the texts of two files.
const BETWEEN: char = '\u{1e}';

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let Some((&first, text)) = bytes.split_first() else { return };
    let Ok(text) = std::str::from_utf8(text) else { return };
    let names = NAMES[usize::from(first) % NAMES.len()];
    let texts: Vec<&str> = text.splitn(2, BETWEEN).collect();
    let sources: Vec<(&Path, &str)> = names.iter().map(Path::new).zip(texts).collect();
    let pictures = match first / 64 {
        0 => None,
        1 => Some((640, 400)),
        2 => Some((32, 24)),
        _ => Some((752, 480)),
    };
    let found = Calibration::parse(&sources, pictures);
    match &found {
        Ok(found) => check(found, pictures),
        Err(error) => {
            let text = error.to_string();
            assert!(names.iter().any(|name| text.contains(name)), "an error that does not name its file: {text}");
        }
    }
    if first & 0x0C == 0 {
        // A debug text compares what is not a number, too.
        let again = Calibration::parse(&sources, pictures);
        assert_eq!(format!("{found:?}"), format!("{again:?}"), "the same text again");
    }
}

/// What was read can be used, or is refused by name where it is configured.
fn check(calibration: &Calibration, pictures: Option<(u32, u32)>) {
    assert!(!calibration.files.is_empty());
    for warning in &calibration.warnings {
        assert!(!warning.to_string().is_empty());
    }
    let size = match &calibration.stereo {
        StereoCalibration::Rectified(pair) => {
            assert_eq!(calibration.format, CalibrationFormat::Kitti);
            check_pair(pair);
            (pair.width, pair.height)
        }
        StereoCalibration::Raw(raw) => {
            check_raw(raw);
            (raw.left.width, raw.left.height)
        }
    };
    if calibration.format == CalibrationFormat::Kitti {
        assert_eq!(pictures.unwrap_or(size), size, "of another size than the pictures");
    }
    // Room for small pictures only: others are refused, whatever is in them.
    let mut rectifier = Rectifier::<{ 13 * 13 }>::new();
    match rectifier.configure(&calibration.stereo) {
        Ok(pair) => assert_eq!(pair.check(), Ok(())),
        Err(error) => assert!(error.field.starts_with("calibration"), "{error}"),
    }
}

fn check_pair(pair: &RectifiedPair) {
    let RectifiedPair { width, height, focal_px, cx, cy, baseline_m, disparity_offset_px } = *pair;
    assert!(width > 0 && height > 0 && focal_px > 0.0, "{pair:?}");
    let numbers = [focal_px, cx, cy, baseline_m, disparity_offset_px];
    assert!(numbers.iter().all(|number| number.is_finite()), "{pair:?}");
}

fn check_raw(raw: &RawPair) {
    for camera in [&raw.left, &raw.right] {
        let CameraModel { width, height, fx, fy, cx, cy, distortion } = *camera;
        assert!(width > 0 && height > 0, "{camera:?}");
        assert!([fx, fy, cx, cy].iter().chain(&distortion.0).all(|number| number.is_finite()), "{camera:?}");
    }
    assert!(raw.rotation.iter().flatten().chain(&raw.translation_m).all(|number| number.is_finite()), "{raw:?}");
    if let Some(chosen) = &raw.rectification {
        let rotations = chosen.left_rotation.iter().chain(&chosen.right_rotation).flatten();
        assert!(rotations.into_iter().all(|number| number.is_finite()), "{raw:?}");
        check_pair(&chosen.pair);
    }
}

/// Files as the tools write them, small ones.
pub(crate) fn seeds() -> Vec<Vec<u8>> {
    macro_rules! file {
        ($name:literal) => {
            include_str!(concat!("../../../hal/tests/calibration/", $name))
        };
    }
    let pair = |left: &str, right: &str| format!("{left}{BETWEEN}{right}");
    let euroc = "sensor_type: camera\nresolution: [752, 480]\ncamera_model: pinhole\nintrinsics: [458.6, 457.3, 367.2, 248.4]\n\
                 distortion_model: radial-tangential\ndistortion_coefficients: [-0.28, 0.07, 0.0002, 0.00002]\nT_BS:\n  rows: 4\n  \
                 cols: 4\n  data: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n";
    let right = euroc.replacen("1.0, 0.0, 0.0, 0.0, 0.0", "1.0, 0.0, 0.0, 0.11, 0.0", 1);
    [
        (
            64,
            "P0: 262.5 0 159.5 0 0 262.5 119.5 0 0 0 1 0\nP1: 262.5 0 159.5 -31.5 0 262.5 119.5 0 0 0 1 0\n".to_owned(),
        ),
        (1, pair(euroc, &right)),
        (1, pair(file!("left.yaml"), file!("right.yaml"))),
        (1, pair(file!("left_rational.yaml"), file!("right_rational.yaml"))),
        (2, file!("whole.yml").to_owned()),
        (66, pair(file!("intrinsics.yml"), file!("extrinsics.yml"))),
        (66, file!("pose_only.yml").to_owned()),
        (3, file!("whole.xml").to_owned()),
    ]
    .into_iter()
    .map(|(first, text)| [&[first], text.as_bytes()].concat())
    .collect()
}
