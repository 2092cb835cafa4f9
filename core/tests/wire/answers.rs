//! What the receiver answers to a frame and what it counts, held against what was done to the frames by hand.

use fencepost_core::wire::{
    Abandoned, Frame, FrameFormat, MeaninglessValue, Message, OutputFull, PacketError, ReceiveError, Received,
    ReceiverStatistics,
};

use super::{Encoder, Random, Receiver, SMALL, World, encoder, receiver};

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
