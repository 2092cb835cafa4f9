//! Steps of the matcher in plain Rust, which are compiled for the backend.

use super::{
    MatchSettings, best::RightBest, columns::Columns, plan::Plan, rows::Evidence, rows::Rows, rows::ValidSpan,
};
use crate::{
    arch::{self, Decide, Found, Search, Steps, Sums},
    disparity::DisparityPixel,
};

/// Takes a row of the pair and filters the one that is complete with it.
pub(super) struct PushRow<'a, const WIDTH: usize> {
    pub(super) rows: &'a mut Rows<WIDTH>,
    pub(super) pictures: [&'a [u8]; 2],
    pub(super) spans: [ValidSpan; 2],
    pub(super) settings: &'a MatchSettings,
    pub(super) split_codes: bool,
}

impl<const WIDTH: usize> Steps for PushRow<'_, WIDTH> {
    #[inline(always)]
    fn run(self) {
        let ([left, right], [left_span, right_span]) = (self.pictures, self.spans);
        self.rows.push(left, right, left_span, right_span, self.settings, self.split_codes);
    }
}

/// Lets a row into the sums of evidence and another one out.
pub(super) struct SlideEvidence<'a, const WIDTH: usize, const DISPARITIES: usize> {
    pub(super) columns: &'a mut Columns<WIDTH, DISPARITIES>,
    pub(super) enter: Evidence<'a>,
    pub(super) leave: Option<Evidence<'a>>,
}

impl<const WIDTH: usize, const DISPARITIES: usize> Steps for SlideEvidence<'_, WIDTH, DISPARITIES> {
    #[inline(always)]
    fn run(self) {
        self.columns.slide_evidence(self.enter, self.leave);
    }
}

/// Sums the evidence under the windows of a chunk, and says where the texture is weak.
pub(super) struct SumEvidence<'a> {
    pub(super) search: &'a Search,
    /// Sums of evidence of all columns.
    pub(super) evidence: &'a [u32],
    pub(super) weak_texture: u32,
    pub(super) sums: &'a mut Sums,
    pub(super) found: &'a mut Found,
}

impl Steps for SumEvidence<'_> {
    #[inline(always)]
    fn run(self) {
        self.sums.make(self.search, self.evidence);
        self.sums.weak(self.weak_texture, &mut self.found.weak);
    }
}

/// Decides on the pixels of a chunk.
pub(super) struct DecidePixels<'a> {
    pub(super) decide: &'a Decide,
    pub(super) search: &'a Search,
    pub(super) found: &'a Found,
    pub(super) sums: &'a Sums,
    pub(super) out: &'a mut [DisparityPixel],
    pub(super) weak: &'a mut [bool],
}

impl Steps for DecidePixels<'_> {
    #[inline(always)]
    fn run(self) {
        self.decide.run(self.search, self.found, self.sums, self.out, self.weak);
    }
}

/// Takes out pixels whose right partner matches another left pixel better.
pub(super) struct CheckBack<'a, const WIDTH: usize> {
    pub(super) right: &'a mut RightBest<WIDTH>,
    pub(super) plan: &'a Plan,
    pub(super) tolerance: u16,
    /// Column of the first pixel of `out`.
    pub(super) first: usize,
    pub(super) out: &'a mut [DisparityPixel],
}

impl<const WIDTH: usize> Steps for CheckBack<'_, WIDTH> {
    #[inline(always)]
    fn run(self) {
        arch::back_check(self.tolerance, self.first, self.out, self.right.disparities(self.plan));
    }
}
