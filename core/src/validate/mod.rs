//! Validation of the disparity picture by the size of its surfaces.

mod bands;
mod settings;

pub use settings::ValidateSettings;

use heapless::Vec;

use crate::{
    arch::{self, Chosen, Steps},
    disparity::{DisparityPixel, Reason},
    error::{ConfigError, ConfigProblem},
    links::{Links, PIECE, VALUES, each_bit, near, piece},
    work::{self, Loop},
};

/// Largest value of [`ValidateSettings::min_surface_px`]: the room for walking over one small surface.
pub const MAX_SURFACE_PX: usize = 1024;

/// Takes contiguous surfaces out of the disparity picture that are too small to be believed.
///
/// Source: the paper, section 4.2. Union-find joins the runs of contiguous pixels of each row with those of the row above. Only the
/// surfaces that reach the current row are kept in a table, so the memory grows with the width and not with the picture: when a
/// surface ends and is too small, it is walked over once more and taken out.
///
/// # Bound
/// One pass over `width x height` pixels, three over the runs, as many as pixels at most, and at most one more over the pixels of
/// small surfaces. Two surfaces of a row never lie crosswise, so what a run looks up is one step away at most.
pub struct SurfaceSize<const WIDTH: usize> {
    settings: ValidateSettings,
    width: usize,
    /// Surface of each run of contiguous pixels in the row above and in the current row, from the left.
    above: [u16; WIDTH],
    here: [u16; WIDTH],
    /// Surfaces that reach the row above, then those that begin in the current row.
    table: [[Open; WIDTH]; 2],
    /// Surfaces that reach the current row, and the number that each entry of the table has there.
    next: [Open; WIDTH],
    renumbered: [[u16; WIDTH]; 2],
    /// How the first pixels of the row above hang together.
    links: [Links; KEPT],
    walk: Vec<Step, MAX_SURFACE_PX>,
    chosen: Chosen,
}

/// A surface that may still grow.
#[derive(Clone, Copy)]
struct Open {
    parent: u16,
    /// Pixels so far, up to the smallest size that is kept.
    pixels: u16,
    /// One of its pixels.
    seed: (u16, u16),
}

/// A pixel of a small surface that was taken out, with the disparity that it had.
#[derive(Clone, Copy)]
struct Step {
    x: u16,
    y: u16,
    steps: u16,
}

const NONE: u16 = u16::MAX;

/// Pieces of a row of which is kept how they hang together: those of 4096 pixels. Beyond, it is found out twice.
const KEPT: usize = 128;

const CLOSED: Open = Open { parent: 0, pixels: 0, seed: (0, 0) };

impl<const WIDTH: usize> SurfaceSize<WIDTH> {
    /// A stage that is not configured and leaves every picture as it is.
    pub const fn new() -> Self {
        const { assert!(WIDTH < NONE as usize / 2, "labels of two rows must fit 16 bits") };
        Self {
            settings: ValidateSettings { min_surface_px: 0, step_sixteenths: 0 },
            width: 0,
            above: [0; WIDTH],
            here: [0; WIDTH],
            table: [[CLOSED; WIDTH]; 2],
            next: [CLOSED; WIDTH],
            renumbered: [[0; WIDTH]; 2],
            links: [Links::NONE; KEPT],
            walk: Vec::new(),
            chosen: Chosen::PLAIN,
        }
    }

    /// Takes settings and the width of the pictures.
    ///
    /// # Errors
    /// The first setting that cannot be used, named `validate.*`.
    pub fn configure(&mut self, settings: &ValidateSettings, width: usize) -> Result<(), ConfigError> {
        settings.check()?;
        if width > WIDTH {
            let problem = ConfigProblem::OverCapacity { needed: width, capacity: WIDTH };
            return Err(ConfigError::new("calibration.width", problem));
        }
        self.settings = *settings;
        self.width = width;
        Ok(())
    }

    /// Has pictures gone through with the instructions of a backend.
    pub(crate) const fn choose(&mut self, chosen: Chosen) {
        self.chosen = chosen;
    }

