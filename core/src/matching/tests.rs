//! The matcher against a slow plain version.

use std::{boxed::Box, collections::BTreeMap, ops::Range, vec, vec::Vec};

use super::*;
use crate::test_random::Random;

mod backends;
mod parts;

const WIDTH: usize = 112;
const DISPARITIES: usize = 32;

type Grey = Vec<Vec<u8>>;

/// A pair of pictures with the columns of each row that are valid.
struct Pair {
    left: Grey,
    right: Grey,
    spans: Vec<(ValidSpan, ValidSpan)>,
}

/// Every step as its definition says, over whole pictures.
struct Plain<'a> {
    pair: &'a Pair,
    settings: MatchSettings,
}

/// One of the two windows: half its width and height, what it asks for, and the costs of the whole picture under it.
struct PlainWindow {
    half: [i32; 2],
    /// Where there is texture, and where it is weak.
    uniqueness_percent: [i32; 2],
    checks_back: bool,
    /// By row, column and disparity; `None` where a window does not lie within what is valid.
    costs: Vec<Vec<Vec<Option<i32>>>>,
}

impl PlainWindow {
    fn offsets(&self) -> impl Iterator<Item = (i32, i32)> + use<> {
        let [half_width, half_height] = self.half;
        (-half_height..=half_height).flat_map(move |dy| (-half_width..=half_width).map(move |dx| (dx, dy)))
    }

    fn area(&self) -> i32 {
        (2 * self.half[0] + 1) * (2 * self.half[1] + 1)
    }
}

impl<'a> Plain<'a> {
    fn new(pair: &'a Pair, settings: MatchSettings) -> Self {
        Self { pair, settings }
    }

    fn size(&self) -> [i32; 2] {
        [self.pair.left[0].len() as i32, self.pair.left.len() as i32]
    }

    fn range(&self) -> Range<i32> {
        let min = i32::from(self.settings.min_disparity);
        min..min + i32::from(self.settings.disparities)
    }

    /// What a pixel's prefilter says: the horizontal Sobel response in eighths from -31 to 31, lifted by 31, or half the grey value.
    fn filtered(&self, picture: &Grey, x: i32, y: i32) -> i32 {
        let at = |x: i32, y: i32| i32::from(picture[y as usize][x as usize]);
        match self.settings.prefilter {
            Prefilter::Grey => at(x, y) / 2,
            Prefilter::HorizontalSobel => {
                if x == 0 || x + 1 == self.size()[0] {
                    return 31;
                }
                let sum: i32 =
                    [(-1, 1), (0, 2), (1, 1)].iter().map(|&(dy, w)| w * (at(x + 1, y + dy) - at(x - 1, y + dy))).sum();
                sum.clamp(-31, 31) + 31
            }
        }
    }

    /// How different a pixel of the left picture is from one of the right picture.
    fn difference(&self, (x, y): (i32, i32), right_x: i32) -> i32 {
        let Pair { left, right, .. } = self.pair;
        match self.settings.cost {
            MatchCost::AbsoluteDifferences => (self.filtered(left, x, y) - self.filtered(right, right_x, y)).abs(),
            MatchCost::Census => {
                let ring = [(-2, -2), (2, -2), (-2, 2), (2, 2), (-3, 0), (3, 0), (0, -3), (0, 3)];
                let darker = |picture: &Grey, x: i32, (dx, dy): (i32, i32)| {
                    picture[(y + dy) as usize][(x + dx) as usize] < picture[y as usize][x as usize]
                };
                ring.iter().filter(|&&at| darker(left, x, at) != darker(right, right_x, at)).count() as i32
            }
        }
    }

