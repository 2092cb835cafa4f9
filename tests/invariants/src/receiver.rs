//! Frames of a node, whole, lost, repeated, exchanged, damaged and forged, and those of others, into the receiver of scans.

use embedded_can::StandardId;
use fencepost_core::{
    ground::GroundPlane,
    health::{Health, HealthLevel},
    map::{Cell, CellState, MapGeometry, SECTOR_COUNT, SectorDistances, UnknownReason},
    wire::{
        Address, CELL_INDEX_MAX, CELL_INDEX_MIN, Frame, FrameFormat, Message, NoScan, NodeState, PROTOCOL_VERSION,
        PacketError, ReceiveError, Received, ReceiverConfig, ReceiverStatistics, Scan, ScanEncoder, ScanReceiver,
        Status, WireConfig, WireSettings, check_geometry, max_bits_per_second, max_frames_per_scan, max_load_permille,
    },
};

use crate::{
    Source,
    frames::{forge, has_checksum, is_protected},
};

const RUNS: usize = 24;
/// The receiver has room for fewer runs than may be sent.
const ROOM: usize = 12;
type Encoder = ScanEncoder<RUNS>;
type Receiver = ScanReceiver<ROOM>;
/// Frames of the longest scan that is sent here.
type Frames = heapless::Vec<Frame, 32>;

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let mut source = Source::new(bytes);
    let settings = WireSettings {
        base_id: u16::from(source.byte() % 7 + 1) * 0x100,
        node: source.byte() % 16,
        format: if source.flag() { FrameFormat::Fd } else { FrameFormat::Classic },
        max_cell_frames: 1 + source.byte() % 3,
    };
    if source.byte() == 255 {
        check_settings(&mut source);
    }
    let config = WireConfig::new(settings).expect("good settings");
    let mut bus = Bus::new(config);
    while !source.is_empty() {
        bus.step(&mut source);
    }
}

/// A scan as it was sent.
struct Sent {
    scan_index: u16,
    known: Vec<(i8, i8, bool)>,
    sectors: [u8; SECTOR_COUNT],
}

struct Bus {
    address: Address,
    encoder: Encoder,
    receiver: Receiver,
    again: Receiver,
    config: ReceiverConfig,
    now_ns: u64,
    /// Frames that were sent and are not delivered yet.
    waiting: Vec<Frame>,
    sent: Vec<Sent>,
    next_scan: u16,
    /// Somebody has sent frames in the node's name: what is received may be theirs.
    forged: bool,
    heartbeat_ns: Option<u64>,
    newest: Option<Frame>,
}

impl Bus {
    fn new(wire: WireConfig) -> Self {
        let address = wire.address();
        let config = ReceiverConfig { heartbeat_timeout_ns: 300, max_age_ns: 500, ..ReceiverConfig::new(address) };
        Self {
            address,
            encoder: Encoder::new(wire).expect("room for the runs"),
            receiver: Receiver::new(config),
            again: Receiver::new(config),
            config,
            now_ns: 0,
            waiting: Vec::new(),
            sent: Vec::new(),
            next_scan: 0,
            forged: false,
            heartbeat_ns: None,
            newest: None,
        }
    }

