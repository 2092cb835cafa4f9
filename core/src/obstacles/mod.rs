//! Obstacles: near-vertical surfaces that belong together and pass the thresholds.

mod settings;

pub use settings::ObstacleSettings;

use core::f32::consts::{FRAC_PI_2, PI};

use heapless::Vec;

use crate::{
    disparity::DisparityPicture,
    error::ConfigError,
    geometry::Place,
    ground::Terrain,
    planes::{Scatter, SymmetricMatrix3},
    surfaces::{Regions, Surface, SurfaceClass, Surfaces},
    work::{self, Loop},
};

/// One obstacle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Obstacle {
    /// Middle of its points in the vehicle frame, metres.
    pub mean_m: [f32; 3],
    /// Smallest x and y in the vehicle frame, and lowest height above the ground, metres.
    pub min_m: [f32; 3],
    /// Largest x and y in the vehicle frame, and greatest height above the ground, metres.
    pub max_m: [f32; 3],
    /// Direction of its largest extent on the ground, radians from +x towards +y, in -pi/2 ..= pi/2.
    pub orientation_rad: f32,
    /// Length along that direction, metres.
    pub length_m: f32,
    /// Number of pixels.
    pub pixels: u32,
    /// Number of surfaces.
    pub surfaces: u16,
}

impl Obstacle {
    /// Distance on the ground from the vehicle's origin to its nearest corner, metres.
    pub fn distance_m(&self) -> f32 {
        let nearest = |min: f32, max: f32| if min > 0.0 { min } else { (-max).max(0.0) };
        let x = nearest(self.min_m[0], self.max_m[0]);
        let y = nearest(self.min_m[1], self.max_m[1]);
        libm::sqrtf(x * x + y * y)
    }
}

/// Half the length of a uniform distribution in standard deviations: extents are told from the moments, so that a few stray
/// pixels do not stretch them.
pub(crate) const HALF_LENGTH: f32 = 1.732_050_8;

/// Joins surfaces that stand up from the ground into obstacles.
///
/// Source: the paper, section 4.4. A surface takes part if it is near-vertical. What is neither vertical nor horizontal takes
/// part if it reaches the least height of an obstacle, and what is horizontal if it lies so high that it is a bonnet
/// or a table top rather than a lawn behind a kerb.
///
/// # Bound
/// The joining of regions, and three passes over the table of surfaces.
pub struct ObstacleFinder {
    settings: ObstacleSettings,
    focal_px: f32,
}

impl ObstacleFinder {
    /// A stage that is not configured.
    pub const fn new() -> Self {
        Self { settings: ObstacleSettings::UNSET, focal_px: 0.0 }
    }

    /// Takes settings, and the focal length of the pictures, px.
    ///
    /// # Errors
    /// The first setting that cannot be used, named `obstacles.*`.
    pub fn configure(&mut self, settings: &ObstacleSettings, focal_px: f32) -> Result<(), ConfigError> {
        settings.check()?;
        self.settings = *settings;
        self.focal_px = focal_px;
        Ok(())
    }

    /// Settings in force.
    pub const fn settings(&self) -> &ObstacleSettings {
        &self.settings
    }

    /// Finds the obstacles of a pair at `place`, nearest first, and gives their surfaces their class. Heights are measured from
    /// `ground`; the farthest that are joined are those from the camera, while the list tells them from the vehicle's origin. Where
    /// there is no room the farthest are left out of the list (their surfaces keep their class); returns how many.
    pub fn run<const PIXELS: usize, const SURFACES: usize, const OBSTACLES: usize>(
        &mut self,
        surfaces: &mut Surfaces<PIXELS, SURFACES>,
        regions: &mut Regions<SURFACES>,
        picture: DisparityPicture<'_>,
        ground: &Terrain,
        place: &Place,
        obstacles: &mut Vec<Obstacle, OBSTACLES, u16>,
    ) -> u32 {
        obstacles.clear();
        let mut dropped = 0u32;
        regions.join(surfaces, picture, |surface| self.stands_up(surface, ground));
        work::count(Loop::ObstacleSurfaces, surfaces.table().len());
        for root in regions.roots() {
            let table = surfaces.table();
            if !table.get(root).is_some_and(|surface| self.stands_up(surface, ground)) {
                continue;
            }
            let members = regions.members(root).filter_map(|place| table.get(place));
            let members = members.inspect(|_| work::count(Loop::ObstacleSurfaces, 1));
            let Some(obstacle) = self.measure(members, ground, place) else {
                continue;
            };
            for member in regions.members(root) {
                work::count(Loop::ObstacleSurfaces, 1);
                if let Some(surface) = surfaces.table_mut().get_mut(member) {
                    surface.class = SurfaceClass::Obstacle;
                }
            }
            dropped = dropped.saturating_add(insert(obstacles, obstacle));
        }
        dropped
    }