    /// Columns of row `y` at which a window may stand, in the left and in the right picture.
    fn columns(&self, half: [i32; 2], y: i32) -> [Range<i32>; 2] {
        let reach = match self.settings.cost {
            MatchCost::Census => 3,
            MatchCost::AbsoluteDifferences => 1,
        };
        let [width, height] = self.size();
        let [aside, along] = half.map(|half| half + reach);
        if y < along || y + along >= height {
            return [0..0, 0..0];
        }
        let rows = &self.pair.spans[(y - along) as usize..=(y + along) as usize];
        let within = |of: fn(&(ValidSpan, ValidSpan)) -> ValidSpan| {
            let start = rows.iter().map(|row| i32::from(of(row).start)).max().unwrap();
            let end = rows.iter().map(|row| i32::from(of(row).end)).min().unwrap().min(width);
            start + aside..end - aside
        };
        [within(|row| row.0), within(|row| row.1)]
    }

    fn window(&self, width: u16, uniqueness_percent: [u16; 2], checks_back: bool) -> PlainWindow {
        let half = [width, self.settings.window_height].map(|edge| i32::from(edge / 2));
        let uniqueness_percent = uniqueness_percent.map(i32::from);
        let mut window = PlainWindow { half, uniqueness_percent, checks_back, costs: Vec::new() };
        let [width, height] = self.size();
        // Differences of single pixels, so that each is worked out once.
        let inside = |x: i32| (3..width - 3).contains(&x) || self.settings.cost != MatchCost::Census;
        let single = |x: i32, y: i32, d: i32| {
            let comparable = (3..height - 3).contains(&y) || self.settings.cost != MatchCost::Census;
            let rows = (1..height - 1).contains(&y) && comparable;
            (rows && x - d >= 0 && inside(x) && inside(x - d)).then(|| self.difference((x, y), x - d))
        };
        let each = |of: &dyn Fn(i32, i32, i32) -> Option<i32>| -> Vec<Vec<Vec<Option<i32>>>> {
            let row = |y| (0..width).map(|x| self.range().map(|d| of(x, y, d)).collect()).collect();
            (0..height).map(row).collect()
        };
        let differences = each(&single);
        let costs = each(&|x, y, d| {
            let [left, right] = self.columns(window.half, y);
            let place = (d - self.range().start) as usize;
            let at = |(dx, dy): (i32, i32)| differences[(y + dy) as usize][(x + dx) as usize][place].unwrap();
            (left.contains(&x) && right.contains(&(x - d))).then(|| window.offsets().map(at).sum())
        });
        window.costs = costs;
        window
    }

    fn cost(&self, window: &PlainWindow, (x, y): (i32, i32), d: i32) -> Option<i32> {
        let place = usize::try_from(d - self.range().start).ok()?;
        *window.costs.get(y as usize)?.get(usize::try_from(x).ok()?)?.get(place)?
    }

    /// Sum under a window of what each pixel says about where it lies along the row.
    fn texture(&self, window: &PlainWindow, (x, y): (i32, i32)) -> i32 {
        let response = |(dx, dy): (i32, i32)| {
            let here = self.filtered(&self.pair.left, x + dx, y + dy);
            match self.settings.prefilter {
                Prefilter::HorizontalSobel => (here - 31).abs(),
                Prefilter::Grey => (here - self.filtered(&self.pair.left, x + dx - 1, y + dy)).abs(),
            }
        };
        window.offsets().map(response).sum()
    }

