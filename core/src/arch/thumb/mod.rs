//! Arm's instructions for signal processing, four bytes or two 16-bit numbers in a register: Cortex-M4 and M7, and ARMv7 at large.
//!
//! Which processor has them the compiler knows (`build.rs`); nothing is asked at run time. Vectors of four bytes would be too short
//! for the common algorithm, whose costs at each vector are those of a whole one: these loops are made for their registers.
//!
//! Four neighbouring places of a column are a word. Widened they are two words, of places 0 and 2 and of places 1 and 3, because
//! that is what the instructions make of it; sums under the window are kept so.
//!
//! | step, for four disparities | instructions |
//! | --- | --- |
//! | a row into and out of the column sums | 21, of which 4 are loads and stores |
//! | sums under the window | 7 |
//! | keys, and the least of them | 8 |
//! | best left partner of each right pixel | 12 |

mod search;
mod slide;
mod words;

use super::{
    jobs::{Found, KeyLimits, Right, Search, SlideCodes},
    plain,
};

/// Places that are worked on at a time: what is no multiple of it is left to plain Rust.
const BLOCK: usize = 8;

/// Lets a row of codes in and another one out.
pub(super) fn slide_codes(job: SlideCodes<'_>) {
    if fits(job.stride, job.disparities) { slide::slide_codes(job) } else { plain::slide_codes(job) }
}

/// Searches by keys.
pub(super) fn search_keys(
    search: &Search,
    limits: &KeyLimits,
    columns: &[u8],
    work: &mut [i16],
    right: Right<'_>,
    found: &mut Found,
) {
    if fits(search.stride, search.disparities) {
        search::search_keys(search, limits, columns, work, right, found);
    } else {
        plain::search_keys(search, limits, columns, work, right, found);
    }
}

/// Searches by costs; where costs are large or the right pixels are asked, in plain Rust.
pub(super) fn search_costs(
    search: &Search,
    columns: &[u8],
    work: &mut [i16],
    right: Option<Right<'_>>,
    found: &mut Found,
) {
    if fits(search.stride, search.disparities) && search.is_small && right.is_none() {
        search::search_costs(search, columns, work, found);
    } else {
        plain::search_costs(search, columns, work, right, found);
    }
}

/// Whether columns are made of whole blocks.
const fn fits(stride: usize, disparities: usize) -> bool {
    stride == disparities && disparities.is_multiple_of(BLOCK) && disparities <= 128
}
