//! The codec against `fencepost.dbc`: every signal of every message, by the rules of the file alone.

use std::collections::BTreeMap;

use can_dbc::{AttributeValue, ByteOrder, Dbc, MultiplexIndicator, NumericValue, Signal, ValueType};
use fencepost_core::health::{Health, HealthLevel, HealthReason};
use fencepost_core::map::{SECTOR_CLEAR_DM, SECTOR_UNKNOWN};
use fencepost_core::wire::{
    Address, COUNTER, COUNTER_VALUES, CRC, CellsRepr, DATA_ID_NIBBLE, EndRepr, GroundRepr, HeaderRepr, HeartbeatRepr,
    Message, NodeState, PROTOCOL_VERSION, Run, SCAN_LOW, ScanEchoRepr, SectorLayout, SectorsRepr,
    Signal as CodecSignal, VehicleMotionRepr, WireGround, protect,
};

use super::Random;

const DBC: &str = include_str!("../../fencepost.dbc");

/// Values of the signals by their names, in the units of the file.
type Values = BTreeMap<String, f64>;

fn dbc() -> Dbc {
    Dbc::try_from(DBC).expect("the DBC file can be read")
}

/// Raw bits of a signal, one by one: bit `n` of an `@1` signal is bit `start + n` of the message.
fn raw(signal: &Signal, data: &[u8]) -> i64 {
    assert_eq!(signal.byte_order, ByteOrder::LittleEndian, "{}", signal.name);
    let bit = |n: u64| i64::from(data[(n / 8) as usize] >> (n % 8) & 1);
    let value = (0..signal.size).map(|n| bit(signal.start_bit + n) << n).sum::<i64>();
    let negative = signal.value_type == ValueType::Signed && bit(signal.start_bit + signal.size - 1) == 1;
    if negative { value - (1 << signal.size) } else { value }
}

fn number(value: &NumericValue) -> f64 {
    match value {
        NumericValue::Uint(value) => *value as f64,
        NumericValue::Int(value) => *value as f64,
        NumericValue::Double(value) => *value,
    }
}

/// Decodes `data` by the file and compares it with `expected`: the same signals with the same values, all within their
/// ranges, and no bit set that no signal covers.
fn compare(dbc: &Dbc, message: Message, data: &[u8], expected: &Values) {
    let description = dbc.messages.iter().find(|m| m.name == message.name()).unwrap();
    let part = description.signals.iter().find(|s| s.multiplexer_indicator == MultiplexIndicator::Multiplexor);
    let part = part.map(|signal| raw(signal, data) as u64);
    let active = description.signals.iter().filter(|signal| match signal.multiplexer_indicator {
        MultiplexIndicator::MultiplexedSignal(of) => Some(of) == part,
        _ => true,
    });
    let mut found = Values::new();
    let mut covered = vec![0_u8; data.len()];
    for signal in active {
        let value = raw(signal, data) as f64 * signal.factor + signal.offset;
        let (min, max) = (number(&signal.min), number(&signal.max));
        assert!((min - 1e-9..=max + 1e-9).contains(&value), "{}: {value} not in {min} to {max}", signal.name);
        found.insert(signal.name.clone(), value);
        (signal.start_bit..signal.start_bit + signal.size).for_each(|n| covered[(n / 8) as usize] |= 1 << (n % 8));
    }
    assert!(data.iter().zip(&covered).all(|(byte, covered)| byte & !covered == 0), "{message:?}: {data:02X?}");
    assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>(), "{message:?}");
    for (name, value) in expected {
        assert!((found[name] - value).abs() < 1e-6, "{message:?} {name}: {} is not {value}", found[name]);
    }
}

/// Emits a message, protects it, and returns its bytes with the values that the protection has.
fn message_bytes(random: &mut Random, message: Message, emit: impl Fn(&mut [u8])) -> (Vec<u8>, Values) {
    let address = Address::default();
    let counter = random.below(u64::from(COUNTER_VALUES)) as u8;
    let mut data = vec![0; message.data_len()];
    emit(&mut data);
    protect(address.raw_id(message), counter, &mut data);
    let values = [("Crc", f64::from(data[0])), ("Counter", f64::from(counter)), ("DataIdNibble", 4.0)];
    (data, values.map(|(name, value)| (name.to_owned(), value)).into())
}

fn check(random: &mut Random, dbc: &Dbc, message: Message, emit: impl Fn(&mut [u8]), values: &[(&str, f64)]) {
    let (data, mut expected) = message_bytes(random, message, emit);
    expected.extend(values.iter().map(|(name, value)| ((*name).to_owned(), *value)));
    compare(dbc, message, &data, &expected);
}

const ROUNDS: usize = 500;

