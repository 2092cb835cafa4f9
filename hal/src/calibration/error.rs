//! What is wrong with a calibration, where, and the mend.

use std::fmt;
use std::path::{Path, PathBuf};

/// A calibration that cannot be used: file, field, problem.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationError {
    /// The file; of a pair of files the one that holds the field.
    pub file: PathBuf,
    /// The field as it is written in the file; empty where the whole file is meant.
    pub field: String,
    /// What is wrong.
    pub problem: CalibrationProblem,
}

/// What is wrong with a field of a calibration.
#[derive(Clone, Debug, PartialEq)]
pub enum CalibrationProblem {
    /// The file cannot be read; says what the system says.
    Unreadable(String),
    /// The file is not text, or longer than a calibration can be.
    NotText,
    /// The text is not what the format wants.
    Syntax {
        /// Line, from 1.
        line: usize,
        /// What the reader says.
        message: String,
    },
    /// None of the known formats.
    UnknownFormat,
    /// The two files given do not belong together.
    NotAPair(&'static str),
    /// There is no calibration file.
    NoFile,
    /// The field is not there.
    Missing,
    /// Not a number.
    NotANumber(String),
    /// NaN or infinite.
    NotFinite,
    /// A matrix or list with the wrong number of entries.
    Shape {
        /// What is wanted, `3x4`.
        wanted: &'static str,
        /// What is there, `12 values`.
        found: String,
    },
    /// A focal length that is zero or negative.
    FocalLength(f64),
    /// A value outside the range that can be worked with.
    OutOfRange {
        /// The value.
        value: f64,
        /// Smallest allowed.
        min: f64,
        /// Largest allowed.
        max: f64,
    },
    /// The right camera lies to the left of the left one.
    Exchanged {
        /// Distance from the left to the right camera along the row, metres: negative.
        baseline_m: f64,
    },
    /// The cameras are in the same place, or as good as.
    NoBaseline {
        /// Distance from the left to the right camera along the row, metres.
        baseline_m: f64,
    },
    /// The cameras stand above or behind each other, not side by side.
    NotSideBySide {
        /// From the left to the right camera in the left camera's frame, metres.
        baseline_m: [f64; 3],
    },
    /// Not a rotation matrix.
    NotARotation {
        /// Largest deviation of `R^T R` from the identity, or the determinant's from one.
        deviation: f64,
    },
    /// The rectification was made for another pose than the one in `R` and `T`.
    RectificationDiffers {
        /// What the value is.
        value: f64,
        /// What it would be for this pose.
        from_pose: f64,
    },
    /// A lens model that is not pinhole with radial-tangential distortion.
    LensModel(String),
    /// Distortion coefficients that the model does not have.
    ExtraCoefficients {
        /// How many coefficients there are.
        count: usize,
    },
    /// The left and the right camera are not rectified to each other.
    NotRectified {
        /// Value of the left camera.
        left: f64,
        /// Value of the right camera.
        right: f64,
    },
    /// Neither the file nor the pictures say how large the pictures are.
    SizeUnknown,
    /// The pictures of left and right camera have different sizes.
    SizesDiffer {
        /// Size of the left camera's pictures, px.
        left: (u32, u32),
        /// Size of the right camera's pictures, px.
        right: (u32, u32),
    },
    /// The pictures have another size.
    SizeDiffers {
        /// Size in the file, px.
        file: (u32, u32),
        /// Size of the pictures, px.
        pictures: (u32, u32),
    },
}

/// What may be wrong with a calibration that can be used nevertheless.
#[derive(Clone, Debug, PartialEq)]
pub enum CalibrationWarning {
    /// The baseline is longer than a robot's cameras stand apart: another unit than metres?
    LongBaseline {
        /// The file.
        file: PathBuf,
        /// Length of the baseline as read, metres.
        baseline_m: f64,
    },
    /// Pixels are not square; the mean focal length is used.
    NotSquare {
        /// The file.
        file: PathBuf,
        /// The field.
        field: String,
        /// Focal lengths along the row and the column, px.
        focal_px: (f64, f64),
    },
    /// Left and right of a rectified pair differ slightly in a value that should be the same.
    NearlyRectified {
        /// The file.
        file: PathBuf,
        /// The value that differs.
        field: String,
        /// Value of the left camera.
        left: f64,
        /// Value of the right camera.
        right: f64,
    },
    /// `R1`, `R2`, `P1`, `P2` are there in part: they are chosen anew.
    RectificationIncomplete {
        /// The file.
        file: PathBuf,
        /// The first one that is missing.
        missing: String,
    },
}

impl CalibrationError {
    pub(crate) fn new(file: &Path, field: impl Into<String>, problem: CalibrationProblem) -> Self {
        Self { file: file.to_owned(), field: field.into(), problem }
    }
}

impl fmt::Display for CalibrationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.file.display())?;
        if !self.field.is_empty() {
            write!(f, "{}: ", self.field)?;
        }
        write!(f, "{}", self.problem)
    }
}

