//! The maps of several pairs on one vehicle as one.

use super::{Cell, CellState, MapGeometry, ObstacleMap, SectorDistances, UnknownReason};
use crate::{
    detector::Detection,
    ground::GroundPlane,
    health::{Health, HealthLevel},
};

/// Two maps do not have the same cells, so that they cannot be merged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OtherCells {
    /// Where the cells of the map lie that came first.
    pub first: MapGeometry,
    /// Where the cells of the map lie that was to be added.
    pub found: MapGeometry,
}

/// What the pairs of one rig say together: one map, one ground, one health.
///
/// A cell that one pair calls an obstacle is an obstacle, whatever the others say: what stands there may be hidden from them, too
/// near for them, or stand in the part of the cell that they do not see, and a false stop costs less than a collision. A cell
/// that one pair saw to be free is free where no other speaks against it: a pair that did not see the cell knows nothing of it;
/// one whose two detectors dispute it speaks against it.
/// Of a cell that nobody knows, the reason is that of the pair that came closest to seeing it.
///
/// With one pair all of it is exactly what that pair says. Nothing is larger than the map itself, and nothing of it lies on the
/// stack: put it in a `static`.
#[derive(Clone, Debug)]
pub struct Merged<const CELLS: usize> {
    map: ObstacleMap<CELLS>,
    ground: Option<GroundPlane>,
    reasons: u32,
    levels: Option<Levels>,
}

/// The best and the worst of the pairs.
#[derive(Clone, Copy, Debug)]
struct Levels {
    best: HealthLevel,
    worst: HealthLevel,
}

impl<const CELLS: usize> Merged<CELLS> {
    /// What nobody has said yet.
    pub const fn new() -> Self {
        Self { map: ObstacleMap::EMPTY, ground: None, reasons: 0, levels: None }
    }

    /// Forgets what the pairs have said, without moving the table.
    pub fn clear(&mut self) {
        self.map.cells.clear();
        self.ground = None;
        self.reasons = 0;
        self.levels = None;
    }

    /// Adds what one pair has found in its newest pictures.
    ///
    /// # Errors
    /// [`OtherCells`], as [`Self::add_parts`].
    pub fn add<const OBSTACLES: usize>(&mut self, detection: &Detection<OBSTACLES, CELLS>) -> Result<(), OtherCells> {
        self.add_parts(&detection.map, detection.ground.as_ref(), detection.health)
    }

    /// Adds what one pair has found: its map, its ground, and how far both can be trusted. Free cells of a pair that is blind
    /// or has a fault are not taken over.
    ///
    /// # Errors
    /// [`OtherCells`] if the map does not have the cells of those before it; nothing of it is taken then.
    ///
    /// # Bound
    /// One pass over the cells.
    pub fn add_parts(
        &mut self,
        map: &ObstacleMap<CELLS>,
        ground: Option<&GroundPlane>,
        health: Health,
    ) -> Result<(), OtherCells> {
        if self.map.cells.is_empty() {
            self.map.geometry = map.geometry;
            // Cannot fail: both have the same capacity, and this one is empty.
            let _ = self.map.cells.extend_from_slice(&map.cells);
            if health.level >= HealthLevel::Blind {
                self.map.withhold_free();
            }
        } else {
            if self.map.geometry != map.geometry {
                return Err(OtherCells { first: self.map.geometry, found: map.geometry });
            }
            let trusted = health.level < HealthLevel::Blind;
            for (merged, cell) in self.map.cells.iter_mut().zip(&map.cells) {
                let cell = if trusted { *cell } else { cell.without_free() };
                *merged = together(*merged, cell);
            }
        }
        if let Some(ground) = ground.filter(|ground| self.ground.is_none_or(|known| speaks_louder(ground, &known))) {
            self.ground = Some(*ground);
        }
        self.add_health(health);
        Ok(())
    }

    /// Adds a pair that has nothing to show: its pictures are missing or too old. `health` says so.
    pub fn add_health(&mut self, health: Health) {
        self.reasons |= health.reasons;
        let Levels { best, worst } = self.levels.unwrap_or(Levels { best: health.level, worst: health.level });
        self.levels = Some(Levels { best: best.min(health.level), worst: worst.max(health.level) });
    }

