//! The figures of a score, for tables.

use super::{CellScore, DisparityScore};

/// A figure of a score: what it is called, what it means, and which way is better.
#[derive(Clone, Copy, Debug)]
pub struct Figure<S> {
    /// Name in files.
    pub name: &'static str,
    /// Name for people.
    pub title: &'static str,
    /// What it means.
    pub words: &'static str,
    /// Digits behind the point that are worth showing.
    pub digits: usize,
    /// Whether more is better.
    pub more_is_better: bool,
    /// Its value; `None` where there is none.
    pub value: fn(&S) -> Option<f64>,
}

/// The figures of cells.
pub const CELL_FIGURES: [Figure<CellScore>; 6] = [
    Figure {
        name: "f1",
        title: "F1",
        words: "recall and precision in one figure, their harmonic mean",
        digits: 3,
        more_is_better: true,
        value: |score| Some(score.f1),
    },
    Figure {
        name: "recall",
        title: "recall",
        words: "obstacle cells of the truth with a reported one within a cell",
        digits: 3,
        more_is_better: true,
        value: |score| Some(score.recall),
    },
    Figure {
        name: "precision",
        title: "precision",
        words: "reported obstacle cells with one of the truth within a cell",
        digits: 3,
        more_is_better: true,
        value: |score| Some(score.precision),
    },
    Figure {
        name: "false_alarm",
        title: "false alarms",
        words: "free cells away from any obstacle that are reported as obstacles",
        digits: 4,
        more_is_better: false,
        value: |score| Some(score.false_alarm),
    },
    Figure {
        name: "missed_free",
        title: "missed, called free",
        words: "obstacle cells that are reported free, and nothing beside them: the dangerous miss",
        digits: 4,
        more_is_better: false,
        value: |score| Some(score.missed_free),
    },
    Figure {
        name: "free_found",
        title: "free found",
        words: "free cells of the truth that are reported free",
        digits: 3,
        more_is_better: true,
        value: |score| Some(score.free_found),
    },
];

/// The figures of disparity.
pub const DISPARITY_FIGURES: [Figure<DisparityScore>; 5] = [
    Figure {
        name: "density",
        title: "density",
        words: "pixels with truth that have a value",
        digits: 3,
        more_is_better: true,
        value: |score| Some(score.density),
    },
    Figure {
        name: "bad1",
        title: "off by 1 px",
        words: "of those, off by more than 1 px",
        digits: 4,
        more_is_better: false,
        value: |score| Some(score.bad1),
    },
    Figure {
        name: "bad3",
        title: "off by 3 px",
        words: "of those, off by more than 3 px",
        digits: 4,
        more_is_better: false,
        value: |score| Some(score.bad3),
    },
    Figure {
        name: "good3",
        title: "good",
        words: "pixels with truth that have a value within 3 px",
        digits: 3,
        more_is_better: true,
        value: |score| Some(score.good3),
    },
    Figure {
        name: "median",
        title: "median error, px",
        words: "half of the values are off by no more",
        digits: 3,
        more_is_better: false,
        value: |score| score.median,
    },
];

impl<S> Figure<S> {
    /// The value as text; a dash where there is none.
    pub fn text(&self, score: &S) -> String {
        let digits = self.digits;
        (self.value)(score).map_or_else(|| "–".to_string(), |value| format!("{value:.digits$}"))
    }

    /// Whether `score` is shown as good as the best of `all`.
    pub fn is_best<'a>(&self, score: &S, all: impl IntoIterator<Item = &'a S>) -> bool
    where
        S: 'a,
    {
        let sign = if self.more_is_better { 1.0 } else { -1.0 };
        let best = all.into_iter().filter_map(self.value).map(|value| sign * value).fold(f64::NEG_INFINITY, f64::max);
        let shown_alike = 0.5 * 0.1_f64.powi(self.digits as i32);
        (self.value)(score).is_some_and(|value| sign * value > best - shown_alike)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_files() {
        let score = CellScore {
            frames: 1,
            truth_obstacle_cells: 2,
            truth_free_cells: 3,
            recall: 0.1,
            precision: 0.2,
            f1: 0.3,
            false_alarm: 0.4,
            missed_free: 0.5,
            free_found: 0.6,
        };
        let json = serde_json::to_value(score).unwrap();
        for figure in CELL_FIGURES {
            assert_eq!(json[figure.name].as_f64(), (figure.value)(&score), "{}", figure.name);
        }
        let score = DisparityScore { pixels: 1, density: 0.1, bad1: 0.2, bad3: 0.3, good3: 0.4, median: Some(0.5) };
        let json = serde_json::to_value(score).unwrap();
        for figure in DISPARITY_FIGURES {
            assert_eq!(json[figure.name].as_f64(), (figure.value)(&score), "{}", figure.name);
        }
    }

    #[test]
    fn the_best_is_the_least_where_less_is_better() {
        let scores = [0.02, 0.01, 0.0100004, 0.5].map(|bad3| DisparityScore {
            pixels: 1,
            density: bad3,
            bad1: 0.0,
            bad3,
            good3: 0.0,
            median: None,
        });
        let best = |figure: &Figure<DisparityScore>| scores.map(|score| figure.is_best(&score, &scores));
        assert_eq!(best(&DISPARITY_FIGURES[2]), [false, true, true, false]);
        assert_eq!(best(&DISPARITY_FIGURES[0]), [false, false, false, true]);
        assert_eq!(best(&DISPARITY_FIGURES[4]), [false; 4]);
        assert_eq!(DISPARITY_FIGURES[4].text(&scores[0]), "–");
    }
}
