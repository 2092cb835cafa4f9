//! Stereo matching: differences summed over a window, with every check that comes from the same costs.
//!
//! Rows of the rectified pair go in from the top, rows of the disparity picture come out, half a window later. Nothing of
//! the pictures is kept but the rows under the window.

mod bands;
mod best;
mod census;
mod columns;
mod plan;
mod prefilter;
mod rows;
mod settings;
mod steps;
mod strip;

pub(crate) use crate::arch::refine;
pub use rows::ValidSpan;
pub use settings::{MatchCost, MatchSettings, Prefilter};
pub(crate) use strip::Strip;

use crate::{
    arch::{self, Backend, CHUNK, Chosen, CostJob, Decide, Found, KeyJob, KeyLimits, Search, Sums},
    disparity::{DisparityPixel, Reason},
    error::{ConfigError, ConfigProblem},
    work::{self, Loop},
};
use best::RightBest;
use columns::Columns;
use plan::Plan;
use rows::Rows;
use steps::{CheckBack, DecidePixels, PushRow, SlideEvidence, SumEvidence};

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
    /// The backend that was asked for; the fastest one if none was.
    backend: Backend,
    is_forced: bool,
    plan: Plan,
    width: usize,
    height: usize,
    rows: Rows<WIDTH>,
    columns: Columns<WIDTH, DISPARITIES>,
    right: RightBest<WIDTH>,
    /// Pixels of the row that the narrow window could not tell for want of texture.
    weak: [bool; WIDTH],
    /// Sums under the window at the current pixel, largest disparity first, with room around them.
    work: [[i16; 4]; DISPARITIES],
    key_limits: KeyLimits,
    found: Found,
    sums: Sums,
}

impl<const WIDTH: usize, const DISPARITIES: usize> Matcher<WIDTH, DISPARITIES> {
    /// A matcher that is not configured and delivers nothing.
    pub const fn new() -> Self {
        Self {
            settings: MatchSettings::UNSET,
            backend: Backend::Plain,
            is_forced: false,
            plan: Plan::UNSET,
            width: 0,
            height: 0,
            rows: Rows::new(),
            columns: Columns::new(),
            right: RightBest::new(),
            weak: [false; WIDTH],
            work: [[0; 4]; DISPARITIES],
            key_limits: KeyLimits::new(),
            found: Found::new(),
            sums: Sums::new(),
        }
    }

    /// Chooses whose instructions are used from the next [`Self::configure`] on: without this, those of the fastest backend.
    /// Says whether the processor has them; if not, nothing changes. The results are the same with all of them.
    pub fn set_backend(&mut self, backend: Backend) -> bool {
        let available = backend.is_available();
        if available {
            (self.backend, self.is_forced) = (backend, true);
        }
        available
    }

    /// The backend in use: slower than the one that was asked for where tables have no room for its vectors or half as wide ones do
    /// with fewer places, and plain Rust for absolute differences.
    pub const fn backend(&self) -> Backend {
        self.plan.chosen.backend()
    }

    /// The same, as what shows that the processor has its instructions.
    pub(crate) const fn chosen(&self) -> Chosen {
        self.plan.chosen
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
        let backend = if self.is_forced { self.backend } else { Backend::fastest() };
        self.plan = Plan::new::<WIDTH, DISPARITIES>(backend, settings, width);
        self.key_limits.fill(settings.narrow_uniqueness_percent());
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
        let steps = PushRow {
            rows: &mut self.rows,
            pictures: [left, right],
            spans: [left_span, right_span],
            settings: &self.settings,
            chosen: self.plan.chosen,
        };
        arch::compiled(self.plan.chosen, steps);
        self.absorb();
    }

