//! What becomes of the pixels that were searched for.

use super::jobs::{CHUNK, Found, Search};
use crate::disparity::{DisparityPixel, Reason};

/// What is known of the windows around the pixels of a chunk beside their costs: sums of [`evidence`].
#[derive(Clone, Debug)]
pub(crate) struct Sums([u32; CHUNK]);

/// Bits of the texture in a sum; the number of saturated pixels lies above them. 63 x 21 responses of at most 127 fit.
const TEXTURE_BITS: u32 = 20;

/// What a pixel adds to a sum: a response of at most 127, and whether it is saturated.
#[inline(always)]
pub(crate) const fn evidence(response: u8, saturated: bool) -> u32 {
    response as u32 | (saturated as u32) << TEXTURE_BITS
}

impl Sums {
    pub(crate) const fn new() -> Self {
        Self([0; CHUNK])
    }

    /// Sums the columns under the window around each pixel of the search.
    ///
    /// # Bound
    /// A step for each pixel, and for each column of the first window.
    #[inline(always)]
    pub(crate) fn make(&mut self, search: &Search, columns: &[u32]) {
        let before = search.leaving(search.range.start);
        let leaving = columns.get(before..).unwrap_or_default();
        let entering = columns.get(search.entering(search.range.start)..).unwrap_or_default();
        let mut sum = leaving
            .iter()
            .take(search.radius.saturating_mul(2).saturating_add(1))
            .fold(0u32, |sum, &column| sum.wrapping_add(column));
        // What changes first, many at a time, so that only one addition waits for the one before.
        let sums = self.0.get_mut(..search.range.len()).unwrap_or_default();
        for ((out, &enter), &leave) in sums.iter_mut().zip(entering).zip(leaving) {
            *out = enter.wrapping_sub(leave);
        }
        for out in sums {
            sum = sum.wrapping_add(*out);
            *out = sum;
        }
    }

    /// 1 for each pixel whose texture is below the limit, 0 for the others.
    ///
    /// # Bound
    /// A step for each pixel.
    #[inline(always)]
    pub(crate) fn weak(&self, weak_texture: u32, weak: &mut [u8; CHUNK]) {
        for (weak, &sum) in weak.iter_mut().zip(&self.0) {
            *weak = u8::from(texture(sum) < weak_texture);
        }
    }
}

#[inline(always)]
const fn texture(sum: u32) -> u32 {
    sum & ((1 << TEXTURE_BITS) - 1)
}

/// The limits that decide.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decide {
    pub(crate) min_texture: u32,
    pub(crate) max_saturated: u32,
    /// Below this texture a pixel that was not told apart is weak.
    pub(crate) weak_texture: u32,
    /// Only the pixels that are weak are decided on, and stay weak.
    pub(crate) only_weak: bool,
    /// Whether ambiguous places are refused: where there is texture, and where it is weak.
    pub(crate) unique: [bool; 2],
    /// Whether keys were found, or costs.
    pub(crate) keys: bool,
}

