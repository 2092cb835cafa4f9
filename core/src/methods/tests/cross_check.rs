//! The table of agreement, whole.

use super::*;
use crate::map::MapGeometry;

const SETTINGS: ConfidenceSettings = ConfidenceSettings { disputed_percent: 40, unconfirmed_percent: 70 };
const REASONS: [UnknownReason; 11] = [
    UnknownReason::OutsideView,
    UnknownReason::TooNear,
    UnknownReason::TooFar,
    UnknownReason::Hidden,
    UnknownReason::LowTexture,
    UnknownReason::NoMatch,
    UnknownReason::TooFewPixels,
    UnknownReason::NoGround,
    UnknownReason::Dropped,
    UnknownReason::NotTrusted,
    UnknownReason::Disputed,
];

fn cell(state: CellState) -> Cell {
    match state {
        CellState::Unknown(_) => Cell { state, ..Cell::default() },
        _ => Cell { state, pixels: 99, height_dm: 7, cost: 12, ..Cell::CERTAIN },
    }
}

fn map(cells: &[Cell]) -> ObstacleMap<256> {
    let geometry = MapGeometry { x_count: cells.len() as u16, y_count: 1, ..MapGeometry::default() };
    ObstacleMap { geometry, cells: cells.iter().copied().collect() }
}

#[test]
fn every_pair_of_states_is_told_as_the_table_says() {
    use CellState::{Free, Obstacle, Unknown};
    let states: std::vec::Vec<CellState> = [Free, Obstacle].into_iter().chain(REASONS.map(Unknown)).collect();
    let pairs: std::vec::Vec<_> = states.iter().flat_map(|a| states.iter().map(move |b| (*a, *b))).collect();
    let (ours, theirs): (std::vec::Vec<_>, std::vec::Vec<_>) = pairs.iter().map(|(a, b)| (cell(*a), cell(*b))).unzip();
    let mut checked = map(&ours);
    let mut other = OtherMap::<256>::new();
    other.keep(&map(&theirs));
    other.check(&mut checked, &SETTINGS);
    assert_eq!(pairs.len(), 169);
    for ((a, b), found) in pairs.into_iter().zip(&checked.cells) {
        let certain = cell(a);
        let expected = match (a, b) {
            (Obstacle, Obstacle) | (Free, Free) | (Unknown(_), _) => certain,
            (Obstacle, Free) => Cell { confidence_percent: 40, doubt: Doubt::Disputed, ..certain },
            (Obstacle | Free, Unknown(_)) => Cell { confidence_percent: 70, doubt: Doubt::Unconfirmed, ..certain },
            (Free, Obstacle) => {
                let state = Unknown(UnknownReason::Disputed);
                Cell { state, pixels: 0, height_dm: 0, cost: 0, confidence_percent: 0, doubt: Doubt::Disputed }
            }
        };
        assert_eq!(*found, expected, "{a:?}, the other says {b:?}");
        // Whatever the two say: an obstacle stays, and nothing is free that one of them calls an obstacle.
        assert_eq!(found.state == Obstacle, a == Obstacle);
        assert!(found.state != Free || b != Obstacle);
    }
}

#[test]
fn what_was_kept_of_the_frame_before_has_no_say() {
    let mut other = OtherMap::<256>::new();
    other.keep(&map(&[cell(CellState::Obstacle); 200]));
    other.keep(&map(&[cell(CellState::Free); 3]));
    let mut checked = map(&[cell(CellState::Free); 200]);
    other.check(&mut checked, &SETTINGS);
    let doubts: std::vec::Vec<Doubt> = checked.cells.iter().map(|cell| cell.doubt).collect();
    assert_eq!(doubts[..3], [Doubt::None; 3]);
    assert!(doubts[3..].iter().all(|doubt| *doubt == Doubt::Unconfirmed));
}
