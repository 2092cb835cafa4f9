//! From bytes to values: every sequence of bytes is an input, and a byte more or less changes little of it.

use arbitrary::Unstructured;

/// The bytes of an input. Behind their end everything is zero.
#[derive(Debug)]
pub struct Source<'a> {
    bytes: Unstructured<'a>,
    /// The state of a generator that begins with what the bytes hash to.
    chance: u64,
}

impl<'a> Source<'a> {
    /// Begins with the first byte.
    pub fn new(bytes: &'a [u8]) -> Self {
        // FNV-1a, eight bytes at a time.
        let mix = |hash: u64, bytes: &[u8]| {
            let word = bytes.iter().fold(0, |word, byte| word << 8 | u64::from(*byte));
            (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3)
        };
        let chance = bytes.chunks(8).fold(0xcbf2_9ce4_8422_2325, mix);
        Self { bytes: Unstructured::new(bytes), chance }
    }

    /// Whether what takes long is to be done: for one in `many` inputs. Which ones is drawn from a hash of all bytes. One byte would
    /// not do: a fuzzer goes on with the inputs that reach the most, which are those that take the longest, and soon most would be.
    pub fn seldom(&mut self, many: u64) -> bool {
        next(&mut self.chance).is_multiple_of(many)
    }

    /// Whether all bytes are used up.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// The next byte.
    pub fn byte(&mut self) -> u8 {
        self.bytes.arbitrary().unwrap_or(0)
    }

    /// The next two bytes.
    pub fn word(&mut self) -> u16 {
        self.bytes.arbitrary().unwrap_or(0)
    }

    /// The next four bytes.
    pub fn double_word(&mut self) -> u32 {
        self.bytes.arbitrary().unwrap_or(0)
    }

    /// One of two by the lowest bit of a byte.
    pub fn flag(&mut self) -> bool {
        self.byte() & 1 == 1
    }

    /// A number below `limit`, from a byte; 0 if `limit` is.
    pub fn below(&mut self, limit: usize) -> usize {
        usize::from(self.byte()).checked_rem(limit).unwrap_or(0)
    }

    /// One of several.
    ///
    /// # Panics
    /// If there is none.
    pub fn one_of<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(values.len())]
    }

    /// A number within `low..=high`, in 255 steps.
    pub fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * f32::from(self.byte()) / 255.0
    }

    /// A number that a file may hold: mostly within `low..=high`, else at its ends or anything that 32 bits can be.
    pub fn any_number(&mut self, low: f32, high: f32) -> f32 {
        match self.byte() {
            0..=215 => self.within(low, high),
            216..=223 => low,
            224..=231 => high,
            232..=239 => 0.0,
            _ => f32::from_bits(self.double_word()),
        }
    }

    /// The next bytes, up to `most`.
    pub fn bytes(&mut self, most: usize) -> &'a [u8] {
        let count = self.bytes.len().min(most);
        self.bytes.bytes(count).unwrap_or_default()
    }

    /// All bytes that are left.
    pub fn rest(&mut self) -> &'a [u8] {
        self.bytes(usize::MAX)
    }
}

/// The next number of a generator: SplitMix64 (Steele, Lea, Flood 2014).
pub(crate) fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
