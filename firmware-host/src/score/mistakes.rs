//! Which cells are wrong.

use std::collections::BTreeMap;

use super::{
    CellIndex, Said, TrueCells,
    cells::{is_counted, near},
};

/// What is wrong with a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Mistake {
    /// An obstacle is there, and none is reported within one cell.
    Missed,
    /// The same, and the cell is reported free: the dangerous miss.
    CalledFree,
    /// An obstacle is reported, and none is there within one cell.
    NotThere,
}

/// The cells of a frame that are wrong, in their order.
///
/// # Bound
/// Nine looks at the other side for each cell.
pub fn mistakes(truth: &TrueCells, said: &Said) -> BTreeMap<CellIndex, Mistake> {
    let missed = truth.obstacles.iter().filter(|cell| !near(&said.obstacles, **cell)).map(|cell| {
        let mistake = if said.free.contains(cell) { Mistake::CalledFree } else { Mistake::Missed };
        (*cell, mistake)
    });
    let not_there = said.obstacles.iter().filter(|cell| is_counted(truth, **cell) && !near(&truth.obstacles, **cell));
    missed.chain(not_there.map(|cell| (*cell, Mistake::NotThere))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_mistake_has_its_kind() {
        let truth = TrueCells {
            obstacles: [(20, 0), (25, 0), (30, 0)].into(),
            free: [(20, 8), (10, 0)].into(),
            cell_size_mm: 500,
        };
        let said = Said { obstacles: [(21, 1), (20, 9), (35, 5)].into(), free: [(25, 0), (10, 0)].into() };
        let found: Vec<_> = mistakes(&truth, &said).into_iter().collect();
        // The obstacle at (35, 5) is far from anything that was judged.
        assert_eq!(found, [((20, 9), Mistake::NotThere), ((25, 0), Mistake::CalledFree), ((30, 0), Mistake::Missed)]);
    }
}
