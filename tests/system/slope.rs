//! A slope of 10 degrees is ground.

use fencepost_core::map::CellState;
use fencepost_hal::scene::{Content, SceneOptions, TruthCell};
use fencepost_tests::say;

use super::cells::for_each_frame;

/// Where the slope begins, metres ahead of the first frame: under the vehicle, just before the picture, and within it.
const STARTS_M: [f32; 4] = [-30.0, 1.0, 2.5, 4.0];
const FRAMES: u32 = 2;

/// Cells that are free and have no obstacle beside them, and what was made of them; obstacles that were found.
#[derive(Debug, Default)]
struct Count {
    clear: usize,
    clear_called_obstacle: usize,
    clear_called_free: usize,
    /// Cells called obstacles where nothing is known to be, most of them too far away to be judged.
    not_judged_called_obstacle: usize,
    obstacles_found: usize,
}

impl Count {
    /// Looks at the cells on the slope.
    fn of(content: Content, slope_deg: f32, slope_start_m: f32) -> Self {
        let options = SceneOptions { content, slope_deg, slope_start_m, frames: FRAMES, ..Default::default() };
        let mut count = Self::default();
        for_each_frame(options, |scene, frame, detector| {
            let truth = scene.truth(frame).cells;
            let map = &detector.detection().map;
            for (index, cell) in map.cells.iter().enumerate() {
                let (i, j) = map.geometry.cell_at(index);
                if map.geometry.centre_m(i, j).0 < slope_start_m {
                    continue;
                }
                let around = (-1..=1).flat_map(|a| (-1..=1).map(move |b| (i + a, j + b)));
                let is_lonely = around.map(|(i, j)| truth.get(i, j)).all(|state| state != TruthCell::Obstacle);
                let is_clear = truth.get(i, j) == TruthCell::Free && is_lonely;
                let (is_free, is_obstacle) = (cell.state == CellState::Free, cell.state == CellState::Obstacle);
                count.clear += usize::from(is_clear);
                count.clear_called_obstacle += usize::from(is_clear && is_obstacle);
                count.clear_called_free += usize::from(is_clear && is_free);
                count.not_judged_called_obstacle +=
                    usize::from(is_lonely && is_obstacle && truth.get(i, j) == TruthCell::NotJudged);
                count.obstacles_found += usize::from(truth.get(i, j) == TruthCell::Obstacle && is_obstacle);
            }
        });
        count
    }

    fn say(&self, what: &str) {
        say!(
            "{what}: of {} clear cells on it {} are called obstacles and {} free; farther away {} more are called \
             obstacles; {} obstacle cells found",
            self.clear,
            self.clear_called_obstacle,
            self.clear_called_free,
            self.not_judged_called_obstacle,
            self.obstacles_found
        );
    }
}

#[test]
fn a_bare_slope_holds_no_obstacle() {
    let mut bad = Vec::new();
    let rising = STARTS_M.map(|slope_start_m| (10.0, slope_start_m));
    for (slope_deg, slope_start_m) in rising.into_iter().chain([(-10.0, 2.5)]) {
        let name = format!("bare slope of {slope_deg}° from {slope_start_m} m");
        let count = Count::of(Content::OpenGround, slope_deg, slope_start_m);
        count.say(&name);
        // Seen from above, ground that falls away soon lies out of sight.
        let least = if slope_deg > 0.0 { count.clear / 2 } else { count.clear / 3 };
        if count.clear_called_obstacle > 0 || count.clear_called_free < least || count.clear < 50 {
            bad.push(name);
        }
    }
    assert_eq!(bad, [""; 0], "clear cells are called obstacles, or too few of them free");
}

#[test]
fn what_stands_on_a_slope_is_found_and_the_slope_is_free() {
    let mut bad = Vec::new();
    Count::of(Content::Rural, 0.0, 2.5).say("level ground with things on it");
    for slope_start_m in STARTS_M {
        let name = format!("slope of 10° from {slope_start_m} m with things on it");
        let count = Count::of(Content::Rural, 10.0, slope_start_m);
        count.say(&name);
        // Beside things with leaves a cell or two are taken for part of them, on level ground as well.
        let few = count.clear_called_obstacle * 100 <= count.clear * 5;
        if !few || 2 * count.clear_called_free < count.clear || count.obstacles_found < 30 {
            bad.push(name);
        }
    }
    assert_eq!(bad, [""; 0], "more than 5 % of the clear cells are called obstacles, or too little is found");
}
