//! Which pixels of a disparity picture hang together with their neighbours, 32 pixels at a time, a bit for each.
//!
//! Union-find pixel by pixel runs against its branches: nearly every pixel belongs to the surface of its neighbour, and the processor
//! guesses wrong where one does not. Here comparisons come first, all 32 at once and without a branch; what is left is a run of pixels
//! in place of each, and a join where two runs meet for the first time.

use core::ops::Range;

use crate::disparity::DisparityPixel;

/// Pixels that are looked at together.
pub(crate) const PIECE: usize = 32;

/// Disparities in 1/16 px that are values: those of [`DisparityPixel::has_value`].
pub(crate) const VALUES: Range<u16> = 1..0x8000;

/// Up to [`PIECE`] neighbouring pixels of a row, 0 beyond its end.
pub(crate) type Piece = [u16; PIECE];

/// How the pixels of a piece hang together, the first pixel in the lowest bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Links {
    /// Pixels with a value.
    pub(crate) value: u32,
    /// Pixels that hang together with the one to their left: both have a value, and the values are near.
    pub(crate) left: u32,
}

impl Links {
    /// The links of `piece`; `before` is the pixel to the left of it, 0 if there is none.
    #[inline(always)]
    pub(crate) fn of(piece: &Piece, before: u16, values: &Range<u16>, step: u16) -> Self {
        let value = within(piece, values);
        let shifted = shifted(piece, before);
        let value_before = value << 1 | u32::from(values.contains(&before));
        Self { value, left: value & value_before & near(piece, &shifted, step) }
    }

    /// Pixels that begin a run: those with a value that does not go on to the left.
    pub(crate) const fn starts(&self) -> u32 {
        self.value & !self.left
    }
}

/// The piece of `row` from pixel `x` on.
#[inline(always)]
pub(crate) fn piece(row: &[DisparityPixel], x: usize) -> Piece {
    let mut piece = [0; PIECE];
    let pixels = row.get(x..).unwrap_or_default();
    if let Some(whole) = pixels.first_chunk::<PIECE>() {
        // Of a known length: this is one copy.
        for (to, from) in piece.iter_mut().zip(whole) {
            *to = from.bits();
        }
        return piece;
    }
    for (to, from) in piece.iter_mut().zip(pixels) {
        *to = from.bits();
    }
    piece
}

/// Where `piece` lies within `values`.
#[inline(always)]
fn within(piece: &Piece, values: &Range<u16>) -> u32 {
    let span = values.end.saturating_sub(values.start);
    let mut flags = [0; PIECE];
    for (flag, value) in flags.iter_mut().zip(piece) {
        *flag = u8::from(value.wrapping_sub(values.start) < span);
    }
    bits(&flags)
}

/// Where two pieces differ by no more than `step`.
#[inline(always)]
pub(crate) fn near(a: &Piece, b: &Piece, step: u16) -> u32 {
    let mut flags = [0; PIECE];
    for (flag, (a, b)) in flags.iter_mut().zip(a.iter().zip(b)) {
        *flag = u8::from(a.abs_diff(*b) <= step);
    }
    bits(&flags)
}

/// Where two rows are the same.
#[inline(always)]
pub(crate) fn same<T: PartialEq>(a: &[T; PIECE], b: &[T; PIECE]) -> u32 {
    let mut flags = [0; PIECE];
    for (flag, (a, b)) in flags.iter_mut().zip(a.iter().zip(b)) {
        *flag = u8::from(a == b);
    }
    bits(&flags)
}

/// Where a row differs from what lies to the left; the first place from zero.
#[inline(always)]
pub(crate) fn changes<T: PartialEq + Copy + Default>(row: &[T; PIECE]) -> u32 {
    !same(row, &shifted(row, T::default()))
}

/// A row one place to the right, with `before` as the first.
#[inline(always)]
pub(crate) fn shifted<T: Copy>(row: &[T; PIECE], before: T) -> [T; PIECE] {
    // Copied as a whole, which is a few registers: a part of it would be a call.
    let mut twice = [[before; PIECE]; 2];
    let [_, whole] = &mut twice;
    *whole = *row;
    let mut shifted = [before; PIECE];
    if let Some(from) = twice.as_flattened().get(PIECE - 1..).and_then(|rest| rest.first_chunk()) {
        shifted = *from;
    }
    shifted
}

/// Bytes that are 0 or 1 as bits, the first in the lowest one.
#[inline(always)]
fn bits(flags: &[u8; PIECE]) -> u32 {
    // The product brings the lowest bits of eight bytes side by side into its highest byte.
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let (eights, _) = flags.as_chunks::<8>();
    let mut bits = 0;
    for eight in eights.iter().rev() {
        bits = bits << 8 | (u64::from_le_bytes(*eight).wrapping_mul(GATHER) >> 56) as u32;
    }
    bits
}

/// The bits of `of`, lowest first, each alone.
#[inline(always)]
pub(crate) fn each_bit(mut of: u32) -> impl Iterator<Item = u32> {
    core::iter::from_fn(move || {
        let bit = of & of.wrapping_neg();
        of ^= bit;
        (bit != 0).then_some(bit)
    })
}

#[cfg(test)]
#[path = "links_tests.rs"]
mod tests;
