//! Whatever happens to frames on their way: never a wrong map, and never unnoticed.

use fencepost_core::wire::{Frame, FrameFormat, Message, Received, ReceiverStatistics};

use super::{RUNNING, Random, Receiver, SMALL, World, cell_set, encoder, receiver};

/// A bus with some scans of different worlds.
struct Bus {
    worlds: Vec<World>,
    heartbeat: Frame,
    frames: Vec<Frame>,
}

impl Bus {
    fn new(random: &mut Random, format: FrameFormat, scans: u16, changes: u64) -> Self {
        let mut encoder = encoder(format);
        let heartbeat = encoder.heartbeat(&RUNNING);
        let worlds = (0..scans).map(|k| World::random(random, k, SMALL, changes)).collect::<Vec<_>>();
        let frames = worlds.iter().flat_map(|world| world.encode(&mut encoder).0).collect();
        Self { worlds, heartbeat, frames }
    }

    /// Receives `frames`; whenever a scan becomes whole it must be the world that was sent under its index.
    fn receive<'a>(&self, frames: impl IntoIterator<Item = &'a Frame>) -> Receiver {
        let mut receiver = receiver(super::config(FrameFormat::Classic, 0).address());
        receiver.receive(self.heartbeat.id(), self.heartbeat.data(), 0).unwrap();
        for frame in frames {
            let result = receiver.receive(frame.id(), frame.data(), 0);
            if let Ok(Received::Scan { scan_index }) = result {
                let world = &self.worlds[usize::from(scan_index)];
                let scan = receiver.scan(0).unwrap();
                assert_eq!(scan.scan_index, scan_index);
                assert_eq!(cell_set(&scan), world.known(), "a wrong map was taken over");
                assert_eq!(scan.sectors, world.sectors);
            }
        }
        receiver
    }
}

/// Whether the receiver has anything to complain about.
fn noticed(statistics: &ReceiverStatistics) -> bool {
    let complaints = ReceiverStatistics { scans: 0, ..*statistics };
    complaints != ReceiverStatistics::default()
}

fn formats() -> [(FrameFormat, u64); 2] {
    [(FrameFormat::Classic, 30), (FrameFormat::Fd, 60)]
}

#[test]
fn nothing_is_noticed_when_nothing_happens() {
    for (format, changes) in formats() {
        let bus = Bus::new(&mut Random::new(20), format, 40, changes);
        let receiver = bus.receive(&bus.frames);
        assert_eq!(receiver.statistics(), &ReceiverStatistics { scans: 40, ..ReceiverStatistics::default() });
    }
}

#[test]
fn every_single_lost_frame_is_noticed() {
    for (format, changes) in formats() {
        let bus = Bus::new(&mut Random::new(21), format, 4, changes);
        for lost in 0..bus.frames.len() {
            let receiver = bus.receive(bus.frames[..lost].iter().chain(&bus.frames[lost + 1..]));
            let statistics = receiver.statistics();
            assert_eq!(statistics.scans, 3, "frame {lost}: exactly its own scan is given up");
            // What was lost from the last scan shows in the next one, or in the time-out if there is none.
            assert!(noticed(statistics) || lost + 1 == bus.frames.len(), "frame {lost}");
        }
    }
}

#[test]
fn every_lost_stretch_of_frames_is_noticed() {
    let bus = Bus::new(&mut Random::new(22), FrameFormat::Classic, 5, 30);
    // The last scan stays, so that there is something to notice by.
    let last = bus.frames.iter().rposition(|frame| frame.id().as_raw() == 0x401).unwrap();
    for first in 1..last {
        for end in first + 1..=last {
            let receiver = bus.receive(bus.frames[..first].iter().chain(&bus.frames[end..]));
            assert!(noticed(receiver.statistics()), "frames {first} to {end}");
        }
    }
}

