//! Calibrations of stereo pairs, from the files that calibration tools write.
//!
//! | format | files | gives |
//! | --- | --- | --- |
//! | KITTI | `calib.txt` with `P0:` and `P1:` | a rectified pair |
//! | EuRoC | a `sensor.yaml` for each camera | a raw pair |
//! | OpenCV | FileStorage YAML or XML, in one file or `intrinsics` and `extrinsics` | a raw pair |
//! | ROS | a `camera_info` YAML for each camera | a raw pair |

mod document;
mod error;
mod euroc;
mod kitti;
mod lidar;
mod opencv;
mod pair;
mod ros;

use std::{
    io::Read,
    path::{Path, PathBuf},
};

use fencepost_core::geometry::StereoCalibration;

pub use error::{CalibrationError, CalibrationProblem, CalibrationWarning};
pub use lidar::LidarCalibration;

use document::{Document, Node};

/// Longest calibration file that is read, bytes: real ones have a few thousand.
const MAX_BYTES: u64 = 1 << 20;

/// The files that are looked for beside the pictures, in this order; of each set all must be there.
const SETS: [&[&str]; 15] = [
    &["calib.txt"],
    &["mav0/cam0/sensor.yaml", "mav0/cam1/sensor.yaml"],
    &["calib.yaml"],
    &["calib.yml"],
    &["calib.xml"],
    &["calibration.yaml"],
    &["calibration.yml"],
    &["calibration.xml"],
    &["stereo.yaml"],
    &["stereo.yml"],
    &["stereo.xml"],
    &["intrinsics.yml", "extrinsics.yml"],
    &["intrinsics.xml", "extrinsics.xml"],
    &["left.yaml", "right.yaml"],
    &["left.yml", "right.yml"],
];

/// Where a calibration comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CalibrationFormat {
    /// KITTI's `calib.txt`.
    Kitti,
    /// EuRoC's `sensor.yaml` for each camera.
    Euroc,
    /// OpenCV's FileStorage, YAML or XML.
    OpenCv,
    /// ROS `camera_info` for each camera.
    Ros,
}

/// A calibration as it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// The pair.
    pub stereo: StereoCalibration,
    /// The format it was found in.
    pub format: CalibrationFormat,
    /// The files it was read from.
    pub files: Vec<PathBuf>,
    /// What may be wrong with it.
    pub warnings: Vec<CalibrationWarning>,
}

impl CalibrationFormat {
    /// The name in words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Kitti => "KITTI calib.txt",
            Self::Euroc => "EuRoC sensor.yaml",
            Self::OpenCv => "OpenCV FileStorage",
            Self::Ros => "ROS camera_info",
        }
    }
}

impl Calibration {
    /// Reads one file, or the two files of a pair (left first), and tells the format by what is in them.
    ///
    /// `pictures` is the width and height of the pictures in pixels where it is known: it stands in where the files do
    /// not say it, and is checked against them where they do.
    ///
    /// # Errors
    /// [`CalibrationError`], naming file and field.
    pub fn load(paths: &[impl AsRef<Path>], pictures: Option<(u32, u32)>) -> Result<Self, CalibrationError> {
        let files: Vec<PathBuf> = paths.iter().map(|path| path.as_ref().to_owned()).collect();
        let texts = files.iter().map(|file| read(file)).collect::<Result<Vec<_>, _>>()?;
        let sources: Vec<(&Path, &str)> =
            files.iter().zip(&texts).map(|(file, text)| (file.as_path(), text.as_str())).collect();
        Self::parse(&sources, pictures)
    }

