//! The search by costs, for windows whose costs and places do not fit 16 bits together.

use super::{PLACES, Vector, Wide, by_blocks, is_outside, outside_is_nothing, search_fits};
use crate::arch::jobs::{CostJob, Found, PAD, Search};

/// What stands where there is no disparity, between the costs of bytes, less 32768; 16 times this is still a large number.
const NO_COST: i16 = 0x07ff;

/// # Safety
/// The processor must have the instructions of `V`.
#[inline(always)]
pub(in crate::arch) unsafe fn search_costs<V: Vector>(job: CostJob<'_, u8>) {
    let CostJob { search, columns, work, right, found } = job;
    if search.range.is_empty() || !search_fits::<V>(search, columns, work, right.as_ref()) {
        return;
    }
    let inner = search.inner();
    let tables = right.map(|right| right.tables.map(|table| table.as_mut_ptr()));
    // SAFETY: all that is touched was seen to lie in the slices; the caller guarantees the instructions.
    unsafe {
        let costs = work.as_mut_ptr().add(PAD);
        if !search.follows {
            begin_costs::<V>(search, columns, costs);
        }
        if search.is_small && tables.is_none() && inner == search.range {
            by_blocks!(search.stride / V::LANES,
                BLOCKS => return cost_run::<V, BLOCKS>(search, columns, costs, found),
                _ => ()
            );
        }
        for x in search.range.clone() {
            if inner.contains(&x) {
                cost_pixel::<V, false>(search, columns, costs, tables, x, found);
            } else {
                cost_pixel::<V, true>(search, columns, costs, tables, x, found);
            }
        }
    }
}

/// # Safety
/// That of [`search_costs`], and that [`search_fits`].
#[inline(always)]
unsafe fn begin_costs<V: Vector>(search: &Search, columns: &[u8], costs: *mut i16) {
    // SAFETY: that of this function.
    unsafe {
        for first in (0..search.stride).step_by(V::LANES) {
            let mut sums = [V::Wide::splat(i16::MIN); 2];
            for x in search.window_before() {
                let [low, high] = V::load(columns.as_ptr().add(x.wrapping_mul(search.stride)).add(first)).widen();
                sums = [sums[0].add(low), sums[1].add(high)];
            }
            for half in 0..2 {
                let place = first.wrapping_add(half * V::Wide::LANES);
                let inside = outside_is_nothing::<V>(sums[half], place, &(0..search.disparities));
                // Sums of bytes under a window are all below this.
                inside.min(V::Wide::splat(NO_COST)).store(costs.add(place));
            }
        }
    }
}

/// # Safety
/// That of [`search_costs`], and that [`search_fits`].
#[inline(always)]
unsafe fn cost_pixel<V: Vector, const BORDER: bool>(
    search: &Search,
    columns: &[u8],
    costs: *mut i16,
    tables: Option<[*mut i16; 2]>,
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
        let places = V::Wide::load(PLACES.as_ptr());
        let top = V::Wide::splat(search.top() as i16);
        let mut least = nothing;
        for first in (0..stride).step_by(V::LANES) {
            let (enter, leave) = (V::load(enter.add(first)).widen(), V::load(leave.add(first)).widen());
            for half in 0..2 {
                let place = first.wrapping_add(half * V::Wide::LANES);
                let cost = V::Wide::load(costs.add(place)).add(enter[half].sub(leave[half]));
                cost.store(costs.add(place));
                if BORDER && is_outside::<V>(place, &candidates) {
                    continue;
                }
                let cost = if BORDER { outside_is_nothing::<V>(cost, place, &candidates) } else { cost };
                least = least.min(cost);
                if let Some([best, disparities]) = tables {
                    let (best, disparities) = (best.add(x).add(place), disparities.add(x).add(place));
                    let (before, told) = (V::Wide::load(best), V::Wide::load(disparities));
                    let offered = top.sub(V::Wide::splat(place as i16)).sub(places);
                    before.min(cost).store(best);
                    offered.select(before.greater(cost), told).store(disparities);
                }
            }
        }
        if BORDER && candidates.is_empty() {
            return;
        }
        let cost = least.least();
        let above = search.above(cost, found.weak(search.nth(x)));
        let bound = V::Wide::splat(above);
        let best = V::Wide::splat(cost);
        let mut near = V::Wide::none();
        // The first of equal places: those that are not equal are 32767 or so.
        let mut first = nothing;
        for place in (0..stride).step_by(V::Wide::LANES) {
            if BORDER && is_outside::<V>(place, &candidates) {
                continue;
            }
            let cost = V::Wide::load(costs.add(place));
            let cost = if BORDER { outside_is_nothing::<V>(cost, place, &candidates) } else { cost };
            near = V::Wide::count(near, bound.greater(cost));
            let here = places.add(V::Wide::splat(place as i16));
            first = first.min(here.select(best.equal(cost), nothing));
        }
        let place = first.least() as usize % stride.max(1);
        // There is room on both sides.
        let beside = [*costs.add(place).sub(1), cost, *costs.add(place).add(1)];
        found.put(search.nth(x), place, beside, V::Wide::total(near), above);
    }
}

/// Pixels that have all candidates, with columns of `BLOCKS` vectors and costs of at most 2040: as [`cost_pixel`], but cost and
/// number of the vector go together through the search, and only the place in the vector is left to find.
///
/// # Safety
/// That of [`search_costs`], and that [`search_fits`].
#[inline(always)]
unsafe fn cost_run<V: Vector, const BLOCKS: usize>(
    search: &Search,
    columns: &[u8],
    costs: *mut i16,
    found: &mut Found,
) {
    // SAFETY: that of this function.
    unsafe {
        let stride = BLOCKS * V::LANES;
        for x in search.range.clone() {
            let enter = columns.as_ptr().add(search.entering(x).wrapping_mul(stride));
            let leave = columns.as_ptr().add(search.leaving(x).wrapping_mul(stride));
            let mut least = V::Wide::splat(i16::MAX);
            for block in 0..BLOCKS {
                let first = block * V::LANES;
                let change = V::load(enter.add(first)).sub(V::load(leave.add(first))).widen_signed();
                for half in 0..2 {
                    let place = first.wrapping_add(half * V::Wide::LANES);
                    let cost = V::Wide::load(costs.add(place)).add(change[half]);
                    cost.store(costs.add(place));
                    // The 32768 that costs are less by falls out at the top.
                    least = least.min(cost.times_16().add(V::Wide::splat((2 * block + half) as i16)));
                }
            }
            let key = least.least();
            let first = V::Wide::first(least.equal(V::Wide::splat(key)));
            let place = ((key & 15) as usize).wrapping_mul(V::Wide::LANES).wrapping_add(first);
            let best = (key >> 4).wrapping_add(i16::MIN);
            let above = search.above(best, found.weak(search.nth(x)));
            let bound = V::Wide::splat(above);
            let mut near = V::Wide::none();
            for half in 0..2 * BLOCKS {
                near = V::Wide::count(near, bound.greater(V::Wide::load(costs.add(half * V::Wide::LANES))));
            }
            // There is room on both sides.
            let beside = [*costs.add(place).sub(1), best, *costs.add(place).add(1)];
            let near = V::Wide::total(near);
            found.put(search.nth(x), place, beside, near, above);
        }
    }
}