#[test]
fn a_loss_of_as_many_frames_as_counter_and_sequence_repeat_after_is_noticed() {
    let mut encoder = encoder(FrameFormat::Classic);
    // One run in each cell: 255 frames of two.
    let geometry = fencepost_core::map::MapGeometry { x_first: -20, x_count: 40, y_first: -30, y_count: 60, ..SMALL };
    let world = World::random(&mut Random::new(23), 0, geometry, 90);
    let (frames, _) = world.encode(&mut encoder);
    assert_eq!(frames.len(), 263);
    for lost in [1, 14, 15, 16, 30, 32, 240, 254] {
        for first in 1..=255 - lost {
            let mut receiver = receiver(encoder.config().address());
            for frame in frames[..first].iter().chain(&frames[first + lost..]) {
                receiver.receive(frame.id(), frame.data(), 0).unwrap();
            }
            assert_eq!((receiver.statistics().scans, receiver.statistics().abandoned_scans), (0, 1), "{first} {lost}");
        }
    }
}

#[test]
fn every_repeated_frame_is_noticed_and_does_no_harm() {
    for (format, changes) in formats() {
        let bus = Bus::new(&mut Random::new(24), format, 3, changes);
        for k in 0..bus.frames.len() {
            let receiver = bus.receive(bus.frames[..=k].iter().chain(&bus.frames[k..]));
            let statistics = receiver.statistics();
            assert_eq!((statistics.scans, statistics.repeated), (3, 1), "frame {k}");
        }
    }
}

#[test]
fn every_exchange_of_two_frames_is_noticed() {
    for (format, changes) in formats() {
        let bus = Bus::new(&mut Random::new(25), format, 3, changes);
        for a in 0..bus.frames.len() {
            for b in a + 1..bus.frames.len() {
                let mut frames = bus.frames.clone();
                frames.swap(a, b);
                let receiver = bus.receive(&frames);
                assert!(noticed(receiver.statistics()), "frames {a} and {b}");
                assert!(receiver.statistics().scans < 3, "frames {a} and {b}");
            }
        }
    }
}

#[test]
fn a_frame_from_elsewhere_in_the_stream_is_noticed() {
    let bus = Bus::new(&mut Random::new(26), FrameFormat::Classic, 36, 10);
    let mut random = Random::new(27);
    for _ in 0..3_000 {
        let (from, to) =
            (random.below(bus.frames.len() as u64) as usize, random.below(bus.frames.len() as u64) as usize);
        let frame = bus.frames[from];
        // Inserted, as a delayed copy would be.
        let inserted = bus.frames[..to].iter().chain([&frame]).chain(&bus.frames[to..]);
        let receiver = bus.receive(inserted);
        let harmless = from == to || from + 1 == to;
        assert!(noticed(receiver.statistics()) || harmless, "{from} inserted at {to}");
        // In place of another.
        let replaced = bus.frames[..to].iter().chain([&frame]).chain(&bus.frames[to + 1..]);
        let receiver = bus.receive(replaced);
        assert!(noticed(receiver.statistics()) || from == to, "{from} in place of {to}");
    }
}

#[test]
fn scans_whose_frames_are_mixed_are_never_one() {
    let mut random = Random::new(28);
    let bus = Bus::new(&mut random, FrameFormat::Classic, 40, 30);
    let starts = (0..bus.frames.len()).filter(|k| bus.frames[*k].id().as_raw() == 0x401).collect::<Vec<_>>();
    let part = |k: usize| &bus.frames[starts[k]..starts.get(k + 1).copied().unwrap_or(bus.frames.len())];
    for a in 0..39 {
        for b in [a + 1, (a + 16) % 40, (a + 15) % 40, (a + 30) % 40] {
            let (mut a_frames, mut b_frames) = (part(a).iter(), part(b).iter());
            let mut mixed = Vec::new();
            while a_frames.len() + b_frames.len() > 0 {
                let next = if random.below(2) == 0 { a_frames.next() } else { b_frames.next() };
                mixed.extend(next);
            }
            // Checks inside that whatever becomes whole is right.
            bus.receive(mixed);
            // The head of one scan and the tail of the other, at every place.
            for cut in 1..part(a).len().min(part(b).len()) {
                let receiver = bus.receive(part(a)[..cut].iter().chain(&part(b)[cut..]));
                assert_eq!(receiver.statistics().scans, 0, "scans {a} and {b} cut at {cut}");
            }
        }
    }
}

