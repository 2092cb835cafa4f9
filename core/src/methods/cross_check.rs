//! Two detectors that look at the same disparities.

use super::ConfidenceSettings;
use crate::map::{Cell, CellState, Doubt, ObstacleMap, UnknownReason};

/// What the checking detector says of the cells, a byte for each.
pub struct OtherMap<const CELLS: usize> {
    states: [u8; CELLS],
}

/// What the checking detector says of a cell.
const UNKNOWN: u8 = 0;
const FREE: u8 = 1;
const OBSTACLE: u8 = 2;

impl<const CELLS: usize> OtherMap<CELLS> {
    /// Nothing is known.
    pub const fn new() -> Self {
        Self { states: [UNKNOWN; CELLS] }
    }

    /// Keeps what the checking detector found.
    ///
    /// # Bound
    /// One pass over the cells.
    pub fn keep(&mut self, map: &ObstacleMap<CELLS>) {
        self.states.fill(UNKNOWN);
        for (state, cell) in self.states.iter_mut().zip(&map.cells) {
            *state = match cell.state {
                CellState::Unknown(_) => UNKNOWN,
                CellState::Free => FREE,
                CellState::Obstacle => OBSTACLE,
            };
        }
    }

    /// Holds `map` against what was kept. No cell is free that one of the two calls an obstacle; an obstacle stays one.
    ///
    /// # Bound
    /// One pass over the cells.
    pub fn check(&self, map: &mut ObstacleMap<CELLS>, settings: &ConfidenceSettings) {
        for (cell, &other) in map.cells.iter_mut().zip(&self.states) {
            *cell = checked(*cell, other, settings);
        }
    }
}

impl<const CELLS: usize> Default for OtherMap<CELLS> {
    fn default() -> Self {
        Self::new()
    }
}

/// A cell as it is after the other detector was asked.
fn checked(cell: Cell, other: u8, settings: &ConfidenceSettings) -> Cell {
    let doubted = |doubt, percent: u8| Cell { doubt, confidence_percent: cell.confidence_percent.min(percent), ..cell };
    match (cell.state, other) {
        (CellState::Unknown(_), _) | (CellState::Free, FREE) | (CellState::Obstacle, OBSTACLE) => cell,
        (CellState::Free, OBSTACLE) => {
            Cell { state: CellState::Unknown(UnknownReason::Disputed), doubt: Doubt::Disputed, ..Cell::default() }
        }
        (CellState::Obstacle, FREE) => doubted(Doubt::Disputed, settings.disputed_percent),
        (CellState::Free | CellState::Obstacle, _) => doubted(Doubt::Unconfirmed, settings.unconfirmed_percent),
    }
}

#[cfg(test)]
#[path = "tests/cross_check.rs"]
mod tests;
