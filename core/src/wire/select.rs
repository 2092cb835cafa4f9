//! From cells to runs: which of them are sent, and in which order.

use heapless::VecView;

use crate::map::{Cell, CellState, MapGeometry};
use crate::work::{self, Loop};

use super::message::{CELL_INDEX_MAX, CELL_INDEX_MIN, HeaderRepr, MAX_RUN_LENGTH, Run};

/// How many cells go into the runs, and how many do not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Selection {
    /// Cells in the runs.
    pub cells: u16,
    /// Known cells that are in no run.
    pub dropped: u32,
}

/// Fills `runs` with at most `limit` runs of known cells in the order of [`Run::rank`]: those with the lowest ranks.
///
/// While the table is being filled it is a heap with the highest rank at the root, so that each further run costs one look at
/// the root, and the table needs no room for more runs than are sent.
///
/// # Bound
/// The cells once; for each run the logarithm of `limit`, twice.
pub(super) fn select(geometry: &MapGeometry, cells: &[Cell], limit: usize, runs: &mut VecView<Run, u16>) -> Selection {
    runs.clear();
    let limit = limit.min(runs.capacity());
    let mut dropped: u32 = 0;
    let mut keep = |run: Run| dropped = dropped.saturating_add(insert(runs, limit, run));
    let mut unsendable: u32 = 0;

    let columns = usize::from(geometry.y_count).max(1);
    let rows = usize::from(if geometry.y_count == 0 { 0 } else { geometry.x_count });
    for (row, a) in cells.chunks(columns).zip(0..rows) {
        let i = index(geometry.x_first, a);
        let mut open: Option<Run> = None;
        work::count(Loop::WireCells, row.len());
        for (b, cell) in row.iter().enumerate() {
            let obstacle = match cell.state {
                CellState::Unknown(_) => None,
                CellState::Free => Some(false),
                CellState::Obstacle => Some(true),
            };
            let place = i.zip(index(geometry.y_first, b));
            match (obstacle, place, &mut open) {
                (Some(obstacle), Some(_), Some(run)) if run.obstacle == obstacle && run.length < MAX_RUN_LENGTH => {
                    run.length += 1;
                }
                (Some(obstacle), Some((i, j)), _) => {
                    open.replace(Run { i, j, length: 1, obstacle }).into_iter().for_each(&mut keep);
                }
                _ => {
                    unsendable = unsendable.saturating_add(u32::from(obstacle.is_some()));
                    open.take().into_iter().for_each(&mut keep);
                }
            }
        }
        open.into_iter().for_each(&mut keep);
    }

    sort(runs);
    let mut selection = Selection { cells: 0, dropped: dropped.saturating_add(unsendable) };
    let mut total = runs.iter().fold(0u32, |total, run| total.saturating_add(u32::from(run.length)));
    while total > HeaderRepr::CELL_COUNT.max() {
        let length = runs.pop().map_or(0, |run| u32::from(run.length));
        total = total.saturating_sub(length);
        selection.dropped = selection.dropped.saturating_add(length);
    }
    selection.cells = total as u16;
    selection
}

/// The index `offset` places after `first`, if it can be sent.
fn index(first: i16, offset: usize) -> Option<i8> {
    let index = i32::from(first).saturating_add(i32::try_from(offset).ok()?);
    i8::try_from(index).ok().filter(|index| (CELL_INDEX_MIN..=CELL_INDEX_MAX).contains(index))
}

/// Adds `run` to the heap, or exchanges the root for it if that has a higher rank. Returns how many cells fell out.
fn insert(heap: &mut VecView<Run, u16>, limit: usize, run: Run) -> u32 {
    // The list counts in 16 bits.
    if heap.len() < limit.min(usize::from(u16::MAX)) {
        if heap.push(run).is_err() {
            return u32::from(run.length);
        }
        if heap.len() >= limit {
            heapify(heap);
        }
        return 0;
    }
    match heap.first_mut() {
        Some(root) if run.rank() < root.rank() => {
            let fallen = core::mem::replace(root, run);
            sift_down(heap, 0);
            u32::from(fallen.length)
        }
        _ => u32::from(run.length),
    }
}

/// Turns the heap into a list with rising ranks: the end of a heap sort.
fn sort(heap: &mut [Run]) {
    // It is none yet if there was room for all.
    heapify(heap);
    for len in (1..heap.len()).rev() {
        exchange(heap, 0, len);
        if let Some(rest) = heap.get_mut(..len) {
            sift_down(rest, 0);
        }
    }
}

/// Makes a heap of runs in any order, in as many exchanges as there are runs at most (Floyd, *Algorithm 245*, CACM 7(12), 1964).
fn heapify(heap: &mut [Run]) {
    for parent in (0..heap.len() / 2).rev() {
        sift_down(heap, parent);
    }
}

fn sift_down(heap: &mut [Run], mut parent: usize) {
    loop {
        let left = parent.saturating_mul(2).saturating_add(1);
        let right = left.saturating_add(1);
        let child = if is_higher(heap, right, left) { right } else { left };
        if !is_higher(heap, child, parent) {
            return;
        }
        exchange(heap, child, parent);
        parent = child;
    }
}

/// Whether both exist and the first has the higher rank.
fn is_higher(heap: &[Run], a: usize, b: usize) -> bool {
    heap.get(a).zip(heap.get(b)).is_some_and(|(a, b)| a.rank() > b.rank())
}

fn exchange(heap: &mut [Run], a: usize, b: usize) {
    work::count(Loop::WireSifts, 1);
    if a < heap.len() && b < heap.len() {
        heap.swap(a, b);
    }
}

#[cfg(test)]
#[path = "select_tests.rs"]
mod tests;