    /// What one window says of a pixel, without what the other one says; `None` where it has no candidates.
    fn ask(&self, window: &PlainWindow, (x, y): (i32, i32)) -> Option<DisparityPixel> {
        let candidates: Vec<(i32, i32)> =
            self.range().filter_map(|d| Some((d, self.cost(window, (x, y), d)?))).collect();
        let (&(nearest, _), &(farthest, _)) = (candidates.last()?, candidates.first()?);
        let saturated =
            |&(dx, dy): &(i32, i32)| matches!(self.pair.left[(y + dy) as usize][(x + dx) as usize], 0 | 255);
        let saturated = window.offsets().filter(saturated).count() as i32;
        if saturated > window.area() * i32::from(self.settings.saturated_percent) / 100 {
            return Some(DisparityPixel::none(Reason::Saturated));
        }
        if self.texture(window, (x, y)) < i32::from(self.settings.texture) * window.area() / 16 {
            return Some(DisparityPixel::none(Reason::LowTexture));
        }
        // The largest disparity wins a tie.
        let &(d, best) = candidates.iter().rev().min_by_key(|&&(_, cost)| cost)?;
        if d == nearest || d == farthest {
            return Some(DisparityPixel::none(Reason::OutOfRange));
        }
        let second = candidates.iter().filter(|&&(other, _)| (other - d).abs() > 1).map(|&(_, cost)| cost).min();
        let percent = window.uniqueness_percent[usize::from(self.is_weak(window, (x, y)))];
        if percent > 0 && second.is_some_and(|second| second * 100 <= best * (100 + percent)) {
            return Some(DisparityPixel::none(Reason::NotUnique));
        }
        let [farther, nearer] = [d - 1, d + 1].map(|d| self.cost(window, (x, y), d).unwrap());
        let slope = farther.max(nearer) - best;
        let offset = if slope == 0 { 0.0 } else { 8.0 * f64::from(farther - nearer) / f64::from(slope) };
        let pixel = DisparityPixel::from_steps((d * 16 + offset.round() as i32) as u16);
        let checked = self.settings.back_check && window.checks_back;
        if pixel.has_value() && checked && !self.leads_back(window, (x, y), pixel) {
            return Some(DisparityPixel::none(Reason::LeftRightMismatch));
        }
        Some(pixel)
    }

    fn is_weak(&self, window: &PlainWindow, at: (i32, i32)) -> bool {
        self.texture(window, at) < i32::from(self.settings.weak_texture) * window.area() / 16
    }

    /// Whether the right partner of a pixel matches this pixel, with the same window.
    fn leads_back(&self, window: &PlainWindow, (x, y): (i32, i32), pixel: DisparityPixel) -> bool {
        let rounded = (i32::from(pixel.steps()) + 8) / 16;
        let partner = x - rounded;
        let back = (0..self.size()[0])
            .filter_map(|x| Some((self.cost(window, (x, y), x - partner)?, x - partner)))
            .min_by_key(|&(cost, _)| cost);
        back.is_some_and(|(_, back)| (back - rounded).abs() <= i32::from(self.settings.back_check_px))
    }

    /// Every pixel of the picture, and what both windows said where both were asked.
    fn picture(&self, seen: &mut Seen) -> Vec<DisparityPixel> {
        let s = &self.settings;
        // Where the texture is weak and there is a second window, the first has a limit of its own.
        let weak = if s.wide_window_width > 0 { s.weak_uniqueness_percent } else { s.uniqueness_percent };
        let narrow = self.window(s.window_width, [s.uniqueness_percent, weak], true);
        // The wide window is not checked back.
        let wide =
            (s.wide_window_width > 0).then(|| self.window(s.wide_window_width, [s.wide_uniqueness_percent; 2], false));
        let [width, height] = self.size();
        let mut picture = Vec::new();
        for at in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let Some(first) = self.ask(&narrow, at) else {
                picture.push(DisparityPixel::none(Reason::OutsideValidArea));
                continue;
            };
            *seen.entry((s.cost.is_census(), Asked::Narrow, first.get().err())).or_default() += 1;
            let undecided = matches!(first.get(), Err(Reason::LowTexture | Reason::NotUnique));
            let second =
                wide.as_ref().filter(|_| undecided && self.is_weak(&narrow, at)).and_then(|wide| self.ask(wide, at));
            if let Some(second) = second {
                *seen.entry((s.cost.is_census(), Asked::Wide, second.get().err())).or_default() += 1;
            }
            picture.push(second.unwrap_or(first));
        }
        picture
    }
}

/// How often each window gave each answer, for each way of comparing: what was not seen was not tested.
type Seen = BTreeMap<(bool, Asked, Option<Reason>), u32>;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Asked {
    Narrow,
    Wide,
}

impl MatchCost {
    const fn is_census(self) -> bool {
        matches!(self, Self::Census)
    }
}

