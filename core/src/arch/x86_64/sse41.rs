//! 16 bytes; bits are counted by looking them up.

use core::arch::x86_64::*;

use super::sse2::{eight_words, sixteen_bytes};
use crate::arch::generic::{Vector, Wide, byte_instructions, word_instructions};

#[derive(Clone, Copy)]
pub(super) struct Sse41(__m128i);

/// Eight numbers, the least of which one instruction finds.
#[derive(Clone, Copy)]
pub(super) struct Words(__m128i);

/// For each four bits the number of bits by which each other four differ from them.
pub(super) static DIFFERENT: [[u8; 16]; 16] = {
    let mut table = [[0; 16]; 16];
    let mut i = 0;
    while i < 256 {
        table[i / 16][i % 16] = ((i / 16) ^ (i % 16)).count_ones() as u8;
        i += 1;
    }
    table
};

impl Vector for Sse41 {
    type Code = [__m128i; 2];

    sixteen_bytes!(Words);

    #[inline(always)]
    unsafe fn code(code: u8) -> [__m128i; 2] {
        let [low, high] = [&DIFFERENT[usize::from(code & 15)], &DIFFERENT[usize::from(code >> 4)]];
        // SAFETY: both rows have 16 bytes; the caller guarantees the instructions.
        unsafe { [_mm_loadu_si128(low.as_ptr().cast()), _mm_loadu_si128(high.as_ptr().cast())] }
    }

    /// Bits are looked up, four at a time.
    #[inline(always)]
    unsafe fn hamming(code: [__m128i; 2], low: *const u8, high: *const u8) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let low = _mm_shuffle_epi8(code[0], _mm_loadu_si128(low.cast()));
            let high = _mm_shuffle_epi8(code[1], _mm_loadu_si128(high.cast()));
            Self(_mm_add_epi8(low, high))
        }
    }
}

impl Wide for Words {
    eight_words!();

    #[inline(always)]
    unsafe fn least(self) -> i16 {
        // SAFETY: the caller guarantees the instructions.
        unsafe { least_of_eight(self.0) }
    }
}

/// The instruction compares numbers without a sign.
///
/// # Safety
/// The processor must have SSE4.1.
#[inline(always)]
pub(super) unsafe fn least_of_eight(numbers: __m128i) -> i16 {
    // SAFETY: that of this function.
    unsafe {
        let turned = _mm_xor_si128(numbers, _mm_set1_epi16(i16::MIN));
        (_mm_cvtsi128_si32(_mm_minpos_epu16(turned)) as i16) ^ i16::MIN
    }
}
