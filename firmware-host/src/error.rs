//! What the program says when it cannot go on: what is wrong, where, and the mend.

use std::{fmt, io, path::Path, process::ExitCode};

use fencepost_core::error::{ConfigError, ConfigProblem};

/// Whose turn it is to act; decides the exit status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureKind {
    /// The input is bad or the work failed: exit status 1.
    Work,
    /// The program was called wrongly, or its configuration cannot be used: exit status 2.
    Usage,
}

impl FailureKind {
    /// Exit status of the program.
    pub const fn exit_status(self) -> u8 {
        match self {
            Self::Work => 1,
            Self::Usage => 2,
        }
    }
}

/// One thing that went wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// Decides the exit status.
    pub kind: FailureKind,
    /// What is wrong, in a sentence.
    pub what: String,
    /// File and field.
    pub place: Option<String>,
    /// What to do about it.
    pub mend: Option<String>,
}

impl Failure {
    /// Bad input or failed work.
    pub fn work(what: impl Into<String>) -> Self {
        Self { kind: FailureKind::Work, what: what.into(), place: None, mend: None }
    }

    /// Wrong usage or configuration.
    pub fn usage(what: impl Into<String>) -> Self {
        Self { kind: FailureKind::Usage, what: what.into(), place: None, mend: None }
    }

    /// Says where.
    #[must_use]
    pub fn at(mut self, place: impl Into<String>) -> Self {
        self.place = Some(place.into());
        self
    }

    /// Says what to do.
    #[must_use]
    pub fn mend(mut self, mend: impl Into<String>) -> Self {
        self.mend = Some(mend.into());
        self
    }

    /// A file or folder that cannot be written.
    pub fn cannot_write(path: &Path, error: &io::Error) -> Self {
        let mend = match error.kind() {
            io::ErrorKind::PermissionDenied => "choose a folder that you may write to: --out DIR",
            io::ErrorKind::StorageFull => "make room on the disk, or choose another folder: --out DIR",
            io::ErrorKind::AlreadyExists | io::ErrorKind::NotADirectory => {
                "a file stands where a folder is needed: remove it, or choose another folder: --out DIR"
            }
            _ => "choose another folder: --out DIR",
        };
        Self::work(format!("cannot write: {error}")).at(path.display().to_string()).mend(mend)
    }

    /// Settings that the detector does not take. `file` is the configuration file, if there is one.
    pub fn config(error: ConfigError, file: Option<&Path>) -> Self {
        let ConfigError { field, problem } = error;
        let from_input = field.starts_with("calibration.") || field.starts_with("mount.");
        let failure = if from_input {
            Self::work(format!("{field} {problem}"))
        } else {
            Self::usage(format!("{field} {problem}"))
        };
        let place = file.map_or_else(|| field.to_string(), |file| format!("{}, {field}", file.display()));
        failure.at(place).mend(match problem {
            ConfigProblem::Exchanged => "exchange the left and the right camera in the calibration".to_string(),
            ConfigProblem::OverCapacity { .. } if from_input => {
                format!("give pictures of at most {}", crate::detector::capacity_in_words())
            }
            ConfigProblem::OverCapacity { capacity, .. } => format!("set {field} to {capacity} or less"),
            ConfigProblem::OutOfRange { min, max } if !from_input => {
                format!("set {field} to {min} or more, {max} at most")
            }
            ConfigProblem::SameDetector => format!("name another detector, or leave {field} out"),
            _ if from_input => "calibrate again, or correct the value by hand".to_string(),
            _ => format!("correct {field} in the configuration"),
        })
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.what)?;
        if let Some(place) = &self.place {
            write!(f, "\n  where: {place}")?;
        }
        if let Some(mend) = &self.mend {
            write!(f, "\n  mend:  {mend}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Failure {}

impl From<FailureKind> for ExitCode {
    fn from(kind: FailureKind) -> Self {
        Self::from(kind.exit_status())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn says_what_where_and_the_mend() {
        let failure = Failure::work("the picture is cut off").at("image_0/000003.png").mend("record it again");
        assert_eq!(
            failure.to_string(),
            "the picture is cut off\n  where: image_0/000003.png\n  mend:  record it again"
        );
    }

    #[test]
    fn settings_are_usage_and_calibrations_are_input() {
        let out_of_range = ConfigProblem::OutOfRange { min: 5.0, max: 21.0 };
        let settings = Failure::config(ConfigError::new("matching.window_width", out_of_range), None);
        assert_eq!(settings.kind.exit_status(), 2);
        assert!(settings.to_string().contains("set matching.window_width to 5 or more, 21 at most"));
        let calibration = Failure::config(ConfigError::new("calibration.baseline_m", ConfigProblem::Exchanged), None);
        assert_eq!(calibration.kind.exit_status(), 1);
    }
}
