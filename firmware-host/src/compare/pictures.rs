//! The pictures of a frame, as one detector sees it.

use std::sync::Arc;

use fencepost_core::settings::Settings;
use serde::Serialize;

use crate::{
    paint::{self, Figures},
    report::{Embedded, Painter},
    score::RecordedTruth,
    view::FrameView,
};

/// Pictures are thinned until they are no wider: they stand beside others, px.
const WIDEST: usize = 640;

/// Paints what is compared: the classes over the left picture, and the map.
#[derive(Clone, Debug)]
pub struct SidePainter {
    /// The truth, where there is any.
    pub truth: Option<Arc<RecordedTruth>>,
}

/// A frame as one detector sees it.
#[derive(Clone, Debug, Serialize)]
pub struct SidePictures {
    /// Number of the frame.
    pub number: u32,
    /// Ground red, obstacles blue, over the left picture.
    pub classes: Embedded,
    /// The map.
    pub map: Embedded,
    /// The left picture, for who knows no classes.
    pub left: Embedded,
    /// What is really in the cells, where there is a sweep of the frame.
    pub truth: Option<Embedded>,
}

impl Painter for SidePainter {
    type Painted = SidePictures;

    fn paint(&self, view: &FrameView<'_>, settings: &Settings) -> SidePictures {
        let figures = Figures { view, scale_px: (0.0, 1.0), step_sixteenths: settings.surfaces.step_sixteenths };
        let cell_size_mm = view.detection.map.geometry.cell_size_mm;
        // What is wrong with the truth was said when the frame was scored.
        let truth = self.truth.as_ref().and_then(|truth| truth.cells_of(view.number, cell_size_mm).ok().flatten());
        let true_map =
            |cells: Arc<crate::score::TrueCells>| paint::true_map(view, |i, j| cells.get((i32::from(i), i32::from(j))));
        let embedded = |canvas| Embedded::new(&canvas, WIDEST);
        SidePictures {
            number: view.number,
            classes: embedded(figures.classes()),
            map: embedded(paint::birdseye(view)),
            left: embedded(figures.left()),
            truth: truth.map(true_map).map(embedded),
        }
    }
}
