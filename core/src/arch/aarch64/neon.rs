//! 16 bytes, whose bits the processor counts.

use core::arch::aarch64::*;

use crate::arch::generic::{Vector, Wide, byte_instructions, word_instructions};

#[derive(Clone, Copy)]
pub(super) struct Neon(uint8x16_t);

/// Eight numbers.
#[derive(Clone, Copy)]
pub(super) struct Words(int16x8_t);

impl Vector for Neon {
    const LANES: usize = 16;
    // There are 32 registers.
    const KEPT: usize = 8;
    type Code = uint8x16_t;
    type Wide = Words;

    byte_instructions!(vld1q_u8, vst1q_u8, vaddq_u8, vsubq_u8, vandq_u8);

    #[inline(always)]
    unsafe fn code(code: u8) -> uint8x16_t {
        // SAFETY: the caller guarantees the instructions.
        unsafe { vdupq_n_u8(code) }
    }

    #[inline(always)]
    unsafe fn hamming(code: uint8x16_t, low: *const u8, _high: *const u8) -> Self {
        // SAFETY: the caller guarantees the instructions and what lies behind pointers.
        unsafe { Self(vcntq_u8(veorq_u8(code, vld1q_u8(low)))) }
    }

    #[inline(always)]
    unsafe fn widen(self) -> [Words; 2] {
        // SAFETY: the caller guarantees the instructions.
        unsafe {
            let halves = [vmovl_u8(vget_low_u8(self.0)), vmovl_high_u8(self.0)];
            [Words(vreinterpretq_s16_u16(halves[0])), Words(vreinterpretq_s16_u16(halves[1]))]
        }
    }

    #[inline(always)]
    unsafe fn widen_signed(self) -> [Words; 2] {
        // SAFETY: the caller guarantees the instructions.
        unsafe {
            let bytes = vreinterpretq_s8_u8(self.0);
            [Words(vmovl_s8(vget_low_s8(bytes))), Words(vmovl_high_s8(bytes))]
        }
    }

    /// 128 is no number of 8 bits with a sign, but -128 is.
    #[inline(always)]
    unsafe fn add_shifted(self, to: [Words; 2]) -> [Words; 2] {
        // SAFETY: the caller guarantees the instructions.
        unsafe {
            let (bytes, times) = (vreinterpretq_s8_u8(self.0), vdupq_n_s8(-128));
            let low = vmlsl_s8(to[0].0, vget_low_s8(bytes), vget_low_s8(times));
            [Words(low), Words(vmlsl_high_s8(to[1].0, bytes, times))]
        }
    }
}

impl Wide for Words {
    const LANES: usize = 8;
    type Mask = uint16x8_t;
    type Count = uint16x8_t;

    word_instructions!(vld1q_s16, vst1q_s16, vdupq_n_s16, vaddq_s16, vsubq_s16, vminq_s16, veorq_s16, vshlq_n_s16);

    #[inline(always)]
    unsafe fn greater(self, other: Self) -> uint16x8_t {
        // SAFETY: the caller guarantees the instructions.
        unsafe { vcgtq_s16(self.0, other.0) }
    }

    #[inline(always)]
    unsafe fn equal(self, other: Self) -> uint16x8_t {
        // SAFETY: the caller guarantees the instructions.
        unsafe { vceqq_s16(self.0, other.0) }
    }

    #[inline(always)]
    unsafe fn select(self, mask: uint16x8_t, other: Self) -> Self {
        // SAFETY: the caller guarantees the instructions.
        unsafe { Self(vbslq_s16(mask, self.0, other.0)) }
    }

    #[inline(always)]
    unsafe fn least(self) -> i16 {
        // SAFETY: the caller guarantees the instructions.
        unsafe { vminvq_s16(self.0) }
    }

    /// Eight bits of each number say so in one register.
    #[inline(always)]
    unsafe fn first(mask: uint16x8_t) -> usize {
        // SAFETY: the caller guarantees the instructions.
        let bits = unsafe { vget_lane_u64::<0>(vreinterpret_u64_u8(vshrn_n_u16::<4>(mask))) };
        bits.trailing_zeros() as usize / 8
    }

    #[inline(always)]
    unsafe fn none() -> uint16x8_t {
        // SAFETY: the caller guarantees the instructions.
        unsafe { vdupq_n_u16(0) }
    }

    /// True is -1.
    #[inline(always)]
    unsafe fn count(count: uint16x8_t, mask: uint16x8_t) -> uint16x8_t {
        // SAFETY: the caller guarantees the instructions.
        unsafe { vsubq_u16(count, mask) }
    }

    #[inline(always)]
    unsafe fn total(count: uint16x8_t) -> u16 {
        // SAFETY: the caller guarantees the instructions.
        unsafe { vaddvq_u16(count) }
    }
}
