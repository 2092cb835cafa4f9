//! 32 bytes.

use core::arch::x86_64::*;

use super::sse41::DIFFERENT;
use crate::arch::generic::{Vector, Wide};

#[derive(Clone, Copy)]
pub(super) struct Avx2(__m256i);

/// Sixteen numbers.
#[derive(Clone, Copy)]
pub(super) struct Words16(__m256i);

impl Vector for Avx2 {
    const LANES: usize = 32;
    type Code = [__m256i; 2];
    type Wide = Words16;

    #[inline(always)]
    unsafe fn load(from: *const u8) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_loadu_si256(from.cast())) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut u8) {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { _mm256_storeu_si256(to.cast(), self.0) }
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_add_epi8(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn sub(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_sub_epi8(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn and(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_and_si256(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn code(code: u8) -> [__m256i; 2] {
        let [low, high] = [&DIFFERENT[usize::from(code & 15)], &DIFFERENT[usize::from(code >> 4)]];
        // SAFETY: both rows have 16 bytes; the caller guarantees the instructions.
        unsafe {
            [
                _mm256_broadcastsi128_si256(_mm_loadu_si128(low.as_ptr().cast())),
                _mm256_broadcastsi128_si256(_mm_loadu_si128(high.as_ptr().cast())),
            ]
        }
    }

    /// Bits are looked up, four at a time.
    #[inline(always)]
    unsafe fn hamming(code: [__m256i; 2], low: *const u8, high: *const u8) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let low = _mm256_shuffle_epi8(code[0], _mm256_loadu_si256(low.cast()));
            let high = _mm256_shuffle_epi8(code[1], _mm256_loadu_si256(high.cast()));
            Self(_mm256_add_epi8(low, high))
        }
    }

    #[inline(always)]
    unsafe fn widen(self) -> [Words16; 2] {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let halves = [_mm256_castsi256_si128(self.0), _mm256_extracti128_si256::<1>(self.0)];
            [Words16(_mm256_cvtepu8_epi16(halves[0])), Words16(_mm256_cvtepu8_epi16(halves[1]))]
        }
    }

    #[inline(always)]
    unsafe fn widen_signed(self) -> [Words16; 2] {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let halves = [_mm256_castsi256_si128(self.0), _mm256_extracti128_si256::<1>(self.0)];
            [Words16(_mm256_cvtepi8_epi16(halves[0])), Words16(_mm256_cvtepi8_epi16(halves[1]))]
        }
    }

    #[inline(always)]
    unsafe fn widen_shifted(self) -> [Words16; 2] {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let halves = [_mm256_castsi256_si128(self.0), _mm256_extracti128_si256::<1>(self.0)];
            [
                Words16(_mm256_slli_epi16::<7>(_mm256_cvtepi8_epi16(halves[0]))),
                Words16(_mm256_slli_epi16::<7>(_mm256_cvtepi8_epi16(halves[1]))),
            ]
        }
    }
}

impl Wide for Words16 {
    const LANES: usize = 16;

    #[inline(always)]
    unsafe fn load(from: *const i16) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_loadu_si256(from.cast())) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut i16) {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { _mm256_storeu_si256(to.cast(), self.0) }
    }

    #[inline(always)]
    unsafe fn splat(number: i16) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_set1_epi16(number)) }
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_add_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn sub(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_sub_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn min(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_min_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn and(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_and_si256(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn xor(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_xor_si256(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn greater(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_cmpgt_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn equal(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_cmpeq_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn least(self) -> i16 {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let half = _mm_min_epi16(_mm256_castsi256_si128(self.0), _mm256_extracti128_si256::<1>(self.0));
            // The instruction compares numbers without a sign.
            let turned = _mm_xor_si128(half, _mm_set1_epi16(i16::MIN));
            (_mm_cvtsi128_si32(_mm_minpos_epu16(turned)) as i16) ^ i16::MIN
        }
    }

    #[inline(always)]
    unsafe fn first_equal(self, other: Self) -> usize {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        let equal = unsafe { _mm256_movemask_epi8(_mm256_cmpeq_epi16(self.0, other.0)) };
        equal.trailing_zeros() as usize / 2
    }

    #[inline(always)]
    unsafe fn times_16(self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm256_slli_epi16::<4>(self.0)) }
    }

    #[inline(always)]
    unsafe fn sum(self) -> u32 {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let half = _mm_add_epi16(_mm256_castsi256_si128(self.0), _mm256_extracti128_si256::<1>(self.0));
            let sums = _mm_sad_epu8(half, _mm_setzero_si128());
            _mm_cvtsi128_si32(_mm_add_epi32(sums, _mm_unpackhi_epi64(sums, sums))) as u32
        }
    }
}