    /// Takes the small surfaces out of `picture`, rows of the configured width.
    pub fn run(&mut self, picture: &mut [DisparityPixel]) {
        if self.settings.min_surface_px <= 1 || self.width == 0 {
            return;
        }
        arch::compiled(self.chosen, Rows { stage: self, picture, seams: [false; 2] });
    }

    #[inline(always)]
    fn go_through(&mut self, picture: &mut [DisparityPixel], [above, below]: [bool; 2]) {
        let mut open = 0;
        for y in 0..picture.len().checked_div(self.width).unwrap_or(0) {
            let (runs, used) = self.join_row(picture, y, open);
            if above && y == 0 {
                let surfaces = self.table.as_flattened_mut().iter_mut().take(used);
                surfaces.for_each(|surface| surface.pixels = self.settings.min_surface_px);
            }
            open = self.end_row(picture, runs, used);
        }
        for place in 0..if below { 0 } else { open } {
            let Some(&surface) = self.next.get(place) else { break };
            self.take_out(picture, surface);
        }
    }

    /// Joins row `y` with itself and with the row above, whose surfaces are the first `open` of the table; returns how
    /// many runs it has and how many entries of the table are used.
    #[inline(always)]
    fn join_row(&mut self, picture: &[DisparityPixel], y: usize, open: usize) -> (usize, usize) {
        let Self { settings, width, above, here, table, links: kept, .. } = self;
        let ValidateSettings { step_sixteenths: step, min_surface_px: limit } = *settings;
        let row_at = |y: usize| {
            let start = y.wrapping_mul(*width);
            picture.get(start..start.wrapping_add(*width)).unwrap_or_default()
        };
        let row = row_at(y);
        let row_above = y.checked_sub(1).map(row_at).unwrap_or_default();
        let mut run = Run { table: table.as_flattened_mut(), used: open, limit, label: NONE, first: (0, 0), from: 0 };
        // Runs that began, here and above, pixels with a value that went by, and whether the last pixel of the piece before hangs
        // together with the one above it.
        let (mut runs, mut runs_above, mut values, mut up_before) = (0usize, 0u32, 0u32, 0u32);
        for x in (0..row.len()).step_by(PIECE) {
            let last =
                |row: &[DisparityPixel]| x.checked_sub(1).and_then(|x| row.get(x)).map_or(0, |pixel| pixel.bits());
            let (pixels, pixels_above) = (piece(row, x), piece(row_above, x));
            let links = Links::of(&pixels, last(row), &VALUES, step);
            let links_above = match kept.get_mut(x / PIECE) {
                // What was taken out of the picture since then does not reach the row above.
                Some(kept) if y > 0 => core::mem::replace(kept, links),
                Some(kept) => {
                    *kept = links;
                    Links::NONE
                }
                None => Links::of(&pixels_above, last(row_above), &VALUES, step),
            };
            let (starts, starts_above) = (links.starts(), links_above.starts());
            let up = links.value & links_above.value & near(&pixels, &pixels_above, step);
            // Where both runs go on, so does what is known of them.
            let joins = up & !((up << 1 | up_before) & links.left & links_above.left);
            work::count(Loop::ValidatePieces, 1);
            work::count(Loop::ValidateEvents, (starts | joins).count_ones() as usize);
            for bit in each_bit(starts | joins) {
                if starts & bit != 0 {
                    let went_by = values.wrapping_add((links.value & (bit - 1)).count_ones());
                    if let Some(label) = runs.checked_sub(1).and_then(|before| here.get_mut(before)) {
                        *label = run.end(went_by);
                    }
                    run.begin(((x as u32).wrapping_add(bit.trailing_zeros()), y), went_by);
                    runs = runs.wrapping_add(1);
                }
                if joins & bit != 0 {
                    let began_above = runs_above.wrapping_add((starts_above & (bit | (bit - 1))).count_ones());
                    // It began, as the pixel above belongs to it.
                    run.join(above.get((began_above as usize).wrapping_sub(1)).copied().unwrap_or(NONE));
                }
            }
            // No more than there are pixels in a row.
            runs_above = runs_above.wrapping_add(starts_above.count_ones());
            values = values.wrapping_add(links.value.count_ones());
            up_before = up >> (PIECE - 1);
        }
        if let Some(label) = runs.checked_sub(1).and_then(|before| here.get_mut(before)) {
            *label = run.end(values);
        }
        (runs, run.used)
    }

