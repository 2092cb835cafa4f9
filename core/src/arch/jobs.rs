//! What is handed to a backend.

use core::ops::Range;

/// Pixels that are searched for at a time.
pub(crate) const CHUNK: usize = 64;

/// Room in front of the sums of the pixel at hand, so that both neighbours of any place can be read; as much is needed behind.
pub(crate) const PAD: usize = 16;

/// A row of census codes of both pictures.
#[derive(Clone, Copy)]
pub(crate) struct CodeRow<'a> {
    pub(crate) left: &'a [u8],
    /// Right codes, or their lower four bits where the backend splits them; pixel `x` at `lead + x`.
    pub(crate) low: &'a [u8],
    /// Upper four bits, where the backend splits codes; pixel `x` at `lead + x`.
    #[cfg_attr(
        not(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"))),
        expect(dead_code, reason = "plain Rust does not split codes")
    )]
    pub(crate) high: &'a [u8],
    /// Bytes in front of the first pixel that may be read and mean nothing.
    pub(crate) lead: usize,
}

/// Sums over the rows of a window: `stride` of them for each column, the largest disparity first.
pub(crate) struct SlideCodes<'a> {
    pub(crate) columns: &'a mut [u8],
    pub(crate) stride: usize,
    pub(crate) disparities: usize,
    pub(crate) min_disparity: usize,
    pub(crate) enter: CodeRow<'a>,
    pub(crate) leave: Option<CodeRow<'a>>,
}

/// What is searched for: the pixels `range` of a row.
///
/// Place `e` of a column or of the sums under a window belongs to disparity `min_disparity + disparities - 1 - e`.
#[derive(Clone, Debug)]
pub(crate) struct Search {
    pub(crate) range: Range<usize>,
    /// Whether the sums under the window are those of the pixel before, or are to be made afresh.
    pub(crate) follows: bool,
    /// Half the width of the window.
    pub(crate) radius: usize,
    pub(crate) stride: usize,
    pub(crate) disparities: usize,
    pub(crate) min_disparity: usize,
    /// Right pixels on which a window may stand.
    pub(crate) right_first: usize,
    pub(crate) right_end: usize,
    /// How much better than any other a place must be: where there is texture, and where it is weak.
    pub(crate) uniqueness_percent: [u16; 2],
    /// Whether no cost is above 2040 and no sum of a column above 127.
    pub(crate) is_small: bool,
}

/// For each right pixel the best left partner: two tables, right pixel `x` at `lead + x`.
///
/// With keys both tables hold keys whose place is counted from the smallest disparity, made of every other left pixel each;
/// without, costs less 32768 and disparities. `i16::MAX` is nothing.
pub(crate) struct Right<'a> {
    pub(crate) tables: [&'a mut [i16]; 2],
    pub(crate) lead: usize,
}

/// A search by keys of cost and place: for costs below 512 and places below 128.
pub(crate) struct KeyJob<'a> {
    pub(crate) search: &'a Search,
    pub(crate) limits: &'a KeyLimits,
    /// Sums over the rows of the window.
    pub(crate) columns: &'a [u8],
    /// Keys of the pixel at hand, from [`PAD`] on; those of the last one are still needed where the next job follows it.
    pub(crate) work: &'a mut [i16],
    pub(crate) right: Right<'a>,
    pub(crate) found: &'a mut Found,
}

/// A search by costs, for sums whose window sums fit 16 bits.
pub(crate) struct CostJob<'a, Sum> {
    pub(crate) search: &'a Search,
    /// Sums over the rows of the window.
    pub(crate) columns: &'a [Sum],
    /// Costs of the pixel at hand less 32768, from [`PAD`] on; as with keys.
    pub(crate) work: &'a mut [i16],
    /// `None` where the right pixels are not asked.
    pub(crate) right: Option<Right<'a>>,
    pub(crate) found: &'a mut Found,
}

/// The best place of each pixel that was searched for, and what is beside it. Nothing is said of pixels without candidates.
/// Which of them have weak texture is told before the search.
///
/// Numbers are as the search has them: keys, or costs less 32768. What they mean is worked out for many pixels at a time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Found {
    /// 1 where the texture is weak, 0 elsewhere.
    pub(crate) weak: [u8; CHUNK],
    /// The least one.
    pub(crate) best: [i16; CHUNK],
    /// Its place, the first one of several.
    pub(crate) place: [u16; CHUNK],
    /// One place farther on: at one disparity less.
    pub(crate) farther: [i16; CHUNK],
    pub(crate) nearer: [i16; CHUNK],
    /// The least number that is not nearly as good as the best one.
    pub(crate) above: [i16; CHUNK],
    /// Candidates below that, the best one included.
    pub(crate) near: [u16; CHUNK],
}

impl Found {
    pub(crate) const fn new() -> Self {
        let (numbers, counts) = ([0; CHUNK], [0; CHUNK]);
        Self {
            weak: [0; CHUNK],
            best: numbers,
            place: counts,
            farther: numbers,
            nearer: numbers,
            above: numbers,
            near: counts,
        }
    }

