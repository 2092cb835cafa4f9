//! Sparse matches that look above and below the row, and nearer than the disparity range.

use core::{
    array::from_fn,
    ops::{Range, RangeInclusive},
};

use heapless::Vec;

use crate::{
    arch::{self, Chosen, Steps},
    disparity::{DisparityPixel, Reason},
    matching::{Strip, refine},
    work::{self, Loop},
};

/// Strips down the picture and places across it at which a match is looked for.
pub(crate) const STRIPS: usize = 16;
const PLACES: usize = 8;

/// Half the edge of the patches that are compared, px.
const RADIUS: usize = 3;

/// Rows above and below that are searched.
const REACH: usize = 4;

/// Rows of the matcher that are needed above and below the one that is looked at.
pub(crate) const MARGIN: usize = RADIUS + REACH;

/// Disparities to either side that are searched along with the rows: an edge that is not upright seems moved along the row
/// when it is moved across.
const ALONG: usize = 3;

const PATCH: u32 = ((2 * RADIUS + 1) * (2 * RADIUS + 1)) as u32;

/// Two rows off, a patch must fit worse by this for each pixel, filtered grey values: otherwise it does not say in which row it
/// belongs.
const LEAST_RISE: u32 = 2 * PATCH;

/// Least contrast around a place that is worth looking at, filtered grey values, summed over 3 x 3 pixels.
const LEAST_CONTRAST: u16 = 40;

/// Neighbouring places that are looked at together.
const LANES: usize = 16;

/// Places without a disparity that are looked for over the whole range, at most.
const SEARCHES: usize = 64;

/// How many times the disparity range is searched for what is too near.
const NEARER: usize = 3;

/// Fewer matches say nothing.
const LEAST_MATCHES: usize = 12;
const LEAST_PLACES: u16 = 8;

/// What the sparse matches of one picture say.
#[derive(Clone, Debug)]
pub(crate) struct SparseMatches {
    /// Rows by which the right picture lies lower, 1/16 px.
    errors: Vec<i16, { STRIPS * PLACES }, u16>,
    searches_left: usize,
    /// Places in the lower half, and those among them that match nearer than the range by far the best.
    lower: u16,
    near: u16,
    chosen: Chosen,
}

/// For each match by the how manieth search of a band it was found, from 1; 0 for none.
pub(crate) type Ordinals = Vec<u8, { STRIPS * PLACES }, u16>;

/// What the sparse matches say of the rows and of the near zone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowSign {
    /// Middle one of the distances between the rows in which left and right show the same, px; 0 if there are too few matches.
    pub error_px: f32,
    /// Matches that say so.
    pub matches: u16,
    /// Share of the places in the lower half that match nearer than the disparity range reaches, percent.
    pub near_percent: f32,
}

/// First and last disparity of the search range, px.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SearchRange {
    pub(crate) first: usize,
    pub(crate) last: usize,
}

impl SparseMatches {
    pub(crate) const fn new() -> Self {
        Self { errors: Vec::new(), searches_left: 0, lower: 0, near: 0, chosen: Chosen::PLAIN }
    }

    /// Has patches compared with the instructions of a backend.
    pub(crate) const fn choose(&mut self, chosen: Chosen) {
        self.chosen = chosen;
    }

    /// Starts a picture.
    pub(crate) fn begin(&mut self) {
        self.errors.clear();
        self.searches_left = SEARCHES;
        (self.lower, self.near) = (0, 0);
    }

    /// Adds the matches of rows below, whose searches are numbered: only as many searches of the whole picture count as there are.
    ///
    /// # Bound
    /// One step for each match.
    pub(crate) fn append(&mut self, other: &Self, ordinals: &Ordinals) {
        for (&error, &ordinal) in other.errors.iter().zip(ordinals) {
            if usize::from(ordinal) <= self.searches_left {
                // Cannot fail: there is room for every place.
                let _ = self.errors.push(error);
            }
        }
        self.searches_left = self.searches_left.saturating_sub(SEARCHES.saturating_sub(other.searches_left));
        // No more than there are places in the whole picture.
        self.lower = self.lower.saturating_add(other.lower);
        self.near = self.near.saturating_add(other.near);
    }

