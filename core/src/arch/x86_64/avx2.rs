//! 32 bytes.

use core::arch::x86_64::*;

use super::sse41::{DIFFERENT, least_of_eight};
use crate::arch::generic::{Vector, Wide, byte_instructions, word_instructions};

#[derive(Clone, Copy)]
pub(super) struct Avx2(__m256i);

/// Sixteen numbers.
#[derive(Clone, Copy)]
pub(super) struct Words16(__m256i);

impl Vector for Avx2 {
    const LANES: usize = 32;
    const KEPT: usize = 4;
    type Code = [__m256i; 2];
    type Wide = Words16;

    byte_instructions!(_mm256_loadu_si256, _mm256_storeu_si256, _mm256_add_epi8, _mm256_sub_epi8, _mm256_and_si256);

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
        // SAFETY: the caller guarantees the instructions.
        unsafe {
            let halves = [_mm256_castsi256_si128(self.0), _mm256_extracti128_si256::<1>(self.0)];
            [Words16(_mm256_cvtepu8_epi16(halves[0])), Words16(_mm256_cvtepu8_epi16(halves[1]))]
        }
    }

    #[inline(always)]
    unsafe fn widen_signed(self) -> [Words16; 2] {
        // SAFETY: the caller guarantees the instructions.
        unsafe {
            let halves = [_mm256_castsi256_si128(self.0), _mm256_extracti128_si256::<1>(self.0)];
            [Words16(_mm256_cvtepi8_epi16(halves[0])), Words16(_mm256_cvtepi8_epi16(halves[1]))]
        }
    }

    #[inline(always)]
    unsafe fn add_shifted(self, to: [Words16; 2]) -> [Words16; 2] {
        // SAFETY: the caller guarantees the instructions.
        unsafe {
            let [Words16(low), Words16(high)] = self.widen_signed();
            [to[0].add(Words16(_mm256_slli_epi16::<7>(low))), to[1].add(Words16(_mm256_slli_epi16::<7>(high)))]
        }
    }
}

impl Wide for Words16 {
    const LANES: usize = 16;
    type Mask = __m256i;
    type Count = __m256i;

    word_instructions!(
        _mm256_loadu_si256,
        _mm256_storeu_si256,
        _mm256_set1_epi16,
        _mm256_add_epi16,
        _mm256_sub_epi16,
        _mm256_min_epi16,
        _mm256_xor_si256,
        _mm256_slli_epi16
    );

    #[inline(always)]
    unsafe fn greater(self, other: Self) -> __m256i {
        // SAFETY: the caller guarantees the instructions.
        unsafe { _mm256_cmpgt_epi16(self.0, other.0) }
    }

    #[inline(always)]
    unsafe fn equal(self, other: Self) -> __m256i {
        // SAFETY: the caller guarantees the instructions.
        unsafe { _mm256_cmpeq_epi16(self.0, other.0) }
    }

    #[inline(always)]
    unsafe fn select(self, mask: __m256i, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions.
        unsafe { Self(_mm256_blendv_epi8(other.0, self.0, mask)) }
    }

    #[inline(always)]
    unsafe fn least(self) -> i16 {
        // SAFETY: the caller guarantees the instructions.
        unsafe {
            let halves = [_mm256_castsi256_si128(self.0), _mm256_extracti128_si256::<1>(self.0)];
            least_of_eight(_mm_min_epi16(halves[0], halves[1]))
        }
    }

    #[inline(always)]
    unsafe fn first(mask: __m256i) -> usize {
        // SAFETY: the caller guarantees the instructions.
        unsafe { _mm256_movemask_epi8(mask).trailing_zeros() as usize / 2 }
    }

    #[inline(always)]
    unsafe fn none() -> __m256i {
        // SAFETY: the caller guarantees the instructions.
        unsafe { _mm256_setzero_si256() }
    }

    /// True is -1.
    #[inline(always)]
    unsafe fn count(count: __m256i, mask: __m256i) -> __m256i {
        // SAFETY: the caller guarantees the instructions.
        unsafe { _mm256_sub_epi16(count, mask) }
    }

    #[inline(always)]
    unsafe fn total(count: __m256i) -> u16 {
        // SAFETY: the caller guarantees the instructions.
        unsafe {
            let half = _mm_add_epi16(_mm256_castsi256_si128(count), _mm256_extracti128_si256::<1>(count));
            let sums = _mm_sad_epu8(half, _mm_setzero_si128());
            _mm_cvtsi128_si32(_mm_add_epi32(sums, _mm_unpackhi_epi64(sums, sums))) as u16
        }
    }
}