/// A pair whose right picture shows the left one moved, in parts moved differently: full and faint texture, stripes, noise, and
/// pixels at the limits.
fn pair(random: &mut Random, width: usize, height: usize) -> Pair {
    let shifts = [random.below(12) as usize, random.below(12) as usize];
    let most = [4, 40][random.below(2) as usize];
    let noise = 1 + random.below(most);
    // From nearly nothing to the full range.
    let contrasts = [1 + (256 >> random.below(9)), 1 + (256 >> random.below(9))];
    let period = [0, 0, 4 + random.below(6)][random.below(3) as usize];
    // Either side may lie at a limit of what the camera measures.
    let brightness = [0, 1].map(|_| [0, 10, 50, 252][random.below(4) as usize]);
    let scene: Grey = (0..height)
        .map(|_| {
            let row: Vec<u8> = (0..width + 16)
                .map(|x| {
                    let side = usize::from(x > width / 2);
                    (brightness[side] + random.below(contrasts[side])).min(255) as u8
                })
                .collect();
            let stripe = |x: usize| if period > 0 { x % period as usize } else { x };
            (0..row.len()).map(|x| row[stripe(x)]).collect()
        })
        .collect();
    let picture = |right: bool, random: &mut Random| -> Grey {
        let moved = |x: usize, y: usize| if right { x + shifts[usize::from(y > height / 2)] } else { x };
        let mut pixel = |x: usize, y: usize| scene[y][moved(x, y)].saturating_add(random.below(noise) as u8);
        (0..height).map(|y| (0..width).map(|x| pixel(x, y)).collect()).collect()
    };
    let (left, right) = (picture(false, random), picture(true, random));
    let span =
        |random: &mut Random| ValidSpan { start: random.below(4) as u16, end: width as u16 - random.below(4) as u16 };
    // The same for the whole picture, or another one for each row, as a turned camera has.
    let common = (span(random), span(random));
    let ragged = random.below(3) == 0;
    let spans = (0..height).map(|_| if ragged { (span(random), span(random)) } else { common }).collect();
    Pair { left, right, spans }
}

fn settings(random: &mut Random, round: u32) -> MatchSettings {
    let large = round.is_multiple_of(10);
    let prefilter = if random.below(3) == 0 { Prefilter::Grey } else { Prefilter::HorizontalSobel };
    let cost = if random.below(3) == 0 { MatchCost::AbsoluteDifferences } else { MatchCost::Census };
    let edge = |random: &mut Random| 5 + 2 * random.below(if large { 9 } else { 3 }) as u16;
    let window_width = edge(random);
    let widest = u32::from(MatchSettings::MAX_WIDE_WINDOW - window_width) / 2;
    let wider = random.below(if large { widest + 1 } else { 10 }) as u16;
    let settings = MatchSettings {
        disparities: 8 + random.below(25) as u16,
        min_disparity: if random.below(3) == 0 { random.below(6) as u16 } else { 0 },
        cost,
        window_width,
        window_height: edge(random),
        wide_window_width: if random.below(5) == 0 { 0 } else { window_width + 2 * wider },
        weak_texture: random.below(300) as u16,
        wide_uniqueness_percent: random.below(12) as u16,
        prefilter,
        texture: random.below(60) as u16,
        uniqueness_percent: random.below(20) as u16,
        weak_uniqueness_percent: random.below(30) as u16,
        back_check: random.below(4) > 0,
        back_check_px: random.below(3) as u16,
        saturated_percent: 1 + random.below(100) as u16,
    };
    // Where sums would not fit, the second window is left out.
    let fits = settings.check().is_ok();
    if fits { settings } else { MatchSettings { wide_window_width: 0, ..settings } }
}

