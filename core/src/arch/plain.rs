//! Plain Rust: what every other backend is held against.

use super::jobs::{CHUNK, CodeRow, CostJob, KeyJob, PAD, SlideCodes};

/// A sum over the rows of a window as it lies in a column.
pub(super) trait Sum: Copy {
    fn value(self) -> u16;
}

impl Sum for u8 {
    #[inline(always)]
    fn value(self) -> u16 {
        u16::from(self)
    }
}

/// Sums of 16 bits, as the processor holds them.
impl Sum for [u8; 2] {
    #[inline(always)]
    fn value(self) -> u16 {
        u16::from_ne_bytes(self)
    }
}

pub(super) fn slide_codes(job: SlideCodes<'_>) {
    let SlideCodes { columns, stride, disparities, min_disparity, enter, leave } = job;
    let difference = |left: u8, right: u8| ones(left ^ right);
    let add = |sum: &mut u8, change: u8| *sum = sum.wrapping_add(change);
    let (enter, leave) = (both(enter), leave.map(both));
    slide(columns, [stride, disparities, min_disparity], enter, leave, difference, add);
}

/// Codes of both rows, from their first pixels on.
fn both(row: CodeRow<'_>) -> (&[u8], &[u8]) {
    (row.left, row.low.get(row.lead..).unwrap_or_default())
}

pub(super) fn slide_grey(
    columns: &mut [[u8; 2]],
    disparities: usize,
    min_disparity: usize,
    enter: (&[u8], &[u8]),
    leave: Option<(&[u8], &[u8])>,
) {
    // Differences are at most 127, so what a sum changes by fits 8 bits: bytes are half as wide as sums, and twice as many of
    // them are worked on at once.
    let add = |sum: &mut [u8; 2], change: u8| {
        *sum = u16::from_ne_bytes(*sum).wrapping_add_signed(i16::from(change as i8)).to_ne_bytes();
    };
    slide(columns, [disparities, disparities, min_disparity], enter, leave, u8::abs_diff, add);
}

#[inline(always)]
fn slide<S: Copy>(
    columns: &mut [S],
    [stride, disparities, min_disparity]: [usize; 3],
    (enter_left, enter_right): (&[u8], &[u8]),
    leave: Option<(&[u8], &[u8])>,
    difference: impl Fn(u8, u8) -> u8 + Copy,
    add: impl Fn(&mut S, u8) + Copy,
) {
    let mut columns = columns.chunks_exact_mut(stride.max(1));
    for (x, &left) in enter_left.iter().enumerate() {
        let Some(column) = columns.next() else { return };
        // Place e holds disparity `min + disparities - 1 - e`, whose right pixel is `x + 1 - min - disparities + e`.
        let Some(last) = x.checked_sub(min_disparity) else { continue };
        let end = last.saturating_add(1);
        let first = end.saturating_sub(disparities);
        let skipped = disparities.saturating_sub(end.saturating_sub(first));
        let Some(column) = column.get_mut(skipped..disparities) else { return };
        let Some(right) = enter_right.get(first..=last) else { return };
        match leave {
            Some((leave_left, leave_right)) => {
                let (Some(&left_out), Some(right_out)) = (leave_left.get(x), leave_right.get(first..=last)) else {
                    return;
                };
                for ((sum, &right), &right_out) in column.iter_mut().zip(right).zip(right_out) {
                    add(sum, difference(left, right).wrapping_sub(difference(left_out, right_out)));
                }
            }
            None => {
                for (sum, &right) in column.iter_mut().zip(right) {
                    add(sum, difference(left, right));
                }
            }
        }
    }
}

