//! What is wrong with a recording, where, and the mend.

use std::fmt;
use std::path::PathBuf;

use crate::calibration::{CalibrationError, CalibrationWarning};

/// A recording, or a frame of it, that cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub enum RecordingError {
    /// The folder is not there, or is not a folder.
    NotAFolder(PathBuf),
    /// The folder has neither layout.
    UnknownLayout(PathBuf),
    /// A file or folder cannot be read or written; says what the system says.
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// The calibration cannot be used.
    Calibration(CalibrationError),
    /// `mount.json` cannot be used.
    Mount {
        /// The file.
        file: PathBuf,
        /// The field; empty where the whole file is meant.
        field: String,
        /// What is wrong.
        problem: String,
        /// What to do about it.
        mend: String,
    },
    /// A line of `times.txt` or `data.csv` cannot be read.
    Line {
        /// The file.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong, and the mend.
        problem: String,
    },
    /// There is no pair of pictures.
    NoFrames(PathBuf),
    /// A picture of this frame is not there.
    MissingPicture {
        /// The frame.
        frame: u32,
        /// The picture.
        path: PathBuf,
    },
    /// A picture of this frame cannot be decoded: truncated, or not a picture.
    BadPicture {
        /// The frame.
        frame: u32,
        /// The picture.
        path: PathBuf,
        /// What the decoder says.
        reason: String,
    },
    /// Left and right picture of this frame have different sizes.
    SizesDiffer {
        /// The frame.
        frame: u32,
        /// The right picture.
        path: PathBuf,
        /// Size of the left picture, px.
        left: (u32, u32),
        /// Size of the right picture, px.
        right: (u32, u32),
    },
    /// The pictures of this frame have another size than the calibration is for.
    SizeDiffersFromCalibration {
        /// The frame.
        frame: u32,
        /// The picture.
        path: PathBuf,
        /// Size of the picture, px.
        picture: (u32, u32),
        /// Size in the calibration, px.
        calibration: (u32, u32),
    },
    /// Truth of this frame, a sweep or a disparity picture, cannot be used.
    BadTruth {
        /// The frame.
        frame: u32,
        /// The file.
        path: PathBuf,
        /// What is wrong, and the mend.
        problem: String,
    },
    /// What is to be written does not fit the recording.
    Unwritable {
        /// The folder of the recording.
        folder: PathBuf,
        /// What is wrong, and the mend.
        problem: String,
    },
}

/// What is odd about a recording that can be used nevertheless.
#[derive(Clone, Debug, PartialEq)]
pub enum RecordingWarning {
    /// The calibration has something to say.
    Calibration(CalibrationWarning),
    /// There is no `mount.json`.
    MountMissing(PathBuf),
    /// A tilt in `mount.json` is not known; 0 stands in.
    TiltUnknown {
        /// The file.
        file: PathBuf,
        /// The field.
        field: &'static str,
    },
    /// `mount.json` has a number that looks like height or tilt under another name.
    MountKeyIgnored {
        /// The file.
        file: PathBuf,
        /// The key.
        key: String,
    },
    /// There are no times; they are made at 10 Hz.
    TimesMissing(PathBuf),
    /// There are fewer times than frames; times at 10 Hz stand in.
    TimesTooFew {
        /// The file.
        file: PathBuf,
        /// Times there.
        times: usize,
        /// Frames there.
        frames: usize,
    },
    /// The time of a frame is not after the one before it.
    TimeDoesNotRise {
        /// The file.
        file: PathBuf,
        /// The first such frame.
        frame: u32,
        /// How many there are.
        count: usize,
    },
    /// The last line of a list is torn off: whoever wrote it was stopped.
    TornLine {
        /// The file.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
    },
    /// The last frame has a right picture only: whoever wrote it was stopped.
    Unfinished {
        /// The frame.
        frame: u32,
        /// The right picture.
        path: PathBuf,
    },
    /// `data.csv` is not there; the times are taken from the names of the pictures.
    ListMissing(PathBuf),
    /// Pictures without a partner in the other camera are left out.
    Unpaired {
        /// The folder of the camera.
        folder: PathBuf,
        /// How many there are.
        count: usize,
        /// Time of the first, nanoseconds.
        first_ns: u64,
    },
    /// Left and right were not taken at the same time.
    PairedByNearest {
        /// The folder of the recording.
        folder: PathBuf,
        /// How many pairs.
        count: usize,
        /// The largest difference, nanoseconds.
        largest_ns: u64,
    },
    /// Files among the pictures whose names are no frame numbers are left out.
    NotNumbered {
        /// The first of them.
        path: PathBuf,
        /// How many there are.
        count: usize,
    },
    /// The pictures have colours; they are turned to grey.
    Colour(PathBuf),
    /// The pictures have 16 bits; the upper 8 are used.
    SixteenBit(PathBuf),
}

impl RecordingError {
    /// The frame, where the error is of one frame only: the next call gets the next frame.
    pub const fn frame(&self) -> Option<u32> {
        match self {
            Self::MissingPicture { frame, .. }
            | Self::BadPicture { frame, .. }
            | Self::SizesDiffer { frame, .. }
            | Self::BadTruth { frame, .. }
            | Self::SizeDiffersFromCalibration { frame, .. } => Some(*frame),
            _ => None,
        }
    }

