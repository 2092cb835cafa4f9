//! The ground as it bends: a plane and how far the ground lies above it, by range.

use super::GroundPlane;
use crate::surfaces::{Surface, SurfaceClass};

/// Length of a band, metres.
const BAND_M: f32 = 1.0;

/// Number of bands.
const BANDS: usize = 48;

/// Pixels that the plane itself counts for under the robot, where the ground is too near to be seen.
const PLANE_WEIGHT: f32 = 200.0;

/// How much of what a band knows still counts in the next one.
const FADE: f32 = 0.15;

/// The ground ahead: the plane, and its deviation from the plane in bands of 1 m along x, linear between their middles.
///
/// A plane fits the ground under the robot; a slope that begins some metres ahead leaves it by more than the height of an
/// obstacle. Heights are measured from here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Terrain {
    plane: GroundPlane,
    lift_m: [f32; BANDS],
}

impl Terrain {
    /// Ground that does not bend.
    pub const fn flat(plane: GroundPlane) -> Self {
        Self { plane, lift_m: [0.0; BANDS] }
    }

    /// The terrain that the surfaces on the ground describe; those `corridor_m` to the side count half.
    ///
    /// # Bound
    /// One pass over the table and three over the bands.
    pub fn of(plane: GroundPlane, table: &[Surface], corridor_m: f32) -> Self {
        let mut weight = [0.0_f32; BANDS];
        let mut lift_m = [0.0_f32; BANDS];
        for surface in table.iter().filter(|surface| surface.class == SurfaceClass::Ground) {
            let [x, y, _] = surface.points.mean_m;
            let Some(band) = band(x) else { continue };
            let aside = y / corridor_m;
            let w = surface.points.weight / (1.0 + aside * aside);
            weight[band] += w;
            lift_m[band] += w * plane.height_m(surface.points.mean_m);
        }
        // Forth and back, each band takes in what its neighbour knows, fading with the distance: gaps are filled, bands with
        // little support are held by those around them. The plane itself speaks for the ground under the robot.
        let mut forth = ([0.0_f32; BANDS], [0.0_f32; BANDS]);
        let mut carried = (PLANE_WEIGHT, 0.0);
        for i in 0..BANDS {
            forth.0[i] = carried.0;
            forth.1[i] = carried.1;
            carried = (FADE * (carried.0 + weight[i]), FADE * (carried.1 + lift_m[i]));
        }
        let mut carried = (0.0, 0.0);
        for i in (0..BANDS).rev() {
            let total = (forth.0[i] + weight[i] + carried.0, forth.1[i] + lift_m[i] + carried.1);
            carried = (FADE * (carried.0 + weight[i]), FADE * (carried.1 + lift_m[i]));
            lift_m[i] = if total.0 > 0.0 { total.1 / total.0 } else { 0.0 };
        }
        Self { plane, lift_m }
    }

    /// The plane under the robot.
    pub const fn plane(&self) -> &GroundPlane {
        &self.plane
    }

    /// How far the ground lies above the plane at `x_m` ahead, metres.
    pub fn lift_m(&self, x_m: f32) -> f32 {
        let place = (x_m / BAND_M - 0.5).clamp(0.0, (BANDS - 1) as f32);
        let band = (place as usize).min(BANDS - 2);
        let share = place - band as f32;
        self.lift_m[band] + share * (self.lift_m[band + 1] - self.lift_m[band])
    }

    /// Height of a point of the vehicle frame above the ground, metres.
    pub fn height_m(&self, p: [f32; 3]) -> f32 {
        self.plane.height_m(p) - self.lift_m(p[0])
    }
}

fn band(x_m: f32) -> Option<usize> {
    let place = x_m / BAND_M;
    (place >= 0.0 && place < BANDS as f32).then_some(place as usize)
}

#[cfg(test)]
#[path = "terrain_tests.rs"]
mod tests;
