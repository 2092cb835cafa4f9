//! What lies behind obstacles, and the nearest of them by direction, on maps that are laid out by hand.

use super::*;
use crate::geometry::Place;

/// A map of 30 x 40 cells with obstacles, free and unseen cells strewn about.
fn strewn(random: &mut Random) -> ObstacleMap<CELLS> {
    let geometry = MapGeometry { cell_size_mm: 500, x_first: -2, x_count: 30, y_first: -20, y_count: 40 };
    let mut map = ObstacleMap::<CELLS> { geometry, cells: heapless::Vec::new() };
    let obstacles = 1 + random.below(20);
    for _ in 0..geometry.len() {
        let state = match random.below(1000) {
            n if n < obstacles => CellState::Obstacle,
            n if n < 500 => CellState::Free,
            n => CellState::Unknown(match n % 9 {
                0 => UnknownReason::OutsideView,
                1 => UnknownReason::TooNear,
                2 => UnknownReason::TooFar,
                3 => UnknownReason::NoGround,
                4 => UnknownReason::LowTexture,
                5 => UnknownReason::NoMatch,
                _ => UnknownReason::TooFewPixels,
            }),
        };
        map.cells.push(Cell { state, ..Cell::default() }).unwrap();
    }
    map
}

fn centres(map: &ObstacleMap<CELLS>) -> impl Iterator<Item = (f64, f64, CellState)> {
    map.cells.iter().enumerate().map(|(index, cell)| {
        let (i, j) = map.geometry.cell_at(index);
        ((f64::from(i) + 0.5) * 0.5, (f64::from(j) + 0.5) * 0.5, cell.state)
    })
}

#[test]
fn cells_behind_obstacles_are_hidden_as_rays_say() {
    let mut random = Random::seeded("shadows", 0x5eed_0151);
    // Directions are told apart in steps of 1/32 of sideways per ahead.
    let step = 1.0 / 32.0 + 1.0e-4;
    let (mut hidden, mut open) = (0, 0);
    for round in 0..200 {
        let before = strewn(&mut random);
        let mut after = before.clone();
        shadow::mark(&mut after, &Place::ORIGIN);
        // Obstacles as the interval of sideways per ahead that their corners span.
        let shades: Vec<(f64, f64, f64)> = centres(&before)
            .filter(|&(x, _, state)| state == CellState::Obstacle && x > 0.25)
            .map(|(x, y, _)| {
                let corners = [(-0.25, -0.25), (-0.25, 0.25), (0.25, -0.25), (0.25, 0.25)];
                let tangents = corners.map(|(dx, dy)| (y + dy) / (x + dx));
                (x, tangents.into_iter().fold(f64::MAX, f64::min), tangents.into_iter().fold(f64::MIN, f64::max))
            })
            .collect();
        for ((x, y, was), is) in centres(&before).zip(&after.cells) {
            let unseen = matches!(
                was,
                CellState::Unknown(UnknownReason::LowTexture | UnknownReason::NoMatch | UnknownReason::TooFewPixels)
            );
            if !unseen || x <= 0.0 || y.abs() >= 2.0 * x {
                assert_eq!(is.state, was, "round {round}: {x}, {y}");
                continue;
            }
            let crossed = |slack: f64| {
                shades.iter().any(|&(ox, right, left)| ox < x && y / x >= right - slack && y / x <= left + slack)
            };
            let is_hidden = is.state == CellState::Unknown(UnknownReason::Hidden);
            assert!(is_hidden || is.state == was);
            assert!(is_hidden || !crossed(-1.0e-5), "round {round}: {x}, {y} is hidden");
            assert!(!is_hidden || crossed(step), "round {round}: {x}, {y} is open");
            hidden += u32::from(is_hidden);
            open += u32::from(!is_hidden);
        }
    }
    std::println!("{hidden} hidden, {open} open");
    assert!(hidden > 1000 && open > 1000);
}

