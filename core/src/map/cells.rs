//! Cells and where they lie.

use heapless::Vec;

/// Why nothing is known of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum UnknownReason {
    /// Outside the view of the cameras.
    #[default]
    OutsideView = 0,
    /// Closer than the disparity range reaches.
    TooNear = 1,
    /// Farther than cells are claimed.
    TooFar = 2,
    /// Behind an obstacle.
    Hidden = 3,
    /// No disparity there: too little texture.
    LowTexture = 4,
    /// No disparity there: matches were ambiguous or contradicted each other.
    NoMatch = 5,
    /// Seen, but by too few pixels to tell.
    TooFewPixels = 6,
    /// No ground plane to measure heights from.
    NoGround = 7,
    /// Left out because the map had no room.
    Dropped = 8,
    /// Perhaps seen to be free, but in a picture that cannot be trusted.
    NotTrusted = 9,
    /// Free for one detector and an obstacle for the one that checks it.
    Disputed = 10,
}

/// What the detector that checks another one thinks of a cell that is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Doubt {
    /// It says the same, or nobody checks.
    #[default]
    None = 0,
    /// It does not know the cell.
    Unconfirmed = 1,
    /// It says the opposite.
    Disputed = 2,
}

/// What is known of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellState {
    /// Not seen; never to be taken as free.
    Unknown(UnknownReason),
    /// Ground was seen and nothing stands on it.
    Free,
    /// Something stands there.
    Obstacle,
}

/// One cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// What is known.
    pub state: CellState,
    /// Pixels that speak for the state; saturates.
    pub pixels: u16,
    /// Height of the highest obstacle pixel above the ground, decimetres; 0 where there is none; saturates.
    pub height_dm: u8,
    /// Traversal cost: the number of obstacle points in the column. Only [`crate::methods::DetectorKind::CostMap`] has one; 0
    /// otherwise; saturates.
    pub cost: u16,
    /// Confidence in the state, percent; less than 100 where a second detector disagrees, 0 where the cell is unknown.
    pub confidence_percent: u8,
    /// Why the confidence is less than 100.
    pub doubt: Doubt,
}

impl Cell {
    /// A cell that nobody doubts, to be given its state.
    pub(crate) const CERTAIN: Self = Self {
        state: CellState::Unknown(UnknownReason::OutsideView),
        pixels: 0,
        height_dm: 0,
        cost: 0,
        confidence_percent: 100,
        doubt: Doubt::None,
    };

    /// The cell, unless it is free: then nothing is known of it.
    #[must_use]
    pub(crate) fn without_free(self) -> Self {
        match self.state {
            CellState::Free => Self { state: CellState::Unknown(UnknownReason::NotTrusted), ..Self::default() },
            _ => self,
        }
    }
}

impl Default for Cell {
    fn default() -> Self {
        Self {
            state: CellState::Unknown(UnknownReason::OutsideView),
            pixels: 0,
            height_dm: 0,
            cost: 0,
            confidence_percent: 0,
            doubt: Doubt::None,
        }
    }
}

/// Where the cells lie in the vehicle frame. Cell `(i, j)` covers `[i, i + 1) x [j, j + 1)` times the cell size, so that
/// edges lie at whole multiples of it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct MapGeometry {
    /// Edge of a cell, millimetres. The paper, section 3: the required map resolution is 0.5 m.
    pub cell_size_mm: u16,
    /// First cell along x (forward).
    pub x_first: i16,
    /// Number of cells along x.
    pub x_count: u16,
    /// First cell along y (left).
    pub y_first: i16,
    /// Number of cells along y.
    pub y_count: u16,
}

impl Default for MapGeometry {
    /// 0.5 m cells, 25 m ahead and 12.5 m to either side.
    fn default() -> Self {
        Self { cell_size_mm: 500, x_first: 0, x_count: 50, y_first: -25, y_count: 50 }
    }
}

impl MapGeometry {
    /// Number of cells.
    pub const fn len(&self) -> usize {
        self.x_count as usize * self.y_count as usize
    }

    /// Whether there is no cell.
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Edge of a cell, metres.
    pub fn cell_size_m(&self) -> f32 {
        f32::from(self.cell_size_mm) * 1.0e-3
    }

    /// Place in the table of cell `(i, j)`: x first, row by row of equal x.
    pub const fn index(&self, i: i16, j: i16) -> Option<usize> {
        let a = i as i32 - self.x_first as i32;
        let b = j as i32 - self.y_first as i32;
        if a < 0 || b < 0 || a >= self.x_count as i32 || b >= self.y_count as i32 {
            return None;
        }
        Some(a as usize * self.y_count as usize + b as usize)
    }

    /// Place in the table of the cell at `(x, y)`, metres.
    pub(crate) fn index_at(&self, x_m: f32, y_m: f32) -> Option<usize> {
        let per_cell = 1.0 / self.cell_size_m();
        self.index(floor(x_m * per_cell), floor(y_m * per_cell))
    }

    /// Cell `(i, j)` at a place in the table.
    pub const fn cell_at(&self, index: usize) -> (i16, i16) {
        let columns = if self.y_count == 0 { 1 } else { self.y_count as usize };
        (self.x_first.saturating_add((index / columns) as i16), self.y_first.saturating_add((index % columns) as i16))
    }

    /// Centre of cell `(i, j)`, metres.
    pub fn centre_m(&self, i: i16, j: i16) -> (f32, f32) {
        let size = self.cell_size_m();
        ((f32::from(i) + 0.5) * size, (f32::from(j) + 0.5) * size)
    }
}

/// A map of up to `CELLS` cells.
#[derive(Clone, Debug)]
pub struct ObstacleMap<const CELLS: usize> {
    /// Where the cells lie.
    pub geometry: MapGeometry,
    /// The cells, in the order of [`MapGeometry::index`].
    pub cells: Vec<Cell, CELLS, u16>,
}

impl<const CELLS: usize> ObstacleMap<CELLS> {
    /// A map without cells.
    pub const EMPTY: Self = Self {
        geometry: MapGeometry { cell_size_mm: 0, x_first: 0, x_count: 0, y_first: 0, y_count: 0 },
        cells: Vec::new(),
    };

    /// Makes all free cells unknown, because the picture that they were seen in cannot be trusted. Obstacles stay.
    pub(crate) fn withhold_free(&mut self) {
        for cell in &mut self.cells {
            *cell = cell.without_free();
        }
    }
}

/// Largest whole number not above `x`, within i16.
pub(super) fn floor(x: f32) -> i16 {
    let whole = x as i16;
    if f32::from(whole) > x { whole.saturating_sub(1) } else { whole }
}
