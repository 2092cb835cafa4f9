//! Writes recordings that [`Recording`](super::Recording) and other programs for the two layouts read.

use std::fmt::Write as _;
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use fencepost_core::geometry::{CameraModel, Mount, RawPair, RectifiedPair, StereoCalibration};
use fencepost_core::picture::Picture;

use super::error::RecordingError;
use super::{Layout, mount, picture, picture_size};
use crate::calibration::CalibrationFormat;
use crate::camera::StereoPair;

/// Writes a recording: KITTI's layout for a rectified pair, EuRoC's for a raw one.
///
/// The folder can be read after every call, however the writing ends: a picture appears under its name only when it is
/// whole, and lists never name a picture that is not there.
#[derive(Debug)]
pub struct RecordingWriter {
    folder: PathBuf,
    layout: Layout,
    size: (u32, u32),
    frames: u32,
    last_ns: Option<u64>,
}

impl RecordingWriter {
    /// Makes the folder (and those above it) and writes calibration and mount.
    ///
    /// # Errors
    /// When the folder cannot be written or holds a recording already, or the calibration has a
    /// [`Rectification`](fencepost_core::geometry::Rectification), for which EuRoC's layout has no place: see
    /// [`RecordingWriter::create_with_files`].
    pub fn create(
        folder: impl AsRef<Path>,
        calibration: &StereoCalibration,
        mount: &Mount,
    ) -> Result<Self, RecordingError> {
        let files = match calibration {
            StereoCalibration::Rectified(pair) => vec![("calib.txt".to_owned(), calib_txt(pair).into_bytes())],
            StereoCalibration::Raw(RawPair { rectification: Some(_), .. }) => {
                return Err(RecordingError::Unwritable {
                    folder: folder.as_ref().to_owned(),
                    problem:
                        "sensor.yaml has no place for a chosen rectification; leave it out, or give the files of the \
                              calibration"
                            .to_owned(),
                });
            }
            StereoCalibration::Raw(pair) => {
                let [left, right] = sensor_yaml(pair).map(String::into_bytes);
                vec![("mav0/cam0/sensor.yaml".to_owned(), left), ("mav0/cam1/sensor.yaml".to_owned(), right)]
            }
        };
        Self::begin(folder.as_ref(), calibration, mount, &files)
    }

    /// As [`RecordingWriter::create`], with the files that the calibration was read from, as they are: whoever reads the
    /// recording has exactly this calibration, a rectification that was chosen with it included. Without files the
    /// calibration is written anew.
    ///
    /// # Errors
    /// As [`RecordingWriter::create`], and when a file cannot be read.
    pub fn create_with_files(
        folder: impl AsRef<Path>,
        calibration: &StereoCalibration,
        mount: &Mount,
        files: &[PathBuf],
    ) -> Result<Self, RecordingError> {
        if files.is_empty() {
            return Self::create(folder, calibration, mount);
        }
        let read = |file: &PathBuf| fs::read(file).map_err(|error| RecordingError::io(file, &error));
        let texts = files.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        let sources: Vec<(&Path, String)> = files
            .iter()
            .zip(&texts)
            .map(|(file, text)| (file.as_path(), String::from_utf8_lossy(text).into_owned()))
            .collect();
        let sources: Vec<(&Path, &str)> = sources.iter().map(|(file, text)| (*file, text.as_str())).collect();
        let format = crate::calibration::Calibration::parse(&sources, Some(picture_size(calibration)))?.format;
        let xml = sources.iter().any(|(_, text)| text.trim_start_matches('\u{feff}').trim_start().starts_with('<'));
        let names = file_names(format, files.len(), xml).into_iter().map(str::to_owned);
        Self::begin(folder.as_ref(), calibration, mount, &names.zip(texts).collect::<Vec<_>>())
    }

