//! The algorithm over vectors, whatever their width.
//!
//! Every function here is inlined into one that is compiled for the instructions of its vector.

use super::jobs::{CHUNK, CodeRow, Found, KeyLimits, PAD, Right, Search, SlideCodes};

/// A vector of bytes.
///
/// # Safety
/// Every function needs a processor with the instructions of the vector; those that take a pointer read or write
/// [`Self::LANES`] bytes there.
pub(super) trait Vector: Copy {
    /// Bytes.
    const LANES: usize;
    /// A left code, ready to be compared with right ones.
    type Code: Copy;
    /// A vector of as many bits, of 16-bit numbers.
    type Wide: Wide;

    unsafe fn load(from: *const u8) -> Self;
    unsafe fn store(self, to: *mut u8);
    unsafe fn add(self, other: Self) -> Self;
    unsafe fn sub(self, other: Self) -> Self;
    unsafe fn and(self, other: Self) -> Self;
    unsafe fn code(code: u8) -> Self::Code;
    /// Bits by which the codes at `low` and `high` differ from the left one.
    unsafe fn hamming(code: Self::Code, low: *const u8, high: *const u8) -> Self;
    /// Numbers without sign, in order.
    unsafe fn widen(self) -> [Self::Wide; 2];
    /// Numbers with a sign, in order.
    unsafe fn widen_signed(self) -> [Self::Wide; 2];
    /// 128 times numbers with a sign, in order.
    unsafe fn widen_shifted(self) -> [Self::Wide; 2];
}

/// A vector of 16-bit numbers with a sign.
///
/// # Safety
/// As [`Vector`].
pub(super) trait Wide: Copy {
    /// Numbers.
    const LANES: usize;

    unsafe fn load(from: *const i16) -> Self;
    unsafe fn store(self, to: *mut i16);
    unsafe fn splat(number: i16) -> Self;
    unsafe fn add(self, other: Self) -> Self;
    unsafe fn sub(self, other: Self) -> Self;
    unsafe fn min(self, other: Self) -> Self;

    unsafe fn and(self, other: Self) -> Self;
    unsafe fn xor(self, other: Self) -> Self;
    /// All bits where this is greater than the other.
    unsafe fn greater(self, other: Self) -> Self;
    unsafe fn equal(self, other: Self) -> Self;
    unsafe fn least(self) -> i16;
    /// The first place at which both hold the same; there must be one.
    unsafe fn first_equal(self, other: Self) -> usize;
    /// 16 times each.
    unsafe fn times_16(self) -> Self;
    /// The sum of numbers from 0 to 255.
    unsafe fn sum(self) -> u32;
}

/// Bytes that let nothing through, everything, and nothing again; long enough for the widest vector.
static MASKS: [u8; 3 * WIDEST] = {
    let mut masks = [0; 3 * WIDEST];
    let mut i = WIDEST;
    while i < 2 * WIDEST {
        masks[i] = 0xff;
        i += 1;
    }
    masks
};

/// The numbers from 0 on, for the widest vector.
static PLACES: [i16; WIDEST / 2] = {
    let mut places = [0; WIDEST / 2];
    let mut i = 0;
    while i < WIDEST / 2 {
        places[i] = i as i16;
        i += 1;
    }
    places
};

const WIDEST: usize = 64;

/// What stands where there is no disparity, between the costs of bytes, less 32768; 16 times this is still a large number.
const NO_COST: i16 = 0x07ff;

/// A mask for the lanes from place `place` on: lets places through from `first` up to `end`.
#[inline(always)]
unsafe fn mask<V: Vector>(place: usize, first: usize, end: usize) -> V {
    let skipped = first.saturating_sub(place).min(WIDEST);
    let kept = end.saturating_sub(place).min(WIDEST);
    // SAFETY: the table is three times as long as the widest vector, and both starts lie in its first two thirds.
    unsafe { V::load(MASKS.as_ptr().add(WIDEST - skipped)).and(V::load(MASKS.as_ptr().add(2 * WIDEST - kept))) }
}

