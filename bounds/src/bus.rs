//! Bus: the most bits of a scan, the load of a bus, and how long a scan takes to go out.

use fencepost_core::wire::{
    FIXED_FRAMES_PER_SCAN, FrameFormat, Message, WireConfig, WireSettings, classic_frame_bits, max_bits_per_scan,
    max_frames_per_scan, max_load_permille,
};

/// Bit rates that are looked at, bits a second.
pub(crate) const BIT_RATES: [u32; 4] = [125_000, 250_000, 500_000, 1_000_000];

/// Scans a second that are looked at.
pub(crate) const SCAN_RATES_HZ: [u16; 3] = [5, 10, 15];

/// Arbitration and data rate of CAN FD with a rate that is switched, bits a second: what most transceivers of vehicles do.
pub(crate) const FD_RATES: (u32, u32) = (500_000, 2_000_000);

/// The formats with their defaults, by name.
pub(crate) fn formats() -> [(&'static str, WireConfig); 2] {
    [("classic", WireSettings::CLASSIC), ("fd", WireSettings::FD)]
        .map(|(name, settings)| (name, WireConfig::new(settings).expect("the defaults are valid")))
}

/// What a format takes of a bus at most, rows of a name and a figure.
pub(crate) fn rows() -> Vec<(String, u64)> {
    let mut rows = Vec::new();
    for message in Message::ALL {
        rows.push((format!("message_bytes.{}", message.name()), message.data_len() as u64));
    }
    for (name, config) in formats() {
        rows.push((format!("{name}.frames_per_scan"), max_frames_per_scan(&config) as u64));
        rows.push((format!("{name}.bits_per_scan"), u64::from(max_bits_per_scan(&config))));
        for bit_rate in BIT_RATES {
            let kbit = bit_rate / 1000;
            rows.push((format!("{name}.{kbit}kbit.scan_us"), scan_us(&config, bit_rate)));
            for rate_hz in SCAN_RATES_HZ {
                let permille = max_load_permille(&config, bit_rate, rate_hz);
                rows.push((format!("{name}.{kbit}kbit.{rate_hz}hz.load_permille"), u64::from(permille)));
            }
        }
    }
    let (_, fd) = formats()[1];
    rows.push(("fd.500kbit_2mbit.scan_us".to_owned(), switched_scan_us(&fd, FD_RATES)));
    rows
}

/// Longest time from the first bit of a scan to the last of its last frame on a bus that nobody else uses, microseconds,
/// rounded up; before it, one frame of another device may be under way.
///
/// A scan that has the bus to itself goes out without gaps: the intermission is part of each frame. Devices of higher priority
/// come on top, by their own bits.
pub(crate) fn scan_us(config: &WireConfig, bit_rate: u32) -> u64 {
    let blocking = match config.format() {
        FrameFormat::Classic => classic_frame_bits(8),
        // Whoever speaks CAN FD may send 64 bytes.
        FrameFormat::Fd => fencepost_core::wire::fd_frame_bits(64),
    };
    let bits = u64::from(max_bits_per_scan(config)) + u64::from(blocking);
    (bits * 1_000_000).div_ceil(u64::from(bit_rate))
}

/// The same where the frames of cells switch their bit rate.
pub(crate) fn switched_scan_us(config: &WireConfig, (arbitration, data): (u32, u32)) -> u64 {
    let ns = |bits: u64, rate: u32| (bits * 1_000_000_000).div_ceil(u64::from(rate));
    let frame_ns = |bytes| {
        let (slow, fast) = switched_bits(bytes);
        ns(slow, arbitration) + ns(fast, data)
    };
    let fixed = FIXED_FRAMES_PER_SCAN as u64 * ns(u64::from(classic_frame_bits(8)), arbitration);
    let cells = u64::from(config.max_cell_frames()) * frame_ns(24);
    (frame_ns(64) + fixed + cells).div_ceil(1000)
}

/// Most bits of a CAN FD frame with an 11-bit identifier and 17 to 64 bytes, at the arbitration and at the data rate.
///
/// The rate switches after the bit that says so, the last of 17 with the start of frame: start, identifier, RRS, IDE, FDF, res,
/// BRS; and back at the end of the CRC delimiter, which counts as fast but for its end. ISO 11898-1:2015. Each run of five equal
/// bits has a stuff bit, the worst one after the first five bits and each four after them, whichever phase they fall in.
pub(crate) fn switched_bits(data_bytes: u32) -> (u64, u64) {
    let (before, after) = (17u64, 5 + 8 * u64::from(data_bytes));
    let stuffed = |bits: u64| (bits - 1) / 4;
    // Stuff bits of the slow phase, as many as can fall there; the fast one has the rest and may have one more.
    let slow = before + stuffed(before);
    let fast = after + after.div_ceil(4);
    // Stuff count, CRC of 21 bits, their fixed stuff bits and the delimiter.
    let check = 4 + 21 + 1 + 6 + 1;
    // Acknowledge, its delimiter, end of frame, intermission; and the delimiter once more, since it lasts into the slow phase.
    (slow + 1 + 1 + 1 + 7 + 3, fast + check)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fencepost_core::wire::fd_frame_bits;

    /// Bits on the bus of a run of bits, stuffed as a controller does it.
    fn on_the_bus(bits: impl Iterator<Item = bool>) -> u32 {
        let (mut count, mut run, mut last) = (0, 0, None);
        for bit in bits {
            run = if last == Some(bit) { run + 1 } else { 1 };
            (last, count) = (Some(bit), count + 1);
            if run == 5 {
                (last, run, count) = (Some(!bit), 1, count + 1);
            }
        }
        count
    }

    /// Most bits on the bus over every run of `len` bits, found by going through all states that stuffing can be in instead of
    /// through the runs: the last bit does not matter, only how many equal ones there were.
    fn most_on_the_bus(len: u32) -> u32 {
        let mut most = [None; 5];
        // `most[run]`: bits so far, where the last `run` are equal.
        most[1] = Some(1);
        for _ in 1..len {
            let mut next = [None; 5];
            for (run, bits) in most.iter().enumerate().filter_map(|(run, bits)| Some((run, (*bits)?))) {
                for (run, bits) in [(1, bits + 1), (run + 1, bits + 1)] {
                    // The fifth equal bit is followed by a stuff bit, which begins a run of its own.
                    let (run, bits) = if run == 5 { (1, bits + 1) } else { (run, bits) };
                    next[run] = next[run].max(Some(bits));
                }
            }
            most = next;
        }
        most.into_iter().flatten().max().unwrap_or(0)
    }

    #[test]
    fn the_search_for_the_worst_agrees_with_going_through_every_frame() {
        for len in 1..=18 {
            let every = (0..1u32 << len).map(|bits| on_the_bus((0..len).map(move |i| bits >> i & 1 == 1))).max();
            assert_eq!(Some(most_on_the_bus(len)), every, "{len} bits");
        }
    }

    #[test]
    fn no_frame_is_longer_than_its_bound() {
        for bytes in 0..=8 {
            assert_eq!(classic_frame_bits(bytes), most_on_the_bus(34 + 8 * bytes) + 13, "{bytes} bytes");
        }
        for bytes in [20, 24, 32, 48, 64] {
            let check = 25 + 7 + 13;
            assert_eq!(fd_frame_bits(bytes), most_on_the_bus(22 + 8 * bytes) + check, "{bytes} bytes");
            let (slow, fast) = switched_bits(bytes);
            assert!(slow + fast >= u64::from(fd_frame_bits(bytes)), "{bytes} bytes");
        }
    }

    /// Published: Davis, Burns, Bril, Lukkien (Real-Time Systems 35, 2007), `g + 8 s + 13 + (g + 8 s - 1) / 4` with `g` = 34; with
    /// eight bytes 135 bits. And 673 bits for the fast part of 64 bytes in a CAN FD frame.
    #[test]
    fn published_lengths() {
        let published = |bytes: u32| 34 + 8 * bytes + 13 + (34 + 8 * bytes - 1) / 4;
        assert_eq!([0, 1, 8].map(classic_frame_bits), [0, 1, 8].map(published));
        assert_eq!(classic_frame_bits(8), 135);
        let (_, fast) = switched_bits(64);
        assert!((673..=682).contains(&fast), "{fast}");
    }

    #[test]
    fn a_scan_takes_as_long_as_its_bits() {
        let [(_, classic), (_, fd)] = formats();
        assert_eq!(scan_us(&classic, 500_000), (208 + 1) * 135 * 2);
        let (slow, fast) = scan_us_of_both(&fd);
        assert!(slow > fast, "{slow} us, {fast} us with a rate that is switched");
    }

    fn scan_us_of_both(config: &WireConfig) -> (u64, u64) {
        (scan_us(config, 500_000), switched_scan_us(config, (500_000, 2_000_000)))
    }
}