#[test]
fn every_error_of_one_bit_and_many_of_two_are_noticed() {
    let mut random = Random::new(29);
    for (format, changes) in formats() {
        let bus = Bus::new(&mut random, format, 2, changes);
        for k in 0..bus.frames.len() {
            let frame = bus.frames[k];
            let bits = frame.data().len() * 8;
            for bit in 0..bits {
                for second in [None, Some(random.below(bits as u64) as usize)] {
                    let mut data = frame.data().to_vec();
                    data[bit / 8] ^= 1 << (bit % 8);
                    if let Some(second) = second.filter(|second| *second != bit) {
                        data[second / 8] ^= 1 << (second % 8);
                    }
                    let spoiled = if frame.is_fd() { Frame::fd } else { Frame::classic };
                    let spoiled = spoiled(frame.id(), &data).unwrap();
                    let receiver = bus.receive(bus.frames[..k].iter().chain([&spoiled]).chain(&bus.frames[k + 1..]));
                    assert_eq!(receiver.statistics().crc_errors, 1, "frame {k} bit {bit}");
                    assert_eq!(receiver.statistics().scans, 1, "frame {k} bit {bit}");
                }
            }
        }
    }
}

#[test]
fn a_storm_of_faults_never_brings_a_wrong_map() {
    let mut random = Random::new(30);
    let (mut whole, mut given_up) = (0, 0);
    for round in 0..300 {
        let (format, changes) = formats()[round % 2];
        let bus = Bus::new(&mut random, format, 20, changes / 3);
        let mut frames = Vec::new();
        for k in 0..bus.frames.len() {
            match random.below(60) {
                0 => {}
                1 => frames.extend([bus.frames[k]; 2]),
                2 => frames.insert(frames.len().saturating_sub(random.below(6) as usize), bus.frames[k]),
                3 => frames.extend([bus.frames[k], bus.frames[random.below(k as u64 + 1) as usize]]),
                4 => {
                    let mut data = bus.frames[k].data().to_vec();
                    for _ in 0..2 {
                        let bit = random.below(data.len() as u64 * 8) as usize;
                        data[bit / 8] ^= 1 << (bit % 8);
                    }
                    let spoiled = if bus.frames[k].is_fd() { Frame::fd } else { Frame::classic };
                    frames.push(spoiled(bus.frames[k].id(), &data).unwrap());
                }
                _ => frames.push(bus.frames[k]),
            }
        }
        let receiver = bus.receive(&frames);
        whole += receiver.statistics().scans;
        given_up += receiver.statistics().abandoned_scans;
    }
    println!("{whole} scans became whole, {given_up} were given up");
    assert!(whole > 500 && given_up > 500, "the storm must be neither a breeze nor the end of the world");
}

#[test]
fn any_bytes_under_any_identifier_are_survived() {
    let mut random = Random::new(31);
    let address = super::config(FrameFormat::Classic, 0).address();
    let mut receiver = receiver(address);
    for _ in 0..200_000 {
        let message = Message::ALL[random.below(9) as usize];
        let mut data = [(); 24].map(|()| random.next() as u8);
        let data = &mut data[..message.data_len()];
        // Protected rightly, so that the values themselves are looked at.
        fencepost_core::wire::protect(address.raw_id(message), random.next() as u8, data);
        let _ = receiver.receive(address.id(message), data, random.below(1 << 40));
        let _ = receiver.scan(random.below(1 << 40));
    }
    let noise = *receiver.statistics();
    assert!(noticed(&noise), "{noise:?}");
}
