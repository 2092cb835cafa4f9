//! Which detector looks at the disparity picture.

/// The detectors: the paper's final method and those that came before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[repr(u8)]
pub enum DetectorKind {
    /// Surfaces inside tiles, a plane through each, told apart by its normal. The paper, section 4.4.
    #[default]
    SurfaceNormals = 0,
    /// Points counted in columns above a ground plane that flat columns give. The paper, section 4.1.
    CostMap = 1,
    /// Deviations from the disparity that the ground plane would have. The paper, section 2.3.
    GroundDeviation = 2,
    /// Contiguous segments of the disparity picture, judged by size and height. The paper, section 4.3.
    DisparitySegments = 3,
    /// A plane around every pixel, segments by normal: Murray's way. The paper, sections 2.3 and 4.3.
    PixelNormals = 4,
}

impl DetectorKind {
    /// Every detector.
    pub const ALL: [Self; 5] =
        [Self::SurfaceNormals, Self::CostMap, Self::GroundDeviation, Self::DisparitySegments, Self::PixelNormals];

    /// Name as it is written in settings and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::SurfaceNormals => "surface-normals",
            Self::CostMap => "cost-map",
            Self::GroundDeviation => "ground-deviation",
            Self::DisparitySegments => "disparity-segments",
            Self::PixelNormals => "pixel-normals",
        }
    }

    /// The detector of that name.
    ///
    /// # Bound
    /// The number of detectors.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// The detector of a frame, and the one that checks it, if any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Detectors {
    main: DetectorKind,
    /// The main one itself where nobody checks: an `Option` would not be zero when it is empty, and a detector that is not
    /// configured is.
    check: DetectorKind,
}

impl Detectors {
    /// The default detector, which nobody checks.
    pub const DEFAULT: Self = Self { main: DetectorKind::SurfaceNormals, check: DetectorKind::SurfaceNormals };

    /// `main`, checked by another one.
    pub fn new(main: DetectorKind, check: Option<DetectorKind>) -> Self {
        Self { main, check: check.unwrap_or(main) }
    }

    /// The detector that says what is where.
    pub const fn main(self) -> DetectorKind {
        self.main
    }

    /// The detector that checks it.
    pub fn cross_check(self) -> Option<DetectorKind> {
        Some(self.check).filter(|check| *check != self.main)
    }
}

#[cfg(test)]
mod tests {
    use std::{format, string::String};

    use super::*;

    #[test]
    fn detectors_are_found_by_the_names_that_they_have_in_the_code() {
        for kind in DetectorKind::ALL {
            let mut name = String::new();
            for letter in format!("{kind:?}").chars() {
                if letter.is_uppercase() && !name.is_empty() {
                    name.push('-');
                }
                name.extend(letter.to_lowercase());
            }
            assert_eq!((kind.name(), DetectorKind::from_name(&name)), (name.as_str(), Some(kind)));
        }
        for other in ["", "surface", "Cost-Map", "xyzzy"] {
            assert_eq!(DetectorKind::from_name(other), None);
        }
    }

    #[test]
    fn a_detector_that_is_to_check_itself_checks_nothing() {
        assert_eq!(Detectors::DEFAULT, Detectors::new(DetectorKind::default(), None));
        for main in DetectorKind::ALL {
            assert_eq!(Detectors::new(main, None).cross_check(), None);
            for check in DetectorKind::ALL {
                let both = Detectors::new(main, Some(check));
                assert_eq!((both.main(), both.cross_check()), (main, (check != main).then_some(check)));
            }
        }
    }
}
