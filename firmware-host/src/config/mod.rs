//! The configuration: what a TOML file and the command line set, over defaults that serve every camera.

mod mistake;
mod rig;

pub use mistake::Mistake;
pub use rig::{RecordingSettings, Rig, RigPair, RigSource, SceneSettings, build_scene};

use std::path::{Path, PathBuf};

use crate::{
    cli::{DetectorArgs, MethodArgs},
    detector,
    error::Failure,
    normalized_cuts::NormalizedCutSettings,
};
use fencepost_core::{
    error::ConfigError,
    geometry::Mount,
    ground::GroundSettings,
    health::HealthSettings,
    map::MapSettings,
    matching::MatchSettings,
    methods::{
        ConfidenceSettings, CostMapSettings, DetectorKind, DisparitySegmentSettings, GroundDeviationSettings,
        PixelNormalSettings,
    },
    obstacles::ObstacleSettings,
    settings::Settings,
    surfaces::SurfaceSettings,
    validate::ValidateSettings,
    wire::{FrameFormat, WireConfig, WireSettings},
};
use mistake::{Reader, Refused};
use serde::Deserialize;

/// Settings of the detector, of the mount and of the bus.
#[derive(Clone, Debug, Default)]
pub struct Config {
    /// Settings of the detector; `matching.disparities` is set by [`Config::settings_for`].
    settings: Settings,
    /// Number of disparities, if somebody chose one.
    disparities: Option<u16>,
    /// Takes the place of the recording's `mount.json`.
    pub mount: Option<Mount>,
    /// The bus.
    pub wire: WireSettings,
    /// The detector `normalized-cuts`.
    pub normalized_cuts: NormalizedCutSettings,
    /// The rig, if the file describes one.
    pub rig: Rig,
    /// The file that it was read from.
    pub file: Option<PathBuf>,
}

/// What stands in a configuration file before its sections.
const CHOICE: [&str; 2] = ["detector", "cross_check"];

/// ... and its sections.
const SECTIONS: [&str; 18] = [
    "matching",
    "validate",
    "surfaces",
    "ground",
    "obstacles",
    "map",
    "health",
    "normalized_cuts",
    "cost_map",
    "ground_deviation",
    "disparity_segments",
    "pixel_normals",
    "confidence",
    "mount",
    "wire",
    "bus",
    "run",
    "pair",
];

/// The detector, and the one that checks it.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Choice {
    detector: DetectorKind,
    cross_check: Option<DetectorKind>,
}

impl Choice {
    /// These detectors, in the default settings.
    fn settings(self) -> Settings {
        Settings { detector: self.detector, cross_check: self.cross_check, ..Settings::default() }
    }
}

impl Config {
    /// Reads the file that the command line names, if it names one, and puts the command line's own settings over it.
    ///
    /// # Errors
    /// A file that cannot be read or holds something that is not a setting.
    pub fn load(args: &DetectorArgs) -> Result<Self, Failure> {
        let mut config = match &args.config {
            Some(path) => Self::read(path)?,
            None => Self::default(),
        };
        config.choose(&args.methods)?;
        config.disparities = args.disparities.or(config.disparities);
        config.wire.node = args.node.unwrap_or(config.wire.node);
        if args.can_fd && config.wire.format == FrameFormat::Classic {
            // Frames of CAN FD hold four times as many cells: as many cells as before fit in fewer frames.
            let WireSettings { base_id, node, .. } = config.wire;
            config.wire = WireSettings { base_id, node, ..WireSettings::FD };
        }
        Ok(config)
    }

    /// Puts the detectors that the command line names over those of the file.
    ///
    /// # Errors
    /// When a detector would check itself.
    pub fn choose(&mut self, methods: &MethodArgs) -> Result<(), Failure> {
        self.settings.detector = methods.detector.unwrap_or(self.settings.detector);
        self.settings.cross_check = methods.cross_check.or(self.settings.cross_check);
        self.settings.check_detectors().map_err(|error| Failure::config(error, self.file.as_deref()))
    }

