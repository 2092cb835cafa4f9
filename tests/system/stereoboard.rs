//! Tiny pictures: screens and a cylinder seen by a camera with 128 x 96 pixels that was carried by hand.
//!
//! Distances are held against those that plain block matching of a box drawn by hand gives with the recording's own calibration:
//! the whole box is shifted, so that it needs neither window nor validation. The calibration itself is inferred and about 6 %
//! right.

use fencepost::detector::ProgramDetector;
use fencepost_core::{
    health::{HealthLevel, HealthReason},
    map::CellState,
    picture::Picture,
};
use fencepost_tests::{at_hand, replay, say};

/// Focal length times baseline, px m: from the recordings' `calib.txt`.
const FOCAL_BASELINE_PX_M: f32 = 7.7154;

/// Least share of the frames.
const FOUND: f64 = 0.95;

/// Columns and rows of the left picture, px; the ends are not in it.
type Box = [usize; 4];

/// Frames of take18 that show the screen, which then leaves to the left. It takes a quarter of the last one.
const SCREEN_FRAMES: std::ops::Range<usize> = 0..26;

/// The cylinder in take1, drawn by hand: from which frame on, and where. From frame 23 on it is nearer than 0.4 m.
const CYLINDER: [(usize, Box); 10] = [
    (0, [59, 73, 26, 78]),
    (14, [55, 69, 24, 80]),
    (15, [56, 71, 22, 80]),
    (16, [57, 74, 20, 84]),
    (17, [55, 74, 12, 88]),
    (18, [53, 76, 6, 90]),
    (19, [49, 76, 4, 92]),
    (20, [49, 83, 4, 92]),
    (21, [44, 93, 4, 92]),
    (22, [32, 98, 4, 92]),
];
const CYLINDER_NEAR: usize = 23;

/// The wall with a grid at the end of the corridor in take21, where no frame shows anything else; its edge is in it, since the
/// grid by itself matches every few pixels.
const WALL: [(usize, Box); 4] =
    [(0, [44, 80, 12, 66]), (12, [38, 82, 10, 66]), (18, [32, 90, 10, 74]), (22, [24, 96, 10, 80])];

#[test]
fn the_screen_is_found_at_one_metre() {
    let Some(folder) = at_hand::recording("stereoboard-take18") else { return };
    let (mut frame, mut found) = (0, 0);
    replay::for_each_detection(&folder, |detector, _| {
        if SCREEN_FRAMES.contains(&frame) {
            // Turned by some degrees it reaches from 0.95 m to 1.3 m; 0.2 m more or less is what the calibration leaves open.
            let cells = obstacle_cells(detector);
            let there = cells.iter().any(|cell| cell.reaches([0.75, 1.25], [-0.6, 0.6]));
            let nearer = cells.iter().find(|cell| cell.x_m[1] <= 0.75);
            found += usize::from(there && nearer.is_none());
            if !there || nearer.is_some() {
                say!("take18 {frame}: screen found {there}, before it {nearer:?}");
            }
        }
        frame += 1;
    });
    judge("stereoboard-take18: the screen at 1 m", found, SCREEN_FRAMES.len());
}

#[test]
fn the_cylinder_is_found_at_its_distance() {
    let Some(folder) = at_hand::recording("stereoboard-take1") else { return };
    let (mut frame, mut found, mut blocked) = (0, 0, 0);
    replay::for_each_detection(&folder, |detector, pair| {
        if frame < CYLINDER_NEAR {
            let [x0, x1, y0, y1] = at(&CYLINDER, frame);
            let disparity_px = plain_disparity_px(&pair.left, &pair.right, [x0, x1, y0, y1], 1..16);
            let distance_m = FOCAL_BASELINE_PX_M / disparity_px;
            // Half a cell, and what a quarter of a pixel makes of the distance.
            let slack_m = 0.25 + distance_m * (0.25 / disparity_px);
            let aside = |column: usize| (64.0 - column as f32) * distance_m / 116.9;
            let (x_m, y_m) = ([distance_m - slack_m, distance_m + slack_m], [aside(x1), aside(x0)]);
            let cells = obstacle_cells(detector);
            let there = cells.iter().any(|cell| cell.reaches(x_m, y_m));
            // Nothing before it, in its direction.
            let nearer = cells.iter().find(|cell| cell.x_m[1] < x_m[0] && cell.reaches([0.0, x_m[0]], y_m));
            found += usize::from(there && nearer.is_none());
            if !there || nearer.is_some() {
                say!("take1 {frame}: cylinder at {distance_m:.2} m found {there}, before it {nearer:?}");
            }
        } else {
            // Too near for the disparity range: nobody is told that all is well and the way free.
            let health = detector.detection().health;
            assert!(health.level > HealthLevel::Ok && !free_ahead(detector), "take1 {frame}: {health:?}");
            blocked += usize::from(health.has(HealthReason::NearZoneBlocked));
        }
        frame += 1;
    });
    let near = frame - CYLINDER_NEAR;
    say!(
        "stereoboard-take1: in {near} frames it is too near for the disparity range, which {blocked} of them name as the cause"
    );
    judge("stereoboard-take1: the cylinder at its distance", found, CYLINDER_NEAR);
}

