//! Whether obstacle cells stay where they are from frame to frame.

use std::{collections::BTreeSet, path::Path};

use fencepost_core::{
    geometry::{RectifiedPair, VehicleFrame},
    map::MapGeometry,
};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion};

/// The number of a cell along x and along y.
pub type CellNumber = (i16, i16);

/// What became of the cells of one frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Steadiness {
    /// Cells that were obstacles in the frame before and in the frame after, and can be seen in this one.
    pub expected: BTreeSet<CellNumber>,
    /// Those of them without an obstacle in this frame.
    pub missing: BTreeSet<CellNumber>,
}

/// The obstacle cells of a frame, with the pose of its camera.
#[derive(Clone, Debug)]
pub struct ObstacleCells {
    /// Left camera to world.
    pub pose: Isometry3<f64>,
    /// Numbers of the cells.
    pub cells: BTreeSet<CellNumber>,
}

/// How the cameras see the cells, the same in all frames of a sequence.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Where the cells lie.
    pub geometry: MapGeometry,
    /// The rectified pair.
    pub pair: RectifiedPair,
    /// How the left camera sits on the vehicle.
    pub frame: VehicleFrame,
    /// Largest disparity that can be found, px.
    pub largest_disparity_px: f32,
    /// Heights above the ground between which something is an obstacle, metres.
    pub obstacle_heights_m: (f32, f32),
    /// Distance from the camera up to which cells count, metres.
    pub range_m: f32,
}

impl Steadiness {
    /// Compares a frame with its neighbours.
    ///
    /// A cell is expected if the centre of an obstacle cell of the frame before, carried into this frame by the poses, lies in
    /// it, and that of one of the frame after in it or one of the eight around it; and if [`Sight::sees`] it. It is missing if
    /// neither it nor one of the eight around it is an obstacle in this frame. One cell of tolerance is what the rounding to
    /// cells takes: a point that is carried lies up to half a cell from where the thing in its cell is, along both axes, and
    /// cells have borders.
    ///
    /// # Bound
    /// 18 look-ups for each cell of the frame before.
    pub fn of(before: &ObstacleCells, now: &ObstacleCells, after: &ObstacleCells, sight: &Sight) -> Self {
        let carried = |other: &ObstacleCells| -> BTreeSet<CellNumber> {
            other.cells.iter().filter_map(|cell| sight.carry(*cell, &other.pose, &now.pose)).collect()
        };
        let (before, after) = (carried(before), carried(after));
        let expected: BTreeSet<_> =
            before.into_iter().filter(|cell| sight.sees(*cell) && has_near(&after, *cell)).collect();
        let missing = expected.iter().copied().filter(|cell| !has_near(&now.cells, *cell)).collect();
        Self { expected, missing }
    }
}

impl Sight {
    /// The cell of the frame at `to` in which the centre of a cell of the frame at `from` lies, on the ground of the mount.
    fn carry(&self, (i, j): CellNumber, from: &Isometry3<f64>, to: &Isometry3<f64>) -> Option<CellNumber> {
        let (x, y) = self.geometry.centre_m(i, j);
        let world = from * self.in_camera([x, y, 0.0]).map(f64::from);
        let seen = to.inverse_transform_point(&world).map(|metres| metres as f32);
        let [x, y, _] = self.frame.point(seen.into());
        let size = self.geometry.cell_size_m();
        let cell = ((x / size).floor() as i16, (y / size).floor() as i16);
        self.geometry.index(cell.0, cell.1).map(|_| cell)
    }

    /// Whether what stands in a cell can be found: all of the cell lies in the range that counts, not nearer than the disparity
    /// range reaches, within the columns that both cameras see, and a height at which something is an obstacle lies between the
    /// upper and the lower edge of the picture.
    pub fn sees(&self, (i, j): CellNumber) -> bool {
        let (x, y) = self.geometry.centre_m(i, j);
        let half = 0.5 * self.geometry.cell_size_m();
        let [camera_x, camera_y, _] = self.frame.origin_m();
        let corners = [(-half, -half), (-half, half), (half, -half), (half, half)].map(|(dx, dy)| (x + dx, y + dy));
        let (low_m, high_m) = self.obstacle_heights_m;
        corners.into_iter().all(|(x, y)| {
            let [top, foot] = [high_m, low_m].map(|z| self.in_camera([x, y, z]));
            let disparity_px = self.pair.disparity_px(foot.z);
            let u = self.pair.cx + self.pair.focal_px * foot.x / foot.z;
            let [v_top, v_foot] = [top, foot].map(|p| self.pair.cy + self.pair.focal_px * p.y / p.z);
            (x - camera_x).hypot(y - camera_y) <= self.range_m
                && foot.z > 0.0
                && disparity_px <= self.largest_disparity_px
                && u - disparity_px >= 0.0
                && u <= self.pair.width as f32 - 1.0
                && v_foot >= 0.0
                && v_top <= self.pair.height as f32 - 1.0
        })
    }

    fn in_camera(&self, vehicle_m: [f32; 3]) -> Point3<f32> {
        let origin = self.frame.origin_m();
        self.frame.to_camera(std::array::from_fn(|k| vehicle_m[k] - origin[k])).into()
    }
}

