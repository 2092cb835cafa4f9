//! What the receiver answers to a frame and what it counts, held against what was done to the frames by hand.

use fencepost_core::map::SECTOR_COUNT;
use fencepost_core::wire::{
    Abandoned, CellsRepr, Command, CommandEncoder, CommandReceiver, CommandStatistics, EndRepr, Frame, FrameFormat,
    GroundRepr, HeaderRepr, HeartbeatRepr, MeaninglessValue, Message, NoScan, OutputFull, PROTOCOL_VERSION,
    PacketError, ReceiveError, Received, ReceiverStatistics, SCAN_LOW, SectorsRepr, Signal, VehicleMotionRepr,
};

use super::{Encoder, RUNNING, Random, Receiver, SMALL, World, encoder, receiver};

/// A node that sends small worlds, and one that hears it.
struct Link {
    encoder: Encoder,
    receiver: Receiver,
    random: Random,
}

impl Link {
    fn new(seed: u64) -> Self {
        let encoder = encoder(FrameFormat::Classic);
        let receiver = receiver(encoder.config().address());
        Self { encoder, receiver, random: Random::new(seed) }
    }

    /// The frames of a scan of this index, which is taken as new as it is sent.
    fn frames(&mut self, scan_index: u16) -> Vec<Frame> {
        let world = World { age_ns: 0, ..World::random(&mut self.random, scan_index, SMALL, 20) };
        world.encode(&mut self.encoder).0
    }

    fn hear(&mut self, frame: &Frame) -> Result<Received, ReceiveError> {
        self.receiver.receive(frame.id(), frame.data(), 0)
    }

    /// Sends a whole scan.
    fn send(&mut self, scan_index: u16) {
        let frames = self.frames(scan_index);
        let (end, parts) = frames.split_last().unwrap();
        for frame in parts {
            assert_eq!(self.hear(frame), Ok(Received::Part));
        }
        assert_eq!(self.hear(end), Ok(Received::Scan { scan_index }));
    }

    fn statistics(&self) -> ReceiverStatistics {
        *self.receiver.statistics()
    }
}

#[test]
fn a_header_within_a_scan_gives_up_the_scan_before() {
    let mut link = Link::new(40);
    link.send(7);
    let cut_short = link.frames(8);
    for frame in &cut_short[..3] {
        assert_eq!(link.hear(frame), Ok(Received::Part));
    }
    let next = link.frames(9);
    assert_eq!(link.hear(&next[0]), Ok(Received::Abandoned(Abandoned::OutOfOrder)));
    assert_eq!(link.statistics().abandoned_scans, 1);

    // One that is no newer gives it up as well, and is told to be old.
    let old = link.frames(7);
    assert_eq!(link.hear(&old[0]), Ok(Received::Old));
    assert_eq!((link.statistics().abandoned_scans, link.statistics().old_scans), (2, 1));
    assert_eq!(link.hear(&old[1]), Ok(Received::Waiting));
    assert_eq!((link.statistics().scans, link.statistics().stray_parts), (1, 1));
}

#[test]
fn half_of_all_indices_are_newer_and_half_are_old() {
    for newest in [0, 1, 0x7FFF, 0x8000, 0xFFFF_u16] {
        for (steps, is_newer) in
            [(0, false), (1, true), (0x7FFE, true), (0x7FFF, true), (0x8000, false), (0xFFFF, false)]
        {
            let mut link = Link::new(41);
            link.send(newest);
            let scan_index = newest.wrapping_add(steps);
            if is_newer {
                link.send(scan_index);
                let missed_scans = u32::from(steps) - 1;
                let expected = ReceiverStatistics { scans: 2, missed_scans, ..ReceiverStatistics::default() };
                assert_eq!(link.statistics(), expected, "{steps} after {newest}");
            } else {
                let frames = link.frames(scan_index);
                assert_eq!(link.hear(&frames[0]), Ok(Received::Old), "{steps} after {newest}");
                assert_eq!((link.statistics().scans, link.statistics().old_scans), (1, 1));
            }
        }
    }
}

#[test]
fn what_is_refused_is_counted_by_its_reason() {
    let mut link = Link::new(42);
    let frames = link.frames(1);
    let address = link.encoder.config().address();
    let id = address.id(Message::Header);
    assert_eq!(link.receiver.receive(id, &frames[0].data()[..7], 0), {
        Err(ReceiveError::Packet(PacketError::WrongLength { expected: 8, found: 7 }))
    });
    assert_eq!((link.statistics().refused, link.statistics().crc_errors), (1, 0));
    let mut spoiled = frames[0].data().to_vec();
    spoiled[5] ^= 4;
    assert_eq!(link.receiver.receive(id, &spoiled, 0), Err(ReceiveError::Packet(PacketError::WrongCrc)));
    assert_eq!((link.statistics().refused, link.statistics().crc_errors), (1, 1));

    // What is meant for the node, from a controller, is nothing of the node's.
    for message in [Message::VehicleMotion, Message::ScanEcho] {
        let mut data = [0; 8];
        fencepost_core::wire::protect(address.raw_id(message), 0, &mut data);
        assert_eq!(link.receiver.receive(address.id(message), &data, 0), Ok(Received::NotOurs));
    }
    assert_eq!(link.hear(&frames[0]), Ok(Received::Part));
    assert_eq!(link.hear(&frames[0]), Ok(Received::Repeated));
    let expected = ReceiverStatistics { refused: 1, crc_errors: 1, repeated: 1, ..ReceiverStatistics::default() };
    assert_eq!(link.statistics(), expected);
}

