//! Stereo matching: differences summed over a window, with every check that comes from the same costs.
//!
//! Rows of the rectified pair go in from the top, rows of the disparity picture come out, half a window later. Nothing of
//! the pictures is kept but the rows under the window.

mod best;
mod census;
mod columns;
mod prefilter;
mod rows;
mod settings;
mod strip;

pub(crate) use best::refine;
pub use rows::ValidSpan;
pub use settings::{MatchCost, MatchSettings, Prefilter};
pub(crate) use strip::Strip;

use crate::{
    disparity::{DisparityPixel, Reason},
    error::{ConfigError, ConfigProblem},
};
use best::{Best, RightBest};
use columns::Columns;
use rows::Rows;

/// The matcher for pictures up to `WIDTH` wide and up to `DISPARITIES` disparities.
///
/// Source: the paper, section 2.2 (windows compared along the row) and 4.2 (validation). The four checks come from one
/// pass over the costs of a row.
///
/// # Bound
/// Each output row takes `width x disparities` steps for the costs, the same for the selection with each of the two windows, and
/// `width` for the rest.
pub struct Matcher<const WIDTH: usize, const DISPARITIES: usize> {
    settings: MatchSettings,
    width: usize,
    height: usize,
    rows: Rows<WIDTH>,
    columns: Columns<WIDTH, DISPARITIES>,
    right: RightBest<WIDTH>,
    /// Pixels of the row that the narrow window could not tell for want of texture.
    weak: [bool; WIDTH],
    /// Sums under the window at the current pixel, largest disparity first.
    costs: [u16; DISPARITIES],
}

/// Candidates for one pixel: places in the table of costs whose window lies within the right picture.
#[derive(Clone, Copy)]
struct Candidates {
    first: usize,
    end: usize,
}

impl<const WIDTH: usize, const DISPARITIES: usize> Matcher<WIDTH, DISPARITIES> {
    /// A matcher that is not configured and delivers nothing.
    pub const fn new() -> Self {
        Self {
            settings: MatchSettings::UNSET,
            width: 0,
            height: 0,
            rows: Rows::new(),
            columns: Columns::new(),
            right: RightBest::new(),
            weak: [false; WIDTH],
            costs: [0; DISPARITIES],
        }
    }

    /// Takes settings and the size of the rectified pictures.
    ///
    /// # Errors
    /// The first setting that cannot be used, named `matching.*`.
    pub fn configure(&mut self, settings: &MatchSettings, width: usize, height: usize) -> Result<(), ConfigError> {
        settings.check()?;
        let capacity = |field, needed: usize, capacity| {
            if needed > capacity {
                Err(ConfigError::new(field, ConfigProblem::OverCapacity { needed, capacity }))
            } else {
                Ok(())
            }
        };
        capacity("matching.disparities", usize::from(settings.disparities), DISPARITIES)?;
        capacity("calibration.width", width, WIDTH)?;
        self.settings = *settings;
        self.width = width;
        self.height = height;
        self.begin();
        Ok(())
    }

    /// Settings in force.
    pub const fn settings(&self) -> &MatchSettings {
        &self.settings
    }

    /// Starts a new picture.
    pub fn begin(&mut self) {
        self.rows.begin(self.settings.reach());
        self.columns.begin();
    }

    /// Takes the next row of the rectified pair, from the top.
    ///
    /// Rows after the last one of the picture, and rows of another width, are left out.
    pub fn push(&mut self, left: &[u8], right: &[u8], left_span: ValidSpan, right_span: ValidSpan) {
        if left.len() != self.width || right.len() != self.width || self.rows.pushed() >= self.height {
            return;
        }
        self.rows.push(left, right, left_span, right_span, &self.settings);
        self.absorb();
    }

    /// Adds the newest filtered row, if there is one, to the column sums and takes the one that leaves the window out.
    fn absorb(&mut self) {
        let window = usize::from(self.settings.window_height);
        let first = self.rows.first_filtered();
        let Some(newest) = self.rows.newest_filtered() else { return };
        let enter = self.rows.filtered(newest, self.width);
        // Rows above the first filtered one never entered.
        let leave = newest.checked_sub(window).filter(|&y| y >= first).map(|y| self.rows.filtered(y, self.width));
        let disparities = usize::from(self.settings.disparities);
        self.columns.slide(self.settings.cost, enter, leave, disparities, usize::from(self.settings.min_disparity));
    }

