//! 16 bytes, with what every x86-64 processor has.

use core::arch::x86_64::*;

use crate::arch::generic::{Vector, Wide, byte_instructions, word_instructions};

#[derive(Clone, Copy)]
pub(super) struct Sse2(__m128i);

/// Eight numbers.
#[derive(Clone, Copy)]
pub(super) struct Words(__m128i);

/// Functions of [`Vector`] that are the same with all 16 bytes.
macro_rules! sixteen_bytes {
    ($words:ident) => {
        const LANES: usize = 16;
        const KEPT: usize = 4;
        type Wide = $words;

        byte_instructions!(_mm_loadu_si128, _mm_storeu_si128, _mm_add_epi8, _mm_sub_epi8, _mm_and_si128);

        #[inline(always)]
        unsafe fn widen(self) -> [$words; 2] {
            // SAFETY: the caller guarantees the instructions.
            unsafe {
                let zero = _mm_setzero_si128();
                [$words(_mm_unpacklo_epi8(self.0, zero)), $words(_mm_unpackhi_epi8(self.0, zero))]
            }
        }

        /// A byte in the upper half is 256 times the number.
        #[inline(always)]
        unsafe fn widen_signed(self) -> [$words; 2] {
            // SAFETY: the caller guarantees the instructions.
            unsafe {
                let zero = _mm_setzero_si128();
                let [low, high] = [_mm_unpacklo_epi8(zero, self.0), _mm_unpackhi_epi8(zero, self.0)];
                [$words(_mm_srai_epi16::<8>(low)), $words(_mm_srai_epi16::<8>(high))]
            }
        }

        /// A byte in the upper half is 256 times the number.
        #[inline(always)]
        unsafe fn add_shifted(self, to: [$words; 2]) -> [$words; 2] {
            // SAFETY: the caller guarantees the instructions.
            unsafe {
                let zero = _mm_setzero_si128();
                let [low, high] = [_mm_unpacklo_epi8(zero, self.0), _mm_unpackhi_epi8(zero, self.0)];
                [to[0].add($words(_mm_srai_epi16::<1>(low))), to[1].add($words(_mm_srai_epi16::<1>(high)))]
            }
        }
    };
}
pub(super) use sixteen_bytes;

/// Functions of [`Wide`] that are the same with all eight numbers.
macro_rules! eight_words {
    () => {
        const LANES: usize = 8;
        type Mask = __m128i;
        type Count = __m128i;

        word_instructions!(
            _mm_loadu_si128,
            _mm_storeu_si128,
            _mm_set1_epi16,
            _mm_add_epi16,
            _mm_sub_epi16,
            _mm_min_epi16,
            _mm_xor_si128,
            _mm_slli_epi16
        );

        #[inline(always)]
        unsafe fn greater(self, other: Self) -> __m128i {
            // SAFETY: the caller guarantees the instructions.
            unsafe { _mm_cmpgt_epi16(self.0, other.0) }
        }

        #[inline(always)]
        unsafe fn equal(self, other: Self) -> __m128i {
            // SAFETY: the caller guarantees the instructions.
            unsafe { _mm_cmpeq_epi16(self.0, other.0) }
        }

        #[inline(always)]
        unsafe fn select(self, mask: __m128i, other: Self) -> Self {
            // SAFETY: the caller guarantees the instructions.
            unsafe { Self(_mm_or_si128(_mm_and_si128(mask, self.0), _mm_andnot_si128(mask, other.0))) }
        }

        #[inline(always)]
        unsafe fn first(mask: __m128i) -> usize {
            // SAFETY: the caller guarantees the instructions.
            unsafe { _mm_movemask_epi8(mask).trailing_zeros() as usize / 2 }
        }

        #[inline(always)]
        unsafe fn none() -> __m128i {
            // SAFETY: the caller guarantees the instructions.
            unsafe { _mm_setzero_si128() }
        }

        /// True is -1.
        #[inline(always)]
        unsafe fn count(count: __m128i, mask: __m128i) -> __m128i {
            // SAFETY: the caller guarantees the instructions.
            unsafe { _mm_sub_epi16(count, mask) }
        }

        #[inline(always)]
        unsafe fn total(count: __m128i) -> u16 {
            // SAFETY: the caller guarantees the instructions.
            unsafe {
                let sums = _mm_sad_epu8(count, _mm_setzero_si128());
                _mm_cvtsi128_si32(_mm_add_epi32(sums, _mm_unpackhi_epi64(sums, sums))) as u16
            }
        }
    };
}
pub(super) use eight_words;

impl Vector for Sse2 {
    type Code = __m128i;

    sixteen_bytes!(Words);

    #[inline(always)]
    unsafe fn code(code: u8) -> __m128i {
        // SAFETY: the caller guarantees the instructions.
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
}

impl Wide for Words {
    eight_words!();

    #[inline(always)]
    unsafe fn least(self) -> i16 {
        // SAFETY: the caller guarantees the instructions.
        unsafe {
            let four = _mm_min_epi16(self.0, _mm_unpackhi_epi64(self.0, self.0));
            let two = _mm_min_epi16(four, _mm_shuffle_epi32::<1>(four));
            _mm_cvtsi128_si32(_mm_min_epi16(two, _mm_srli_epi32::<16>(two))) as i16
        }
    }
}
