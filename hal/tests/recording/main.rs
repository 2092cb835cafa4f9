//! Recordings: what is written is read again, and everything that can be wrong with one is said.

mod folder;
mod reading;
mod truth;
mod writing;

use std::fs;
use std::path::{Path, PathBuf};

use fencepost_core::geometry::{
    CameraModel, Distortion, Mount, RawPair, Rectification, RectifiedPair, StereoCalibration,
};
use fencepost_core::picture::Picture;
use fencepost_hal::calibration::{Calibration, CalibrationFormat, CalibrationProblem};
use fencepost_hal::camera::{Camera, StereoPair};
use fencepost_hal::recording::{Layout, RecordedCamera, Recording, RecordingError, RecordingWarning, RecordingWriter};
use image::{DynamicImage, ImageBuffer, Luma, LumaA, Rgb};

const SIZE: (u32, u32) = (40, 24);
const PERIOD_NS: u64 = 50_000_001;
const MOUNT: Mount = Mount {
    height_m: Some(0.95),
    pitch_down_deg: 21.7,
    roll_deg: -0.3,
    forward_m: 0.0,
    left_m: 0.0,
    yaw_left_deg: 0.0,
};

/// A folder of its own for a test, gone at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("fencepost-recording-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        Self(path)
    }

    fn join(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.join(name), text).unwrap();
    }

    fn open(&self) -> Result<Recording, RecordingError> {
        Recording::open(&self.0)
    }

    fn camera(&self) -> RecordedCamera {
        self.open().unwrap().into_camera()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn rectified() -> RectifiedPair {
    RectifiedPair {
        width: SIZE.0,
        height: SIZE.1,
        focal_px: 31.7,
        cx: 19.3,
        cy: 12.1,
        baseline_m: 0.1234,
        disparity_offset_px: 0.7,
    }
}

fn raw() -> RawPair {
    let camera = |cx, k3| CameraModel {
        width: SIZE.0,
        height: SIZE.1,
        fx: 31.7,
        fy: 31.9,
        cx,
        cy: 12.1,
        distortion: Distortion([-0.3, 0.1, 0.001, -2.0e-5, k3, 0.0, 0.0, 0.0]),
    };
    let (sin, cos) = 0.02_f32.sin_cos();
    RawPair {
        left: camera(19.3, 0.0),
        right: camera(20.9, 0.01),
        rotation: [[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]],
        translation_m: [-0.1234, 0.001, -0.002],
        rectification: None,
    }
}

/// Grey values that no other frame or side has.
fn pixels(frame: u64, side: u64) -> Vec<u8> {
    (0..u64::from(SIZE.0 * SIZE.1)).map(|i| (i * 7 + frame * 31 + side * 101 + i * i / 13) as u8).collect()
}

fn time_ns(frame: u64) -> u64 {
    1_700_000_000_000_000_123 + frame * PERIOD_NS
}

fn put(writer: &mut RecordingWriter, frame: u64) -> Result<u32, RecordingError> {
    let (left, right) = (pixels(frame, 0), pixels(frame, 1));
    let view = |pixels| Picture::packed(pixels, SIZE.0 as usize, SIZE.1 as usize).unwrap();
    writer.write_pair(&StereoPair {
        left: view(&left),
        right: view(&right),
        timestamp_ns: time_ns(frame),
        skew_ns: 0,
        sequence: frame as u32,
        missed: 0,
    })
}

/// A sound recording of `frames` frames.
fn sound(name: &str, calibration: &StereoCalibration, frames: u64) -> Folder {
    let folder = Folder::new(name);
    let mut writer = RecordingWriter::create(&folder.0, calibration, &MOUNT).unwrap();
    for frame in 0..frames {
        assert_eq!(put(&mut writer, frame).unwrap(), frame as u32);
    }
    folder
}

fn kitti(name: &str) -> Folder {
    sound(name, &StereoCalibration::Rectified(rectified()), 3)
}

fn euroc(name: &str) -> Folder {
    sound(name, &StereoCalibration::Raw(raw()), 3)
}

fn grey(picture: &Picture<'_>) -> Vec<u8> {
    (0..picture.height()).flat_map(|y| picture.row(y)).copied().collect()
}

/// Number, time and pixels of each frame, or what is wrong with it.
#[expect(clippy::type_complexity, reason = "used by tests alone, which take it apart at once")]
fn play(camera: &mut RecordedCamera) -> Vec<Result<(u32, u64, [Vec<u8>; 2]), RecordingError>> {
    let mut frames = Vec::new();
    loop {
        match camera.next_pair(|pair| (pair.sequence, pair.timestamp_ns, [grey(&pair.left), grey(&pair.right)])) {
            Ok(Some(frame)) => frames.push(Ok(frame)),
            Ok(None) => return frames,
            Err(error) => frames.push(Err(error)),
        }
        assert!(frames.len() < 100, "a recording ends");
    }
}

/// Plays the frames that are sound and the errors of the others, by frame number.
fn errors(folder: &Folder) -> (Vec<u32>, Vec<RecordingError>) {
    let (mut good, mut bad) = (Vec::new(), Vec::new());
    for frame in play(&mut folder.camera()) {
        match frame {
            Ok((number, ..)) => good.push(number),
            Err(error) => bad.push(error),
        }
    }
    (good, bad)
}