/// The frame with another payload under the same counter, protected as a sender would.
fn changed(frame: &Frame, change: impl FnOnce(&mut [u8])) -> Frame {
    let mut data = frame.data().to_vec();
    let counter = data[1] & 0xF;
    change(&mut data);
    fencepost_core::wire::protect(frame.id().as_raw(), counter, &mut data);
    Frame::classic(frame.id(), &data).unwrap()
}

#[test]
fn a_scan_that_contradicts_itself_is_given_up_for_that_reason() {
    let address = Link::new(44).encoder.config().address();
    let id = |message| address.id(message);
    let add = |signal: Signal| move |data: &mut [u8]| signal.put(data, (signal.get(data) + 1) & signal.max());
    // The first frame of a message that is changed, how, and what is said at which frame: that itself, or the end.
    type Change = Box<dyn Fn(&mut [u8])>;
    let cases: [(Message, Change, Message, Result<Received, ReceiveError>); 9] = [
        (Message::Header, Box::new(add(HeaderRepr::CELL_COUNT)), Message::End, {
            Ok(Received::Abandoned(Abandoned::WrongCellCount))
        }),
        (Message::End, Box::new(add(EndRepr::SCAN_CRC)), Message::End, {
            Ok(Received::Abandoned(Abandoned::WrongScanCrc))
        }),
        (Message::End, Box::new(add(EndRepr::SCAN_INDEX)), Message::End, {
            Ok(Received::Abandoned(Abandoned::OtherScan))
        }),
        (Message::Cells, Box::new(add(SCAN_LOW)), Message::Cells, Ok(Received::Abandoned(Abandoned::OtherScan))),
        (Message::Sectors, Box::new(add(SCAN_LOW)), Message::Sectors, Ok(Received::Abandoned(Abandoned::OtherScan))),
        (Message::Ground, Box::new(add(SCAN_LOW)), Message::Ground, Ok(Received::Abandoned(Abandoned::OtherScan))),
        (Message::Cells, Box::new(add(CellsRepr::SEQUENCE)), Message::Cells, {
            Ok(Received::Abandoned(Abandoned::OutOfOrder))
        }),
        (Message::Sectors, Box::new(add(SectorsRepr::PART)), Message::Sectors, {
            Ok(Received::Abandoned(Abandoned::OutOfOrder))
        }),
        (Message::End, Box::new(|data| EndRepr::CELL_SIZE.put(data, 0)), Message::End, {
            Err(ReceiveError::Value(MeaninglessValue("CellSize")))
        }),
    ];
    for (message, change, told_at, answer) in cases {
        let mut link = Link::new(44);
        let mut frames = link.frames(3);
        let place = frames.iter().position(|frame| frame.id() == id(message)).unwrap();
        frames[place] = changed(&frames[place], change);
        let told = frames.iter().position(|frame| frame.id() == id(told_at)).unwrap();
        for frame in &frames[..told] {
            assert_eq!(link.hear(frame), Ok(Received::Part), "{message:?}");
        }
        assert_eq!(link.hear(&frames[told]), answer, "{message:?}");
        for frame in &frames[told + 1..] {
            assert_eq!(link.hear(frame), Ok(Received::Waiting), "{message:?}");
        }
        let statistics = link.statistics();
        assert_eq!((statistics.scans, statistics.abandoned_scans), (0, 1), "{message:?}");
        assert_eq!(statistics.refused, u32::from(answer.is_err()), "{message:?}");
        link.send(4);
    }
}

#[test]
fn a_frame_that_is_missing_within_its_kind_is_lost() {
    let mut link = Link::new(45);
    let frames = link.frames(3);
    assert!(frames.len() > 12, "several frames of cells");
    for frame in &frames[..2] {
        assert_eq!(link.hear(frame), Ok(Received::Part));
    }
    assert_eq!(link.hear(&frames[3]), Ok(Received::Abandoned(Abandoned::Lost)));
    assert_eq!((link.statistics().lost, link.statistics().abandoned_scans), (1, 1));
}

#[test]
fn sectors_of_another_number_are_refused() {
    let mut link = Link::new(46);
    let frames = link.frames(3);
    // The last part of the sectors comes before the ground and the end.
    let layout = frames.len() - 3;
    for frame in &frames[..layout] {
        assert_eq!(link.hear(frame), Ok(Received::Part));
    }
    let count = SectorsRepr::COUNT;
    let spoiled = changed(&frames[layout], |data| {
        assert_eq!(count.get(data), SECTOR_COUNT as u32);
        count.put(data, SECTOR_COUNT as u32 - 1);
    });
    assert_eq!(link.hear(&spoiled), Err(ReceiveError::Value(MeaninglessValue("SectorCount"))));
    assert_eq!((link.statistics().refused, link.statistics().abandoned_scans), (1, 1));
}