    /// Writes disparity row `next` to `out` if all that it needs has come; says whether it did. Rows are to be taken in order,
    /// each as soon as it is there: after every [`Self::push`], until this says no. After the last push it delivers the rest.
    pub fn pull(&mut self, next: usize, out: &mut [DisparityPixel]) -> bool {
        if next >= self.height || out.len() != self.width {
            return false;
        }
        // A row of the window needs rows around it for what is compared.
        let [_, margin] = self.settings.margins();
        let border = next < margin || next + margin >= self.height;
        let available = if border { next < self.rows.pushed() } else { next + margin < self.rows.pushed() };
        if !available {
            return false;
        }
        if border {
            out.fill(DisparityPixel::none(Reason::OutsideValidArea));
        } else {
            self.match_row(next, out);
        }
        true
    }

    /// Matches the row under the middle of the window: with the narrow window, and with the wide one where the texture is weak and
    /// the narrow one could not tell one place from another.
    fn match_row(&mut self, y: usize, out: &mut [DisparityPixel]) {
        out.fill(DisparityPixel::none(Reason::OutsideValidArea));
        self.weak[..self.width].fill(false);
        self.pass(y, Window::Narrow, out);
        if self.settings.wide_window_width > 0 && self.weak[..self.width].contains(&true) {
            self.pass(y, Window::Wide, out);
        }
    }

    /// Goes along a row with one of the windows.
    fn pass(&mut self, y: usize, window: Window, out: &mut [DisparityPixel]) {
        let settings = self.settings;
        let width = match window {
            Window::Narrow => settings.window_width,
            Window::Wide => settings.wide_window_width,
        };
        let uniqueness_percent = match window {
            Window::Narrow => settings.uniqueness_percent,
            Window::Wide => settings.wide_uniqueness_percent,
        };
        let radius = usize::from(width) / 2;
        let margin = radius + settings.reach();
        let disparities = usize::from(settings.disparities);
        let min_disparity = usize::from(settings.min_disparity);
        // Columns that the window and what is compared may touch, and their middle pixels.
        let (left, right) = self.rows.spans(y, usize::from(settings.window_height) / 2 + 1);
        let first = usize::from(left.start) + margin;
        let end = usize::from(left.end).min(self.width).saturating_sub(margin);
        if first >= end {
            return;
        }
        let right_first = usize::from(right.start) + margin;
        let right_end = usize::from(right.end).min(self.width).saturating_sub(margin);
        self.right.begin(self.width);
        let costs = &mut self.costs[..disparities];
        costs.fill(0);
        let (mut texture, mut saturated) = (0u32, 0u32);
        for x in first - radius..first + radius {
            add(costs, self.columns.costs(x, disparities));
            texture += u32::from(self.columns.texture(x));
            saturated += u32::from(self.columns.saturated(x));
        }
        let area = u32::from(width) * u32::from(settings.window_height);
        let min_texture = (u32::from(settings.texture) * area) >> 4;
        let weak_texture = (u32::from(settings.weak_texture) * area) >> 4;
        let max_saturated = area * u32::from(settings.saturated_percent) / 100;
        for x in first..end {
            let enter = x + radius;
            let leave = x.wrapping_sub(radius + 1);
            if x == first {
                add(costs, self.columns.costs(enter, disparities));
            } else {
                slide(costs, self.columns.costs(enter, disparities), self.columns.costs(leave, disparities));
                texture -= u32::from(self.columns.texture(leave));
                saturated -= u32::from(self.columns.saturated(leave));
            }
            texture += u32::from(self.columns.texture(enter));
            saturated += u32::from(self.columns.saturated(enter));

            // Place e in the table is disparity min + (disparities - 1 - e); its right pixel is x - disparity.
            let (Some(out), Some(weak)) = (out.get_mut(x), self.weak.get_mut(x)) else { break };
            let Some(reach) = x.checked_sub(right_first) else { continue };
            let largest = (min_disparity + disparities - 1).min(reach);
            let smallest = min_disparity.max((x + 1).saturating_sub(right_end));
            if largest < smallest || right_first >= right_end {
                continue;
            }
            let place = |disparity: usize| min_disparity + disparities - 1 - disparity;
            let candidates = Candidates { first: place(largest), end: place(smallest) + 1 };
            if window == Window::Narrow {
                self.right.offer(&costs[candidates.first..candidates.end], x - largest, largest as u16);
            } else if !*weak {
                continue;
            }
            *out = if saturated > max_saturated {
                DisparityPixel::none(Reason::Saturated)
            } else if texture < min_texture {
                DisparityPixel::none(Reason::LowTexture)
            } else {
                choose(costs, candidates, min_disparity + disparities - 1, uniqueness_percent)
            };
            let told_apart = !matches!(out.get(), Err(Reason::LowTexture | Reason::NotUnique));
            *weak = match window {
                Window::Narrow => texture < weak_texture && !told_apart,
                Window::Wide => true,
            };
        }
        if settings.back_check && window == Window::Narrow {
            self.back_check(&mut out[first..end], first, window);
        }
    }

