//! Recordings in folders: KITTI odometry (rectified) and EuRoC ASL (raw), told apart by what is found.
//!
//! ```text
//! KITTI   image_0/NNNNNN.png left, image_1/ right, calib.txt, times.txt
//! EuRoC   mav0/cam0 left, mav0/cam1 right, each with data/*.png, data.csv, sensor.yaml
//! both    mount.json: height_m, pitch_down_deg, roll_deg of the left camera
//! truth   disp_occ_0/NNNNNN.png disparity, velodyne/NNNNNN.bin lidar sweeps with Tr in calib.txt; either may be absent
//! ```
//!
//! Pictures in KITTI's layout with the files of OpenCV or ROS in place of `calib.txt` are taken as raw.

mod camera;
mod error;
mod euroc;
mod kitti;
mod mount;
mod picture;
mod truth;
mod writer;

use std::path::{Path, PathBuf};

use fencepost_core::geometry::{Mount, StereoCalibration};

pub use camera::RecordedCamera;
pub use error::{RecordingError, RecordingWarning};
pub use picture::GreyPicture;
pub use truth::{TrueDisparity, Truth};
pub use writer::RecordingWriter;

use crate::calibration::Calibration;

/// How the files of a recording are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// KITTI odometry.
    Kitti,
    /// EuRoC ASL.
    Euroc,
}

/// A pair of a recording, not yet read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedFrame {
    /// Number of the frame: of the file in KITTI's layout, counted from 0 in EuRoC's.
    pub number: u32,
    /// Time of exposure, nanoseconds.
    pub timestamp_ns: u64,
    /// Name of the pictures, without extension.
    pub name: String,
    /// Left picture.
    pub left: PathBuf,
    /// Right picture.
    pub right: PathBuf,
}

/// A recording that was opened: everything but the pictures is read.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Where it lies.
    pub folder: PathBuf,
    /// How it is laid out.
    pub layout: Layout,
    /// The pair of cameras.
    pub calibration: Calibration,
    /// The left camera on the vehicle.
    pub mount: Mount,
    /// The frames in the order of the recording; one at least.
    pub frames: Vec<RecordedFrame>,
    /// Truth that lies beside the pictures.
    pub truth: Truth,
    /// What is odd about it.
    pub warnings: Vec<RecordingWarning>,
}

impl Layout {
    /// The name in words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Kitti => "KITTI odometry",
            Self::Euroc => "EuRoC ASL",
        }
    }
}

impl Recording {
    /// Opens the recording in `folder`.
    ///
    /// # Errors
    /// [`RecordingError`] when there is no recording, its lists, calibration or mount cannot be read, or no picture tells
    /// the size where the calibration does not.
    pub fn open(folder: impl AsRef<Path>) -> Result<Self, RecordingError> {
        let folder = folder.as_ref();
        if !folder.is_dir() {
            return Err(RecordingError::NotAFolder(folder.to_owned()));
        }
        let mut warnings = Vec::new();
        let (layout, frames) = if folder.join("image_0").is_dir() {
            (Layout::Kitti, kitti::frames(folder, &mut warnings)?)
        } else if folder.join("mav0").is_dir() {
            (Layout::Euroc, euroc::frames(folder, &mut warnings)?)
        } else {
            return Err(RecordingError::UnknownLayout(folder.to_owned()));
        };
        let calibration = Calibration::load_from_folder(folder, first_size(&frames))?;
        warnings.extend(calibration.warnings.iter().cloned().map(RecordingWarning::Calibration));
        let mount = mount::read(folder, &mut warnings)?;
        warn_of_times(folder, layout, &frames, &mut warnings);
        let truth = Truth::of(folder);
        Ok(Self { folder: folder.to_owned(), layout, calibration, mount, frames, truth, warnings })
    }

    /// Plays the recording as a camera.
    pub const fn into_camera(self) -> RecordedCamera {
        RecordedCamera::new(self)
    }

    /// Width and height of the pictures, px.
    pub const fn picture_size(&self) -> (u32, u32) {
        picture_size(&self.calibration.stereo)
    }
}

impl std::fmt::Display for Layout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

const fn picture_size(calibration: &StereoCalibration) -> (u32, u32) {
    match calibration {
        StereoCalibration::Rectified(pair) => (pair.width, pair.height),
        StereoCalibration::Raw(pair) => (pair.left.width, pair.left.height),
    }
}

/// Size of the first picture that can be read. A broken one is an error of its frame, not of the recording.
fn first_size(frames: &[RecordedFrame]) -> Option<(u32, u32)> {
    frames.iter().find_map(|frame| picture::size(frame.number, &frame.left).ok())
}

fn warn_of_times(folder: &Path, layout: Layout, frames: &[RecordedFrame], warnings: &mut Vec<RecordingWarning>) {
    let steps = frames.iter().zip(frames.iter().skip(1));
    let mut falls =
        steps.filter(|(before, after)| after.timestamp_ns <= before.timestamp_ns).map(|(_, after)| after.number);
    if let Some(frame) = falls.next() {
        let file = folder.join(if layout == Layout::Kitti { "times.txt" } else { "mav0/cam0/data.csv" });
        warnings.push(RecordingWarning::TimeDoesNotRise { file, frame, count: 1 + falls.count() });
    }
}

/// The files of a folder, in the order of their names.
fn list_folder(folder: &Path) -> Result<Vec<PathBuf>, RecordingError> {
    let io = |error: std::io::Error| RecordingError::io(folder, &error);
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
        if !hidden && path.is_file() {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}
