//! Cells against lidar, and against the truth of rendered scenes.

use fencepost::{config::Config, detector};
use fencepost_hal::{
    camera::Camera,
    scene::{Scene, SceneOptions, Score, score},
};
use fencepost_tests::{at_hand, say};

/// Scenes that are scored. The first is that of the demonstration.
const SEEDS: [u32; 4] = [1, 2, 3, 4];

#[test]
fn road_against_lidar() {
    let name = "kitti15-road";
    let (Some(recording), Some(tool), Some(python)) =
        (at_hand::recording(name), at_hand::scoring_tool("score_cells.py"), at_hand::python())
    else {
        return;
    };
    let Some(out) = super::replayed(name) else { return };
    let cells = out.join("cells.csv");
    let said = at_hand::run_python(&python, &tool, &[recording.as_ref(), cells.as_ref(), "--json".as_ref()]);
    let scores: serde_json::Value = serde_json::from_str(&said).unwrap();
    let [f1, false_alarm, missed_free, free_found] =
        ["f1", "false_alarm", "missed_free", "free_found"].map(|field| scores[field].as_f64().unwrap());
    say!(
        "{name}: F1 {f1:.3} (at least 0.95), false alarms {false_alarm:.4} (at most 0.005), obstacles called free \
         {missed_free:.4} (at most 0.005), free cells found {free_found:.3} (at least 0.80)"
    );
    assert!(f1 >= 0.95 && false_alarm <= 0.005 && missed_free <= 0.005 && free_found >= 0.80, "{name}: {said}");
}

#[test]
fn rendered_scenes_against_their_truth() {
    let mut below = Vec::new();
    for seed in SEEDS {
        let total = score_scene(SceneOptions { seed, ..SceneOptions::default() });
        let (f1, false_alarm, missed_free) = (total.f1(), total.false_alarm(), total.missed_free());
        say!(
            "scene {seed}: F1 {f1:.3} (at least 0.97), false alarms {false_alarm:.4}, obstacles called free \
             {missed_free:.4}, free cells found {:.3}, {} obstacle cells",
            total.free_found_share(),
            total.obstacles
        );
        assert!(total.obstacles > 50 && total.free > 1000, "scene {seed} has something to find: {total:?}");
        if f1 < 0.97 {
            below.push((seed, f1));
        }
    }
    assert_eq!(below, [], "scenes with an F1 below 0.97");
}

/// Detects in every frame of a scene with the program's settings and scores the cells.
fn score_scene(options: SceneOptions) -> Score {
    let mut total = Score::default();
    for_each_frame(options, |scene, frame, detector| {
        let map = &detector.detection().map;
        total += score(&scene.truth(frame).cells, &map.geometry, &map.cells);
    });
    total
}

/// Renders every frame of a scene, detects with the program's settings, and lends scene and detector after each.
pub(crate) fn for_each_frame(options: SceneOptions, mut look: impl FnMut(&Scene, u32, &detector::ProgramDetector)) {
    let scene = Scene::new(options).unwrap();
    let settings = Config::default().settings_for(options.width);
    let (calibration, mount) = (scene.calibration(), scene.mount());
    let mut camera = scene.into_camera();
    // Held to the end: the ground is carried from frame to frame.
    let mut detector = detector::lock();
    detector.configure(&settings, &calibration, &mount).unwrap();
    for frame in 0..options.frames {
        let seen = camera.next_pair(|pair| detector.detect(&pair.left, &pair.right, &mut ()).map(|_| ()).unwrap());
        assert_eq!(seen, Ok(Some(())));
        look(camera.scene(), frame, &detector);
    }
}