#[test]
fn sectors_are_those_of_a_plain_search() {
    let mut random = Random::seeded("sectors", 0x5eed_0152);
    for (round, width_deg) in (0..300).zip([5.0, 18.0, 0.5, 7.0].into_iter().cycle()) {
        let map = strewn(&mut random);
        let found = SectorDistances::of(&map, width_deg);
        let width_deg = f64::from(width_deg);
        assert_eq!((f64::from(found.left_deg), f64::from(found.width_deg)), (10.0 * width_deg, width_deg));
        for sector in 0..SECTOR_COUNT {
            let inside = |x: f64, y: f64| {
                let place = 10.0 - y.atan2(x).to_degrees() / width_deg;
                // Centres on an edge belong to the sector on the right of it.
                let place = if (place - place.round()).abs() < 1.0e-5 { place.round() } else { place.floor() };
                place == sector as f64
            };
            let cells: Vec<_> = centres(&map).filter(|&(x, y, _)| inside(x, y)).collect();
            let nearest = cells.iter().filter(|c| c.2 == CellState::Obstacle).map(|c| c.0.hypot(c.1)).reduce(f64::min);
            let free = cells.iter().filter(|c| c.2 == CellState::Free).count();
            let outside = [UnknownReason::OutsideView, UnknownReason::TooFar, UnknownReason::TooNear];
            let in_view = cells.iter().filter(|c| !outside.iter().any(|&r| c.2 == CellState::Unknown(r))).count();
            let expected = match nearest {
                Some(distance) => (distance * 10.0).round().min(253.0) as u8,
                None if free > 0 && 2 * free >= in_view => SECTOR_CLEAR_DM,
                None => SECTOR_UNKNOWN,
            };
            let near = found.distance_dm[sector].abs_diff(expected);
            let rounding = nearest.is_some_and(|d| (d * 10.0).fract() > 0.4999 && (d * 10.0).fract() < 0.5001);
            assert!(near == 0 || rounding && near == 1, "round {round}, sector {sector}: {found:?}, {expected}");
        }
    }
    let empty = ObstacleMap::<CELLS>::EMPTY;
    assert_eq!(SectorDistances::of(&empty, 5.0).distance_dm, [SECTOR_UNKNOWN; SECTOR_COUNT]);
}

/// A map of metre cells around the origin of which nothing is known but `known`.
fn laid_out(known: &[((i16, i16), CellState)]) -> ObstacleMap<CELLS> {
    let geometry = MapGeometry { cell_size_mm: 1000, x_first: -5, x_count: 55, y_first: -20, y_count: 40 };
    let mut map = ObstacleMap::<CELLS> { geometry, cells: heapless::Vec::new() };
    map.cells.resize(geometry.len(), Cell::default()).unwrap();
    for ((i, j), state) in known {
        map.cells[geometry.index(*i, *j).unwrap()].state = *state;
    }
    map
}

#[test]
fn the_last_sector_distances_are_told_and_edges_have_a_sector() {
    let obstacle = CellState::Obstacle;
    let told = |known: &[((i16, i16), CellState)], width_deg: f32| SectorDistances::of(&laid_out(known), width_deg);
    // 20 m and 45 m ahead and a little to the left.
    assert_eq!(told(&[((20, 0), obstacle)], 5.0).distance_dm[9], 205);
    assert_eq!(told(&[((45, 0), obstacle)], 5.0).distance_dm[9], 253, "farther than can be told");
    assert_eq!(told(&[((45, 0), CellState::Free)], 5.0).distance_dm[9], SECTOR_CLEAR_DM);
    // 45 degrees to the left are the left edge of sectors of 4.5 degrees.
    let edge = told(&[((3, 3), obstacle)], 4.5);
    assert_eq!((edge.left_deg, edge.distance_dm[0]), (45.0, 49));
    assert!(edge.distance_dm[1..].iter().all(|distance| *distance == SECTOR_UNKNOWN));
}

#[test]
fn nothing_is_hidden_beyond_the_directions_that_are_looked_at() {
    let no_match = CellState::Unknown(UnknownReason::NoMatch);
    // From the middle of a cell other middles lie at whole metres: (4, 8) is twice as far aside as ahead, (5, 8) is not.
    let place = Place::new(&crate::geometry::Mount { forward_m: -0.5, left_m: 0.5, ..Default::default() });
    let mut map = laid_out(&[((1, 4), CellState::Obstacle), ((3, 8), no_match), ((4, 8), no_match)]);
    shadow::mark(&mut map, &place);
    let state = |i: i16, j: i16| map.cells[map.geometry.index(i, j).unwrap()].state;
    assert_eq!((state(3, 8), state(4, 8)), (no_match, CellState::Unknown(UnknownReason::Hidden)));
}
