//! The search by keys of cost and place.

use core::ops::Range;

use super::{PLACES, Vector, Wide, by_blocks, outside_is_nothing, search_fits};
use crate::arch::jobs::{Found, KeyJob, KeyLimits, PAD, Search};

/// # Safety
/// The processor must have the instructions of `V`.
#[inline(always)]
pub(in crate::arch) unsafe fn search_keys<V: Vector>(job: KeyJob<'_>) {
    let KeyJob { search, limits, columns, work, right, found } = job;
    if search.range.is_empty() || !search_fits::<V>(search, columns, work, Some(&right)) {
        return;
    }
    let (inner, range) = (search.inner(), search.range.clone());
    let tables = right.tables.map(|table| table.as_mut_ptr());
    // SAFETY: all that is touched was seen to lie in the slices; the caller guarantees the instructions.
    unsafe {
        let keys = work.as_mut_ptr().add(PAD);
        if !search.follows {
            begin_keys::<V>(search, columns, keys);
        }
        for x in range.start..inner.start {
            key_pixel::<V, true>(search, limits, columns, keys, tables, x, found);
        }
        by_blocks!(search.stride / V::LANES,
            BLOCKS => key_run::<V, BLOCKS>(search, limits, columns, keys, tables, inner.clone(), found),
            _ => for x in inner.clone() {
                key_pixel::<V, false>(search, limits, columns, keys, tables, x, found);
            }
        );
        for x in inner.end..range.end {
            key_pixel::<V, true>(search, limits, columns, keys, tables, x, found);
        }
    }
}

/// The keys of the pixel before the first: cost and place of each, and the largest key behind the last one.
///
/// # Safety
/// That of [`search_keys`], and that [`search_fits`].
#[inline(always)]
unsafe fn begin_keys<V: Vector>(search: &Search, columns: &[u8], keys: *mut i16) {
    // SAFETY: that of this function.
    unsafe {
        let nothing = V::Wide::splat(i16::MAX);
        let end = V::Wide::splat((search.disparities as i16).wrapping_add(i16::MIN));
        for first in (0..search.stride).step_by(V::LANES) {
            let places = V::Wide::load(PLACES.as_ptr()).add(V::Wide::splat((first as i16).wrapping_add(i16::MIN)));
            let mut sums = [places, places.add(V::Wide::splat(V::Wide::LANES as i16))];
            let inside = [end.greater(sums[0]), end.greater(sums[1])];
            for x in search.window_before() {
                sums = V::load(columns.as_ptr().add(x.wrapping_mul(search.stride)).add(first)).add_shifted(sums);
            }
            for half in 0..2 {
                sums[half].select(inside[half], nothing).store(keys.add(first).add(half * V::Wide::LANES));
            }
        }
    }
}

/// # Safety
/// That of [`search_keys`], and that [`search_fits`].
#[inline(always)]
unsafe fn key_pixel<V: Vector, const BORDER: bool>(
    search: &Search,
    limits: &KeyLimits,
    columns: &[u8],
    keys: *mut i16,
    tables: [*mut i16; 2],
    x: usize,
    found: &mut Found,
) {
    // SAFETY: that of this function.
    unsafe {
        let stride = search.stride;
        let enter = columns.as_ptr().add(search.entering(x).wrapping_mul(stride));
        let leave = columns.as_ptr().add(search.leaving(x).wrapping_mul(stride));
        let candidates = if BORDER { search.candidates(x) } else { 0..search.disparities };
        let nothing = V::Wide::splat(i16::MAX);
        let turn = V::Wide::splat(0x7f);
        let table = tables[x % 2].add(x);
        for first in (0..stride).step_by(V::LANES) {
            let change = V::load(enter.add(first)).sub(V::load(leave.add(first)));
            let before = [V::Wide::load(keys.add(first)), V::Wide::load(keys.add(first).add(V::Wide::LANES))];
            let after = change.add_shifted(before);
            after[0].store(keys.add(first));
            after[1].store(keys.add(first).add(V::Wide::LANES));
        }
        if BORDER && candidates.is_empty() {
            return;
        }
        // Vectors without candidates are passed over.
        let places = (candidates.start / V::Wide::LANES).wrapping_mul(V::Wide::LANES)..if BORDER {
            candidates.end
        } else {
            stride
        };
        let mut least = nothing;
        for place in places.clone().step_by(V::Wide::LANES) {
            let key = V::Wide::load(keys.add(place));
            let key = if BORDER { outside_is_nothing::<V>(key, place, &candidates) } else { key };
            least = least.min(key);
            V::Wide::load(table.add(place)).min(key.xor(turn)).store(table.add(place));
        }
        let least = least.least();
        let place = (least & 0x7f) as usize;
        let above = limits.above(least, found.weak(search.nth(x)));
        let bound = V::Wide::splat(above);
        let mut near = V::Wide::none();
        for place in places.step_by(V::Wide::LANES) {
            let key = V::Wide::load(keys.add(place));
            let key = if BORDER { outside_is_nothing::<V>(key, place, &candidates) } else { key };
            near = V::Wide::count(near, bound.greater(key));
        }
        // There is room on both sides.
        let beside = [*keys.add(place).sub(1), least, *keys.add(place).add(1)];
        found.put(search.nth(x), place, beside, V::Wide::total(near), above);
    }
}