#[test]
fn identifiers_lengths_senders_and_formats_agree() {
    let dbc = dbc();
    assert_eq!(dbc.messages.len(), Message::ALL.len());
    for message in Message::ALL {
        let description = dbc.messages.iter().find(|m| m.name == message.name()).unwrap();
        assert_eq!(description.id.raw(), u32::from(Address::default().raw_id(message)), "{message:?}");
        assert_eq!(description.size as usize, message.data_len(), "{message:?}");
        let from_controller = matches!(message, Message::VehicleMotion | Message::ScanEcho);
        let sender = if from_controller { "VehicleController" } else { "Fencepost" };
        assert_eq!(description.transmitter.as_deref(), Some(sender));
        // 14 is StandardCAN_FD in the list of formats, 0 StandardCAN.
        let format = dbc.message_attribute(description.id, "VFrameFormat");
        let is_fd = matches!(format, Some(AttributeValue::Uint(14)));
        assert_eq!(is_fd, message.is_fd(), "{message:?}: {format:?}");
        for signal in &description.signals {
            assert!(!signal.receivers.is_empty() && !signal.receivers.iter().any(|r| *r == sender), "{}", signal.name);
        }
    }
}

#[test]
fn places_in_the_code_are_those_in_the_file() {
    let dbc = dbc();
    let signals: &[(Message, &str, CodecSignal)] = &[
        (Message::Header, "Crc", CRC),
        (Message::Header, "Counter", COUNTER),
        (Message::Header, "DataIdNibble", DATA_ID_NIBBLE),
        (Message::Heartbeat, "State", HeartbeatRepr::STATE),
        (Message::Heartbeat, "LastScan", HeartbeatRepr::LAST_SCAN),
        (Message::Header, "CellCount", HeaderRepr::CELL_COUNT),
        (Message::Cells, "ScanLow", SCAN_LOW),
        (Message::Cells, "Run1Y", CellsRepr::RUN_Y.shifted(CellsRepr::RUN_BITS)),
        (Message::CellsFd, "Run7Obstacle", CellsRepr::RUN_OBSTACLE.shifted(7 * CellsRepr::RUN_BITS)),
        (Message::Sectors, "SectorWidth", SectorsRepr::WIDTH),
        (Message::Ground, "PitchDown", GroundRepr::PITCH),
        (Message::End, "DroppedCells", EndRepr::DROPPED_CELLS),
        (Message::VehicleMotion, "YawRate", VehicleMotionRepr::YAW_RATE),
        (Message::ScanEcho, "ScanIndex", ScanEchoRepr::SCAN_INDEX),
    ];
    for (message, name, place) in signals {
        let description = dbc.messages.iter().find(|m| m.name == message.name()).unwrap();
        let signal = description.signals.iter().find(|s| s.name == *name).unwrap();
        assert_eq!((signal.start_bit, signal.size), (place.start.into(), place.size.into()), "{name}");
    }
}

#[test]
fn named_values_agree() {
    let dbc = dbc();
    let values = |message: Message, signal: &str| {
        let id = dbc.messages.iter().find(|m| m.name == message.name()).unwrap().id;
        let descriptions = dbc.value_descriptions_for_signal(id, signal).unwrap();
        descriptions.iter().map(|v| (v.id, v.description.clone())).collect::<Vec<_>>()
    };
    let debug = |values: &[(i64, &dyn std::fmt::Debug)]| {
        values.iter().map(|(code, name)| (*code, format!("{name:?}"))).collect::<Vec<_>>()
    };
    use {HealthLevel as H, NodeState as N};
    let health = debug(&[(0, &H::Ok), (1, &H::Degraded), (2, &H::Blind), (3, &H::Fault)]);
    assert_eq!(values(Message::Header, "Health"), health);
    assert_eq!(values(Message::Heartbeat, "Health"), health);
    let states = debug(&[(0, &N::Starting), (1, &N::Running), (2, &N::Stopping), (3, &N::Fault)]);
    assert_eq!(values(Message::Heartbeat, "State"), states);
    for sector in 0..20 {
        let named =
            [(i64::from(SECTOR_CLEAR_DM), "Clear".to_owned()), (i64::from(SECTOR_UNKNOWN), "Unknown".to_owned())];
        assert_eq!(values(Message::Sectors, &format!("Sector{sector:02}")), named);
    }
}

