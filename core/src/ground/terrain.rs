//! The ground as it bends: a plane and how far the ground lies above it, patch by patch.

use super::GroundPlane;
use crate::{
    disparity::DisparityPicture,
    geometry::{DepthTable, Rays},
    lanes::floor,
    surfaces::{SurfaceClass, Surfaces, TILE},
    work::{self, Loop},
};

/// Patches ahead, and to both sides together.
const AHEAD: usize = 40;
const ACROSS: usize = 40;

/// Of so many pixels along and across the rows one is looked at.
const STEP_X: usize = 4;
const STEP_Y: usize = 2;

const _: () = assert!(TILE.is_multiple_of(STEP_X), "the first pixel of a tile is one that is looked at");

/// Pixels that the plane itself counts for under the robot, where the ground is too near to be seen.
const PLANE_WEIGHT: f32 = 25.0;

/// Pixels that make a patch known.
const LEAST_WEIGHT: f32 = 4.0;

/// What lies this many tolerances below the ground of the first round is still ground: that round's is never too low by less.
const LOWER: f32 = 4.0;

/// The ground ahead: the plane, and its deviation from the plane in square patches, linear between their middles.
///
/// A plane fits the ground under the robot. A slope that begins some metres ahead, a verge behind a kerb or a bank beside the
/// road leaves it by more than the height of an obstacle, and pictures that are not quite in line bend even level ground.
/// Heights are measured from here.
#[derive(Clone, Debug, PartialEq)]
pub struct Terrain {
    plane: GroundPlane,
    patch_m: f32,
    lift_m: [[f32; ACROSS]; AHEAD],
    weight: [[f32; ACROSS]; AHEAD],
    sum_m: [[f32; ACROSS]; AHEAD],
}

/// The two rounds in which the ground is followed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Round {
    /// From the robot outwards, over all that may be ground.
    Follow,
    /// Once more, without what rises above it: the mean of a patch is lifted by what stands in it.
    Trim,
}

/// How the ground may bend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bend {
    /// Edge of a patch, metres.
    pub(crate) patch_m: f32,
    /// How much of what a patch knows counts in the next one.
    pub(crate) share: f32,
    /// How far ground may rise or fall in a metre.
    pub(crate) max_slope: f32,
    /// How far ground may lie off that, metres, and how much farther for each metre ahead: heights are less certain there.
    pub(crate) tolerance_m: f32,
    pub(crate) tolerance_per_m: f32,
}

impl Terrain {
    /// No ground yet: level, at the height of the frame's origin.
    pub const fn new() -> Self {
        Self {
            plane: GroundPlane::UNSET,
            patch_m: 0.0,
            lift_m: [[0.0; ACROSS]; AHEAD],
            weight: [[0.0; ACROSS]; AHEAD],
            sum_m: [[0.0; ACROSS]; AHEAD],
        }
    }

    /// Ground that does not bend.
    ///
    /// # Bound
    /// One pass over the patches.
    pub fn flatten(&mut self, plane: GroundPlane) {
        self.plane = plane;
        if self.patch_m == 0.0 {
            // Any length does where nothing bends; a detector that is not configured is all zero.
            self.patch_m = 1.0;
        }
        work::count(Loop::TerrainPatches, AHEAD * ACROSS);
        for lift_m in &mut self.lift_m {
            lift_m.fill(0.0);
        }
    }

    /// The terrain that the pixels on the ground describe, followed from the robot outwards: what is farther up the picture
    /// counts if it can be reached from the ground below it. So the bonnet of a car, as level as ground and now and then hanging
    /// together with it, is none, and a bank is.
    ///
    /// # Bound
    /// Three passes over one pixel in [`STEP_X`] `x` [`STEP_Y`] of the picture, and twelve over the patches.
    pub(crate) fn fit<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize>(
        &mut self,
        plane: GroundPlane,
        surfaces: &Surfaces<PIXELS, SURFACES>,
        picture: DisparityPicture<'_>,
        (depth, rays): (&DepthTable<DISPARITIES>, &Rays),
        bend: &Bend,
    ) {
        self.flatten(plane);
        self.patch_m = bend.patch_m;
        // The surfaces of another picture say nothing about this one.
        let height = if (picture.width(), picture.height()) == surfaces.size() { picture.height() } else { 0 };
        for round in [Round::Follow, Round::Trim, Round::Trim] {
            self.begin();
            for y in (0..height).rev().step_by(STEP_Y) {
                let (row, labels) = (picture.row(y), surfaces.labels_row(y));
                for x0 in (0..row.len()).step_by(TILE) {
                    let table = surfaces.of_tile(x0, y);
                    if table.is_empty() {
                        continue;
                    }
                    let end = x0.saturating_add(TILE).min(row.len());
                    for x in (x0..end).step_by(STEP_X) {
                        let (Some(pixel), Some(&label)) = (row.get(x), labels.get(x)) else { break };
                        work::count(Loop::TerrainPixels, 1);
                        let surface = usize::from(label).checked_sub(1).and_then(|i| table.get(i));
                        let Some(surface) = surface.filter(|surface| surface.class != SurfaceClass::Vertical) else {
                            continue;
                        };
                        let z = depth.distance_m(pixel.steps());
                        let direction = rays.direction(x as f32, y as f32);
                        let point: [f32; 3] = core::array::from_fn(|i| rays.origin_m[i] + z * direction[i]);
                        self.add(round, point, surface.class == SurfaceClass::Ground, bend);
                    }
                }
            }
            self.settle(bend.share);
        }
    }