impl Decide {
    /// Writes the pixels of the chunk to `out` and which of them are weak to `weak`. Pixels without candidates keep what they
    /// are.
    ///
    /// Every pixel takes the same steps, whatever becomes of it: branches would be guessed wrong too often, and the compiler
    /// makes vectors of it.
    ///
    /// # Bound
    /// A fixed number of steps for each pixel.
    #[inline(always)]
    pub(crate) fn run(
        &self,
        search: &Search,
        found: &Found,
        sums: &Sums,
        out: &mut [DisparityPixel],
        weak: &mut [bool],
    ) {
        // All numbers have 16 bits: disparities are below 2048, and nothing that lies farther off than that makes a difference.
        let near = |place: usize, from: usize| (place as i32).wrapping_sub(from as i32).clamp(-FAR, FAR) as i16;
        let top = search.top() as i16;
        let min_disparity = search.min_disparity as i16;
        let [largest_first, smallest_first] = [
            near(search.range.start, search.right_first),
            near(search.range.start.saturating_add(1), search.right_end),
        ];
        let none = |reason: Reason| DisparityPixel::none(reason).bits();
        let (mut decided, mut untold) = ([[0u16; PART]; CHUNK / PART], [[0u8; PART]; CHUNK / PART]);
        // Runs of weak pixels are short: no more parts of the chunk than there are pixels in.
        let parts = search.range.len().saturating_add(PART - 1) / PART;
        for (number, (decided, untold)) in (0..parts).zip(decided.iter_mut().zip(&mut untold)) {
            let [farther, best, nearer] = [&found.farther, &found.best, &found.nearer].map(|all| part(all, number));
            let [near, place] = [&found.near, &found.place].map(|all| part(all, number));
            let (above, weak) = (part(&found.above, number), part(&found.weak, number));
            let offsets = self.offsets(search, [farther, best, nearer]);
            let flags = self.flags(part(&sums.0, number));
            let first = number.wrapping_mul(PART) as i16;
            // Arrays of one length and one step for each pixel: this becomes vector instructions.
            for i in 0..PART {
                let largest = top.min(largest_first.wrapping_add(first).wrapping_add(i as i16));
                let smallest = min_disparity.max(smallest_first.wrapping_add(first).wrapping_add(i as i16));
                // The two places beside the best one do not count.
                let beside = 1 + u16::from(nearer[i] < above[i]) + u16::from(farther[i] < above[i]);
                let weak_here = weak[i] != 0;
                let unique = if weak_here { self.unique[1] } else { self.unique[0] };
                let ambiguous = unique & (near[i] > beside);
                let disparity = top.wrapping_sub(place[i] as i16);
                let steps = disparity.wrapping_mul(16).wrapping_add(offsets[i]).max(0);
                // As `DisparityPixel::from_steps`; steps are below 32768 because disparities are below 2048.
                let bits = if steps == 0 { none(Reason::OutOfRange) } else { steps as u16 };
                let bits = if ambiguous { none(Reason::NotUnique) } else { bits };
                // At an end of the range the true minimum may lie beyond, and there is no neighbour to interpolate with.
                let at_end = (disparity >= largest) | (disparity <= smallest);
                let bits = if at_end { none(Reason::OutOfRange) } else { bits };
                let bits = if flags[i] & LOW_TEXTURE != 0 { none(Reason::LowTexture) } else { bits };
                let bits = if flags[i] & SATURATED != 0 { none(Reason::Saturated) } else { bits };
                let told_apart = (bits != none(Reason::LowTexture)) & (bits != none(Reason::NotUnique));
                untold[i] = u8::from(!told_apart & weak_here);
                decided[i] = if largest < smallest { 0 } else { bits };
            }
        }
        let (decided, untold) = (decided.as_flattened(), untold.as_flattened());
        if search.right_first >= search.right_end {
            return;
        }
        for ((out, weak), (&decided, &untold)) in out.iter_mut().zip(weak).zip(decided.iter().zip(untold)) {
            let takes = (decided != 0) & (*weak | !self.only_weak);
            *out = if takes { DisparityPixel::from_bits(decided) } else { *out };
            *weak = if self.only_weak { *weak } else { takes & (untold != 0) };
        }
    }

    /// How far from the best place the least cost lies, 1/16 px.
    #[inline(always)]
    fn offsets(&self, search: &Search, [farther, best, nearer]: [&[i16; PART]; 3]) -> [i16; PART] {
        let shift = if self.keys { 7 } else { 0 };
        let cost = |number: i16| number.wrapping_sub(i16::MIN) as u16 >> shift;
        let mut offsets = [0; PART];
        let all = offsets.iter_mut().zip(farther).zip(best).zip(nearer);
        if self.keys | search.is_small {
            // What stands where there is no cost is larger, and does not matter.
            let small = |number: i16| cost(number).min(MOST_SMALL) as i16;
            for (((offset, &farther), &best), &nearer) in all {
                *offset = refine_small(small(farther), small(best), small(nearer));
            }
        } else {
            let wide = |number: i16| i32::from(cost(number));
            for (((offset, &farther), &best), &nearer) in all {
                *offset = refine(wide(farther), wide(best), wide(nearer)) as i16;
            }
        }
        offsets
    }

    /// [`LOW_TEXTURE`] and [`SATURATED`] of each pixel.
    #[inline(always)]
    fn flags(&self, sums: &[u32; PART]) -> [u8; PART] {
        let mut flags = [0; PART];
        for (flags, &sum) in flags.iter_mut().zip(sums) {
            let low = u8::from(texture(sum) < self.min_texture);
            let saturated = u8::from(sum >> TEXTURE_BITS > self.max_saturated);
            *flags = (low * LOW_TEXTURE) | (saturated * SATURATED);
        }
        flags
    }
}

/// Pixels that are decided on together.
const PART: usize = 16;

/// One of the parts of a chunk.
#[inline(always)]
fn part<T>(all: &[T; CHUNK], number: usize) -> &[T; PART] {
    &all.as_chunks().0[number % (CHUNK / PART)]
}

const LOW_TEXTURE: u8 = 1;
const SATURATED: u8 = 2;

/// Pixels that are as far off as no disparity is.
const FAR: i32 = 16_384;

/// The largest cost that [`refine_small`] takes.
const MOST_SMALL: u16 = 2047;

/// A right pixel that nothing was offered to: farther from any disparity than a check back allows.
pub(crate) const NO_PARTNER: i16 = i16::MAX;