    /// Looks along the middle row of `strip`, whose disparities are `row`; `lower` if it lies in the lower half. `ordinals` are told
    /// for each match by the how manieth search it was found, 0 for none.
    ///
    /// # Bound
    /// Nine steps for every second pixel of the row; for each of [`PLACES`] places `7 x 9` patches of 49 pixels, `3 x` the
    /// search range in the lower half, and at [`SEARCHES`] places of the picture `9 x` the search range.
    pub(crate) fn look(
        &mut self,
        strip: &Strip<'_, { 2 * MARGIN + 1 }>,
        row: &[DisparityPixel],
        range: SearchRange,
        lower: bool,
        mut ordinals: Option<&mut Ordinals>,
    ) {
        let span = strip.left_span;
        let (start, end) = (usize::from(span.start) + RADIUS + 1, usize::from(span.end).min(row.len()));
        let end = end.saturating_sub(RADIUS + 1);
        let width = end.saturating_sub(start);
        for place in 0..PLACES {
            // Within the row.
            let at = |place: usize| start.wrapping_add(width.wrapping_mul(place) / PLACES);
            let part = at(place)..at(place + 1);
            if let Some(x) = most_contrast(self.chosen, strip, row, part) {
                let (errors, searches_left) = (self.errors.len(), self.searches_left);
                self.look_at(strip, x, row.get(x).copied().unwrap_or_default(), range, lower);
                if let Some(ordinals) = ordinals.as_deref_mut().filter(|_| self.errors.len() > errors) {
                    let searched = searches_left > self.searches_left;
                    // Cannot fail: there is room for as many as for errors.
                    let _ = ordinals.push(if searched { SEARCHES.saturating_sub(self.searches_left) as u8 } else { 0 });
                }
            }
        }
    }

    fn look_at(
        &mut self,
        strip: &Strip<'_, { 2 * MARGIN + 1 }>,
        x: usize,
        pixel: DisparityPixel,
        range: SearchRange,
        lower: bool,
    ) {
        let known = pixel.has_value().then(|| usize::from((pixel.steps() + 8) >> 4));
        if lower {
            let within = match known {
                Some(disparity) => {
                    best_along(self.chosen, strip, x, disparity.saturating_sub(1)..=disparity.saturating_add(1))
                }
                None => best_along(self.chosen, strip, x, range.first..=range.last),
            };
            let nearer = best_along(self.chosen, strip, x, range.last..=range.last.saturating_mul(NEARER));
            let far_better = |cost: u32| within.is_none_or(|(best, _)| cost.saturating_mul(2) < best);
            self.lower = self.lower.saturating_add(1);
            self.near = self.near.saturating_add(u16::from(nearer.is_some_and(|(cost, _)| far_better(cost))));
        }
        let disparity = match known {
            Some(disparity) => disparity,
            None if self.searches_left > 0 => {
                self.searches_left -= 1;
                let chosen = self.chosen;
                let rows = (0..=2 * REACH).filter_map(|down| best_at(chosen, strip, x, range.first..=range.last, down));
                let Some((_, disparity)) = rows.min() else { return };
                disparity
            }
            None => return,
        };
        if let Some(error) = row_error(self.chosen, strip, x, disparity) {
            // Cannot fail: there is room for every place.
            let _ = self.errors.push(error);
        }
    }

    /// What the matches of the picture say.
    ///
    /// # Bound
    /// 15 passes over at most `STRIPS x PLACES` numbers.
    pub(crate) fn sign(&mut self) -> RowSign {
        let matches = self.errors.len();
        let middle = if matches >= LEAST_MATCHES { middle_of(&self.errors) } else { 0 };
        let near_percent = 100.0 * f32::from(self.near) / f32::from(self.lower.max(LEAST_PLACES));
        RowSign { error_px: f32::from(middle) / 16.0, matches: matches as u16, near_percent }
    }
}

/// The middle one of the absolute values, found bit by bit: sorting would call itself, and how deep would be told by no type.
fn middle_of(errors: &[i16]) -> i16 {
    let before = errors.len() / 2;
    (0..15).rev().fold(0, |least: u16, bit| {
        let next = least | 1 << bit;
        let smaller =
            errors.iter().fold(0usize, |count, error| count.wrapping_add(usize::from(error.unsigned_abs() < next)));
        if smaller <= before { next } else { least }
    }) as i16
}

