//! `compare`: what it writes, read back, and what can go wrong.

mod common;

use std::fs;

use common::{FRAMES, add_true_disparity, compare, fencepost, recording, replay};
use fencepost::compare::Method;
use fencepost_core::methods::DetectorKind;

/// Those that take seconds for a frame have a test of their own.
const QUICK: [Method; 5] = [
    Method::Core(DetectorKind::SurfaceNormals),
    Method::Core(DetectorKind::CostMap),
    Method::Core(DetectorKind::GroundDeviation),
    Method::Core(DetectorKind::DisparitySegments),
    Method::Core(DetectorKind::PixelNormals),
];
const QUICK_NAMES: &str = "surface-normals,cost-map,ground-deviation,disparity-segments,pixel-normals";

#[test]
fn every_detector_writes_its_folder_and_all_of_them_one_report() {
    let recording = recording();
    add_true_disparity(recording.path());
    let run = compare(recording.path(), &["--detectors", QUICK_NAMES]);
    run.assert(0, &[]);
    let page = fs::read_to_string(run.out.join("report.html")).unwrap();
    let written = run.json("compare.json");
    let detectors = written["detectors"].as_array().unwrap();
    assert_eq!(detectors.len(), QUICK.len());
    for (method, detector) in QUICK.into_iter().zip(detectors) {
        let name = method.name();
        assert_eq!(detector["name"], name);
        assert!(run.stdout.contains(name) && page.contains(&format!("<h4>{name}</h4>")), "{name}");
        let folder = run.out.join(name);
        for file in ["cells.csv", "summary.json", "classes/000000.png", "map/000003.png", "disparity/000002.png"] {
            assert!(folder.join(file).is_file(), "{name}: {file}");
        }
        assert_eq!(detector["frames"]["detected"], FRAMES, "{name}");
        for stage in ["match", "total"] {
            for figure in ["median_ms", "p99_ms"] {
                assert!(detector["stages"][stage][figure].as_f64().unwrap() > 0.0, "{name} {stage} {figure}");
            }
        }
        assert!(detector["memory_bytes"].as_u64().unwrap() > 160 * 120 * 3, "{name}");
        assert!(detector["score"]["disparity"]["density"].as_f64().unwrap() > 0.3, "{name}");
        let by_frame = detector["by_frame"].as_array().unwrap();
        let cells: u64 = by_frame.iter().map(|frame| frame["obstacle_cells"].as_u64().unwrap()).sum();
        assert_eq!(cells, detector["counts"]["cells_obstacle"].as_u64().unwrap(), "{name}");
        let mut rows = csv::Reader::from_path(folder.join("cells.csv")).unwrap();
        let obstacles =
            rows.records().filter(|row| row.as_ref().unwrap().iter().any(|field| field == "obstacle")).count();
        assert_eq!(obstacles as u64, cells, "{name}");
    }
    assert_eq!(page.matches("src=\"data:image/png;base64,").count(), 2 * FRAMES as usize * QUICK.len());
    for word in ["http://", "https://", "<script", "<link", "@import", "src=\"/", "url("] {
        assert!(!page.contains(word), "{word}");
    }
    assert!(page.contains("Disparity against truth") && !page.contains("Cells against lidar"));
}

#[test]
fn all_detectors_are_compared_where_none_is_named_and_the_reference_has_the_last_word() {
    let recording = recording();
    let run = compare(recording.path(), &["--frames", "1"]);
    run.assert(0, &[]);
    let written = run.json("compare.json");
    let names: Vec<_> = written["detectors"].as_array().unwrap().iter().map(|d| d["name"].as_str().unwrap()).collect();
    assert_eq!(names, Method::ALL.map(Method::name));
    let reference = &written["detectors"][names.iter().position(|name| *name == "normalized-cuts").unwrap()];
    assert!(reference["stages"]["reference"]["median_ms"].as_f64().unwrap() > 0.0);
    assert!(reference["memory_bytes"].is_null(), "what it takes is not bounded");
    let cells = |name: &str| fs::read(run.out.join(name).join("cells.csv")).unwrap();
    assert_ne!(cells("normalized-cuts"), cells("surface-normals"));
    let page = fs::read_to_string(run.out.join("report.html")).unwrap();
    assert!(page.contains("<h4>normalized-cuts</h4>"));
}

#[test]
fn the_default_detector_is_that_of_replay() {
    let recording = recording();
    let (compared, replayed) =
        (compare(recording.path(), &["--detectors", "surface-normals"]), replay(recording.path(), &[]));
    for file in ["cells.csv", "obstacles.csv", "ground.csv", "classes/000001.png", "map/000002.png"] {
        let ours = fs::read(compared.out.join("surface-normals").join(file)).unwrap();
        assert_eq!(ours, fs::read(replayed.out.join(file)).unwrap(), "{file}");
    }
}

#[test]
fn detectors_frames_and_pictures_can_be_picked() {
    let recording = recording();
    let names = "surface-normals,surface-normals";
    let run = compare(recording.path(), &["--detectors", names, "--frames", "1..3", "--show", "1"]);
    run.assert(0, &[]);
    let written = run.json("compare.json");
    assert_eq!(written["detectors"].as_array().unwrap().len(), 1, "named twice, run once");
    assert_eq!(written["detectors"][0]["frames"]["detected"], 2);
    let page = fs::read_to_string(run.out.join("report.html")).unwrap();
    assert!(page.contains("<h3>Frame 1</h3>") && !page.contains("<h3>Frame 2</h3>"));
}

#[test]
fn a_detector_that_does_not_exist_is_wrong_usage() {
    let recording = recording();
    let run = compare(recording.path(), &["--detectors", "surface-normals,lidar"]);
    run.assert(2, &["lidar", "the detectors are surface-normals"]);
}

#[test]
fn a_broken_frame_is_said_once_and_the_others_are_compared() {
    let recording = recording();
    fs::remove_file(recording.path().join("image_1/000000.png")).unwrap();
    let run = compare(recording.path(), &["--detectors", QUICK_NAMES]);
    run.assert(1, &["error: frame 0: the picture is missing", "mend:  copy it again", "1 of 4 frames"]);
    assert_eq!(run.stderr.matches("the picture is missing").count(), 1, "{}", run.stderr);
    for detector in run.json("compare.json")["detectors"].as_array().unwrap() {
        assert_eq!((&detector["frames"]["detected"], &detector["frames"]["failed"]), (&3.into(), &1.into()));
    }
    let page = fs::read_to_string(run.out.join("report.html")).unwrap();
    assert!(page.contains("Frames that could not be used") && page.contains("<h3>Frame 1</h3>"));
}

#[test]
fn nothing_to_compare() {
    let recording = recording();
    for number in 0..FRAMES {
        fs::write(recording.path().join(format!("image_1/{number:06}.png")), "x").unwrap();
    }
    let run = compare(recording.path(), &[]);
    run.assert(1, &["4 of 4 frames"]);
    assert!(fs::read_to_string(run.out.join("report.html")).unwrap().trim_end().ends_with("</html>"));
    compare(&recording.path().join("nowhere"), &[]).assert(1, &["is not a folder"]);
    let file = recording.path().join("calib.txt");
    let assert = fencepost().arg("compare").arg(recording.path()).arg("--out").arg(&file).assert().code(1);
    assert!(String::from_utf8_lossy(&assert.get_output().stderr).contains("cannot write"));
}