    fn begin(
        folder: &Path,
        calibration: &StereoCalibration,
        mount: &Mount,
        files: &[(String, Vec<u8>)],
    ) -> Result<Self, RecordingError> {
        let folder = folder.to_owned();
        if ["image_0", "mav0"].iter().any(|name| folder.join(name).exists()) {
            let problem = "holds a recording already; choose another folder, or delete it".to_owned();
            return Err(RecordingError::Unwritable { folder, problem });
        }
        let layout = match calibration {
            StereoCalibration::Rectified(_) => Layout::Kitti,
            StereoCalibration::Raw(_) => Layout::Euroc,
        };
        let pictures = match layout {
            Layout::Kitti => ["image_0", "image_1"],
            Layout::Euroc => ["mav0/cam0/data", "mav0/cam1/data"],
        };
        make_folders(&folder, pictures)?;
        for (name, text) in files {
            write_whole(&folder.join(name), text)?;
        }
        match layout {
            Layout::Kitti => write_whole(&folder.join("times.txt"), b"")?,
            Layout::Euroc => {
                for camera in ["mav0/cam0", "mav0/cam1"] {
                    write_whole(&folder.join(camera).join("data.csv"), b"#timestamp [ns],filename\n")?;
                }
            }
        }
        write_whole(&folder.join("mount.json"), mount::emit(mount).as_bytes())?;
        Ok(Self { folder, layout, size: picture_size(calibration), frames: 0, last_ns: None })
    }

    /// Writes a pair and says its number: frames are numbered from 0 without gaps, whatever the pair's own number.
    ///
    /// # Errors
    /// When the pictures have another size than the calibration, or a picture cannot be written; in EuRoC's layout, where
    /// the time names the picture, also when the time does not rise.
    pub fn write_pair(&mut self, pair: &StereoPair<'_>) -> Result<u32, RecordingError> {
        let frame = self.frames;
        for (side, picture) in [("left", &pair.left), ("right", &pair.right)] {
            let (width, height) = self.size;
            if (picture.width(), picture.height()) != (width as usize, height as usize) {
                let (w, h) = (picture.width(), picture.height());
                return Err(self.unwritable(format!(
                    "the {side} picture of frame {frame} is {w} x {h}, the calibration is for {width} x {height}; both must \
                     be the same"
                )));
            }
        }
        match self.layout {
            Layout::Kitti => {
                // First the time: one too many is passed over by the reader, one too few makes all of them doubtful.
                append(&self.folder.join("times.txt"), &format!("{}\n", seconds(pair.timestamp_ns)))?;
                self.write_picture(&format!("image_1/{frame:06}.png"), &pair.right)?;
                self.write_picture(&format!("image_0/{frame:06}.png"), &pair.left)?;
            }
            Layout::Euroc => {
                let time = pair.timestamp_ns;
                if self.last_ns.is_some_and(|last| time <= last) {
                    return Err(self.unwritable(format!(
                        "the time of frame {frame} ({time} ns) is not after the one before it; give times of a monotonic clock"
                    )));
                }
                self.write_picture(&format!("mav0/cam0/data/{time}.png"), &pair.left)?;
                self.write_picture(&format!("mav0/cam1/data/{time}.png"), &pair.right)?;
                for camera in ["cam1", "cam0"] {
                    append(&self.folder.join(format!("mav0/{camera}/data.csv")), &format!("{time},{time}.png\n"))?;
                }
            }
        }
        self.last_ns = Some(pair.timestamp_ns);
        self.frames += 1;
        Ok(frame)
    }