/// The place with the most contrast both along and across the row. Whether it has a disparity must not count: where rows are out
/// of line, those have one that do not show it.
fn most_contrast(
    chosen: Chosen,
    strip: &Strip<'_, { 2 * MARGIN + 1 }>,
    row: &[DisparityPixel],
    part: Range<usize>,
) -> Option<usize> {
    let mut place = None;
    arch::compiled(chosen, MostContrast { strip, row, part, place: &mut place });
    place
}

/// The steps of [`most_contrast`].
struct MostContrast<'a> {
    strip: &'a Strip<'a, { 2 * MARGIN + 1 }>,
    row: &'a [DisparityPixel],
    part: Range<usize>,
    place: &'a mut Option<usize>,
}

impl Steps for MostContrast<'_> {
    #[inline(always)]
    fn run(self) {
        *self.place = contrasts(self.strip, self.row, self.part);
    }
}

#[inline(always)]
fn contrasts(strip: &Strip<'_, { 2 * MARGIN + 1 }>, row: &[DisparityPixel], part: Range<usize>) -> Option<usize> {
    let rows = [MARGIN - 1, MARGIN, MARGIN + 1].map(|y| strip.left.get(y).copied().unwrap_or_default());
    let mut best = (0, None);
    for first in part.clone().step_by(LANES) {
        work::count(Loop::HealthPlaces, LANES);
        // One more to either side of the lanes.
        let [above, middle, below] = rows.map(|row| window::<{ LANES + 2 }>(row, first.saturating_sub(1)));
        let steps = |a: u8, b: u8| u16::from(a.abs_diff(b));
        // Six steps of at most 255 at most.
        let sum = u16::wrapping_add;
        let across: [u16; LANES + 2] = from_fn(|i| sum(steps(above[i], middle[i]), steps(middle[i], below[i])));
        let along: [u16; LANES + 1] =
            from_fn(|i| [above, middle, below].iter().fold(0, |all, row| sum(all, steps(row[i], row[i + 1]))));
        let contrasts: [u16; LANES] =
            from_fn(|i| sum(sum(across[i], across[i + 1]), across[i + 2]).min(sum(along[i], along[i + 1])));
        // Every second place.
        for (x, &[contrast, _]) in (first..part.end).step_by(2).zip(contrasts.as_chunks::<2>().0) {
            if contrast < LEAST_CONTRAST || contrast <= best.0 {
                continue;
            }
            let Some(pixel) = row.get(x) else { break };
            if !matches!(pixel.get(), Err(Reason::OutsideValidArea | Reason::Saturated)) {
                best = (contrast, Some(x));
            }
        }
    }
    best.1
}

/// `N` bytes of `row` from `first` on; 0 beyond its end.
#[inline(always)]
fn window<const N: usize>(row: &[u8], first: usize) -> [u8; N] {
    let bytes = row.get(first..).unwrap_or_default();
    if let Some(whole) = bytes.first_chunk::<N>() {
        return *whole;
    }
    let mut padded = [0; N];
    padded.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
    padded
}

/// The row in which the right picture shows the patch at `x`, against that of the left, 1/16 px; `None` if that cannot be told.
fn row_error(chosen: Chosen, strip: &Strip<'_, { 2 * MARGIN + 1 }>, x: usize, disparity: usize) -> Option<i16> {
    let disparities = disparity.saturating_sub(ALONG)..=disparity.saturating_add(ALONG);
    let mut costs = [u32::MAX; 2 * REACH + 1];
    for (down, cost) in costs.iter_mut().enumerate() {
        *cost = best_at(chosen, strip, x, disparities.clone(), down)?.0;
    }
    let (best, cost) = costs.iter().copied().enumerate().min_by_key(|(_, cost)| *cost)?;
    let aside = [best.checked_sub(2), best.checked_add(2)].map(|place| place.and_then(|place| costs.get(place)));
    // Costs have 16 bits.
    let far_above =
        |other: u32| other >= cost.saturating_add(LEAST_RISE) && other.saturating_mul(4) >= cost.saturating_mul(5);
    let rises = aside.into_iter().flatten().all(|&other| far_above(other));
    let above = *costs.get(best.checked_sub(1)?)?;
    let below = *costs.get(best.checked_add(1)?)?;
    let fraction = refine(above as i32, cost as i32, below as i32);
    rises.then_some((best as i16).wrapping_sub(REACH as i16).wrapping_mul(16).wrapping_add(fraction as i16))
}

