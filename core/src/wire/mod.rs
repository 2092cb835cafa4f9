//! The wire: what goes over the CAN bus, sending and receiving.

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
    FIXED_FRAMES_PER_SCAN, HEARTBEAT_RATE_HZ, VEHICLE_MOTION_RATE_HZ, classic_frame_bits, fd_frame_bits,
    max_bits_per_scan, max_bits_per_second, max_frames_per_scan, max_load_permille,
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