    pub(super) fn io(path: &std::path::Path, error: &std::io::Error) -> Self {
        Self::Io { path: path.to_owned(), reason: error.to_string() }
    }
}

impl fmt::Display for RecordingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAFolder(path) => {
                write!(f, "{}: is not a folder; give the folder that holds the recording", path.display())
            }
            Self::UnknownLayout(path) => write!(
                f,
                "{}: is not a recording; it must hold image_0 and image_1 (KITTI), or mav0/cam0 and mav0/cam1 (EuRoC)",
                path.display()
            ),
            Self::Io { path, reason } => {
                write!(f, "{}: {reason}; check the path, the permissions and the space on the disk", path.display())
            }
            Self::Calibration(error) => error.fmt(f),
            Self::Mount { file, field, problem, mend } if field.is_empty() => {
                write!(f, "{}: {problem}; {mend}", file.display())
            }
            Self::Mount { file, field, problem, mend } => write!(f, "{}: {field}: {problem}; {mend}", file.display()),
            Self::Line { file, line, problem } => write!(f, "{}: line {line}: {problem}", file.display()),
            Self::NoFrames(path) => write!(
                f,
                "{}: holds no pairs of pictures; left and right must have the same numbers (KITTI) or times (EuRoC)",
                path.display()
            ),
            Self::MissingPicture { frame, path } => {
                write!(f, "frame {frame}: {}: is missing; copy it again from where it was recorded", path.display())
            }
            Self::BadPicture { frame, path, reason } => write!(
                f,
                "frame {frame}: {}: cannot be decoded ({reason}); it is truncated or not a picture: copy it again",
                path.display()
            ),
            Self::SizesDiffer { frame, path, left: (lw, lh), right: (rw, rh) } => write!(
                f,
                "frame {frame}: {}: is {rw} x {rh}, but the left picture is {lw} x {lh}; both must have the same size",
                path.display()
            ),
            Self::SizeDiffersFromCalibration { frame, path, picture: (w, h), calibration: (cw, ch) } => write!(
                f,
                "frame {frame}: {}: is {w} x {h}, but the calibration is for {cw} x {ch}; use the calibration made at this \
                 size",
                path.display()
            ),
            Self::BadTruth { frame, path, problem } => write!(f, "frame {frame}: {}: {problem}", path.display()),
            Self::Unwritable { folder, problem } => write!(f, "{}: {problem}", folder.display()),
        }
    }
}

impl std::error::Error for RecordingError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Calibration(error) => Some(error),
            _ => None,
        }
    }
}

impl From<CalibrationError> for RecordingError {
    fn from(error: CalibrationError) -> Self {
        Self::Calibration(error)
    }
}

impl fmt::Display for RecordingWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Calibration(warning) => warning.fmt(f),
            Self::MountMissing(path) => write!(
                f,
                "{}: is missing, so height and tilt of the camera are not known; write height_m, pitch_down_deg and roll_deg",
                path.display()
            ),
            Self::TiltUnknown { file, field } => {
                write!(f, "{}: {field}: is not known, 0 stands in; write it in degrees", file.display())
            }
            Self::MountKeyIgnored { file, key } => write!(
                f,
                "{}: {key}: is not known and ignored; the keys are height_m, pitch_down_deg and roll_deg",
                file.display()
            ),
            Self::TimesMissing(path) => {
                write!(
                    f,
                    "{}: is missing, times at 10 Hz stand in; write a line with seconds per frame",
                    path.display()
                )
            }
            Self::TimesTooFew { file, times, frames } => write!(
                f,
                "{}: has {times} times for {frames} frames, times at 10 Hz stand in; write a line with seconds per frame",
                file.display()
            ),
            Self::TimeDoesNotRise { file, frame, count } => write!(
                f,
                "{}: the time of frame {frame} is not after the one before it ({count} such frames); the frames come in the \
                 order of the recording nevertheless, mend the times",
                file.display()
            ),
            Self::TornLine { file, line } => write!(
                f,
                "{}: line {line}, the last one, is torn off and left out; the recording was stopped, or the disk was full",
                file.display()
            ),
            Self::Unfinished { frame, path } => write!(
                f,
                "{}: is the last picture and has no left partner, frame {frame} is left out; the recording was stopped, or the \
                 disk was full",
                path.display()
            ),
            Self::ListMissing(path) => write!(
                f,
                "{}: is missing, the times are taken from the names of the pictures; write a line `timestamp,name` each",
                path.display()
            ),
            Self::Unpaired { folder, count, first_ns } => write!(
                f,
                "{}: {count} pictures without a partner are left out, the first at {first_ns} ns; check that both cameras \
                 were triggered together",
                folder.display()
            ),
            Self::PairedByNearest { folder, count, largest_ns } => write!(
                f,
                "{}: {count} pairs were not taken at the same time, up to {largest_ns} ns apart; trigger both cameras \
                 together",
                folder.display()
            ),
            Self::NotNumbered { path, count } => write!(
                f,
                "{}: is not named by a frame number and left out ({count} such files); name pictures NNNNNN.png",
                path.display()
            ),
            Self::Colour(path) => {
                write!(f, "{}: has colours, they are turned to grey; record in grey to save time", path.display())
            }
            Self::SixteenBit(path) => {
                write!(f, "{}: has 16 bits, the upper 8 are used; record with 8 bits to save time", path.display())
            }
        }
    }
}
