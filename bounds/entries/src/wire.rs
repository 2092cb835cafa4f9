//! The wire, both sides.

use embedded_can::StandardId;
use fencepost_core::{
    error::ConfigError,
    ground::GroundPlane,
    map::{MapGeometry, SectorDistances},
    wire::{
        self, Address, CellsRepr, Command, CommandEncoder, CommandReceiver, CounterCheck, EncodeReport, EndRepr, Frame,
        GroundRepr, HeaderRepr, HeartbeatRepr, MeaninglessValue, NoScan, OutputFull, Packet, PacketError, ReceiveError,
        Received, ReceivedScan, ReceiverConfig, Scan, ScanCrc, ScanEchoRepr, ScanEncoder, ScanReceiver, SectorsRepr,
        Signal, Status, Step, VehicleMotionRepr, WireConfig, WireSettings,
    },
};
use heapless::VecView;

/// Runs of the defaults on classic CAN.
const RUNS: usize = 400;

type Encoder = ScanEncoder<RUNS>;
type Receiver = ScanReceiver<RUNS>;

#[unsafe(no_mangle)]
fn entry_wire_config(settings: &WireSettings) -> Result<WireConfig, ConfigError> {
    WireConfig::new(*settings)
}

#[unsafe(no_mangle)]
fn entry_wire_check_geometry(geometry: &MapGeometry) -> Result<(), ConfigError> {
    wire::check_geometry(geometry)
}

#[unsafe(no_mangle)]
fn entry_wire_load(config: &WireConfig, bitrate: u32, scan_rate_hz: u16) -> (u32, usize) {
    (wire::max_load_permille(config, bitrate, scan_rate_hz), wire::max_frames_per_scan(config))
}

/// As firmware does it: into a `static`.
#[unsafe(no_mangle)]
fn entry_wire_new_encoder(config: &WireConfig, encoder: &mut Encoder) -> Result<(), ConfigError> {
    *encoder = Encoder::new(*config)?;
    Ok(())
}

#[unsafe(no_mangle)]
fn entry_wire_encode(
    encoder: &mut Encoder,
    scan: &Scan<'_>,
    out: &mut VecView<Frame>,
) -> Result<EncodeReport, OutputFull> {
    #[cfg(feature = "plant-loop")]
    crate::planted::look_at_each(scan.cells);
    encoder.encode(scan, out)
}

#[unsafe(no_mangle)]
fn entry_wire_heartbeat(encoder: &mut Encoder, status: &Status) -> Frame {
    encoder.heartbeat(status)
}

#[unsafe(no_mangle)]
fn entry_wire_new_receiver(config: &ReceiverConfig, receiver: &mut Receiver) {
    *receiver = Receiver::new(*config);
}

#[unsafe(no_mangle)]
fn entry_wire_receive(
    receiver: &mut Receiver,
    id: StandardId,
    data: &[u8],
    now_ns: u64,
) -> Result<Received, ReceiveError> {
    receiver.receive(id, data, now_ns)
}

#[unsafe(no_mangle)]
fn entry_wire_scan<'a>(receiver: &'a Receiver, now_ns: u64) -> Result<ReceivedScan<'a>, NoScan> {
    receiver.scan(now_ns)
}

#[unsafe(no_mangle)]
fn entry_wire_scan_cells(scan: &ReceivedScan<'_>, cells: &mut VecView<(i8, i8, bool)>) {
    for cell in scan.cells() {
        if cells.push(cell).is_err() {
            break;
        }
    }
}

#[unsafe(no_mangle)]
fn entry_wire_received_heartbeat(receiver: &Receiver, now_ns: u64) -> Option<HeartbeatRepr> {
    receiver.heartbeat(now_ns)
}

#[unsafe(no_mangle)]
fn entry_wire_send_motion(encoder: &mut CommandEncoder, motion: &VehicleMotionRepr) -> Frame {
    encoder.vehicle_motion(motion)
}