    /// What happens on the bus next.
    fn step(&mut self, source: &mut Source<'_>) {
        match source.byte() {
            0..=59 => self.send(source),
            60..=79 => {
                let state =
                    source.one_of(&[NodeState::Running, NodeState::Running, NodeState::Starting, NodeState::Fault]);
                let frame = self.encoder.heartbeat(&Status { state, health: Health::OK, last_scan: None });
                self.deliver(frame.id(), frame.data());
            }
            // All that waits, with a fault at one place or none.
            80..=199 => {
                let fault = source.below(8);
                let place = source.below(self.waiting.len());
                let waiting = std::mem::take(&mut self.waiting);
                for (k, frame) in waiting.iter().enumerate() {
                    match (k == place, fault) {
                        (true, 1) => continue,
                        (true, 2) => self.deliver(frame.id(), frame.data()),
                        (true, 3) => {
                            let mut data = frame.data().to_vec();
                            let bit = usize::from(source.byte()) % (8 * data.len());
                            data[bit / 8] ^= 1 << (bit % 8);
                            self.deliver(frame.id(), &data);
                            continue;
                        }
                        (true, 4) if k > 0 => self.deliver(waiting[k - 1].id(), waiting[k - 1].data()),
                        (true, 5) if k + 1 < waiting.len() => self.deliver(waiting[k + 1].id(), waiting[k + 1].data()),
                        (true, 7) => {
                            // Somebody changes a byte of what follows in its place, and the checksum with it.
                            let mut data = frame.data().to_vec();
                            let place = 2 + source.below(data.len() - 2);
                            data[place] = source.byte();
                            let counter = data[1];
                            forge(frame.id().as_raw(), counter, &mut data);
                            self.forged = true;
                            self.deliver(frame.id(), &data);
                            continue;
                        }
                        (true, 6) => self.now_ns += u64::from(source.byte()) * 4,
                        _ => {}
                    }
                    self.deliver(frame.id(), frame.data());
                }
            }
            200..=215 => self.now_ns = self.now_ns.saturating_add(u64::from(source.byte())),
            216..=223 => self.now_ns = self.now_ns.saturating_add(u64::from(source.double_word()) << 24),
            224..=239 => {
                let message = source.one_of(&Message::ALL);
                let mut data = [0; 24];
                let data = &mut data[..message.data_len()];
                data.iter_mut().for_each(|byte| *byte = source.byte());
                forge(self.address.raw_id(message), source.byte(), data);
                self.forged = true;
                self.deliver(self.address.id(message), data);
            }
            240..=247 => {
                let id = StandardId::new(source.word() & 0x7FF).unwrap_or(StandardId::MAX);
                let length = source.below(30);
                let data = source.bytes(length);
                self.forged |= is_protected(id.as_raw(), data);
                self.deliver(id, data);
            }
            _ => {
                if let Some(frame) = self.newest {
                    self.deliver(frame.id(), frame.data());
                }
            }
        }
        self.look();
    }

    /// Sends a scan; its frames wait.
    fn send(&mut self, source: &mut Source<'_>) {
        let few = 1 + source.below(8) as u16;
        let geometry = MapGeometry {
            cell_size_mm: 500,
            x_first: source.one_of(&[0, -3, -64, 60, -66, 64]),
            x_count: 1 + source.below(4) as u16,
            y_first: source.one_of(&[0, -4, -64, 58, -70, 32_760]),
            // More than a run has, too.
            y_count: source.one_of(&[few, few, few, 40]),
        };
        let cells: Vec<Cell> = (0..geometry.len())
            .map(|_| {
                let state = match source.byte() % 3 {
                    0 => CellState::Unknown(UnknownReason::NoMatch),
                    1 => CellState::Free,
                    _ => CellState::Obstacle,
                };
                Cell { state, ..Cell::default() }
            })
            .collect();
        let mut sectors = SectorDistances::default();
        sectors.distance_dm[source.below(SECTOR_COUNT)] = source.byte();
        let ground = (source.flag()).then(|| ground_plane(source));
        let scan = Scan {
            scan_index: self.next_scan,
            age_ns: u64::from(source.byte()) << source.one_of(&[0, 0, 0, 24]),
            health: Health { level: HealthLevel::Ok, reasons: 0 },
            geometry: &geometry,
            cells: &cells,
            sectors: &sectors,
            ground: ground.as_ref(),
        };
        let mut frames = Frames::new();
        let report = self.encoder.encode(&scan, &mut frames).expect("room for a scan");
        assert_eq!(report.frames, frames.len());
        assert!(frames.len() <= max_frames_per_scan(self.encoder.config()), "more frames than a scan has at most");
        // What is sent and what is dropped is all that is known.
        let known = cells.iter().filter(|cell| !matches!(cell.state, CellState::Unknown(_))).count();
        assert_eq!(usize::from(report.cells) + report.dropped_cells as usize, known, "cells sent and dropped");
        let mut all: Vec<(i8, i8, bool)> = Vec::new();
        for (index, cell) in cells.iter().enumerate() {
            let (i, j) = geometry.cell_at(index);
            let indices = i8::try_from(i).ok().zip(i8::try_from(j).ok());
            let range = CELL_INDEX_MIN..=CELL_INDEX_MAX;
            let Some((i, j)) = indices.filter(|(i, j)| range.contains(i) && range.contains(j)) else { continue };
            match cell.state {
                CellState::Unknown(_) => {}
                state => all.push((i, j, state == CellState::Obstacle)),
            }
        }
        all.sort_unstable();
        self.sent.push(Sent { scan_index: self.next_scan, known: all, sectors: sectors.distance_dm });
        self.next_scan = self.next_scan.wrapping_add(1 + u16::from(source.byte() == 255) * 40_000);
        self.waiting.extend(frames.iter().copied());
    }