    /// Takes out the small surfaces that do not reach the current row, which has `runs` runs, and numbers the others anew; returns
    /// how many there are.
    #[inline(always)]
    fn end_row(&mut self, picture: &mut [DisparityPixel], runs: usize, used: usize) -> usize {
        // Labels are places in the table, which has room for the runs of two rows: nothing that is looked up below is missing.
        let mut open = 0usize;
        {
            let Self { above, here, table, next, renumbered, .. } = self;
            let table = table.as_flattened_mut();
            let renumbered = renumbered.as_flattened_mut();
            renumbered.get_mut(..used).unwrap_or_default().fill(NONE);
            work::count(Loop::ValidatePlaces, used);
            work::count(Loop::ValidateRuns, runs);
            // Older entries come first and stand for the others: from the first on, the way to what stands for one is a single step.
            for place in 0..used {
                let Some(parent) = table.get(place).map(|entry| usize::from(entry.parent)) else { break };
                let Some(parent) = table.get(parent).map(|entry| entry.parent) else { break };
                if let Some(entry) = table.get_mut(place) {
                    entry.parent = parent;
                }
            }
            for (&here, above) in here.iter().zip(above.iter_mut()).take(runs) {
                let root = table.get(usize::from(here)).map_or(0, |entry| usize::from(entry.parent));
                let (Some(number), Some(surface)) = (renumbered.get_mut(root), table.get(root)) else { continue };
                if *number == NONE
                    && let Some(next) = next.get_mut(open)
                {
                    *number = open as u16;
                    *next = Open { parent: open as u16, ..*surface };
                    open = open.wrapping_add(1);
                }
                *above = *number;
            }
        }
        for place in 0..used {
            let (table, numbers) = (self.table.as_flattened(), self.renumbered.as_flattened());
            let (Some(&surface), Some(&number)) = (table.get(place), numbers.get(place)) else { break };
            if usize::from(surface.parent) == place && number == NONE {
                self.take_out(picture, surface);
            }
        }
        if let (Some(to), Some(from)) = (self.table.as_flattened_mut().get_mut(..open), self.next.get(..open)) {
            to.copy_from_slice(from);
        }
        open
    }

    /// Takes a surface out of the picture if it is too small.
    fn take_out(&mut self, picture: &mut [DisparityPixel], surface: Open) {
        if surface.pixels >= self.settings.min_surface_px {
            return;
        }
        let width = self.width;
        let reach = self.settings.step_sixteenths;
        let none = DisparityPixel::none(Reason::SmallSurface);
        let walk = &mut self.walk;
        walk.clear();
        let mut visit = |walk: &mut Vec<Step, MAX_SURFACE_PX>, x: usize, y: usize, from: Option<u16>| {
            let Some(pixel) = picture.get_mut(y.wrapping_mul(width).wrapping_add(x)).filter(|_| x < width) else {
                return;
            };
            let steps = pixel.steps();
            if steps != 0 && from.is_none_or(|from| steps.abs_diff(from) <= reach) {
                // There is room: the surface has fewer pixels than the smallest that is kept, and each is visited once.
                if walk.push(Step { x: x as u16, y: y as u16, steps }).is_ok() {
                    *pixel = none;
                }
            }
        };
        visit(walk, usize::from(surface.seed.0), usize::from(surface.seed.1), None);
        while let Some(Step { x, y, steps }) = walk.pop() {
            work::count(Loop::ValidateTaken, 1);
            let (x, y) = (usize::from(x), usize::from(y));
            visit(walk, x + 1, y, Some(steps));
            visit(walk, x, y + 1, Some(steps));
            if x > 0 {
                visit(walk, x - 1, y, Some(steps));
            }
            if y > 0 {
                visit(walk, x, y - 1, Some(steps));
            }
        }
    }
}

