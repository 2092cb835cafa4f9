//! A slope of 10 degrees is ground.

use fencepost_core::map::CellState;
use fencepost_hal::scene::{Content, SceneOptions, TruthCell};
use fencepost_tests::say;

use super::cells::{count, for_each_frame};

/// Where the slope begins, metres ahead of the first frame: under the vehicle, just before the picture, and within it.
const STARTS_M: [f32; 4] = [-30.0, 1.0, 2.5, 4.0];
const FRAMES: u32 = 2;

#[test]
fn a_bare_slope_holds_no_obstacle() {
    let mut wrong = Vec::new();
    for slope_deg in [10.0, -10.0] {
        for slope_start_m in STARTS_M {
            let content = Content::OpenGround;
            let options = SceneOptions { content, slope_deg, slope_start_m, frames: FRAMES, ..Default::default() };
            let (mut obstacles, mut free) = (0, 0);
            for_each_frame(options, |_, _, detector| {
                obstacles += count(detector, CellState::Obstacle, 0.0);
                free += count(detector, CellState::Free, slope_start_m.max(0.0) + 0.5);
            });
            say!(
                "bare slope of {slope_deg}° from {slope_start_m} m: {obstacles} obstacle cells, {free} free cells on the slope \
                 in {FRAMES} frames"
            );
            // Seen from above, ground that falls away soon lies out of sight.
            let least = if slope_deg > 0.0 { 100 } else { 10 };
            if obstacles > 0 || free < least {
                wrong.push((slope_deg, slope_start_m, obstacles, free));
            }
        }
    }
    assert_eq!(wrong, [], "slopes (degrees, start in metres) with obstacle cells, or with too few free cells");
}

#[test]
fn what_stands_on_a_slope_is_found_and_the_slope_is_free() {
    let mut bad = Vec::new();
    for slope_start_m in STARTS_M {
        let options = SceneOptions { slope_deg: 10.0, slope_start_m, frames: FRAMES, ..Default::default() };
        let (mut wrong, mut clear, mut found, mut free) = (0, 0, 0, 0);
        for_each_frame(options, |scene, frame, detector| {
            let truth = scene.truth(frame).cells;
            let map = &detector.detection().map;
            for (index, cell) in map.cells.iter().enumerate() {
                let (i, j) = map.geometry.cell_at(index);
                let around = (-1..=1).flat_map(|a| (-1..=1).map(move |b| (i + a, j + b)));
                let mut around = around.map(|(i, j)| truth.get(i, j));
                let is_clear = truth.get(i, j) == TruthCell::Free && around.all(|state| state != TruthCell::Obstacle);
                clear += usize::from(is_clear);
                wrong += usize::from(is_clear && cell.state == CellState::Obstacle);
                free += usize::from(is_clear && cell.state == CellState::Free);
                found += usize::from(truth.get(i, j) == TruthCell::Obstacle && cell.state == CellState::Obstacle);
            }
        });
        say!(
            "slope of 10° from {slope_start_m} m with things on it: of {clear} clear cells {wrong} are called obstacles and \
             {free} free; {found} obstacle cells found"
        );
        if wrong > 0 || 2 * free < clear || found < 30 {
            bad.push((slope_start_m, wrong, free, clear, found));
        }
    }
    assert_eq!(
        bad,
        [],
        "slopes (start in metres) with clear cells called obstacles (first number), or too little found"
    );
}
