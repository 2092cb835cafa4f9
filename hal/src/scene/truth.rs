//! What is really there: the disparity of every pixel, and which cells hold an obstacle.

use fencepost_core::map::MapGeometry;

use super::Scene;
use super::ground::Ground;
use super::layout::{COURSE, side, spot};
use super::mesh::Mesh;
use super::noise::floor;
use super::optics::{Eye, Pose};
use super::parallel::for_each_chunk;
use super::render::Hit;
use super::sky;
use super::vector::v3;

/// What is really in a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TruthCell {
    /// Not told: not seen by both cameras, too far, or neither clearly an obstacle nor clearly free.
    #[default]
    NotJudged,
    /// The left camera sees ground there, and nothing higher than 0.2 m stands there.
    Free,
    /// The left camera sees parts of a thing there, from 0.3 m to 2.2 m above the ground.
    Obstacle,
}

/// The cells of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct TruthCells {
    /// Where the cells lie.
    pub geometry: MapGeometry,
    /// The cells, in the order of [`MapGeometry::index`].
    pub cells: Vec<TruthCell>,
    /// Least distance ahead of cells that are judged, metres.
    pub nearest_m: f32,
    /// Greatest distance ahead of cells that are judged, metres: where the disparity is 5 px.
    pub farthest_m: f32,
    /// Greatest distance to either side of cells that are judged, metres.
    pub aside_m: f32,
}

/// What is really in a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Disparity of each pixel of the left picture of the ideal pair ([`SceneOptions::ideal_pair`](super::SceneOptions::ideal_pair)),
    /// in 1/256 px; 0 where there is none (sky). KITTI's convention.
    pub disparity: Vec<u16>,
    /// Whether the point that a pixel of the left picture sees is hidden from the right camera, or outside its picture.
    pub occluded: Vec<bool>,
    /// The cells.
    pub cells: TruthCells,
}

/// Disparity below which cells are not judged, px.
const LEAST_DISPARITY_PX: f32 = 5.0;
const NEAREST_M: f32 = 1.5;
const ASIDE_M: f32 = 10.0;
/// Heights above the local ground, metres, that make a cell an obstacle or free: those by which lidar sweeps are judged.
const OBSTACLE_M: core::ops::RangeInclusive<f32> = 0.3..=2.2;
const HIGH_M: core::ops::RangeInclusive<f32> = 0.2..=2.2;
/// Pixels that both cameras see. What covers fewer than this is smaller than a quarter of a 7 x 7 matching window.
const OBSTACLE_PIXELS: u32 = 12;
const FREE_PIXELS: u32 = 2;
/// Ground so near before the foot of a thing does not hide it, metres: it is rough, and the line of sight grazes it.
const FOOT_SLACK_M: f32 = 0.3;
/// Spacing of the places in [`high_places`], metres.
pub(crate) const MARK_M: f32 = 0.05;

#[derive(Clone, Copy, Default)]
struct Seen {
    disparity: u16,
    hidden: bool,
    /// The cell and the height above the ground, where there is a point at all.
    place: Option<(usize, f32, bool)>,
}

#[derive(Clone, Copy, Default)]
struct Tally {
    ground: u32,
    obstacle: u32,
    high: bool,
}

impl Scene {
    /// The truth of a frame.
    ///
    /// # Bound
    /// Two rays a pixel.
    pub fn truth(&self, frame: u32) -> Truth {
        let (width, height) = (self.options.width as usize, self.options.height as usize);
        let pose = self.pose(frame);
        let (left, right) = Eye::ideal_pair(&self.options, &self.frame, pose);
        let mut seen = vec![Seen::default(); width * height];
        for_each_chunk(&mut seen, width, |y, row| {
            for (x, pixel) in row.iter_mut().enumerate() {
                *pixel = self.see(&left, &right, pose, x as f32, y as f32);
            }
        });
        Truth {
            disparity: seen.iter().map(|pixel| pixel.disparity).collect(),
            occluded: seen.iter().map(|pixel| pixel.hidden).collect(),
            cells: self.judge(&seen, pose),
        }
    }

    /// The cell of the map in which the middle of a thing of [`COURSE`] stands in a frame, if it is on the map.
    ///
    /// The scene must be one with [`Content::Course`](super::Content::Course): others have nothing there.
    pub fn course_cell(&self, thing: usize, frame: u32) -> Option<(i16, i16)> {
        let (_, x, aside_m) = *COURSE.get(thing)?;
        let v = self.pose(frame).to_vehicle(spot(&self.ground, side(self.options.seed), x, aside_m));
        self.cell(v.x, v.y).map(|index| self.options.map.cell_at(index))
    }

    /// Whether a crest hides the foot of a thing of [`COURSE`] from the left camera in a frame: of what stands behind it only the top
    /// shows, if anything.
    ///
    /// The scene must be one with [`Content::Course`](super::Content::Course): others have nothing there.
    pub fn course_foot_is_hidden(&self, thing: usize, frame: u32) -> bool {
        let Some((_, x, aside_m)) = COURSE.get(thing) else { return true };
        let (left, _) = Eye::ideal_pair(&self.options, &self.frame, self.pose(frame));
        let foot = spot(&self.ground, side(self.options.seed), *x, *aside_m);
        let (column, row, depth_m) = left.project(foot);
        let met_m = self.ground.meet(left.origin, left.look(column, row));
        // The foot itself is ground: what is met well before it lies in the way.
        met_m.is_some_and(|met_m| met_m < depth_m - FOOT_SLACK_M)
    }