impl<const WIDTH: usize> Default for SurfaceSize<WIDTH> {
    fn default() -> Self {
        Self::new()
    }
}

/// All rows of a picture.
struct Rows<'a, const WIDTH: usize> {
    stage: &'a mut SurfaceSize<WIDTH>,
    picture: &'a mut [DisparityPixel],
    /// Whether the picture goes on above and below: what touches those edges is large enough.
    seams: [bool; 2],
}

impl<const WIDTH: usize> Steps for Rows<'_, WIDTH> {
    #[inline(always)]
    fn run(self) {
        self.stage.go_through(self.picture, self.seams);
    }
}

/// The run of contiguous pixels that is being gone through.
struct Run<'a> {
    table: &'a mut [Open],
    /// Entries of the table that are used.
    used: usize,
    /// Pixels are counted up to here.
    limit: u16,
    /// Surface that it belongs to; [`NONE`] as long as it touches none.
    label: u16,
    /// Its first pixel, and how many pixels with a value lie before that in the row.
    first: (u16, u16),
    from: u32,
}

impl Run<'_> {
    #[inline(always)]
    fn begin(&mut self, (x, y): (u32, usize), from: u32) {
        (self.label, self.first, self.from) = (NONE, (x as u16, y as u16), from);
    }

    /// Joins the run with a surface that touches it.
    #[inline(always)]
    fn join(&mut self, other: u16) {
        self.label = match self.label {
            NONE => root(self.table, other),
            label => join(self.table, label, other, self.limit),
        };
    }

    /// Counts its pixels, `to` pixels with a value into the row, and gives its surface.
    #[inline(always)]
    fn end(&mut self, to: u32) -> u16 {
        if self.label == NONE {
            self.label = self.used as u16;
            // There is room: no row has more runs than pixels, and the surfaces of the row above are not more either.
            if let Some(entry) = self.table.get_mut(self.used) {
                *entry = Open { parent: self.label, pixels: 0, seed: self.first };
            }
            self.used = self.used.wrapping_add(1);
        }
        if let Some(Open { pixels, .. }) = self.table.get_mut(usize::from(self.label)) {
            let more = to.wrapping_sub(self.from);
            *pixels = u32::from(*pixels).wrapping_add(more).min(u32::from(self.limit)) as u16;
        }
        self.label
    }
}

/// The entry that stands for the surface of entry `label`; halves the path on the way. What is not in the table stands for itself.
#[inline(always)]
fn root(table: &mut [Open], mut label: u16) -> u16 {
    loop {
        let Some(parent) = table.get(usize::from(label)).map(|entry| entry.parent).filter(|&parent| parent != label)
        else {
            return label;
        };
        let Some(grandparent) = table.get(usize::from(parent)).map(|entry| entry.parent) else { return label };
        if let Some(entry) = table.get_mut(usize::from(label)) {
            entry.parent = grandparent;
        }
        work::count(Loop::ValidateHops, 1);
        label = grandparent;
    }
}

/// Joins two surfaces; returns the entry that stands for both.
#[inline(always)]
fn join(table: &mut [Open], a: u16, b: u16, limit: u16) -> u16 {
    let (a, b) = (root(table, a), root(table, b));
    // The older entry wins, so that labels of the row above stay valid the longest.
    let (keep, give) = if a < b { (a, b) } else { (b, a) };
    if keep != give
        && let Some(given) = table.get_mut(usize::from(give))
    {
        given.parent = keep;
        let pixels = given.pixels;
        if let Some(kept) = table.get_mut(usize::from(keep)) {
            kept.pixels = kept.pixels.saturating_add(pixels).min(limit);
        }
    }
    keep
}

#[cfg(test)]
mod tests;