    fn deliver(&mut self, id: StandardId, data: &[u8]) {
        let before = *self.receiver.statistics();
        let result = self.receiver.receive(id, data, self.now_ns);
        assert_eq!(self.again.receive(id, data, self.now_ns), result, "the same frame again, elsewhere");
        assert_eq!(self.again.statistics(), self.receiver.statistics());
        check_statistics(&before, self.receiver.statistics(), &result);
        let message = self.address.message(id);
        let ours = message.filter(|message| !matches!(message, Message::VehicleMotion | Message::ScanEcho));
        match message {
            None => assert_eq!(result, Ok(Received::NotOurs), "a frame of somebody else"),
            Some(message) if data.len() != message.data_len() => {
                assert!(matches!(result, Err(ReceiveError::Packet(PacketError::WrongLength { .. }))), "{result:?}");
            }
            Some(_) if !has_checksum(id.as_raw(), data) => {
                assert_eq!(result, Err(ReceiveError::Packet(PacketError::WrongCrc)), "a damaged frame");
            }
            Some(_) if !is_protected(id.as_raw(), data) => assert!(result.is_err(), "{result:?}"),
            Some(_) if ours.is_none() => assert_eq!(result, Ok(Received::NotOurs)),
            Some(_) => assert!(!matches!(result, Err(ReceiveError::Packet(_))), "{result:?}"),
        }
        if result == Ok(Received::Heartbeat) {
            self.heartbeat_ns = Some(self.now_ns);
        }
        if result.is_ok() && ours.is_some() {
            self.newest = if data.len() > 8 { Frame::fd(id, data) } else { Frame::classic(id, data) };
        }
    }

    /// Nothing may be driven by that is not whole, fresh and of a node that runs; and what is there is what was sent.
    fn look(&mut self) {
        let (now_ns, config) = (self.now_ns, &self.config);
        let alive = self.heartbeat_ns.is_some_and(|at_ns| now_ns - at_ns <= config.heartbeat_timeout_ns);
        assert_eq!(self.receiver.heartbeat(now_ns).is_some(), alive, "heartbeat");
        let scan = match self.receiver.scan(now_ns) {
            Ok(scan) => scan,
            Err(reason) => {
                assert_eq!(reason == NoScan::NoHeartbeat, !alive, "{reason:?}");
                return;
            }
        };
        let heartbeat = self.receiver.heartbeat(now_ns).expect("no scan without a heartbeat");
        assert_eq!((heartbeat.state, heartbeat.protocol_version), (NodeState::Running, PROTOCOL_VERSION));
        assert!(scan.age_ns <= config.max_age_ns, "too old");
        assert!(self.receiver.statistics().scans > 0 && scan.runs.len() <= ROOM && scan.cell_size_mm > 0);
        for run in scan.runs {
            assert!(run.length >= 1 && run.i >= CELL_INDEX_MIN && run.j >= CELL_INDEX_MIN);
            assert!(i16::from(run.j) + i16::from(run.length) - 1 <= i16::from(CELL_INDEX_MAX), "{run:?}");
            assert!(run.i <= CELL_INDEX_MAX);
        }
        if self.forged {
            return;
        }
        let sent = self.sent.iter().rfind(|sent| sent.scan_index == scan.scan_index).expect("a scan that was sent");
        let mut cells: Vec<_> = scan.cells().collect();
        cells.sort_unstable();
        assert!(cells.windows(2).all(|two| two[0] != two[1]), "a cell twice");
        let kept = cells.iter().all(|cell| sent.known.binary_search(cell).is_ok());
        assert!(kept, "a cell that was not sent: {cells:?}, {:?}", sent.known);
        assert!(cells.len() + usize::from(scan.dropped_cells) >= sent.known.len(), "cells lost without a word");
        assert_eq!(scan.sectors.distance_dm, sent.sectors);
    }
}

