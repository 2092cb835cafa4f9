//! Every setting that changes the result, with its unit and its reason.

use crate::{
    error::{ConfigError, ConfigProblem},
    ground::GroundSettings,
    health::HealthSettings,
    map::MapSettings,
    matching::MatchSettings,
    methods::{
        ConfidenceSettings, CostMapSettings, DetectorKind, DisparitySegmentSettings, GroundDeviationSettings,
        PixelNormalSettings,
    },
    obstacles::ObstacleSettings,
    surfaces::SurfaceSettings,
    validate::ValidateSettings,
};

/// The settings of all stages. The defaults serve every camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Settings {
    /// The detector.
    pub detector: DetectorKind,
    /// A second detector that looks at the same disparities; where it disagrees, the confidence in a cell is lowered.
    pub cross_check: Option<DetectorKind>,
    /// Stereo matching.
    pub matching: MatchSettings,
    /// Validation by surface size.
    pub validate: ValidateSettings,
    /// Surfaces and their classes.
    pub surfaces: SurfaceSettings,
    /// Ground plane.
    pub ground: GroundSettings,
    /// Obstacles.
    pub obstacles: ObstacleSettings,
    /// Cells.
    pub map: MapSettings,
    /// Health.
    pub health: HealthSettings,
    /// The detector `cost-map`.
    pub cost_map: CostMapSettings,
    /// The detector `ground-deviation`.
    pub ground_deviation: GroundDeviationSettings,
    /// The detector `disparity-segments`.
    pub disparity_segments: DisparitySegmentSettings,
    /// The detector `pixel-normals`.
    pub pixel_normals: PixelNormalSettings,
    /// What the cross-check takes from the confidence in a cell.
    pub confidence: ConfidenceSettings,
}

impl Settings {
    /// Checks which detectors go together.
    ///
    /// # Errors
    /// `cross_check` if it is the detector itself, which would agree with itself always.
    pub fn check_detectors(&self) -> Result<(), ConfigError> {
        match self.cross_check {
            Some(other) if other == self.detector => Err(ConfigError::new("cross_check", ConfigProblem::SameDetector)),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_detector_checks_itself() {
        for detector in DetectorKind::ALL {
            assert_eq!(Settings { detector, cross_check: None, ..Settings::default() }.check_detectors(), Ok(()));
            for other in DetectorKind::ALL {
                let settings = Settings { detector, cross_check: Some(other), ..Settings::default() };
                let error = ConfigError::new("cross_check", ConfigProblem::SameDetector);
                assert_eq!(settings.check_detectors(), if other == detector { Err(error) } else { Ok(()) });
            }
        }
    }
}