    /// Adds the newest filtered row, if there is one, to the column sums and takes the one that leaves the window out.
    fn absorb(&mut self) {
        let window = usize::from(self.settings.window_height);
        let first = self.rows.first_filtered();
        let Some(newest) = self.rows.newest_filtered() else { return };
        // Rows above the first filtered one never entered.
        let leaving = newest.checked_sub(window).filter(|&y| y >= first);
        let Self { rows, columns, width, plan, .. } = self;
        work::count(Loop::MatchFiltered, width.saturating_mul(3));
        work::count(
            Loop::MatchSlid,
            (1 + usize::from(leaving.is_some()))
                .saturating_mul(*width)
                .saturating_mul(usize::from(self.settings.disparities)),
        );
        let evidence = |y| rows.evidence(y, *width, self.settings.prefilter);
        arch::compiled(plan.chosen, SlideEvidence { columns, enter: evidence(newest), leave: leaving.map(evidence) });
        let range = [usize::from(self.settings.disparities), usize::from(self.settings.min_disparity)];
        match self.settings.cost {
            MatchCost::Census => {
                let (enter, leave) = (rows.codes(newest, *width), leaving.map(|y| rows.codes(y, *width)));
                columns.slide_codes(plan.chosen, plan.stride, range, enter, leave);
            }
            MatchCost::AbsoluteDifferences => {
                columns.slide_grey(range, rows.filtered(newest, *width), leaving.map(|y| rows.filtered(y, *width)));
            }
        }
    }

    /// Writes disparity row `next` to `out` if all that it needs has come; says whether it did. Rows are to be taken in order,
    /// each as soon as it is there: after every [`Self::push`], until this says no. After the last push it delivers the rest.
    pub fn pull(&mut self, next: usize, out: &mut [DisparityPixel]) -> bool {
        if next >= self.height || out.len() != self.width {
            return false;
        }
        // A row of the window needs rows around it for what is compared.
        let [_, margin] = self.settings.margins();
        let lowest = next.saturating_add(margin);
        let border = next < margin || lowest >= self.height;
        let available = if border { next < self.rows.pushed() } else { lowest < self.rows.pushed() };
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
        self.weak.get_mut(..self.width).unwrap_or_default().fill(false);
        self.pass(y, Window::Narrow, out);
        let weak = self.weak.get(..self.width).unwrap_or_default();
        if self.settings.wide_window_width > 0 && weak.contains(&true) {
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
            Window::Narrow => settings.narrow_uniqueness_percent(),
            Window::Wide => [settings.wide_uniqueness_percent; 2],
        };
        let radius = usize::from(width) / 2;
        let margin = radius + settings.reach();
        // Columns that the window and what is compared may touch, and their middle pixels.
        let (left, right) = self.rows.spans(y, usize::from(settings.window_height) / 2 + 1);
        let first = usize::from(left.start) + margin;
        let end = usize::from(left.end).min(self.width).saturating_sub(margin);
        if first >= end {
            return;
        }
        // Windows and percents were checked: nothing here is near the limits of the numbers.
        let area = u32::from(width).saturating_mul(u32::from(settings.window_height));
        let decide = Decide {
            min_texture: area.saturating_mul(u32::from(settings.texture)) >> 4,
            weak_texture: area.saturating_mul(u32::from(settings.weak_texture)) >> 4,
            max_saturated: area.saturating_mul(u32::from(settings.saturated_percent)) / 100,
            unique: uniqueness_percent.map(|percent| percent > 0),
            only_weak: window == Window::Wide,
            keys: window == Window::Narrow && self.plan.keys,
        };
        let mut search = Search {
            range: first..first,
            follows: false,
            radius,
            stride: self.plan.stride,
            disparities: usize::from(settings.disparities),
            min_disparity: usize::from(settings.min_disparity),
            right_first: usize::from(right.start) + margin,
            right_end: usize::from(right.end).min(self.width).saturating_sub(margin),
            uniqueness_percent,
            is_small: settings.cost == MatchCost::Census && settings.window_height <= 127 / 8 && area <= 2040 / 8,
        };
        if window == Window::Narrow {
            self.right.begin();
        }
        let mut begun = 0usize;
        let mut run = first..if window == Window::Narrow { end } else { first };
        loop {
            if run.is_empty() && window == Window::Wide {
                let most_gap = if begun < SHORT_GAPS { radius / 3 } else { radius.saturating_mul(2) };
                run = self.weak_run(run.end..end, most_gap);
                begun = begun.saturating_add(1);
            }
            if run.is_empty() {
                break;
            }
            search.follows = search.range.end == run.start && !search.range.is_empty();
            search.range = run.start..run.end.min(run.start.saturating_add(CHUNK));
            run.start = search.range.end;
            count_chunk(&search, window);
            let (sums, found) = (&mut self.sums, &mut self.found);
            let evidence = self.columns.evidence();
            let weak_texture = decide.weak_texture;
            arch::compiled(self.plan.chosen, SumEvidence { search: &search, evidence, weak_texture, sums, found });
            self.search(&search, window);
            let chunk = search.range.clone();
            let (Some(out), Some(weak)) = (out.get_mut(chunk.clone()), self.weak.get_mut(chunk)) else { break };
            let steps =
                DecidePixels { decide: &decide, search: &search, found: &self.found, sums: &self.sums, out, weak };
            arch::compiled(self.plan.chosen, steps);
        }
        if settings.back_check && window == Window::Narrow {
            let (right, plan, tolerance) = (&mut self.right, &self.plan, settings.back_check_px);
            let Some(out) = out.get_mut(first..end) else { return };
            work::count(Loop::MatchChecked, out.len());
            arch::compiled(plan.chosen, CheckBack { right, plan, tolerance, first, out });
        }
    }

