//! Merged maps against the rules, cell by cell.

use std::{boxed::Box, vec::Vec};

use super::*;
use crate::map::Doubt;
use crate::test_random::Random;

const CELLS: usize = 2500;
const GEOMETRY: MapGeometry = MapGeometry { cell_size_mm: 500, x_first: -10, x_count: 40, y_first: -30, y_count: 60 };
const REASONS: [UnknownReason; 11] = [
    UnknownReason::OutsideView,
    UnknownReason::TooFar,
    UnknownReason::TooNear,
    UnknownReason::Hidden,
    UnknownReason::LowTexture,
    UnknownReason::NoMatch,
    UnknownReason::TooFewPixels,
    UnknownReason::NoGround,
    UnknownReason::NotTrusted,
    UnknownReason::Dropped,
    UnknownReason::Disputed,
];

fn random_map(random: &mut Random) -> Box<ObstacleMap<CELLS>> {
    let mut map = Box::new(ObstacleMap { geometry: GEOMETRY, ..ObstacleMap::EMPTY });
    for _ in 0..GEOMETRY.len() {
        let pixels = random.below(65_536) as u16;
        let (confidence_percent, doubt) =
            [(100, Doubt::None), (80, Doubt::Unconfirmed), (80, Doubt::Disputed), (50, Doubt::Disputed)]
                [random.below(4) as usize];
        let known = Cell { pixels, confidence_percent, doubt, ..Cell::default() };
        let (height_dm, cost) = (random.below(256) as u8, random.below(65_536) as u16);
        let cell = match random.below(3) {
            0 => Cell { state: CellState::Obstacle, height_dm, cost, ..known },
            1 => Cell { state: CellState::Free, ..known },
            _ => Cell { state: CellState::Unknown(REASONS[random.below(11) as usize]), ..Cell::default() },
        };
        map.cells.push(cell).unwrap();
    }
    map
}

fn merged(parts: &[(&ObstacleMap<CELLS>, Health)]) -> Box<Merged<CELLS>> {
    let mut merged = Box::new(Merged::new());
    for (map, health) in parts {
        merged.add_parts(map, None, *health).unwrap();
    }
    merged
}

fn at(level: HealthLevel, reasons: u32) -> Health {
    Health { level, reasons }
}

#[test]
fn one_pair_says_what_it_says() {
    let mut random = Random::seeded("one pair", 0x5eed_0160);
    let map = random_map(&mut random);
    for level in [HealthLevel::Ok, HealthLevel::Degraded] {
        let found = merged(&[(&map, at(level, 0x1234))]);
        assert_eq!((found.map().geometry, &found.map().cells), (map.geometry, &map.cells));
        assert_eq!(found.sectors(9.0), SectorDistances::of(&map, 9.0));
        assert_eq!(found.health(), at(level, 0x1234));
    }
}

#[test]
fn every_cell_follows_the_rules_in_any_order() {
    let mut random = Random::seeded("merging", 0x5eed_0161);
    for pairs in 2..=4 {
        let maps: Vec<_> = (0..pairs).map(|_| random_map(&mut random)).collect();
        // The second pair is blind: nothing that it calls free counts.
        let health = |i: usize| at([HealthLevel::Ok, HealthLevel::Blind][usize::from(i == 1)], 1 << i);
        let parts: Vec<_> = maps.iter().enumerate().map(|(i, map)| (&**map, health(i))).collect();
        let found = merged(&parts);
        let mut reversed = parts.clone();
        reversed.reverse();
        assert_eq!(found.map().cells, merged(&reversed).map().cells, "the order does not matter");
        assert_eq!(found.health(), at(HealthLevel::Degraded, (1 << pairs) - 1));
        for (index, cell) in found.map().cells.iter().enumerate() {
            let all: Vec<(usize, Cell)> = maps.iter().map(|map| map.cells[index]).enumerate().collect();
            let of =
                |state| all.iter().filter(move |(i, c)| c.state == state && !(state == CellState::Free && *i == 1));
            if of(CellState::Obstacle).count() > 0 {
                assert_eq!(cell.state, CellState::Obstacle);
                assert_eq!(Some(cell.pixels), of(CellState::Obstacle).map(|(_, c)| c.pixels).max());
                assert_eq!(Some(cell.height_dm), of(CellState::Obstacle).map(|(_, c)| c.height_dm).max());
                assert_eq!(Some(cell.cost), of(CellState::Obstacle).map(|(_, c)| c.cost).max());
                // Of the surest the one that is doubted least.
                let surest = of(CellState::Obstacle).map(|(_, c)| (c.confidence_percent, c.doubt));
                let surest = surest.max_by_key(|(confidence, doubt)| (*confidence, core::cmp::Reverse(*doubt)));
                assert_eq!(Some((cell.confidence_percent, cell.doubt)), surest);
            } else if of(CellState::Unknown(UnknownReason::Disputed)).count() > 0 {
                // Nobody's free counts where another pair's detectors disagree.
                assert_eq!(cell.state, CellState::Unknown(UnknownReason::Disputed));
            } else if of(CellState::Free).count() > 0 {
                assert_eq!(cell.state, CellState::Free);
                assert_eq!(Some(cell.pixels), of(CellState::Free).map(|(_, c)| c.pixels).max());
            } else {
                let CellState::Unknown(reason) = cell.state else { panic!("{cell:?} from {all:?}") };
                let said = all.iter().map(|(_, cell)| match cell.state {
                    CellState::Unknown(reason) => reason,
                    _ => UnknownReason::NotTrusted,
                });
                let place = |reason| REASONS[..8].iter().position(|r| *r == reason);
                let said: Vec<_> = said.collect();
                assert!(said.contains(&reason));
                // Reasons in the order in which one comes closer to seeing; the same as that of the numbers but for two.
                let order = |reason| match reason {
                    UnknownReason::TooFar => 1,
                    UnknownReason::TooNear => 2,
                    UnknownReason::NotTrusted => 8,
                    UnknownReason::Dropped => 9,
                    UnknownReason::Disputed => 10,
                    other => place(other).unwrap(),
                };
                assert_eq!(Some(order(reason)), said.iter().map(|r| order(*r)).max());
            }
        }
    }
}

