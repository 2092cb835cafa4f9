//! Mistakes on purpose, a feature each. What comes in is not known, so that none of them is folded away.

/// An index that nobody checks.
#[cfg(feature = "plant-panic")]
#[unsafe(no_mangle)]
fn entry_planted_panic(table: &[u32; 8], at: usize) -> u32 {
    table[at]
}

#[cfg(feature = "plant-recursion")]
#[unsafe(no_mangle)]
fn entry_planted_recursion(tree: &[u8]) -> u32 {
    match tree {
        [] => 0,
        [first, rest @ ..] => {
            let (left, right) = rest.split_at_checked(usize::from(*first)).unwrap_or((&[], rest));
            entry_planted_recursion(left).wrapping_mul(31).wrapping_add(entry_planted_recursion(right))
        }
    }
}

#[cfg(feature = "plant-indirect-call")]
#[unsafe(no_mangle)]
fn entry_planted_indirect_call(each: &mut dyn FnMut(u32) -> u32) -> u32 {
    each(1).wrapping_add(each(2))
}

/// A loop of which nobody knows how often it goes round.
#[cfg(feature = "plant-loop")]
pub(crate) fn look_at_each(cells: &[fencepost_core::map::Cell]) {
    for cell in cells {
        core::hint::black_box(cell);
    }
}

/// 9 KiB on the stack.
#[cfg(feature = "plant-deep-stack")]
#[unsafe(no_mangle)]
fn entry_planted_deep_stack(at: &[u8]) -> u8 {
    let mut table = [0u8; 9 * 1024];
    for (i, &at) in at.iter().enumerate() {
        if let Some(place) = table.get_mut(usize::from(at) * 36) {
            *place = i as u8;
        }
    }
    core::hint::black_box(&table).iter().fold(0, |sum, byte| sum ^ byte)
}

/// Memory from an allocator.
#[cfg(feature = "plant-allocator")]
#[unsafe(no_mangle)]
fn entry_planted_allocator(size: usize) -> *mut u8 {
    malloc(size)
}

/// Has nothing to give, but has the name.
#[cfg(feature = "plant-allocator")]
#[inline(never)]
#[unsafe(no_mangle)]
extern "C" fn malloc(size: usize) -> *mut u8 {
    core::hint::black_box(core::ptr::without_provenance_mut(size))
}

// Stack by the size of the input, which the language itself does not offer.
#[cfg(all(feature = "plant-unbounded-stack", target_arch = "arm"))]
core::arch::global_asm!(
    ".thumb_func",
    ".global entry_planted_unbounded_stack",
    ".type entry_planted_unbounded_stack, %function",
    "entry_planted_unbounded_stack:",
    "push {{r7, lr}}",
    "mov r7, sp",
    "sub.w r1, sp, r0",
    "mov sp, r1",
    "mov sp, r7",
    "pop {{r7, pc}}",
    ".size entry_planted_unbounded_stack, . - entry_planted_unbounded_stack",
);
