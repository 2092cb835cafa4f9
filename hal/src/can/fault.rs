//! A bus that spoils frames, for tests of what is behind it.

use std::collections::VecDeque;

use super::{BusCondition, CanBus, CanFrame};

/// Spoils frames on their way to the bus behind: drops, repeats, corrupts or delays them, by chance from a seed.
///
/// Chances are in percent, 0 at first. One frame may meet several faults.
#[derive(Clone, Debug)]
pub struct FaultInjector<B> {
    bus: B,
    state: u64,
    drop_percent: u8,
    duplicate_percent: u8,
    corrupt_percent: u8,
    delay_percent: u8,
    delay_frames: u32,
    held: VecDeque<Held>,
    counts: FaultCounts,
}

/// How often each fault was met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultCounts {
    /// Frames handed over for sending.
    pub sent: u64,
    /// Frames that never reached the bus.
    pub dropped: u64,
    /// Frames that reached the bus twice.
    pub duplicated: u64,
    /// Frames with one bit of their data turned over.
    pub corrupted: u64,
    /// Frames that reached the bus behind later ones.
    pub delayed: u64,
}

#[derive(Clone, Copy, Debug)]
struct Held {
    frame: CanFrame,
    frames_left: u32,
}

impl<B> FaultInjector<B> {
    /// Passes everything on to `bus` until a chance is set. The same seed gives the same faults.
    pub const fn new(bus: B, seed: u64) -> Self {
        Self {
            bus,
            state: seed,
            drop_percent: 0,
            duplicate_percent: 0,
            corrupt_percent: 0,
            delay_percent: 0,
            delay_frames: 1,
            held: VecDeque::new(),
            counts: FaultCounts { sent: 0, dropped: 0, duplicated: 0, corrupted: 0, delayed: 0 },
        }
    }

    /// Chance that a frame is lost, percent.
    pub const fn set_drop_chance(&mut self, percent: u8) {
        self.drop_percent = percent;
    }

    /// Chance that a frame is sent twice, percent.
    pub const fn set_duplicate_chance(&mut self, percent: u8) {
        self.duplicate_percent = percent;
    }

    /// Chance that one bit of a frame's data is turned over, percent. Frames without data stay as they are.
    pub const fn set_corrupt_chance(&mut self, percent: u8) {
        self.corrupt_percent = percent;
    }

    /// Chance that a frame is held back, percent, until `frames` (at least 1) later ones have gone.
    pub const fn set_delay_chance(&mut self, percent: u8, frames: u32) {
        self.delay_percent = percent;
        self.delay_frames = if frames == 0 { 1 } else { frames };
    }

    /// How often each fault was met.
    pub const fn counts(&self) -> FaultCounts {
        self.counts
    }

    /// The bus behind. Frames that are held back are lost.
    pub fn into_inner(self) -> B {
        self.bus
    }

    fn happens(&mut self, percent: u8) -> bool {
        // A draw for every chance, set or not: changing one chance leaves the others' draws as they are.
        self.draw() % 100 < u64::from(percent)
    }

    /// SplitMix64 (Steele, Lea, Flood: Fast splittable pseudorandom number generators, 2014).
    const fn draw(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
}

impl<B: CanBus> FaultInjector<B> {
    /// Sends what is held back.
    ///
    /// # Errors
    /// When the bus behind does not take a frame; that one is lost, the ones behind it stay held.
    pub fn flush(&mut self, now_ns: u64) -> Result<(), B::Error> {
        while let Some(held) = self.held.pop_front() {
            self.bus.send(&held.frame, now_ns)?;
        }
        Ok(())
    }

    /// Sends the frames whose time has come after one more frame has gone.
    fn release(&mut self, now_ns: u64) -> Result<(), B::Error> {
        for held in &mut self.held {
            held.frames_left = held.frames_left.saturating_sub(1);
        }
        while let Some(held) = self.held.pop_front_if(|held| held.frames_left == 0) {
            self.bus.send(&held.frame, now_ns)?;
        }
        Ok(())
    }
}

impl<B: CanBus> CanBus for FaultInjector<B> {
    type Error = B::Error;

