//! Which cells are obstacles and which are free, from a lidar sweep.

use std::collections::{HashMap, HashSet};

use fencepost_hal::{calibration::LidarCalibration, scene::TruthCell};
use nalgebra::Vector3;

use super::{
    CellIndex,
    road::{NoRoad, Road},
};

/// Where cells are judged, by their centres: metres ahead, and metres to either side.
pub(super) const AHEAD_M: (f64, f64) = (4.0, 20.0);
pub(super) const ASIDE_M: f64 = 10.0;
/// Points this much outside still tell the ground of the cells within, metres.
const MARGIN_M: f64 = 2.0;
/// Points lower or higher than this above the road are no part of the scene, metres.
const HEIGHT_M: (f64, f64) = (-2.0, 6.0);
/// Points closer than this to the camera are the vehicle's own, metres.
const LEAST_DEPTH_M: f64 = 2.0;
/// The ground of a cell is as high as this share of the points of the lowest cell around is low.
const GROUND_SHARE: f64 = 0.05;
/// Points from here to there above the ground make an obstacle, metres ...
const OBSTACLE_M: (f64, f64) = (0.3, 2.2);
/// ... if there are so many.
const OBSTACLE_POINTS: usize = 3;
/// A free cell has no point from above this height to the upper end of an obstacle, metres ...
const FREE_M: f64 = 0.2;
/// ... and so many points at least.
const FREE_POINTS: usize = 2;

/// What is really in the cells of a frame, as far as the sweep tells.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TrueCells {
    /// Cells that hold an obstacle.
    pub obstacles: HashSet<CellIndex>,
    /// Cells that are free.
    pub free: HashSet<CellIndex>,
    /// Edge of a cell, millimetres.
    pub cell_size_mm: u16,
}

impl TrueCells {
    /// What is in a cell.
    pub fn get(&self, cell: CellIndex) -> TruthCell {
        match (self.obstacles.contains(&cell), self.free.contains(&cell)) {
            (true, _) => TruthCell::Obstacle,
            (false, true) => TruthCell::Free,
            (false, false) => TruthCell::NotJudged,
        }
    }
}

/// Sorts the points of a sweep, in the lidar's frame, into cells. Only points count that both cameras see; `size` is that of the left
/// picture, px.
///
/// # Errors
/// Where no road is found to measure heights from.
///
/// # Bound
/// 400 looks at each point for the road, and the sorting of the points of each cell.
pub fn true_cells(
    sweep: &[[f32; 3]],
    calibration: &LidarCalibration,
    size: (u32, u32),
    cell_size_mm: u16,
) -> Result<TrueCells, NoRoad> {
    let cell_m = cell_size_m(cell_size_mm);
    let seen: Vec<_> = sweep.iter().map(|p| to_camera(p, calibration)).filter(|p| sees(p, calibration, size)).collect();
    let heights = heights_by_cell(&seen, &Road::find(&seen)?, cell_m);
    let lowest: HashMap<CellIndex, f64> = heights.iter().map(|(cell, heights)| (*cell, low_of(heights))).collect();
    let mut cells = TrueCells { cell_size_mm, ..TrueCells::default() };
    for (cell, heights) in heights.iter().filter(|(cell, _)| is_judged(**cell, cell_m)) {
        let ground_m = around(*cell).filter_map(|c| lowest.get(&c).copied()).fold(f64::INFINITY, f64::min);
        let above = || heights.iter().map(|height| height - ground_m);
        if above().filter(|h| (OBSTACLE_M.0..=OBSTACLE_M.1).contains(h)).count() >= OBSTACLE_POINTS {
            cells.obstacles.insert(*cell);
        } else if heights.len() >= FREE_POINTS && !above().any(|h| h > FREE_M && h <= OBSTACLE_M.1) {
            cells.free.insert(*cell);
        }
    }
    Ok(cells)
}

/// Edge of a cell in metres.
pub(super) fn cell_size_m(cell_size_mm: u16) -> f64 {
    f64::from(cell_size_mm) / 1000.0
}

