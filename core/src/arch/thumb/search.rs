//! The best place of each pixel, by costs in pairs.

use core::{arch::asm, ops::Range};

use super::{
    BLOCK, MOST_PLACES,
    words::{add_even, add_odd, below, bytes_less, least},
};
use crate::arch::jobs::{CHUNK, CostJob, KeyJob, PAD, Search};

/// Words of a block: four of costs, places 0 and 2, 1 and 3, 4 and 6, 5 and 7, and the least of its keys, or costs.
const RECORD: usize = 5;

/// Turns a key of the left pixel into that of the right one: the place is counted the other way round, and the number is less 32768,
/// as the tables of right pixels have it.
const TURN: u32 = 0x807f_807f;

/// More candidates than the best place and those beside it, which may be as good: further ones change nothing.
const AMBIGUOUS: u32 = 4;

/// The same number in both halves.
const fn both(number: u16) -> u32 {
    number as u32 * 0x0001_0001
}

/// The costs of the pixel at hand.
struct Costs {
    /// A record for each block.
    records: *mut u32,
    blocks: usize,
    /// What a key counts places from, so that it ends at 128 with the last one.
    first_place: u16,
}

/// Where a pixel's costs come from and what they are offered to.
#[derive(Clone, Copy)]
struct Pixel {
    enter: *const u32,
    leave: *const u32,
    /// The table's number for place 0; nothing where right pixels are not asked.
    table: *mut i16,
}

/// Searches by keys.
#[inline(never)]
pub(in crate::arch) fn search_keys(job: KeyJob<'_>) {
    let KeyJob { search, limits, columns, work, right, found } = job;
    let partners = search.range.end.saturating_add(search.stride);
    let fits = right.lead == search.top() && right.tables.iter().all(|t| t.len() >= partners);
    let Some(costs) = Costs::new(search, columns, work).filter(|_| fits) else {
        debug_assert!(false, "the plan of the matcher sees to it that everything fits");
        return;
    };
    let tables = right.tables.map(|table| table.as_mut_ptr());
    let inner = search.inner();
    for (i, x) in (0..CHUNK).zip(search.range.clone()) {
        // SAFETY: `Costs::new` has seen that the columns under the window and the costs lie in their slices, and the tables were seen
        // to hold the places of a column from every pixel of the range on.
        unsafe {
            let pixel = Pixel::new(search, columns, x, tables[x % 2].add(x));
            let candidates = if inner.contains(&x) { 0..search.disparities } else { search.candidates(x) };
            let Some(least) = costs.go_on::<true>(&pixel, &candidates) else { continue };
            let number = |cost: u16| (cost << 7 ^ 0x8000) as i16;
            let above = limits.above((least ^ 0x8000) as i16, found.weak(i));
            let bound = above as u16 ^ 0x8000;
            let near = costs.near(&candidates, bound, bound >> 7);
            let place = usize::from((least & 0x7f).wrapping_sub(costs.first_place));
            let [nearer, farther] =
                [place.saturating_sub(1), place.wrapping_add(1)].map(|place| number(costs.at(place)));
            found.put(i, place, [nearer, number(least >> 7), farther], near, above);
        }
    }
}

/// For windows whose costs are at most 2040 and are not asked of the right pixels.
#[inline(never)]
pub(super) fn search_costs(job: CostJob<'_, u8>) {
    let CostJob { search, columns, work, found, .. } = job;
    let Some(costs) = Costs::new(search, columns, work) else {
        debug_assert!(false, "the plan of the matcher sees to it that everything fits");
        return;
    };
    let inner = search.inner();
    for (i, x) in (0..CHUNK).zip(search.range.clone()) {
        // SAFETY: `Costs::new` has seen that the columns under the window and the costs lie in their slices; there is no table.
        unsafe {
            let pixel = Pixel::new(search, columns, x, core::ptr::null_mut());
            let candidates = if inner.contains(&x) { 0..search.disparities } else { search.candidates(x) };
            let Some(least) = costs.go_on::<false>(&pixel, &candidates) else { continue };
            let number = |cost: u16| (cost ^ 0x8000) as i16;
            let above = search.above(number(least), found.weak(i));
            let bound = above as u16 ^ 0x8000;
            let near = costs.near(&candidates, bound, bound);
            let place = costs.first_of(candidates, least);
            let [nearer, farther] =
                [place.saturating_sub(1), place.wrapping_add(1)].map(|place| number(costs.at(place)));
            found.put(i, place, [nearer, number(least), farther], near, above);
        }
    }
}

