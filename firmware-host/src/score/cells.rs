//! Cells that were reported, against those that are really there. One cell of slack in every direction.

use std::{collections::HashSet, ops::AddAssign};

use fencepost_core::map::CellState;
use serde::Serialize;

use super::{
    CellIndex, TrueCells,
    lidar::{around, cell_size_m, is_judged},
    share,
};
use crate::output::CellRow;

/// The cells that were reported of a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Said {
    /// Cells reported as obstacles.
    pub obstacles: HashSet<CellIndex>,
    /// Cells reported free.
    pub free: HashSet<CellIndex>,
}

/// Counts over any number of frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CellCounts {
    frames: u64,
    obstacles: u64,
    obstacles_found: u64,
    obstacles_called_free: u64,
    reported: u64,
    reported_true: u64,
    free: u64,
    free_found: u64,
    clear: u64,
    clear_called_obstacle: u64,
}

impl AddAssign for CellCounts {
    fn add_assign(&mut self, other: Self) {
        self.frames += other.frames;
        self.obstacles += other.obstacles;
        self.obstacles_found += other.obstacles_found;
        self.obstacles_called_free += other.obstacles_called_free;
        self.reported += other.reported;
        self.reported_true += other.reported_true;
        self.free += other.free;
        self.free_found += other.free_found;
        self.clear += other.clear;
        self.clear_called_obstacle += other.clear_called_obstacle;
    }
}

/// What the cells are worth. The names are those of the field's scripts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CellScore {
    /// Frames with truth.
    pub frames: u64,
    /// Cells that hold an obstacle.
    pub truth_obstacle_cells: u64,
    /// Cells that are free.
    pub truth_free_cells: u64,
    /// Share of the obstacle cells that have a reported obstacle within one cell.
    pub recall: f64,
    /// Share of the reported obstacle cells, within one cell of a judged one, that have an obstacle within one cell.
    pub precision: f64,
    /// Harmonic mean of recall and precision.
    pub f1: f64,
    /// Share of the free cells without an obstacle within one cell that are reported as obstacles.
    pub false_alarm: f64,
    /// Share of the obstacle cells that are reported free with no obstacle reported within one cell: the dangerous miss.
    pub missed_free: f64,
    /// Share of the free cells that are reported free.
    pub free_found: f64,
}

impl Said {
    /// The cells of a frame that are not unknown.
    pub fn of(rows: &[CellRow]) -> Self {
        let mut said = Self::default();
        for row in rows {
            let cell = (i32::from(row.cell.0), i32::from(row.cell.1));
            match row.content.state {
                CellState::Obstacle => said.obstacles.insert(cell),
                CellState::Free => said.free.insert(cell),
                CellState::Unknown(_) => false,
            };
        }
        said
    }
}

impl CellCounts {
    /// The counts of one frame.
    ///
    /// # Bound
    /// Nine looks at the other side for each cell.
    pub fn of_frame(truth: &TrueCells, said: &Said) -> Self {
        let count = |cells: &HashSet<CellIndex>, is: &dyn Fn(CellIndex) -> bool| {
            cells.iter().filter(|cell| is(**cell)).count() as u64
        };
        let said_near = |cell| near(&said.obstacles, cell);
        let truth_near = |cell| near(&truth.obstacles, cell);
        let is_counted = |cell| is_counted(truth, cell);
        Self {
            frames: 1,
            obstacles: truth.obstacles.len() as u64,
            obstacles_found: count(&truth.obstacles, &said_near),
            obstacles_called_free: count(&truth.obstacles, &|c| said.free.contains(&c) && !said_near(c)),
            reported: count(&said.obstacles, &is_counted),
            reported_true: count(&said.obstacles, &|c| is_counted(c) && truth_near(c)),
            free: truth.free.len() as u64,
            free_found: count(&truth.free, &|c| said.free.contains(&c)),
            clear: count(&truth.free, &|c| !truth_near(c)),
            clear_called_obstacle: count(&truth.free, &|c| !truth_near(c) && said.obstacles.contains(&c)),
        }
    }

    /// The figures; `None` without a frame.
    pub fn score(&self) -> Option<CellScore> {
        let recall = share(self.obstacles_found, self.obstacles);
        let precision = share(self.reported_true, self.reported);
        (self.frames > 0).then(|| CellScore {
            frames: self.frames,
            truth_obstacle_cells: self.obstacles,
            truth_free_cells: self.free,
            recall,
            precision,
            f1: 2.0 * precision * recall / (precision + recall).max(1.0e-9),
            false_alarm: share(self.clear_called_obstacle, self.clear),
            missed_free: share(self.obstacles_called_free, self.obstacles),
            free_found: share(self.free_found, self.free),
        })
    }
}

