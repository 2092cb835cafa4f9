//! Every setting that changes the result, with its unit and its reason.

use crate::{
    ground::GroundSettings, health::HealthSettings, map::MapSettings, matching::MatchSettings,
    obstacles::ObstacleSettings, surfaces::SurfaceSettings, validate::ValidateSettings,
};

/// The settings of all stages. The defaults serve every camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Settings {
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
}
