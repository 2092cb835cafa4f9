//! Disparity against laser scans and structured light.

use fencepost_tests::{at_hand, say};

/// Scores the disparity of a recording: at least as dense, at most as many pixels off by more than 3 px.
fn score(name: &str, least_density: f64, most_bad3: f64) {
    let (Some(recording), Some(tool), Some(python)) =
        (at_hand::recording(name), at_hand::scoring_tool("score_disparity.py"), at_hand::python())
    else {
        return;
    };
    let Some(out) = super::replayed(name) else { return };
    let disparity = out.join("disparity");
    let said = at_hand::run_python(&python, &tool, &[recording.as_ref(), disparity.as_ref(), "--json".as_ref()]);
    let scores: serde_json::Value = serde_json::from_str(&said).unwrap();
    let [density, bad3] = ["density", "bad3"].map(|field| scores[field].as_f64().unwrap());
    say!("{name}: density {density:.4} (at least {least_density}), bad3 {bad3:.5} (at most {most_bad3})");
    assert!(density >= least_density && bad3 <= most_bad3, "{name}: {said}");
}

#[test]
fn terrace() {
    score("eth3d-terrace", 0.75, 0.006);
}

#[test]
fn cones() {
    score("middlebury-cones", 0.80, 0.03);
}

#[test]
fn road() {
    score("kitti15-road", 0.60, 0.05);
}