    /// 1 if the texture is weak at pixel `i` of the chunk.
    #[inline(always)]
    pub(crate) fn weak(&self, i: usize) -> usize {
        usize::from(self.weak[i % CHUNK] & 1)
    }

    /// Writes down what was found of pixel `i` of the chunk.
    #[inline(always)]
    pub(crate) fn put(&mut self, i: usize, place: usize, [nearer, best, farther]: [i16; 3], near: u16, above: i16) {
        let i = i % CHUNK;
        self.best[i] = best;
        self.place[i] = place as u16;
        self.farther[i] = farther;
        self.nearer[i] = nearer;
        self.above[i] = above;
        self.near[i] = near;
    }
}

/// For each cost below 512 the least key that is not nearly as good: where there is texture, and where it is weak.
#[derive(Clone, Debug)]
pub(crate) struct KeyLimits([[i16; KEY_COSTS]; 2]);

/// Costs that a key has room for. The largest one is that of no candidate.
pub(crate) const KEY_COSTS: usize = 512;

impl KeyLimits {
    pub(crate) const fn new() -> Self {
        Self([[0; KEY_COSTS]; 2])
    }

    pub(crate) fn fill(&mut self, uniqueness_percent: [u16; 2]) {
        for (limits, percent) in self.0.iter_mut().zip(uniqueness_percent) {
            for (cost, above) in (0..).zip(limits) {
                // Costs reach 510 at most.
                *above = (((limit(cost, percent).min(510) + 1) << 7) as u16 as i16).wrapping_add(i16::MIN);
            }
        }
    }

    /// The least key that is not nearly as good as `key`; `weak` is that of [`Found::weak`].
    #[inline(always)]
    pub(crate) fn above(&self, key: i16, weak: usize) -> i16 {
        self.0[weak & 1][usize::from(key.wrapping_sub(i16::MIN) as u16 >> 7)]
    }
}

/// The largest cost that is nearly as good as `cost`. No sum under a window exceeds 16 bits.
#[inline(always)]
fn limit(cost: u16, uniqueness_percent: u16) -> u32 {
    u32::from(cost).saturating_mul(100 + u32::from(uniqueness_percent)) / 100
}

impl Search {
    /// The disparity of place 0, the largest one.
    #[inline(always)]
    pub(crate) const fn top(&self) -> usize {
        self.min_disparity.saturating_add(self.disparities).saturating_sub(1)
    }

    /// Columns under the window of the pixel before the first.
    #[inline(always)]
    pub(crate) fn window_before(&self) -> Range<usize> {
        self.leaving(self.range.start)..self.entering(self.range.start)
    }

    /// The column that enters the window at left pixel `x`.
    #[inline(always)]
    pub(crate) const fn entering(&self, x: usize) -> usize {
        x.saturating_add(self.radius)
    }

    /// The column that leaves the window at left pixel `x`.
    #[inline(always)]
    pub(crate) const fn leaving(&self, x: usize) -> usize {
        x.saturating_sub(self.radius).saturating_sub(1)
    }

    /// The number of left pixel `x` in the chunk.
    #[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
    #[inline(always)]
    pub(crate) const fn nth(&self, x: usize) -> usize {
        x.wrapping_sub(self.range.start)
    }

    /// Places whose right window lies within the right picture, for left pixel `x`.
    #[inline(always)]
    pub(crate) fn candidates(&self, x: usize) -> Range<usize> {
        let top = self.top();
        let Some(reach) = x.checked_sub(self.right_first) else { return 0..0 };
        let largest = top.min(reach);
        let smallest = self.min_disparity.max(x.saturating_add(1).saturating_sub(self.right_end));
        if largest < smallest || self.right_first >= self.right_end {
            return 0..0;
        }
        // Neither is above the top.
        top.wrapping_sub(largest)..top.wrapping_sub(smallest).wrapping_add(1)
    }

    /// Pixels that have all candidates, within `range`.
    #[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"), dsp))]
    pub(crate) fn inner(&self) -> Range<usize> {
        let Range { start, end } = self.range;
        let first = self.right_first.saturating_add(self.top()).max(start).min(end);
        let some = self.right_first < self.right_end;
        let last = if some { self.right_end.saturating_add(self.min_disparity) } else { 0 };
        first..last.max(first).min(end)
    }

    /// The least number, a cost less 32768, that is not nearly as good as `best`; `weak` is that of [`Found::weak`].
    #[inline(always)]
    pub(crate) fn above(&self, best: i16, weak: usize) -> i16 {
        let percent = self.uniqueness_percent[weak & 1];
        let limit = limit(best.wrapping_sub(i16::MIN) as u16, percent).min(u32::from(u16::MAX) - 1);
        (limit as u16 as i16).wrapping_sub(i16::MAX)
    }
}
