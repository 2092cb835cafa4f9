//! The ground as it bends: a plane and how far the ground lies above it, patch by patch.

use super::GroundPlane;
use crate::surfaces::{Surface, SurfaceClass};

/// Patches ahead, and to both sides together.
const AHEAD: usize = 32;
const ACROSS: usize = 32;

/// Pixels that the plane itself counts for under the robot, where the ground is too near to be seen.
const PLANE_WEIGHT: f32 = 200.0;

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
}

/// How the ground may bend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bend {
    /// Edge of a patch, metres.
    pub(crate) patch_m: f32,
    /// How much of what a patch knows counts in the next one.
    pub(crate) share: f32,
    /// How far ground may rise in a metre away from the robot, metres.
    pub(crate) max_slope: f32,
}

impl Terrain {
    /// No ground yet: level, at the height of the frame's origin.
    pub const fn new() -> Self {
        Self { plane: GroundPlane::UNSET, patch_m: 0.0, lift_m: [[0.0; ACROSS]; AHEAD], weight: [[0.0; ACROSS]; AHEAD] }
    }

    /// Ground that does not bend.
    ///
    /// # Bound
    /// One pass over the patches.
    pub fn flatten(&mut self, plane: GroundPlane) {
        self.plane = plane;
        self.patch_m = 1.0;
        for lift_m in &mut self.lift_m {
            lift_m.fill(0.0);
        }
    }

    /// The terrain that the surfaces on the ground describe.
    ///
    /// # Bound
    /// One pass over the table and eight over the patches.
    pub(crate) fn fit(&mut self, plane: GroundPlane, table: &[Surface], bend: &Bend) {
        self.flatten(plane);
        self.patch_m = bend.patch_m;
        for weight in &mut self.weight {
            weight.fill(0.0);
        }
        for surface in table.iter().filter(|surface| surface.class == SurfaceClass::Ground) {
            let [x, y, _] = surface.points.mean_m;
            let [ahead, across] = self.place(x, y);
            let Some(weight) = patch(&mut self.weight, ahead, across) else { continue };
            *weight += surface.points.weight;
            if let Some(sum) = patch(&mut self.lift_m, ahead, across) {
                *sum += surface.points.weight * plane.height_m(surface.points.mean_m);
            }
        }
        // The plane itself speaks for the ground under the robot.
        for weight in &mut self.weight[0][ACROSS / 2 - 1..=ACROSS / 2] {
            *weight += PLANE_WEIGHT;
        }
        // Each patch takes in what its neighbours know, fading with the distance: gaps are filled, patches with little support
        // are held by those around them.
        spread(&mut self.weight, bend.share);
        spread(&mut self.lift_m, bend.share);
        for (lift_m, weight) in self.lift_m.as_flattened_mut().iter_mut().zip(self.weight.as_flattened()) {
            *lift_m = if *weight > 0.0 { *lift_m / weight } else { 0.0 };
        }
        self.limit(bend.max_slope * bend.patch_m);
    }

    /// Cuts off what rises faster than ground does, seen from the robot outwards: the bonnet of a car is as level as ground, and
    /// hangs together with it now and then.
    fn limit(&mut self, rise_m: f32) {
        let diagonal_m = rise_m * core::f32::consts::SQRT_2;
        for i in 0..AHEAD {
            for outwards in 0..ACROSS / 2 {
                for (j, inner) in [(ACROSS / 2 + outwards, -1), (ACROSS / 2 - 1 - outwards, 1)] {
                    let at = |i: usize, j: isize| self.lift_m.get(i)?.get(usize::try_from(j).ok()?).copied();
                    let (nearer, inner) = (i.wrapping_sub(1), j as isize + inner);
                    let limits = [
                        at(nearer, j as isize).map(|lift_m| lift_m + rise_m),
                        at(i, inner).map(|lift_m| lift_m + rise_m),
                        at(nearer, inner).map(|lift_m| lift_m + diagonal_m),
                    ];
                    let limit = limits.into_iter().flatten().fold(f32::NEG_INFINITY, f32::max);
                    if let Some(lift_m) = patch(&mut self.lift_m, i as f32, j as f32)
                        && limit > f32::NEG_INFINITY
                    {
                        *lift_m = lift_m.min(limit);
                    }
                }
            }
        }
    }

    /// The plane under the robot.
    pub const fn plane(&self) -> &GroundPlane {
        &self.plane
    }

    /// How far the ground lies above the plane `x_m` ahead and `y_m` to the left, metres.
    pub fn lift_m(&self, x_m: f32, y_m: f32) -> f32 {
        let [ahead, across] = self.place(x_m, y_m);
        let ahead = (ahead - 0.5).clamp(0.0, (AHEAD - 1) as f32);
        let across = (across - 0.5).clamp(0.0, (ACROSS - 1) as f32);
        let (i, j) = ((ahead as usize).min(AHEAD - 2), (across as usize).min(ACROSS - 2));
        let (s, t) = (ahead - i as f32, across - j as f32);
        let [near, far] = [self.lift_m[i], self.lift_m[i + 1]].map(|row| row[j] + t * (row[j + 1] - row[j]));
        near + s * (far - near)
    }

    /// Height of a point of the vehicle frame above the ground, metres.
    pub fn height_m(&self, p: [f32; 3]) -> f32 {
        self.plane.height_m(p) - self.lift_m(p[0], p[1])
    }

    /// Where a point lies, in patches from the nearest and from the rightmost one.
    fn place(&self, x_m: f32, y_m: f32) -> [f32; 2] {
        [x_m / self.patch_m, y_m / self.patch_m + (ACROSS / 2) as f32]
    }
}

impl Default for Terrain {
    fn default() -> Self {
        Self::new()
    }
}

fn patch(patches: &mut [[f32; ACROSS]; AHEAD], ahead: f32, across: f32) -> Option<&mut f32> {
    if ahead < 0.0 || across < 0.0 {
        return None;
    }
    patches.get_mut(ahead as usize)?.get_mut(across as usize)
}

/// Adds to every patch the others, each `share` to the power of its distance, along one side and then along the other.
fn spread(patches: &mut [[f32; ACROSS]; AHEAD], share: f32) {
    for row in patches.iter_mut() {
        let mut carried = [0.0; ACROSS];
        for j in 1..ACROSS {
            carried[j] = share * (carried[j - 1] + row[j - 1]);
        }
        let mut back = 0.0;
        for j in (0..ACROSS).rev() {
            let own = row[j];
            row[j] = own + carried[j] + back;
            back = share * (back + own);
        }
    }
    for j in 0..ACROSS {
        let mut carried = [0.0; AHEAD];
        for i in 1..AHEAD {
            carried[i] = share * (carried[i - 1] + patches[i - 1][j]);
        }
        let mut back = 0.0;
        for i in (0..AHEAD).rev() {
            let own = patches[i][j];
            patches[i][j] = own + carried[i] + back;
            back = share * (back + own);
        }
    }
}

#[cfg(test)]
#[path = "terrain_tests.rs"]
mod tests;
