//! Frames of a vehicle's controller, and any others, into the node's side.

use embedded_can::StandardId;
use fencepost_core::wire::{
    Address, BaseId, Command, CommandEncoder, CommandReceiver, CommandStatistics, Frame, Message, NodeId, PacketError,
    ReceiveError, VehicleMotionRepr,
};

use crate::{
    Source,
    frames::{forge, has_checksum, is_protected},
};

const TIMEOUT_NS: u64 = 100_000_000;

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let mut source = Source::new(bytes);
    let base = BaseId::new(u16::from(source.byte() % 7 + 1) * 0x100).unwrap_or(BaseId::DEFAULT);
    let node = NodeId::new(source.byte() % 16).unwrap_or_default();
    let address = Address { base, node };
    let mut encoder = CommandEncoder::new(address);
    let mut receiver = CommandReceiver::new(address, TIMEOUT_NS);
    let mut again = receiver.clone();
    let mut model = Model::default();
    let mut newest = None;
    let mut now_ns = 0u64;
    while !source.is_empty() {
        let (id, data) = next_frame(&mut source, address, &mut encoder, &mut newest);
        let before = *receiver.statistics();
        let result = receiver.receive(id, &data, now_ns);
        assert_eq!(again.receive(id, &data, now_ns), result, "the same frame again, elsewhere");
        model.take(address, id, &data, now_ns, &result);
        check_statistics(&before, receiver.statistics(), &result);
        // Time goes on; now and then it stands still, or a long time passes.
        now_ns = now_ns.saturating_add(match source.byte() {
            0..=99 => 0,
            step @ 100..=249 => u64::from(step) * 500_000,
            250..=253 => TIMEOUT_NS + 1,
            _ => u64::from(source.double_word()) << 32,
        });
        assert_eq!(receiver.vehicle_motion(now_ns), model.fresh(model.motion, now_ns), "motion");
        assert_eq!(receiver.scan_echo(now_ns), model.fresh(model.echo, now_ns), "echo");
    }
}

/// A frame of the controller, whole or spoilt, or any other.
fn next_frame(
    source: &mut Source<'_>,
    address: Address,
    encoder: &mut CommandEncoder,
    newest: &mut Option<Frame>,
) -> (StandardId, Vec<u8>) {
    let kind = source.byte();
    let optional = |source: &mut Source<'_>| (source.below(4) > 0).then_some(source.word() as i16);
    let frame = match kind % 8 {
        0 | 1 => encoder.vehicle_motion(&VehicleMotionRepr {
            speed_mm_per_s: optional(source),
            yaw_rate_cdeg_per_s: optional(source),
        }),
        2 | 3 => encoder.scan_echo(source.word()),
        4 => newest.unwrap_or_else(|| encoder.scan_echo(0)),
        5 => {
            // Protected rightly, with anything in it and any counter.
            let message = source.one_of(&Message::ALL);
            let mut data = [0; 24];
            let data = &mut data[..message.data_len()];
            data.iter_mut().for_each(|byte| *byte = source.byte());
            forge(address.raw_id(message), source.byte(), data);
            return (address.id(message), data.to_vec());
        }
        6 => {
            let id = StandardId::new(source.word() & 0x7FF).unwrap_or(StandardId::MAX);
            let length = source.below(30);
            return (id, source.bytes(length).to_vec());
        }
        _ => encoder.scan_echo(source.word()),
    };
    *newest = Some(frame);
    let mut data = frame.data().to_vec();
    if kind % 8 == 7 {
        match source.below(4) {
            0 => data.truncate(source.below(8)),
            1 => data.push(source.byte()),
            _ => {
                let bit = source.below(64);
                data[bit / 8] ^= 1 << (bit % 8);
            }
        }
    }
    (frame.id(), data)
}

/// What a node may know, by the rules in words.
#[derive(Default)]
struct Model {
    motion: Option<(VehicleMotionRepr, u64)>,
    echo: Option<(u16, u64)>,
    /// Checksum and counter of the newest motion and the newest echo.
    heard: [Option<[u8; 2]>; 2],
}

impl Model {
    fn take(
        &mut self,
        address: Address,
        id: StandardId,
        data: &[u8],
        now_ns: u64,
        result: &Result<Command, ReceiveError>,
    ) {
        let raw = id.as_raw();
        let [motion, echo] = [Message::VehicleMotion, Message::ScanEcho].map(|message| address.raw_id(message) == raw);
        if !motion && !echo {
            assert_eq!(*result, Ok(Command::NotOurs), "a frame for somebody else");
            return;
        }
        if data.len() != 8 {
            let wrong = PacketError::WrongLength { expected: 8, found: data.len() };
            assert_eq!(*result, Err(ReceiveError::Packet(wrong)), "a frame of the wrong length");
            return;
        }
        if !has_checksum(raw, data) {
            assert_eq!(*result, Err(ReceiveError::Packet(PacketError::WrongCrc)), "a damaged frame");
            return;
        }
        if !is_protected(raw, data) {
            assert!(result.is_err(), "a frame with another's data id or a counter that is never sent");
            return;
        }
        let heard = &mut self.heard[usize::from(echo)];
        let repeated = heard.replace([data[0], data[1] & 15]) == Some([data[0], data[1] & 15]);
        if repeated {
            assert_eq!(*result, Ok(Command::Repeated), "the same once more");
            return;
        }
        let word = |first: usize| i16::from_le_bytes([data[first], data[first + 1]]);
        if motion {
            let valid = |bit: u8, value: i16| (data[6] >> bit & 1 == 1).then_some(value);
            let motion =
                VehicleMotionRepr { speed_mm_per_s: valid(0, word(2)), yaw_rate_cdeg_per_s: valid(1, word(4)) };
            assert_eq!(*result, Ok(Command::VehicleMotion(motion)));
            self.motion = Some((motion, now_ns));
        } else {
            assert!(matches!(result, Ok(Command::ScanEcho(echo)) if echo.scan_index == word(2) as u16), "{result:?}");
            self.echo = Some((word(2) as u16, now_ns));
        }
    }

    fn fresh<T>(&self, value: Option<(T, u64)>, now_ns: u64) -> Option<T> {
        value.filter(|(_, at_ns)| now_ns - at_ns <= TIMEOUT_NS).map(|(value, _)| value)
    }
}

/// Each result is counted in its place, once, and nothing else.
fn check_statistics(before: &CommandStatistics, after: &CommandStatistics, result: &Result<Command, ReceiveError>) {
    let mut expected = *before;
    match result {
        Ok(Command::Repeated) => expected.repeated += 1,
        Ok(_) => {}
        Err(ReceiveError::Packet(PacketError::WrongCrc)) => expected.crc_errors += 1,
        Err(_) => expected.refused += 1,
    }
    assert!((before.lost..=before.lost + 14).contains(&after.lost));
    assert_eq!(CommandStatistics { lost: after.lost, ..expected }, *after);
}
