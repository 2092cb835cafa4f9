//! Which frames a report shows, and their pictures.

use crate::view::FrameView;
use fencepost_core::settings::Settings;

/// Paints what a report shows of a frame.
pub trait Painter {
    /// What it paints.
    type Painted;

    /// Paints a frame.
    fn paint(&self, view: &FrameView<'_>, settings: &Settings) -> Self::Painted;
}

/// Collects what a report shows of single frames while a run goes on.
#[derive(Debug)]
pub struct Shown<P: Painter> {
    painter: P,
    /// Places of the frames still to be shown, in order.
    targets: Vec<usize>,
    position: usize,
    frames: Vec<P::Painted>,
}

impl<P: Painter> Shown<P> {
    /// Of `count` frames, at most `most` are shown, spread evenly.
    pub fn new(painter: P, most: usize, count: usize) -> Self {
        let shown = most.min(count);
        let spread = |k: usize| if shown > 1 { k * (count - 1) / (shown - 1) } else { 0 };
        Self { painter, targets: (0..shown).map(spread).collect(), position: 0, frames: Vec::new() }
    }

    /// Whether the frame that comes now is to be shown.
    pub fn wants_frame(&self) -> bool {
        self.targets.first().is_some_and(|target| *target <= self.position)
    }

    /// A frame was looked at; it is painted if it is to be shown.
    pub fn frame(&mut self, view: &FrameView<'_>, settings: &Settings) {
        if self.wants_frame() {
            self.targets.remove(0);
            self.frames.push(self.painter.paint(view, settings));
        }
        self.position += 1;
    }

    /// A frame could not be used: the next good one takes its place.
    pub const fn skipped(&mut self) {
        self.position += 1;
    }

    /// What was painted, to keep.
    pub fn into_frames(self) -> Vec<P::Painted> {
        self.frames
    }

    /// What was painted, in the order of the frames.
    pub fn frames(&self) -> &[P::Painted] {
        &self.frames
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::testing::MadeUp;

    /// Paints nothing.
    struct Blank;

    impl Painter for Blank {
        type Painted = ();

        fn paint(&self, _: &FrameView<'_>, _: &Settings) {}
    }

    fn shown(count: usize, broken: &[usize]) -> Vec<usize> {
        let mut report = Shown::new(Blank, 4, count);
        let mut shown = Vec::new();
        for place in 0..count {
            if broken.contains(&place) {
                report.skipped();
                continue;
            }
            if report.wants_frame() {
                shown.push(place);
            }
            MadeUp::new().view(|view| report.frame(view, &Settings::default()));
        }
        assert_eq!(report.frames().len(), shown.len());
        shown
    }

    #[test]
    fn shown_frames_are_spread_and_broken_ones_replaced() {
        assert_eq!(shown(1, &[]), [0]);
        assert_eq!(shown(3, &[]), [0, 1, 2]);
        assert_eq!(shown(16, &[]), [0, 5, 10, 15]);
        assert_eq!(shown(16, &[0, 5]), [1, 6, 10, 15]);
        assert_eq!(shown(0, &[]), [0; 0]);
        assert!(!Shown::new(Blank, 0, 9).wants_frame());
    }
}