    /// Makes all free cells unknown, for a reason that lies with none of the pairs: what they say together comes late, say, or some
    /// of it was lost. Obstacles stay.
    ///
    /// # Bound
    /// One pass over the cells.
    pub fn withhold_free(&mut self) {
        self.map.withhold_free();
    }

    /// The cells; none before the first pair.
    pub const fn map(&self) -> &ObstacleMap<CELLS> {
        &self.map
    }

    /// Nearest obstacle by direction on the merged map, by sectors of `width_deg`.
    ///
    /// # Bound
    /// One pass over the cells.
    pub fn sectors(&self, width_deg: f32) -> SectorDistances {
        SectorDistances::of(&self.map, width_deg)
    }

    /// The ground plane with the most support, one that was seen before one that is held; height and tilt are those of the
    /// camera that saw it.
    pub const fn ground(&self) -> Option<&GroundPlane> {
        self.ground.as_ref()
    }

    /// The reasons of all pairs. Blind or fault only if no pair sees, and then as the worst of them; with one that sees and one
    /// that does not the whole is degraded. Blind before the first pair.
    pub fn health(&self) -> Health {
        let level = match self.levels {
            None => HealthLevel::Blind,
            Some(Levels { best, worst }) if worst >= HealthLevel::Blind && best < HealthLevel::Blind => {
                HealthLevel::Degraded
            }
            Some(Levels { worst, .. }) => worst,
        };
        Health { level, reasons: self.reasons }
    }
}

impl<const CELLS: usize> Default for Merged<CELLS> {
    fn default() -> Self {
        Self::new()
    }
}

/// What two pairs say of one cell.
fn together(a: Cell, b: Cell) -> Cell {
    use CellState::{Free, Obstacle, Unknown};
    use UnknownReason::Disputed;
    // What one pair's second detector doubts, another pair may have seen for certain.
    let surer = if b.confidence_percent > a.confidence_percent { b } else { a };
    let both = Cell {
        state: a.state,
        pixels: a.pixels.max(b.pixels),
        height_dm: a.height_dm.max(b.height_dm),
        cost: a.cost.max(b.cost),
        confidence_percent: surer.confidence_percent,
        doubt: if a.confidence_percent == b.confidence_percent { a.doubt.min(b.doubt) } else { surer.doubt },
    };
    match (a.state, b.state) {
        (Obstacle, Obstacle) | (Free, Free) => both,
        // One of the two detectors of a pair sees something there: that speaks against free.
        (Unknown(Disputed), Free) => a,
        (Free, Unknown(Disputed)) => b,
        (Obstacle, _) | (Free, Unknown(_)) => a,
        (_, Obstacle) | (Unknown(_), Free) => b,
        (Unknown(reason), Unknown(other)) if nearness(other) > nearness(reason) => b,
        (Unknown(_), Unknown(_)) => a,
    }
}

/// How close a pair came to seeing a cell.
const fn nearness(reason: UnknownReason) -> u8 {
    match reason {
        UnknownReason::OutsideView => 0,
        UnknownReason::TooFar => 1,
        UnknownReason::TooNear => 2,
        UnknownReason::Hidden => 3,
        UnknownReason::LowTexture => 4,
        UnknownReason::NoMatch => 5,
        UnknownReason::TooFewPixels => 6,
        UnknownReason::NoGround => 7,
        UnknownReason::NotTrusted => 8,
        UnknownReason::Dropped => 9,
        UnknownReason::Disputed => 10,
    }
}

/// Whether `ground` is to be told rather than `known`.
fn speaks_louder(ground: &GroundPlane, known: &GroundPlane) -> bool {
    let seen = |plane: &GroundPlane| plane.age_frames == 0;
    if seen(ground) != seen(known) { seen(ground) } else { ground.support > known.support }
}

#[cfg(test)]
#[path = "merge_tests.rs"]
mod tests;
