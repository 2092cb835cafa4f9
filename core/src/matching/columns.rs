//! Sums over the height of the window, for each column and disparity.

use super::rows::Evidence;
use crate::arch::{self, Chosen, CodeRow, SlideCodes};

/// For each column of the left picture, the sums over the rows under the window: differences for each disparity
/// (largest disparity first, so that the right pixels lie in the order of memory), texture, saturated pixels.
pub(super) struct Columns<const WIDTH: usize, const DISPARITIES: usize> {
    costs: Costs<WIDTH, DISPARITIES>,
    /// Texture and saturated pixels; see [`arch::evidence`].
    evidence: [u32; WIDTH],
}

/// Sums of Hamming distances fit bytes and are kept closely, `stride` of them for each column; sums of absolute differences take
/// 16 bits each. Aligned, so that a vector never lies in two lines of the cache.
#[repr(align(64))]
struct Costs<const WIDTH: usize, const DISPARITIES: usize>([[[u8; 2]; DISPARITIES]; WIDTH]);

impl<const WIDTH: usize, const DISPARITIES: usize> Columns<WIDTH, DISPARITIES> {
    pub(super) const fn new() -> Self {
        Self { costs: Costs([[[0; 2]; DISPARITIES]; WIDTH]), evidence: [0; WIDTH] }
    }

    pub(super) fn begin(&mut self) {
        self.costs.0.as_flattened_mut().as_flattened_mut().fill(0);
        self.evidence.fill(0);
    }

    /// Sums of Hamming distances.
    pub(super) const fn bytes(&self) -> &[u8] {
        self.costs.0.as_flattened().as_flattened()
    }

    /// Sums of absolute differences.
    pub(super) const fn words(&self) -> &[[u8; 2]] {
        self.costs.0.as_flattened()
    }

    pub(super) const fn evidence(&self) -> &[u32] {
        &self.evidence
    }

    /// Lets row `enter` of the evidence in and row `leave` out.
    ///
    /// # Bound
    /// `width` steps.
    #[inline(always)]
    pub(super) fn slide_evidence(&mut self, enter: Evidence<'_>, leave: Option<Evidence<'_>>) {
        enter.add_to(&mut self.evidence, u32::wrapping_add);
        if let Some(leave) = leave {
            leave.add_to(&mut self.evidence, u32::wrapping_sub);
        }
    }

    /// Lets a row of census codes in and another one out.
    ///
    /// # Bound
    /// `width x disparities` steps.
    pub(super) fn slide_codes(
        &mut self,
        chosen: Chosen,
        stride: usize,
        [disparities, min_disparity]: [usize; 2],
        enter: CodeRow<'_>,
        leave: Option<CodeRow<'_>>,
    ) {
        let columns = self.costs.0.as_flattened_mut().as_flattened_mut();
        arch::slide_codes(chosen, SlideCodes { columns, stride, disparities, min_disparity, enter, leave });
    }

    /// Lets a filtered row in and another one out.
    ///
    /// # Bound
    /// `width x disparities` steps.
    pub(super) fn slide_grey(
        &mut self,
        [disparities, min_disparity]: [usize; 2],
        enter: (&[u8], &[u8]),
        leave: Option<(&[u8], &[u8])>,
    ) {
        arch::slide_grey(self.costs.0.as_flattened_mut(), disparities, min_disparity, enter, leave);
    }
}