impl Pixel {
    /// # Safety
    /// The columns that enter and leave the window around `x` lie in `columns`.
    #[inline(always)]
    unsafe fn new(search: &Search, columns: &[u8], x: usize, table: *mut i16) -> Self {
        // SAFETY: that of this function.
        let column = |x: usize| unsafe { columns.as_ptr().add(x.wrapping_mul(search.stride)).cast::<u32>() };
        Self { enter: column(search.entering(x)), leave: column(search.leaving(x)), table }
    }
}

impl Costs {
    /// Sees that everything lies in the slices, and makes the costs of the pixel before the first where they are not there.
    fn new(search: &Search, columns: &[u8], work: &mut [i16]) -> Option<Self> {
        let Search { range, radius, stride, disparities, .. } = search;
        let fits = stride == disparities
            && stride.is_multiple_of(BLOCK)
            && *stride <= MOST_PLACES
            && range.start > *radius
            && range.len() <= CHUNK
            && columns.len() >= range.end.saturating_add(*radius).saturating_mul(*stride)
            && columns.as_ptr().addr().is_multiple_of(4);
        if !fits {
            return None;
        }
        let blocks = stride / BLOCK;
        // Pairs of words are read at once, which wants them aligned.
        let first = PAD + work.as_ptr().align_offset(4);
        let records = work.get_mut(first..first + 2 * RECORD * blocks + 1)?.as_mut_ptr().cast::<u32>();
        let costs = Self { records, blocks, first_place: (MOST_PLACES - stride) as u16 };
        if !search.follows {
            // SAFETY: columns up to the first one's window and the costs were just seen to lie in the slices.
            unsafe { costs.begin(columns, search.window_before()) };
        }
        Some(costs)
    }

    /// The record of a block.
    ///
    /// # Safety
    /// There is such a block.
    #[inline(always)]
    const unsafe fn record(&self, block: usize) -> *mut u32 {
        // SAFETY: that of this function.
        unsafe { self.records.add(RECORD.wrapping_mul(block)) }
    }

    /// Sums columns.
    ///
    /// # Safety
    /// Those columns and the costs lie in their slices.
    unsafe fn begin(&self, columns: &[u8], range: Range<usize>) {
        const EVEN: u32 = 0x00ff_00ff;
        let words = 2 * self.blocks;
        for word in 0..words {
            let mut sums = [0u32; 2];
            for x in range.clone() {
                // SAFETY: that of this function.
                let four = unsafe { *columns.as_ptr().cast::<u32>().add(x.wrapping_mul(words)).add(word) };
                sums = [sums[0].wrapping_add(four & EVEN), sums[1].wrapping_add(four >> 8 & EVEN)];
            }
            // SAFETY: that of this function.
            unsafe { self.record(word / 2).add(word % 2 * 2).cast::<[u32; 2]>().write(sums) };
        }
    }

    /// Moves the costs on to a pixel and finds the least key, or cost; `None` without candidates. Keys are offered to right pixels.
    ///
    /// # Safety
    /// All lies in its slices: see [`Self::new`].
    #[inline(always)]
    unsafe fn go_on<const KEYS: bool>(&self, pixel: &Pixel, candidates: &Range<usize>) -> Option<u16> {
        // SAFETY: that of this function.
        unsafe {
            if candidates.is_empty() {
                // Nothing is to be found; the costs go on all the same.
                self.cost_blocks(pixel, 0);
                return None;
            }
            // Candidates are missing in front near the left edge; only odd spans of valid columns make them end early.
            let whole = candidates.end == self.blocks.wrapping_mul(BLOCK);
            let first = if whole { candidates.start.div_ceil(BLOCK) } else { self.blocks };
            for block in 0..first {
                self.edge_block::<KEYS>(pixel, block, candidates);
            }
            if first < self.blocks {
                if KEYS {
                    self.key_blocks(pixel, first);
                } else {
                    self.cost_blocks(pixel, first);
                }
            }
            let all = self.least();
            Some((all as u16).min((all >> 16) as u16))
        }
    }

