//! The ground as it bends: a plane and how far the ground lies above it, patch by patch.

use super::GroundPlane;
use crate::{
    arch::{self, Chosen, Steps},
    disparity::DisparityPicture,
    geometry::{DepthTable, Rays},
    lanes::{LANES, floor},
    surfaces::{MAX_TILE_SURFACES, SurfaceClass, Surfaces, TILE},
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
        chosen: Chosen,
    ) {
        self.flatten(plane);
        self.patch_m = bend.patch_m;
        for round in [Round::Follow, Round::Trim, Round::Trim] {
            self.begin();
            // The surfaces of another picture say nothing about this one.
            if (picture.width(), picture.height()) == surfaces.size() {
                arch::compiled(chosen, Gather { terrain: self, round, surfaces, picture, depth, rays, bend });
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

    /// The patch of each point; none outside of the terrain.
    #[inline(always)]
    fn patches(&self, points: &Points) -> [Option<usize>; LANES] {
        let patches: [i32; LANES] = core::array::from_fn(|k| {
            let [ahead, across] = self.place(points.x_m[k], points.y_m[k]);
            let outside = (ahead < 0.0) | (across < 0.0) | (ahead >= AHEAD as f32) | (across >= ACROSS as f32);
            let (i, j) = (floor(ahead, 0.0, (AHEAD - 1) as f32), floor(across, 0.0, (ACROSS - 1) as f32));
            if outside { -1 } else { i.wrapping_mul(ACROSS as i32).wrapping_add(j) }
        });
        patches.map(|patch| usize::try_from(patch).ok())
    }

    /// Adds points to their patches where the ground goes on as what is known of it lets expect, one after the other: a point may make
    /// the patch known in which the next one lies.
    #[inline(always)]
    fn follow(&mut self, points: &Points, bend: &Bend) {
        for (k, patch) in (0..points.count.min(LANES)).zip(self.patches(points)) {
            let Some(patch) = patch else { continue };
            let (i, j, sure, height_m) = (patch / ACROSS, patch % ACROSS, points.sure[k], points.height_m[k]);
            let (expected_m, reach_m) = self.expected_m(i, j, points.x_m[k], sure, bend);
            // What stands there hides the ground, which is taken to go on under it: what lies behind is not reached over it.
            if sure && height_m > expected_m + reach_m {
                self.count(patch, expected_m);
            }
            if (height_m - expected_m).abs() <= reach_m {
                self.count(patch, height_m);
            }
        }
    }

    /// Adds points to their patches that neither rise above the terrain of the round before nor lie far below it.
    #[inline(always)]
    fn trim(&mut self, points: &Points, bend: &Bend) {
        let (patches, lifts_m) = (self.patches(points), self.lifts_m(&points.x_m, &points.y_m));
        let mut accepted = [false; LANES];
        for k in 0..LANES {
            let tolerance_m = bend.tolerance_m + bend.tolerance_per_m * points.x_m[k];
            let above_m = points.height_m[k] - lifts_m[k];
            accepted[k] = (above_m <= tolerance_m) & (above_m >= -LOWER * tolerance_m);
        }
        for (k, patch) in (0..points.count.min(LANES)).zip(patches) {
            if let Some(patch) = patch.filter(|_| accepted[k]) {
                self.count(patch, points.height_m[k]);
            }
        }
    }

    /// Counts a height in a patch.
    #[inline(always)]
    fn count(&mut self, patch: usize, height_m: f32) {
        let weight = self.weight.as_flattened_mut().get_mut(patch);
        let sum_m = self.sum_m.as_flattened_mut().get_mut(patch);
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

/// Goes over the picture from the robot outwards and adds what may be ground to the terrain.
struct Gather<'a, const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize> {
    terrain: &'a mut Terrain,
    round: Round,
    surfaces: &'a Surfaces<PIXELS, SURFACES>,
    picture: DisparityPicture<'a>,
    depth: &'a DepthTable<DISPARITIES>,
    rays: &'a Rays,
    bend: &'a Bend,
}

/// What the pixels of a surface say of the ground.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Says {
    /// What stands upright, and what belongs to no surface.
    Nothing,
    MayBeGround,
    Ground,
}

impl Says {
    const fn of(class: SurfaceClass) -> Self {
        match class {
            SurfaceClass::Vertical => Self::Nothing,
            SurfaceClass::Ground => Self::Ground,
            _ => Self::MayBeGround,
        }
    }
}

/// Pixels of a row that are to become points, the first `count`, and how sure it is that they are ground.
#[derive(Default)]
struct Waiting {
    count: usize,
    column: [f32; LANES],
    steps: [u16; LANES],
    sure: [bool; LANES],
}

/// Points of a row in the frame of the vehicle, the first `count`, with their heights above the plane.
struct Points {
    count: usize,
    x_m: [f32; LANES],
    y_m: [f32; LANES],
    height_m: [f32; LANES],
    sure: [bool; LANES],
}

impl<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize> Steps
    for Gather<'_, PIXELS, SURFACES, DISPARITIES>
{
    #[inline(always)]
    fn run(mut self) {
        for y in (0..self.picture.height()).rev().step_by(STEP_Y) {
            let (row, labels) = (self.picture.row(y), self.surfaces.labels_row(y));
            let mut waiting = Waiting::default();
            for x0 in (0..row.len()).step_by(TILE) {
                let table = self.surfaces.of_tile(x0, y);
                if table.is_empty() {
                    continue;
                }
                let mut says = [Says::Nothing; MAX_TILE_SURFACES + 1];
                for (says, surface) in says.iter_mut().skip(1).zip(table) {
                    *says = Says::of(surface.class);
                }
                let end = x0.saturating_add(TILE).min(row.len());
                for x in (x0..end).step_by(STEP_X) {
                    let (Some(pixel), Some(&label)) = (row.get(x), labels.get(x)) else { break };
                    work::count(Loop::TerrainPixels, 1);
                    let says = says.get(usize::from(label)).copied().unwrap_or(Says::Nothing);
                    // Written in any case, and kept if the pixel says something: what the next one is, no branch can foresee.
                    let place = waiting.count % LANES;
                    waiting.column[place] = x as f32;
                    waiting.steps[place] = pixel.steps();
                    waiting.sure[place] = says == Says::Ground;
                    waiting.count = place.wrapping_add(usize::from(says != Says::Nothing));
                    if waiting.count == LANES {
                        self.points(y, &mut waiting);
                    }
                }
            }
            self.points(y, &mut waiting);
        }
    }
}

impl<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize> Gather<'_, PIXELS, SURFACES, DISPARITIES> {
    /// Adds what waits of row `y`.
    #[inline(always)]
    fn points(&mut self, y: usize, waiting: &mut Waiting) {
        let count = core::mem::take(&mut waiting.count);
        if count == 0 {
            return;
        }
        let Waiting { column, steps, sure, .. } = waiting;
        let distances_m = self.depth.distances_m(steps);
        let plane = *self.terrain.plane();
        let mut points = Points { count, x_m: [0.0; LANES], y_m: [0.0; LANES], height_m: [0.0; LANES], sure: *sure };
        for k in 0..LANES {
            let point = self.rays.point_m(column[k], y as f32, distances_m[k]);
            [points.x_m[k], points.y_m[k], _] = point;
            points.height_m[k] = plane.height_m(point);
        }
        match self.round {
            Round::Follow => self.terrain.follow(&points, self.bend),
            Round::Trim => self.terrain.trim(&points, self.bend),
        }
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
    for rows in patches.as_chunks_mut::<LINES>().0 {
        let mut lines: Lines<ACROSS> = core::array::from_fn(|k| core::array::from_fn(|row| rows[row][k]));
        spread_lines(&mut lines, share);
        for (k, line) in lines.iter().enumerate() {
            for (row, patch) in rows.iter_mut().zip(line) {
                row[k] = *patch;
            }
        }
    }
    for first in (0..ACROSS).step_by(LINES) {
        let mut lines: Lines<AHEAD> = core::array::from_fn(|i| core::array::from_fn(|line| patches[i][first + line]));
        spread_lines(&mut lines, share);
        for (row, line) in patches.iter_mut().zip(&lines) {
            for (patch, value) in row.iter_mut().skip(first).zip(line) {
                *patch = *value;
            }
        }
    }
}

/// Rows or columns of patches that are worked on side by side: each step along one waits for the step before.
const LINES: usize = LANES.div_ceil(2);
const _: () = assert!(AHEAD.is_multiple_of(LINES) && ACROSS.is_multiple_of(LINES), "no row or column is left over");

type Lines<const N: usize> = [[f32; LINES]; N];

fn spread_lines<const N: usize>(lines: &mut Lines<N>, share: f32) {
    let mut before = [[0.0; LINES]; N];
    let mut carried = [0.0; LINES];
    for (before, own) in before.iter_mut().zip(&*lines) {
        *before = carried;
        carried = core::array::from_fn(|line| share * (carried[line] + own[line]));
    }
    let mut behind = [0.0; LINES];
    for (patches, before) in lines.iter_mut().rev().zip(before.iter().rev()) {
        let own = *patches;
        *patches = core::array::from_fn(|line| own[line] + before[line] + behind[line]);
        behind = core::array::from_fn(|line| share * (behind[line] + own[line]));
    }
}

#[cfg(test)]
#[path = "terrain_tests.rs"]
mod tests;
