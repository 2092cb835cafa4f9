//! The detector `cost-map`: what the LAGR robot had first.

use super::{
    CostMapSettings,
    points::{PointSums, row_points},
};
use crate::{
    disparity::DisparityPicture,
    error::ConfigError,
    ground::{GroundPlane, GroundSettings},
    map::{Cell, CellState, Evidence, MapBuilder, UnknownReason, View, Vote},
    surfaces::{CODES, SurfaceClass},
};

/// Points projected into columns over the cells of the map.
///
/// Source: the paper, section 4.1. Columns whose points lie at nearly one height give the ground plane, by orthogonal distance
/// regression over their points; points from 0.25 to 1.25 m above it are counted by column, and their number is the
/// cost of driving there.
///
/// Its weaknesses are those that the paper tells of. Heights are taken in the vehicle's frame, so the points of a column on a
/// slope are spread as if something stood there: steep ground gives no column, the level that the mount promises takes the
/// place of the plane, and the hill is an obstacle. A column of ground with an object on it gives no ground. Costs fade
/// with the distance, because far things have fewer points; false matches that lie near have as many as anything.
///
/// # Bound
/// Four passes of `width x height` steps, two over the cells.
pub struct CostMap {
    settings: CostMapSettings,
    least_upright: f32,
    min_support: f32,
}

/// The heights in a column, while the ground is looked for. They lie where the votes on the column's cell will lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Column {
    /// Points; saturates.
    points: u16,
    /// Mean height above the level of the vehicle, cm; saturates.
    level_cm: i8,
    /// First the sum of the heights above [`LOWEST_MM`], mm; then that of the squares of the deviations from the mean, mm^2.
    /// Saturates.
    sum: u32,
}

/// Heights are kept within 16 bits.
const LOWEST_MM: f32 = -32_768.0;
const HIGHEST_MM: f32 = 32_767.0;

/// Classes of pixels.
const OTHER: u8 = 0;
const GROUND: u8 = 1;
const OBSTACLE: u8 = 2;

/// The classes of the surfaces that the pixels make, where the ground was seen.
pub(crate) const CLASSES: [SurfaceClass; CODES] =
    [SurfaceClass::Undefined, SurfaceClass::Ground, SurfaceClass::Vertical, SurfaceClass::Undefined];

impl CostMap {
    /// A detector that is not configured.
    pub const fn new() -> Self {
        Self { settings: CostMapSettings::UNSET, least_upright: 0.0, min_support: 0.0 }
    }

    /// Takes settings; of those of the ground the largest tilt and the least support count here.
    ///
    /// # Errors
    /// The first setting that cannot be used, named `cost_map.*`.
    pub fn configure(
        &mut self,
        settings: &CostMapSettings,
        ground: &GroundSettings,
        pixels: usize,
    ) -> Result<(), ConfigError> {
        settings.check()?;
        self.settings = *settings;
        self.least_upright = libm::cosf(ground.max_tilt_deg.to_radians());
        self.min_support = ground.min_support_permille * 1.0e-3 * pixels as f32;
        Ok(())
    }

    /// The ground plane that the flat columns give; `None` where there are too few, or where it is too steep. What was said of the
    /// cells of `map` before is lost.
    pub(crate) fn ground<const CELLS: usize, const DISPARITIES: usize>(
        &self,
        picture: DisparityPicture<'_>,
        view: &View<'_, DISPARITIES>,
        map: &mut MapBuilder<CELLS>,
    ) -> Option<GroundPlane> {
        self.measure(picture, view, map);
        let mut flat = map.table().iter().filter(|slot| self.is_flat(Column::of(slot)));
        let least = usize::from(self.settings.min_columns);
        if least > 0 && flat.nth(least.wrapping_sub(1)).is_none() {
            return None;
        }
        let mut sums = PointSums::default();
        for_each_point(picture, view, map, |slot, point| {
            if self.is_flat(Column::of(slot)) {
                sums.add(point);
            }
        });
        let plane = GroundPlane::through(&sums.scatter(), view.frame)?;
        let plausible = plane.normal[2] >= self.least_upright && plane.camera_height_m > 0.0;
        (plausible && plane.support as f32 >= self.min_support).then_some(plane)
    }

    /// Counts the points above `ground` by column, and gives each pixel its class.
    pub(crate) fn count<const CELLS: usize, const DISPARITIES: usize>(
        &self,
        picture: DisparityPicture<'_>,
        view: &View<'_, DISPARITIES>,
        ground: &GroundPlane,
        map: &mut MapBuilder<CELLS>,
        codes: &mut [u8],
    ) {
        let CostMapSettings { min_height_m, max_height_m, .. } = self.settings;
        map.begin();
        codes.fill(OTHER);
        let mut rows = codes.chunks_exact_mut(picture.width().max(1));
        for y in 0..picture.height() {
            let Some(codes) = rows.next() else { break };
            for (x, point) in row_points(picture, view.depth, view.rays, y) {
                let height_m = ground.height_m(point);
                let (code, vote) = match height_m {
                    h if h >= min_height_m && h <= max_height_m => (OBSTACLE, Vote::Obstacle { height_m }),
                    h if h.abs() < min_height_m => (GROUND, Vote::Ground),
                    _ => continue,
                };
                if let Some(slot) = codes.get_mut(x) {
                    *slot = code;
                }
                map.vote(view.place.to_vehicle([point[0], point[1]]), vote);
            }
        }
    }

