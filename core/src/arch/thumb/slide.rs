//! A row of codes into the sums of its columns, and another one out.

use core::arch::asm;

use super::BLOCK;
use crate::arch::jobs::{CodeRow, SlideCodes};

/// Bytes that are all the same.
const fn bytes(byte: u8) -> u32 {
    u32::from_ne_bytes([byte; 4])
}

pub(in crate::arch) fn slide_codes(job: SlideCodes<'_>) {
    let SlideCodes { columns, stride, disparities, min_disparity, enter, leave } = job;
    let width = enter.left.len();
    let Some(back) = min_disparity.saturating_add(disparities).checked_sub(1) else { return };
    let holds = |row: &CodeRow<'_>| {
        let needed = row.lead.saturating_sub(back).saturating_add(width).saturating_add(stride);
        row.left.len() >= width && row.lead >= back && row.low.len() >= needed
    };
    let fits = stride == disparities
        && stride.is_multiple_of(BLOCK)
        && stride > 0
        && width.checked_mul(stride).is_some_and(|sums| columns.len() >= sums)
        && columns.as_ptr().addr().is_multiple_of(4)
        && holds(&enter)
        && leave.as_ref().is_none_or(holds);
    if !fits {
        debug_assert!(false, "the plan of the matcher sees to it that everything fits");
        return;
    }
    // The right code that place 0 of the first column is compared with. What lies in front of the row goes into sums that no search
    // looks at, and out of them again when the row leaves.
    let right = |row: &CodeRow<'_>| row.low.as_ptr().wrapping_add(row.lead.wrapping_sub(back));
    let right_in = right(&enter);
    let mut columns = columns.chunks_exact_mut(stride.max(1));
    match leave {
        Some(leave) => {
            let right_out = right(&leave);
            for (x, (&left_in, &left_out)) in (0..width).zip(enter.left.iter().zip(leave.left)) {
                let Some(column) = columns.next() else { return };
                let rights = [right_in, right_out].map(|right| right.wrapping_add(x));
                // SAFETY: the column is a multiple of a block and aligned, and `holds` has seen as many right codes from `x` on.
                unsafe { slide(column, [bytes(left_in), !bytes(left_out)], rights) };
            }
        }
        None => {
            for (x, &left_in) in (0..width).zip(enter.left) {
                let Some(column) = columns.next() else { return };
                // SAFETY: `holds` has seen a column's right codes from `x` on.
                let right_in = unsafe { core::slice::from_raw_parts(right_in.add(x), stride) };
                for (sums, right_in) in column.as_chunks_mut::<4>().0.iter_mut().zip(right_in.as_chunks::<4>().0) {
                    let counts = ones(bytes(left_in) ^ u32::from_ne_bytes(*right_in));
                    *sums = u32::from_ne_bytes(*sums).wrapping_add(counts).to_ne_bytes();
                }
            }
        }
    }
}

/// Lets a row into the sums of a column and another one out. The left code that leaves comes with its bits turned: counting the bits
/// that agree gives eight less those that differ, and both counts go together.
///
/// Sums of whole words are sums of bytes, because no sum of a byte is negative or above 255 in the end.
///
/// # Safety
/// The column is aligned to four bytes and made of whole blocks; from both pointers on as many bytes can be read.
#[inline(always)]
unsafe fn slide(column: &mut [u8], codes: [u32; 2], [right_in, right_out]: [*const u8; 2]) {
    // SAFETY: reads and writes the column and reads the right codes, a block in each round; the caller guarantees that they are there.
    unsafe {
        asm!(
            "2:",
            "ldr {a}, [{right_in}], #4",
            "ldr {b}, [{right_out}], #4",
            "eor {a}, {a}, {code_in}",
            "eor {b}, {b}, {code_out}",
            // Bits of each two, then of each four, then of both rows together.
            "and {s}, {fives}, {a}, lsr #1",
            "sub {a}, {a}, {s}",
            "and {s}, {fives}, {b}, lsr #1",
            "sub {b}, {b}, {s}",
            "and {s}, {threes}, {a}, lsr #2",
            "and {a}, {a}, #0x33333333",
            "add {a}, {a}, {s}",
            "and {s}, {threes}, {b}, lsr #2",
            "and {b}, {b}, #0x33333333",
            "add {b}, {b}, {s}",
            "add {a}, {a}, {b}",
            "and {s}, {fifteens}, {a}, lsr #4",
            "and {a}, {a}, {fifteens}",
            "ldr {b}, [{column}]",
            "add {a}, {a}, {s}",
            "sub {a}, {a}, #0x08080808",
            "add {b}, {b}, {a}",
            "str {b}, [{column}], #4",
            // The next four.
            "ldr {a}, [{right_in}], #4",
            "ldr {b}, [{right_out}], #4",
            "eor {a}, {a}, {code_in}",
            "eor {b}, {b}, {code_out}",
            "and {s}, {fives}, {a}, lsr #1",
            "sub {a}, {a}, {s}",
            "and {s}, {fives}, {b}, lsr #1",
            "sub {b}, {b}, {s}",
            "and {s}, {threes}, {a}, lsr #2",
            "and {a}, {a}, #0x33333333",
            "add {a}, {a}, {s}",
            "and {s}, {threes}, {b}, lsr #2",
            "and {b}, {b}, #0x33333333",
            "add {b}, {b}, {s}",
            "add {a}, {a}, {b}",
            "and {s}, {fifteens}, {a}, lsr #4",
            "and {a}, {a}, {fifteens}",
            "ldr {b}, [{column}]",
            "add {a}, {a}, {s}",
            "sub {a}, {a}, #0x08080808",
            "add {b}, {b}, {a}",
            "str {b}, [{column}], #4",
            "subs {blocks}, {blocks}, #1",
            "bne 2b",
            column = inout(reg) column.as_mut_ptr() => _,
            right_in = inout(reg) right_in => _,
            right_out = inout(reg) right_out => _,
            blocks = inout(reg) column.len() / BLOCK => _,
            code_in = in(reg) codes[0],
            code_out = in(reg) codes[1],
            fives = in(reg) bytes(0x55),
            threes = in(reg) bytes(0x33),
            fifteens = in(reg) bytes(0x0f),
            a = out(reg) _,
            b = out(reg) _,
            s = out(reg) _,
            options(nostack),
        );
    }
}

/// Bits of each byte.
#[inline(always)]
const fn ones(bits: u32) -> u32 {
    let pairs = bits.wrapping_sub((bits >> 1) & bytes(0x55));
    let fours = (pairs & bytes(0x33)) + ((pairs >> 2) & bytes(0x33));
    (fours & bytes(0x0f)) + ((fours >> 4) & bytes(0x0f))
}