/// The least cost along the row itself, and its disparity.
fn best_along(
    chosen: Chosen,
    strip: &Strip<'_, { 2 * MARGIN + 1 }>,
    x: usize,
    disparities: RangeInclusive<usize>,
) -> Option<(u32, usize)> {
    best_at(chosen, strip, x, disparities, REACH)
}

/// The least cost of the patch at `x` of the left picture, `down - REACH` rows lower in the right one, and its disparity.
fn best_at(
    chosen: Chosen,
    strip: &Strip<'_, { 2 * MARGIN + 1 }>,
    x: usize,
    disparities: RangeInclusive<usize>,
    down: usize,
) -> Option<(u32, usize)> {
    let mut best = None;
    arch::compiled(chosen, BestAt { strip, x, disparities, down, best: &mut best });
    best
}

/// The steps of [`best_at`].
struct BestAt<'a> {
    strip: &'a Strip<'a, { 2 * MARGIN + 1 }>,
    x: usize,
    disparities: RangeInclusive<usize>,
    down: usize,
    best: &'a mut Option<(u32, usize)>,
}

impl Steps for BestAt<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { strip, x, disparities, down, best } = self;
        *best = least_cost(strip, x, &disparities, down);
    }
}

#[inline(always)]
fn least_cost(
    strip: &Strip<'_, { 2 * MARGIN + 1 }>,
    x: usize,
    disparities: &RangeInclusive<usize>,
    down: usize,
) -> Option<(u32, usize)> {
    // Places in the right picture whose patch is valid and whose disparity is asked for.
    let (first, end) = (usize::from(strip.right_span.start) + RADIUS, usize::from(strip.right_span.end));
    let nearest = x.checked_sub(*disparities.start())?.saturating_add(1).min(end.saturating_sub(RADIUS));
    let first = x.saturating_sub(*disparities.end()).max(first);
    let mut best: Option<(u32, usize)> = None;
    let mut upto = nearest;
    // From the smallest disparity on, which wins where several fit alike.
    while upto > first {
        let from = upto.saturating_sub(LANES).max(first);
        work::count(Loop::HealthCosts, LANES);
        let costs = costs(strip, x, from, down);
        let lanes = upto.wrapping_sub(from);
        let least = costs.iter().take(lanes).copied().min().unwrap_or(u16::MAX);
        if best.is_none_or(|(cost, _)| u32::from(least) < cost) {
            // The last of equals, without the reversed zip that could panic.
            let lane =
                (0..lanes).zip(&costs).fold(None, |last, (lane, cost)| if *cost == least { Some(lane) } else { last });
            // Not to the right of the place in the left picture: no disparity is negative.
            best = lane.map(|lane| (u32::from(least), x.wrapping_sub(from).wrapping_sub(lane))).or(best);
        }
        upto = from;
    }
    best
}

/// Sums of the absolute differences of the patch at `x` of the left picture and each of [`LANES`] patches of the right one, from
/// that at `there` on.
#[inline(always)]
fn costs(strip: &Strip<'_, { 2 * MARGIN + 1 }>, x: usize, there: usize, down: usize) -> [u16; LANES] {
    let mut costs = [0u16; LANES];
    let right = strip.right.get(down..).unwrap_or_default();
    let rows = strip.left.iter().skip(REACH).zip(right).take(2 * RADIUS + 1);
    for (left, right) in rows {
        let left: [u8; 2 * RADIUS + 1] = window(left, x.saturating_sub(RADIUS));
        let right: [u8; LANES + 2 * RADIUS] = window(right, there.saturating_sub(RADIUS));
        for (column, &grey) in left.iter().enumerate() {
            let places = right.iter().skip(column);
            for (cost, &other) in costs.iter_mut().zip(places) {
                // 49 differences of at most 255.
                *cost = cost.wrapping_add(u16::from(grey.abs_diff(other)));
            }
        }
    }
    costs
}

#[cfg(test)]
#[path = "row_error_tests.rs"]
mod tests;
