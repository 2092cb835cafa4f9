//! `listen` as a pipe and a script meet it.

mod common;

use std::path::PathBuf;

use common::fencepost;
use predicates::{prelude::*, str::contains};

/// The bus log that belongs to the recording of a clone.
fn golden() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/recordings/trail.can.log")
}

#[test]
fn a_log_is_told_in_lines_when_nobody_looks() {
    let assert = fencepost().args(["listen", "--log"]).arg(golden()).assert().success();
    let text = String::from_utf8(assert.get_output().stdout.clone()).unwrap();
    // What the decoder counts is what is heard.
    let decoded = fencepost().args(["can", "decode"]).arg(golden()).assert().success();
    let decoded = String::from_utf8(decoded.get_output().stdout.clone()).unwrap();
    let scans = decoded.lines().filter(|line| line.contains("whole scan ")).count();
    assert!(scans > 0);
    assert!(text.contains(&format!("node 0: {scans} scans, ")), "{text}");
    assert!(text.contains("heartbeat stopping") && text.contains("0 lost, 0 damaged"), "{text}");
}

#[test]
fn lines_of_json_are_json_and_end_when_told_to() {
    let assert = fencepost().args(["listen", "--json", "--count", "2", "--log"]).arg(golden()).assert().success();
    let lines: Vec<serde_json::Value> = assert
        .get_output()
        .stdout
        .split(|byte| *byte == b'\n')
        .filter(|line| !line.is_empty())
        .map(|line| serde_json::from_slice(line).unwrap())
        .collect();
    assert_eq!(lines.iter().filter(|line| line["message"] == "scan").count(), 2);
    assert_eq!(lines.last().unwrap()["summary"]["nodes"][0]["scans"], 2);
}

#[test]
fn what_cannot_be_listened_to_is_said_with_its_mend() {
    let missing = fencepost().args(["listen", "--log", "missing.log"]).assert().code(1);
    missing.stderr(contains("cannot be read").and(contains("candump -L")));
    fencepost().arg("listen").assert().code(2).stderr(contains("INTERFACE"));
    let other_base = fencepost().args(["listen", "--base-id", "0x500", "--log"]).arg(golden()).assert().code(1);
    let frames = std::fs::read_to_string(golden()).unwrap().lines().count();
    other_base.stderr(contains(format!("no message of fencepost in {frames} frames")).and(contains("--base-id")));
    fencepost().args(["listen", "can0", "--base-id", "3"]).assert().code(2).stderr(contains("wire.base_id"));
}

#[cfg(target_os = "linux")]
#[test]
fn an_interface_that_is_not_there_is_waited_for() {
    let assert = fencepost().args(["listen", "nothere0", "--seconds", "0.2"]).assert().code(1);
    assert.stdout(contains("nothere0")).stderr(contains("no message of fencepost"));
}
