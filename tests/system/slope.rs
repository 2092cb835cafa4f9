//! A slope of 10 degrees is ground.

use fencepost_core::map::CellState;
use fencepost_hal::scene::{Content, SceneOptions, TruthCell};
use fencepost_tests::say;

use super::cells::{count, for_each_frame};

/// Where the slope begins, metres ahead of the first frame, and the least share of its free cells that must be found: all of
/// the ground (the vehicle stands on the slope), and a slope ahead that lies at an angle to the ground that it stands on.
const STARTS: [(&str, f32); 2] = [("sloping ground", -30.0), ("a slope ahead", 4.0)];

#[test]
fn a_bare_slope_holds_no_obstacle() {
    for (name, slope_start_m) in STARTS {
        for slope_deg in [10.0, -10.0] {
            let options = SceneOptions {
                content: Content::OpenGround,
                slope_deg,
                slope_start_m,
                frames: 4,
                ..Default::default()
            };
            let (mut obstacles, mut free) = (0, 0);
            for_each_frame(options, |_, _, detector| {
                obstacles += count(detector, CellState::Obstacle, 0.0);
                free += count(detector, CellState::Free, slope_start_m.max(0.0) + 0.5);
            });
            say!("{name}, {slope_deg}°: {obstacles} obstacle cells, {free} free cells on the slope in 4 frames");
            assert_eq!(obstacles, 0, "{name}, {slope_deg}°");
            // Seen from above, ground that falls away soon lies out of sight.
            let least = if slope_deg > 0.0 { 200 } else { 20 };
            assert!(free >= least, "{name}, {slope_deg}°: {free} free cells");
        }
    }
}

#[test]
fn what_stands_on_a_slope_is_found_and_the_slope_is_free() {
    for (name, slope_start_m) in STARTS {
        let options = SceneOptions { slope_deg: 10.0, slope_start_m, frames: 4, ..Default::default() };
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
            "{name} of 10° with things on it: of {clear} clear cells {wrong} are called obstacles and {free} free; \
             {found} obstacle cells found"
        );
        assert_eq!(wrong, 0, "{name}");
        assert!(2 * free >= clear, "{name}: {free} of {clear} clear cells are free");
        assert!(found > 50, "{name}: {found} obstacle cells");
    }
}
