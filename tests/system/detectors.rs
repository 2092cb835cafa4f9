//! The paper's earlier detectors beside its final one, and two detectors that check each other.

use std::{
    collections::{BTreeSet, HashMap, HashSet},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use fencepost::{
    cli::{DetectorArgs, MethodArgs},
    config::Config,
    detector,
};
use fencepost_core::{map::CellState, methods::DetectorKind, settings::Settings};
use fencepost_hal::{
    camera::Camera,
    scene::{Content, Scene, SceneOptions, Score, score},
};
use fencepost_tests::{
    at_hand,
    replay::replay_with,
    say,
    table::{self, Row},
};

/// Runs the program on a recording with chosen detectors, once for all tests.
fn replayed(name: &str, detector: DetectorKind, cross_check: Option<DetectorKind>) -> Option<PathBuf> {
    static DONE: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    let recording = at_hand::recording(name)?;
    let check = cross_check.map_or("alone", DetectorKind::name);
    let out = Path::new(super::SCRATCH).join("detectors").join(name).join(detector.name()).join(check);
    let mut done = DONE.lock().unwrap_or_else(PoisonError::into_inner);
    if !done.contains(&out) {
        let methods = MethodArgs { detector: Some(detector), cross_check };
        replay_with(&recording, &out, DetectorArgs { methods, ..DetectorArgs::default() });
        done.insert(out.clone());
    }
    Some(out)
}

/// The state of each cell, by frame and place.
fn states(rows: &[Row]) -> HashMap<[String; 3], String> {
    let place = |row: &Row| ["frame", "x_m", "y_m"].map(|column| row[column].clone());
    rows.iter().map(|row| (place(row), row["state"].clone())).collect()
}

/// F1 on `kitti15-road` of what a user would otherwise take: OpenCV's semi-global matching, with the better of two ways to find the
/// ground in its disparities.
const SEMI_GLOBAL_F1: f64 = 0.891;

#[test]
fn the_final_method_is_better_than_what_came_before_it() {
    let name = "kitti15-road";
    let (Some(recording), Some(tool), Some(python)) =
        (at_hand::recording(name), at_hand::scoring_tool("score_cells.py"), at_hand::python())
    else {
        return;
    };
    let (mut f1_of, mut false_alarm_of) = (HashMap::new(), HashMap::new());
    for kind in DetectorKind::ALL {
        let Some(out) = replayed(name, kind, None) else { return };
        let cells = out.join("cells.csv");
        let said = at_hand::run_python(&python, &tool, &[recording.as_ref(), cells.as_ref(), "--json".as_ref()]);
        let scores: serde_json::Value = serde_json::from_str(&said).unwrap();
        let [f1, recall, false_alarm, missed_free, free_found] =
            ["f1", "recall", "false_alarm", "missed_free", "free_found"].map(|field| scores[field].as_f64().unwrap());
        say!(
            "{name}, {}: F1 {f1:.3}, obstacles found {recall:.3}, false alarms {false_alarm:.4}, obstacles called free \
             {missed_free:.4}, free cells found {free_found:.3}",
            kind.name()
        );
        // What cannot be used at all would show nothing about the method.
        assert!(recall >= 0.8 && missed_free <= 0.01, "{}: {said}", kind.name());
        f1_of.insert(kind.name(), f1);
        false_alarm_of.insert(kind.name(), false_alarm);
    }
    let final_f1 = f1_of["surface-normals"];
    assert!(final_f1 > SEMI_GLOBAL_F1, "F1 {final_f1:.3}, against {SEMI_GLOBAL_F1} with another matcher");
    for kind in DetectorKind::ALL.into_iter().skip(1) {
        let f1 = f1_of[kind.name()];
        assert!(f1 < final_f1, "{}: F1 {f1:.3}, against {final_f1:.3}", kind.name());
        // The paper, section 4.3: an object melts into the ground that it stands on, and the more of the ground has a disparity,
        // the more of it becomes an obstacle. The others are useful.
        let melts = kind == DetectorKind::DisparitySegments;
        assert_eq!(f1 < 0.7, melts, "{}: F1 {f1:.3}", kind.name());
        assert_eq!(false_alarm_of[kind.name()] > 0.3, melts, "{}: {false_alarm_of:?}", kind.name());
    }
}

#[test]
fn nothing_is_free_that_the_checking_detector_calls_an_obstacle() {
    let name = "kitti15-road";
    for (main, check) in [
        (DetectorKind::SurfaceNormals, DetectorKind::CostMap),
        (DetectorKind::SurfaceNormals, DetectorKind::PixelNormals),
        (DetectorKind::CostMap, DetectorKind::GroundDeviation),
    ] {
        let what = format!("{name}: {} checked by {}", main.name(), check.name());
        let runs = [replayed(name, main, None), replayed(name, check, None), replayed(name, main, Some(check))];
        let [Some(alone), Some(other), Some(both)] = runs else { return };
        let rows = [alone, other, both].map(|out| table::rows(&out.join("cells.csv")));
        let [alone, other, both] = rows.each_ref().map(|rows| states(rows));
        let obstacles = |states: &HashMap<[String; 3], String>| -> HashSet<[String; 3]> {
            states.iter().filter(|(_, state)| *state == "obstacle").map(|(place, _)| place.clone()).collect()
        };
        assert_eq!(obstacles(&alone), obstacles(&both), "{what}: obstacles stay");
        let mut counts = HashMap::<&str, usize>::new();
        for row in &rows[2] {
            let place = ["frame", "x_m", "y_m"].map(|column| row[column].clone());
            let (doubt, percent) = (row["doubt"].as_str(), table::number(row, "confidence_percent"));
            let expected = match (row["state"].as_str(), other.get(&place).map(String::as_str)) {
                (state, Some(same)) if state == same => ("", Some(100.0)),
                (_, None) => ("unconfirmed", Some(80.0)),
                ("obstacle", Some(_)) => ("disputed", Some(50.0)),
                (state, other) => panic!("{what}: {place:?} is {state}, and {other:?} for the other"),
            };
            assert_eq!((doubt, percent), expected, "{what}: {place:?}");
            *counts.entry(doubt).or_default() += 1;
        }
        let withheld = alone.keys().filter(|place| !both.contains_key(*place)).count();
        say!("{what}: {counts:?}, {withheld} cells not free any more");
        assert!(counts[""] > 1000, "{what}: they agree on most");
        assert_eq!(both.len() + withheld, alone.len(), "{what}");
    }
}

/// Looks at rendered frames with chosen detectors.
fn look_at_scene(
    options: SceneOptions,
    detector: DetectorKind,
    mut look: impl FnMut(&Scene, u32, &detector::ProgramDetector),
) {
    let scene = Scene::new(options).unwrap();
    let settings = Settings { detector, ..Config::default().settings_for(options.width) };
    let (calibration, mount) = (scene.calibration(), scene.mount());
    let mut camera = scene.into_camera();
    let mut program = detector::lock();
    program.configure(&settings, &calibration, &mount).unwrap();
    for frame in 0..options.frames {
        camera.next_pair(|pair| program.detect(&pair.left, &pair.right, &mut ()).map(|_| ()).unwrap()).unwrap();
        look(camera.scene(), frame, &program);
    }
}

/// The paper, section 4.1 and Figure 8.
#[test]
fn a_rendered_hill_is_an_obstacle_for_the_cost_map_only() {
    let options = SceneOptions {
        content: Content::OpenGround,
        slope_deg: 15.0,
        slope_start_m: 1.0,
        frames: 2,
        ..SceneOptions::default()
    };
    let mut found = HashMap::new();
    for kind in [DetectorKind::SurfaceNormals, DetectorKind::CostMap] {
        let (mut obstacle, mut free, mut seen) = (0, 0, 0);
        look_at_scene(options, kind, |_, _, program| {
            let count = |state| program.detection().map.cells.iter().filter(|cell| cell.state == state).count();
            obstacle += count(CellState::Obstacle);
            free += count(CellState::Free);
            seen += usize::from(program.detection().ground.is_some());
        });
        say!("bare hill of 15°, {}: ground in {seen} of 2 frames, {obstacle} obstacle cells, {free} free", kind.name());
        found.insert(kind.name(), (obstacle, free, seen));
    }
    let [(false_alarms, free, seen), (obstacle, called_free, _)] =
        ["surface-normals", "cost-map"].map(|name| found[name]);
    assert!(obstacle > 50 && called_free < obstacle, "the hill is an obstacle for the cost map: {found:?}");
    assert!(20 * false_alarms < obstacle && free > 1000 && seen == 2, "and ground for the surfaces: {found:?}");
}

#[test]
fn every_detector_finds_most_of_a_rendered_scene() {
    let options = SceneOptions { frames: 4, ..SceneOptions::default() };
    for kind in DetectorKind::ALL {
        let mut total = Score::default();
        look_at_scene(options, kind, |scene, frame, program| {
            let map = &program.detection().map;
            total += score(&scene.truth(frame).cells, &map.geometry, &map.cells);
        });
        let (f1, false_alarm, missed_free) = (total.f1(), total.false_alarm(), total.missed_free());
        say!(
            "scene 1, {}: F1 {f1:.3}, false alarms {false_alarm:.4}, obstacles called free {missed_free:.4}, free cells \
             found {:.3}",
            kind.name(),
            total.free_found_share()
        );
        // The segments melt into the ground; the others are of use on level ground.
        let least = if kind == DetectorKind::DisparitySegments { 0.1 } else { 0.6 };
        assert!(f1 > least && missed_free < 0.1, "{}: F1 {f1:.3}, {missed_free:.4}", kind.name());
    }
}
