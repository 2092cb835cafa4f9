//! The configuration: what a TOML file and the command line set, over defaults that serve every camera.

use std::path::{Path, PathBuf};

use fencepost_core::{
    geometry::Mount,
    ground::GroundSettings,
    health::HealthSettings,
    map::MapSettings,
    matching::MatchSettings,
    obstacles::ObstacleSettings,
    settings::Settings,
    surfaces::SurfaceSettings,
    validate::ValidateSettings,
    wire::{FrameFormat, WireSettings},
};
use serde::Deserialize;

use crate::{cli::DetectorArgs, error::Failure};

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
    /// The file that it was read from.
    pub file: Option<PathBuf>,
}

/// The sections of a configuration file.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Sections {
    matching: MatchSettings,
    validate: ValidateSettings,
    surfaces: SurfaceSettings,
    ground: GroundSettings,
    obstacles: ObstacleSettings,
    map: MapSettings,
    health: HealthSettings,
    mount: Option<Mount>,
    wire: WireSettings,
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
        config.disparities = args.disparities.or(config.disparities);
        config.wire.node = args.node.unwrap_or(config.wire.node);
        if args.can_fd && config.wire.format == FrameFormat::Classic {
            // Frames of CAN FD hold four times as many cells: as many cells as before fit in fewer frames.
            let WireSettings { base_id, node, .. } = config.wire;
            config.wire = WireSettings { base_id, node, ..WireSettings::FD };
        }
        Ok(config)
    }

    /// Reads a configuration file.
    ///
    /// # Errors
    /// As [`Config::load`].
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let place = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| {
            Failure::usage(format!("the configuration cannot be read: {error}"))
                .at(&place)
                .mend("give the path of a TOML file that you may read: --config FILE")
        })?;
        let wrong = |error: toml::de::Error| {
            let line = error.span().map(|span| 1 + text.bytes().take(span.start).filter(|b| *b == b'\n').count());
            let place = line.map_or_else(|| place.clone(), |line| format!("{place}, line {line}"));
            Failure::usage(format!("the configuration does not say what a setting is: {}", error.message().trim()))
                .at(place)
                .mend("compare it with the list of settings in docs/files.md")
        };
        let table: toml::Table = text.parse().map_err(wrong)?;
        let chose_disparities = table.get("matching").and_then(|section| section.get("disparities")).is_some();
        let Sections { matching, validate, surfaces, ground, obstacles, map, health, mount, wire } =
            toml::from_str(&text).map_err(wrong)?;
        Ok(Self {
            settings: Settings { matching, validate, surfaces, ground, obstacles, map, health },
            disparities: chose_disparities.then_some(matching.disparities),
            mount,
            wire,
            file: Some(path.to_path_buf()),
        })
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
mod tests {
    use std::io::Write;

    use super::*;

    fn read(text: &str) -> Result<Config, Failure> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        Config::read(file.path())
    }

    #[test]
    fn disparities_follow_the_width_unless_chosen() {
        assert_eq!([128, 640, 752, 1242, 2048].map(default_disparities), [16, 80, 96, 128, 128]);
        assert_eq!(read("").unwrap().settings_for(640).matching.disparities, 80);
        assert_eq!(read("[matching]\nwindow = 9\n").unwrap().settings_for(640).matching.disparities, 80);
        let chosen = read("[matching]\ndisparities = 64\n").unwrap();
        assert_eq!(chosen.settings_for(640).matching.disparities, 64);
    }

    #[test]
    fn what_is_not_set_keeps_its_default() {
        let config = read("[surfaces]\nhorizontal_deg = 25.0\n[wire]\nnode = 3\n").unwrap();
        let settings = config.settings_for(512);
        assert_eq!(settings.surfaces.horizontal_deg, 25.0);
        assert_eq!(settings.surfaces.min_pixels, SurfaceSettings::default().min_pixels);
        assert_eq!(config.wire, WireSettings { node: 3, ..WireSettings::CLASSIC });
    }

    #[test]
    fn every_setting_is_documented_with_its_default() {
        let documented = include_str!("../../docs/files.md");
        let text = toml::to_string(&Settings::default()).unwrap();
        let mut section = String::new();
        for line in text.lines().filter(|line| !line.is_empty()) {
            if let Some(name) = line.strip_prefix('[') {
                section = name.trim_end_matches(']').to_string();
                continue;
            }
            let (name, value) = line.split_once(" = ").unwrap();
            let name = format!("`{section}.{name}`");
            let row = documented.lines().find(|row| row.contains(&name));
            let row = row.unwrap_or_else(|| panic!("{name} is not in docs/files.md"));
            let value = value.trim_end_matches(".0");
            // The number of disparities follows the width of the pictures.
            assert!(
                row.contains(value) || name.contains(".disparities"),
                "{name} is {value}, but docs/files.md says: {row}"
            );
        }
        for name in ["base_id", "node", "format", "max_cell_frames"] {
            assert!(documented.contains(&format!("`wire.{name}`")));
        }
    }

    #[test]
    fn mistakes_name_the_line() {
        let unknown = read("[matching]\nwindow = 7\nwindov = 9\n").unwrap_err();
        assert_eq!(unknown.kind.exit_status(), 2);
        assert!(unknown.place.as_ref().is_some_and(|p| p.ends_with("line 3")), "{unknown}");
        assert!(unknown.what.contains("windov"), "{unknown}");
        for text in ["[matching]\nwindow = \"wide\"\n", "[matching\n", "[nonsense]\n", "a = [\n", "\u{0}"] {
            assert_eq!(read(text).unwrap_err().kind.exit_status(), 2, "{text}");
        }
    }
}
