//! How deep the stack grows: what lies below it is painted, and looked at afterwards.

use core::arch::asm;

/// Bytes that are painted. What goes deeper is told as this much.
const DEPTH: usize = 32 * 1024;

const PAINT: u32 = 0xa5c3_0ff1;

/// Runs `work` and tells the bytes of stack below this function's own that it took.
#[inline(always)]
pub(crate) fn depth_of<R>(work: impl FnOnce() -> R) -> (R, usize) {
    let top = pointer();
    paint();
    let result = work();
    (result, deepest(top))
}

#[inline(always)]
fn pointer() -> usize {
    let pointer: usize;
    // SAFETY: reads a register, nothing else.
    unsafe { asm!("mov {}, sp", out(reg) pointer, options(nomem, nostack, preserves_flags)) };
    pointer
}

#[inline(never)]
fn paint() {
    let top = pointer() as *mut u32;
    for word in 1..=DEPTH / 4 {
        // SAFETY: below the stack pointer nothing lives; memory.x leaves more than that above the statics, and no interrupt comes
        // between.
        unsafe { top.sub(word).write_volatile(PAINT) };
    }
}

/// Distance from `top` to the lowest word that has lost its paint.
#[inline(never)]
fn deepest(top: usize) -> usize {
    let own = pointer() - DEPTH;
    let lowest = (0..DEPTH / 4)
        .map(|word| own as *const u32 as usize + 4 * word)
        // SAFETY: as in `paint`, whose stack pointer was the same.
        .find(|&place| unsafe { (place as *const u32).read_volatile() } != PAINT);
    top - lowest.unwrap_or(top)
}
