//! A row of codes into the sums of its columns, and another one out.

use super::{Vector, by_blocks, mask};
use crate::arch::jobs::{CodeRow, SlideCodes};

/// # Safety
/// The processor must have the instructions of `V`.
#[inline(always)]
pub(in crate::arch) unsafe fn slide_codes<V: Vector>(job: SlideCodes<'_>) {
    let width = job.enter.left.len();
    let SlideCodes { columns, stride, disparities, min_disparity, enter, leave } = job;
    let Some(back) = min_disparity.saturating_add(disparities).checked_sub(1) else { return };
    let holds = |row: &CodeRow<'_>| {
        let needed = row.lead.saturating_sub(back).saturating_add(width).saturating_add(stride);
        row.left.len() >= width && row.lead >= back && row.low.len() >= needed && row.high.len() >= needed
    };
    let fits =
        stride.is_multiple_of(V::LANES) && stride >= disparities && stride.saturating_sub(disparities) < V::LANES;
    let whole = width.checked_mul(stride).is_some_and(|sums| columns.len() >= sums);
    if !fits || !whole || !holds(&enter) || leave.as_ref().is_some_and(|leave| !holds(leave)) {
        debug_assert!(false, "the plan of the matcher sees to it that everything fits");
        return;
    }
    // SAFETY: column x has `stride` sums from `x * stride` on, and the right codes for it are read from `lead + x - back` on,
    // as many: all of that was seen to lie in the slices. The caller guarantees the instructions.
    unsafe {
        let sizes = [width, stride, disparities, back];
        let Some(leave) = leave else { return slide::<V, false, 0>(columns, sizes, enter, enter) };
        by_blocks!(stride / V::LANES,
            BLOCKS => slide::<V, true, BLOCKS>(columns, sizes, enter, leave),
            _ => slide::<V, true, 0>(columns, sizes, enter, leave)
        );
    }
}

/// A column takes `BLOCKS` vectors; 0 for any number.
///
/// # Safety
/// That of [`slide_codes`], which has seen that everything lies in the slices.
#[inline(always)]
unsafe fn slide<V: Vector, const LEAVES: bool, const BLOCKS: usize>(
    columns: &mut [u8],
    [width, stride, disparities, back]: [usize; 4],
    enter: CodeRow<'_>,
    leave: CodeRow<'_>,
) {
    // SAFETY: that of this function.
    unsafe {
        let (enter, leave) = (Codes::new(enter, back), Codes::new(leave, back));
        let stride = if BLOCKS == 0 { stride } else { BLOCKS * V::LANES };
        let last = stride.wrapping_sub(V::LANES);
        let tail = mask::<V>(last, 0, disparities);
        let columns = columns.as_mut_ptr();
        for x in 0..width.min(back) {
            let codes = [V::code(*enter.left.add(x)), V::code(*leave.left.add(x))];
            let column = columns.add(x.wrapping_mul(stride));
            // What lies in front of the row must leave no trace.
            let mut place = 0usize;
            while place < stride {
                let change = change::<V, LEAVES>(codes, &enter, &leave, x.wrapping_add(place));
                let change = change.and(mask::<V>(place, back.wrapping_sub(x), disparities));
                V::load(column.add(place)).add(change).store(column.add(place));
                place = place.wrapping_add(V::LANES);
            }
        }
        for x in back..width {
            let codes = [V::code(*enter.left.add(x)), V::code(*leave.left.add(x))];
            let column = columns.add(x.wrapping_mul(stride));
            if 0 < BLOCKS && BLOCKS <= V::KEPT {
                // All is read before anything is written: two vectors in one instruction, where there is one.
                let mut changes = [change::<V, LEAVES>(codes, &enter, &leave, x); BLOCKS];
                for block in 1..BLOCKS {
                    changes[block] = change::<V, LEAVES>(codes, &enter, &leave, x.wrapping_add(block * V::LANES));
                }
                changes[BLOCKS - 1] = changes[BLOCKS - 1].and(tail);
                for block in 0..BLOCKS {
                    changes[block] = changes[block].add(V::load(column.add(block * V::LANES)));
                }
                for block in 0..BLOCKS {
                    changes[block].store(column.add(block * V::LANES));
                }
                continue;
            }
            let mut place = 0usize;
            while place < last {
                let change = change::<V, LEAVES>(codes, &enter, &leave, x.wrapping_add(place));
                V::load(column.add(place)).add(change).store(column.add(place));
                place = place.wrapping_add(V::LANES);
            }
            let change = change::<V, LEAVES>(codes, &enter, &leave, x.wrapping_add(last)).and(tail);
            V::load(column.add(last)).add(change).store(column.add(last));
        }
    }
}

/// Where the codes of a row lie: those of the right row from the one on that place 0 of the first column is compared with.
struct Codes {
    left: *const u8,
    low: *const u8,
    high: *const u8,
}

impl Codes {
    /// # Safety
    /// `back` must not exceed the lead.
    #[inline(always)]
    unsafe fn new(row: CodeRow<'_>, back: usize) -> Self {
        let base = row.lead.wrapping_sub(back);
        // SAFETY: both rows are longer than the lead.
        unsafe { Self { left: row.left.as_ptr(), low: row.low.as_ptr().add(base), high: row.high.as_ptr().add(base) } }
    }
}

/// What the sums change by, from right code `at` on. Not a closure: that would not be compiled for the instructions.
///
/// # Safety
/// That of [`slide`].
#[inline(always)]
unsafe fn change<V: Vector, const LEAVES: bool>(codes: [V::Code; 2], enter: &Codes, leave: &Codes, at: usize) -> V {
    // SAFETY: that of this function.
    unsafe {
        let change = V::hamming(codes[0], enter.low.add(at), enter.high.add(at));
        if LEAVES { change.sub(V::hamming(codes[1], leave.low.add(at), leave.high.add(at))) } else { change }
    }
}