    /// Makes room for the points of a round.
    fn begin(&mut self) {
        work::count(Loop::TerrainPatches, 2 * AHEAD * ACROSS);
        for patches in [&mut self.weight, &mut self.sum_m] {
            for row in patches {
                row.fill(0.0);
            }
        }
        // The plane itself speaks for the ground under the robot.
        for weight in &mut self.weight[0][ACROSS / 2 - 1..=ACROSS / 2] {
            *weight += PLANE_WEIGHT;
        }
    }

    /// Makes the terrain of the points of a round. Each patch takes in what its neighbours know, fading with the distance: gaps
    /// are filled, patches with little support are held by those around them.
    fn settle(&mut self, share: f32) {
        spread(&mut self.weight, share);
        spread(&mut self.sum_m, share);
        work::count(Loop::TerrainPatches, AHEAD * ACROSS);
        let sums = self.sum_m.as_flattened().iter().zip(self.weight.as_flattened());
        for (lift_m, (sum_m, weight)) in self.lift_m.as_flattened_mut().iter_mut().zip(sums) {
            *lift_m = if *weight > 0.0 { *sum_m / weight } else { 0.0 };
        }
    }

    /// Adds a point to its patch, if ground can be there; `sure` if its surface is known to be ground.
    fn add(&mut self, round: Round, point: [f32; 3], sure: bool, bend: &Bend) {
        let [ahead, across] = self.place(point[0], point[1]);
        if ahead < 0.0 || across < 0.0 || ahead >= AHEAD as f32 || across >= ACROSS as f32 {
            return;
        }
        let (i, j) = (ahead as i32 as usize, across as i32 as usize);
        let height_m = self.plane.height_m(point);
        let tolerance_m = bend.tolerance_m + bend.tolerance_per_m * point[0];
        let accepted = match round {
            Round::Follow => {
                let (expected_m, reach_m) = self.expected_m(i, j, point[0], sure, bend);
                // What stands there hides the ground, which is taken to go on under it: what lies behind is not reached over it.
                if sure && height_m > expected_m + reach_m {
                    self.count(i, j, expected_m);
                }
                (height_m - expected_m).abs() <= reach_m
            }
            Round::Trim => {
                let above_m = height_m - self.lift_m(point[0], point[1]);
                above_m <= tolerance_m && above_m >= -LOWER * tolerance_m
            }
        };
        if accepted {
            self.count(i, j, height_m);
        }
    }

    /// Counts a height in a patch.
    fn count(&mut self, i: usize, j: usize, height_m: f32) {
        let weight = self.weight.get_mut(i).and_then(|row| row.get_mut(j));
        let sum_m = self.sum_m.get_mut(i).and_then(|row| row.get_mut(j));
        if let Some((weight, sum_m)) = weight.zip(sum_m) {
            *weight += 1.0;
            *sum_m += height_m;
        }
    }

    /// Where the ground is expected, seen from what is known of its patch or of those between it and the robot, and how far it may
    /// lie above or below.
    fn expected_m(&self, i: usize, j: usize, x_m: f32, sure: bool, bend: &Bend) -> (f32, f32) {
        let known = |i: usize, j: usize| {
            let (weight, sum_m) = (*self.weight.get(i)?.get(j)?, *self.sum_m.get(i)?.get(j)?);
            (weight >= LEAST_WEIGHT).then(|| sum_m / weight)
        };
        let inner = if j < ACROSS / 2 { j + 1 } else { j.wrapping_sub(1) };
        // The patch itself, those between it and the robot, and at last the nearest one before it: what hides the ground hides
        // more of it the farther it reaches.
        // It may rise and fall as much as drivable ground does in the frame; ground that is not known to be some goes on as it was.
        // So what the plane itself falls from there to here is taken out.
        let [nx, ny, nz] = self.plane.normal;
        let aside = if j < ACROSS / 2 { -ny } else { ny };
        let level = |lift_m: f32, across: f32, along: usize| {
            let fall_m = if sure { (along as f32 * nx + across * aside) / nz * self.patch_m } else { 0.0 };
            (lift_m + fall_m, along.max(1))
        };
        let around = known(i, j)
            .map(|lift_m| (lift_m, 1))
            .or_else(|| Some(level(known(i.wrapping_sub(1), j)?, 0.0, 1)))
            .or_else(|| Some(level(known(i.wrapping_sub(1), inner)?, 1.0, 1)))
            .or_else(|| Some(level(known(i, inner)?, 1.0, 0)))
            .or_else(|| {
                let mut backs = (2..=i).inspect(|_| work::count(Loop::TerrainBack, 1));
                backs.find_map(|back| Some(level(known(i.checked_sub(back)?, j)?, 0.0, back)))
            });
        let slope = if sure { bend.max_slope } else { 0.0 };
        match around {
            Some((lift_m, patches)) => (lift_m, bend.tolerance_m + slope * patches as f32 * self.patch_m),
            None if sure => (0.0, bend.tolerance_m + slope * x_m),
            None => (0.0, -1.0),
        }
    }