#[test]
fn heartbeat_says_what_the_file_says() {
    let (mut random, dbc) = (Random::new(50), dbc());
    let states = [NodeState::Starting, NodeState::Running, NodeState::Stopping, NodeState::Fault];
    let levels = [HealthLevel::Ok, HealthLevel::Degraded, HealthLevel::Blind, HealthLevel::Fault];
    for _ in 0..ROUNDS {
        let (state, level) = (random.below(4) as usize, random.below(4) as usize);
        let mut health = Health { level: levels[level], reasons: 0 };
        let mut expected = Vec::new();
        for reason in HealthReason::ALL {
            let given = random.below(2) == 1;
            if given {
                health.raise(reason, HealthLevel::Ok);
            }
            expected.push((format!("{reason:?}"), f64::from(u8::from(given))));
        }
        let last_scan = (random.below(2) == 1).then_some(random.next() as u16);
        let repr = HeartbeatRepr { state: states[state], health, protocol_version: PROTOCOL_VERSION, last_scan };
        let mut values = vec![
            ("State", state as f64),
            ("Health", level as f64),
            ("ProtocolVersion", 1.0),
            ("LastScanValid", f64::from(u8::from(last_scan.is_some()))),
            ("LastScan", f64::from(last_scan.unwrap_or(0))),
        ];
        values.extend(expected.iter().map(|(name, value)| (name.as_str(), *value)));
        check(&mut random, &dbc, Message::Heartbeat, |data| repr.emit(data), &values);
        let (data, _) = message_bytes(&mut random, Message::Heartbeat, |data| repr.emit(data));
        assert_eq!(HeartbeatRepr::parse(&data), Ok(repr));
    }
}

#[test]
fn header_and_end_say_what_the_file_says() {
    let (mut random, dbc) = (Random::new(51), dbc());
    for _ in 0..ROUNDS {
        let header = HeaderRepr {
            scan_index: random.next() as u16,
            cell_count: random.below(1 << 14) as u16,
            health: HealthLevel::Blind,
            frame_count: random.next() as u8,
            age_steps: random.next() as u8,
        };
        let values = [
            ("ScanIndex", f64::from(header.scan_index)),
            ("CellCount", f64::from(header.cell_count)),
            ("Health", 2.0),
            ("FrameCount", f64::from(header.frame_count)),
            ("Age", 5.0 * f64::from(header.age_steps)),
        ];
        check(&mut random, &dbc, Message::Header, |data| header.emit(data), &values);
        let (data, _) = message_bytes(&mut random, Message::Header, |data| header.emit(data));
        assert_eq!(HeaderRepr::parse(&data), Ok(header));

        let end = EndRepr {
            scan_index: random.next() as u16,
            cell_size_mm: random.between(1, 4095) as u16,
            dropped_cells: random.below(4096) as u16,
            scan_crc: random.next() as u8,
        };
        let values = [
            ("ScanIndex", f64::from(end.scan_index)),
            ("CellSize", f64::from(end.cell_size_mm) / 1000.0),
            ("DroppedCells", f64::from(end.dropped_cells)),
            ("ScanCrc", f64::from(end.scan_crc)),
        ];
        check(&mut random, &dbc, Message::End, |data| end.emit(data), &values);
        let (data, _) = message_bytes(&mut random, Message::End, |data| end.emit(data));
        assert_eq!(EndRepr::parse(&data), Ok(end));
    }
}

#[test]
fn cells_say_what_the_file_says() {
    let (mut random, dbc) = (Random::new(52), dbc());
    for round in 0..2 * ROUNDS {
        let (message, count) = if round % 2 == 0 { (Message::Cells, 2) } else { (Message::CellsFd, 8) };
        let mut cells = CellsRepr {
            scan_low: random.below(16) as u8,
            sequence: random.below(16) as u8,
            runs: [None; CellsRepr::FD_RUNS],
        };
        let mut expected =
            vec![("ScanLow".to_owned(), f64::from(cells.scan_low)), ("Sequence".to_owned(), f64::from(cells.sequence))];
        let used = random.below(count + 1);
        for k in 0..count {
            let j = random.between(-64, 63);
            let run = Run {
                i: random.between(-64, 63) as i8,
                j: j as i8,
                length: random.between(1, 31.min(64 - j)) as u8,
                obstacle: random.below(2) == 1,
            };
            let run = if k < used { run } else { Run::default() };
            cells.runs[k as usize] = (k < used).then_some(run);
            expected.push((format!("Run{k}X"), f64::from(run.i)));
            expected.push((format!("Run{k}Y"), f64::from(run.j)));
            expected.push((format!("Run{k}Length"), f64::from(run.length)));
            expected.push((format!("Run{k}Obstacle"), f64::from(u8::from(run.obstacle))));
        }
        let values = expected.iter().map(|(name, value)| (name.as_str(), *value)).collect::<Vec<_>>();
        check(&mut random, &dbc, message, |data| cells.emit(data), &values);
        let (data, _) = message_bytes(&mut random, message, |data| cells.emit(data));
        assert_eq!(CellsRepr::parse(&data), Ok(cells));
    }
}

