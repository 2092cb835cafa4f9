//! Validation of the disparity picture by the size of its surfaces.

mod settings;

pub use settings::ValidateSettings;

use heapless::Vec;

use crate::{
    disparity::{DisparityPixel, Reason},
    error::{ConfigError, ConfigProblem},
};

/// Largest value of [`ValidateSettings::min_surface_px`]: the room for walking over one small surface.
pub const MAX_SURFACE_PX: usize = 1024;

/// Takes contiguous surfaces out of the disparity picture that are too small to be believed.
///
/// Source: the paper, section 4.2. Union-find joins each row with the one above. Only the surfaces that reach the current
/// row are kept in a table, so the memory grows with the width and not with the picture: when a surface ends and is too
/// small, it is walked over once more and taken out.
///
/// # Bound
/// Two passes of `width x height` steps (join, renumber), and at most one more over the pixels of small surfaces.
pub struct SurfaceSize<const WIDTH: usize> {
    settings: ValidateSettings,
    width: usize,
    /// Surface of each pixel in the row above and in the current row; [`NONE`] where there is no disparity.
    above: [u16; WIDTH],
    here: [u16; WIDTH],
    /// Surfaces that reach the row above, then those that begin in the current row.
    table: [[Open; WIDTH]; 2],
    /// Surfaces that reach the current row, and the number that each entry of the table has there.
    next: [Open; WIDTH],
    renumbered: [[u16; WIDTH]; 2],
    walk: Vec<Step, MAX_SURFACE_PX>,
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
            walk: Vec::new(),
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

    /// Takes the small surfaces out of `picture`, rows of the configured width.
    pub fn run(&mut self, picture: &mut [DisparityPixel]) {
        if self.settings.min_surface_px <= 1 || self.width == 0 {
            return;
        }
        self.above[..self.width].fill(NONE);
        let mut open = 0;
        for y in 0..picture.len() / self.width {
            let used = self.join_row(picture, y, open);
            open = self.end_row(picture, used);
        }
        for place in 0..open {
            self.take_out(picture, self.next[place]);
        }
    }

    /// Joins row `y` with itself and with the row above, whose surfaces are the first `open` of the table; returns how
    /// many entries of the table are used.
    fn join_row(&mut self, picture: &[DisparityPixel], y: usize, open: usize) -> usize {
        let Self { settings, width, above, here, table, .. } = self;
        let (reach, limit) = (settings.step_sixteenths, settings.min_surface_px);
        let row = &picture[y * *width..(y + 1) * *width];
        let row_above = &picture[y.saturating_sub(1) * *width..][..*width];
        let table = table.as_flattened_mut();
        let mut used = open;
        let (mut left_steps, mut left_label, mut left_up) = (0, NONE, NONE);
        for (x, (pixel, pixel_above)) in row.iter().zip(row_above).enumerate() {
            let steps = pixel.steps();
            let (mut label, mut joined_up) = (NONE, NONE);
            if steps != 0 {
                if left_label != NONE && steps.abs_diff(left_steps) <= reach {
                    label = left_label;
                    joined_up = left_up;
                }
                let up = above[x];
                if up != NONE && up != joined_up && steps.abs_diff(pixel_above.steps()) <= reach {
                    label = if label == NONE { root(table, up) } else { join(table, label, up, limit) };
                    joined_up = up;
                }
                if label == NONE {
                    label = used as u16;
                    table[used] = Open { parent: label, pixels: 0, seed: (x as u16, y as u16) };
                    used += 1;
                }
                let pixels = &mut table[usize::from(label)].pixels;
                *pixels = (*pixels + 1).min(limit);
            }
            here[x] = label;
            (left_steps, left_label, left_up) = (steps, label, joined_up);
        }
        used
    }

    /// Takes out the small surfaces that do not reach the current row and numbers the others anew; returns how many there
    /// are.
    fn end_row(&mut self, picture: &mut [DisparityPixel], used: usize) -> usize {
        let mut open = 0;
        {
            let Self { width, above, here, table, next, renumbered, .. } = self;
            let table = table.as_flattened_mut();
            let renumbered = renumbered.as_flattened_mut();
            renumbered[..used].fill(NONE);
            for (&here, above) in here[..*width].iter().zip(above.iter_mut()) {
                *above = NONE;
                if here == NONE {
                    continue;
                }
                let root = usize::from(root(table, here));
                if renumbered[root] == NONE {
                    renumbered[root] = open as u16;
                    next[open] = Open { parent: open as u16, ..table[root] };
                    open += 1;
                }
                *above = renumbered[root];
            }
        }
        for place in 0..used {
            let surface = self.table.as_flattened()[place];
            let ended = usize::from(surface.parent) == place && self.renumbered.as_flattened()[place] == NONE;
            if ended {
                self.take_out(picture, surface);
            }
        }
        self.table.as_flattened_mut()[..open].copy_from_slice(&self.next[..open]);
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
            let Some(pixel) = picture.get_mut(y * width + x).filter(|_| x < width) else { return };
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

/// The entry that stands for the surface of entry `label`; halves the path on the way.
fn root(table: &mut [Open], mut label: u16) -> u16 {
    loop {
        let parent = table[usize::from(label)].parent;
        if parent == label {
            return label;
        }
        let grandparent = table[usize::from(parent)].parent;
        table[usize::from(label)].parent = grandparent;
        label = grandparent;
    }
}

/// Joins two surfaces; returns the entry that stands for both.
fn join(table: &mut [Open], a: u16, b: u16, limit: u16) -> u16 {
    let (a, b) = (root(table, a), root(table, b));
    // The older entry wins, so that labels of the row above stay valid the longest.
    let (keep, give) = if a < b { (a, b) } else { (b, a) };
    if keep != give {
        let pixels = table[usize::from(give)].pixels;
        table[usize::from(give)].parent = keep;
        let sum = &mut table[usize::from(keep)].pixels;
        *sum = (*sum + pixels).min(limit);
    }
    keep
}

#[cfg(test)]
mod tests;