/// Pixels that have all candidates, with columns of `BLOCKS` vectors: as [`key_pixel`], without loops, and with the keys in
/// registers where there are enough of them.
///
/// # Safety
/// That of [`search_keys`], and that [`search_fits`].
#[inline(always)]
unsafe fn key_run<V: Vector, const BLOCKS: usize>(
    search: &Search,
    limits: &KeyLimits,
    columns: &[u8],
    keys: *mut i16,
    tables: [*mut i16; 2],
    range: Range<usize>,
    found: &mut Found,
) {
    // SAFETY: that of this function.
    unsafe {
        let stride = BLOCKS * V::LANES;
        let kept = BLOCKS <= V::KEPT;
        let turn = V::Wide::splat(0x7f);
        let mut current = [[V::Wide::splat(0); 2]; BLOCKS];
        if kept {
            for block in 0..BLOCKS {
                let at = keys.add(block * V::LANES);
                current[block] = [V::Wide::load(at), V::Wide::load(at.add(V::Wide::LANES))];
            }
        }
        for x in range {
            let enter = columns.as_ptr().add(search.entering(x).wrapping_mul(stride));
            let leave = columns.as_ptr().add(search.leaving(x).wrapping_mul(stride));
            let table = tables[x % 2].add(x);
            let mut least = V::Wide::splat(i16::MAX);
            for block in 0..BLOCKS {
                let (first, second) = (block * V::LANES, block * V::LANES + V::Wide::LANES);
                if !kept {
                    current[block] = [V::Wide::load(keys.add(first)), V::Wide::load(keys.add(second))];
                }
                let change = V::load(enter.add(first)).sub(V::load(leave.add(first)));
                // What belongs together is read and written together: two vectors in one instruction, where there is one.
                let [low, high] = change.add_shifted(current[block]);
                let offered = [V::Wide::load(table.add(first)), V::Wide::load(table.add(second))];
                current[block] = [low, high];
                low.store(keys.add(first));
                high.store(keys.add(second));
                least = least.min(low.min(high));
                let best = [offered[0].min(low.xor(turn)), offered[1].min(high.xor(turn))];
                best[0].store(table.add(first));
                best[1].store(table.add(second));
            }
            let least = least.least();
            let place = (least & 0x7f) as usize;
            let above = limits.above(least, found.weak(search.nth(x)));
            let bound = V::Wide::splat(above);
            let mut near = V::Wide::none();
            for block in 0..BLOCKS {
                for half in 0..2 {
                    let place = block * V::LANES + half * V::Wide::LANES;
                    let key = if kept { current[block][half] } else { V::Wide::load(keys.add(place)) };
                    near = V::Wide::count(near, bound.greater(key));
                }
            }
            // There is room on both sides.
            let beside = [*keys.add(place).sub(1), least, *keys.add(place).add(1)];
            found.put(search.nth(x), place, beside, V::Wide::total(near), above);
        }
    }
}