    /// The least numbers of all blocks.
    ///
    /// # Safety
    /// That of [`Self::go_on`].
    #[inline(always)]
    unsafe fn least(&self) -> u32 {
        let all;
        // SAFETY: reads the last word of each record, of which there is one at least; `build.rs` guarantees that the processor has the
        // instructions.
        unsafe {
            asm!(
                "ldr {all}, [{record}], #20",
                "b 3f",
                "2:",
                "ldr {minimum}, [{record}], #20",
                "usub16 {difference}, {all}, {minimum}",
                "sel {all}, {minimum}, {all}",
                "3:",
                "subs {blocks}, {blocks}, #1",
                "bne 2b",
                all = out(reg) all,
                record = inout(reg) self.records.add(RECORD - 1) => _,
                blocks = inout(reg) self.blocks => _,
                minimum = out(reg) _,
                difference = out(reg) _,
                options(nostack, readonly),
            );
        }
        all
    }

    /// The next block, from the given one on, whose least number is below `numbers`; one behind the last if there is none.
    ///
    /// # Safety
    /// That of [`Self::go_on`], and there is a block left.
    #[inline(always)]
    unsafe fn next_below(&self, from: usize, numbers: u32) -> usize {
        let left: usize;
        // SAFETY: as in `least`, of the blocks from the given one on.
        unsafe {
            asm!(
                "2:",
                "ldr {minimum}, [{record}], #20",
                "usub16 r0, {minimum}, {numbers}",
                "sel r0, {zero}, {numbers}",
                "cbnz r0, 3f",
                "subs {left}, {left}, #1",
                "bne 2b",
                "3:",
                record = inout(reg) self.record(from).add(RECORD - 1) => _,
                left = inout(reg) self.blocks.wrapping_sub(from) => left,
                numbers = in(reg) numbers,
                zero = in(reg) 0,
                minimum = out(reg) _,
                out("r0") _,
                options(nostack, readonly),
            );
        }
        self.blocks.wrapping_sub(left)
    }

    /// A block of which not all places are candidates.
    ///
    /// # Safety
    /// That of [`Self::go_on`].
    #[inline(never)]
    unsafe fn edge_block<const KEYS: bool>(&self, pixel: &Pixel, block: usize, candidates: &Range<usize>) {
        // SAFETY: that of this function.
        unsafe {
            let record = self.record(block);
            for half in 0..2 {
                let word = block.wrapping_mul(2).wrapping_add(half);
                let changes = bytes_less(*pixel.enter.add(word), *pixel.leave.add(word));
                let costs = record.add(2 * half);
                *costs = add_even(*costs, changes);
                *costs.add(1) = add_odd(*costs.add(1), changes);
            }
            *record.add(4) = u32::MAX;
            let first = block.wrapping_mul(BLOCK);
            for place in candidates.start.max(first)..candidates.end.min(first.wrapping_add(BLOCK)) {
                let cost = self.at(place);
                let number = if KEYS { cost << 7 | (place as u16).wrapping_add(self.first_place) } else { cost };
                *record.add(4) = least(*record.add(4), u32::from(number) | 0xffff_0000);
                if KEYS {
                    let here = pixel.table.add(place);
                    *here = (*here).min((number ^ TURN as u16) as i16);
                }
            }
        }
    }

