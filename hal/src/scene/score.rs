//! Compares cells that were reported with those that are really there.

use fencepost_core::map::{Cell, CellState, MapGeometry};

use super::truth::{TruthCell, TruthCells};

/// Counts over any number of frames, and the rates made of them. One cell of slack in every direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Score {
    /// Cells that are obstacles.
    pub obstacles: u32,
    /// ... with an obstacle reported within one cell.
    pub obstacles_found: u32,
    /// ... that are reported free, with no obstacle reported within one cell: the dangerous miss.
    pub obstacles_called_free: u32,
    /// Cells reported as obstacles, within one cell of a judged one.
    pub reported: u32,
    /// ... with an obstacle within one cell.
    pub reported_true: u32,
    /// Cells that are free.
    pub free: u32,
    /// ... that are reported free.
    pub free_found: u32,
    /// Free cells with no obstacle within one cell.
    pub clear: u32,
    /// ... that are reported as obstacles.
    pub clear_called_obstacle: u32,
}

/// Scores the cells reported for one frame, in the order of [`MapGeometry::index`] of `geometry`.
///
/// Both maps must have cells of the same size; cells that one of them lacks count as unknown.
///
/// # Bound
/// Thirty looks at either map for each cell of the truth.
pub fn score(truth: &TruthCells, geometry: &MapGeometry, cells: &[Cell]) -> Score {
    let said = |i: i16, j: i16| geometry.index(i, j).and_then(|index| cells.get(index)).map(|cell| cell.state);
    let is_said = |i: i16, j: i16, state: CellState| said(i, j) == Some(state);
    let mut score = Score::default();
    // One more cell all around: reports just outside the range are near, and are left out by `judges`.
    for index in 0..truth.geometry.len() {
        let (i, j) = truth.geometry.cell_at(index);
        let said_near = near(i, j, |i, j| is_said(i, j, CellState::Obstacle));
        let obstacle_near = near(i, j, |i, j| truth.get(i, j) == TruthCell::Obstacle);
        match truth.get(i, j) {
            TruthCell::Obstacle => {
                score.obstacles += 1;
                score.obstacles_found += u32::from(said_near);
                score.obstacles_called_free += u32::from(is_said(i, j, CellState::Free) && !said_near);
            }
            TruthCell::Free => {
                score.free += 1;
                score.free_found += u32::from(is_said(i, j, CellState::Free));
                score.clear += u32::from(!obstacle_near);
                score.clear_called_obstacle += u32::from(!obstacle_near && is_said(i, j, CellState::Obstacle));
            }
            TruthCell::NotJudged => {}
        }
        let judged_near = near(i, j, |i, j| truth.get(i, j) != TruthCell::NotJudged);
        if is_said(i, j, CellState::Obstacle) && truth.judges(i, j) && judged_near {
            score.reported += 1;
            score.reported_true += u32::from(obstacle_near);
        }
    }
    score
}

impl Score {
    /// Share of the obstacles that were found.
    pub fn recall(&self) -> f32 {
        share(self.obstacles_found, self.obstacles)
    }

    /// Share of the reported obstacles that are there.
    pub fn precision(&self) -> f32 {
        share(self.reported_true, self.reported)
    }

    /// Harmonic mean of recall and precision.
    pub fn f1(&self) -> f32 {
        let (r, p) = (self.recall(), self.precision());
        2.0 * r * p / (r + p).max(1.0e-9)
    }

    /// Share of the clear cells that are reported as obstacles.
    pub fn false_alarm(&self) -> f32 {
        share(self.clear_called_obstacle, self.clear)
    }

    /// Share of the obstacles that are reported free.
    pub fn missed_free(&self) -> f32 {
        share(self.obstacles_called_free, self.obstacles)
    }

    /// Share of the free cells that are reported free.
    pub fn free_found_share(&self) -> f32 {
        share(self.free_found, self.free)
    }
}

impl core::ops::AddAssign for Score {
    fn add_assign(&mut self, o: Self) {
        self.obstacles += o.obstacles;
        self.obstacles_found += o.obstacles_found;
        self.obstacles_called_free += o.obstacles_called_free;
        self.reported += o.reported;
        self.reported_true += o.reported_true;
        self.free += o.free;
        self.free_found += o.free_found;
        self.clear += o.clear;
        self.clear_called_obstacle += o.clear_called_obstacle;
    }
}

fn near(i: i16, j: i16, mut is: impl FnMut(i16, i16) -> bool) -> bool {
    (-1..=1).any(|a| (-1..=1).any(|b| is(i.saturating_add(a), j.saturating_add(b))))
}

fn share(part: u32, whole: u32) -> f32 {
    part as f32 / whole.max(1) as f32
}