    /// Takes out pixels that were matched with `window` and whose right partner matches another left pixel better.
    fn back_check(&self, out: &mut [DisparityPixel], first: usize, window: Window) {
        let tolerance = i32::from(self.settings.back_check_px);
        let weak = self.weak.get(first..).unwrap_or_default();
        for (i, (pixel, &weak)) in out.iter_mut().zip(weak).enumerate() {
            if !pixel.has_value() || weak != (window == Window::Wide) {
                continue;
            }
            let disparity = usize::from((pixel.steps() + 8) >> 4);
            let back = (first + i).checked_sub(disparity).and_then(|x| self.right.disparity(x));
            // Rounding to the nearest pixel may be one off the place that was chosen: half a pixel is shared.
            if back.is_none_or(|back| (i32::from(back) - disparity as i32).abs() > tolerance) {
                *pixel = DisparityPixel::none(Reason::LeftRightMismatch);
            }
        }
    }
}

/// Which of the two windows a row is matched with.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Window {
    Narrow,
    Wide,
}

impl<const WIDTH: usize, const DISPARITIES: usize> Default for Matcher<WIDTH, DISPARITIES> {
    fn default() -> Self {
        Self::new()
    }
}

/// The best candidate, refined to 1/16 px, or why there is none. `top` is the disparity at place 0.
fn choose(costs: &[u16], candidates: Candidates, top: usize, uniqueness_percent: u16) -> DisparityPixel {
    let best = Best::find(&costs[candidates.first..candidates.end]);
    let place = candidates.first + best.place;
    // At an end of the range the true minimum may lie beyond, and there is no neighbour to interpolate with.
    if place == candidates.first || place + 1 >= candidates.end {
        return DisparityPixel::none(Reason::OutOfRange);
    }
    if uniqueness_percent > 0 {
        let second = u32::from(best.second(&costs[candidates.first..candidates.end]));
        if second * 100 <= u32::from(best.cost) * (100 + u32::from(uniqueness_percent)) {
            return DisparityPixel::none(Reason::NotUnique);
        }
    }
    let farther = i32::from(costs[place + 1]);
    let nearer = i32::from(costs[place - 1]);
    let steps = ((top - place) as i32) * 16 + best::refine(farther, i32::from(best.cost), nearer);
    DisparityPixel::from_steps(steps.max(0) as u16)
}

/// `costs += enter`, wrapping: the settings see to it that sums fit 16 bits.
fn add(costs: &mut [u16], enter: &[u16]) {
    for (cost, &enter) in costs.iter_mut().zip(enter) {
        *cost = cost.wrapping_add(enter);
    }
}

/// `costs += enter - leave`.
fn slide(costs: &mut [u16], enter: &[u16], leave: &[u16]) {
    for ((cost, &enter), &leave) in costs.iter_mut().zip(enter).zip(leave) {
        *cost = cost.wrapping_add(enter).wrapping_sub(leave);
    }
}

#[cfg(test)]
mod tests;