    /// Blocks of candidates, from the first one on to the last.
    ///
    /// # Safety
    /// That of [`Self::go_on`]; there is one block at least.
    #[inline(always)]
    unsafe fn key_blocks(&self, pixel: &Pixel, first: usize) {
        // SAFETY: reads the words of a column twice, and reads and writes the records of blocks and the places of a table, from the
        // first block to the last, where the lowest place is 128; the caller has seen that they are there and are aligned. `build.rs`
        // guarantees that the processor has the instructions.
        unsafe {
            asm!(
                "2:",
                "ldrd {a}, {b}, [{enter}], #8",
                "ldrd {x}, {y}, [{leave}], #8",
                "usub8 {a}, {a}, {x}",
                "usub8 {b}, {b}, {y}",
                // Places 0 to 3: costs, then keys in x and y.
                "ldrd {x}, {y}, [{record}]",
                "sxtab16 {x}, {x}, {a}",
                "sxtab16 {y}, {y}, {a}, ror #8",
                "strd {x}, {y}, [{record}], #8",
                "add {x}, {places}, {x}, lsl #7",
                "add {y}, {places}, {y}, lsl #7",
                "add {y}, {y}, #0x00010001",
                // In order, turned, in a and z.
                "pkhbt {a}, {x}, {y}, lsl #16",
                "pkhtb {z}, {y}, {x}, asr #16",
                "eor {a}, {a}, {turn}",
                "eor {z}, {z}, {turn}",
                "usub16 {s}, {x}, {y}",
                "sel {x}, {y}, {x}",
                "ldr {y}, [{table}]",
                "ssub16 {s}, {y}, {a}",
                "sel {y}, {a}, {y}",
                "str {y}, [{table}], #4",
                "ldr {y}, [{table}]",
                "ssub16 {s}, {y}, {z}",
                "sel {y}, {z}, {y}",
                "str {y}, [{table}], #4",
                // Places 4 to 7, with keys in y and z.
                "ldrd {y}, {z}, [{record}]",
                "sxtab16 {y}, {y}, {b}",
                "sxtab16 {z}, {z}, {b}, ror #8",
                "strd {y}, {z}, [{record}], #8",
                "add {places}, {places}, #0x00040004",
                "add {y}, {places}, {y}, lsl #7",
                "add {z}, {places}, {z}, lsl #7",
                "add {z}, {z}, #0x00010001",
                "pkhbt {a}, {y}, {z}, lsl #16",
                "pkhtb {b}, {z}, {y}, asr #16",
                "eor {a}, {a}, {turn}",
                "eor {b}, {b}, {turn}",
                "usub16 {s}, {y}, {z}",
                "sel {y}, {z}, {y}",
                "usub16 {s}, {x}, {y}",
                "sel {x}, {y}, {x}",
                "str {x}, [{record}], #4",
                "ldr {y}, [{table}]",
                "ssub16 {s}, {y}, {a}",
                "sel {y}, {a}, {y}",
                "str {y}, [{table}], #4",
                "ldr {y}, [{table}]",
                "ssub16 {s}, {y}, {b}",
                "sel {y}, {b}, {y}",
                "str {y}, [{table}], #4",
                "add {places}, {places}, #0x00040004",
                "tst {places}, #0x80",
                "beq 2b",
                enter = inout(reg) pixel.enter.add(first).add(first) => _,
                leave = inout(reg) pixel.leave.add(first).add(first) => _,
                record = inout(reg) self.record(first) => _,
                table = inout(reg) pixel.table.add(first.wrapping_mul(BLOCK)) => _,
                // Those of places 0 and 2.
                places = inout(reg) both(self.first_place.wrapping_add(first.wrapping_mul(BLOCK) as u16)).wrapping_add(0x0002_0000) => _,
                turn = in(reg) TURN,
                a = out(reg) _,
                b = out(reg) _,
                x = out(reg) _,
                y = out(reg) _,
                z = out(reg) _,
                s = out(reg) _,
                options(nostack),
            );
        }
    }

    /// As [`Self::key_blocks`], by costs.
    ///
    /// # Safety
    /// That of [`Self::key_blocks`].
    #[inline(always)]
    unsafe fn cost_blocks(&self, pixel: &Pixel, first: usize) {
        // SAFETY: as in `key_blocks`, without a table.
        unsafe {
            asm!(
                "2:",
                "ldrd {a}, {b}, [{enter}], #8",
                "ldrd {x}, {y}, [{leave}], #8",
                "usub8 {a}, {a}, {x}",
                "usub8 {b}, {b}, {y}",
                "ldrd {x}, {y}, [{record}]",
                "sxtab16 {x}, {x}, {a}",
                "sxtab16 {y}, {y}, {a}, ror #8",
                "strd {x}, {y}, [{record}], #8",
                "usub16 {s}, {x}, {y}",
                "sel {x}, {y}, {x}",
                "ldrd {y}, {z}, [{record}]",
                "sxtab16 {y}, {y}, {b}",
                "sxtab16 {z}, {z}, {b}, ror #8",
                "strd {y}, {z}, [{record}], #8",
                "usub16 {s}, {y}, {z}",
                "sel {y}, {z}, {y}",
                "usub16 {s}, {x}, {y}",
                "sel {x}, {y}, {x}",
                "str {x}, [{record}], #4",
                "subs {blocks}, {blocks}, #1",
                "bne 2b",
                enter = inout(reg) pixel.enter.add(first).add(first) => _,
                leave = inout(reg) pixel.leave.add(first).add(first) => _,
                record = inout(reg) self.record(first) => _,
                blocks = inout(reg) self.blocks.wrapping_sub(first) => _,
                a = out(reg) _,
                b = out(reg) _,
                x = out(reg) _,
                y = out(reg) _,
                z = out(reg) _,
                s = out(reg) _,
                options(nostack),
            );
        }
    }