#[unsafe(no_mangle)]
fn entry_wire_send_echo(encoder: &mut CommandEncoder, scan_index: u16) -> Frame {
    encoder.scan_echo(scan_index)
}

#[unsafe(no_mangle)]
fn entry_wire_receive_command(
    receiver: &mut CommandReceiver,
    id: StandardId,
    data: &[u8],
    now_ns: u64,
) -> Result<Command, ReceiveError> {
    receiver.receive(id, data, now_ns)
}

#[unsafe(no_mangle)]
fn entry_wire_commanded(receiver: &CommandReceiver, now_ns: u64) -> (Option<VehicleMotionRepr>, Option<u16>) {
    (receiver.vehicle_motion(now_ns), receiver.scan_echo(now_ns))
}

#[unsafe(no_mangle)]
fn entry_wire_packet<'a>(
    address: Address,
    id: StandardId,
    data: &'a [u8],
) -> Option<Result<(Packet<'a>, u8, u8), PacketError>> {
    Some(Packet::check(address, id, data)?.map(|packet| (packet, packet.counter(), packet.crc())))
}

#[unsafe(no_mangle)]
fn entry_wire_counter(check: &mut CounterCheck, packet: &Packet<'_>) -> Step {
    check.step(packet)
}

#[unsafe(no_mangle)]
fn entry_wire_protect(data_id: u16, counter: u8, data: &mut [u8]) -> u8 {
    wire::protect(data_id, counter, data);
    wire::next_counter(counter)
}

#[unsafe(no_mangle)]
fn entry_wire_scan_crc(crc: &mut ScanCrc, payload: &[u8]) -> u8 {
    crc.add(payload);
    crc.get()
}

#[unsafe(no_mangle)]
fn entry_wire_signal_get(signal: Signal, data: &[u8]) -> (u32, i32) {
    (signal.get(data), signal.get_signed(data))
}

#[unsafe(no_mangle)]
fn entry_wire_signal_put(signal: Signal, data: &mut [u8], value: i32) {
    signal.put(data, value as u32);
    signal.put_signed(data, value);
}

#[unsafe(no_mangle)]
fn entry_wire_frame(id: StandardId, data: &[u8]) -> [Option<Frame>; 2] {
    [Frame::classic(id, data), Frame::fd(id, data)]
}

/// A message, read and written.
macro_rules! message {
    ($parse:ident, $emit:ident, $repr:ty) => {
        #[unsafe(no_mangle)]
        fn $parse(data: &[u8]) -> Result<$repr, MeaninglessValue> {
            <$repr>::parse(data)
        }

        #[unsafe(no_mangle)]
        fn $emit(repr: &$repr, data: &mut [u8]) {
            repr.emit(data);
        }
    };
}

message!(entry_wire_parse_cells, entry_wire_emit_cells, CellsRepr);
message!(entry_wire_parse_end, entry_wire_emit_end, EndRepr);
message!(entry_wire_parse_ground, entry_wire_emit_ground, GroundRepr);
message!(entry_wire_parse_header, entry_wire_emit_header, HeaderRepr);
message!(entry_wire_parse_heartbeat, entry_wire_emit_heartbeat, HeartbeatRepr);
message!(entry_wire_parse_sectors, entry_wire_emit_sectors, SectorsRepr);
message!(entry_wire_parse_motion, entry_wire_emit_motion, VehicleMotionRepr);
message!(entry_wire_parse_echo, entry_wire_emit_echo, ScanEchoRepr);

#[unsafe(no_mangle)]
fn entry_wire_sectors_of(sectors: &SectorDistances, scan_low: u8, part: u8) -> SectorsRepr {
    SectorsRepr::of(sectors, scan_low, part)
}

#[unsafe(no_mangle)]
fn entry_wire_ground_of(plane: Option<&GroundPlane>, scan_low: u8) -> GroundRepr {
    GroundRepr::of(plane, scan_low)
}
