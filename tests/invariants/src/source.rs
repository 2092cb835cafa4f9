//! From bytes to values: every sequence of bytes is an input, and a byte more or less changes little of it.

use arbitrary::Unstructured;

/// The bytes of an input. Behind their end everything is zero.
#[derive(Debug)]
pub struct Source<'a>(Unstructured<'a>);

impl<'a> Source<'a> {
    /// Begins with the first byte.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self(Unstructured::new(bytes))
    }

    /// Whether all bytes are used up.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The next byte.
    pub fn byte(&mut self) -> u8 {
        self.0.arbitrary().unwrap_or(0)
    }

    /// The next two bytes.
    pub fn word(&mut self) -> u16 {
        self.0.arbitrary().unwrap_or(0)
    }

    /// The next four bytes.
    pub fn double_word(&mut self) -> u32 {
        self.0.arbitrary().unwrap_or(0)
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
        let count = self.0.len().min(most);
        self.0.bytes(count).unwrap_or_default()
    }

    /// All bytes that are left.
    pub fn rest(&mut self) -> &'a [u8] {
        self.bytes(usize::MAX)
    }
}
