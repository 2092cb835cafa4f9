//! Scans that can be told from each other by their cells, so that a mixture of two would be found.

use fencepost_core::{
    health::Health,
    map::{Cell, CellState, MapGeometry, SectorDistances},
    wire::{Frame, FrameFormat, NodeState, Scan, ScanEncoder, Status, WireConfig, WireSettings},
};

/// Cells along x and along y: enough for a scan of some twenty frames.
const CELLS: usize = 10;
const RUNS: usize = 255 * 8;
const FRAMES: usize = 300;

/// Encodes scans with rising numbers, and the heartbeats that go with them.
#[derive(Debug)]
pub struct NumberedScans {
    encoder: Box<ScanEncoder<RUNS>>,
    geometry: MapGeometry,
    next: u16,
}

impl NumberedScans {
    /// Begins with scan 0.
    ///
    /// # Panics
    /// Never: the settings are good.
    pub fn new(format: FrameFormat) -> Self {
        let settings = if format == FrameFormat::Fd { WireSettings::FD } else { WireSettings::CLASSIC };
        let config = WireConfig::new(settings).expect("good settings");
        let geometry =
            MapGeometry { x_count: CELLS as u16, y_count: CELLS as u16, y_first: -5, ..MapGeometry::default() };
        Self { encoder: Box::new(ScanEncoder::new(config).expect("room for it")), geometry, next: 0 }
    }

    /// The frames of the next scan.
    ///
    /// # Panics
    /// Never: there is room for all of them.
    pub fn scan(&mut self) -> Vec<Frame> {
        let scan_index = self.next;
        self.next += 1;
        let states = (0..CELLS * CELLS).map(|at| state_of(scan_index, at));
        let cells: Vec<Cell> =
            states.map(|state| Cell { state: state.unwrap_or(Cell::default().state), ..Cell::default() }).collect();
        let scan = Scan {
            scan_index,
            age_ns: 0,
            health: Health::OK,
            geometry: &self.geometry,
            cells: &cells,
            sectors: &SectorDistances::default(),
            ground: None,
        };
        let mut frames = heapless::Vec::<Frame, FRAMES>::new();
        self.encoder.encode(&scan, frames.as_mut_view()).expect("room for all frames");
        frames.iter().copied().collect()
    }

    /// A heartbeat of a node that is well.
    pub fn heartbeat(&mut self) -> Frame {
        let last_scan = self.next.checked_sub(1);
        self.encoder.heartbeat(&Status { state: NodeState::Running, health: Health::OK, last_scan })
    }

    /// The cells of scan `scan_index`: `(i, j, obstacle)` in order.
    pub fn cells_of(&self, scan_index: u16) -> Vec<(i8, i8, bool)> {
        let mut cells: Vec<_> = (0..CELLS * CELLS)
            .filter_map(|at| {
                let obstacle = state_of(scan_index, at)? == CellState::Obstacle;
                Some((
                    self.geometry.x_first as i8 + (at / CELLS) as i8,
                    self.geometry.y_first as i8 + (at % CELLS) as i8,
                    obstacle,
                ))
            })
            .collect();
        cells.sort_unstable();
        cells
    }
}

/// `None` for unknown.
fn state_of(scan_index: u16, at: usize) -> Option<CellState> {
    match (at * at + usize::from(scan_index) * 31 + at * usize::from(scan_index)) % 7 {
        0 | 1 => Some(CellState::Obstacle),
        2..=4 => Some(CellState::Free),
        _ => None,
    }
}