/// Whether the centre of a cell lies where cells are judged.
pub(super) fn is_judged((i, j): CellIndex, cell_m: f64) -> bool {
    let centre = |index: i32| (f64::from(index) + 0.5) * cell_m;
    (AHEAD_M.0..=AHEAD_M.1).contains(&centre(i)) && centre(j).abs() <= ASIDE_M
}

/// A cell and its eight neighbours.
pub(super) fn around((i, j): CellIndex) -> impl Iterator<Item = CellIndex> {
    (-1..=1).flat_map(move |a| (-1..=1).map(move |b| (i.saturating_add(a), j.saturating_add(b))))
}

fn to_camera(point: &[f32; 3], calibration: &LidarCalibration) -> Vector3<f64> {
    let [x, y, z] = point.map(f64::from);
    Vector3::from(calibration.to_camera.map(|[a, b, c, d]| a * x + b * y + c * z + d))
}

fn sees(p: &Vector3<f64>, calibration: &LidarCalibration, (width, height): (u32, u32)) -> bool {
    let LidarCalibration { focal_px, cx, cy, baseline_m, .. } = *calibration;
    let (u, v) = (focal_px * p.x / p.z + cx, focal_px * p.y / p.z + cy);
    let disparity_px = focal_px * baseline_m / p.z;
    p.z > LEAST_DEPTH_M && u >= disparity_px && u < f64::from(width) && v >= 0.0 && v < f64::from(height)
}

/// Heights above the road, metres, of the points in each cell of the frame whose origin is on the road below the camera: x ahead
/// along the road, y to the left.
fn heights_by_cell(points: &[Vector3<f64>], road: &Road, cell_m: f64) -> HashMap<CellIndex, Vec<f64>> {
    let up = road.normal;
    let ahead = (Vector3::z() - up.z * up).normalize();
    let left = up.cross(&ahead);
    let mut heights: HashMap<CellIndex, Vec<f64>> = HashMap::new();
    for p in points {
        let (x, y, z) = (p.dot(&ahead), p.dot(&left), p.dot(&up) + road.offset_m);
        let within = x > AHEAD_M.0 - MARGIN_M && x < AHEAD_M.1 + MARGIN_M && y.abs() < ASIDE_M + MARGIN_M;
        if within && z > HEIGHT_M.0 && z < HEIGHT_M.1 {
            let cell = ((x / cell_m).floor() as i32, (y / cell_m).floor() as i32);
            heights.entry(cell).or_default().push(z);
        }
    }
    heights
}