/// # Safety
/// The processor must have the instructions of `V`.
#[inline(always)]
pub(super) unsafe fn slide_codes<V: Vector>(job: SlideCodes<'_>) {
    let width = job.enter.left.len();
    let SlideCodes { columns, stride, disparities, min_disparity, enter, leave } = job;
    let Some(back) = (min_disparity + disparities).checked_sub(1) else { return };
    let holds = |row: &CodeRow<'_>| {
        let needed = (row.lead + width + stride).saturating_sub(back);
        row.left.len() >= width && row.lead >= back && row.low.len() >= needed && row.high.len() >= needed
    };
    let fits = stride.is_multiple_of(V::LANES) && stride >= disparities && stride - disparities < V::LANES;
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
        match stride / V::LANES {
            1 => slide::<V, true, 1>(columns, sizes, enter, leave),
            2 => slide::<V, true, 2>(columns, sizes, enter, leave),
            3 => slide::<V, true, 3>(columns, sizes, enter, leave),
            4 => slide::<V, true, 4>(columns, sizes, enter, leave),
            6 => slide::<V, true, 6>(columns, sizes, enter, leave),
            8 => slide::<V, true, 8>(columns, sizes, enter, leave),
            _ => slide::<V, true, 0>(columns, sizes, enter, leave),
        }
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
        let last = stride - V::LANES;
        let tail = mask::<V>(last, 0, disparities);
        for x in 0..width {
            let codes = [V::code(*enter.left.add(x)), V::code(*leave.left.add(x))];
            let column = columns.as_mut_ptr().add(x * stride);
            if x >= back {
                let mut place = 0;
                while place < last {
                    let change = change::<V, LEAVES>(codes, &enter, &leave, x + place);
                    V::load(column.add(place)).add(change).store(column.add(place));
                    place += V::LANES;
                }
                let change = change::<V, LEAVES>(codes, &enter, &leave, x + last).and(tail);
                V::load(column.add(last)).add(change).store(column.add(last));
            } else {
                // What lies in front of the row must leave no trace.
                let mut place = 0;
                while place < stride {
                    let change = change::<V, LEAVES>(codes, &enter, &leave, x + place);
                    let change = change.and(mask::<V>(place, back - x, disparities));
                    V::load(column.add(place)).add(change).store(column.add(place));
                    place += V::LANES;
                }
            }
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
        let base = row.lead - back;
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

/// Whether all that a search touches lies in the slices.
#[inline(always)]
fn search_fits<V: Vector>(search: &Search, columns: &[u8], work: &[i16], right: Option<&Right<'_>>) -> bool {
    let Search { range, radius, stride, disparities, .. } = search;
    let columns_needed = (range.end + radius).saturating_mul(*stride);
    let lead = search.min_disparity + disparities - 1;
    let fits = stride.is_multiple_of(V::LANES)
        && stride >= disparities
        && range.start > *radius
        && range.len() <= CHUNK
        && columns.len() >= columns_needed
        && work.len() >= stride + 2 * PAD
        && right.is_none_or(|right| right.lead == lead && right.tables.iter().all(|t| t.len() >= range.end + stride));
    debug_assert!(fits, "the plan of the matcher sees to it that everything fits");
    fits
}

/// # Safety
/// The processor must have the instructions of `V`.
#[inline(always)]
pub(super) unsafe fn search_keys<V: Vector>(
    search: &Search,
    limits: &KeyLimits,
    columns: &[u8],
    work: &mut [i16],
    right: Right<'_>,
    found: &mut Found,
) {
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
        match search.stride / V::LANES {
            1 => key_run::<V, 1>(search, limits, columns, keys, tables, inner.clone(), found),
            2 => key_run::<V, 2>(search, limits, columns, keys, tables, inner.clone(), found),
            3 => key_run::<V, 3>(search, limits, columns, keys, tables, inner.clone(), found),
            4 => key_run::<V, 4>(search, limits, columns, keys, tables, inner.clone(), found),
            6 => key_run::<V, 6>(search, limits, columns, keys, tables, inner.clone(), found),
            8 => key_run::<V, 8>(search, limits, columns, keys, tables, inner.clone(), found),
            _ => {
                for x in inner.clone() {
                    key_pixel::<V, false>(search, limits, columns, keys, tables, x, found);
                }
            }
        }
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
            for x in search.range.start - search.radius - 1..search.range.start + search.radius {
                let [low, high] = V::load(columns.as_ptr().add(x * search.stride + first)).widen_shifted();
                sums = [sums[0].add(low), sums[1].add(high)];
            }
            for half in 0..2 {
                let key = nothing.xor(nothing.xor(sums[half]).and(inside[half]));
                key.store(keys.add(first + half * V::Wide::LANES));
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
        let enter = columns.as_ptr().add((x + search.radius) * stride);
        let leave = columns.as_ptr().add((x - search.radius - 1) * stride);
        let candidates = if BORDER { search.candidates(x) } else { 0..search.disparities };
        let nothing = V::Wide::splat(i16::MAX);
        let turn = V::Wide::splat(0x7f);
        let table = tables[x % 2].add(x);
        let mut least = nothing;
        for first in (0..stride).step_by(V::LANES) {
            let change = V::load(enter.add(first)).sub(V::load(leave.add(first))).widen_shifted();
            for half in 0..2 {
                let place = first + half * V::Wide::LANES;
                let key = V::Wide::load(keys.add(place)).add(change[half]);
                key.store(keys.add(place));
                if BORDER && is_outside::<V>(place, &candidates) {
                    continue;
                }
                let key = if BORDER { outside_is_nothing::<V>(key, place, &candidates) } else { key };
                least = least.min(key);
                V::Wide::load(table.add(place)).min(key.xor(turn)).store(table.add(place));
            }
        }
        if BORDER && candidates.is_empty() {
            return;
        }
        let least = least.least();
        let place = (least & 0x7f) as usize;
        let above = limits.above(least);
        let bound = V::Wide::splat(above);
        let mut near = V::Wide::splat(0);
        for place in (0..stride).step_by(V::Wide::LANES) {
            if BORDER && is_outside::<V>(place, &candidates) {
                continue;
            }
            let key = V::Wide::load(keys.add(place));
            let key = if BORDER { outside_is_nothing::<V>(key, place, &candidates) } else { key };
            near = near.add(bound.greater(key));
        }
        // There is room on both sides.
        let beside = [*keys.add(place).sub(1), least, *keys.add(place + 1)];
        found.put(x - search.range.start, place, beside, V::Wide::splat(0).sub(near).sum() as u16, above);
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
    range: core::ops::Range<usize>,
    found: &mut Found,
) {
    // SAFETY: that of this function.
    unsafe {
        let stride = BLOCKS * V::LANES;
        let kept = BLOCKS <= 4;
        let turn = V::Wide::splat(0x7f);
        let mut current = [[V::Wide::splat(0); 2]; BLOCKS];
        if kept {
            for block in 0..BLOCKS {
                let at = keys.add(block * V::LANES);
                current[block] = [V::Wide::load(at), V::Wide::load(at.add(V::Wide::LANES))];
            }
        }
        for x in range {
            let enter = columns.as_ptr().add((x + search.radius) * stride);
            let leave = columns.as_ptr().add((x - search.radius - 1) * stride);
            let table = tables[x % 2].add(x);
            let mut least = V::Wide::splat(i16::MAX);
            for block in 0..BLOCKS {
                let first = block * V::LANES;
                let change = V::load(enter.add(first)).sub(V::load(leave.add(first))).widen_shifted();
                for half in 0..2 {
                    let place = first + half * V::Wide::LANES;
                    let before = if kept { current[block][half] } else { V::Wide::load(keys.add(place)) };
                    let key = before.add(change[half]);
                    if kept {
                        current[block][half] = key;
                    }
                    key.store(keys.add(place));
                    least = least.min(key);
                    V::Wide::load(table.add(place)).min(key.xor(turn)).store(table.add(place));
                }
            }
            let least = least.least();
            let place = (least & 0x7f) as usize;
            let above = limits.above(least);
            let bound = V::Wide::splat(above);
            let mut near = V::Wide::splat(0);
            for block in 0..BLOCKS {
                for half in 0..2 {
                    let place = block * V::LANES + half * V::Wide::LANES;
                    let key = if kept { current[block][half] } else { V::Wide::load(keys.add(place)) };
                    near = near.add(bound.greater(key));
                }
            }
            // There is room on both sides.
            let beside = [*keys.add(place).sub(1), least, *keys.add(place + 1)];
            found.put(x - search.range.start, place, beside, V::Wide::splat(0).sub(near).sum() as u16, above);
        }
    }
}

/// Whether a vector from `place` on has no candidates.
#[inline(always)]
fn is_outside<V: Vector>(place: usize, candidates: &core::ops::Range<usize>) -> bool {
    place + V::Wide::LANES <= candidates.start || place >= candidates.end
}

/// # Safety
/// That of [`search_keys`].
#[inline(always)]
unsafe fn outside_is_nothing<V: Vector>(
    number: V::Wide,
    place: usize,
    candidates: &core::ops::Range<usize>,
) -> V::Wide {
    // SAFETY: that of this function.
    unsafe {
        if place >= candidates.start && place + V::Wide::LANES <= candidates.end {
            return number;
        }
        let nothing = V::Wide::splat(i16::MAX);
        let places = V::Wide::load(PLACES.as_ptr()).add(V::Wide::splat(place as i16));
        let from = places.greater(V::Wide::splat(candidates.start as i16 - 1));
        let to = V::Wide::splat(candidates.end as i16).greater(places);
        nothing.xor(nothing.xor(number).and(from.and(to)))
    }
}

/// # Safety
/// The processor must have the instructions of `V`.
#[inline(always)]
pub(super) unsafe fn search_costs<V: Vector>(
    search: &Search,
    columns: &[u8],
    work: &mut [i16],
    right: Option<Right<'_>>,
    found: &mut Found,
) {
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
            match search.stride / V::LANES {
                1 => return cost_run::<V, 1>(search, columns, costs, found),
                2 => return cost_run::<V, 2>(search, columns, costs, found),
                3 => return cost_run::<V, 3>(search, columns, costs, found),
                4 => return cost_run::<V, 4>(search, columns, costs, found),
                6 => return cost_run::<V, 6>(search, columns, costs, found),
                8 => return cost_run::<V, 8>(search, columns, costs, found),
                _ => (),
            }
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
            for x in search.range.start - search.radius - 1..search.range.start + search.radius {
                let [low, high] = V::load(columns.as_ptr().add(x * search.stride + first)).widen();
                sums = [sums[0].add(low), sums[1].add(high)];
            }
            for half in 0..2 {
                let place = first + half * V::Wide::LANES;
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
        let enter = columns.as_ptr().add((x + search.radius) * stride);
        let leave = columns.as_ptr().add((x - search.radius - 1) * stride);
        let candidates = if BORDER { search.candidates(x) } else { 0..search.disparities };
        let nothing = V::Wide::splat(i16::MAX);
        let places = V::Wide::load(PLACES.as_ptr());
        let top = V::Wide::splat((search.min_disparity + search.disparities - 1) as i16);
        let mut least = nothing;
        for first in (0..stride).step_by(V::LANES) {
            let (enter, leave) = (V::load(enter.add(first)).widen(), V::load(leave.add(first)).widen());
            for half in 0..2 {
                let place = first + half * V::Wide::LANES;
                let cost = V::Wide::load(costs.add(place)).add(enter[half].sub(leave[half]));
                cost.store(costs.add(place));
                if BORDER && is_outside::<V>(place, &candidates) {
                    continue;
                }
                let cost = if BORDER { outside_is_nothing::<V>(cost, place, &candidates) } else { cost };
                least = least.min(cost);
                if let Some([best, disparities]) = tables {
                    let (best, disparities) = (best.add(x + place), disparities.add(x + place));
                    let (before, told) = (V::Wide::load(best), V::Wide::load(disparities));
                    let offered = top.sub(V::Wide::splat(place as i16)).sub(places);
                    before.min(cost).store(best);
                    told.xor(told.xor(offered).and(before.greater(cost))).store(disparities);
                }
            }
        }
        if BORDER && candidates.is_empty() {
            return;
        }
        let cost = least.least();
        let above = search.above(cost);
        let bound = V::Wide::splat(above);
        let best = V::Wide::splat(cost);
        let mut near = V::Wide::splat(0);
        // The first of equal places: those that are not equal are 32767 or so.
        let mut first = nothing;
        for place in (0..stride).step_by(V::Wide::LANES) {
            if BORDER && is_outside::<V>(place, &candidates) {
                continue;
            }
            let cost = V::Wide::load(costs.add(place));
            let cost = if BORDER { outside_is_nothing::<V>(cost, place, &candidates) } else { cost };
            near = near.add(bound.greater(cost));
            let here = places.add(V::Wide::splat(place as i16));
            first = first.min(nothing.xor(nothing.xor(here).and(best.equal(cost))));
        }
        let place = first.least() as usize % stride;
        // There is room on both sides.
        let beside = [*costs.add(place).sub(1), cost, *costs.add(place + 1)];
        found.put(x - search.range.start, place, beside, V::Wide::splat(0).sub(near).sum() as u16, above);
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
            let enter = columns.as_ptr().add((x + search.radius) * stride);
            let leave = columns.as_ptr().add((x - search.radius - 1) * stride);
            let mut least = V::Wide::splat(i16::MAX);
            for block in 0..BLOCKS {
                let first = block * V::LANES;
                let change = V::load(enter.add(first)).sub(V::load(leave.add(first))).widen_signed();
                for half in 0..2 {
                    let place = first + half * V::Wide::LANES;
                    let cost = V::Wide::load(costs.add(place)).add(change[half]);
                    cost.store(costs.add(place));
                    // The 32768 that costs are less by falls out at the top.
                    least = least.min(cost.times_16().add(V::Wide::splat((2 * block + half) as i16)));
                }
            }
            let key = least.least();
            let place = (key & 15) as usize * V::Wide::LANES + least.first_equal(V::Wide::splat(key));
            let best = (key >> 4).wrapping_add(i16::MIN);
            let above = search.above(best);
            let bound = V::Wide::splat(above);
            let mut near = V::Wide::splat(0);
            for half in 0..2 * BLOCKS {
                near = near.add(bound.greater(V::Wide::load(costs.add(half * V::Wide::LANES))));
            }
            // There is room on both sides.
            let beside = [*costs.add(place).sub(1), best, *costs.add(place + 1)];
            let near = V::Wide::splat(0).sub(near).sum() as u16;
            found.put(x - search.range.start, place, beside, near, above);
        }
    }
}
