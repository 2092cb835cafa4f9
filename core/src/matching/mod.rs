//! Stereo matching: sums of absolute differences over a window, with every check that comes from the same costs.
//!
//! Rows of the rectified pair go in from the top, rows of the disparity picture come out, half a window later. Nothing of
//! the pictures is kept but the rows under the window.

mod best;
mod columns;
mod prefilter;
mod rows;
mod settings;
mod strip;

pub(crate) use best::refine;
pub use rows::ValidSpan;
pub use settings::{MatchSettings, Prefilter};
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
/// Source: the paper, section 2.2 (sum of absolute differences, 7 x 7) and 4.2 (validation). The four checks come from one
/// pass over the costs of a row.
///
/// # Bound
/// Each output row takes `width x disparities` steps for the costs, the same for the selection, and `width` for the rest.
pub struct Matcher<const WIDTH: usize, const DISPARITIES: usize> {
    settings: MatchSettings,
    width: usize,
    height: usize,
    rows: Rows<WIDTH>,
    columns: Columns<WIDTH, DISPARITIES>,
    right: RightBest<WIDTH>,
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
        self.rows.begin();
        self.columns.begin();
    }

    /// Takes the next row of the rectified pair, from the top.
    ///
    /// Rows after the last one of the picture, and rows of another width, are left out.
    pub fn push(&mut self, left: &[u8], right: &[u8], left_span: ValidSpan, right_span: ValidSpan) {
        if left.len() != self.width || right.len() != self.width || self.rows.pushed() >= self.height {
            return;
        }
        self.rows.push(left, right, left_span, right_span, self.settings.prefilter);
        self.absorb();
    }

    /// Adds the newest filtered row, if there is one, to the column sums and takes the one that leaves the window out.
    fn absorb(&mut self) {
        let window = usize::from(self.settings.window);
        let Some(newest) = self.rows.newest_filtered() else { return };
        let enter = self.rows.filtered(newest, self.width);
        // Row 0 was never filtered, so it never entered.
        let leave = newest.checked_sub(window).filter(|&y| y > 0).map(|y| self.rows.filtered(y, self.width));
        let disparities = usize::from(self.settings.disparities);
        self.columns.slide(enter, leave, disparities, usize::from(self.settings.min_disparity));
    }

    /// Writes disparity row `next` to `out` if all that it needs has come; says whether it did. Rows are to be taken in order,
    /// each as soon as it is there: after every [`Self::push`], until this says no. After the last push it delivers the rest.
    pub fn pull(&mut self, next: usize, out: &mut [DisparityPixel]) -> bool {
        if next >= self.height || out.len() != self.width {
            return false;
        }
        // A row of the window needs the row below it for the vertical part of the filter.
        let margin = usize::from(self.settings.window) / 2 + 1;
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

    /// Matches the row under the middle of the window.
    fn match_row(&mut self, y: usize, out: &mut [DisparityPixel]) {
        let radius = usize::from(self.settings.window) / 2;
        let window = 2 * radius + 1;
        let disparities = usize::from(self.settings.disparities);
        let min_disparity = usize::from(self.settings.min_disparity);
        let (left, right) = self.rows.spans(y, radius + 1);
        // Columns that the window and its filter may touch, and their middle pixels.
        let first = usize::from(left.start) + radius + 1;
        let end = usize::from(left.end).min(self.width).saturating_sub(radius + 1);
        out.fill(DisparityPixel::none(Reason::OutsideValidArea));
        if first >= end {
            return;
        }
        let right_first = usize::from(right.start) + radius + 1;
        let right_end = usize::from(right.end).min(self.width).saturating_sub(radius + 1);
        self.right.begin(self.width);
        let costs = &mut self.costs[..disparities];
        costs.fill(0);
        let (mut texture, mut saturated) = (0u32, 0u32);
        for x in first - radius..first + radius {
            add(costs, self.columns.costs(x, disparities));
            texture += u32::from(self.columns.texture(x));
            saturated += u32::from(self.columns.saturated(x));
        }
        let area = (window * window) as u32;
        let min_texture = (u32::from(self.settings.texture) * area) >> 4;
        let max_saturated = area * u32::from(self.settings.saturated_percent) / 100;
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
            let Some(out) = out.get_mut(x) else { break };
            let Some(reach) = x.checked_sub(right_first) else { continue };
            let largest = (min_disparity + disparities - 1).min(reach);
            let smallest = min_disparity.max((x + 1).saturating_sub(right_end));
            if largest < smallest || right_first >= right_end {
                continue;
            }
            let place = |disparity: usize| min_disparity + disparities - 1 - disparity;
            let candidates = Candidates { first: place(largest), end: place(smallest) + 1 };
            self.right.offer(&costs[candidates.first..candidates.end], x - largest, largest as u16);
            *out = if saturated > max_saturated {
                DisparityPixel::none(Reason::Saturated)
            } else if texture < min_texture {
                DisparityPixel::none(Reason::LowTexture)
            } else {
                choose(costs, candidates, min_disparity + disparities - 1, self.settings.uniqueness_percent)
            };
        }
        if self.settings.back_check {
            self.back_check(&mut out[first..end], first, i32::from(self.settings.back_check_px));
        }
    }

    /// Takes out pixels whose right partner matches another left pixel better.
    fn back_check(&self, out: &mut [DisparityPixel], first: usize, tolerance: i32) {
        for (i, pixel) in out.iter_mut().enumerate() {
            if !pixel.has_value() {
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

/// `costs += enter`, wrapping: sums of up to 21 x 21 differences of up to 127 fit 16 bits.
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
