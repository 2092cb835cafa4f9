//! What a thing smears, on maps that are laid out by hand.

use std::vec::Vec;

use super::take_out;
use crate::{
    geometry::{Mount, Place},
    map::{Cell, CellState, MapGeometry, MapSettings, ObstacleMap, UnknownReason},
};

const GEOMETRY: MapGeometry = MapGeometry { cell_size_mm: 500, x_first: 0, x_count: 40, y_first: -20, y_count: 40 };

/// A map of which nothing is known.
fn unknown() -> ObstacleMap<1600> {
    let mut map = ObstacleMap { geometry: GEOMETRY, cells: heapless::Vec::new() };
    map.cells.resize(GEOMETRY.len(), Cell::default()).unwrap();
    map
}

#[test]
fn obstacles_smear_cells_with_few_pixels_right_behind_them() {
    let settings = MapSettings::default();
    // A thing in cell (10, j) with 400 pixels, and what lies `behind` it in its direction.
    let left_over = |j: i16, behind: &[(i16, u16)], settings: &MapSettings| {
        let mut map = unknown();
        let (x, y) = GEOMETRY.centre_m(10, j);
        let along = |cells: i16| {
            let far = 1.0 + f32::from(cells) * 0.5 / x;
            GEOMETRY.index((x * far / 0.5).floor() as i16, (y * far / 0.5).floor() as i16).unwrap()
        };
        for (cells, pixels) in behind.iter().chain([&(0, 400)]) {
            map.cells[along(*cells)] = Cell { state: CellState::Obstacle, pixels: *pixels, ..Cell::default() };
        }
        take_out(&mut map, &Place::ORIGIN, settings);
        let state = |cells: i16| map.cells[along(cells)].state;
        assert_eq!(state(0), CellState::Obstacle, "the thing itself stays");
        behind.iter().map(|(cells, _)| state(*cells) == CellState::Obstacle).collect::<Vec<_>>()
    };
    for j in [-8, -1, 0, 5] {
        assert_eq!(left_over(j, &[(1, 99)], &settings), [false], "{j}");
        assert_eq!(left_over(j, &[(2, 99)], &settings), [false], "{j}");
        assert_eq!(left_over(j, &[(3, 99)], &settings), [true], "{j}: too far behind");
        assert_eq!(left_over(j, &[(1, 140)], &settings), [true], "{j}: enough of its own");
        // What was taken out still stands for nothing itself.
        assert_eq!(left_over(j, &[(2, 90), (3, 20)], &settings), [false, false], "{j}");
        let never = MapSettings { smear_share: 0.0, ..settings };
        assert_eq!(left_over(j, &[(1, 1)], &never), [true], "{j}");
    }
}

#[test]
fn a_thing_on_the_border_of_two_cells_smears_with_the_pixels_of_both() {
    let settings = MapSettings::default();
    // Seen from five metres to the right, the line of sight to the last cell passes the border between the two before it.
    let place = Place::new(&Mount { left_m: -5.0, ..Mount::default() });
    let stays = |left: u16, right: u16| {
        let mut map = unknown();
        for (i, j, pixels) in [(20, 0, left), (20, -1, right), (21, 0, 120)] {
            let cell = &mut map.cells[GEOMETRY.index(i, j).unwrap()];
            *cell = Cell { state: CellState::Obstacle, pixels, ..Cell::default() };
        }
        take_out(&mut map, &place, &settings);
        map.cells[GEOMETRY.index(21, 0).unwrap()].state == CellState::Obstacle
    };
    assert!(stays(200, 0) && stays(0, 200), "either by itself is too little");
    assert!(!stays(200, 200), "both together are enough");
}

#[test]
fn a_smeared_cell_is_hidden_and_keeps_its_cost_and_nothing_smears_nothing() {
    let mut map = unknown();
    for (i, pixels) in [(10, 400), (11, 20), (30, 0)] {
        let cell = Cell { state: CellState::Obstacle, pixels, cost: 7, height_dm: 3, ..Cell::default() };
        map.cells[GEOMETRY.index(i, 0).unwrap()] = cell;
    }
    take_out(&mut map, &Place::ORIGIN, &MapSettings::default());
    let at = |i: i16| map.cells[GEOMETRY.index(i, 0).unwrap()];
    assert_eq!(at(11), Cell { state: CellState::Unknown(UnknownReason::Hidden), cost: 7, ..Cell::default() });
    // What was unclear alone may have made an obstacle without a pixel of one.
    assert_eq!(at(30).state, CellState::Obstacle);
}
