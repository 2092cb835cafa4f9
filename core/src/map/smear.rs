//! Obstacle cells that are only what the matching window smears of the obstacle before them.

use super::{Cell, CellState, MapSettings, ObstacleMap, UnknownReason};
use crate::{
    geometry::Place,
    work::{self, Loop},
};

/// Takes out obstacle cells that have few pixels beside the obstacle cells nearer to the pair at `place` in the same direction.
///
/// Beside the edge of a thing the window sees the thing and what lies behind it, and finds a disparity between the two: a few
/// pixels of each obstacle come to lie behind it. What hides behind an obstacle, they cannot tell.
///
/// # Bound
/// One pass over the cells, each with at most 2 x `smear_cells` steps.
pub(super) fn take_out<const CELLS: usize>(map: &mut ObstacleMap<CELLS>, place: &Place, settings: &MapSettings) {
    let geometry = map.geometry;
    let size = geometry.cell_size_m();
    // Cells lie in the order of their distance ahead: from the far end, none is looked at after it was taken out.
    for index in (0..map.cells.len()).rev() {
        let Some(cell) = map.cells.get(index).filter(|cell| cell.state == CellState::Obstacle) else { continue };
        let (i, j) = geometry.cell_at(index);
        let [x, y] = place.to_pair(geometry.centre_m(i, j).into());
        let fewest = f32::from(cell.pixels) / settings.smear_share.max(f32::MIN_POSITIVE);
        // Where the lines of sight to both sides of the cell pass: they may lie to either side of the border of two cells, and a thing
        // that stands on it has its pixels in both.
        let smears = (1..=settings.smear_cells).any(|back| {
            let part = 1.0 - f32::from(back) * size / x.max(size);
            let [ahead, aside] = place.to_vehicle([x * part, y * part]);
            work::count(Loop::MapSmears, 2);
            let [right, left] = [-0.5, 0.5].map(|side| geometry.index_at(ahead, aside + side * part * size));
            let pixels = |before: Option<usize>| {
                let before = before.filter(|&before| before != index).and_then(|before| map.cells.get(before));
                before
                    .filter(|before| before.state == CellState::Obstacle)
                    .map_or(0.0, |before| f32::from(before.pixels))
            };
            let before = pixels(right) + if left == right { 0.0 } else { pixels(left) };
            before > 0.0 && before >= fewest
        });
        if let Some(cell) = map.cells.get_mut(index).filter(|_| smears) {
            *cell = Cell { state: CellState::Unknown(UnknownReason::Hidden), cost: cell.cost, ..Cell::default() };
        }
    }
}

#[cfg(test)]
#[path = "smear_tests.rs"]
mod tests;
