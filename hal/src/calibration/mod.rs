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
mod pair;

use std::path::{Path, PathBuf};

use fencepost_core::geometry::StereoCalibration;

pub use error::{CalibrationError, CalibrationProblem, CalibrationWarning};

use document::{Document, Node};

/// Longest calibration file that is read, bytes: real ones have a few thousand.
const MAX_BYTES: u64 = 1 << 20;

/// Where a calibration comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CalibrationFormat {
    /// KITTI's `calib.txt`.
    Kitti,
    /// EuRoC's `sensor.yaml` for each camera.
    Euroc,
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
        let (format, stereo) = if let [(file, text)] = sources
            && is_kitti(file, text)
        {
            (CalibrationFormat::Kitti, StereoCalibration::Rectified(kitti::parse(file, text, pictures, &mut warnings)?))
        } else {
            let documents = sources.iter().map(|(file, text)| document(file, text)).collect::<Result<Vec<_>, _>>()?;
            match documents.as_slice() {
                [left, right] if is_euroc(left) => (
                    CalibrationFormat::Euroc,
                    StereoCalibration::Raw(euroc::parse([left, right], pictures, &mut warnings)?),
                ),
                _ => return Err(CalibrationError::new(first, "", CalibrationProblem::UnknownFormat)),
            }
        };
        Ok(Self { stereo, format, files: sources.iter().map(|(file, _)| (*file).to_owned()).collect(), warnings })
    }

    /// Reads the calibration that lies beside the pictures of a folder.
    ///
    /// # Errors
    /// As [`Calibration::load`], and when the folder holds none.
    pub fn load_from_folder(folder: &Path, pictures: Option<(u32, u32)>) -> Result<Self, CalibrationError> {
        const SETS: [&[&str]; 2] = [&["calib.txt"], &["mav0/cam0/sensor.yaml", "mav0/cam1/sensor.yaml"]];
        for names in SETS {
            let paths: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
            if paths.first().is_some_and(|path| path.exists()) {
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
    let length = std::fs::metadata(file).map_err(unreadable)?.len();
    if length > MAX_BYTES {
        return Err(error(CalibrationProblem::NotText));
    }
    String::from_utf8(std::fs::read(file).map_err(unreadable)?).map_err(|_| error(CalibrationProblem::NotText))
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

fn is_euroc(document: &Document<'_>) -> bool {
    document.find(&["T_BS", "intrinsics", "sensor_type"]).is_some()
}
