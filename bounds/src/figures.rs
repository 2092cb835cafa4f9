//! All figures in one place.

use std::{collections::BTreeMap, path::Path};

use anyhow::Result;
use fencepost_core::detector::Capacities;

use crate::{
    bus,
    image::{Analysis, Image},
    instructions::{self, Bound},
    memory::{self, Formula, Layout},
    work::{Shape, StageWork},
};

/// Rows of a table: a name and a figure.
pub(crate) type Rows = BTreeMap<String, u64>;

/// Everything that is found.
pub(crate) struct Figures {
    pub(crate) layouts: Vec<(&'static str, Layout)>,
    pub(crate) formulas: Vec<Formula>,
    /// Bytes, by size of the pictures and part.
    pub(crate) memory: Rows,
    /// Bytes, frames, bits, microseconds and tenths of a percent, as the names say.
    pub(crate) bus: Rows,
    /// Steps, by size of the pictures, stage and loop; and the stages for the report.
    pub(crate) work: Rows,
    pub(crate) stages: Vec<(&'static str, Vec<StageWork>)>,
    /// From the image; `None` if there is none.
    pub(crate) stack: Option<Stack>,
    /// Instructions of the stages, from the image; `None` if there is none.
    pub(crate) instructions: Option<Vec<Bound>>,
    /// Calls of panics, by function; `None` without an image.
    pub(crate) panics: Option<Panics>,
    /// What must not be, whatever the budget.
    pub(crate) faults: Vec<String>,
}

/// Depths of the stack.
pub(crate) struct Stack {
    /// Bytes, by entry.
    pub(crate) depths: Rows,
    /// The entry that goes deepest, and the functions on the way with their own bytes.
    pub(crate) deepest: Vec<(String, u32)>,
}

/// Panics that are linked into an image.
pub(crate) struct Panics {
    pub(crate) calls: Vec<(String, usize)>,
    /// Entries from which one can be reached, as far as the code tells.
    pub(crate) entries: Vec<String>,
}

impl Figures {
    /// Finds all figures; those of an image only if it is given.
    ///
    /// # Errors
    /// An image cannot be used.
    pub(crate) fn find(image: Option<&Path>, checked: Option<&Path>) -> Result<Self> {
        let layouts = Vec::from(memory::named());
        let formulas = memory::formulas()?;
        let stages: Vec<_> = layouts.iter().map(|(name, layout)| (*name, shape(layout).stages())).collect();
        let mut figures = Self {
            work: work_rows(&stages),
            stages,
            memory: memory_rows(&layouts),
            bus: bus::rows().into_iter().collect(),
            stack: None,
            instructions: None,
            panics: None,
            faults: memory_faults(&layouts, &formulas),
            layouts,
            formulas,
        };
        if let Some(path) = image {
            figures.look_at(&Image::read(path)?);
        }
        if let Some(path) = checked {
            figures.panics = Some(panics(&Image::read(path)?));
        }
        Ok(figures)
    }

    /// Stack, memory and allocators of an image.
    fn look_at(&mut self, image: &Image) {
        let mut analysis = Analysis::new(image);
        let mut depths = Rows::new();
        let mut deepest = (0, None);
        for (address, name) in image.entries() {
            let depth = analysis.depth(address);
            depths.insert(name.to_owned(), u64::from(depth.worst));
            if depth.worst > deepest.0 {
                deepest = (depth.worst, Some(address));
            }
        }
        if depths.is_empty() {
            self.faults.push("the image has no entry, no function whose name begins with `entry_`".to_owned());
        }
        self.faults.extend(analysis.flaws().map(ToString::to_string));
        self.faults.extend(image.allocators.iter().map(|name| format!("the image has an allocator: {name}")));
        if let Some(bytes) = image.detector_bytes {
            self.memory.insert("320x240x48.whole_on_thumbv7em".to_owned(), bytes);
        }
        let way = deepest.1.map(|start| analysis.deepest_way(start)).unwrap_or_default();
        let deepest = way.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect();
        self.stack = Some(Stack { depths, deepest });
        let (width, height, disparities) = instructions::SIZE;
        let (bounds, faults) = instructions::bounds(image, &Shape::of(width, height, disparities));
        self.faults.extend(faults);
        self.instructions = Some(bounds);
    }
}

/// Rows for the budget: instructions for a frame, by stage.
pub(crate) fn instruction_rows(bounds: &[Bound]) -> Rows {
    let (width, height, disparities) = instructions::SIZE;
    let name = |bound: &Bound| format!("{width}x{height}x{disparities}.{}", bound.stage);
    bounds.iter().map(|bound| (name(bound), bound.instructions)).collect()
}

fn memory_rows(layouts: &[(&'static str, Layout)]) -> Rows {
    let mut rows = Rows::new();
    for (name, layout) in layouts {
        rows.insert(format!("{name}.whole"), layout.whole as u64);
        rows.extend(layout.parts.iter().map(|part| (format!("{name}.{}", part.name), part.bytes as u64)));
    }
    rows
}

/// What decides the work of a detector of such a size, with the default settings.
fn shape(layout: &Layout) -> Shape {
    let Capacities { pixels, width, disparities, .. } = layout.capacities;
    Shape::of(width, pixels / width, disparities)
}

fn work_rows(stages: &[(&'static str, Vec<StageWork>)]) -> Rows {
    let mut rows = Rows::new();
    for (size, stages) in stages {
        rows.insert(format!("{size}.whole"), stages.iter().map(|stage| stage.total).sum());
        for StageWork { stage, loops, total, .. } in stages {
            rows.insert(format!("{size}.{stage}"), *total);
            rows.extend(loops.iter().map(|(name, steps)| (format!("{size}.{stage}.{name}"), *steps)));
        }
    }
    rows
}

/// Where sizes are not what their formulas say.
fn memory_faults(layouts: &[(&'static str, Layout)], formulas: &[Formula]) -> Vec<String> {
    let mut faults = Vec::new();
    for (name, layout) in layouts {
        for (formula, part) in formulas.iter().zip(layout.parts) {
            if !formula.holds(&layout.capacities, part.bytes as i64) {
                faults.push(format!("memory {name}.{}: {} bytes are not {formula}", part.name, part.bytes));
            }
        }
        let sum = memory::whole_bytes(layout);
        if !sum.contains(&layout.whole) {
            faults.push(format!(
                "memory {name}.whole: {} bytes are not the sum of the parts, {}: a part is missing in \
                 `Detector::memory_parts`",
                layout.whole,
                sum.start()
            ));
        }
    }
    faults
}

fn panics(image: &Image) -> Panics {
    let mut analysis = Analysis::new(image);
    let entries = image.entries().map(|(address, name)| (address, name.to_owned())).collect::<Vec<_>>();
    for (address, _) in &entries {
        analysis.depth(*address);
    }
    let mut calls = BTreeMap::<String, usize>::new();
    for (name, count) in analysis.panics() {
        *calls.entry(name.to_owned()).or_default() += count;
    }
    let entries = entries.into_iter().filter(|(address, _)| analysis.can_panic(*address)).map(|(_, name)| name);
    Panics { calls: calls.into_iter().collect(), entries: entries.collect() }
}

impl Panics {
    /// Rows for the budget.
    pub(crate) fn rows(&self) -> Rows {
        let calls = self.calls.iter().map(|(_, count)| *count as u64).sum();
        Rows::from([("calls".to_owned(), calls), ("entries".to_owned(), self.entries.len() as u64)])
    }
}
