//! The detectors that can be compared.

use std::{fmt, str::FromStr};

use fencepost_core::{
    methods::{CostMap, DetectorKind, DisparitySegments, GroundDeviation, PixelNormals},
    settings::Settings,
};

use crate::{
    normalized_cuts::{self, NormalizedCutSettings},
    words,
};

/// A detector, in the core or outside of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// One of the core's.
    Core(DetectorKind),
    /// The reference segmentation, in the program.
    NormalizedCuts,
}

impl Method {
    /// Every detector, in the order of the report.
    pub const ALL: [Self; 6] = [
        Self::Core(DetectorKind::SurfaceNormals),
        Self::Core(DetectorKind::CostMap),
        Self::Core(DetectorKind::GroundDeviation),
        Self::Core(DetectorKind::DisparitySegments),
        Self::Core(DetectorKind::PixelNormals),
        Self::NormalizedCuts,
    ];

    /// Name on the command line, in files and of the folder that it writes to.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Core(kind) => kind.name(),
            Self::NormalizedCuts => normalized_cuts::NAME,
        }
    }

    /// How it works, in words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Core(kind) => words::detector_words(kind),
            Self::NormalizedCuts => {
                "segments of the whole picture at once, told apart by their normals; for comparison only"
            }
        }
    }

    /// The settings for it, made of those for all. A detector does not check itself.
    #[must_use]
    pub fn settings(self, common: Settings) -> Settings {
        let Self::Core(detector) = self else {
            // It starts from the same disparities, and nobody checks it.
            return Settings { detector: DetectorKind::SurfaceNormals, cross_check: None, ..common };
        };
        Settings { detector, cross_check: common.cross_check.filter(|other| *other != detector), ..common }
    }

    /// State that it alone has in the core's detector, bytes, for pictures of this `width`; all share the rest. `None` for one that
    /// takes what it needs from the heap.
    pub const fn own_bytes(self, width: u32) -> Option<usize> {
        const COLUMNS: usize = 1024;
        const PER_COLUMN: usize = (size_of::<PixelNormals<COLUMNS>>() - size_of::<PixelNormals<0>>()) / COLUMNS;
        Some(match self {
            Self::Core(DetectorKind::SurfaceNormals) => 0,
            Self::Core(DetectorKind::CostMap) => size_of::<CostMap>(),
            Self::Core(DetectorKind::GroundDeviation) => size_of::<GroundDeviation>(),
            Self::Core(DetectorKind::DisparitySegments) => size_of::<DisparitySegments>(),
            Self::Core(DetectorKind::PixelNormals) => size_of::<PixelNormals<0>>() + PER_COLUMN * width as usize,
            Self::NormalizedCuts => return None,
        })
    }

    /// Settings of what has the last word about a frame, where that is not the core.
    pub fn normalized_cuts(self) -> Option<NormalizedCutSettings> {
        (self == Self::NormalizedCuts).then(NormalizedCutSettings::default)
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
    fn every_detector_of_the_core_can_be_compared() {
        for kind in DetectorKind::ALL {
            assert!(Method::ALL.contains(&Method::Core(kind)), "{}", kind.name());
        }
    }

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

    #[test]
    fn a_detector_with_a_state_of_its_own_says_how_large_it_is() {
        assert_eq!(Method::Core(DetectorKind::PixelNormals).own_bytes(640), Some(size_of::<PixelNormals<640>>()));
        assert_eq!(Method::Core(DetectorKind::SurfaceNormals).own_bytes(640), Some(0));
    }

    #[test]
    fn a_detector_is_checked_by_another_one_only() {
        let common = Settings { cross_check: Some(DetectorKind::CostMap), ..Settings::default() };
        for method in Method::ALL {
            let settings = method.settings(common);
            assert_eq!(settings.check_detectors(), Ok(()), "{method}");
            let unchecked = [Method::Core(DetectorKind::CostMap), Method::NormalizedCuts].contains(&method);
            assert_eq!(settings.cross_check.is_none(), unchecked, "{method}");
        }
    }
}