#[test]
fn values_without_a_meaning_are_refused_by_name() {
    for part in 0..=SectorsRepr::PART.max() {
        let mut data = [0; 8];
        SectorsRepr::PART.put(&mut data, part);
        let expected =
            if part < u32::from(SectorsRepr::PARTS) { Ok(part as u8) } else { Err(MeaninglessValue("Part")) };
        assert_eq!(SectorsRepr::parse(&data).map(|sectors| sectors.part()), expected);
    }
    for state in 0..=3 {
        for age in 0..=GroundRepr::AGE.max() {
            let mut data = [0; 8];
            GroundRepr::STATE.put(&mut data, state);
            GroundRepr::AGE.put(&mut data, age);
            let expected = match state {
                0 => Ok(None),
                1 if age == 0 => Ok(Some(0)),
                2 if age > 0 => Ok(Some(age as u8)),
                _ => Err(MeaninglessValue("State")),
            };
            let found = GroundRepr::parse(&data).map(|repr| repr.ground.map(|ground| ground.age_frames));
            assert_eq!(found, expected, "state {state}, age {age}");
        }
    }
}

#[test]
fn a_node_of_another_version_is_not_driven_by() {
    for version in 0..=HeartbeatRepr::PROTOCOL_VERSION.max() {
        let mut link = Link::new(48);
        link.send(1);
        let heartbeat = link.encoder.heartbeat(&RUNNING);
        let heartbeat = changed(&heartbeat, |data| HeartbeatRepr::PROTOCOL_VERSION.put(data, version));
        assert_eq!(link.hear(&heartbeat), Ok(Received::Heartbeat));
        let expected = if version as u8 == PROTOCOL_VERSION { Ok(1) } else { Err(NoScan::OtherVersion(version as u8)) };
        assert_eq!(link.receiver.scan(0).map(|scan| scan.scan_index), expected);
    }
}

#[test]
fn the_node_counts_what_comes_from_its_controller() {
    let address = Link::new(47).encoder.config().address();
    let (mut encoder, mut receiver) = (CommandEncoder::new(address), CommandReceiver::new(address, 100));
    let motion = VehicleMotionRepr { speed_mm_per_s: Some(-7), yaw_rate_cdeg_per_s: None };
    for lost in [0, 1, 3] {
        for _ in 0..lost {
            encoder.vehicle_motion(&motion);
        }
        let frame = encoder.vehicle_motion(&motion);
        assert_eq!(receiver.receive(frame.id(), frame.data(), 0), Ok(Command::VehicleMotion(motion)));
    }
    let echo = encoder.scan_echo(9);
    receiver.receive(echo.id(), echo.data(), 1000).unwrap();
    assert_eq!((receiver.scan_echo(1100), receiver.scan_echo(1101)), (Some(9), None));
    assert_eq!(receiver.receive(echo.id(), echo.data(), 1050), Ok(Command::Repeated));
    assert_eq!(receiver.scan_echo(1101), None, "no younger by what was heard before");
    assert!(receiver.receive(echo.id(), &echo.data()[..7], 0).is_err());
    let mut spoiled = echo.data().to_vec();
    spoiled[4] ^= 1;
    assert!(receiver.receive(echo.id(), &spoiled, 0).is_err());
    let expected = CommandStatistics { lost: 4, repeated: 1, crc_errors: 1, refused: 1 };
    assert_eq!(receiver.statistics(), &expected);
}

#[test]
fn a_refusal_says_why() {
    for (error, text) in [
        (ReceiveError::Packet(PacketError::WrongCrc), "the checksum does not fit"),
        (ReceiveError::Packet(PacketError::WrongLength { expected: 8, found: 7 }), "the message has 8 bytes, 7 came"),
        (ReceiveError::Packet(PacketError::WrongDataId), "the data id is not that of the identifier"),
        (ReceiveError::Packet(PacketError::InvalidCounter), "the counter is 15, which is never sent"),
        (ReceiveError::Value(MeaninglessValue("SectorCount")), "SectorCount has a value without a meaning"),
    ] {
        assert_eq!(error.to_string(), text);
    }
    assert_eq!(OutputFull.to_string(), "the output has no room for a scan's 8 fixed frames");
}

#[test]
fn a_lost_header_is_one_lost_message_and_leaves_strays() {
    let mut link = Link::new(43);
    link.send(1);
    let without_header = link.frames(2);
    for frame in &without_header[1..] {
        assert_eq!(link.hear(frame), Ok(Received::Waiting));
    }
    link.send(3);
    let stray_parts = without_header.len() as u32 - 1;
    let expected =
        ReceiverStatistics { scans: 2, missed_scans: 1, lost: 1, stray_parts, ..ReceiverStatistics::default() };
    assert_eq!(link.statistics(), expected);
}
