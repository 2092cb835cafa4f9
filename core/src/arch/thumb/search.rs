//! The best place of each pixel, by costs in pairs.

use core::ops::Range;

use super::{
    BLOCK,
    words::{add_even, add_odd, below, bytes_less, least, least_signed},
};
use crate::arch::jobs::{CHUNK, Found, KeyLimits, PAD, Right, Search};

/// Places in blocks that are enough for all disparities that fit a key.
const MOST_BLOCKS: usize = 128 / BLOCK;

/// Turns a key of the left pixel into that of the right one: the place is counted the other way round, and the number is less 32768,
/// as the tables of right pixels have it.
const TURN: u32 = 0x807f_807f;

/// More candidates than the best place and those beside it, which may be as good: further ones change nothing.
const AMBIGUOUS: u32 = 4;

/// Each of two lanes.
const fn both(number: u16) -> u32 {
    number as u32 * 0x0001_0001
}

/// What a search works with.
struct Work {
    /// Sums of the columns, four places to a word.
    columns: *const u32,
    /// Costs: places 0 and 2, then 1 and 3, of each four.
    costs: *mut u32,
    words: usize,
}

pub(super) fn search_keys(
    search: &Search,
    limits: &KeyLimits,
    columns: &[u8],
    work: &mut [i16],
    right: Right<'_>,
    found: &mut Found,
) {
    let lead = search.min_disparity + search.disparities - 1;
    let fits = right.lead == lead && right.tables.iter().all(|t| t.len() >= search.range.end + search.stride);
    let Some(work) = Work::new(search, columns, work).filter(|_| fits) else {
        debug_assert!(false, "the plan of the matcher sees to it that everything fits");
        return;
    };
    let [even, odd] = right.tables.map(|table| table.as_mut_ptr());
    // SAFETY: `Work::new` has seen that columns and costs lie in their slices, and the tables were seen to hold a column's places
    // from every pixel of the range on.
    unsafe {
        for x in search.range.clone() {
            let table = if x % 2 == 0 { even } else { odd };
            let mut minima = [u32::MAX; MOST_BLOCKS];
            let Some(least) = work.pixel::<true>(search, x, table.add(x), &mut minima) else { continue };
            let key = least as u16;
            let above = limits.above((key ^ 0x8000) as i16);
            let bound = (above as u16 ^ 0x8000) >> 7;
            let near = work.near(&minima, key_bound(bound), bound);
            let number = |cost: u16| ((cost << 7) ^ 0x8000) as i16;
            let place = usize::from(key & 0x7f);
            let beside = [number(work.cost(place.saturating_sub(1))), (key ^ 0x8000) as i16, number(work.cost(place + 1))];
            found.put(x - search.range.start, place, beside, near, above);
        }
    }
}

/// For windows whose costs are at most 2040 and are not asked of the right pixels.
pub(super) fn search_costs(search: &Search, columns: &[u8], work: &mut [i16], found: &mut Found) {
    let Some(work) = Work::new(search, columns, work) else {
        debug_assert!(false, "the plan of the matcher sees to it that everything fits");
        return;
    };
    // SAFETY: `Work::new` has seen that columns and costs lie in their slices; there is no table.
    unsafe {
        for x in search.range.clone() {
            let mut minima = [u32::MAX; MOST_BLOCKS];
            let Some(least) = work.pixel::<false>(search, x, core::ptr::null_mut(), &mut minima) else { continue };
            let cost = least as u16;
            let number = |cost: u16| (cost ^ 0x8000) as i16;
            let above = search.above(number(cost));
            let bound = above as u16 ^ 0x8000;
            let near = work.near(&minima, bound, bound);
            let place = work.first_of(search.candidates(x), &minima, cost);
            let beside = [number(work.cost(place.saturating_sub(1))), number(cost), number(work.cost(place + 1))];
            found.put(x - search.range.start, place, beside, near, above);
        }
    }
}

/// The bound of keys for a bound of costs; no cost reaches 511.
const fn key_bound(cost: u16) -> u16 {
    cost << 7
}

impl Work {
    /// Sees that everything lies in the slices, and makes the costs of the pixel before the first where they are not there.
    fn new(search: &Search, columns: &[u8], work: &mut [i16]) -> Option<Self> {
        let Search { range, radius, stride, disparities, .. } = search;
        let fits = stride == disparities
            && stride.is_multiple_of(BLOCK)
            && *stride <= MOST_BLOCKS * BLOCK
            && range.start > *radius
            && range.len() <= CHUNK
            && columns.len() >= (range.end + radius).saturating_mul(*stride)
            && columns.as_ptr().addr().is_multiple_of(4)
            && work.len() >= stride + 2 * PAD;
        if !fits {
            return None;
        }
        // Pairs of words are read at once where they lie at a multiple of four bytes; there is room for that in front.
        let first = PAD + work.as_ptr().align_offset(4);
        let costs = work.get_mut(first..first + stride)?.as_mut_ptr().cast::<u32>();
        let work = Self { columns: columns.as_ptr().cast(), costs, words: stride / 4 };
        if !search.follows {
            // SAFETY: columns up to the first one's window and the costs were just seen to lie in the slices.
            unsafe { work.begin(range.start - radius - 1..range.start + radius) };
        }
        Some(work)
    }

    /// Sums `columns`.
    ///
    /// # Safety
    /// Those columns and the costs lie in their slices.
    unsafe fn begin(&self, columns: Range<usize>) {
        const EVEN: u32 = 0x00ff_00ff;
        for word in 0..self.words {
            let mut sums = [0u32; 2];
            for x in columns.clone() {
                // SAFETY: that of this function.
                let four = unsafe { *self.columns.add(x * self.words + word) };
                sums = [sums[0] + (four & EVEN), sums[1] + (four >> 8 & EVEN)];
            }
            // SAFETY: that of this function.
            unsafe {
                *self.costs.add(2 * word) = sums[0];
                *self.costs.add(2 * word + 1) = sums[1];
            }
        }
    }

