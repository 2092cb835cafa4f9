//! How much of a bus the messages take, in the worst case.
//!
//! Bits are counted with the intermission of three bits and the most stuff bits that a frame can have. Errors on the bus and
//! the frames that are sent again after them are not counted: they have no bound.

use super::config::{FrameFormat, WireConfig, WireSettings};
use super::message::SectorsRepr;

/// Frames of a scan beside the cell frames: header, sectors, ground and end.
pub const FIXED_FRAMES_PER_SCAN: usize = 3 + SectorsRepr::PARTS as usize;

/// Heartbeats of a node in a second.
pub const HEARTBEAT_RATE_HZ: u32 = 10;

/// Most heartbeats in a second: those that tell at once what has changed come besides, but never closer than 50 ms.
pub const MAX_HEARTBEAT_RATE_HZ: u32 = 20;

/// Vehicle motion messages in a second that the load reckons with.
pub const VEHICLE_MOTION_RATE_HZ: u32 = 50;

/// Most bits of a classic data frame with an 11-bit identifier and `data_bytes` bytes.
///
/// 34 bits from the start of frame to the end of the CRC are stuffed beside the data, 13 are not; in the worst case one stuff
/// bit follows the first five bits and each four after them. Source: Davis, Burns, Bril, Lukkien, *Controller Area Network
/// (CAN) schedulability analysis: Refuted, revisited and revised*, Real-Time Systems 35, 2007, section 3.
pub const fn classic_frame_bits(data_bytes: u32) -> u32 {
    8 * data_bytes + 47 + (34 + 8 * data_bytes - 1) / 4
}

/// Most bits of a CAN FD data frame with an 11-bit identifier and 17 to 64 `data_bytes`, in the bits of a frame that does not
/// switch its bit rate: an upper bound of the time that any other takes.
///
/// 22 bits before the data, stuffed with them; then, by ISO 11898-1:2015, the stuff count of 4 bits and the CRC of 21 with a
/// fixed stuff bit before each four of them; then delimiters, acknowledge, end of frame and intermission, 13 bits.
pub const fn fd_frame_bits(data_bytes: u32) -> u32 {
    let stuffed = 22 + 8 * data_bytes;
    let stuff_bits = (stuffed - 1) / 4;
    let check = 4 + 21_u32;
    let fixed_stuff_bits = check.div_ceil(4);
    stuffed + stuff_bits + check + fixed_stuff_bits + 13
}

/// Most frames of a scan.
pub const fn max_frames_per_scan(config: &WireConfig) -> usize {
    FIXED_FRAMES_PER_SCAN + config.max_cell_frames() as usize
}

/// Most bits of a scan.
pub const fn max_bits_per_scan(config: &WireConfig) -> u32 {
    let cell_frame = match config.format() {
        FrameFormat::Classic => classic_frame_bits(8),
        FrameFormat::Fd => fd_frame_bits(24),
    };
    FIXED_FRAMES_PER_SCAN as u32 * classic_frame_bits(8) + config.max_cell_frames() as u32 * cell_frame
}

/// Most bits in a second of one node and of the controller that talks to it: scans, heartbeats, the echo of each scan, and
/// the vehicle's motion at [`VEHICLE_MOTION_RATE_HZ`].
pub const fn max_bits_per_second(config: &WireConfig, scan_rate_hz: u16) -> u32 {
    let scans = scan_rate_hz as u32;
    let others = MAX_HEARTBEAT_RATE_HZ + VEHICLE_MOTION_RATE_HZ + scans;
    scans.saturating_mul(max_bits_per_scan(config)).saturating_add(others * classic_frame_bits(8))
}

/// Largest load of a bus with `bitrate` bits a second, in tenths of a percent, rounded up; above 1000 it does not fit.
pub const fn max_load_permille(config: &WireConfig, bitrate: u32, scan_rate_hz: u16) -> u32 {
    let bits = max_bits_per_second(config, scan_rate_hz) as u64 * 1000;
    let permille = bits.div_ceil(if bitrate == 0 { 1 } else { bitrate as u64 });
    match permille {
        0..=0xffff_ffff => permille as u32,
        _ => u32::MAX,
    }
}

const fn checked(settings: WireSettings) -> WireConfig {
    match WireConfig::new(settings) {
        Ok(config) => config,
        Err(_) => panic!("the settings are valid"),
    }
}

// Above 60 % the lower priorities of a CAN bus wait long; and other devices want to speak as well.
const _: () = assert!(max_load_permille(&checked(WireSettings::CLASSIC), 500_000, 10) <= 600);
const _: () = assert!(max_load_permille(&checked(WireSettings::FD), 500_000, 10) <= 600);

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    /// Bits of a frame on the bus, stuffed bit by bit as a controller does it.
    fn stuffed(bits: &[bool]) -> usize {
        let (mut count, mut run, mut last) = (0, 0, None);
        for &bit in bits {
            run = if last == Some(bit) { run + 1 } else { 1 };
            last = Some(bit);
            count += 1;
            if run == 5 {
                count += 1;
                last = Some(!bit);
                run = 1;
            }
        }
        count
    }

    #[test]
    fn worst_frame_bits_are_those_of_the_worst_pattern() {
        // Five equal bits, then four of the other value each: every stuff bit begins the next run of five.
        let worst = |len: usize| (0..len).map(|i| i == 0 || (i - 1) / 4 % 2 == 0).collect::<Vec<_>>();
        for bytes in 0..=8 {
            let bits = worst(34 + 8 * bytes);
            assert_eq!(classic_frame_bits(bytes as u32) as usize, stuffed(&bits) + 13);
        }
        assert_eq!(classic_frame_bits(8), 135);
        // 22 + 192 bits with 53 stuff bits, 25 + 7 for the check, 13 at the end.
        assert_eq!(fd_frame_bits(24) as usize, stuffed(&worst(22 + 192)) + 25 + 7 + 13);
        assert_eq!(fd_frame_bits(24), 312);
    }

    #[test]
    fn load_of_the_defaults() {
        let classic = checked(WireSettings::CLASSIC);
        assert_eq!(max_frames_per_scan(&classic), 208);
        assert_eq!(max_bits_per_scan(&classic), 208 * 135);
        assert_eq!(max_load_permille(&classic, 500_000, 10), 584);
        assert_eq!(max_load_permille(&checked(WireSettings::FD), 500_000, 10), 543);
        assert_eq!(max_load_permille(&classic, 0, 10), 291_600_000);
        assert_eq!(max_load_permille(&classic, 0, u16::MAX), u32::MAX);
    }
}
