//! The detector `disparity-segments`: contiguous pieces of the disparity picture, judged by size and height.

use super::{DisparitySegmentSettings, points::row_points};
use crate::{
    disparity::DisparityPicture,
    error::ConfigError,
    geometry::VehicleFrame,
    ground::{GroundPlane, GroundSettings},
    map::{MapBuilder, View, Vote},
    obstacles::HALF_LENGTH,
    planes::Scatter,
    surfaces::{Regions, Surface, SurfaceClass, Surfaces},
};

/// Takes what hangs together in the disparity picture for one thing.
///
/// Source: the paper, section 4.3, Figure 10: union-find over the disparity picture, then size in the world and height above
/// the ground. There is no estimate of the ground in it, so heights are those above the level that the mount promises.
///
/// Its weakness is the one that the paper tells of: where an object touches the ground its disparities are those of the ground, so
/// that both are one segment, and what is said of the object is said of all the ground that it stands on.
///
/// Surfaces of tiles, joined over all borders of tiles, are just the segments that union-find over all pixels finds; pieces of a
/// tile with fewer than `surfaces.min_pixels` pixels are left out.
///
/// # Bound
/// The joining of regions, two passes over the table of surfaces, one pass of `width x height` steps.
pub struct DisparitySegments {
    settings: DisparitySegmentSettings,
    min_support: f32,
}

impl DisparitySegments {
    /// A detector that is not configured.
    pub const fn new() -> Self {
        Self { settings: DisparitySegmentSettings::UNSET, min_support: 0.0 }
    }

    /// Takes settings; of the settings of the ground the least support counts here.
    ///
    /// # Errors
    /// The first setting that cannot be used, named `disparity_segments.*`.
    pub fn configure(
        &mut self,
        settings: &DisparitySegmentSettings,
        ground: &GroundSettings,
        pixels: usize,
    ) -> Result<(), ConfigError> {
        settings.check()?;
        self.settings = *settings;
        self.min_support = ground.min_support_permille * 1.0e-3 * pixels as f32;
        Ok(())
    }

    /// Gives the surfaces of each segment the class of the whole: [`SurfaceClass::Ground`] if it lies flat on the level of the
    /// mount, [`SurfaceClass::Vertical`] if it reaches above it. Returns that level with what was seen to lie on it, if it is
    /// enough.
    pub fn run<const PIXELS: usize, const SURFACES: usize>(
        &self,
        surfaces: &mut Surfaces<PIXELS, SURFACES>,
        regions: &mut Regions<SURFACES>,
        picture: DisparityPicture<'_>,
        frame: &VehicleFrame,
    ) -> Option<GroundPlane> {
        let level = GroundPlane::of_mount(frame);
        let mut ground = Scatter::default();
        regions.join(surfaces, picture, |_| true);
        for root in regions.roots() {
            let table = surfaces.table();
            let members = regions.members(root).filter_map(|place| table.get(place));
            let (class, points) = self.judge(members, &level);
            if class == SurfaceClass::Ground {
                ground = ground.joined(&points);
            }
            for place in regions.members(root) {
                if let Some(surface) = surfaces.table_mut().get_mut(place) {
                    surface.class = class;
                }
            }
        }
        let off = level.height_m(ground.mean_m);
        let rms_m = libm::sqrtf(ground.variance_along(level.normal) + off * off);
        (ground.weight >= self.min_support.max(1.0)).then_some(GroundPlane {
            support: ground.weight as u32,
            rms_m,
            ..level
        })
    }

    /// Says what the pixels of `picture` make of the cells: all those of an obstacle speak for one, on whatever height they lie.
    pub(crate) fn vote<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize, const CELLS: usize>(
        &self,
        surfaces: &Surfaces<PIXELS, SURFACES>,
        picture: DisparityPicture<'_>,
        view: &View<'_, DISPARITIES>,
        map: &mut MapBuilder<CELLS>,
    ) {
        let level = GroundPlane::of_mount(view.frame);
        for y in 0..picture.height() {
            for (x, point) in row_points(picture, view.depth, view.rays, y) {
                let height_m = level.height_m(point);
                let vote = match surfaces.surface_at(x, y).map(|surface| surface.class) {
                    Some(SurfaceClass::Obstacle) => Vote::Obstacle { height_m },
                    Some(SurfaceClass::Ground) => Vote::Ground,
                    _ => continue,
                };
                map.vote(view.place.to_vehicle([point[0], point[1]]), vote);
            }
        }
    }

    /// What a segment is taken for, and its points.
    fn judge<'a>(&self, members: impl Iterator<Item = &'a Surface>, level: &GroundPlane) -> (SurfaceClass, Scatter) {
        let mut all = Scatter::default();
        let mut top_m = f32::NEG_INFINITY;
        for Surface { points, .. } in members {
            let half = HALF_LENGTH * libm::sqrtf(points.variance_along(level.normal));
            top_m = top_m.max(level.height_m(points.mean_m) + half);
            all = all.joined(points);
        }
        let class = match top_m {
            top if top >= self.settings.min_height_m => SurfaceClass::Vertical,
            _ if level.height_m(all.mean_m).abs() <= self.settings.ground_tolerance_m => SurfaceClass::Ground,
            _ => SurfaceClass::Horizontal,
        };
        (class, all)
    }
}

impl Default for DisparitySegments {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
#[path = "tests/disparity_segments.rs"]
mod tests;
