//! What the pairs of a rig saw, as one.

use fencepost_core::{detector::Detection, health::HealthLevel};

use crate::detector::{CELLS, OBSTACLES};

/// What a pair has to give.
pub(super) enum PairView<'a> {
    /// What it saw.
    Seen(&'a Detection<OBSTACLES, CELLS>),
    /// Nothing.
    Blind,
}

/// What the pairs saw, as one.
#[derive(Debug)]
pub(super) struct Gathered {
    detection: Box<Detection<OBSTACLES, CELLS>>,
}

impl Gathered {
    pub(super) fn new() -> Self {
        Self { detection: Box::new(Detection::new()) }
    }

    pub(super) fn clear(&mut self) {
        self.detection.health.level = HealthLevel::Ok;
    }

    pub(super) fn add(&mut self, view: &PairView<'_>) {
        if let PairView::Seen(detection) = view {
            super::exchange::copy(&mut self.detection, detection);
        }
    }

    pub(super) fn detection(&self) -> &Detection<OBSTACLES, CELLS> {
        &self.detection
    }
}
