//! `report.html`: one file that reads like the paper's Figure 11 and can be opened anywhere.

mod charts;
mod frames;
mod page;
mod tables;

pub use frames::ReportFrame;
pub use page::PageInput;

use crate::error::Failure;

/// Most frames that are shown in full.
const SHOWN: usize = 4;

/// Collects what the report shows of single frames while a run goes on.
#[derive(Debug, Default)]
pub struct Report {
    /// Places of the frames still to be shown, in order.
    targets: Vec<usize>,
    position: usize,
    frames: Vec<ReportFrame>,
}

impl Report {
    /// A report over `count` frames, of which a few are shown, spread evenly; none if the report is not `wanted`.
    pub fn new(wanted: bool, count: usize) -> Self {
        let shown = if wanted { SHOWN.min(count) } else { 0 };
        let spread = |k: usize| if shown > 1 { k * (count - 1) / (shown - 1) } else { 0 };
        Self { targets: (0..shown).map(spread).collect(), position: 0, frames: Vec::new() }
    }

    /// Whether the frame that comes now is to be shown.
    pub fn wants_frame(&self) -> bool {
        self.targets.first().is_some_and(|target| *target <= self.position)
    }

    /// A frame was looked at; `paint` is called if it is to be shown.
    pub fn frame(&mut self, paint: impl FnOnce() -> ReportFrame) {
        if self.wants_frame() {
            self.targets.remove(0);
            self.frames.push(paint());
        }
        self.position += 1;
    }

    /// A frame could not be used: the next good one takes its place.
    pub const fn skipped(&mut self) {
        self.position += 1;
    }

    /// The page.
    ///
    /// # Errors
    /// When the template does not fit what it is given, which is a mistake of the program.
    pub fn page(&self, input: &PageInput<'_>) -> Result<String, Failure> {
        page::render(&self.frames, input)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(count: usize, broken: &[usize]) -> Vec<usize> {
        let mut report = Report::new(true, count);
        let mut shown = Vec::new();
        for place in 0..count {
            if broken.contains(&place) {
                report.skipped();
                continue;
            }
            if report.wants_frame() {
                shown.push(place);
            }
            report.frame(ReportFrame::default);
        }
        shown
    }

    #[test]
    fn shown_frames_are_spread_and_broken_ones_replaced() {
        assert_eq!(shown(1, &[]), [0]);
        assert_eq!(shown(3, &[]), [0, 1, 2]);
        assert_eq!(shown(16, &[]), [0, 5, 10, 15]);
        assert_eq!(shown(16, &[0, 5]), [1, 6, 10, 15]);
        assert_eq!(shown(0, &[]), [0; 0]);
        assert!(!Report::new(false, 9).wants_frame());
    }
}