    /// Writes the true disparity of the left picture of `frame`, row by row, 1/256 px, 0 where it is not known.
    ///
    /// # Errors
    /// When there are not as many values as pixels, or the picture cannot be written.
    pub fn write_disparity(&mut self, frame: u32, disparity: &[u16]) -> Result<(), RecordingError> {
        let (width, height) = self.size;
        if disparity.len() != width as usize * height as usize {
            let found = disparity.len();
            return Err(
                self.unwritable(format!("{found} disparities do not fill {width} x {height} pixels; give all of them"))
            );
        }
        let folder = self.folder.join("disp_occ_0");
        fs::create_dir_all(&folder).map_err(|error| RecordingError::io(&folder, &error))?;
        picture::write_16_bit(&folder.join(format!("{frame:06}.png")), disparity, width, height)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Frames written.
    pub const fn frames(&self) -> u32 {
        self.frames
    }

    fn write_picture(&self, name: &str, picture: &Picture<'_>) -> Result<(), RecordingError> {
        let (width, height) = self.size;
        let pixels: Vec<u8> = (0..picture.height()).flat_map(|y| picture.row(y)).copied().collect();
        picture::write_grey(&self.folder.join(name), &pixels, width, height)
    }

    fn unwritable(&self, problem: String) -> RecordingError {
        RecordingError::Unwritable { folder: self.folder.clone(), problem }
    }
}

fn make_folders(folder: &Path, names: [&str; 2]) -> Result<(), RecordingError> {
    names
        .iter()
        .map(|name| folder.join(name))
        .try_for_each(|path| fs::create_dir_all(&path).map_err(|error| RecordingError::io(&path, &error)))
}

/// Writes a file that appears under its name only when it is whole.
fn write_whole(path: &Path, text: &[u8]) -> Result<(), RecordingError> {
    let part = path.with_extension("part");
    let written = fs::write(&part, text).and_then(|()| fs::rename(&part, path));
    written.map_err(|error| RecordingError::io(path, &error))
}

/// Names under which the files of a calibration are found beside the pictures.
const fn file_names(format: CalibrationFormat, count: usize, xml: bool) -> [&'static str; 2] {
    match (format, count, xml) {
        (CalibrationFormat::Kitti, ..) => ["calib.txt", "calib.txt"],
        (CalibrationFormat::Euroc, ..) => ["mav0/cam0/sensor.yaml", "mav0/cam1/sensor.yaml"],
        (CalibrationFormat::Ros, ..) => ["left.yaml", "right.yaml"],
        (CalibrationFormat::OpenCv, 1, false) => ["calib.yaml", "calib.yaml"],
        (CalibrationFormat::OpenCv, 1, true) => ["calib.xml", "calib.xml"],
        (CalibrationFormat::OpenCv, _, false) => ["intrinsics.yml", "extrinsics.yml"],
        (CalibrationFormat::OpenCv, _, true) => ["intrinsics.xml", "extrinsics.xml"],
    }
}

fn append(path: &Path, text: &str) -> Result<(), RecordingError> {
    let file = OpenOptions::new().append(true).create(true).open(path);
    file.and_then(|mut file| file.write_all(text.as_bytes())).map_err(|error| RecordingError::io(path, &error))
}

fn seconds(timestamp_ns: u64) -> String {
    format!("{}.{:09}", timestamp_ns / 1_000_000_000, timestamp_ns % 1_000_000_000)
}

/// `calib.txt`: projection matrices of the left and the right camera.
///
/// In f64 the product of focal length and baseline is exact, so the numbers are read back as they were. They are plain
/// decimals, here and in `sensor.yaml`: YAML 1.1 takes `1e2` without a sign for a word.
fn calib_txt(pair: &RectifiedPair) -> String {
    let (f, cx, cy) = (f64::from(pair.focal_px), f64::from(pair.cx), f64::from(pair.cy));
    let cameras = [(cx, 0.0), (cx + f64::from(pair.disparity_offset_px), -f * f64::from(pair.baseline_m))];
    let mut text = String::new();
    for (index, (cx, shift)) in cameras.into_iter().enumerate() {
        let _ = writeln!(text, "P{index}: {f} 0 {cx} {shift} 0 {f} {cy} 0 0 0 1 0");
    }
    text
}

/// `sensor.yaml` of the left and the right camera; the body frame is that of the left camera.
fn sensor_yaml(pair: &RawPair) -> [String; 2] {
    let r = pair.rotation.map(|row| row.map(f64::from));
    let t = pair.translation_m.map(f64::from);
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let to_body = std::array::from_fn(|row| std::array::from_fn(|col| r[col][row]));
    let origin = std::array::from_fn(|row| -(0..3).map(|k| r[k][row] * t[k]).sum::<f64>());
    [sensor(&pair.left, identity, [0.0; 3]), sensor(&pair.right, to_body, origin)]
}

fn sensor(camera: &CameraModel, rotation: [[f64; 3]; 3], origin: [f64; 3]) -> String {
    let rows: Vec<String> = rotation.iter().zip(origin).map(|([a, b, c], d)| format!("{a}, {b}, {c}, {d}")).collect();
    let CameraModel { width, height, fx, fy, cx, cy, distortion } = camera;
    let coefficients = distortion.0;
    let used = match coefficients.iter().rposition(|value| *value != 0.0) {
        None | Some(0..=3) => 4,
        Some(4) => 5,
        Some(_) => 8,
    };
    let coefficients: Vec<String> = coefficients.iter().take(used).map(|value| format!("{value}")).collect();
    format!(
        "%YAML:1.0\nsensor_type: camera\ncomment: body frame = left camera\n\n# camera-to-body\nT_BS:\n  cols: 4\n  rows: 4\n  \
         data: [{},\n         0, 0, 0, 1]\n\nresolution: [{width}, {height}]\ncamera_model: pinhole\n\
         intrinsics: [{fx}, {fy}, {cx}, {cy}] # fu, fv, cu, cv\ndistortion_model: radial-tangential\n\
         distortion_coefficients: [{}]\n",
        rows.join(",\n         "),
        coefficients.join(", ")
    )
}