    /// The next run of weak pixels in `range`; gaps of up to `most_gap` pixels are part of it. Empty if there is none.
    fn weak_run(&self, range: core::ops::Range<usize>, most_gap: usize) -> core::ops::Range<usize> {
        let weak = self.weak.get(range.clone()).unwrap_or_default();
        let Some(skipped) = first_weak(weak) else {
            work::count(Loop::MatchScanned, weak.len());
            return range.end..range.end;
        };
        let (mut end, mut gap) = (skipped, 0usize);
        for (i, &weak) in (1..=weak.len()).zip(weak).skip(skipped) {
            if weak {
                (end, gap) = (i, 0);
            } else {
                gap = gap.saturating_add(1);
                if gap > most_gap {
                    break;
                }
            }
        }
        work::count(Loop::MatchScanned, end.saturating_add(gap));
        // Within the range.
        range.start.wrapping_add(skipped)..range.start.wrapping_add(end)
    }

    /// Finds the best places of a chunk, in the way of the plan.
    fn search(&mut self, search: &Search, window: Window) {
        let Self { plan, columns, right, found, .. } = self;
        let work = self.work.as_flattened_mut();
        let lent = right.lend(plan.lead);
        match (self.settings.cost, window) {
            (MatchCost::Census, Window::Narrow) if plan.keys => {
                let (limits, columns) = (&self.key_limits, columns.bytes());
                arch::search_keys(plan.chosen, KeyJob { search, limits, columns, work, right: lent, found });
            }
            (MatchCost::Census, _) => {
                let (columns, right) = (columns.bytes(), (window == Window::Narrow).then_some(lent));
                arch::search_bytes(plan.chosen, CostJob { search, columns, work, right, found });
            }
            (MatchCost::AbsoluteDifferences, _) => {
                let (columns, right) = (columns.words(), (window == Window::Narrow).then_some(lent));
                arch::search_words(CostJob { search, columns, work, right, found });
            }
        }
    }
}

/// Counts the costs that a chunk looks at, and the pixels that are decided on.
#[inline(always)]
fn count_chunk(search: &Search, window: Window) {
    let of = if window == Window::Wide { Loop::MatchWide } else { Loop::MatchNarrow };
    work::count(of, search.range.len().saturating_mul(search.disparities));
    let begun = if search.follows { 0 } else { search.radius.saturating_mul(2).saturating_add(1) };
    work::count(Loop::MatchBegun, begun.saturating_mul(search.disparities));
    work::count(Loop::MatchDecided, CHUNK);
}

/// The first weak pixel; most blocks have none.
fn first_weak(weak: &[bool]) -> Option<usize> {
    const BLOCK: usize = 32;
    let some = |block: &[bool]| block.iter().fold(false, |some, &weak| some | weak);
    let mut blocks = (0..weak.len()).step_by(BLOCK).zip(weak.chunks(BLOCK));
    let (first, pixels) = blocks.find(|(_, block)| some(block))?;
    pixels.iter().position(|&weak| weak)?.checked_add(first)
}

/// Runs of weak pixels in a row that end at a gap that is longer than it takes to start anew. Those that come after have to be farther
/// apart, as far as a start adds up columns: so no row costs much more than one that is weak all along.
const SHORT_GAPS: usize = 4;

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

#[cfg(test)]
mod tests;