    /// As [`Calibration::load`], from the text of the files.
    ///
    /// # Errors
    /// As [`Calibration::load`].
    pub fn parse(sources: &[(&Path, &str)], pictures: Option<(u32, u32)>) -> Result<Self, CalibrationError> {
        let mut warnings = Vec::new();
        let first = sources.first().map(|(file, _)| *file).unwrap_or(Path::new(""));
        let error = |problem| Err(CalibrationError::new(first, "", problem));
        if let [(file, text)] = sources
            && is_kitti(file, text)
        {
            let stereo = StereoCalibration::Rectified(kitti::parse(file, text, pictures, &mut warnings)?);
            return Ok(Self { stereo, format: CalibrationFormat::Kitti, files: vec![(*file).to_owned()], warnings });
        }
        let documents = sources.iter().map(|(file, text)| document(file, text)).collect::<Result<Vec<_>, _>>()?;
        let (format, pair) = match documents.as_slice() {
            [left, right] if is_euroc(left) && is_euroc(right) => {
                (CalibrationFormat::Euroc, euroc::parse([left, right], pictures, &mut warnings)?)
            }
            [left, right] if ros::is_ros(left) && ros::is_ros(right) => {
                (CalibrationFormat::Ros, ros::parse([left, right], pictures, &mut warnings)?)
            }
            [one] if is_euroc(one) || ros::is_ros(one) => {
                return error(CalibrationProblem::NotAPair("is of one camera; give the files of both, left first"));
            }
            [_] | [_, _] if documents.iter().all(opencv::is_opencv) => {
                (CalibrationFormat::OpenCv, opencv::parse(&documents, pictures, &mut warnings)?)
            }
            [left, right] if is_known(left) && is_known(right) => {
                return error(CalibrationProblem::NotAPair(
                    "and its partner have different formats; give files of one tool",
                ));
            }
            _ => {
                let stranger = documents.iter().find(|document| !is_known(document)).map_or(first, |d| d.file);
                return Err(CalibrationError::new(stranger, "", CalibrationProblem::UnknownFormat));
            }
        };
        let stereo = StereoCalibration::Raw(pair);
        Ok(Self { stereo, format, files: sources.iter().map(|(file, _)| (*file).to_owned()).collect(), warnings })
    }

    /// Reads the calibration that lies beside the pictures of a folder.
    ///
    /// # Errors
    /// As [`Calibration::load`], and when the folder holds none.
    pub fn load_from_folder(folder: &Path, pictures: Option<(u32, u32)>) -> Result<Self, CalibrationError> {
        for names in SETS {
            let paths: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
            // One of a set is enough to try: the error then says which other one is missing.
            if paths.iter().any(|path| path.exists()) {
                return Self::load(&paths, pictures);
            }
        }
        Err(CalibrationError::new(folder, "", CalibrationProblem::NoFile))
    }
}

impl std::fmt::Display for CalibrationFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

fn read(file: &Path) -> Result<String, CalibrationError> {
    let error = |problem| CalibrationError::new(file, "", problem);
    let unreadable = |e: std::io::Error| error(CalibrationProblem::Unreadable(e.to_string()));
    // A device or a pipe has no length, and may have no end.
    if !std::fs::metadata(file).map_err(unreadable)?.is_file() {
        return Err(error(CalibrationProblem::NotText));
    }
    let mut bytes = Vec::new();
    std::fs::File::open(file).map_err(unreadable)?.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(error(CalibrationProblem::NotText));
    }
    String::from_utf8(bytes).map_err(|_| error(CalibrationProblem::NotText))
}

/// KITTI's lines are valid YAML too, so they are looked for first: `P0:` with a number behind it, or a `.txt` file.
fn is_kitti(file: &Path, text: &str) -> bool {
    let line = |line: &str| {
        let rest = line.trim_start().strip_prefix("P0:").or_else(|| line.trim_start().strip_prefix("P1:"));
        rest.and_then(|rest| rest.split_whitespace().next()).is_some_and(|word| document::number(word).is_ok())
    };
    file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("txt")) || text.lines().any(line)
}

fn document<'a>(file: &'a Path, text: &str) -> Result<Document<'a>, CalibrationError> {
    let root = if text.trim_start_matches('\u{feff}').trim_start().starts_with('<') {
        Node::from_xml(text.trim_start_matches('\u{feff}').trim_start())
    } else {
        Node::from_yaml(text)
    };
    let root =
        root.map_err(|(line, message)| CalibrationError::new(file, "", CalibrationProblem::Syntax { line, message }))?;
    Ok(Document { file, root })
}

fn is_known(document: &Document<'_>) -> bool {
    is_euroc(document) || ros::is_ros(document) || opencv::is_opencv(document)
}

fn is_euroc(document: &Document<'_>) -> bool {
    document.find(&["T_BS", "intrinsics", "sensor_type"]).is_some()
}
