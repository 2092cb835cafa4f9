//! Where the pictures come from: a recording or the scene renderer.

use std::{ops::Range, path::Path, sync::Arc};

use fencepost_core::geometry::{Mount, StereoCalibration};
use fencepost_hal::{
    calibration::CalibrationError,
    camera::Camera,
    recording::{RecordedCamera, Recording, RecordingError},
};

use crate::{error::Failure, score::RecordedTruth};

/// A camera that ends, and knows what comes next.
pub trait Source: Camera<Error: Into<Failure>> {
    /// Number and time of the frame that comes next.
    fn upcoming(&self) -> Option<(u32, u64)>;

    /// What was odd about the pictures since the last call.
    fn take_warnings(&mut self) -> Vec<String> {
        Vec::new()
    }
}

impl Source for RecordedCamera {
    fn upcoming(&self) -> Option<(u32, u64)> {
        self.upcoming().map(|frame| (frame.number, frame.timestamp_ns))
    }

    fn take_warnings(&mut self) -> Vec<String> {
        self.take_warnings().iter().map(ToString::to_string).collect()
    }
}

/// A source and everything that is known of it before the first picture.
#[derive(Debug)]
pub struct Input<S> {
    /// The pictures.
    pub source: S,
    /// What it is called.
    pub name: String,
    /// Where it comes from, in words.
    pub description: String,
    /// The pair of cameras.
    pub calibration: StereoCalibration,
    /// How the left camera sits on the vehicle.
    pub mount: Mount,
    /// Number of frames that will come.
    pub frames: usize,
    /// What is really there, where the source knows it.
    pub truth: Option<Arc<RecordedTruth>>,
    /// What is odd about it.
    pub warnings: Vec<String>,
}

impl<S> Input<S> {
    /// Width and height of the raw pictures, px.
    pub const fn picture_size(&self) -> (u32, u32) {
        match &self.calibration {
            StereoCalibration::Rectified(pair) => (pair.width, pair.height),
            StereoCalibration::Raw(pair) => (pair.left.width, pair.left.height),
        }
    }
}

impl Input<RecordedCamera> {
    /// Opens the frames of a recording whose numbers lie in `frames`.
    ///
    /// # Errors
    /// When it is not a recording, or holds no such frame.
    pub fn recording(folder: &Path, frames: &Range<u32>) -> Result<Self, Failure> {
        let mut recording = Recording::open(folder)?;
        let numbers = recording.frames.first().map(|f| f.number).zip(recording.frames.last().map(|f| f.number));
        recording.frames.retain(|frame| frames.contains(&frame.number));
        if recording.frames.is_empty() {
            let (first, last) = numbers.unwrap_or_default();
            return Err(Failure::usage("the recording has no frame with such a number")
                .at(format!("--frames {}..{}", frames.start, frames.end))
                .mend(format!("choose from {first} to {last}")));
        }
        let (truth, complaint) = RecordedTruth::of(&recording);
        // The same folder may be written as `.` or with a slash at its end.
        let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
        let name = whole.file_name().map_or_else(|| folder.display().to_string(), |n| n.to_string_lossy().into_owned());
        Ok(Self {
            name,
            description: format!("{} in the layout of {}", folder.display(), recording.layout.name()),
            calibration: recording.calibration.stereo,
            mount: recording.mount,
            frames: recording.frames.len(),
            truth: truth.map(Arc::new),
            warnings: recording.warnings.iter().map(ToString::to_string).chain(complaint).collect(),
            source: recording.into_camera(),
        })
    }
}

impl From<RecordingError> for Failure {
    fn from(error: RecordingError) -> Self {
        let (subject, place) = match &error {
            RecordingError::NotAFolder(path) | RecordingError::UnknownLayout(path) | RecordingError::NoFrames(path) => {
                ("the recording".to_string(), path.display().to_string())
            }
            RecordingError::Io { path, .. } => ("the file".to_string(), path.display().to_string()),
            RecordingError::MissingPicture { path, .. }
            | RecordingError::BadPicture { path, .. }
            | RecordingError::SizesDiffer { path, .. }
            | RecordingError::SizeDiffersFromCalibration { path, .. } => {
                ("the picture".to_string(), path.display().to_string())
            }
            RecordingError::Mount { file, field, .. } => subject_and_place(file, field),
            RecordingError::Line { file, line, .. } => {
                ("the line".to_string(), format!("{}: line {line}", file.display()))
            }
            RecordingError::BadTruth { path, .. } => ("the truth".to_string(), path.display().to_string()),
            RecordingError::Unwritable { folder, .. } => ("the folder".to_string(), folder.display().to_string()),
            RecordingError::Calibration(error) => return error.clone().into(),
        };
        from_sentence(&error.to_string(), &subject, place)
    }
}

impl From<CalibrationError> for Failure {
    fn from(error: CalibrationError) -> Self {
        let (subject, place) = subject_and_place(&error.file, &error.field);
        from_sentence(&error.to_string(), &subject, place)
    }
}

fn subject_and_place(file: &Path, field: &str) -> (String, String) {
    match field {
        "" => ("the file".to_string(), file.display().to_string()),
        field => (field.to_string(), format!("{}: {field}", file.display())),
    }
}

/// Errors of the hardware layer are one sentence, `place: what; mend`, where `what` may go on from the place ("is missing").
fn from_sentence(sentence: &str, subject: &str, place: String) -> Failure {
    const VERBS: [&str; 5] = ["is ", "has ", "holds ", "must ", "cannot "];
    let rest = sentence.replacen(&format!("{place}: "), "", 1);
    let (what, mend) = rest.split_once("; ").map_or((rest.as_str(), None), |(what, mend)| (what, Some(mend)));
    let (frame, what) = match what.split_once(": ") {
        Some((frame, what)) if frame.starts_with("frame ") => (format!("{frame}: "), what),
        _ => (String::new(), what),
    };
    let subject = if VERBS.iter().any(|verb| what.starts_with(verb)) { format!("{subject} ") } else { String::new() };
    let failure = Failure::work(format!("{frame}{subject}{what}")).at(place);
    match mend {
        Some(mend) => failure.mend(mend),
        None => failure,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_come_apart() {
        let missing = RecordingError::MissingPicture { frame: 3, path: "r/image_1/000003.png".into() };
        let failure = Failure::from(missing);
        assert_eq!(failure.what, "frame 3: the picture is missing");
        assert_eq!(failure.place.as_deref(), Some("r/image_1/000003.png"));
        assert_eq!(failure.mend.as_deref(), Some("copy it again from where it was recorded"));

        let mount = RecordingError::Mount {
            file: "r/mount.json".into(),
            field: "height_m".into(),
            problem: "is not a number".into(),
            mend: "give metres".into(),
        };
        let failure = Failure::from(mount);
        assert_eq!(failure.place.as_deref(), Some("r/mount.json: height_m"));
        assert_eq!((failure.what.as_str(), failure.mend.as_deref()), ("height_m is not a number", Some("give metres")));
    }
}
