//! The detectors that can be compared.

use std::{fmt, str::FromStr};

use fencepost_core::settings::Settings;

use crate::reference::Reference;

/// A detector, in the core or outside of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The paper's final method.
    SurfaceNormals,
}

impl Method {
    /// Every detector, in the order of the report.
    pub const ALL: [Self; 1] = [Self::SurfaceNormals];

    /// Name on the command line, in files and of the folder that it writes to.
    pub const fn name(self) -> &'static str {
        match self {
            Self::SurfaceNormals => "surface-normals",
        }
    }

    /// How it works, in a sentence.
    pub const fn words(self) -> &'static str {
        match self {
            Self::SurfaceNormals => {
                "A plane for each surface inside tiles of 32 × 32 pixels; its normal tells ground from obstacle."
            }
        }
    }

    /// The settings for it, made of those for all.
    #[must_use]
    pub const fn settings(self, common: Settings) -> Settings {
        common
    }

    /// What looks at the frames, where that is not the core.
    pub const fn reference(self) -> Option<&'static dyn Reference> {
        None
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|method| method.name() == text)
            .ok_or_else(|| format!("the detectors are {}", known()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_detector_has_a_name_of_its_own() {
        for (k, method) in Method::ALL.into_iter().enumerate() {
            assert_eq!(method.name().parse(), Ok(method));
            assert!(method.name().bytes().all(|b| b.is_ascii_lowercase() || b == b'-'), "{method}");
            assert!(Method::ALL.iter().skip(k + 1).all(|other| other.name() != method.name()));
        }
        let error = "surfaces".parse::<Method>().unwrap_err();
        assert!(error.contains("surface-normals"), "{error}");
    }
}
