//! Cells behind obstacles.

use super::{CellState, ObstacleMap, UnknownReason};

/// Number of directions that are told apart.
const DIRECTIONS: usize = 128;

/// Largest sideways distance per metre ahead that is looked at: 63 degrees to either side.
const REACH: f32 = 2.0;

/// Says of cells that were not seen that an obstacle hides them, if one lies in the same direction and nearer.
///
/// # Bound
/// Two passes over the cells, each with at most [`DIRECTIONS`] steps for an obstacle.
pub(super) fn mark<const CELLS: usize>(map: &mut ObstacleMap<CELLS>) {
    let mut nearest_x = [f32::INFINITY; DIRECTIONS];
    let geometry = map.geometry;
    let half = 0.5 * geometry.cell_size_m();
    let at = |index: usize| {
        let (i, j) = geometry.cell_at(index);
        geometry.centre_m(i, j)
    };
    for (index, cell) in map.cells.iter().enumerate() {
        let (x, y) = at(index);
        if cell.state != CellState::Obstacle || x <= half {
            continue;
        }
        // The corners that lie farthest apart, seen from the camera.
        let right = direction(y - half, if y > half { x + half } else { x - half });
        let left = direction(y + half, if y < -half { x + half } else { x - half });
        for nearest in &mut nearest_x[right.min(left)..=left.max(right)] {
            *nearest = nearest.min(x);
        }
    }
    for (index, cell) in map.cells.iter_mut().enumerate() {
        let (x, y) = at(index);
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