/// Takes out pixels whose right partner matches another left pixel better. `out` begins at pixel `first`; `right` says for each
/// right pixel at which disparity it matches best.
///
/// # Bound
/// A fixed number of steps for each pixel.
#[inline(always)]
pub(crate) fn back_check(tolerance: u16, first: usize, out: &mut [DisparityPixel], right: &[i16]) {
    let mismatch = DisparityPixel::none(Reason::LeftRightMismatch).bits();
    let end = first.saturating_add(out.len());
    for (start, out) in (first..end).step_by(CHUNK).zip(out.chunks_mut(CHUNK)) {
        let (mut disparities, mut back) = ([0u16; CHUNK], [0i16; CHUNK]);
        for (disparity, pixel) in disparities.iter_mut().zip(&*out) {
            // Rounding to the nearest pixel may be one off the place that was chosen: half a pixel is shared.
            *disparity = ((pixel.bits() & 0x7fff) + 8) >> 4;
        }
        // What is told here of pixels without a disparity does not matter.
        for ((back, &disparity), x) in back.iter_mut().zip(&disparities).zip(start..start.saturating_add(CHUNK)) {
            *back = right.get(x.wrapping_sub(usize::from(disparity))).copied().unwrap_or(NO_PARTNER);
        }
        for (pixel, (&disparity, &back)) in out.iter_mut().zip(disparities.iter().zip(&back)) {
            let away = disparity.abs_diff(back as u16);
            let refused = pixel.has_value() & (away > tolerance);
            *pixel = DisparityPixel::from_bits(if refused { mismatch } else { pixel.bits() });
        }
    }
}

/// Where between its neighbours the least cost lies, 1/16 px towards the nearer one: two lines of the same slope.
///
/// The quotient is at most 8, so four steps of a division by hand find it: vectors have no integer division.
macro_rules! refine {
    ($name:ident, $number:ty, $what:literal) => {
        #[doc = $what]
        #[inline(always)]
        pub(crate) fn $name(farther: $number, best: $number, nearer: $number) -> $number {
            // What is made of costs fits their number.
            let slope = farther.max(nearer).wrapping_sub(best);
            let difference = farther.wrapping_sub(nearer);
            // Rounds to the nearest, halves away from zero.
            let mut rest = difference.wrapping_abs().wrapping_mul(8).wrapping_add(slope / 2);
            let mut quotient = 0;
            for bit in [8, 4, 2, 1] {
                let times = slope.wrapping_mul(bit);
                let fits = rest >= times;
                rest = rest.wrapping_sub(if fits { times } else { 0 });
                quotient |= if fits { bit } else { 0 };
            }
            let quotient = if slope <= 0 { 0 } else { quotient };
            if difference < 0 { quotient.wrapping_neg() } else { quotient }
        }
    };
}

refine!(refine, i32, "Where the least cost lies, of costs of 16 bits.");
refine!(refine_small, i16, "Where the least cost lies, of costs up to 2047: twice as many of them fit a vector.");

#[cfg(test)]
mod tests {
    use super::{MOST_SMALL, refine, refine_small};

    /// As it is written down in integers.
    fn in_integers(farther: i64, best: i64, nearer: i64) -> i64 {
        let slope = farther.max(nearer) - best;
        let scaled = 8 * (farther - nearer);
        if slope == 0 { 0 } else { (scaled + scaled.signum() * (slope / 2)) / slope }
    }

    #[test]
    fn the_quotient_is_that_of_integers() {
        let check = |farther: i32, best: i32, nearer: i32| {
            let expected = in_integers(i64::from(farther), i64::from(best), i64::from(nearer));
            let found = refine(farther, best, nearer);
            assert_eq!(i64::from(found), expected, "{farther} {best} {nearer}");
            let most = i32::from(MOST_SMALL);
            if farther.max(nearer) <= most {
                let small = refine_small(farther as i16, best as i16, nearer as i16);
                assert_eq!(i64::from(small), expected, "{farther} {best} {nearer}");
            }
        };
        // A best cost of 0 loses nothing: only differences count.
        for farther in 0..512 {
            for nearer in 0..512 {
                check(farther, 0, nearer);
            }
        }
        for farther in (0..=2047).step_by(13).chain([2047]) {
            for nearer in (0..=2047).step_by(11).chain([2047]) {
                check(farther, farther.min(nearer) / 3, nearer);
                check(farther, farther.min(nearer), nearer);
            }
        }
        for farther in (0..=65535).step_by(97).chain(65400..=65535) {
            for nearer in (0..=65535).step_by(89).chain(65450..=65535) {
                check(farther, 0, nearer);
                check(farther, farther.min(nearer) / 3, nearer);
            }
        }
    }
}
