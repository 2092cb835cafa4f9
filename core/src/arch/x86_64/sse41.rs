//! 16 bytes; bits are counted by looking them up.

use core::arch::x86_64::*;

use super::sse2::Words;
use crate::arch::generic::{Vector, Wide};

#[derive(Clone, Copy)]
pub(super) struct Sse41(__m128i);

/// Eight numbers, the least of which one instruction finds.
#[derive(Clone, Copy)]
pub(super) struct Words41(Words);

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
    const LANES: usize = 16;
    type Code = [__m128i; 2];
    type Wide = Words41;

    #[inline(always)]
    unsafe fn load(from: *const u8) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_loadu_si128(from.cast())) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut u8) {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { _mm_storeu_si128(to.cast(), self.0) }
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_add_epi8(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn sub(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_sub_epi8(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn and(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_and_si128(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn code(code: u8) -> [__m128i; 2] {
        let [low, high] = [&DIFFERENT[usize::from(code & 15)], &DIFFERENT[usize::from(code >> 4)]];
        // SAFETY: the caller guarantees the instructions.
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

    #[inline(always)]
    unsafe fn widen(self) -> [Words41; 2] {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let zero = _mm_setzero_si128();
            [Words41(Words(_mm_unpacklo_epi8(self.0, zero))), Words41(Words(_mm_unpackhi_epi8(self.0, zero)))]
        }
    }

    #[inline(always)]
    unsafe fn widen_signed(self) -> [Words41; 2] {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let high = _mm_unpackhi_epi64(self.0, self.0);
            [Words41(Words(_mm_cvtepi8_epi16(self.0))), Words41(Words(_mm_cvtepi8_epi16(high)))]
        }
    }

    /// A byte in the upper half is 256 times the number.
    #[inline(always)]
    unsafe fn widen_shifted(self) -> [Words41; 2] {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let zero = _mm_setzero_si128();
            let [low, high] = [_mm_unpacklo_epi8(zero, self.0), _mm_unpackhi_epi8(zero, self.0)];
            [Words41(Words(_mm_srai_epi16::<1>(low))), Words41(Words(_mm_srai_epi16::<1>(high)))]
        }
    }
}

impl Wide for Words41 {
    const LANES: usize = 8;

    #[inline(always)]
    unsafe fn load(from: *const i16) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(Words::load(from)) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut i16) {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { self.0.store(to) }
    }

    #[inline(always)]
    unsafe fn splat(number: i16) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(Words::splat(number)) }
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(self.0.add(other.0)) }
    }

    #[inline(always)]
    unsafe fn sub(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(self.0.sub(other.0)) }
    }

    #[inline(always)]
    unsafe fn min(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(self.0.min(other.0)) }
    }

    #[inline(always)]
    unsafe fn and(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(self.0.and(other.0)) }
    }

    #[inline(always)]
    unsafe fn xor(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(self.0.xor(other.0)) }
    }

    #[inline(always)]
    unsafe fn greater(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(self.0.greater(other.0)) }
    }

    #[inline(always)]
    unsafe fn equal(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(self.0.equal(other.0)) }
    }

    /// The instruction compares numbers without a sign.
    #[inline(always)]
    unsafe fn least(self) -> i16 {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let turned = _mm_xor_si128(self.0.0, _mm_set1_epi16(i16::MIN));
            (_mm_cvtsi128_si32(_mm_minpos_epu16(turned)) as i16) ^ i16::MIN
        }
    }

    #[inline(always)]
    unsafe fn first_equal(self, other: Self) -> usize {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { self.0.first_equal(other.0) }
    }

    #[inline(always)]
    unsafe fn times_16(self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(self.0.times_16()) }
    }

    #[inline(always)]
    unsafe fn sum(self) -> u32 {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { self.0.sum() }
    }
}