    /// The plane under the robot.
    pub const fn plane(&self) -> &GroundPlane {
        &self.plane
    }

    /// How far the ground lies above the plane `x_m` ahead and `y_m` to the left, metres.
    pub fn lift_m(&self, x_m: f32, y_m: f32) -> f32 {
        let [lift_m] = self.lifts_m(&[x_m], &[y_m]);
        lift_m
    }

    /// [`Self::lift_m`] of several places side by side.
    #[inline(always)]
    pub(crate) fn lifts_m<const N: usize>(&self, x_m: &[f32; N], y_m: &[f32; N]) -> [f32; N] {
        let (mut corners, mut parts) = ([0; N], [[0.0; 2]; N]);
        for k in 0..N {
            let [ahead, across] = self.place(x_m[k], y_m[k]);
            let (most_ahead, most_across) = ((AHEAD - 1) as f32, (ACROSS - 1) as f32);
            let (ahead, across) = ((ahead - 0.5).clamp(0.0, most_ahead), (across - 0.5).clamp(0.0, most_across));
            let (i, j) = (floor(ahead, 0.0, most_ahead - 1.0), floor(across, 0.0, most_across - 1.0));
            parts[k] = [ahead - i as f32, across - j as f32];
            corners[k] = i.wrapping_mul(ACROSS as i32).wrapping_add(j);
        }
        // The four patches around each place, one after the other: no vector instruction of all processors does it.
        let lift_m = self.lift_m.as_flattened();
        let mut around = [[0.0; N]; 4];
        for k in 0..N {
            let corner = (corners[k] as usize).min((AHEAD - 1) * ACROSS - 2);
            for (patches, offset) in around.iter_mut().zip([0, 1, ACROSS, ACROSS + 1]) {
                patches[k] = lift_m.get(corner + offset).copied().unwrap_or(0.0);
            }
        }
        let mut lifts_m = [0.0; N];
        for k in 0..N {
            let ([s, t], [a, b, c, d]) = (parts[k], [around[0][k], around[1][k], around[2][k], around[3][k]]);
            let (near, far) = (a + t * (b - a), c + t * (d - c));
            lifts_m[k] = near + s * (far - near);
        }
        lifts_m
    }

    /// Height of a point of the vehicle frame above the ground, metres.
    pub fn height_m(&self, p: [f32; 3]) -> f32 {
        self.plane.height_m(p) - self.lift_m(p[0], p[1])
    }

    /// Where a point lies, in patches from the nearest and from the rightmost one.
    #[inline(always)]
    fn place(&self, x_m: f32, y_m: f32) -> [f32; 2] {
        [x_m / self.patch_m, y_m / self.patch_m + (ACROSS / 2) as f32]
    }
}

impl Default for Terrain {
    fn default() -> Self {
        Self::new()
    }
}

/// Adds to every patch the others, each `share` to the power of its distance, along one side and then along the other.
fn spread(patches: &mut [[f32; ACROSS]; AHEAD], share: f32) {
    work::count(Loop::TerrainPatches, 6 * AHEAD * ACROSS);
    for row in patches.iter_mut() {
        spread_line(row, share);
    }
    for j in 0..ACROSS {
        let mut column: [f32; AHEAD] = core::array::from_fn(|i| patches[i][j]);
        spread_line(&mut column, share);
        for (row, patch) in patches.iter_mut().zip(column) {
            row[j] = patch;
        }
    }
}

fn spread_line<const N: usize>(line: &mut [f32; N], share: f32) {
    let mut before = [0.0; N];
    let mut carried = 0.0;
    for (before, own) in before.iter_mut().zip(&*line) {
        *before = carried;
        carried = share * (carried + own);
    }
    let mut behind = 0.0;
    for (patch, before) in line.iter_mut().rev().zip(before.iter().rev()) {
        let own = *patch;
        *patch = own + before + behind;
        behind = share * (behind + own);
    }
}

#[cfg(test)]
#[path = "terrain_tests.rs"]
mod tests;
