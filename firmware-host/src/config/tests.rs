//! Tests of the configuration.

use std::{collections::BTreeSet, io::Write};

use super::*;
use crate::live::{BusSettings, RunSettings};

fn read(text: &str) -> Result<Config, Failure> {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(text.as_bytes()).unwrap();
    Config::read(file.path())
}

#[test]
fn disparities_follow_the_width_unless_chosen() {
    assert_eq!([128, 640, 752, 1242, 2048].map(default_disparities), [16, 80, 96, 128, 128]);
    assert_eq!(read("").unwrap().settings_for(640).matching.disparities, 80);
    assert_eq!(read("[matching]\nwindow_width = 11\n").unwrap().settings_for(640).matching.disparities, 80);
    let chosen = read("[matching]\ndisparities = 64\n").unwrap();
    assert_eq!(chosen.settings_for(640).matching.disparities, 64);
}

#[test]
fn normalized_cuts_have_a_section() {
    let config = read("[normalized_cuts]\nmax_segments = 12\n").unwrap();
    let expected = NormalizedCutSettings { max_segments: 12, ..NormalizedCutSettings::default() };
    assert_eq!(config.normalized_cuts, expected);
    let mistake = read("[normalized_cuts]\n\nmax_cut = 3.0\n").unwrap_err();
    assert!(mistake.place.as_ref().is_some_and(|p| p.ends_with("line 3")), "{mistake}");
}

#[test]
fn detectors_are_chosen_by_the_file_and_by_the_command_line() {
    let text = "detector = \"cost-map\"\ncross_check = \"pixel-normals\"\n[cost_map]\nobstacle_cost = 30\n";
    let mut config = read(text).unwrap();
    let settings = config.settings_for(640);
    assert_eq!((settings.detector, settings.cross_check), (DetectorKind::CostMap, Some(DetectorKind::PixelNormals)));
    assert_eq!(settings.cost_map.obstacle_cost, 30);
    let choose = |detector, cross_check| MethodArgs { detector, cross_check };
    config.choose(&choose(Some(DetectorKind::GroundDeviation), None)).unwrap();
    let settings = config.settings_for(640);
    assert_eq!(settings.detector, DetectorKind::GroundDeviation);
    assert_eq!(settings.cross_check, Some(DetectorKind::PixelNormals));
    let refused = config.choose(&choose(Some(DetectorKind::PixelNormals), None)).unwrap_err();
    assert!(refused.what.contains("cross_check is the detector itself"), "{refused}");

    let unknown = read("detector = \"costmap\"\n").unwrap_err().to_string();
    for kind in DetectorKind::ALL {
        assert!(unknown.contains(kind.name()), "{unknown}");
    }
    let itself = read("detector = \"cost-map\"\ncross_check = \"cost-map\"\n").unwrap_err();
    assert!(itself.place.as_ref().is_some_and(|place| place.ends_with("line 2")), "{itself}");
    assert_eq!(read("detektor = \"cost-map\"\n").unwrap_err().mend.as_deref(), Some("write `detector`"));
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
    let documented = include_str!("../../../docs/files.md");
    let text = toml::to_string(&Settings::default()).unwrap();
    let mut section = String::new();
    let mut settings = BTreeSet::new();
    for line in text.lines().filter(|line| !line.is_empty()) {
        if let Some(name) = line.strip_prefix('[') {
            section = name.trim_end_matches(']').to_string();
            continue;
        }
        let (name, value) = line.split_once(" = ").unwrap();
        let name = if section.is_empty() { format!("`{name}`") } else { format!("`{section}.{name}`") };
        let row = documented.lines().filter(|row| row.starts_with('|')).find(|row| row.contains(&name));
        let row = row.unwrap_or_else(|| panic!("{name} is not in docs/files.md"));
        let value = value.trim_end_matches(".0");
        // One row may have several names, and their defaults in the same order.
        let [names, defaults] = [1, 2].map(|column| row.split('|').nth(column).unwrap().split(',').map(str::trim));
        let default =
            names.zip(defaults).find(|(other, _)| *other == name).map(|(_, default)| default.trim_matches('`'));
        // The number of disparities follows the width of the pictures.
        let is_same = default == Some(value) || name == "`matching.disparities`";
        assert!(is_same, "{name} is {value}, but docs/files.md says: {row}");
        settings.insert(name);
    }
    let sections: BTreeSet<_> = settings.iter().filter_map(|name| Some(name.split_once('.')?.0)).collect();
    let rows = documented.lines().filter_map(|row| row.strip_prefix("| ")?.split('|').next());
    for name in rows.flat_map(|names| names.split(',')).map(str::trim) {
        let is_setting = name.split_once('.').is_some_and(|(section, _)| sections.contains(section));
        assert!(!is_setting || settings.contains(name), "{name} is in docs/files.md, but there is no such setting");
    }
    let others = [
        ("run", toml::to_string(&RunSettings::default())),
        ("bus", toml::to_string(&BusSettings::default())),
        ("normalized_cuts", toml::to_string(&NormalizedCutSettings::default())),
    ];
    for (section, text) in others {
        for line in text.unwrap().lines() {
            let (name, value) = line.split_once(" = ").unwrap();
            let value = value.trim_end_matches(".0");
            let name = format!("`{section}.{name}`");
            let row = documented.lines().find(|row| row.contains(&name));
            assert!(row.is_some_and(|row| row.contains(value)), "{name} is {value}, but docs/files.md says: {row:?}");
        }
    }
    for name in ["base_id", "node", "format", "max_cell_frames"] {
        assert!(documented.contains(&format!("`wire.{name}`")));
    }
}