#[test]
fn agrees_with_a_plain_version_on_random_pictures() {
    let mut random = Random::seeded("matcher", 0x5eed_0003);
    let mut matcher = Box::new(Matcher::<WIDTH, DISPARITIES>::new());
    let mut seen = Seen::new();
    for round in 0..600 {
        let settings = settings(&mut random, round);
        let room = if round.is_multiple_of(10) { 96 } else { 60 };
        let (width, height) = (16 + random.below(room) as usize, 14 + random.below(16) as usize);
        let pair = pair(&mut random, width, height);
        matcher.configure(&settings, width, height).unwrap();
        let found = run(&mut matcher, &pair);
        let expected = Plain::new(&pair, settings).picture(&mut seen);
        for (place, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert!(
                found == expected,
                "round {round}, ({}, {}): {:?}, not {:?}; {settings:?} {width} x {height}, {:?}",
                place % width,
                place / width,
                found.get(),
                expected.get(),
                pair.spans
            );
        }
    }
    std::println!("{seen:?}");
    // Everything that either window can say was said, with both ways of comparing.
    let outcomes = [
        None,
        Some(Reason::LowTexture),
        Some(Reason::NotUnique),
        Some(Reason::LeftRightMismatch),
        Some(Reason::Saturated),
        Some(Reason::OutOfRange),
    ];
    for (census, asked) in [false, true].into_iter().flat_map(|c| [(c, Asked::Narrow), (c, Asked::Wide)]) {
        for outcome in outcomes {
            let times = seen.get(&(census, asked, outcome)).copied().unwrap_or_default();
            if asked == Asked::Wide && outcome == Some(Reason::LeftRightMismatch) {
                assert_eq!(times, 0, "the wide window is not checked back");
            } else {
                assert!(times >= 10, "census {census}, {asked:?}, {outcome:?}: {times} times");
            }
        }
    }
}

fn run(matcher: &mut Matcher<WIDTH, DISPARITIES>, pair: &Pair) -> Vec<DisparityPixel> {
    let width = pair.left[0].len();
    let height = pair.left.len();
    let mut picture = vec![DisparityPixel::default(); width * height];
    let mut next = 0;
    matcher.begin();
    for ((left, right), spans) in pair.left.iter().zip(&pair.right).zip(&pair.spans) {
        matcher.push(left, right, spans.0, spans.1);
        while matcher.pull(next, picture.get_mut(next * width..(next + 1) * width).unwrap_or_default()) {
            next += 1;
        }
    }
    assert_eq!(next, height, "every row comes out");
    picture
}

/// Faint stripes of one period but for a mark of its own here and there: the narrow window sees stripes only, the wide one the marks.
#[test]
fn the_wide_window_tells_what_the_narrow_one_could_not() {
    let mark = |x: usize| usize::from(x % 24 == 11) * 6;
    let stripes = |x: usize| (100 + (x % 4) * 2 + mark(x)) as u8;
    let row = |shift: usize| (0..100).map(|x| stripes(x + shift)).collect::<Vec<u8>>();
    let everything = ValidSpan { start: 0, end: 100 };
    let pair = Pair { left: vec![row(0); 30], right: vec![row(9); 30], spans: vec![(everything, everything); 30] };
    let base = MatchSettings {
        disparities: 20,
        cost: MatchCost::AbsoluteDifferences,
        window_width: 5,
        window_height: 5,
        texture: 0,
        weak_texture: 0,
        ..MatchSettings::DEFAULT
    };
    let mut matcher = Box::new(Matcher::<WIDTH, DISPARITIES>::new());
    let mut told = |settings: MatchSettings| {
        matcher.configure(&settings, 100, 30).unwrap();
        let picture = run(&mut matcher, &pair);
        let row = &picture[15 * 100 + 50..15 * 100 + 80];
        (row.iter().filter(|p| p.steps().abs_diff(9 * 16) <= 8).count(), row.iter().filter(|p| p.has_value()).count())
    };
    let (narrow, _) = told(MatchSettings { wide_window_width: 0, ..base });
    assert!(narrow < 20, "{narrow} of 30 with the narrow window alone");
    // The texture is above the limit: it is not weak, only repetitive.
    assert_eq!(told(MatchSettings { wide_window_width: 31, ..base }).0, narrow);
    let weak = MatchSettings { wide_window_width: 31, weak_texture: 500, ..base };
    assert_eq!(told(weak), (30, 30));
}
