//! `rig.toml` of any text, with the files that it names and without.

use std::{cell::RefCell, collections::BTreeSet, fs, path::Path};

use fencepost::config::Config;
use fencepost_core::wire::WireConfig;

thread_local! {
    /// A folder in memory where the system has a place for that: the rig's file, and a calibration for it to name.
    static FOLDER: RefCell<Option<tempfile::TempDir>> = const { RefCell::new(None) };
}

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let Some((first, text)) = bytes.split_first() else { return };
    FOLDER.with_borrow_mut(|folder| {
        let folder = folder.get_or_insert_with(|| {
            let memory = Path::new("/dev/shm");
            let parent = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
            let folder = tempfile::tempdir_in(parent).expect("a folder");
            let calib =
                "P0: 262.5 0 159.5 0 0 262.5 119.5 0 0 0 1 0\nP1: 262.5 0 159.5 -31.5 0 262.5 119.5 0 0 0 1 0\n";
            fs::write(folder.path().join("calib.txt"), calib).expect("a file");
            folder
        });
        let file = folder.path().join("rig.toml");
        fs::write(&file, text).expect("a file");
        check(&file, text, first & 1 == 1, first & 6 == 0);
    });
}

/// Every mistake is told with its line, and the same if it is read `twice`; where there is none, every number can be used.
fn check(file: &Path, text: &[u8], with_rig: bool, twice: bool) {
    let (config, mistakes) = match Config::read_all(file, with_rig) {
        Ok(found) => found,
        Err(failure) => return assert!(std::str::from_utf8(text).is_err(), "{failure}"),
    };
    if twice {
        let again = Config::read_all(file, with_rig).map(|(_, again)| format!("{again:?}"));
        assert_eq!(again.ok(), Some(format!("{mistakes:?}")), "the same text again");
    }
    let lines = text.split(|byte| *byte == b'\n').count();
    let mut seen = BTreeSet::new();
    for mistake in &mistakes {
        assert!(!mistake.problem.is_empty(), "{mistake:?}");
        assert!(mistake.line.is_none_or(|line| (1..=lines).contains(&line)), "{mistake:?} of {lines} lines");
        assert!(seen.insert(format!("{mistake:?}")), "told twice: {mistake:?}");
    }
    // What is mistaken has its default: whatever was read can be used.
    let settings = config.settings_for(640);
    let checks = [
        settings.check_detectors(),
        settings.matching.check(),
        settings.validate.check(),
        settings.surfaces.check(),
        settings.ground.check(),
        settings.obstacles.check(),
        settings.health.check(),
        settings.cost_map.check(),
        settings.ground_deviation.check(),
        settings.disparity_segments.check(),
        settings.pixel_normals.check(),
        settings.confidence.check(),
        settings.map.check(128 * 128),
        config.mount.map_or(Ok(()), |mount| mount.check()),
        WireConfig::new(config.wire).map(|_| ()),
    ];
    for result in checks {
        assert_eq!(result, Ok(()), "a setting that cannot be used was taken");
    }
}

pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let texts = [
        include_str!("../../../deploy/rig.toml").to_owned(),
        "detector = \"cost-map\"\ncross_check = \"pixel-normals\"\n[cost_map]\nobstacle_cost = 30\n".to_owned(),
        "[matching]\ndisparities = 32\nwindow_width = 11\nprefilter = \"grey\"\n[map.geometry]\ncell_size_mm = 250\n".to_owned(),
        "[[pair]]\nname = \"a\"\ncalibration = [\"calib.txt\"]\n[pair.camera]\nleft = \"a\"\nright = \"b\"\nwidth = 320\n\
         height = 240\nrate_hz = 10\n[pair.mount]\nheight_m = 1.0\n[run]\nstale_ms = 500\n"
            .to_owned(),
        "[[pair]]\n[pair.scene]\nwidth = 64\n[wire]\nbase_id = 0x500\nformat = \"fd\"\n[health]\nrow_error_px = nan\n".to_owned(),
    ];
    texts.iter().flat_map(|text| [0, 1].map(|first| [&[first], text.as_bytes()].concat())).collect()
}
