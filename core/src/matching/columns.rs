//! Sums over the height of the window, for each column and disparity.

use super::{MatchCost, rows::FilteredRow};

/// For each column of the left picture, the sums over the rows under the window: differences for each disparity
/// (largest disparity first, so that the right pixels lie in the order of memory), texture, saturated pixels.
pub(super) struct Columns<const WIDTH: usize, const DISPARITIES: usize> {
    costs: [[u16; DISPARITIES]; WIDTH],
    texture: [u16; WIDTH],
    saturated: [u16; WIDTH],
}

impl<const WIDTH: usize, const DISPARITIES: usize> Columns<WIDTH, DISPARITIES> {
    pub(super) const fn new() -> Self {
        Self { costs: [[0; DISPARITIES]; WIDTH], texture: [0; WIDTH], saturated: [0; WIDTH] }
    }

    pub(super) fn begin(&mut self) {
        for column in &mut self.costs {
            column.fill(0);
        }
        self.texture.fill(0);
        self.saturated.fill(0);
    }

    pub(super) fn costs(&self, x: usize, disparities: usize) -> &[u16] {
        &self.costs[x][..disparities]
    }

    pub(super) const fn texture(&self, x: usize) -> u16 {
        self.texture[x]
    }

    pub(super) const fn saturated(&self, x: usize) -> u16 {
        self.saturated[x]
    }

    /// Lets row `enter` in and row `leave` out.
    ///
    /// # Bound
    /// `width x disparities` steps.
    pub(super) fn slide(
        &mut self,
        cost: MatchCost,
        enter: FilteredRow<'_>,
        leave: Option<FilteredRow<'_>>,
        disparities: usize,
        min_disparity: usize,
    ) {
        slide_sums(&mut self.texture, enter.texture, leave.map(|row| row.texture));
        slide_sums(&mut self.saturated, enter.saturated, leave.map(|row| row.saturated));
        match cost {
            MatchCost::Census => {
                let difference = |left: u8, right: u8| ones(left ^ right);
                let (enter, leave) = (enter.codes(), leave.map(FilteredRow::codes));
                self.slide_costs(enter, leave, disparities, min_disparity, difference);
            }
            MatchCost::AbsoluteDifferences => {
                let difference = |left: u8, right: u8| left.abs_diff(right);
                let (enter, leave) = (enter.grey(), leave.map(FilteredRow::grey));
                self.slide_costs(enter, leave, disparities, min_disparity, difference);
            }
        }
    }

    fn slide_costs(
        &mut self,
        (enter_left, enter_right): (&[u8], &[u8]),
        leave: Option<(&[u8], &[u8])>,
        disparities: usize,
        min_disparity: usize,
        difference: impl Fn(u8, u8) -> u8 + Copy,
    ) {
        for (x, (column, &left)) in self.costs.iter_mut().zip(enter_left).enumerate() {
            // Place e holds disparity `min + disparities - 1 - e`, whose right pixel is `x + 1 - min - disparities + e`.
            let Some(last) = x.checked_sub(min_disparity) else { continue };
            let first = (last + 1).saturating_sub(disparities);
            let skipped = disparities - (last + 1 - first);
            let column = &mut column[skipped..disparities];
            let right = &enter_right[first..=last];
            match leave {
                Some((leave_left, leave_right)) => {
                    let out = (leave_left[x], &leave_right[first..=last]);
                    slide_column(column, (left, right), out, difference);
                }
                None => enter_column(column, left, right, difference),
            }
        }
    }
}

fn slide_sums(sums: &mut [u16], enter: &[u8], leave: Option<&[u8]>) {
    for (sum, &enter) in sums.iter_mut().zip(enter) {
        *sum = sum.wrapping_add(u16::from(enter));
    }
    for (sum, &leave) in sums.iter_mut().zip(leave.unwrap_or_default()) {
        *sum = sum.wrapping_sub(u16::from(leave));
    }
}

fn enter_column(column: &mut [u16], left: u8, right: &[u8], difference: impl Fn(u8, u8) -> u8) {
    for (sum, &right) in column.iter_mut().zip(right) {
        *sum = sum.wrapping_add(u16::from(difference(left, right)));
    }
}

fn slide_column(
    column: &mut [u16],
    (left, right): (u8, &[u8]),
    (left_out, right_out): (u8, &[u8]),
    difference: impl Fn(u8, u8) -> u8,
) {
    for ((sum, &right), &right_out) in column.iter_mut().zip(right).zip(right_out) {
        // Differences are at most 127, so what a sum changes by fits 8 bits: bytes are half as wide as sums, and twice as many
        // of them are worked on at once.
        let change = difference(left, right).wrapping_sub(difference(left_out, right_out)) as i8;
        *sum = sum.wrapping_add_signed(i16::from(change));
    }
}

/// Number of bits that are set; by halves, because few processors count them in bytes side by side.
const fn ones(bits: u8) -> u8 {
    let pairs = bits.wrapping_sub((bits >> 1) & 0x55);
    let fours = (pairs & 0x33).wrapping_add((pairs >> 2) & 0x33);
    fours.wrapping_add(fours >> 4) & 0x0f
}
