//! The instructions. Each is one or two of the processor's, which `core::arch` does not offer to stable compilers.

use core::arch::asm;

/// Differences of bytes, whatever their sign.
#[inline(always)]
pub(super) fn bytes_less(a: u32, b: u32) -> u32 {
    let difference;
    // SAFETY: computes with registers; `build.rs` guarantees that the processor has the instruction.
    unsafe {
        asm!("usub8 {0}, {1}, {2}", lateout(reg) difference, in(reg) a, in(reg) b, options(pure, nomem, nostack))
    };
    difference
}

/// Two 16-bit numbers and the signed bytes 0 and 2 of another word.
#[inline(always)]
pub(super) fn add_even(numbers: u32, bytes: u32) -> u32 {
    let sums;
    // SAFETY: computes with registers; `build.rs` guarantees that the processor has the instruction.
    unsafe {
        asm!("sxtab16 {0}, {1}, {2}", lateout(reg) sums, in(reg) numbers, in(reg) bytes,
            options(pure, nomem, nostack, preserves_flags));
    }
    sums
}

/// Two 16-bit numbers and the signed bytes 1 and 3 of another word.
#[inline(always)]
pub(super) fn add_odd(numbers: u32, bytes: u32) -> u32 {
    let sums;
    // SAFETY: computes with registers; `build.rs` guarantees that the processor has the instruction.
    unsafe {
        asm!("sxtab16 {0}, {1}, {2}, ror #8", lateout(reg) sums, in(reg) numbers, in(reg) bytes,
            options(pure, nomem, nostack, preserves_flags));
    }
    sums
}

/// The lesser ones of two 16-bit numbers without sign.
#[inline(always)]
pub(super) fn least(a: u32, b: u32) -> u32 {
    let least;
    // SAFETY: computes with registers; `build.rs` guarantees that the processor has the instructions.
    unsafe {
        asm!("usub16 {0}, {1}, {2}", "sel {0}, {2}, {1}", out(reg) least, in(reg) a, in(reg) b,
            options(pure, nomem, nostack));
    }
    least
}

/// 1 for each of two 16-bit numbers without sign that is below the other, 0 for the rest.
#[inline(always)]
pub(super) fn below(a: u32, b: u32) -> u32 {
    let below;
    // SAFETY: computes with registers; `build.rs` guarantees that the processor has the instructions.
    unsafe {
        asm!("usub16 {0}, {1}, {2}", "sel {0}, {3}, {4}", out(reg) below, in(reg) a, in(reg) b, in(reg) 0,
            in(reg) 0x0001_0001, options(pure, nomem, nostack));
    }
    below
}
