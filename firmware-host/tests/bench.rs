//! `bench`, as a user calls it. What it measures depends on the machine, so nothing here asks how long anything takes.

mod common;

use common::{fencepost, recording};
use fencepost_core::arch::Backend;
use predicates::{prelude::*, str::contains};
use serde_json::Value;

/// The figures of a run.
fn figures(arguments: &[&str]) -> Value {
    let output = fencepost().arg("bench").args(arguments).arg("--json").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn figures_of_a_rendered_trail() {
    let found = figures(&["--size", "160x120", "--disparities", "64", "--frames", "9"]);
    let ms = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("not a number in {found:#}"));
    let stages = found["stages"].as_object().unwrap();
    // serde_json sorts names.
    let mut names = vec!["rectify", "match", "validate", "surfaces", "ground", "obstacles", "map", "health", "wire"];
    names.sort_unstable();
    assert_eq!(stages.keys().collect::<Vec<_>>(), names);
    assert!(stages.values().all(|stage| ms(stage) > 0.0), "every stage has work: {found:#}");
    let sum: f64 = stages.values().map(ms).sum();
    let (total, p99, max) = (ms(&found["total_ms"]), ms(&found["p99_ms"]), ms(&found["max_ms"]));
    assert!(sum > 0.0 && total > 0.0 && total <= p99 && p99 <= max, "{found:#}");
    assert_eq!((&found["frames"], &found["threads"]), (&9.into(), &1.into()));
    assert_eq!((&found["width"], &found["height"], &found["disparities"]), (&160.into(), &120.into(), &64.into()));
    assert_eq!(found["backend"], Backend::fastest().name());
    let capacities = fencepost_core::detector::Capacities::for_pictures(160, 120, 64);
    assert_eq!(found["memory_bytes"], fencepost_core::detector::memory_bytes(&capacities));
}

#[test]
fn a_recording_in_its_own_size_and_in_others() {
    let recording = recording();
    let path = recording.path().to_str().unwrap();
    for (arguments, size) in
        [(&[][..], (160, 120)), (&["--size", "96x64"], (96, 64)), (&["--size", "200x130"], (200, 130))]
    {
        let found = figures(&[&["--recording", path, "--frames", "2"], arguments].concat());
        assert_eq!((&found["width"], &found["height"]), (&size.0.into(), &size.1.into()));
        assert!(found["stages"]["rectify"].as_f64().unwrap() > 0.0, "{found:#}");
    }
    let text = fencepost().args(["bench", "--frames", "2", "--recording", path]).assert().success();
    text.stdout(contains("160 × 120 px, 32 disparities").and(contains("rectify")).and(contains("backend")));
}

#[test]
fn every_backend_of_this_processor_is_measured() {
    for backend in Backend::ALL.iter().filter(|backend| backend.is_available()) {
        let found = figures(&["--size", "96x64", "--frames", "2", "--disparities", "64", "--backend", backend.name()]);
        assert_eq!(found["backend"], backend.name());
    }
    // They fill half of a vector: what serves instead is named.
    if Backend::Avx512.is_available() {
        let found = figures(&["--size", "96x64", "--frames", "2", "--disparities", "32", "--backend", "avx512"]);
        assert_eq!(found["backend"], "avx2");
    }
    let unknown = fencepost().args(["bench", "--backend", "mmx"]).assert().code(2);
    unknown.stderr(contains("this processor has plain"));
}

#[test]
fn threads_work_side_by_side() {
    let found = figures(&["--size", "96x64", "--frames", "3", "--threads", "3"]);
    assert_eq!((&found["threads"], &found["frames"]), (&3.into(), &9.into()), "three frames on each of three threads");
}

#[test]
fn a_picture_is_cut_into_bands() {
    let size = ["--size", "96x64", "--disparities", "32", "--frames", "3"];
    let (one, three) = (figures(&size), figures(&[&size[..], &["--bands", "3", "--threads", "2"]].concat()));
    assert_eq!((&one["bands"], &three["bands"]), (&1.into(), &3.into()));
    assert_eq!((&three["threads"], &three["frames"]), (&2.into(), &6.into()));
    let capacities = fencepost_core::detector::Capacities::for_pictures(96, 64, 32);
    let more = three["memory_bytes"].as_u64().unwrap() - one["memory_bytes"].as_u64().unwrap();
    assert_eq!(more, 2 * fencepost_core::detector::band_bytes(&capacities) as u64);
    assert!(three["stages"]["match"].as_f64().unwrap() > 0.0 && three["stages"]["rectify"] == 0.0, "{three:#}");
}

#[test]
fn what_cannot_be_measured_is_said() {
    let bench = |arguments: &[&str]| fencepost().arg("bench").args(arguments).assert();
    bench(&["--size", "640"]).code(2).stderr(contains("give width and height"));
    bench(&["--threads", "5"]).code(2).stderr(contains("1..=4"));
    bench(&["--bands", "9"]).code(2).stderr(contains("1..=8"));
    bench(&["--frames", "0"]).code(2);
    bench(&["--recording", "/nowhere"]).code(1).stderr(contains("/nowhere"));
    bench(&["--size", "4096x64", "--frames", "1"]).code(1).stderr(contains("2048 px width"));
    bench(&["--size", "64x48", "--disparities", "300"]).code(2).stderr(contains("matching.disparities"));
}