    /// Reads a configuration file without its rig: a recording can be replayed where there is no camera.
    ///
    /// # Errors
    /// The first mistake of the file, and how many there are besides.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        Self::read_sections(path, false)
    }

    /// Reads a configuration file with its rig.
    ///
    /// # Errors
    /// As [`Config::read`], and when there is no pair of cameras in it.
    pub fn read_rig(path: &Path) -> Result<Self, Failure> {
        let config = Self::read_sections(path, true)?;
        if config.rig.pairs.is_empty() {
            return Err(Failure::usage("the configuration has no pair of cameras")
                .at(path.display().to_string())
                .mend(
                    "add [[pair]] with [pair.camera]; docs/deploy.md shows one, and `fencepost cameras` what is there",
                ));
        }
        Ok(config)
    }

    fn read_sections(path: &Path, with_rig: bool) -> Result<Self, Failure> {
        let (config, mistakes) = Self::read_all(path, with_rig)?;
        let Some(first) = mistakes.first() else { return Ok(config) };
        let place = path.display().to_string();
        let place = first.line.map_or_else(|| place.clone(), |line| format!("{place}, line {line}"));
        let more = match mistakes.len() {
            1 => String::new(),
            count => format!(" (and {} mistakes more: `fencepost check {}` lists all)", count - 1, path.display()),
        };
        let field = if first.field.is_empty() { String::new() } else { format!("{} ", first.field) };
        Err(Failure::usage(format!("the configuration cannot be used: {field}{}", first.problem))
            .at(place)
            .mend(format!("{}{more}", first.mend)))
    }

    /// Reads a configuration file and, `with_rig`, the files that it names, and tells every mistake in it, in the order of its
    /// lines. What is mistaken has its default.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn read_all(path: &Path, with_rig: bool) -> Result<(Self, Vec<Mistake>), Failure> {
        let text = std::fs::read_to_string(path).map_err(|error| {
            Failure::usage(format!("the configuration cannot be read: {error}"))
                .at(path.display().to_string())
                .mend("give the path of a TOML file that you may read: --config FILE")
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let (mut config, mut mistakes) = Self::parse(&text, folder, with_rig);
        config.file = Some(path.to_path_buf());
        mistakes.sort_by_key(|mistake| mistake.line);
        Ok((config, mistakes))
    }

    fn parse(text: &str, folder: &Path, with_rig: bool) -> (Self, Vec<Mistake>) {
        let mut reader = Reader::new(text);
        let root = reader.root();
        reader.only(&root, &[&CHOICE[..], &SECTIONS].concat());
        let checked = |check: Result<(), ConfigError>| check.err().map(Refused::of).into_iter().collect::<Vec<_>>();
        macro_rules! section {
            ($name:literal, $type:ty, $check:expr) => {
                reader
                    .section(&root, $name)
                    .and_then(|section| reader.settings(&section, &[], |settings: &$type| checked(($check)(settings))))
            };
        }
        let choice = root.plain(&CHOICE);
        let choice = reader.settings(&choice, &[], |choice: &Choice| checked(choice.settings().check_detectors()));
        let settings = Settings {
            matching: section!("matching", MatchSettings, MatchSettings::check).unwrap_or_default(),
            validate: section!("validate", ValidateSettings, ValidateSettings::check).unwrap_or_default(),
            surfaces: section!("surfaces", SurfaceSettings, SurfaceSettings::check).unwrap_or_default(),
            ground: section!("ground", GroundSettings, GroundSettings::check).unwrap_or_default(),
            obstacles: section!("obstacles", ObstacleSettings, ObstacleSettings::check).unwrap_or_default(),
            map: section!("map", MapSettings, |map: &MapSettings| map.check(detector::CELLS)).unwrap_or_default(),
            health: section!("health", HealthSettings, HealthSettings::check).unwrap_or_default(),
            cost_map: section!("cost_map", CostMapSettings, CostMapSettings::check).unwrap_or_default(),
            ground_deviation: section!("ground_deviation", GroundDeviationSettings, GroundDeviationSettings::check)
                .unwrap_or_default(),
            disparity_segments: section!(
                "disparity_segments",
                DisparitySegmentSettings,
                DisparitySegmentSettings::check
            )
            .unwrap_or_default(),
            pixel_normals: section!("pixel_normals", PixelNormalSettings, PixelNormalSettings::check)
                .unwrap_or_default(),
            confidence: section!("confidence", ConfidenceSettings, ConfidenceSettings::check).unwrap_or_default(),
            ..choice.unwrap_or_default().settings()
        };
        let mount: Option<Mount> = section!("mount", Mount, Mount::check);
        let wire = section!("wire", WireSettings, |wire: &WireSettings| WireConfig::new(*wire).map(|_| ()))
            .unwrap_or_default();
        let normalized_cuts =
            section!("normalized_cuts", NormalizedCutSettings, NormalizedCutSettings::check).unwrap_or_default();
        let chose_disparities = reader.section(&root, "matching").is_some_and(|section| section.has("disparities"));
        let mut config = Self {
            settings,
            disparities: chose_disparities.then_some(settings.matching.disparities),
            mount,
            wire,
            normalized_cuts,
            rig: Rig::default(),
            file: None,
        };
        if with_rig {
            config.rig = rig::read(&mut reader, &root, folder, (mount, |width| config.settings_for(width)));
        }
        (config, reader.mistakes)
    }

    /// The settings for pictures of `width`: where nobody chose the number of disparities, an eighth of the width.
    pub fn settings_for(&self, width: u32) -> Settings {
        let mut settings = self.settings;
        settings.matching.disparities = self.disparities.unwrap_or_else(|| default_disparities(width));
        settings
    }

    /// Whether somebody chose the number of disparities.
    pub const fn has_disparities(&self) -> bool {
        self.disparities.is_some()
    }
}

/// An eighth of the width, in steps of 16, within 16 to 128: about the disparity of something 2 m away from cameras
/// 12 cm apart that see 60 degrees.
pub fn default_disparities(width: u32) -> u16 {
    let eighth = width.div_ceil(8).next_multiple_of(16).clamp(16, 128);
    u16::try_from(eighth).unwrap_or(128)
}

#[cfg(test)]
mod tests;
