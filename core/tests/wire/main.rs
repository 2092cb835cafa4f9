//! The wire from one end to the other: made-up maps are sent, spoiled on their way, and received.

mod answers;
mod dbc;
mod faults;
mod log;
mod round_trip;

use std::collections::BTreeSet;

use fencepost_core::ground::GroundPlane;
use fencepost_core::health::Health;
use fencepost_core::map::{Cell, CellState, MapGeometry, SECTOR_COUNT, SectorDistances, UnknownReason};
use fencepost_core::wire::{
    Address, EncodeReport, Frame, FrameFormat, NodeState, ReceivedScan, ReceiverConfig, Scan, ScanEncoder,
    ScanReceiver, Status, WireConfig, WireSettings, max_frames_per_scan,
};

/// Runs of every encoder and receiver of these tests: the most that can ever be sent.
const RUNS: usize = 255 * 8;

/// Most frames of a scan.
const FRAMES: usize = 263;

type Encoder = ScanEncoder<RUNS>;
type Receiver = ScanReceiver<RUNS>;
type Frames = heapless::Vec<Frame, FRAMES>;

/// `(i, j, obstacle)`
type CellSet = BTreeSet<(i8, i8, bool)>;

/// SplitMix64 (Steele, Lea, Flood 2014): small, and the same everywhere.
struct Random(u64);

impl Random {
    fn new(seed: u64) -> Self {
        println!("seed {seed}");
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    fn between(&mut self, first: i64, last: i64) -> i64 {
        first + self.below((last - first + 1) as u64) as i64
    }
}

/// A made-up scan that owns what [`Scan`] borrows.
#[derive(Clone, Debug)]
struct World {
    scan_index: u16,
    age_ns: u64,
    health: Health,
    geometry: MapGeometry,
    cells: Vec<Cell>,
    sectors: SectorDistances,
    ground: Option<GroundPlane>,
}

impl World {
    /// A world of `geometry` whose state changes from a cell to the next in `changes` of 100 cases.
    fn random(random: &mut Random, scan_index: u16, geometry: MapGeometry, changes: u64) -> Self {
        let mut state = CellState::Free;
        let cells = (0..geometry.len()).map(|_| {
            if random.below(100) < changes {
                state = match random.below(3) {
                    0 => CellState::Unknown(UnknownReason::Hidden),
                    1 => CellState::Free,
                    _ => CellState::Obstacle,
                };
            }
            Cell { state, ..Cell::default() }
        });
        let cells = cells.collect();
        let ground = (random.below(4) > 0).then(|| GroundPlane {
            normal: [0.0, 0.0, 1.0],
            offset_m: 0.0,
            camera_height_m: random.below(16_000) as f32 / 1000.0,
            pitch_down_rad: (random.between(-800, 800) as f32 / 20.0).to_radians(),
            roll_rad: (random.between(-800, 800) as f32 / 20.0).to_radians(),
            support: 1000,
            rms_m: 0.01,
            age_frames: random.below(20) as u16,
        });
        let distance_dm = [(); SECTOR_COUNT].map(|()| random.below(256) as u8);
        let sectors = SectorDistances { left_deg: 50.0, width_deg: 5.0, distance_dm };
        Self { scan_index, age_ns: random.below(200_000_000), health: Health::OK, geometry, cells, sectors, ground }
    }

    fn scan(&self) -> Scan<'_> {
        Scan {
            scan_index: self.scan_index,
            age_ns: self.age_ns,
            health: self.health,
            geometry: &self.geometry,
            cells: &self.cells,
            sectors: &self.sectors,
            ground: self.ground.as_ref(),
        }
    }

    /// The known cells, straight from the map.
    fn known(&self) -> CellSet {
        let known = self.cells.iter().enumerate().filter_map(|(index, cell)| {
            let (i, j) = self.geometry.cell_at(index);
            match cell.state {
                CellState::Unknown(_) => None,
                state => Some((i as i8, j as i8, state == CellState::Obstacle)),
            }
        });
        known.collect()
    }

    fn encode(&self, encoder: &mut Encoder) -> (Vec<Frame>, EncodeReport) {
        let mut out = Frames::new();
        let report = encoder.encode(&self.scan(), &mut out).unwrap();
        assert_eq!(report.frames, out.len());
        assert!(out.len() <= max_frames_per_scan(encoder.config()));
        (out.to_vec(), report)
    }
}

/// A map of 12 x 12 cells around the origin, so that every sign of an index occurs and tests are quick.
const SMALL: MapGeometry = MapGeometry { cell_size_mm: 250, x_first: -6, x_count: 12, y_first: -6, y_count: 12 };

fn config(format: FrameFormat, node: u8) -> WireConfig {
    WireConfig::new(WireSettings { format, node, max_cell_frames: 255, ..WireSettings::CLASSIC }).unwrap()
}

fn encoder(format: FrameFormat) -> Encoder {
    Encoder::new(config(format, 0)).unwrap()
}

fn receiver(address: Address) -> Receiver {
    Receiver::new(ReceiverConfig::new(address))
}

const RUNNING: Status = Status { state: NodeState::Running, health: Health::OK, last_scan: None };

fn cell_set(scan: &ReceivedScan<'_>) -> CellSet {
    let set = scan.cells().collect::<CellSet>();
    assert_eq!(set.len(), scan.cells().count(), "a cell came twice");
    set
}