    fn see(&self, left: &Eye, right: &Eye, pose: Pose, x: f32, y: f32) -> Seen {
        let look = left.look(x, y);
        let (depth_m, thing) = match self.meet(left.origin, look) {
            Hit::Ground(t) => (t, false),
            Hit::Thing(hit) => (hit.t, true),
            Hit::Far => {
                let pixel_rad = 0.5 / left.focal_px();
                match sky::far(left.origin, look, pixel_rad, self.options.seed).1 {
                    Some(t) => (t, false),
                    None => return Seen::default(),
                }
            }
        };
        let disparity_px = self.options.focal_px * self.options.baseline_m / depth_m;
        let disparity = (disparity_px * 256.0 + 0.5).clamp(0.0, 65535.0) as u16;
        let p = left.origin + look * depth_m;
        let hidden = x - disparity_px < 0.0 || self.hides(right, p);
        let v = pose.to_vehicle(p);
        let above_m = p.z - self.ground.height(p.x, p.y);
        let place = self.cell(v.x, v.y).map(|index| (index, above_m, thing));
        // Cells are judged by what both cameras see.
        let place = if hidden { None } else { place };
        Seen { disparity, hidden, place }
    }

    fn hides(&self, eye: &Eye, p: super::vector::V3) -> bool {
        let (px, py, depth_m) = eye.project(p);
        let look = eye.look(px, py);
        let reach = depth_m - 0.004 - 0.002 * depth_m;
        self.bvh.blocks(eye.origin, look, 0.05, reach)
            || self.ground.meet(eye.origin, look).is_some_and(|t| t < reach - 0.03)
    }

    fn cell(&self, x: f32, y: f32) -> Option<usize> {
        let size = self.options.map.cell_size_m();
        let (i, j) = (floor(x / size), floor(y / size));
        self.options.map.index(i16::try_from(i).ok()?, i16::try_from(j).ok()?)
    }

    fn judge(&self, seen: &[Seen], pose: Pose) -> TruthCells {
        let geometry = self.options.map;
        let mut tallies = vec![Tally::default(); geometry.len()];
        for (index, above_m, thing) in seen.iter().filter_map(|pixel| pixel.place) {
            let tally = &mut tallies[index];
            if !thing {
                tally.ground += 1;
            } else if OBSTACLE_M.contains(&above_m) {
                tally.obstacle += 1;
            }
        }
        for (i, j) in &self.high {
            let (x, y) = ((f32::from(*i) + 0.5) * MARK_M, (f32::from(*j) + 0.5) * MARK_M);
            let v = pose.to_vehicle(v3(x, y, self.ground.height(x, y)));
            if let Some(index) = self.cell(v.x, v.y) {
                tallies[index].high = true;
            }
        }
        let farthest_m = self.options.focal_px * self.options.baseline_m / LEAST_DISPARITY_PX;
        let mut cells = TruthCells { geometry, cells: Vec::new(), nearest_m: NEAREST_M, farthest_m, aside_m: ASIDE_M };
        cells.cells = (0..)
            .zip(&tallies)
            .map(|(index, tally)| {
                let (i, j) = geometry.cell_at(index);
                if !cells.judges(i, j) {
                    TruthCell::NotJudged
                } else if tally.obstacle >= OBSTACLE_PIXELS {
                    TruthCell::Obstacle
                } else if tally.ground >= FREE_PIXELS && !tally.high {
                    TruthCell::Free
                } else {
                    TruthCell::NotJudged
                }
            })
            .collect();
        cells
    }
}

impl TruthCells {
    /// Whether cell `(i, j)` lies in the range that is judged.
    pub fn judges(&self, i: i16, j: i16) -> bool {
        let (x, y) = self.geometry.centre_m(i, j);
        (self.nearest_m..=self.farthest_m).contains(&x) && y.abs() <= self.aside_m
    }

    /// What is in cell `(i, j)`; not judged outside the map.
    pub fn get(&self, i: i16, j: i16) -> TruthCell {
        self.geometry.index(i, j).and_then(|index| self.cells.get(index)).copied().unwrap_or_default()
    }
}

/// Places where something is between 0.2 m and 2.2 m above the ground, seen or not.
pub(crate) fn high_places(mesh: &Mesh, ground: &Ground) -> Vec<(i16, i16)> {
    let mut places = std::collections::BTreeSet::new();
    for shape in &mesh.shapes {
        let object = usize::from(mesh.skins[shape.id as usize].object);
        if !mesh.objects.get(object).is_some_and(|o| o.shadow) {
            continue;
        }
        shape.sprinkle(MARK_M, |p| {
            if HIGH_M.contains(&(p.z - ground.height(p.x, p.y))) {
                places.insert((floor(p.x / MARK_M) as i16, floor(p.y / MARK_M) as i16));
            }
        });
    }
    places.into_iter().collect()
}
