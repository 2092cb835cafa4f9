//! 64 bytes, whose bits the processor counts.

use core::arch::x86_64::*;

use super::sse41::least_of_eight;
use crate::arch::generic::{Vector, Wide, byte_instructions, word_instructions};

#[derive(Clone, Copy)]
pub(super) struct Avx512(__m512i);

/// Thirty-two numbers.
#[derive(Clone, Copy)]
pub(super) struct Words32(__m512i);

impl Vector for Avx512 {
    const LANES: usize = 64;
    // There are 32 registers: all that keys have places for.
    const KEPT: usize = 8;
    type Code = __m512i;
    type Wide = Words32;

    byte_instructions!(_mm512_loadu_si512, _mm512_storeu_si512, _mm512_add_epi8, _mm512_sub_epi8, _mm512_and_si512);

    #[inline(always)]
    unsafe fn code(code: u8) -> __m512i {
        // SAFETY: the caller guarantees the instructions.
        unsafe { _mm512_set1_epi8(code as i8) }
    }

    #[inline(always)]
    unsafe fn hamming(code: __m512i, low: *const u8, _high: *const u8) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm512_popcnt_epi8(_mm512_xor_si512(code, _mm512_loadu_si512(low.cast())))) }
    }

    #[inline(always)]
    unsafe fn widen(self) -> [Words32; 2] {
        // SAFETY: the caller guarantees the instructions.
        unsafe {
            let [low, high] = halves(self);
            [Words32(_mm512_cvtepu8_epi16(low)), Words32(_mm512_cvtepu8_epi16(high))]
        }
    }

    #[inline(always)]
    unsafe fn widen_signed(self) -> [Words32; 2] {
        // SAFETY: the caller guarantees the instructions.
        unsafe {
            let [low, high] = halves(self);
            [Words32(_mm512_cvtepi8_epi16(low)), Words32(_mm512_cvtepi8_epi16(high))]
        }
    }

    #[inline(always)]
    unsafe fn add_shifted(self, to: [Words32; 2]) -> [Words32; 2] {
        // SAFETY: the caller guarantees the instructions.
        unsafe {
            let [Words32(low), Words32(high)] = self.widen_signed();
            [to[0].add(Words32(_mm512_slli_epi16::<7>(low))), to[1].add(Words32(_mm512_slli_epi16::<7>(high)))]
        }
    }
}

/// # Safety
/// The processor must have AVX-512F.
#[inline(always)]
unsafe fn halves(bytes: Avx512) -> [__m256i; 2] {
    // SAFETY: that of this function.
    unsafe { [_mm512_castsi512_si256(bytes.0), _mm512_extracti64x4_epi64::<1>(bytes.0)] }
}

impl Wide for Words32 {
    const LANES: usize = 32;
    type Mask = __mmask32;
    type Count = u32;

    word_instructions!(
        _mm512_loadu_si512,
        _mm512_storeu_si512,
        _mm512_set1_epi16,
        _mm512_add_epi16,
        _mm512_sub_epi16,
        _mm512_min_epi16,
        _mm512_xor_si512,
        _mm512_slli_epi16
    );

    #[inline(always)]
    unsafe fn greater(self, other: Self) -> __mmask32 {
        // SAFETY: the caller guarantees the instructions.
        unsafe { _mm512_cmpgt_epi16_mask(self.0, other.0) }
    }

    #[inline(always)]
    unsafe fn equal(self, other: Self) -> __mmask32 {
        // SAFETY: the caller guarantees the instructions.
        unsafe { _mm512_cmpeq_epi16_mask(self.0, other.0) }
    }

    #[inline(always)]
    unsafe fn select(self, mask: __mmask32, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions.
        unsafe { Self(_mm512_mask_blend_epi16(mask, other.0, self.0)) }
    }

    #[inline(always)]
    unsafe fn least(self) -> i16 {
        // SAFETY: the caller guarantees the instructions.
        unsafe {
            let half = _mm256_min_epi16(_mm512_castsi512_si256(self.0), _mm512_extracti64x4_epi64::<1>(self.0));
            least_of_eight(_mm_min_epi16(_mm256_castsi256_si128(half), _mm256_extracti128_si256::<1>(half)))
        }
    }

    #[inline(always)]
    unsafe fn first(mask: __mmask32) -> usize {
        mask.trailing_zeros() as usize
    }

    #[inline(always)]
    unsafe fn none() -> u32 {
        0
    }

    #[inline(always)]
    unsafe fn count(count: u32, mask: __mmask32) -> u32 {
        // No more than there are places.
        count.wrapping_add(mask.count_ones())
    }

    #[inline(always)]
    unsafe fn total(count: u32) -> u16 {
        count as u16
    }
}