/// The poses of a recording's `poses.txt`: a line for each frame, the twelve numbers of a 3 x 4 matrix that takes points of the
/// left camera into the world, row by row.
///
/// # Panics
/// When the file cannot be read, or a line holds something else.
pub fn poses(file: &Path) -> Vec<Isometry3<f64>> {
    let place = file.display();
    let text = std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{place}: {error}"));
    let pose = |(index, line): (usize, &str)| {
        let numbers: Vec<f64> = line.split_whitespace().map_while(|word| word.parse().ok()).collect();
        assert_eq!(numbers.len(), 12, "{place}: line {}", index + 1);
        let at = |row: usize, column: usize| numbers[4 * row + column];
        let rotation = Rotation3::from_matrix(&Matrix3::from_fn(at));
        let translation = Translation3::new(at(0, 3), at(1, 3), at(2, 3));
        Isometry3::from_parts(translation, UnitQuaternion::from_rotation_matrix(&rotation))
    };
    text.lines().enumerate().map(pose).collect()
}

fn has_near(cells: &BTreeSet<CellNumber>, (i, j): CellNumber) -> bool {
    (-1..=1).any(|a| (-1..=1).any(|b| cells.contains(&(i + a, j + b))))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use fencepost_core::geometry::Mount;
    use nalgebra::Vector3;

    use super::*;

    /// A camera 1 m up that looks ahead: 500 px to either side, 500 px focal length, a baseline of 0.1 m.
    fn sight() -> Sight {
        let pair = RectifiedPair {
            width: 1001,
            height: 1001,
            focal_px: 500.0,
            cx: 500.0,
            cy: 500.0,
            baseline_m: 0.1,
            disparity_offset_px: 0.0,
        };
        let frame = VehicleFrame::new(&Mount { height_m: Some(1.0), ..Mount::default() }).unwrap();
        let geometry = MapGeometry::default();
        Sight { geometry, pair, frame, largest_disparity_px: 25.0, obstacle_heights_m: (0.3, 2.2), range_m: 15.0 }
    }

    /// A camera `ahead_m` ahead of the world's origin and turned to the left.
    fn frame(ahead_m: f64, left_rad: f64, cells: &[CellNumber]) -> ObstacleCells {
        let turn = UnitQuaternion::from_axis_angle(&-Vector3::y_axis(), left_rad);
        let pose = Isometry3::from_parts(Translation3::new(0.0, 0.0, ahead_m), turn);
        ObstacleCells { pose, cells: cells.iter().copied().collect() }
    }

    fn counts(before: &ObstacleCells, now: &ObstacleCells, after: &ObstacleCells) -> (usize, usize) {
        let steadiness = Steadiness::of(before, now, after, &sight());
        (steadiness.expected.len(), steadiness.missing.len())
    }

    #[test]
    fn a_thing_that_is_passed_is_steady_if_it_is_there_every_time() {
        // 1 m, two cells, from frame to frame.
        let [before, after] = [frame(0.0, 0.0, &[(12, 3)]), frame(2.0, 0.0, &[(8, 3)])];
        assert_eq!(counts(&before, &frame(1.0, 0.0, &[(10, 3)]), &after), (1, 0));
        assert_eq!(counts(&before, &frame(1.0, 0.0, &[(11, 2)]), &after), (1, 0), "one cell off");
        assert_eq!(counts(&before, &frame(1.0, 0.0, &[(12, 3)]), &after), (1, 1), "two cells off");
        assert_eq!(counts(&before, &frame(1.0, 0.0, &[]), &after), (1, 1), "gone");
    }

    #[test]
    fn a_cell_must_be_there_before_and_after() {
        let (once, gone) = (frame(0.0, 0.0, &[(12, 3)]), frame(0.0, 0.0, &[]));
        assert_eq!(counts(&once, &gone, &gone), (0, 0), "before alone");
        assert_eq!(counts(&gone, &gone, &once), (0, 0), "after alone");
        assert_eq!(counts(&once, &gone, &frame(0.0, 0.0, &[(13, 4)])), (1, 1), "within a cell");
        assert_eq!(counts(&once, &gone, &frame(0.0, 0.0, &[(14, 3)])), (0, 0), "elsewhere");
    }

    #[test]
    fn turning_cameras_carry_cells_around() {
        // Seen ahead by a camera that looks to the left: to the left of one that looks ahead, out of its view.
        let left = frame(0.0, FRAC_PI_2, &[(10, 0)]);
        let carried = sight().carry((10, 0), &left.pose, &frame(0.0, 0.0, &[]).pose);
        assert_eq!(carried, Some((-1, 10)).filter(|_| sight().geometry.index(-1, 10).is_some()));
        let half = frame(0.0, FRAC_PI_2 / 2.0, &[]);
        // (5.25, 0.25) turned by 45 degrees: (3.54, 3.89).
        assert_eq!(sight().carry((10, 0), &half.pose, &frame(0.0, 0.0, &[]).pose), Some((7, 7)));
    }

    #[test]
    fn only_what_can_be_seen_counts() {
        let sight = sight();
        assert!(sight.sees((10, 0)), "5 m ahead");
        assert!(!sight.sees((3, 0)), "nearer than 2 m, where the disparity is above 25 px");
        assert!(sight.sees((4, 0)));
        assert!(!sight.sees((30, 0)), "beyond 15 m");
        assert!(sight.sees((28, 0)));
        // The view is 45 degrees to either side; the left-most 10 px at 5 m are seen by one camera alone.
        assert!(sight.sees((10, -10)) && !sight.sees((10, -11)), "right edge");
        assert!(sight.sees((10, 8)) && !sight.sees((10, 9)), "left edge");
        // A camera high up, which sees nothing below it.
        let frame = VehicleFrame::new(&Mount { height_m: Some(12.0), ..Mount::default() }).unwrap();
        assert!(!Sight { frame, ..sight }.sees((10, 0)), "below the picture");
        assert!(Sight { frame, ..sight }.sees((25, 0)));
    }
}
