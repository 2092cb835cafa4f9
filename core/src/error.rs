//! What a stage says when it is given settings or pictures that it cannot work with.

/// A setting that cannot be used: which one, and what is wrong with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConfigError {
    /// Path of the setting as it is written in a configuration file, `matching.window`.
    pub field: &'static str,
    /// What is wrong with the value.
    pub problem: ConfigProblem,
}

/// What is wrong with the value of a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConfigProblem {
    /// Not a finite number.
    NotFinite,
    /// Outside the closed interval given, in the unit of the setting.
    OutOfRange {
        /// Smallest value allowed.
        min: f32,
        /// Largest value allowed.
        max: f32,
    },
    /// An odd number is needed.
    NotOdd,
    /// A whole multiple of another number is needed.
    NotAMultiple {
        /// The number that it must be a multiple of.
        of: u32,
    },
    /// More than this build of the detector has room for.
    OverCapacity {
        /// What was asked for.
        needed: usize,
        /// What there is room for.
        capacity: usize,
    },
    /// A rotation matrix whose rows are not orthonormal.
    NotARotation,
    /// Left and right are exchanged: the right camera lies to the left of the left one.
    Exchanged,
    /// A detector cannot be checked against itself.
    SameDetector,
}

impl ConfigError {
    /// An error for `field`.
    pub const fn new(field: &'static str, problem: ConfigProblem) -> Self {
        Self { field, problem }
    }

    /// Checks that `value` is finite and within `min..=max`.
    ///
    /// # Errors
    /// [`ConfigProblem::NotFinite`] or [`ConfigProblem::OutOfRange`].
    pub fn check(field: &'static str, value: f32, min: f32, max: f32) -> Result<(), Self> {
        if !value.is_finite() {
            return Err(Self::new(field, ConfigProblem::NotFinite));
        }
        if value < min || value > max {
            return Err(Self::new(field, ConfigProblem::OutOfRange { min, max }));
        }
        Ok(())
    }
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}: {}", self.field, self.problem)
    }
}

impl core::fmt::Display for ConfigProblem {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotFinite => write!(f, "is not a finite number"),
            Self::OutOfRange { min, max } => write!(f, "must lie within {min} to {max}"),
            Self::NotOdd => write!(f, "must be odd"),
            Self::NotAMultiple { of } => write!(f, "must be a multiple of {of}"),
            Self::OverCapacity { needed, capacity } => {
                write!(f, "needs {needed}, but this build has room for {capacity}")
            }
            Self::NotARotation => write!(f, "is not a rotation matrix"),
            Self::Exchanged => {
                write!(f, "puts the right camera to the left of the left one: exchange the two")
            }
            Self::SameDetector => write!(f, "is the detector itself: choose another one"),
        }
    }
}

impl core::error::Error for ConfigError {}

#[cfg(test)]
#[path = "error_tests.rs"]
mod tests;
