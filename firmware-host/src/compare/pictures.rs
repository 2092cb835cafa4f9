//! The pictures of a frame, as one detector sees it.

use std::sync::Arc;

use fencepost_core::{map::Cell, settings::Settings};
use serde::Serialize;

use crate::{
    output::CellRow,
    paint::{self, Figures},
    report::{Embedded, Painter},
    score::{Mistake, RecordedTruth, Said, TrueCells, mistakes},
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
        let true_map = |cells: Arc<TrueCells>| paint::true_map(view, |i, j| cells.get((i32::from(i), i32::from(j))));
        let embedded = |canvas| Embedded::new(&canvas, WIDEST);
        let mut map = paint::birdseye(view);
        if let Some(truth) = &truth {
            let wrong = mistakes(truth, &said(view));
            let marked = wrong.into_iter().filter_map(|((i, j), mistake)| {
                Some(((i16::try_from(i).ok()?, i16::try_from(j).ok()?), mistake_colour(mistake)))
            });
            paint::mark_cells(&mut map, view.detection.map.geometry, marked);
        }
        SidePictures {
            number: view.number,
            classes: embedded(figures.classes()),
            map: embedded(map),
            left: embedded(figures.left()),
            truth: truth.map(true_map).map(embedded),
        }
    }
}

/// Colour of the frame around a cell that is wrong.
pub(super) const fn mistake_colour(mistake: Mistake) -> [u8; 3] {
    match mistake {
        Mistake::Missed => paint::MISSED,
        Mistake::CalledFree => paint::CALLED_FREE,
        Mistake::NotThere => paint::NOT_THERE,
    }
}

fn said(view: &FrameView<'_>) -> Said {
    let map = &view.detection.map;
    let row = |(index, content): (usize, &Cell)| CellRow { cell: map.geometry.cell_at(index), content: *content };
    Said::of(&map.cells.iter().enumerate().map(row).collect::<Vec<_>>())
}