#[test]
fn mistakes_name_the_line() {
    let unknown = read("[matching]\nwindow_width = 7\nwindov_width = 9\n").unwrap_err();
    assert_eq!(unknown.kind.exit_status(), 2);
    assert!(unknown.place.as_ref().is_some_and(|p| p.ends_with("line 3")), "{unknown}");
    assert!(unknown.what.contains("windov_width"), "{unknown}");
    for text in ["[matching]\nwindow_width = \"wide\"\n", "[matching\n", "[nonsense]\n", "a = [\n", "\u{0}"] {
        assert_eq!(read(text).unwrap_err().kind.exit_status(), 2, "{text}");
    }
}

#[test]
fn every_mistake_is_told_at_once_with_its_line() {
    let text = r#"[matching]
windov_width = 9
window_width = 8
texture = "rough"
[wire]
node = 17
format = "fdd"
[bus]
interface = "a/b"
bitrate = 5
[run]
deadline_ms = 0
priorty = 3
[colour]
x = 1
[map]
geometry = { cell_size_mm = 1, x_coumt = 3 }
[[pair]]
name = "front"
calibration = ["none.yaml"]
[pair.mount]
height_m = -1.0
pitch_down_deg = 200.0
[pair.camera]
left = "/dev/video0"
width = 8
height = "tall"
[[pair]]
[pair.scene]
widht = 3
[[pair]]
"#;
    let (_, mistakes) = Config::parse(text, Path::new(""), true);
    let mut found: Vec<(usize, &str)> = mistakes.iter().map(|m| (m.line.unwrap(), m.field.as_str())).collect();
    found.sort_unstable();
    let expected = [
        (2, "matching.windov_width"),
        (3, "matching.window_width"),
        (4, "matching.texture"),
        (6, "wire.node"),
        (7, "wire.format"),
        (9, "bus.interface"),
        (10, "bus.bitrate"),
        (12, "run.deadline_ms"),
        (13, "run.priorty"),
        (14, "colour"),
        (17, "map.geometry"),
        (22, "pair[0].mount.height_m"),
        (23, "pair[0].mount.pitch_down_deg"),
        (24, "pair[0].camera.right"),
        (26, "pair[0].camera.width"),
        (27, "pair[0].camera.height"),
        (28, "pair[1].mount"),
        (30, "pair[1].scene.widht"),
        (31, "pair[2]"),
        (31, "pair[2].mount"),
    ];
    assert_eq!(found, expected, "{mistakes:#?}");
    let mend = |field: &str| mistakes.iter().find(|m| m.field == field).unwrap().mend.as_str();
    assert_eq!((mend("matching.windov_width"), mend("run.priorty")), ("write `window_width`", "write `priority`"));
}

#[test]
fn several_mistakes_in_the_text_itself_are_told_at_once() {
    let (_, mistakes) =
        Config::parse("[matching\nwindow_width = = 7\n[wire]\nnode = 1\nnode = 2\n", Path::new(""), true);
    let lines: Vec<_> = mistakes.iter().filter_map(|mistake| mistake.line).collect();
    assert!(lines.contains(&1) && lines.contains(&2) && lines.contains(&5), "{mistakes:#?}");
}

#[test]
fn the_rig_that_is_shipped_has_no_mistake_but_the_calibration_that_everybody_makes() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/rig.toml");
    let (config, mistakes) = Config::read_all(&path, true).unwrap();
    let fields: Vec<_> = mistakes.iter().map(|mistake| mistake.field.as_str()).collect();
    assert_eq!(fields, ["pair.calibration"], "{mistakes:#?}");
    assert_eq!(config.rig.bus.interface, "can0");
}

#[test]
fn a_recording_is_replayed_with_the_file_of_a_rig_whose_cameras_are_elsewhere() {
    let config =
        read("[matching]\nwindow_width = 11\n[[pair]]\ncalibration = [\"none.yaml\"]\n[pair.camera]\n").unwrap();
    assert_eq!(config.settings_for(640).matching.window_width, 11);
    assert!(config.rig.pairs.is_empty());
}

#[test]
fn several_pairs_need_mounts_of_their_own() {
    let scene = "[pair.scene]\nwidth = 96\nheight = 72\nframes = 1\n";
    let fields = |text: &str| -> Vec<String> {
        let (_, mistakes) = Config::parse(text, Path::new(""), true);
        mistakes.into_iter().map(|mistake| mistake.field).collect()
    };
    let mount = |yaw: &str| format!("[pair.mount]\nheight_m = 1.0\nyaw_left_deg = {yaw}\n");
    let two = |first: &str, second: &str| format!("[[pair]]\n{first}{scene}[[pair]]\n{second}{scene}");
    assert_eq!(fields(&two(&mount("0.0"), &mount("90.0"))), [""; 0]);
    assert_eq!(fields(&two(&mount("0.0"), "")), ["pair[1].mount"]);
    assert_eq!(fields(&two(&mount("0.0"), &mount("0.0"))), ["pair[1].mount"]);
    let whose = format!("[mount]\nheight_m = 1.0\n{}", two(&mount("0.0"), &mount("90.0")));
    assert_eq!(fields(&whose), ["mount"]);

    let one = format!("[mount]\nheight_m = 0.7\n[[pair]]\n{scene}");
    let (config, mistakes) = Config::parse(&one, Path::new(""), true);
    assert_eq!(mistakes, []);
    assert_eq!(config.rig.pairs[0].mount.height_m, Some(0.7), "with one pair it is clear whose it is");
}