    /// What the counts make of a cell, whatever else was made of it. Without ground nothing is free.
    pub(crate) fn verdict(&self, counted: &Evidence, cell: Cell, ground_seen: bool) -> Cell {
        let cost = counted.obstacle;
        let unknown = |reason| Cell { state: CellState::Unknown(reason), cost, ..Cell::default() };
        match cell.state {
            CellState::Unknown(UnknownReason::TooFar) => unknown(UnknownReason::TooFar),
            _ if cost >= self.settings.obstacle_cost => {
                let height_dm = counted.height_dm;
                Cell { state: CellState::Obstacle, pixels: cost, height_dm, cost, ..Cell::CERTAIN }
            }
            _ if cost == 0 && ground_seen && counted.ground >= self.settings.min_points => {
                Cell { state: CellState::Free, pixels: counted.ground, ..Cell::CERTAIN }
            }
            CellState::Unknown(reason) => unknown(reason),
            CellState::Free | CellState::Obstacle => unknown(UnknownReason::TooFewPixels),
        }
    }

    /// Mean and squared deviations of the heights in each column.
    fn measure<const CELLS: usize, const DISPARITIES: usize>(
        &self,
        picture: DisparityPicture<'_>,
        view: &View<'_, DISPARITIES>,
        map: &mut MapBuilder<CELLS>,
    ) {
        let height_mm = |point: [f32; 3]| libm::roundf((point[2] * 1000.0).clamp(LOWEST_MM, HIGHEST_MM)) as i32;
        map.begin();
        for_each_point(picture, view, map, |slot, point| {
            let column = Column::of(slot);
            if column.points < u16::MAX {
                let sum = column.sum.saturating_add(height_mm(point).abs_diff(LOWEST_MM as i32));
                Column { points: column.points + 1, sum, ..column }.put(slot);
            }
        });
        for slot in map.table() {
            let Column { points, sum, .. } = Column::of(slot);
            let mean_mm = sum as f32 / f32::from(points.max(1)) + LOWEST_MM;
            Column { points, level_cm: libm::roundf(0.1 * mean_mm) as i8, sum: 0 }.put(slot);
        }
        for_each_point(picture, view, map, |slot, point| {
            let column = Column::of(slot);
            let off = height_mm(point).abs_diff(10 * i32::from(column.level_cm));
            Column { sum: column.sum.saturating_add(off.saturating_mul(off)), ..column }.put(slot);
        });
    }

    fn is_flat(&self, column: Column) -> bool {
        let CostMapSettings { max_deviation_m, min_points, max_level_m, .. } = self.settings;
        let deviation_m = 1.0e-3 * libm::sqrtf(column.sum as f32 / f32::from(column.points.max(1)));
        let level_m = 1.0e-2 * f32::from(column.level_cm);
        column.points >= min_points && deviation_m <= max_deviation_m && level_m.abs() <= max_level_m
    }
}

impl Default for CostMap {
    fn default() -> Self {
        Self::new()
    }
}

impl Column {
    const fn of(slot: &Evidence) -> Self {
        let sum = (slot.obstacle as u32) << 16 | slot.unclear as u32;
        Self { points: slot.ground, level_cm: slot.height_dm as i8, sum }
    }

    const fn put(self, slot: &mut Evidence) {
        let Self { points, level_cm, sum } = self;
        *slot =
            Evidence { obstacle: (sum >> 16) as u16, unclear: sum as u16, ground: points, height_dm: level_cm as u8 };
    }
}

/// Calls `look` with every point of the picture that lies in a column of the map.
fn for_each_point<const CELLS: usize, const DISPARITIES: usize>(
    picture: DisparityPicture<'_>,
    view: &View<'_, DISPARITIES>,
    map: &mut MapBuilder<CELLS>,
    mut look: impl FnMut(&mut Evidence, [f32; 3]),
) {
    let geometry = map.geometry();
    let table = map.table();
    for y in 0..picture.height() {
        for (_, point) in row_points(picture, view.depth, view.rays, y) {
            let [x, y] = view.place.to_vehicle([point[0], point[1]]);
            if let Some(slot) = geometry.index_at(x, y).and_then(|place| table.get_mut(place)) {
                look(slot, point);
            }
        }
    }
}

#[cfg(test)]
#[path = "tests/cost_map.rs"]
mod tests;