pub(super) fn search_keys(job: KeyJob<'_>) {
    let KeyJob { search, limits, columns, work, right, found } = job;
    let disparities = search.disparities;
    let Some(keys) = work.get_mut(PAD..PAD.saturating_add(disparities)) else { return };
    let column = |x: usize| {
        columns.get(x.saturating_mul(search.stride)..).and_then(|rest| rest.get(..disparities)).unwrap_or_default()
    };
    if !search.follows {
        for (place, key) in keys.iter_mut().enumerate() {
            *key = (place as i16).wrapping_add(i16::MIN);
        }
        for x in search.window_before() {
            for (key, &sum) in keys.iter_mut().zip(column(x)) {
                *key = key.wrapping_add(i16::from(sum) << 7);
            }
        }
    }
    let [even, odd] = right.tables;
    for (i, x) in (0..CHUNK).zip(search.range.clone()) {
        let leave = column(search.leaving(x));
        for ((key, &enter), &leave) in keys.iter_mut().zip(column(search.entering(x))).zip(leave) {
            // What a sum of at most 12 rows changes by fits 8 bits.
            *key = key.wrapping_add(i16::from(enter.wrapping_sub(leave) as i8) << 7);
        }
        let candidates = search.candidates(x);
        let Some(inside) = keys.get(candidates.clone()).filter(|inside| !inside.is_empty()) else { continue };
        let least = inside.iter().fold(i16::MAX, |least, &key| least.min(key));
        let table = if x % 2 == 0 { &mut *even } else { &mut *odd };
        let partner = right.lead.saturating_add(x).saturating_add(candidates.start).saturating_sub(search.top());
        for (best, &key) in table.get_mut(partner..).unwrap_or_default().iter_mut().zip(inside) {
            *best = (*best).min(key ^ 0x7f);
        }
        let place = usize::from(least as u16 & 0x7f);
        let above = limits.above(least, found.weak(i));
        let near = inside.iter().fold(0u16, |near, &key| near.wrapping_add(u16::from(key < above)));
        let at = |place: Option<usize>| place.and_then(|place| keys.get(place)).copied().unwrap_or(i16::MAX);
        found.put(i, place, [at(place.checked_sub(1)), least, at(place.checked_add(1))], near, above);
    }
}

/// Costs are kept less 32768, because some processors compare signed numbers only.
pub(super) fn search_costs<S: Sum>(job: CostJob<'_, S>) {
    let CostJob { search, columns, work, mut right, found } = job;
    let disparities = search.disparities;
    let Some(costs) = work.get_mut(PAD..PAD.saturating_add(disparities)) else { return };
    let column = |x: usize| {
        columns.get(x.saturating_mul(search.stride)..).and_then(|rest| rest.get(..disparities)).unwrap_or_default()
    };
    if !search.follows {
        costs.fill(i16::MIN);
        for x in search.window_before() {
            for (cost, &sum) in costs.iter_mut().zip(column(x)) {
                *cost = cost.wrapping_add(sum.value() as i16);
            }
        }
    }
    for (i, x) in (0..CHUNK).zip(search.range.clone()) {
        let leave = column(search.leaving(x));
        for ((cost, &enter), &leave) in costs.iter_mut().zip(column(search.entering(x))).zip(leave) {
            *cost = cost.wrapping_add(enter.value().wrapping_sub(leave.value()) as i16);
        }
        let candidates = search.candidates(x);
        let Some(inside) = costs.get(candidates.clone()).filter(|inside| !inside.is_empty()) else { continue };
        if let Some(right) = &mut right {
            let top = search.top();
            let partner = right.lead.saturating_add(x).saturating_add(candidates.start).saturating_sub(top);
            offer(&mut right.tables, partner, inside, top.wrapping_sub(candidates.start) as i16);
        }
        let least = inside.iter().fold(i16::MAX, |least, &cost| least.min(cost));
        let place = candidates.start.saturating_add(inside.iter().position(|&cost| cost == least).unwrap_or(0));
        let above = search.above(least, found.weak(i));
        let near = inside.iter().fold(0u16, |near, &cost| near.wrapping_add(u16::from(cost < above)));
        let at = |place: Option<usize>| place.and_then(|place| costs.get(place)).copied().unwrap_or(i16::MAX);
        found.put(i, place, [at(place.checked_sub(1)), least, at(place.checked_add(1))], near, above);
    }
}

/// Offers the costs of one left pixel: the first belongs to the right pixel at `first` at disparity `largest`, each further one
/// to the next pixel at one disparity less.
fn offer([best, disparities]: &mut [&mut [i16]; 2], first: usize, costs: &[i16], largest: i16) {
    let best = best.get_mut(first..).unwrap_or_default();
    let disparities = disparities.get_mut(first..).unwrap_or_default();
    let mut offered = largest;
    for ((best, disparity), &cost) in best.iter_mut().zip(disparities).zip(costs) {
        let better = cost < *best;
        *best = if better { cost } else { *best };
        *disparity = if better { offered } else { *disparity };
        offered = offered.wrapping_sub(1);
    }
}

/// Number of bits that are set; by halves, because few processors count them in bytes side by side.
pub(super) const fn ones(bits: u8) -> u8 {
    let pairs = bits.wrapping_sub((bits >> 1) & 0x55);
    let fours = (pairs & 0x33).wrapping_add((pairs >> 2) & 0x33);
    fours.wrapping_add(fours >> 4) & 0x0f
}
