//! For each pixel of the right row the best partner in the left one.

use super::plan::Plan;
use crate::arch::{NO_PARTNER, Right};

/// Two tables for the backends; see [`Right`].
///
/// A left pixel touches `stride` places of a table, the next one those beside them. With keys each of the two tables serves every
/// other pixel, so that the processor is done with writing what it is to read.
pub(super) struct RightBest<const WIDTH: usize> {
    /// Room for two tables of half as many pixels more than the width: what a backend may touch beyond the row.
    tables: [[i16; 3]; WIDTH],
}

impl<const WIDTH: usize> RightBest<WIDTH> {
    pub(super) const fn new() -> Self {
        Self { tables: [[0; 3]; WIDTH] }
    }

    pub(super) fn begin(&mut self) {
        self.tables.as_flattened_mut().fill(i16::MAX);
    }

    pub(super) fn lend(&mut self, lead: usize) -> Right<'_> {
        let (first, second) = self.tables.as_flattened_mut().split_at_mut(WIDTH + WIDTH / 2);
        Right { tables: [first, second], lead }
    }

    /// Disparity of the cheapest partner of each right pixel, or [`NO_PARTNER`]. The tables are used up by that.
    ///
    /// # Bound
    /// One step for each pixel.
    #[inline(always)]
    pub(super) fn disparities(&mut self, plan: &Plan) -> &[i16] {
        let [first, second] = self.lend(plan.lead).tables;
        if plan.keys {
            for (second, &first) in second.iter_mut().zip(&*first) {
                let key = first.min(*second);
                // No cost is 511.
                let told = (key as u16 & 0x7f).wrapping_add(plan.key_disparity);
                *second = if key < 0x7f80 { told as i16 } else { NO_PARTNER };
            }
        }
        second.get(plan.lead..).unwrap_or_default()
    }
}
