//! The votes of the pixels, tile by tile, eight pixels side by side.

use super::{MapGeometry, MapSettings, View, builder::Evidence};
use crate::{
    arch::Steps,
    disparity::DisparityPicture,
    ground::Terrain,
    lanes::{LANES, floor},
    links::{PIECE, Piece, changes, each_bit},
    surfaces::{MAX_TILE_SURFACES, Surface, SurfaceClass, Surfaces, TILE},
    work::{self, Loop},
};

const _: () = assert!(TILE == PIECE, "a row of a tile is one piece");

/// Distance over which the slope of the ground is measured, metres.
const SLOPE_STEP_M: f32 = 1.5;

/// What the pixels of a surface count as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// The first: a detector of zeros takes no room in the image of a program.
    Other,
    /// Ground, and what may stand on it in the same tile: each pixel speaks for itself.
    Ground,
    Obstacle,
}

/// The roles of the pixels of a row of a tile, the first pixel in the lowest bit.
#[derive(Default)]
struct Roles {
    any: u32,
    ground: u32,
    obstacle: u32,
}

/// What a pixel says of its cell: the lowest bits of a key.
const OBSTACLE: u16 = 1;
const UNCLEAR: u16 = 2;
const GROUND: u16 = 3;
const VOTE_BITS: u32 = 2;

/// What all pixels of a surface have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Common {
    role: Role,
    /// Normal of the ground where the surface lies, times a factor: with the direction of a ray the speed at which it drops.
    across: [f32; 3],
}

impl Common {
    /// Of no surface at all.
    pub(super) const UNSET: Self = Self { role: Role::Other, across: [0.0; 3] };

    /// The slope of the ground belongs to the surface, not to the pixel.
    fn of(surface: &Surface, ground: &Terrain) -> Self {
        let [x, y, _] = surface.points.mean_m;
        let half = 0.5 * SLOPE_STEP_M;
        let [before, behind, right, left] = ground.lifts_m(&[x - half, x + half, x, x], &[y, y, y - half, y + half]);
        let [nx, ny, nz] = ground.plane().normal;
        let role = match surface.class {
            SurfaceClass::Obstacle => Role::Obstacle,
            SurfaceClass::Ground => Role::Ground,
            _ => Role::Other,
        };
        Self { role, across: [nx - (behind - before) / SLOPE_STEP_M, ny - (left - right) / SLOPE_STEP_M, nz] }
    }
}

/// Collects the votes of all pixels that belong to a surface.
///
/// # Bound
/// One pass over the picture, one over the surfaces.
pub(super) struct Collect<'a, const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize> {
    pub(super) settings: &'a MapSettings,
    /// Least height and clearance of obstacles, metres.
    pub(super) obstacle_heights_m: (f32, f32),
    pub(super) evidence: &'a mut [Evidence],
    pub(super) common: &'a mut [Common; MAX_TILE_SURFACES],
    pub(super) surfaces: &'a Surfaces<PIXELS, SURFACES>,
    pub(super) picture: DisparityPicture<'a>,
    pub(super) view: &'a View<'a, DISPARITIES>,
    pub(super) ground: &'a Terrain,
    /// The rows that are looked at.
    pub(super) rows: TileRows,
}

/// Every so many rows of tiles, from one of them on.
#[derive(Clone, Copy)]
pub(super) struct TileRows {
    pub(super) first: usize,
    pub(super) every: usize,
}

impl TileRows {
    pub(super) const ALL: Self = Self { first: 0, every: 1 };

    /// First rows of pixels.
    fn tops(self, height: usize) -> impl Iterator<Item = usize> {
        let after = move |&y: &usize| Some(y.saturating_add(self.every.max(1).saturating_mul(TILE)));
        core::iter::successors(Some(self.first.saturating_mul(TILE)), after).take_while(move |&y| y < height)
    }
}

impl<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize> Steps
    for Collect<'_, PIXELS, SURFACES, DISPARITIES>
{
    #[inline(always)]
    fn run(mut self) {
        let height = self.picture.height();
        for y0 in self.rows.tops(height) {
            for x0 in (0..self.picture.width()).step_by(TILE) {
                let found = self.surfaces.of_tile(x0, y0);
                if found.is_empty() {
                    continue;
                }
                work::count(Loop::MapSurfaces, found.len());
                for (common, surface) in self.common.iter_mut().zip(found) {
                    *common = Common::of(surface, self.ground);
                }
                for y in y0..y0.saturating_add(TILE).min(height) {
                    self.row(x0, y);
                }
            }
        }
    }
}

