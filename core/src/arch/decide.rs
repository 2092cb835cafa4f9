//! What becomes of the pixels that were searched for.

use super::jobs::{AMBIGUOUS, CHUNK, Found, Search};
use crate::disparity::{DisparityPixel, Reason};

/// What is known of the windows around the pixels of a chunk beside their costs.
#[derive(Clone, Debug)]
pub(crate) struct Sums {
    /// Prefilter responses under the window.
    pub(crate) texture: [u32; CHUNK],
    /// Saturated pixels under the window.
    pub(crate) saturated: [u32; CHUNK],
}

impl Sums {
    pub(crate) const fn new() -> Self {
        Self { texture: [0; CHUNK], saturated: [0; CHUNK] }
    }

    /// Sums the columns under the window around each pixel of the search.
    ///
    /// # Bound
    /// A step for each pixel, and for each column of the first window.
    pub(crate) fn make(&mut self, search: &Search, texture: &[u16], saturated: &[u16]) {
        for (columns, sums) in [(texture, &mut self.texture), (saturated, &mut self.saturated)] {
            let before = search.range.start.saturating_sub(search.radius + 1);
            let leaving = columns.get(before..).unwrap_or_default();
            let entering = columns.get(search.range.start + search.radius..).unwrap_or_default();
            let mut sum: u32 = leaving.iter().take(2 * search.radius + 1).map(|&sum| u32::from(sum)).sum();
            for ((out, &enter), &leave) in sums.iter_mut().zip(entering).zip(leaving) {
                sum = sum.wrapping_add(u32::from(enter)).wrapping_sub(u32::from(leave));
                *out = sum;
            }
        }
    }
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
    /// Whether ambiguous places are refused.
    pub(crate) unique: bool,
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
        let top = (search.min_disparity + search.disparities - 1) as i32;
        let (min_disparity, right_first, right_end) =
            (search.min_disparity as i32, search.right_first as i32, search.right_end as i32);
        let none = |reason: Reason| u32::from(DisparityPixel::none(reason).bits());
        let limits = found.cost.iter().zip(&found.place).zip(found.farther.iter().zip(&found.nearer));
        let sums = sums.texture.iter().zip(&sums.saturated);
        let pixels = out.iter_mut().zip(weak);
        let start = search.range.start as i32;
        for ((i, (out, weak)), (((&cost, &place), (&farther, &nearer)), (&texture, &saturated))) in
            (0i32..).zip(pixels).zip(limits.zip(sums))
        {
            let x = start + i;
            let largest = top.min(x - right_first);
            let smallest = min_disparity.max(x + 1 - right_end);
            let ambiguous = (place & AMBIGUOUS != 0) & self.unique;
            let disparity = top - i32::from(place & !AMBIGUOUS);
            let (cost, farther, nearer) = (i32::from(cost), i32::from(farther), i32::from(nearer));
            let steps = (16 * disparity + refine(farther, cost, nearer)).max(0);
            // As `DisparityPixel::from_steps`.
            let valueless = (steps == 0) | (steps >= 0x8000);
            let bits = if valueless { none(Reason::OutOfRange) } else { steps as u32 };
            let bits = if ambiguous { none(Reason::NotUnique) } else { bits };
            // At an end of the range the true minimum may lie beyond, and there is no neighbour to interpolate with.
            let at_end = (disparity >= largest) | (disparity <= smallest);
            let bits = if at_end { none(Reason::OutOfRange) } else { bits };
            let untold = bits == none(Reason::NotUnique);
            let low = texture < self.min_texture;
            let bits = if low { none(Reason::LowTexture) } else { bits };
            let too_bright = saturated > self.max_saturated;
            let bits = if too_bright { none(Reason::Saturated) } else { bits };
            let decided = (largest >= smallest) & (right_first < right_end) & (*weak | !self.only_weak);
            *out = DisparityPixel::from_bits(if decided { bits as u16 } else { out.bits() });
            let now_weak = (texture < self.weak_texture) & (low | untold) & !too_bright;
            *weak = (*weak & self.only_weak) | (decided & now_weak & !self.only_weak);
        }
    }
}

/// Where between its neighbours the least cost lies, 1/16 px towards the nearer one: two lines of the same slope.
///
/// Numerator and denominator are below 2^20, so that the quotient in f32 lies on the same side of every whole number as the true
/// one: cut off, it is the integer quotient, and vectors of f32 can be divided where integers cannot.
#[inline(always)]
pub(crate) fn refine(farther: i32, best: i32, nearer: i32) -> i32 {
    let slope = farther.max(nearer) - best;
    let scaled = 8 * (farther - nearer);
    // Rounds to the nearest, halves away from zero.
    let half = if scaled < 0 { -(slope / 2) } else { slope / 2 };
    let quotient = ((scaled + half) as f32 / slope.max(1) as f32) as i32;
    if slope <= 0 { 0 } else { quotient }
}

#[cfg(test)]
mod tests {
    use super::refine;

    /// As it is written down in integers.
    fn in_integers(farther: i64, best: i64, nearer: i64) -> i64 {
        let slope = farther.max(nearer) - best;
        let scaled = 8 * (farther - nearer);
        if slope == 0 { 0 } else { (scaled + scaled.signum() * (slope / 2)) / slope }
    }

    #[test]
    fn the_quotient_is_that_of_integers() {
        let check = |farther: u32, best: u32, nearer: u32| {
            let expected = in_integers(i64::from(farther), i64::from(best), i64::from(nearer));
            let found = refine(farther as i32, best as i32, nearer as i32);
            assert_eq!(i64::from(found), expected, "{farther} {best} {nearer}");
        };
        // A best cost of 0 loses nothing: only differences count.
        for farther in 0..512 {
            for nearer in 0..512 {
                check(farther, 0, nearer);
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
