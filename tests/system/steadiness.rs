//! Obstacle cells stay from frame to frame where nothing but the vehicle moves.

use fencepost::config::Config;
use fencepost_core::{geometry::VehicleFrame, map::CellState};
use fencepost_hal::recording::Recording;
use fencepost_tests::{
    at_hand, replay, say,
    steadiness::{ObstacleCells, Sight, Steadiness, poses},
};

/// Distance from the camera within which cells must be steady, metres.
const RANGE_M: f32 = 15.0;

/// Greatest share of the cells that may be missing.
const MISSING: f64 = 0.03;

#[test]
fn obstacle_cells_are_steady_in_a_residential_road() {
    check("kitti-urban");
}

#[test]
fn obstacle_cells_are_steady_in_a_country_road() {
    check("kitti-rural");
}

fn check(name: &str) {
    let Some(folder) = at_hand::recording(name) else { return };
    let poses = poses(&folder.join("poses.txt"));
    let sight = sight(&folder);
    let mut frames = Vec::new();
    replay::for_each_detection(&folder, |detector, _| {
        let map = &detector.detection().map;
        let is_obstacle = |index: &usize| map.cells[*index].state == CellState::Obstacle;
        let cells = (0..map.cells.len()).filter(is_obstacle).map(|index| map.geometry.cell_at(index)).collect();
        frames.push(ObstacleCells { pose: poses[frames.len()], cells });
    });
    let (mut expected, mut missing) = (0, 0);
    for (index, neighbours) in frames.windows(3).enumerate() {
        let [before, now, after] = neighbours else { unreachable!("three in a window") };
        let steadiness = Steadiness::of(before, now, after, &sight);
        let where_m: Vec<_> = steadiness.missing.iter().map(|(i, j)| sight.geometry.centre_m(*i, *j)).collect();
        let frame = index + 1;
        say!("{name} {frame}: {} of {} cells missing {where_m:?}", steadiness.missing.len(), steadiness.expected.len());
        expected += steadiness.expected.len();
        missing += steadiness.missing.len();
    }
    let share = missing as f64 / expected.max(1) as f64;
    let percent = 100.0 * share;
    say!(
        "{name}: {missing} of {expected} obstacle cells missing between two frames that have them: {percent:.1} % (at most 3 %)"
    );
    // Beside a country road there is little within that range: the edge of a meadow.
    assert!(expected >= 15, "{name} has something to find: {expected} cells");
    assert!(share <= MISSING, "{name}: {missing} of {expected} cells missing, {percent:.1} %");
}

/// What the cameras of a recording can see, with the program's settings.
fn sight(folder: &std::path::Path) -> Sight {
    let recording = Recording::open(folder).unwrap();
    let fencepost_core::geometry::StereoCalibration::Rectified(pair) = recording.calibration.stereo else {
        panic!("{} is not rectified", folder.display())
    };
    let settings = Config::default().settings_for(pair.width);
    let matching = settings.matching;
    Sight {
        geometry: settings.map.geometry,
        pair,
        frame: VehicleFrame::new(&recording.mount).unwrap(),
        // The last disparity has no neighbour to interpolate with and is never reported.
        largest_disparity_px: f32::from(matching.min_disparity + matching.disparities - 2),
        obstacle_heights_m: (settings.obstacles.min_height_m, settings.obstacles.clearance_m),
        range_m: RANGE_M,
    }
}
