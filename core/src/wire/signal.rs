//! Signals: runs of bits in the bytes of a message, little-endian as the DBC's `@1`.

/// Where a signal lies: its lowest bit, counted from bit 0 of byte 0 upward, and how many bits it has (1 to 24).
///
/// These are the start bit and size that stand in the DBC file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signal {
    /// Lowest bit.
    pub start: u8,
    /// Number of bits.
    pub size: u8,
}

/// Where the bytes of a word lie in it.
const BYTES: [u32; 4] = [0, 8, 16, 24];

impl Signal {
    /// A signal of `size` bits from bit `start`.
    pub const fn new(start: u8, size: u8) -> Self {
        assert!(size > 0 && size <= 24, "a signal has 1 to 24 bits");
        Self { start, size }
    }

    /// Largest unsigned value.
    pub const fn max(self) -> u32 {
        match 1u32.checked_shl(self.size as u32) {
            Some(next) => next.wrapping_sub(1),
            None => u32::MAX,
        }
    }

    /// Largest signed value.
    pub const fn max_signed(self) -> i32 {
        (self.max() >> 1) as i32
    }

    /// Smallest signed value.
    pub const fn min_signed(self) -> i32 {
        -self.max_signed() - 1
    }

    /// The same signal `bits` further on.
    pub const fn shifted(self, bits: u8) -> Self {
        Self { start: self.start.saturating_add(bits), size: self.size }
    }

    /// Reads the signal; bits beyond the end of `data` read as zero.
    ///
    /// # Bound
    /// Four bytes.
    pub fn get(self, data: &[u8]) -> u32 {
        let first = usize::from(self.start / 8);
        let mut word = 0;
        for (byte, at) in data.get(first..).unwrap_or_default().iter().zip(BYTES) {
            word |= u32::from(*byte) << at;
        }
        (word >> (self.start % 8)) & self.max()
    }

    /// Reads the signal as a two's complement number.
    pub fn get_signed(self, data: &[u8]) -> i32 {
        let unused = 32u32.saturating_sub(u32::from(self.size)).min(31);
        ((self.get(data) << unused) as i32) >> unused
    }

    /// Writes the signal. Values that do not fit are held at the largest that does; bits beyond the end of `data` are lost.
    ///
    /// # Bound
    /// Four bytes.
    pub fn put(self, data: &mut [u8], value: u32) {
        self.put_bits(data, value.min(self.max()));
    }

    /// Writes the signal as a two's complement number, held within what fits.
    pub fn put_signed(self, data: &mut [u8], value: i32) {
        self.put_bits(data, value.clamp(self.min_signed(), self.max_signed()) as u32 & self.max());
    }

    fn put_bits(self, data: &mut [u8], bits: u32) {
        let first = usize::from(self.start / 8);
        let shift = self.start % 8;
        let (mask, bits) = (self.max() << shift, bits << shift);
        for (byte, at) in data.get_mut(first..).unwrap_or_default().iter_mut().zip(BYTES) {
            *byte = (*byte & !((mask >> at) as u8)) | (bits >> at) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_and_size_keeps_its_value_and_leaves_the_other_bits() {
        for size in 1..=24 {
            for start in 0..=64 - size {
                let signal = Signal::new(start, size);
                let all = ((1_u64 << size) - 1) << start;
                for (value, background) in [(signal.max(), 0_u64), (0, u64::MAX), (0x00A5_C35A & signal.max(), 0)] {
                    let mut data = background.to_le_bytes();
                    signal.put(&mut data, value);
                    // Plain 64-bit arithmetic as the oracle.
                    let expected = (background & !all) | (u64::from(value) << start);
                    assert_eq!(u64::from_le_bytes(data), expected, "{signal:?}");
                    assert_eq!(signal.get(&data), value, "{signal:?}");
                }
            }
        }
    }

    #[test]
    fn signals_of_no_bits_or_more_than_24_are_refused() {
        extern crate std;
        for size in 0..=u8::MAX {
            let made = std::panic::catch_unwind(|| Signal::new(0, size));
            assert_eq!(made.is_ok(), (1..=24).contains(&size), "{size} bits");
        }
    }

    #[test]
    fn signed_values_keep_their_sign_and_saturate() {
        let signal = Signal::new(31, 7);
        for value in -64..=63 {
            let mut data = [0xFF; 8];
            signal.put_signed(&mut data, value);
            assert_eq!(signal.get_signed(&data), value);
        }
        let mut data = [0; 8];
        signal.put_signed(&mut data, 1000);
        assert_eq!(signal.get_signed(&data), 63);
        signal.put_signed(&mut data, -1000);
        assert_eq!(signal.get_signed(&data), -64);
        signal.put(&mut data, 1000);
        assert_eq!(signal.get(&data), 127);
    }

    #[test]
    fn short_data_reads_as_zero_and_is_not_overrun() {
        let signal = Signal::new(12, 16);
        assert_eq!(signal.get(&[0xFF, 0xFF]), 0xF);
        let mut data = [0; 2];
        signal.put(&mut data, 0xFFFF);
        assert_eq!(data, [0, 0xF0]);
        signal.put(&mut [], 1);
    }
}