    fn send(&mut self, frame: &CanFrame, now_ns: u64) -> Result<(), Self::Error> {
        self.counts.sent += 1;
        let dropped = self.happens(self.drop_percent);
        let duplicated = self.happens(self.duplicate_percent);
        let corrupted = self.happens(self.corrupt_percent) && !frame.data().is_empty();
        let delayed = self.happens(self.delay_percent);
        let bit = self.draw();
        if dropped {
            self.counts.dropped += 1;
            return Ok(());
        }
        let mut frame = *frame;
        if corrupted {
            self.counts.corrupted += 1;
            frame = frame.map_data(|data| {
                let bit = (bit % (8 * data.len() as u64)) as usize;
                data[bit / 8] ^= 1 << (bit % 8);
            });
        }
        if delayed {
            self.counts.delayed += 1;
            self.held.push_back(Held { frame, frames_left: self.delay_frames });
            return Ok(());
        }
        self.bus.send(&frame, now_ns)?;
        if duplicated {
            self.counts.duplicated += 1;
            self.bus.send(&frame, now_ns)?;
        }
        self.release(now_ns)
    }

    fn receive(&mut self) -> Result<Option<(u64, CanFrame)>, Self::Error> {
        self.bus.receive()
    }

    fn condition(&self) -> BusCondition {
        self.bus.condition()
    }
}

#[cfg(test)]
mod tests {
    use embedded_can::StandardId;

    use super::*;
    use crate::can::{VirtualBus, VirtualNode};

    const FRAMES: u16 = 2000;

    /// Sends numbered frames through a spoilt bus; what arrives, and the counts.
    fn through(seed: u64, set: impl Fn(&mut FaultInjector<VirtualNode>)) -> (Vec<(u16, u16)>, FaultCounts) {
        println!("seed {seed}");
        let bus = VirtualBus::new(2 * usize::from(FRAMES));
        let (sender, mut receiver) = (bus.attach(), bus.attach());
        let mut faulty = FaultInjector::new(sender, seed);
        set(&mut faulty);
        for i in 0..FRAMES {
            let id = StandardId::new(i).unwrap();
            faulty.send(&CanFrame::new(id, &i.to_be_bytes(), false).unwrap(), u64::from(i)).unwrap();
        }
        faulty.flush(u64::from(FRAMES)).unwrap();
        let arrived = std::iter::from_fn(|| receiver.receive().unwrap());
        let arrived = arrived.map(|(_, f)| (f.raw_id() as u16, u16::from_be_bytes(f.data().try_into().unwrap())));
        (arrived.collect(), faulty.counts())
    }

    fn near(count: u64, percent: u64) {
        let expected = u64::from(FRAMES) * percent / 100;
        assert!(count.abs_diff(expected) < expected / 4, "{count} of about {expected}");
    }

    #[test]
    fn without_faults_everything_passes() {
        let (arrived, counts) = through(1, |_| ());
        assert_eq!(arrived, (0..FRAMES).map(|i| (i, i)).collect::<Vec<_>>());
        assert_eq!(counts, FaultCounts { sent: u64::from(FRAMES), ..FaultCounts::default() });
    }

    #[test]
    fn each_fault_does_what_its_name_says_as_often_as_it_counts() {
        let (arrived, counts) = through(2, |faulty| faulty.set_drop_chance(20));
        near(counts.dropped, 20);
        assert_eq!(arrived.len() as u64, u64::from(FRAMES) - counts.dropped);
        assert!(arrived.is_sorted());

        let (arrived, counts) = through(3, |faulty| faulty.set_duplicate_chance(20));
        near(counts.duplicated, 20);
        assert_eq!(arrived.windows(2).filter(|pair| pair[0] == pair[1]).count() as u64, counts.duplicated);

        let (arrived, counts) = through(4, |faulty| faulty.set_corrupt_chance(20));
        near(counts.corrupted, 20);
        assert_eq!(arrived.iter().filter(|(id, data)| id != data).count() as u64, counts.corrupted);
        assert!(arrived.iter().all(|(id, data)| (id ^ data).count_ones() <= 1), "one bit at most");

        let (mut arrived, counts) = through(5, |faulty| faulty.set_delay_chance(20, 3));
        near(counts.delayed, 20);
        assert!(!arrived.is_sorted());
        arrived.sort();
        assert_eq!(arrived, (0..FRAMES).map(|i| (i, i)).collect::<Vec<_>>(), "nothing is lost");
    }

    #[test]
    fn the_same_seed_gives_the_same_faults_and_another_seed_others() {
        let all = |faulty: &mut FaultInjector<VirtualNode>| {
            faulty.set_drop_chance(10);
            faulty.set_duplicate_chance(10);
            faulty.set_corrupt_chance(10);
            faulty.set_delay_chance(10, 2);
        };
        assert_eq!(through(6, all), through(6, all));
        assert_ne!(through(6, all), through(7, all));
    }
}