    /// Candidates below the bound, up to [`AMBIGUOUS`] or a few more: costs below `cost` in blocks whose least number is below
    /// `number`.
    ///
    /// # Safety
    /// That of [`Self::go_on`].
    #[inline(always)]
    unsafe fn near(&self, candidates: &Range<usize>, number: u16, cost: u16) -> u16 {
        let (numbers, costs) = (both(number), both(cost));
        // Counts of 16 bits, two side by side: no more than there are places.
        let (mut near, mut block) = (0u32, 0usize);
        while block < self.blocks {
            // SAFETY: that of this function.
            unsafe {
                block = self.next_below(block, numbers);
                if block == self.blocks {
                    break;
                }
                let first = block.wrapping_mul(BLOCK);
                if first >= candidates.start && first.wrapping_add(BLOCK) <= candidates.end {
                    let record = self.record(block);
                    for word in 0..4 {
                        near = near.wrapping_add(below(*record.add(word), costs));
                    }
                } else {
                    let inside = candidates.start.max(first)..candidates.end.min(first.wrapping_add(BLOCK));
                    near = near.wrapping_add(self.below_at_edge(inside, cost));
                }
            }
            if (near & 0xffff) + (near >> 16) >= AMBIGUOUS {
                break;
            }
            block = block.wrapping_add(1);
        }
        ((near & 0xffff) + (near >> 16)) as u16
    }

    /// How many of some places have a cost below `cost`. Only pixels at the ends of a row have blocks of which not all places are
    /// candidates.
    ///
    /// # Safety
    /// That of [`Self::at`].
    #[inline(never)]
    unsafe fn below_at_edge(&self, places: Range<usize>, cost: u16) -> u32 {
        // SAFETY: that of this function.
        places.fold(0u32, |near, place| near.wrapping_add(u32::from(unsafe { self.at(place) } < cost)))
    }

    /// The first candidate of cost `cost`; there is one.
    ///
    /// # Safety
    /// That of [`Self::go_on`].
    #[inline(always)]
    unsafe fn first_of(&self, candidates: Range<usize>, cost: u16) -> usize {
        // SAFETY: that of this function.
        unsafe {
            let holds = |&block: &usize| {
                let least = *self.record(block).add(4);
                least as u16 == cost || (least >> 16) as u16 == cost
            };
            let block = (0..self.blocks).find(holds).unwrap_or(0);
            let places = candidates.start.max(block.wrapping_mul(BLOCK))..candidates.end;
            places.clone().find(|&place| self.at(place) == cost).unwrap_or(places.start)
        }
    }

    /// The cost of a place; any number for the one behind the last.
    ///
    /// # Safety
    /// That of [`Self::go_on`], and that the place is not beyond that.
    #[inline(always)]
    unsafe fn at(&self, place: usize) -> u16 {
        // SAFETY: the table has a number for each place and the one behind the last, for which `new` has seen room.
        unsafe { *self.records.cast::<u16>().add(usize::from(*HALVES.as_ptr().add(place))) }
    }
}

/// For each place, and the one behind the last, which 16-bit number of the records holds its cost.
static HALVES: [u16; MOST_PLACES + 1] = {
    let mut halves = [0; MOST_PLACES + 1];
    let mut place = 0;
    while place < halves.len() {
        // Of each four the middle ones are exchanged.
        let half = place & 4 | (place & 1) << 1 | place >> 1 & 1;
        halves[place] = (2 * RECORD * (place / BLOCK) + half) as u16;
        place += 1;
    }
    halves
};
