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

use super::{jobs::CostJob, plain};

pub(super) use search::search_keys;
pub(super) use slide::slide_codes;

/// Places that are worked on at a time.
const BLOCK: usize = 8;

/// Places that a key has room for.
const MOST_PLACES: usize = 128;

/// Whether columns of so many disparities can be worked on.
pub(super) const fn takes(disparities: usize) -> bool {
    disparities.is_multiple_of(BLOCK) && disparities <= MOST_PLACES
}

/// Searches by costs; where they are large or the right pixels are asked, in plain Rust.
pub(super) fn search_costs(job: CostJob<'_, u8>) {
    if job.search.is_small && job.right.is_none() {
        search::search_costs(job);
    } else {
        plain::search_costs(job);
    }
}
