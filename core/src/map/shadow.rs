//! Cells behind obstacles.

use super::{CellState, ObstacleMap, UnknownReason};
use crate::{
    geometry::Place,
    work::{self, Loop},
};

/// Number of directions that are told apart.
const DIRECTIONS: usize = 128;

/// Largest sideways distance per metre ahead that is looked at: 63 degrees to either side.
const REACH: f32 = 2.0;

/// Says of cells that were not seen that an obstacle hides them, if one lies in the same direction from the pair at `place` and
/// nearer.
///
/// # Bound
/// Two passes over the cells, each with at most [`DIRECTIONS`] steps for an obstacle.
pub(super) fn mark<const CELLS: usize>(map: &mut ObstacleMap<CELLS>, place: &Place) {
    let mut nearest_x = [f32::INFINITY; DIRECTIONS];
    let geometry = map.geometry;
    let half = 0.5 * geometry.cell_size_m();
    // Corners and middle of a cell, seen from the camera.
    let at = |index: usize, dx: f32, dy: f32| {
        let (i, j) = geometry.cell_at(index);
        let (x, y) = geometry.centre_m(i, j);
        place.to_pair([x + dx, y + dy])
    };
    for (index, cell) in map.cells.iter().enumerate() {
        if cell.state != CellState::Obstacle {
            continue;
        }
        let corners = [(-half, -half), (-half, half), (half, -half), (half, half)].map(|(dx, dy)| at(index, dx, dy));
        if corners.iter().any(|[x, _]| *x <= 0.0) {
            continue;
        }
        let [x, _] = at(index, 0.0, 0.0);
        let directions = corners.map(|[x, y]| direction(y, x));
        let (right, left) = directions.iter().fold((DIRECTIONS - 1, 0), |(low, high), &d| (low.min(d), high.max(d)));
        work::count(Loop::MapShadows, (left + 1).saturating_sub(right));
        for nearest in nearest_x.iter_mut().take(left + 1).skip(right) {
            *nearest = nearest.min(x);
        }
    }
    work::count(Loop::MapCells, map.cells.len());
    for (index, cell) in map.cells.iter_mut().enumerate() {
        let [x, y] = at(index, 0.0, 0.0);
        let unseen = matches!(
            cell.state,
            CellState::Unknown(UnknownReason::LowTexture | UnknownReason::NoMatch | UnknownReason::TooFewPixels)
        );
        if unseen && x > 0.0 && y.abs() < REACH * x && nearest_x[direction(y, x)] < x {
            cell.state = CellState::Unknown(UnknownReason::Hidden);
        }
    }
}

/// The direction in which `(x, y)` lies, from right to left.
fn direction(y: f32, x: f32) -> usize {
    let tangent = (y / x).clamp(-REACH, REACH);
    let place = (tangent + REACH) * (DIRECTIONS as f32 / (2.0 * REACH));
    (place as usize).min(DIRECTIONS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_rise_from_right_to_left_and_none_is_beyond_the_last() {
        for x in [0.1_f32, 0.7, 1.0, 3.3, 29.0] {
            let edge = REACH * x;
            for y in [edge.next_down(), edge, 10.0 * edge, f32::INFINITY] {
                assert_eq!((direction(y, x), direction(-y, x)), (DIRECTIONS - 1, 0), "{y} at {x}");
            }
            for step in 0..DIRECTIONS {
                // In the middle of the direction.
                let tangent = (step as f32 + 0.5) / 32.0 - 2.0;
                assert_eq!(direction(tangent * x, x), step);
            }
        }
    }
}