/// Whether a reported cell says anything about the detector: it lies where cells are judged, within one cell of one that is.
pub(super) fn is_counted(truth: &TrueCells, cell: CellIndex) -> bool {
    is_judged(cell, cell_size_m(truth.cell_size_mm)) && (near(&truth.obstacles, cell) || near(&truth.free, cell))
}

pub(super) fn near(cells: &HashSet<CellIndex>, cell: CellIndex) -> bool {
    around(cell).any(|neighbour| cells.contains(&neighbour))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(truth: [&[CellIndex]; 2], said: [&[CellIndex]; 2]) -> CellScore {
        let set = |cells: &[CellIndex]| cells.iter().copied().collect::<HashSet<_>>();
        let truth = TrueCells { obstacles: set(truth[0]), free: set(truth[1]), cell_size_mm: 500 };
        let said = Said { obstacles: set(said[0]), free: set(said[1]) };
        CellCounts::of_frame(&truth, &said).score().unwrap()
    }

    #[test]
    fn a_cell_of_slack_is_allowed_and_two_are_not() {
        let truth = [&[(20, 0)][..], &[(20, 3), (23, 0)]];
        let diagonal = score(truth, [&[(21, 1)], &[]]);
        assert_eq!((diagonal.recall, diagonal.precision, diagonal.f1), (1.0, 1.0, 1.0));
        let two_off = score(truth, [&[(22, 0)], &[]]);
        assert_eq!((two_off.recall, two_off.precision, two_off.f1, two_off.false_alarm), (0.0, 0.0, 0.0, 0.0));
    }

    #[test]
    fn free_cells_at_an_obstacle_are_no_false_alarm() {
        let truth = [&[(20, 0)][..], &[(21, 0), (30, 0), (30, 5), (30, 9)]];
        let found = score(truth, [&[(21, 0), (30, 0)], &[(30, 5)]]);
        assert_eq!(found.false_alarm, 1.0 / 3.0, "of the three that are not beside the obstacle");
        assert_eq!((found.free_found, found.truth_free_cells), (0.25, 4));
        assert_eq!(found.precision, 0.5);
    }

    #[test]
    fn an_obstacle_called_free_is_dangerous_unless_one_is_told_beside_it() {
        let truth = [&[(20, 0), (30, 0), (35, 0), (38, 0)][..], &[]];
        let found = score(truth, [&[(31, 0)], &[(20, 0), (30, 0)]]);
        assert_eq!((found.missed_free, found.recall), (0.25, 0.25));
    }

    #[test]
    fn reports_far_from_what_is_judged_say_nothing() {
        let truth = [&[(20, 0)][..], &[]];
        // Not seen by the lidar; nearer than 4 m; farther than 20 m.
        let found = score(truth, [&[(25, 0), (7, 0), (40, 0), (20, 1)], &[]]);
        assert_eq!((found.precision, found.recall), (1.0, 1.0));
        let edge = [&[(8, 0), (39, 19)][..], &[]];
        assert_eq!(score(edge, [&[(7, 0), (40, 19), (39, 20)], &[]]).precision, 0.0, "of cells judged there is none");
        assert_eq!(score(edge, [&[(7, 0), (40, 19), (39, 20)], &[]]).recall, 1.0, "but they are near");
    }

    #[test]
    fn frames_add_up() {
        let set = |cells: &[CellIndex]| cells.iter().copied().collect::<HashSet<_>>();
        let truth = TrueCells { obstacles: set(&[(20, 0), (30, 0)]), free: set(&[(10, 0)]), cell_size_mm: 500 };
        let found = Said { obstacles: set(&[(20, 0)]), free: set(&[(10, 0)]) };
        let mut counts = CellCounts::of_frame(&truth, &found);
        counts += CellCounts::of_frame(&truth, &Said::default());
        let score = counts.score().unwrap();
        assert_eq!((score.frames, score.recall, score.free_found, score.precision), (2, 0.25, 0.5, 1.0));
    }

    #[test]
    fn no_frame_has_no_score_and_an_empty_one_has_zeros() {
        assert_eq!(CellCounts::default().score(), None);
        let empty = score([&[], &[]], [&[], &[]]);
        assert_eq!((empty.frames, empty.recall, empty.precision, empty.f1), (1, 0.0, 0.0, 0.0));
    }
}