/// The rays of a row of a tile.
struct Row {
    /// Directions along x, y and z, and how fast they climb above the plane.
    rays: [[f32; TILE]; 4],
    camera_height_m: f32,
}

impl<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize> Collect<'_, PIXELS, SURFACES, DISPARITIES> {
    /// Collects the votes of one row of one tile.
    #[inline(always)]
    fn row(&mut self, x0: usize, y: usize) {
        let (row, found) = (self.picture.row(y), self.surfaces.labels_row(y));
        let mut labels = [0; TILE];
        let Some(found) = found.get(x0..) else { return };
        if let Some(whole) = found.first_chunk() {
            labels = *whole;
        } else {
            labels.iter_mut().zip(found).for_each(|(to, from)| *to = *from);
        }
        if labels == [0; TILE] {
            return;
        }
        work::count(Loop::MapRows, 1);
        let pixels = crate::links::piece(row, x0);
        let rays = self.view.rays;
        let plane = self.ground.plane();
        let rise = |d: [f32; 3]| d[0] * plane.normal[0] + d[1] * plane.normal[1] + d[2] * plane.normal[2];
        let direction = rays.direction(x0 as f32, y as f32);
        let ([x, y, z], [dx, dy, dz]) = (direction, rays.along_row);
        let (first, steps) = ([x, y, z, rise(direction)], [dx, dy, dz, rise(rays.along_row)]);
        let mut row = Row { rays: [[0.0; TILE]; 4], camera_height_m: plane.height_m(rays.origin_m) };
        // Each by itself: a sum that grows from pixel to pixel waits for the one before.
        for ((ray, first), step) in row.rays.iter_mut().zip(first).zip(steps) {
            for (ray, k) in ray.iter_mut().zip(0u16..) {
                *ray = first + f32::from(k) * step;
            }
        }
        let mut noise_per_m2 = [0.0; TILE];
        let roles = self.spread(&labels, &row, &mut noise_per_m2);
        let (mut keys, mut heights_dm) = ([0; TILE], [0; TILE]);
        for first in (0..TILE).step_by(LANES) {
            self.lanes(first, &row, &pixels, &roles, &noise_per_m2, &mut keys, &mut heights_dm);
        }
        self.count(&keys, &heights_dm);
    }

    /// The role of every pixel, and the noise of its height for each square metre of its range squared: the error of its distance,
    /// times how fast its ray drops towards the ground there, at the first pixel of its run. A slope that rises towards the robot is
    /// seen at a larger angle, and its heights are less certain.
    #[inline(always)]
    fn spread(&self, labels: &[u8; TILE], row: &Row, noise_per_m2: &mut [f32; TILE]) -> Roles {
        let pair = self.view.pair;
        let focal_baseline_px_m = pair.focal_px * pair.baseline_m;
        let mut roles = Roles::default();
        let changes = changes(labels);
        work::count(Loop::MapRuns, changes.count_ones() as usize);
        for bit in each_bit(changes) {
            let first = bit.trailing_zeros();
            let label = labels.get(first as usize).copied().unwrap_or(0);
            let Some(common) = usize::from(label).checked_sub(1).and_then(|i| self.common.get(i)) else { continue };
            let upto = bit | (bit - 1);
            let after = changes & !upto;
            // The pixels from here to the next run.
            let run = (after & after.wrapping_neg()).wrapping_sub(1) & !(bit - 1);
            roles.any |= run;
            match common.role {
                Role::Ground => roles.ground |= run,
                Role::Obstacle => roles.obstacle |= run,
                Role::Other => {}
            }
            let at = |i: usize| row.rays[i].get(first as usize).copied().unwrap_or(0.0);
            let [nx, ny, nz] = common.across;
            let drop = at(0) * nx + at(1) * ny + at(2) * nz;
            let noise = self.settings.height_noise_px * drop.abs() / focal_baseline_px_m;
            // All that follow: the next run has its own.
            work::count(Loop::MapNoise, TILE.saturating_sub(first as usize));
            noise_per_m2.get_mut(first as usize..).unwrap_or_default().fill(noise);
        }
        roles
    }

    /// Finds the cells of [`LANES`] pixels, and what they say of them: a key of both, 0 where that is nothing.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "what a row of a tile has, input and output")]
    fn lanes(
        &self,
        first: usize,
        row: &Row,
        pixels: &Piece,
        roles: &Roles,
        noise_per_m2: &[f32; TILE],
        keys: &mut [u16; TILE],
        heights_dm: &mut [u8; TILE],
    ) {
        let (Some(pixels), Some(noise_per_m2)) = (group(pixels, first), group(noise_per_m2, first)) else {
            return;
        };
        let [known, is_ground, is_obstacle] = [roles.any, roles.ground, roles.obstacle].map(|bits| bits >> first);
        if known & ((1 << LANES) - 1) == 0 {
            return;
        }
        let [ray_x, ray_y, _, climb] = &row.rays;
        let (Some(ray_x), Some(ray_y), Some(climb)) = (group(ray_x, first), group(ray_y, first), group(climb, first))
        else {
            return;
        };
        let view = self.view;
        let MapGeometry { x_first, x_count, y_first, y_count, .. } = self.settings.geometry;
        let per_cell = 1.0 / self.settings.geometry.cell_size_m();
        let z = view.depth.distances_m(pixels);
        let origin = view.rays.origin_m;
        let (mut x, mut y, mut above_plane) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        let (mut cells, mut any) = ([0; LANES], 0);
        for k in 0..LANES {
            x[k] = origin[0] + z[k] * ray_x[k];
            y[k] = origin[1] + z[k] * ray_y[k];
            above_plane[k] = row.camera_height_m + z[k] * climb[k];
            let [ahead, aside] = view.place.to_vehicle([x[k], y[k]]);
            let i = floor(ahead * per_cell, -32768.0, 32767.0).wrapping_sub(i32::from(x_first));
            let j = floor(aside * per_cell, -32768.0, 32767.0).wrapping_sub(i32::from(y_first));
            let inside = (i as u32) < u32::from(x_count) && (j as u32) < u32::from(y_count) && known & 1 << k != 0;
            cells[k] = if inside { i.wrapping_mul(i32::from(y_count)).wrapping_add(j) } else { -1 };
            any |= !cells[k];
        }
        // Far tiles have no pixel in the map.
        if any == 0 {
            return;
        }
        let lift = self.ground.lifts_m(&x, &y);
        let free_max_height_m = self.settings.free_max_height_m;
        let (min_height, clearance) = self.obstacle_heights_m;
        for k in 0..LANES {
            let height = above_plane[k] - lift[k];
            let limit = free_max_height_m.max(noise_per_m2[k] * (x[k] * x[k] + y[k] * y[k]));
            let too_high = height > limit;
            // Ground that lies deeper than expected is a drop, or the top of what stands below.
            let too_low = height < -limit;
            let (is_ground, is_obstacle) = (is_ground & 1 << k != 0, is_obstacle & 1 << k != 0);
            // What stands upright is an obstacle as soon as it does not pass for ground.
            let stands = too_high & (is_obstacle | (is_ground & (height >= min_height)));
            let reachable = height <= clearance;
            let vote = if stands & reachable {
                OBSTACLE
            } else if too_low | (too_high & reachable) {
                UNCLEAR
            } else if is_ground & !too_high {
                GROUND
            } else {
                0
            };
            let says = cells[k] >= 0 && vote != 0;
            keys[first + k] = if says { (cells[k] as u16) << VOTE_BITS | vote } else { 0 };
            heights_dm[first + k] = floor(height * 10.0, 0.0, 255.0) as u8;
        }
    }

    /// Counts what the pixels of a row say: neighbours that say the same of the same cell at once.
    #[inline(always)]
    fn count(&mut self, keys: &[u16; TILE], heights_dm: &[u8; TILE]) {
        let changes = changes(keys);
        work::count(Loop::MapVotes, changes.count_ones() as usize);
        for bit in each_bit(changes) {
            let first = bit.trailing_zeros() as usize;
            let after = changes & !(bit | (bit - 1));
            let end = (after.trailing_zeros() as usize).min(TILE);
            let key = keys.get(first).copied().unwrap_or(0);
            let Some(evidence) = self.evidence.get_mut(usize::from(key >> VOTE_BITS)) else { continue };
            let pixels = end.saturating_sub(first) as u16;
            match key & ((1 << VOTE_BITS) - 1) {
                OBSTACLE => {
                    evidence.obstacle = evidence.obstacle.saturating_add(pixels);
                    let heights = heights_dm.get(first..end).unwrap_or_default();
                    evidence.height_dm = heights.iter().fold(evidence.height_dm, |most, &height| most.max(height));
                }
                UNCLEAR => evidence.unclear = evidence.unclear.saturating_add(pixels),
                GROUND => evidence.ground = evidence.ground.saturating_add(pixels),
                _ => {}
            }
        }
    }
}

/// [`LANES`] values from `first` on.
#[inline(always)]
fn group<T>(values: &[T; TILE], first: usize) -> Option<&[T; LANES]> {
    values.get(first..).and_then(|rest| rest.first_chunk())
}

#[cfg(test)]
#[path = "votes_tests.rs"]
mod tests;