#[test]
fn the_whole_is_blind_only_if_nobody_sees() {
    const LEVELS: [HealthLevel; 4] = [HealthLevel::Ok, HealthLevel::Degraded, HealthLevel::Blind, HealthLevel::Fault];
    assert_eq!(Merged::<CELLS>::new().health(), at(HealthLevel::Blind, 0), "no data is not good data");
    for a in LEVELS {
        for b in LEVELS {
            for c in LEVELS {
                let mut merged = Merged::<4>::new();
                [a, b, c].into_iter().enumerate().for_each(|(i, level)| merged.add_health(at(level, 1 << i)));
                let sees = [a, b, c].iter().any(|level| *level < HealthLevel::Blind);
                let expected = match [a, b, c].into_iter().max() {
                    Some(HealthLevel::Blind | HealthLevel::Fault) if sees => HealthLevel::Degraded,
                    worst => worst.unwrap(),
                };
                assert_eq!(merged.health(), at(expected, 0b111), "{a:?}, {b:?}, {c:?}");
                merged.clear();
                assert_eq!(merged.health(), at(HealthLevel::Blind, 0));
            }
        }
    }
}

#[test]
fn the_ground_with_the_most_support_is_told() {
    let frame = crate::geometry::VehicleFrame::new(&crate::geometry::Mount::default()).unwrap();
    let plane = |support, age_frames| GroundPlane { support, age_frames, ..GroundPlane::of_mount(&frame) };
    let map = ObstacleMap::<CELLS>::EMPTY;
    for (planes, expected) in [
        ([Some(plane(10, 0)), Some(plane(20, 0)), None], Some(plane(20, 0))),
        ([Some(plane(20, 0)), None, Some(plane(10, 0))], Some(plane(20, 0))),
        ([Some(plane(10, 0)), Some(plane(500, 1)), None], Some(plane(10, 0))),
        ([Some(plane(500, 3)), Some(plane(10, 0)), Some(plane(400, 1))], Some(plane(10, 0))),
        ([None, Some(plane(10, 2)), Some(plane(11, 4))], Some(plane(11, 4))),
        // Of equals the first.
        ([Some(plane(10, 1)), Some(plane(10, 2)), None], Some(plane(10, 1))),
        ([None, None, None], None),
    ] {
        let mut merged = Box::new(Merged::new());
        for ground in &planes {
            merged.add_parts(&map, ground.as_ref(), Health::OK).unwrap();
        }
        assert_eq!(merged.ground(), expected.as_ref(), "{planes:?}");
    }
}

#[test]
fn maps_of_other_cells_are_refused_whole() {
    let mut random = Random::seeded("other cells", 0x5eed_0162);
    let first = random_map(&mut random);
    let mut other = random_map(&mut random);
    other.geometry.x_first += 1;
    let mut found = merged(&[(&first, Health::OK)]);
    let refused = found.add_parts(&other, None, at(HealthLevel::Fault, 7));
    assert_eq!(refused, Err(OtherCells { first: first.geometry, found: other.geometry }));
    assert_eq!((&found.map().cells, found.health()), (&first.cells, Health::OK));
    // After clearing it is the first, and nothing of what was before is left.
    found.clear();
    found.add_parts(&other, None, Health::OK).unwrap();
    assert_eq!((found.map().geometry, &found.map().cells), (other.geometry, &other.cells));
}

#[test]
fn a_detection_is_added_with_its_map_its_ground_and_its_health_and_free_cells_are_withheld_on_demand() {
    let mut random = Random::seeded("a detection", 0x5eed_0163);
    let frame = crate::geometry::VehicleFrame::new(&crate::geometry::Mount::default()).unwrap();
    let mut detection = Box::new(Detection::<4, CELLS>::new());
    detection.map.clone_from(&random_map(&mut random));
    detection.ground = Some(GroundPlane::of_mount(&frame));
    detection.health = at(HealthLevel::Degraded, 5);
    let mut merged = Box::new(Merged::new());
    merged.add(&detection).unwrap();
    assert_eq!((&merged.map().cells, merged.ground()), (&detection.map.cells, detection.ground.as_ref()));
    assert_eq!(merged.health(), detection.health);
    merged.withhold_free();
    for (cell, was) in merged.map().cells.iter().zip(&detection.map.cells) {
        let not_trusted = Cell { state: CellState::Unknown(UnknownReason::NotTrusted), ..Cell::default() };
        assert_eq!(*cell, if was.state == CellState::Free { not_trusted } else { *was });
    }
}