#[test]
fn the_corridor_is_free_of_obstacles() {
    let Some(folder) = at_hand::recording("stereoboard-take21") else { return };
    let (mut frame, mut clear, mut judged, mut alarms, mut called_free) = (0, 0, 0, 0, 0);
    replay::for_each_detection(&folder, |detector, pair| {
        let disparity_px = plain_disparity_px(&pair.left, &pair.right, at(&WALL, frame), 1..5);
        let wall_m = FOCAL_BASELINE_PX_M / disparity_px;
        // Up to a cell before the wall. To the right of the middle nothing stands within half a metre in any frame; to the left
        // the screen begins at 0.45 m and 2.7 m ahead of the first frame.
        let map = &detector.detection().map;
        let mut wrong = Vec::new();
        for (index, cell) in map.cells.iter().enumerate() {
            let place = Place::of(detector, index);
            let [near_m, far_m] = place.x_m;
            let right = place.y_m[0] >= -0.5 && place.y_m[1] <= 0.0;
            let left = place.y_m[0] >= 0.0 && place.y_m[1] <= 0.5 && frame < 5 && far_m <= 2.5;
            if near_m < 0.5 || far_m > wall_m - 0.5 || !(right || left) {
                continue;
            }
            judged += 1;
            called_free += usize::from(cell.state == CellState::Free);
            if cell.state == CellState::Obstacle {
                wrong.push((place.x_m[0], place.y_m[0]));
            }
        }
        alarms += wrong.len();
        clear += usize::from(wrong.is_empty());
        if !wrong.is_empty() {
            say!("take21 {frame}: wall at {wall_m:.2} m, obstacles in the corridor at {wrong:?}");
        }
        frame += 1;
    });
    say!(
        "stereoboard-take21: {alarms} of {judged} cells in the free corridor are called obstacles, {called_free} free; \
         {clear} of {frame} frames have none"
    );
    assert!(judged > 60, "{judged} cells");
    // The aim is none. In frames 0 to 4 the pixels are too coarse for the net on the wall: gradients differ by 7 grey values at 6 px,
    // and by 15 at the true 1.4 px, no less than anywhere else. What the pictures do not show, no matching finds. In frame 17 the
    // net repeats every 3.5 px. The others are half a pixel nearer than the wall.
    assert!(alarms <= 18, "{alarms} obstacle cells in the free corridor");
}

/// An obstacle cell: its ends ahead and to the left.
#[derive(Clone, Copy, Debug)]
struct Place {
    x_m: [f32; 2],
    y_m: [f32; 2],
}

impl Place {
    fn of(detector: &ProgramDetector, index: usize) -> Self {
        let geometry = &detector.detection().map.geometry;
        let (i, j) = geometry.cell_at(index);
        let size = geometry.cell_size_m();
        let ends = |n: i16| [f32::from(n) * size, (f32::from(n) + 1.0) * size];
        Self { x_m: ends(i), y_m: ends(j) }
    }

    /// Whether it has a point in common with a field.
    fn reaches(&self, x_m: [f32; 2], y_m: [f32; 2]) -> bool {
        let common = |a: [f32; 2], b: [f32; 2]| a[0] < b[1] && b[0] < a[1];
        common(self.x_m, x_m) && common(self.y_m, y_m)
    }
}

fn obstacle_cells(detector: &ProgramDetector) -> Vec<Place> {
    let cells = &detector.detection().map.cells;
    let is_obstacle = |index: &usize| cells[*index].state == CellState::Obstacle;
    (0..cells.len()).filter(is_obstacle).map(|index| Place::of(detector, index)).collect()
}

/// Whether a cell straight ahead within a metre is called free.
fn free_ahead(detector: &ProgramDetector) -> bool {
    let cells = &detector.detection().map.cells;
    let is_free = |index: &usize| cells[*index].state == CellState::Free;
    (0..cells.len()).filter(is_free).any(|index| Place::of(detector, index).reaches([0.0, 1.0], [-0.5, 0.5]))
}

/// The box of a frame: that of the last entry that begins with it or before.
fn at(table: &[(usize, Box)], frame: usize) -> Box {
    table.iter().rev().find(|(first, _)| *first <= frame).expect("a box for each frame").1
}

/// The shift at which a box of the left picture fits the right one best: the sum of absolute differences of the horizontal
/// gradient, refined by a parabola.
fn plain_disparity_px(
    left: &Picture<'_>,
    right: &Picture<'_>,
    [x0, x1, y0, y1]: Box,
    range: std::ops::Range<usize>,
) -> f32 {
    let gradient = |picture: &Picture<'_>, x: usize, y: usize| {
        let row = picture.row(y);
        i32::from(row[x + 1]) - i32::from(row[x - 1])
    };
    let cost = |shift: usize| {
        let columns = x0.max(shift + 1)..x1;
        let count = (columns.len() * (y1 - y0)) as f32;
        let sum: i32 = columns
            .flat_map(|x| (y0..y1).map(move |y| (x, y)))
            .map(|(x, y)| (gradient(left, x, y) - gradient(right, x - shift, y)).abs())
            .sum();
        sum as f32 / count
    };
    let best = range.clone().min_by(|a, b| cost(*a).total_cmp(&cost(*b))).expect("a range that is not empty");
    let [a, b, c] = [best - 1, best, best + 1].map(cost);
    let bend = a - 2.0 * b + c;
    let part = if bend > 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 };
    best as f32 + part
}

fn judge(what: &str, found: usize, of: usize) {
    let share = found as f64 / of as f64;
    say!("{what}: found in {found} of {of} frames, {:.1} % (at least 95 %)", 100.0 * share);
    assert!(share >= FOUND, "{what}: {found} of {of} frames");
}
