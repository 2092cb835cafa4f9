//! The commands other than `replay`, as a newcomer meets them.

mod common;

use std::fs;

use common::{fencepost, recording};
use predicates::{prelude::*, str::contains};

#[test]
fn without_arguments_the_demo_runs() {
    let folder = tempfile::tempdir().unwrap();
    let assert = fencepost().current_dir(folder.path()).assert().success();
    assert.stdout(contains("median ms").and(contains("report      out/demo/report.html")));
    for name in ["cells.csv", "can.log", "summary.json", "report.html", "map/000000.png", "disparity/000007.png"] {
        assert!(folder.path().join("out/demo").join(name).is_file(), "{name}");
    }
    let summary = fs::read_to_string(folder.path().join("out/demo/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(summary["ground"]["frames_seen"], 8, "the ground of the demo is seen in every frame");
    assert!(summary["counts"]["obstacles"].as_u64().unwrap() > 8);
}

#[test]
fn what_the_demo_records_replays_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| fencepost().current_dir(folder.path()).args(arguments).assert().success();
    run(&["-q", "demo", "--out", "first", "--record", "recording", "--frames", "2"]).stdout("");
    run(&["replay", "recording", "--out", "second"]);
    for name in ["cells.csv", "can.log", "map/000001.png"] {
        let read = |out: &str| fs::read(folder.path().join(out).join(name)).unwrap();
        assert_eq!(read("first"), read("second"), "{name}");
    }
    // A second time would mix two recordings.
    let again = fencepost().current_dir(folder.path()).args(["demo", "--record", "recording"]).assert().code(1);
    again.stderr(contains("holds a recording already"));
}

#[test]
fn help_shows_examples_and_exit_status() {
    let says = contains("fencepost replay").and(contains("Exit status:")).and(contains("mount.json"));
    fencepost().arg("--help").assert().success().stdout(says);
    fencepost().args(["replay", "--help"]).assert().success().stdout(contains("--frames").and(contains("cells.csv")));
    fencepost().arg("--version").assert().success().stdout(contains(env!("CARGO_PKG_VERSION")));
}

#[test]
fn check_tells_what_a_recording_can_see() {
    let recording = recording();
    let says = [
        "KITTI odometry",
        "4, numbered 0 to 3",
        "10.0 frames a second",
        "1.10 m above the ground",
        "blind zone",
        "memory",
        "step of 1/2 px",
    ];
    let assert = fencepost().arg("check").arg(recording.path()).assert().success();
    let text = String::from_utf8(assert.get_output().stdout.clone()).unwrap();
    for part in says {
        assert!(text.contains(part), "`{part}` is not in\n{text}");
    }
    // f b = 15.6 px m; 32 disparities, of which the 30th is the last that is reported.
    assert!(text.contains("nearer than 0.52 m"), "{text}");
    fs::write(recording.path().join("image_0/000002.png"), "x").unwrap();
    let check = fencepost().arg("check").arg(recording.path()).assert().code(1);
    check.stderr(contains("frame 2")).stdout(contains("1 frames cannot be used"));
}

#[test]
fn check_tells_what_a_calibration_and_a_configuration_say() {
    let recording = recording();
    let folder = tempfile::tempdir().unwrap();
    let calibration = recording.path().join("calib.txt");
    // The file alone does not say how large the pictures are.
    fencepost().arg("check").arg(&calibration).assert().code(1).stderr(contains("calib.txt"));
    let file = folder.path().join("robot.toml");
    fs::write(&file, "[surfaces]\nvertical_deg = 50.0\n").unwrap();
    let assert = fencepost().arg("check").arg(&file).assert().success();
    assert.stdout(contains("vertical_deg = 50.0").and(contains("window_width = 9")).and(contains("memory")));
}

#[test]
fn quiet_says_nothing_and_verbose_says_more() {
    let recording = recording();
    let folder = tempfile::tempdir().unwrap();
    let replay = |flag: &str| {
        let out = folder.path().join("out");
        fencepost().arg("replay").arg(recording.path()).arg("--out").arg(out).arg(flag).assert().success()
    };
    replay("--quiet").stdout("").stderr("");
    replay("--verbose").stderr(contains("frame 3: "));
}

#[test]
fn a_listener_that_leaves_does_not_stop_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_fencepost"))
        .current_dir(folder.path())
        .args(["-q", "demo", "--out", "first", "--record", "recording", "--frames", "1"])
        .spawn()
        .unwrap();
    assert!(child.wait().unwrap().success());
    // A pipe that nobody reads.
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_fencepost"))
        .current_dir(folder.path())
        .args(["-v", "replay", "recording", "--out", "second", "--write", "cells"])
        .stdout(writer.try_clone().unwrap())
        .stderr(writer)
        .spawn()
        .unwrap();
    assert!(child.wait().unwrap().success());
    assert!(folder.path().join("second/summary.json").is_file());
}