/// The height below which [`GROUND_SHARE`] of the heights lie, between two of them as on a straight line.
fn low_of(heights: &[f64]) -> f64 {
    let mut sorted = heights.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = sorted.len().saturating_sub(1) as f64 * GROUND_SHARE;
    let at = |index: usize| sorted.get(index).or(sorted.last()).copied().unwrap_or(f64::INFINITY);
    let (low, high, share) = (at(place as usize), at(place as usize + 1), place.fract());
    // From the nearer end, so that neither is missed by a rounding.
    if share < 0.5 { low + (high - low) * share } else { high - (high - low) * (1.0 - share) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lidar in the place of the camera, with the camera's axes.
    const CALIBRATION: LidarCalibration = LidarCalibration {
        focal_px: 500.0,
        cx: 500.0,
        cy: 200.0,
        baseline_m: 0.5,
        to_camera: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
    };
    const SIZE: (u32, u32) = (1000, 400);
    const HEIGHT_OF_CAMERA_M: f32 = 1.6;

    /// Points on the road every 0.1 m, seen from 1.6 m above; `stands` adds points at `(x, y, z)` of the vehicle.
    fn sweep(stands: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let road =
            (30..240).flat_map(|i| (-110..110).map(move |j| [i as f32 * 0.1 + 0.03, j as f32 * 0.1 + 0.03, 0.0]));
        let camera = |[x, y, z]: [f32; 3]| [-y, HEIGHT_OF_CAMERA_M - z, x];
        road.chain(stands.iter().copied()).map(camera).collect()
    }

    fn cells(stands: &[[f32; 3]]) -> TrueCells {
        true_cells(&sweep(stands), &CALIBRATION, SIZE, 500).unwrap()
    }

    fn post(x: f32, y: f32, heights_m: &[f32]) -> Vec<[f32; 3]> {
        heights_m.iter().map(|z| [x, y, *z]).collect()
    }

    #[test]
    fn open_road_is_free_as_far_as_it_is_judged_and_seen() {
        let TrueCells { obstacles, free, .. } = cells(&[]);
        assert!(obstacles.is_empty());
        for i in 8..40 {
            for j in -20..20_i32 {
                // Left of the right picture's border nothing is judged: 5 px of 500 at 1 m aside and 100 m ahead.
                let left_edge_m = (f64::from(i) + 0.5) * 0.5 - 0.5;
                let far_aside = f64::from(j.max(-j - 1) + 1) * 0.5 > left_edge_m - 0.6;
                assert!(far_aside || free.contains(&(i, j)), "({i}, {j})");
            }
        }
        assert!(free.iter().all(|(i, j)| (8..40).contains(i) && (-20..20).contains(j)), "nothing outside is judged");
    }

    #[test]
    fn three_points_of_the_right_height_make_an_obstacle() {
        for (heights, obstacle, free) in [
            (&[0.31, 0.6, 2.1][..], true, false),
            (&[0.31, 0.6], false, false),
            (&[0.25, 0.28, 0.29], false, false),
            (&[0.15, 0.18, 0.19], false, true),
            (&[2.3, 2.5, 3.0], false, true),
        ] {
            let cells = cells(&post(10.2, 1.2, heights));
            assert_eq!(
                (cells.obstacles.contains(&(20, 2)), cells.free.contains(&(20, 2))),
                (obstacle, free),
                "{heights:?}"
            );
        }
    }

    #[test]
    fn what_only_one_camera_sees_does_not_count() {
        // At 10 m the left picture shows 10 m to the left, the right one half a metre less.
        let (seen, not_seen) = (post(10.2, 9.3, &[0.5, 0.7, 0.9]), post(10.2, 9.9, &[0.5, 0.7, 0.9]));
        assert!(cells(&seen).obstacles.contains(&(20, 18)));
        assert!(!cells(&not_seen).obstacles.contains(&(20, 19)));
    }

    #[test]
    fn ground_is_the_lowest_around() {
        // A platform 0.25 m high over four cells: seen beside the road its edge is no free ground.
        let platform: Vec<_> = (0..20)
            .flat_map(|a| (0..20).map(move |b| [12.0 + a as f32 * 0.1 + 0.04, b as f32 * 0.1 + 0.04, 0.25]))
            .collect();
        let camera = |p: &[f32; 3]| [-p[1], HEIGHT_OF_CAMERA_M - p[2], p[0]];
        let mut points = sweep(&[]);
        points.retain(|p| !(p[2] >= 12.0 && p[2] < 14.0 && -p[0] >= 0.0 && -p[0] < 2.0));
        points.extend(platform.iter().map(camera));
        let cells = true_cells(&points, &CALIBRATION, SIZE, 500).unwrap();
        assert!(!cells.free.contains(&(24, 0)) && !cells.obstacles.contains(&(24, 0)), "its edge is neither");
        assert!(cells.free.contains(&(25, 1)), "its middle is measured from itself");
    }

    #[test]
    fn the_low_share_lies_between_two_heights() {
        let heights: Vec<f64> = (0..11).map(|i| f64::from(10 - i)).collect();
        assert!((low_of(&heights) - 0.5).abs() < 1.0e-12);
        assert_eq!(low_of(&[3.0]), 3.0);
        assert!((low_of(&[1.0, 2.0]) - 1.05).abs() < 1.0e-12);
    }
}