#[test]
fn sectors_say_what_the_file_says() {
    let (mut random, dbc) = (Random::new(53), dbc());
    for round in 0..ROUNDS {
        let (scan_low, part) = (random.below(16) as u8, (round % 5) as u8);
        let mut expected = vec![("ScanLow".to_owned(), f64::from(scan_low)), ("Part".to_owned(), f64::from(part))];
        let sectors = if part < 4 {
            let distance_dm = [(); 5].map(|()| random.next() as u8);
            let named = distance_dm.iter().enumerate();
            expected.extend(
                named.map(|(k, dm)| (format!("Sector{:02}", 5 * usize::from(part) + k), f64::from(*dm) / 10.0)),
            );
            SectorsRepr::Distances { scan_low, part, distance_dm }
        } else {
            let layout = SectorLayout {
                left_cdeg: random.next() as i16,
                width_cdeg: random.next() as u16,
                count: random.next() as u8,
            };
            expected.push(("SectorLeft".to_owned(), f64::from(layout.left_cdeg) / 100.0));
            expected.push(("SectorWidth".to_owned(), f64::from(layout.width_cdeg) / 100.0));
            expected.push(("SectorCount".to_owned(), f64::from(layout.count)));
            SectorsRepr::Layout { scan_low, layout }
        };
        let values = expected.iter().map(|(name, value)| (name.as_str(), *value)).collect::<Vec<_>>();
        check(&mut random, &dbc, Message::Sectors, |data| sectors.emit(data), &values);
        let (data, _) = message_bytes(&mut random, Message::Sectors, |data| sectors.emit(data));
        assert_eq!(SectorsRepr::parse(&data), Ok(sectors));
    }
}

#[test]
fn ground_says_what_the_file_says() {
    let (mut random, dbc) = (Random::new(54), dbc());
    for _ in 0..ROUNDS {
        let plane = WireGround {
            age_frames: random.below(16) as u8,
            camera_height_mm: random.below(1 << 14) as u16,
            pitch_down: random.between(-2048, 2047) as i16,
            roll: random.between(-2048, 2047) as i16,
        };
        let ground = GroundRepr { scan_low: random.below(16) as u8, ground: (random.below(4) > 0).then_some(plane) };
        let sent = ground.ground.unwrap_or_default();
        let state = ground.ground.map_or(0.0, |ground| if ground.age_frames == 0 { 1.0 } else { 2.0 });
        let values = [
            ("ScanLow", f64::from(ground.scan_low)),
            ("State", state),
            ("AgeFrames", f64::from(sent.age_frames)),
            ("CameraHeight", f64::from(sent.camera_height_mm) / 1000.0),
            ("PitchDown", f64::from(sent.pitch_down) / 20.0),
            ("Roll", f64::from(sent.roll) / 20.0),
        ];
        check(&mut random, &dbc, Message::Ground, |data| ground.emit(data), &values);
        let (data, _) = message_bytes(&mut random, Message::Ground, |data| ground.emit(data));
        assert_eq!(GroundRepr::parse(&data), Ok(ground));
    }
}

#[test]
fn commands_say_what_the_file_says() {
    let (mut random, dbc) = (Random::new(55), dbc());
    for _ in 0..ROUNDS {
        let motion = VehicleMotionRepr {
            speed_mm_per_s: (random.below(4) > 0).then_some(random.next() as i16),
            yaw_rate_cdeg_per_s: (random.below(4) > 0).then_some(random.next() as i16),
        };
        let values = [
            ("Speed", f64::from(motion.speed_mm_per_s.unwrap_or(0)) / 1000.0),
            ("YawRate", f64::from(motion.yaw_rate_cdeg_per_s.unwrap_or(0)) / 100.0),
            ("SpeedValid", f64::from(u8::from(motion.speed_mm_per_s.is_some()))),
            ("YawRateValid", f64::from(u8::from(motion.yaw_rate_cdeg_per_s.is_some()))),
        ];
        check(&mut random, &dbc, Message::VehicleMotion, |data| motion.emit(data), &values);
        let (data, _) = message_bytes(&mut random, Message::VehicleMotion, |data| motion.emit(data));
        assert_eq!(VehicleMotionRepr::parse(&data), Ok(motion));

        let echo = ScanEchoRepr { scan_index: random.next() as u16 };
        let values = [("ScanIndex", f64::from(echo.scan_index))];
        check(&mut random, &dbc, Message::ScanEcho, |data| echo.emit(data), &values);
    }
}

#[test]
fn values_without_a_meaning_are_refused() {
    let mut data = [0; 8];
    assert_eq!(EndRepr::parse(&data).unwrap_err().0, "CellSize");
    SectorsRepr::PART.put(&mut data, 5);
    assert_eq!(SectorsRepr::parse(&data).unwrap_err().0, "Part");
    for (state, age) in [(3, 0), (1, 1), (2, 0)] {
        GroundRepr::STATE.put(&mut data, state);
        GroundRepr::AGE.put(&mut data, age);
        assert_eq!(GroundRepr::parse(&data).unwrap_err().0, "State");
    }
}