/// Settings of any values, and frames of any length: taken by the rules in words, or refused.
fn check_settings(source: &mut Source<'_>) {
    let settings = WireSettings {
        base_id: source.word(),
        node: source.byte(),
        format: if source.flag() { FrameFormat::Fd } else { FrameFormat::Classic },
        max_cell_frames: source.byte(),
    };
    let WireSettings { base_id, node, max_cell_frames, .. } = settings;
    let good = (1..=7).any(|k| k * 0x100 == base_id) && node < 16 && max_cell_frames > 0;
    let config = WireConfig::new(settings);
    assert_eq!(config.is_ok(), good, "{settings:?}");
    if let Ok(config) = config {
        let runs = usize::from(max_cell_frames) * if settings.format == FrameFormat::Fd { 8 } else { 2 };
        assert_eq!(config.max_runs(), runs);
        assert_eq!(Encoder::new(config).is_ok(), runs <= RUNS, "{settings:?}");
        let rate = source.word();
        let bits = max_bits_per_second(&config, rate);
        assert!(bits >= max_bits_per_second(&config, rate.saturating_sub(1)), "fewer bits with more scans");
        let permille = max_load_permille(&config, source.double_word(), rate);
        assert!(permille > 0 && max_load_permille(&config, u32::MAX, rate) <= permille.max(1));
    }
    let (cell_size_mm, largest) = (source.word(), source.below(4) == 3);
    let geometry = match largest {
        // More cells than can be counted by one.
        true => MapGeometry { cell_size_mm, x_first: -64, x_count: 128, y_first: -64, y_count: 128 },
        false => MapGeometry {
            cell_size_mm,
            x_first: source.word() as i16,
            x_count: source.word() % 300,
            y_first: i16::from(source.byte() as i8),
            y_count: u16::from(source.byte()),
        },
    };
    let fits = |first: i16, count: u16| (-64..=63).contains(&first) && i32::from(first) + i32::from(count) <= 64;
    let MapGeometry { cell_size_mm, x_first, x_count, y_first, y_count } = geometry;
    let good = (1..=4095).contains(&cell_size_mm)
        && fits(x_first, x_count)
        && fits(y_first, y_count)
        && u32::from(x_count) * u32::from(y_count) <= 16_383;
    assert_eq!(check_geometry(&geometry).is_ok(), good, "{geometry:?}");
    let raw = source.word() & 0x7FF;
    let id = StandardId::new(raw).unwrap_or(StandardId::MAX);
    let data = [source.byte(); 70];
    let data = &data[..source.below(70)];
    let classic = <Frame as embedded_can::Frame>::new(id, data);
    assert_eq!(classic.is_some(), data.len() <= 8);
    assert_eq!(Frame::fd(id, data).is_some(), matches!(data.len(), 0..=8 | 12 | 16 | 20 | 24));
    for (frame, mark) in [(classic, "#"), (Frame::fd(id, data), "##1")] {
        let Some(frame) = frame else { continue };
        let hex: String = data.iter().map(|byte| format!("{byte:02X}")).collect();
        assert_eq!(format!("{frame:?}"), format!("{raw:03X}{mark}{hex}"));
        assert_eq!((embedded_can::Frame::data(&frame), embedded_can::Frame::dlc(&frame)), (data, data.len()));
    }
}

fn ground_plane(source: &mut Source<'_>) -> GroundPlane {
    GroundPlane {
        normal: [0.0, 0.0, 1.0],
        offset_m: 0.0,
        camera_height_m: source.any_number(-1.0, 20.0),
        pitch_down_rad: source.any_number(-1.5, 1.5),
        roll_rad: source.any_number(-1.5, 1.5),
        support: 1,
        rms_m: 0.0,
        age_frames: source.word(),
    }
}

/// Each result is counted in its place, once, and nothing goes back.
fn check_statistics(before: &ReceiverStatistics, after: &ReceiverStatistics, result: &Result<Received, ReceiveError>) {
    let mut expected = *before;
    match result {
        Ok(Received::Scan { .. }) => expected.scans += 1,
        Ok(Received::Repeated) => expected.repeated += 1,
        Ok(Received::Old) => expected.old_scans += 1,
        Ok(Received::Waiting) => expected.stray_parts += 1,
        Ok(_) => {}
        Err(ReceiveError::Packet(PacketError::WrongCrc)) => expected.crc_errors += 1,
        Err(_) => expected.refused += 1,
    }
    assert!((before.lost..=before.lost + 14).contains(&after.lost), "lost");
    assert!((before.abandoned_scans..=before.abandoned_scans + 1).contains(&after.abandoned_scans), "given up");
    assert!(after.missed_scans >= before.missed_scans, "missed");
    let abandoned = matches!(result, Ok(Received::Abandoned(_)));
    assert!(!abandoned || after.abandoned_scans == before.abandoned_scans + 1, "given up, and not counted");
    expected.lost = after.lost;
    expected.abandoned_scans = after.abandoned_scans;
    expected.missed_scans = after.missed_scans;
    assert_eq!(expected, *after);
}
