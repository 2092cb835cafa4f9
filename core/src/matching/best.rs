//! The best candidate of a pixel, from the left and from the right.

/// Costs are looked through in blocks of this many, so that only one block is searched for the place.
const BLOCK: usize = 16;

/// The smallest cost and its place; the first one where several are equal.
pub(super) struct Best {
    pub(super) cost: u16,
    pub(super) place: usize,
}

impl Best {
    /// Looks through `costs`.
    ///
    /// # Bound
    /// One step for each cost.
    pub(super) fn find(costs: &[u16]) -> Self {
        let mut best = Self { cost: u16::MAX, place: 0 };
        let mut block_start = 0;
        for (i, block) in costs.chunks(BLOCK).enumerate() {
            let smallest = smallest(block);
            if smallest < best.cost {
                best.cost = smallest;
                block_start = i * BLOCK;
            }
        }
        let place = costs.iter().skip(block_start).take(BLOCK).position(|&cost| cost == best.cost);
        best.place = block_start + place.unwrap_or(0);
        best
    }

    /// The smallest cost that is not at the best place or beside it; the largest value if there is none.
    pub(super) fn second(&self, costs: &[u16]) -> u16 {
        let before = costs.get(..self.place.saturating_sub(1)).unwrap_or_default();
        let after = costs.get(self.place + 2..).unwrap_or_default();
        smallest(before).min(smallest(after))
    }
}

fn smallest(costs: &[u16]) -> u16 {
    costs.iter().fold(u16::MAX, |smallest, &cost| smallest.min(cost))
}

/// Moves the best disparity by up to half a pixel towards the better neighbour, in 1/16 px: two lines of equal and opposite
/// slope through the three costs, which suits sums of absolute differences better than a parabola.
///
/// `farther` is the cost at one disparity less, `nearer` at one more.
pub(crate) fn refine(farther: i32, best: i32, nearer: i32) -> i32 {
    let slope = farther.max(nearer) - best;
    if slope <= 0 {
        return 0;
    }
    let scaled = 8 * (farther - nearer);
    // Rounds to the nearest, halves away from zero.
    (scaled + scaled.signum() * (slope / 2)) / slope
}

/// For each pixel of the right row the cheapest left partner.
pub(super) struct RightBest<const WIDTH: usize> {
    cost: [u16; WIDTH],
    disparity: [u16; WIDTH],
}

impl<const WIDTH: usize> RightBest<WIDTH> {
    pub(super) const fn new() -> Self {
        Self { cost: [0; WIDTH], disparity: [0; WIDTH] }
    }

    pub(super) fn begin(&mut self, width: usize) {
        self.cost[..width].fill(u16::MAX);
        self.disparity[..width].fill(u16::MAX);
    }

    /// Offers the costs of one left pixel: the first belongs to right pixel `first` at disparity `largest`, each further
    /// one to the next pixel at one disparity less.
    ///
    /// # Bound
    /// One step for each cost.
    pub(super) fn offer(&mut self, costs: &[u16], first: usize, largest: u16) {
        let best = self.cost.get_mut(first..).unwrap_or_default();
        let disparities = self.disparity.get_mut(first..).unwrap_or_default();
        let mut offered = largest;
        for ((best, disparity), &cost) in best.iter_mut().zip(disparities).zip(costs) {
            let better = cost < *best;
            *best = if better { cost } else { *best };
            *disparity = if better { offered } else { *disparity };
            offered = offered.wrapping_sub(1);
        }
    }

    /// Disparity of the cheapest partner of right pixel `x`, if it has one.
    pub(super) fn disparity(&self, x: usize) -> Option<u16> {
        self.disparity.get(x).copied().filter(|&disparity| disparity != u16::MAX)
    }
}
