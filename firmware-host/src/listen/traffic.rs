//! How much goes over the bus.

use std::collections::VecDeque;

use embedded_can::Id;
use fencepost_core::wire::{classic_frame_bits, fd_frame_bits};
use fencepost_hal::can::CanFrame;

/// The load is that of the last second.
const WINDOW_NS: u64 = 1_000_000_000;

/// Frames on the bus, ours and others'.
#[derive(Debug)]
pub struct Traffic {
    recent: VecDeque<(u64, u32)>,
    first_ns: Option<u64>,
    newest_ns: Option<u64>,
    frames: u64,
    of_others: u64,
}

impl Traffic {
    /// Nothing yet.
    pub const fn new() -> Self {
        Self { recent: VecDeque::new(), first_ns: None, newest_ns: None, frames: 0, of_others: 0 }
    }

    /// Counts a frame that came at `at_ns`.
    pub fn take(&mut self, frame: &CanFrame, at_ns: u64, ours: bool) {
        self.frames += 1;
        self.of_others += u64::from(!ours);
        self.first_ns.get_or_insert(at_ns);
        self.newest_ns = Some(at_ns);
        self.recent.push_back((at_ns, frame_bits(frame)));
        while self.recent.pop_front_if(|(then_ns, _)| at_ns.saturating_sub(*then_ns) >= WINDOW_NS).is_some() {}
    }

    /// Frames so far.
    pub const fn frames(&self) -> u64 {
        self.frames
    }

    /// Those of other devices among them.
    pub const fn of_others(&self) -> u64 {
        self.of_others
    }

    /// When the newest frame came.
    pub const fn newest_ns(&self) -> Option<u64> {
        self.newest_ns
    }

    /// Frames and bits in a second, as of `now_ns`. In the first second they are those since the first frame.
    pub fn per_s(&self, now_ns: u64) -> (f64, f64) {
        let recent = self.recent.iter().filter(|(then_ns, _)| now_ns.saturating_sub(*then_ns) < WINDOW_NS);
        let (frames, bits) =
            recent.fold((0_u64, 0_u64), |(frames, bits), (_, more)| (frames + 1, bits + u64::from(*more)));
        let heard_ns = self.first_ns.map_or(WINDOW_NS, |first_ns| now_ns.saturating_sub(first_ns));
        // A tenth of a second at least: the first frame alone is no measure.
        let seconds = heard_ns.clamp(WINDOW_NS / 10, WINDOW_NS) as f64 * 1.0e-9;
        (frames as f64 / seconds, bits as f64 / seconds)
    }
}

impl Default for Traffic {
    fn default() -> Self {
        Self::new()
    }
}

/// Most bits that a frame takes on the bus, with all stuff bits. CAN FD is counted without switching the bit rate.
pub fn frame_bits(frame: &CanFrame) -> u32 {
    let bytes = frame.data().len() as u32;
    // Of an extended identifier 18 more bits, SRR and r1: 20, all of them stuffed.
    let extended = if matches!(frame.id(), Id::Extended(_)) { 20 + 20 / 4 } else { 0 };
    extended + if frame.is_fd() { fd_frame_bits(bytes) } else { classic_frame_bits(bytes) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(text: &str) -> CanFrame {
        text.parse().unwrap()
    }

    #[test]
    fn bits_of_frames() {
        assert_eq!(frame_bits(&frame("123#1122334455667788")), 135);
        assert_eq!(frame_bits(&frame("123#")), 55);
        // The published formula for extended frames: g = 54 (Davis et al., section 3).
        assert_eq!(frame_bits(&frame("12345678#1122334455667788")), 54 + 64 + 13 + (54 + 64 - 1) / 4);
        assert_eq!(frame_bits(&frame("123##1112233445566778811223344556677881122334455667788")), 312);
    }

    #[test]
    fn the_load_is_that_of_the_last_second_and_falls_when_nothing_comes() {
        let mut traffic = Traffic::new();
        let one = frame("123#1122334455667788");
        // 1000 frames in a second, for three seconds.
        (0..3_000).for_each(|ms| traffic.take(&one, ms * 1_000_000, ms % 2 == 0));
        let (frames, bits) = traffic.per_s(2_999_000_000);
        assert_eq!((frames.round(), bits.round()), (1_000.0, 135_000.0));
        assert_eq!(traffic.recent.len(), 1_000);
        assert_eq!(traffic.per_s(3_499_000_000).0.round(), 500.0);
        assert_eq!(traffic.per_s(9_000_000_000), (0.0, 0.0));
        assert_eq!((traffic.frames(), traffic.of_others()), (3_000, 1_500));

        let mut young = Traffic::new();
        (0..250).for_each(|ms| young.take(&one, ms * 1_000_000, true));
        assert_eq!(young.per_s(250_000_000).0.round(), 1_000.0);
    }
}
