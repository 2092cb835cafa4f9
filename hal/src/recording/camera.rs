//! A recording played as a camera.

use std::path::Path;

use fencepost_core::geometry::StereoCalibration;
use fencepost_core::picture::Picture;

use super::error::{RecordingError, RecordingWarning};
use super::picture::{self, Converted, GreyPicture};
use super::{RecordedFrame, Recording, picture_size};
use crate::camera::{Camera, CameraError, CameraErrorKind, StereoPair};

/// Delivers the pairs of a recording one after another.
///
/// A frame that cannot be read is an error once; the next call goes on with the frame after it.
#[derive(Clone, Debug)]
pub struct RecordedCamera {
    recording: Recording,
    next: usize,
    converted: Converted,
    warnings: Vec<RecordingWarning>,
}

impl RecordedCamera {
    /// A camera that stands before the first frame of `recording`.
    pub const fn new(recording: Recording) -> Self {
        let converted = Converted { colour: false, sixteen_bit: false };
        Self { recording, next: 0, converted, warnings: Vec::new() }
    }

    /// The recording it plays.
    pub const fn recording(&self) -> &Recording {
        &self.recording
    }

    /// The frame that the next call delivers.
    pub fn upcoming(&self) -> Option<&RecordedFrame> {
        self.recording.frames.get(self.next)
    }

    /// Goes to frame `index` of the recording's list; behind the last one no further pair comes.
    pub const fn seek(&mut self, index: usize) {
        self.next = index;
    }

    /// What was odd about the pictures since the last call, each thing once for a recording.
    pub fn take_warnings(&mut self) -> Vec<RecordingWarning> {
        std::mem::take(&mut self.warnings)
    }

    /// Gives the recording back.
    pub fn into_inner(self) -> Recording {
        self.recording
    }

    fn decode(&mut self, frame: u32, path: &Path) -> Result<GreyPicture, RecordingError> {
        let (picture, converted) = picture::decode(frame, path)?;
        if converted.colour && !std::mem::replace(&mut self.converted.colour, true) {
            self.warnings.push(RecordingWarning::Colour(path.to_owned()));
        }
        if converted.sixteen_bit && !std::mem::replace(&mut self.converted.sixteen_bit, true) {
            self.warnings.push(RecordingWarning::SixteenBit(path.to_owned()));
        }
        Ok(picture)
    }
}

/// A pair that cannot be read is one pair.
impl CameraError for RecordingError {
    fn kind(&self) -> CameraErrorKind {
        CameraErrorKind::Damaged
    }
}

impl Camera for RecordedCamera {
    type Error = RecordingError;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error> {
        let Some(RecordedFrame { number: frame, timestamp_ns, left: left_path, right: right_path, .. }) =
            self.upcoming().cloned()
        else {
            return Ok(None);
        };
        self.next += 1;
        let left = self.decode(frame, &left_path)?;
        let right = self.decode(frame, &right_path)?;
        check_sizes(frame, [(&left_path, &left), (&right_path, &right)], &self.recording.calibration.stereo)?;
        let left = view(frame, &left_path, &left)?;
        let right = view(frame, &right_path, &right)?;
        Ok(Some(consume(&StereoPair { left, right, timestamp_ns, skew_ns: 0, sequence: frame, missed: 0 })))
    }

    fn take_warning(&mut self) -> Option<String> {
        (!self.warnings.is_empty()).then(|| self.warnings.remove(0).to_string())
    }
}

impl GreyPicture {
    /// The picture as the core sees it.
    ///
    /// # Errors
    /// Where there are no pixels, or fewer than width and height say.
    pub fn view(&self) -> Result<Picture<'_>, fencepost_core::picture::PictureError> {
        Picture::packed(&self.pixels, self.width as usize, self.height as usize)
    }
}

fn view<'a>(frame: u32, path: &Path, grey: &'a GreyPicture) -> Result<Picture<'a>, RecordingError> {
    grey.view().map_err(|e| RecordingError::BadPicture { frame, path: path.to_owned(), reason: e.to_string() })
}

fn check_sizes(
    frame: u32,
    [(left_path, left), (right_path, right)]: [(&Path, &GreyPicture); 2],
    calibration: &StereoCalibration,
) -> Result<(), RecordingError> {
    let (left, right) = ((left.width, left.height), (right.width, right.height));
    if left != right {
        return Err(RecordingError::SizesDiffer { frame, path: right_path.to_owned(), left, right });
    }
    let calibration = picture_size(calibration);
    if left != calibration {
        let path = left_path.to_owned();
        return Err(RecordingError::SizeDiffersFromCalibration { frame, path, picture: left, calibration });
    }
    Ok(())
}
