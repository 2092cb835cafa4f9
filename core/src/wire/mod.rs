//! The wire: what goes over the CAN bus, sending and receiving.
//!
//! The contract is `core/fencepost.dbc`; the tests compare it with this code signal by signal. `docs/wire.md` is the page for
//! whoever writes the controller at the other end.
//!
//! # Identifiers
//! 11 bits, `base | node << 4 | message`: sixteen nodes of sixteen messages share a base, see [`Address`].
//!
//! # A scan
//! ```text
//! Header ──> Cells x FrameCount ──> Sectors x 5 ──> Ground ──> End
//! ```
//! A scan counts for the receiver only if all of these came in this order ([`ScanReceiver`]); a scan without cells is sent as
//! well. Known cells are sent as runs of up to 31 cells of the same state side by side along +y, obstacles before free cells,
//! the nearest first in both. What is in no run is unknown, and never free.
//!
//! # Frames
//! Every message begins with the protection of AUTOSAR E2E profile 11, variant 11C ([`protect`]): CRC, counter (`cnt`), and
//! the bits 8 to 11 of the identifier (`id`). Signals are little-endian; bit 0 of byte 0 is the first.
//! ```text
//! byte        0        1        2        3        4        5        6        7
//! bit     0      7 8  11 15 16     23 24     31 32     39 40     47 48     55 56     63
//!         ┌────────┬───┬───┬────────┬────────┬────────┬────────┬────────┬────────┐
//! Heart-  │  CRC   │cnt│id │st he ve│ reasons, a bit each      v│   last scan     │  st: state, he: health,
//! beat    └────────┴───┴───┴────────┴────────┴────────┴────────┴────────┴────────┘  ve: version, v: last scan valid
//!         ┌────────┬───┬───┬────────┬────────┬────────┬────────┬────────┬────────┐
//! Header  │  CRC   │cnt│id │   scan index    │  cell count   he│ frames │  age   │  age in 5 ms
//!         └────────┴───┴───┴────────┴────────┴────────┴────────┴────────┴────────┘
//!         ┌────────┬───┬───┬───┬────┬──────────────────────┬─────────────────────┐
//! Cells   │  CRC   │cnt│id │scn│seq │ run 0, 20 bits       │ run 1, 20 bits      │  CellsFd: 8 runs in 24 bytes
//!         └────────┴───┴───┴───┴────┴──────────────────────┴─────────────────────┘
//!                                     run: x 7 signed, y 7 signed, length 5, obstacle 1
//!         ┌────────┬───┬───┬───┬────┬────────┬────────┬────────┬────────┬────────┐
//! Sectors │  CRC   │cnt│id │scn│0..3│ five distances in decimetres               │
//!         │  CRC   │cnt│id │scn│ 4  │ left edge, 0.01° │   width, 0.01° │  count  │
//!         └────────┴───┴───┴───┴────┴────────┴────────┴────────┴────────┴────────┘
//!         ┌────────┬───┬───┬───┬─┬──┬──┬──────────────┬────────────┬─────────────┐
//! Ground  │  CRC   │cnt│id │scn│s│age│  height, mm    │pitch 0.05° │ roll 0.05°  │  s: none, measured, held
//!         └────────┴───┴───┴───┴─┴──┴──┴──────────────┴────────────┴─────────────┘
//!         ┌────────┬───┬───┬────────┬────────┬────────────┬─────────────┬────────┐
//! End     │  CRC   │cnt│id │   scan index    │cell size mm│dropped cells│scan CRC│
//!         └────────┴───┴───┴────────┴────────┴────────────┴─────────────┴────────┘
//!         ┌────────┬───┬───┬────────┬────────┬────────┬────────┬────────┬────────┐
//! Vehicle │  CRC   │cnt│id │  speed, mm/s    │ yaw rate, 0.01°/s│valid │        │
//! Motion  └────────┴───┴───┴────────┴────────┴────────┴────────┴────────┴────────┘
//!         ┌────────┬───┬───┬────────┬────────┬────────┬────────┬────────┬────────┐
//! Scan    │  CRC   │cnt│id │   scan index    │                                   │
//! Echo    └────────┴───┴───┴────────┴────────┴────────┴────────┴────────┴────────┘
//! ```
//! `scn` are the low four bits of the scan's index, `seq` the number of the frame in its scan. Counter and sequence together
//! repeat after 240 frames; that, the number of frames and cells in the header, and the checksum over all cell frames in the
//! end leave no way for a scan to look whole when it is not.
//!
//! # Sending and receiving
//! ```
//! use fencepost_core::health::Health;
//! use fencepost_core::map::{Cell, CellState, MapGeometry, SectorDistances};
//! use fencepost_core::wire::{
//!     Frame, NodeState, Received, ReceiverConfig, Scan, ScanEncoder, ScanReceiver, Status, WireConfig,
//! };
//!
//! let config = WireConfig::default();
//! let mut encoder = ScanEncoder::<400>::new(config)?;
//! let mut receiver = ScanReceiver::<400>::new(ReceiverConfig::new(config.address()));
//!
//! let geometry = MapGeometry { x_count: 1, ..MapGeometry::default() };
//! let cells = [Cell { state: CellState::Obstacle, ..Cell::default() }; 50];
//! let sectors = SectorDistances::default();
//! let scan = Scan {
//!     scan_index: 7,
//!     age_ns: 45_000_000,
//!     health: Health::OK,
//!     geometry: &geometry,
//!     cells: &cells,
//!     sectors: &sectors,
//!     ground: None,
//! };
//! let mut frames = heapless::Vec::<Frame, 208>::new();
//! frames.push(encoder.heartbeat(&Status { state: NodeState::Running, ..Status::default() })).unwrap();
//! let report = encoder.encode(&scan, &mut frames)?;
//! assert_eq!((report.cells, report.dropped_cells), (50, 0));
//!
//! let now_ns = 1_000_000;
//! for frame in &frames {
//!     receiver.receive(frame.id(), frame.data(), now_ns)?;
//! }
//! let received = receiver.scan(now_ns).expect("a whole scan");
//! assert_eq!(received.cells().count(), 50);
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```

mod address;
mod assembly;
mod command;
mod config;
mod encoder;
mod frame;
mod load;
mod message;
mod protect;
mod receiver;
mod select;
mod signal;

pub use address::{Address, BaseId, Message, NodeId};
pub use command::{Command, CommandEncoder, CommandReceiver, CommandStatistics};
pub use config::{FrameFormat, WireConfig, WireSettings, check_geometry};
pub use encoder::{EncodeReport, OutputFull, Scan, ScanEncoder, Status};
pub use frame::{Frame, MAX_DATA};
pub use load::{
    FIXED_FRAMES_PER_SCAN, HEARTBEAT_RATE_HZ, MAX_HEARTBEAT_RATE_HZ, VEHICLE_MOTION_RATE_HZ, classic_frame_bits,
    fd_frame_bits, max_bits_per_scan, max_bits_per_second, max_frames_per_scan, max_load_permille,
};
pub use message::{
    AGE_STEP_MS, CELL_INDEX_MAX, CELL_INDEX_MIN, CellsRepr, EndRepr, GroundRepr, HeaderRepr, HeartbeatRepr,
    MAX_RUN_LENGTH, MeaninglessValue, NodeState, PROTOCOL_VERSION, Run, SCAN_LOW, SECTORS_PER_PART, ScanEchoRepr,
    SectorLayout, SectorsRepr, VehicleMotionRepr, WireGround, scan_low,
};
pub use protect::{
    COUNTER, COUNTER_VALUES, CRC, CounterCheck, DATA_ID_NIBBLE, Packet, PacketError, ScanCrc, Step, next_counter,
    protect,
};
pub use receiver::{
    Abandoned, NoScan, ReceiveError, Received, ReceivedScan, ReceiverConfig, ReceiverStatistics, ScanReceiver,
};
pub use signal::Signal;
