//! The recording that every clone has, and the bus log that belongs to it, byte for byte.

use std::{fs, path::Path};

use fencepost_tests::{
    at_hand::{self, ROOT},
    golden, replay, say,
};

#[test]
fn recording_is_rendered_alike_everywhere() {
    let (there, scratch) = (golden::recording(), tempfile::tempdir().unwrap());
    let fresh = scratch.path().join("trail");
    golden::render(&fresh);
    if golden::blesses() {
        bless(&fresh, &there);
    }
    let (expected, rendered) = (files(&there), files(&fresh));
    assert_eq!(names(&expected), names(&rendered), "files of {}. {}", there.display(), golden::HOW_TO_BLESS);
    for ((name, expected), (_, rendered)) in expected.iter().zip(&rendered) {
        assert!(expected == rendered, "{}/{name} is rendered otherwise now. {}", there.display(), golden::HOW_TO_BLESS);
    }
    let size: usize = expected.iter().map(|(_, bytes)| bytes.len()).sum();
    say!("{} files, {} KB, are rendered alike", expected.len(), size / 1000);
    assert!(size < 2_000_000, "{size} bytes are too much for the repository");
}

#[test]
fn bus_log_is_the_golden_one() {
    let scratch = tempfile::tempdir().unwrap();
    // Blessing renews the recording too: both tests may run at once, so that this one renders its own.
    let recording = if golden::blesses() { scratch.path().join("trail") } else { golden::recording() };
    if golden::blesses() {
        golden::render(&recording);
    }
    let out = scratch.path().join("out");
    replay::replay(&recording, &out);
    let log = fs::read_to_string(out.join("can.log")).unwrap();
    if golden::blesses() {
        fs::write(golden::can_log(), &log).unwrap();
    }
    let expected = fs::read_to_string(golden::can_log()).unwrap();
    let differs = (1..).zip(log.lines().zip(expected.lines())).find(|(_, (now, golden))| now != golden);
    if let Some((line, (now, golden))) = differs {
        panic!("can.log, line {line}: {now}, golden {golden}. {}", golden::HOW_TO_BLESS);
    }
    assert!(log == expected, "can.log has another length than the golden one. {}", golden::HOW_TO_BLESS);

    let Some(python) = at_hand::python() else { return };
    let checker = Path::new(ROOT).join("tests/python/check_can_log.py");
    let cells = out.join("cells.csv");
    let said = at_hand::run_python(&python, &checker, &[golden::can_log().as_ref(), cells.as_ref()]);
    say!("{}", said.trim());
    // The log is one of the program: what it looks like when something is wrong with it must be seen, too.
    let plant = Path::new(ROOT).join("tests/python/test_check_can_log.py");
    let said = at_hand::run_python(&python, &plant, &[golden::can_log().as_ref(), cells.as_ref()]);
    say!("{}", said.trim());
}

/// Puts freshly rendered files in the place of those that are there.
fn bless(fresh: &Path, there: &Path) {
    if there.exists() {
        fs::remove_dir_all(there).unwrap();
    }
    for (name, bytes) in files(fresh) {
        let path = there.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
}

/// Names and bytes of all files in a folder and those below it.
fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    fn collect(folder: &Path, prefix: &str, into: &mut Vec<(String, Vec<u8>)>) {
        let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
        for entry in entries.map(Result::unwrap) {
            let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
            if entry.path().is_dir() {
                collect(&entry.path(), &format!("{name}/"), into);
            } else {
                into.push((name, fs::read(entry.path()).unwrap()));
            }
        }
    }
    let mut all = Vec::new();
    collect(folder, "", &mut all);
    all.sort();
    all
}

fn names(files: &[(String, Vec<u8>)]) -> Vec<&str> {
    files.iter().map(|(name, _)| name.as_str()).collect()
}