impl std::error::Error for CalibrationError {}

impl fmt::Display for CalibrationProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unreadable(reason) => write!(f, "cannot be read ({reason}); check the path and the permissions"),
            Self::NotText => write!(f, "is not a text file; give the calibration as YAML, XML or KITTI's calib.txt"),
            Self::Syntax { line, message } => {
                write!(f, "line {line}: {message}; mend the line or export the file anew")
            }
            Self::UnknownFormat => write!(
                f,
                "is no calibration in a known format; known are KITTI calib.txt, EuRoC sensor.yaml, OpenCV FileStorage \
                 YAML or XML, and ROS camera_info YAML"
            ),
            Self::NotAPair(what) => write!(f, "{what}"),
            Self::NoFile => write!(
                f,
                "holds no calibration; put calib.txt, calib.yaml, calib.xml, intrinsics.yml with extrinsics.yml, or \
                 left.yaml with right.yaml beside the pictures"
            ),
            Self::Missing => write!(f, "is missing; add it, or export the calibration of both cameras anew"),
            Self::NotANumber(text) => write!(f, "`{text}` is not a number; write a decimal number"),
            Self::NotFinite => write!(f, "is not a finite number; the calibration has failed, calibrate anew"),
            Self::Shape { wanted, found } => write!(f, "must have {wanted}, has {found}; export the matrix whole"),
            Self::FocalLength(value) => {
                write!(f, "focal length is {value}, must be above 0 px; calibrate anew or mend the matrix")
            }
            Self::OutOfRange { value, min, max } => write!(f, "is {value}, must lie within {min} to {max}"),
            Self::Exchanged { baseline_m } => write!(
                f,
                "baseline is {baseline_m:.4} m: left and right are exchanged; exchange the two cameras, both pictures and \
                 calibration (in calib.txt the fourth value of P1 must be negative)"
            ),
            Self::NoBaseline { baseline_m } => write!(
                f,
                "baseline is {baseline_m:.6} m, too short for stereo; give the translation from the left to the right \
                 camera in metres"
            ),
            Self::NotSideBySide { baseline_m: [x, y, z] } => write!(
                f,
                "the right camera lies ({x:.3}, {y:.3}, {z:.3}) m from the left one (right, down, forward), not beside \
                 it; mount the cameras side by side, or turn the pictures of a vertical pair by 90 degrees"
            ),
            Self::NotARotation { deviation } => {
                write!(f, "is not a rotation matrix (off by {deviation:.1e}); export it with all its digits")
            }
            Self::RectificationDiffers { value, from_pose } => write!(
                f,
                "has {value:.5} where R and T make it {from_pose:.5}; save R, T, R1, R2, P1 and P2 of the same calibration, \
                 with T and P2 in metres"
            ),
            Self::LensModel(model) => write!(
                f,
                "lens model `{model}` is not known; calibrate as pinhole with radial-tangential distortion (4, 5 or 8 \
                 coefficients)"
            ),
            Self::ExtraCoefficients { count } => write!(
                f,
                "has {count} coefficients, and those beyond the eighth are not zero; calibrate without the thin prism \
                 and tilted models (4, 5 or 8 coefficients)"
            ),
            Self::NotRectified { left, right } => write!(
                f,
                "is {left} for the left and {right} for the right camera: the pair is not rectified; rectify the \
                 pictures, or give the raw calibration"
            ),
            Self::SizeUnknown => {
                write!(f, "is missing, and there is no picture to take it from; add image_width and image_height")
            }
            Self::SizesDiffer { left: (lw, lh), right: (rw, rh) } => {
                write!(f, "is {rw} x {rh}, but {lw} x {lh} for the left camera; calibrate both at the same size")
            }
            Self::SizeDiffers { file: (fw, fh), pictures: (pw, ph) } => write!(
                f,
                "is {fw} x {fh}, but the pictures are {pw} x {ph}; use the calibration made at the pictures' size"
            ),
        }
    }
}

impl fmt::Display for CalibrationWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LongBaseline { file, baseline_m } => write!(
                f,
                "{}: the cameras stand {baseline_m} m apart; if that is in millimetres, divide the translation and the fourth value of P2 by 1000 (the \
                 chessboard's squares were given in millimetres)",
                file.display()
            ),
            Self::NotSquare { file, field, focal_px: (fx, fy) } => write!(
                f,
                "{}: {field}: focal lengths {fx} and {fy} px differ, their mean is used; rectify to square pixels",
                file.display()
            ),
            Self::NearlyRectified { file, field, left, right } => write!(
                f,
                "{}: {field} is {left} for the left and {right} for the right camera, the left one is used; rectify anew",
                file.display()
            ),
            Self::RectificationIncomplete { file, missing } => write!(
                f,
                "{}: {missing} is missing, so the rectification is chosen anew; save R1, R2, P1 and P2 to keep yours",
                file.display()
            ),
        }
    }
}