    fn stands_up(&self, surface: &Surface, ground: &Terrain) -> bool {
        let [x, y, _] = surface.points.mean_m;
        if x * x + y * y > self.settings.max_range_m * self.settings.max_range_m {
            return false;
        }
        match surface.class {
            SurfaceClass::Vertical | SurfaceClass::Obstacle => true,
            SurfaceClass::Ground => false,
            // Where no ground was seen, this may be it.
            SurfaceClass::Horizontal => {
                ground.plane().support > 0 && ground.height_m(surface.points.mean_m) >= self.settings.platform_height_m
            }
            SurfaceClass::Slanted | SurfaceClass::Undefined => {
                let half = HALF_LENGTH * libm::sqrtf(surface.points.variance_along(ground.plane().normal));
                ground.height_m(surface.points.mean_m) + half >= self.settings.min_height_m
            }
        }
    }

    /// The obstacle that the surfaces make, if they pass the thresholds.
    fn measure<'a>(
        &self,
        members: impl Iterator<Item = &'a Surface>,
        ground: &Terrain,
        place: &Place,
    ) -> Option<Obstacle> {
        let mut all = Scatter::default();
        let mut count = 0u16;
        let mut area_m2 = 0.0;
        let (mut min_m, mut max_m) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        // The box lies along the vehicle's axes.
        let [ahead, aside] = [[1.0, 0.0], [0.0, 1.0]].map(|axis| place.turn_back(axis));
        let axes = [[ahead[0], ahead[1], 0.0], [aside[0], aside[1], 0.0], ground.plane().normal];
        for surface in members {
            let points = &surface.points;
            all = all.joined(points);
            count = count.saturating_add(1);
            let pixel_m = range_m(points) / self.focal_px;
            area_m2 += points.weight * pixel_m * pixel_m;
            let height = ground.height_m(points.mean_m);
            let [x, y] = place.to_vehicle([points.mean_m[0], points.mean_m[1]]);
            let middle = [x, y, height];
            for i in 0..3 {
                // Where a surface runs through a wide range of distances, they are not spread evenly: it is told to begin no nearer
                // than half way.
                let half = (HALF_LENGTH * libm::sqrtf(points.variance_along(axes[i]))).min(0.5 * range_m(points));
                min_m[i] = min_m[i].min(middle[i] - half);
                max_m[i] = max_m[i].max(middle[i] + half);
            }
        }
        let (orientation_rad, length_m) = orientation(&all.covariance);
        let [x, y] = place.to_vehicle([all.mean_m[0], all.mean_m[1]]);
        let obstacle = Obstacle {
            mean_m: [x, y, all.mean_m[2]],
            min_m,
            max_m,
            orientation_rad: within_half_turn(orientation_rad + place.yaw_left_rad()),
            length_m,
            pixels: all.weight as u32,
            surfaces: count,
        };
        let high = max_m[2] >= self.settings.min_height_m && min_m[2] <= self.settings.clearance_m;
        let large = length_m.max(max_m[2] - min_m[2]) >= self.settings.min_size_m;
        let seen = obstacle.pixels >= u32::from(self.settings.min_pixels) && area_m2 >= self.settings.min_area_m2;
        (high && large && seen).then_some(obstacle)
    }
}

impl Default for ObstacleFinder {
    fn default() -> Self {
        Self::new()
    }
}

/// Distance of the middle of some points on the ground, metres.
fn range_m(points: &Scatter) -> f32 {
    let [x, y, _] = points.mean_m;
    libm::sqrtf(x * x + y * y)
}

/// Direction and length of the largest extent on the ground: the largest eigenvector of the covariance of x and y.
fn orientation(covariance: &SymmetricMatrix3) -> (f32, f32) {
    let (a, b, c) = (covariance.xx, covariance.xy, covariance.yy);
    let half_difference = 0.5 * (a - c);
    let radius = libm::sqrtf(half_difference * half_difference + b * b);
    let largest = (0.5 * (a + c) + radius).max(0.0);
    (0.5 * libm::atan2f(b, half_difference), 2.0 * HALF_LENGTH * libm::sqrtf(largest))
}

/// The direction of a line, which looks the same from both ends, in -pi/2 ..= pi/2.
fn within_half_turn(angle_rad: f32) -> f32 {
    let turned = angle_rad % PI;
    match turned {
        _ if turned > FRAC_PI_2 => turned - PI,
        _ if turned < -FRAC_PI_2 => turned + PI,
        _ => turned,
    }
}

/// Inserts by distance; returns how many had to go.
fn insert<const N: usize>(obstacles: &mut Vec<Obstacle, N, u16>, obstacle: Obstacle) -> u32 {
    let distance = obstacle.distance_m();
    let place = obstacles.iter().position(|other| other.distance_m() > distance).unwrap_or(obstacles.len());
    // Those that are nearer were passed, those that are farther make room.
    work::count(Loop::ObstaclesPassed, obstacles.len());
    let mut moved = obstacle;
    for listed in obstacles.iter_mut().skip(place) {
        core::mem::swap(listed, &mut moved);
    }
    // The farthest of all: where the list is full it has no room.
    u32::from(obstacles.push(moved).is_err())
}

#[cfg(test)]
mod tests;