    /// Moves the costs on to pixel `x` and finds the least key, or cost, in each block and among all; `None` without candidates.
    /// With keys they are offered to the right pixels from `table` on.
    ///
    /// # Safety
    /// All that was seen by [`Self::new`], and with keys `table` holds a column's places.
    #[inline(always)]
    unsafe fn pixel<const KEYS: bool>(
        &self,
        search: &Search,
        x: usize,
        table: *mut i16,
        minima: &mut [u32; MOST_BLOCKS],
    ) -> Option<u32> {
        let candidates = search.candidates(x);
        // SAFETY: that of this function.
        unsafe {
            let enter = self.columns.add((x + search.radius) * self.words);
            let leave = self.columns.add((x - search.radius - 1) * self.words);
            let mut all = u32::MAX;
            let mut places = 0x0002_0000u32;
            for (block, minimum) in minima.iter_mut().enumerate().take(self.words / 2) {
                let word = 2 * block;
                let costs = self.costs.add(2 * word);
                let changes =
                    [0, 1].map(|i| bytes_less(*enter.add(word + i), *leave.add(word + i)));
                let moved = [
                    add_even(*costs, changes[0]),
                    add_odd(*costs.add(1), changes[0]),
                    add_even(*costs.add(2), changes[1]),
                    add_odd(*costs.add(3), changes[1]),
                ];
                for (i, &cost) in moved.iter().enumerate() {
                    *costs.add(i) = cost;
                }
                let first = BLOCK * block;
                if first + BLOCK <= candidates.start || first >= candidates.end {
                    places += both(BLOCK as u16);
                    continue;
                }
                let mut numbers = moved;
                if KEYS {
                    let [a, b, c, d] = moved;
                    let later = places + both(4);
                    numbers = [
                        places + (a << 7),
                        places + both(1) + (b << 7),
                        later + (c << 7),
                        later + both(1) + (d << 7),
                    ];
                    places += both(BLOCK as u16);
                }
                if first < candidates.start || first + BLOCK > candidates.end {
                    numbers = inside(numbers, first, &candidates);
                }
                let [a, b, c, d] = numbers;
                *minimum = least(least(a, b), least(c, d));
                all = least(all, *minimum);
                if KEYS {
                    let table = table.add(first).cast::<u32>();
                    let keys = [a & 0xffff | b << 16, a >> 16 | b & 0xffff_0000, c & 0xffff | d << 16, c >> 16 | d & 0xffff_0000];
                    for (i, key) in keys.into_iter().enumerate() {
                        let here = table.add(i);
                        here.write_unaligned(least_signed(here.read_unaligned(), key ^ TURN));
                    }
                }
            }
            let all = (all & 0xffff).min(all >> 16);
            (!candidates.is_empty()).then_some(all)
        }
    }

    /// Candidates below the bound, up to [`AMBIGUOUS`] or a few more: blocks whose least number is below `number`, and in those the
    /// costs below `cost`. Costs of places that are no candidates may be among them where no place is told anyway.
    ///
    /// # Safety
    /// As [`Self::pixel`].
    #[inline(always)]
    unsafe fn near(&self, minima: &[u32; MOST_BLOCKS], number: u16, cost: u16) -> u16 {
        let mut near = 0;
        for (block, &minimum) in minima.iter().enumerate().take(self.words / 2) {
            if below(minimum, both(number)) == 0 {
                continue;
            }
            // SAFETY: that of this function.
            let counts = unsafe {
                let costs = self.costs.add(4 * block);
                [0, 1, 2, 3].map(|i| below(*costs.add(i), both(cost)))
            };
            near += counts[0] + counts[1] + counts[2] + counts[3];
            if (near & 0xffff) + (near >> 16) >= AMBIGUOUS {
                break;
            }
        }
        ((near & 0xffff) + (near >> 16)) as u16
    }

    /// The first candidate of cost `cost`; there is one.
    ///
    /// # Safety
    /// As [`Self::pixel`].
    unsafe fn first_of(&self, candidates: Range<usize>, minima: &[u32; MOST_BLOCKS], cost: u16) -> usize {
        let holds = |&minimum: &u32| minimum as u16 == cost || (minimum >> 16) as u16 == cost;
        let block = minima.iter().position(holds).unwrap_or(0);
        let places = candidates.start.max(BLOCK * block)..candidates.end;
        // SAFETY: that of this function.
        places.clone().find(|&place| unsafe { self.cost(place) } == cost).unwrap_or(places.start)
    }

    /// The cost of a place; of the last one for those beyond.
    ///
    /// # Safety
    /// As [`Self::pixel`].
    #[inline(always)]
    unsafe fn cost(&self, place: usize) -> u16 {
        let place = place.min(4 * self.words - 1);
        // Of each four the middle ones are exchanged.
        let at = place & !3 | (place & 1) << 1 | place >> 1 & 1;
        // SAFETY: that of this function.
        unsafe { *self.costs.cast::<u16>().add(at) }
    }
}

/// What is no candidate is the largest number.
#[cold]
#[inline(never)]
fn inside(numbers: [u32; 4], first: usize, candidates: &Range<usize>) -> [u32; 4] {
    let mut numbers = numbers;
    for (place, offset) in (first..first + BLOCK).zip([0, 2, 1, 3, 4, 6, 5, 7]) {
        // Offset counts 16-bit numbers: two to a word.
        if !candidates.contains(&place)
            && let Some(pair) = numbers.get_mut(offset / 2)
        {
            *pair |= 0xffff << (16 * (offset % 2));
        }
    }
    numbers
}
