//! The table of runs where it is smaller than it is told to be.

use heapless::Vec;

use super::*;

fn run(i: i8, length: u8) -> Run {
    Run { i, j: 0, length, obstacle: true }
}

#[test]
fn a_run_without_room_is_dropped_with_all_its_cells() {
    let mut table = Vec::<Run, 2, u16>::new();
    let dropped = [run(1, 1), run(2, 2), run(3, 3)].map(|run| insert(table.as_mut_view(), 5, run));
    assert_eq!(dropped, [0, 0, 3]);
    assert_eq!(table[..], [run(1, 1), run(2, 2)]);
}

#[test]
fn what_is_not_in_the_table_is_exchanged_for_nothing() {
    let before = [run(1, 1), run(2, 2)];
    for (a, b, expected) in [(0, 1, [before[1], before[0]]), (0, 2, before), (2, 1, before)] {
        let mut table = before;
        exchange(&mut table, a, b);
        assert_eq!(table, expected, "{a} and {b}");
    }
}
