//! 16 bytes, with what every x86-64 processor has.

use core::arch::x86_64::*;

use crate::arch::generic::{Vector, Wide};

#[derive(Clone, Copy)]
pub(super) struct Sse2(__m128i);

/// Eight numbers; SSE4.1 adds nothing to them but a faster least.
#[derive(Clone, Copy)]
pub(super) struct Words(pub(super) __m128i);

impl Vector for Sse2 {
    const LANES: usize = 16;
    type Code = __m128i;
    type Wide = Words;

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
    unsafe fn code(code: u8) -> __m128i {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { _mm_set1_epi8(code as i8) }
    }

    /// Bits are counted by halves.
    #[inline(always)]
    unsafe fn hamming(code: __m128i, low: *const u8, _high: *const u8) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let (fives, threes, fifteens) = (_mm_set1_epi8(0x55), _mm_set1_epi8(0x33), _mm_set1_epi8(0x0f));
            let bits = _mm_xor_si128(code, _mm_loadu_si128(low.cast()));
            let pairs = _mm_sub_epi8(bits, _mm_and_si128(_mm_srli_epi16(bits, 1), fives));
            let fours = _mm_add_epi8(_mm_and_si128(pairs, threes), _mm_and_si128(_mm_srli_epi16(pairs, 2), threes));
            Self(_mm_and_si128(_mm_add_epi8(fours, _mm_srli_epi16(fours, 4)), fifteens))
        }
    }

    #[inline(always)]
    unsafe fn widen(self) -> [Words; 2] {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let zero = _mm_setzero_si128();
            [Words(_mm_unpacklo_epi8(self.0, zero)), Words(_mm_unpackhi_epi8(self.0, zero))]
        }
    }

    /// A byte in the upper half is 256 times the number.
    #[inline(always)]
    unsafe fn widen_signed(self) -> [Words; 2] {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let zero = _mm_setzero_si128();
            let [low, high] = [_mm_unpacklo_epi8(zero, self.0), _mm_unpackhi_epi8(zero, self.0)];
            [Words(_mm_srai_epi16::<8>(low)), Words(_mm_srai_epi16::<8>(high))]
        }
    }

    /// A byte in the upper half is 256 times the number.
    #[inline(always)]
    unsafe fn widen_shifted(self) -> [Words; 2] {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let zero = _mm_setzero_si128();
            let [low, high] = [_mm_unpacklo_epi8(zero, self.0), _mm_unpackhi_epi8(zero, self.0)];
            [Words(_mm_srai_epi16(low, 1)), Words(_mm_srai_epi16(high, 1))]
        }
    }
}

impl Wide for Words {
    const LANES: usize = 8;

    #[inline(always)]
    unsafe fn load(from: *const i16) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_loadu_si128(from.cast())) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut i16) {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { _mm_storeu_si128(to.cast(), self.0) }
    }

    #[inline(always)]
    unsafe fn splat(number: i16) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_set1_epi16(number)) }
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_add_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn sub(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_sub_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn min(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_min_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn and(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_and_si128(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn xor(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_xor_si128(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn greater(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_cmpgt_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn equal(self, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_cmpeq_epi16(self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn least(self) -> i16 {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let four = _mm_min_epi16(self.0, _mm_unpackhi_epi64(self.0, self.0));
            let two = _mm_min_epi16(four, _mm_shuffle_epi32::<1>(four));
            _mm_cvtsi128_si32(_mm_min_epi16(two, _mm_srli_epi32::<16>(two))) as i16
        }
    }

    #[inline(always)]
    unsafe fn first_equal(self, other: Self) -> usize {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        let equal = unsafe { _mm_movemask_epi8(_mm_cmpeq_epi16(self.0, other.0)) };
        equal.trailing_zeros() as usize / 2
    }

    #[inline(always)]
    unsafe fn times_16(self) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(_mm_slli_epi16::<4>(self.0)) }
    }

    #[inline(always)]
    unsafe fn sum(self) -> u32 {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe {
            let sums = _mm_sad_epu8(self.0, _mm_setzero_si128());
            _mm_cvtsi128_si32(_mm_add_epi32(sums, _mm_unpackhi_epi64(sums, sums))) as u32
        }
    }
}
