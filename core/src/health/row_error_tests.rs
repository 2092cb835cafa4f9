//! Sparse matches against a plain search, place by place.

use std::{vec, vec::Vec};

use super::*;
use crate::{matching::ValidSpan, test_random::Random};

#[test]
fn the_middle_is_that_of_the_sorted_numbers() {
    let mut random = Random::seeded("middle of the row errors", 7);
    for len in 1..200 {
        let errors = (0..len).map(|_| random.next() as i16 >> (len % 12)).collect::<Vec<i16>>();
        let errors: Vec<_> = errors.into_iter().filter(|error| *error != i16::MIN).collect();
        let mut sorted: Vec<_> = errors.iter().map(|error| error.abs()).collect();
        sorted.sort_unstable();
        if let Some(&expected) = sorted.get(sorted.len() / 2) {
            assert_eq!(middle_of(&errors), expected, "{errors:?}");
        }
    }
}

/// Fifteen rows of both pictures, with columns that are valid, and the disparities of the middle row.
struct Rows {
    left: Vec<Vec<u8>>,
    right: Vec<Vec<u8>>,
    spans: [ValidSpan; 2],
    pixels: Vec<DisparityPixel>,
}

impl Rows {
    fn random(random: &mut Random) -> Self {
        let width = 20 + random.below(110) as usize;
        let amplitude = [3, 12, 40, 255][random.below(4) as usize];
        let texture: Vec<Vec<u8>> =
            (0..40).map(|_| (0..width + 100).map(|_| random.below(amplitude + 1) as u8).collect()).collect();
        // The right picture shows the same, moved along the row and down, with some noise; or parts of it do not.
        let (moved, down) = (random.below(60) as usize, random.below(10) as usize);
        let (noise, alien) = ([1, 4, 20, 60][random.below(4) as usize], random.below(40));
        let mut right: Vec<Vec<u8>> = (0..15)
            .map(|y| {
                (0..width).map(|x| texture[y + down][x + moved].saturating_add(random.below(noise) as u8)).collect()
            })
            .collect();
        for x in (0..width).filter(|x| x / 8 % 5 == 0) {
            if random.below(100) < alien {
                right.iter_mut().for_each(|row| row[x] = random.below(amplitude + 1) as u8);
            }
        }
        let left = (0..15).map(|y| texture[y + 4][..width].to_vec()).collect();
        let mut span = || ValidSpan { start: random.below(9) as u16, end: (width - random.below(9) as usize) as u16 };
        let spans = [span(), span()];
        let any = random.below(3);
        let pixels = (0..width).map(|_| match random.below(6) {
            0 => DisparityPixel::none(Reason::ALL[random.below(7) as usize]),
            // Near the truth, to a sixteenth.
            _ if any == 0 => DisparityPixel::from_steps((moved * 16 + random.below(40) as usize) as u16 + 1),
            _ if any == 1 => DisparityPixel::none(Reason::NotUnique),
            _ => DisparityPixel::from_steps(random.below(1200) as u16),
        });
        Self { pixels: pixels.collect(), left, right, spans }
    }

    fn strip(&self) -> Strip<'_, { 2 * MARGIN + 1 }> {
        let [left, right] = [&self.left, &self.right].map(|rows| from_fn(|y| &rows[y][..]));
        Strip { left, right, left_span: self.spans[0], right_span: self.spans[1] }
    }

    /// How far the eight neighbours and the pixel itself differ, along the rows and across them; the lesser of both.
    fn contrast(&self, x: usize) -> u32 {
        let at = |x: usize, y: usize| u32::from(self.left[y][x]);
        let across = (x - 1..=x + 1).map(|x| at(x, 6).abs_diff(at(x, 7)) + at(x, 7).abs_diff(at(x, 8))).sum::<u32>();
        let along = (6..=8).map(|y| at(x - 1, y).abs_diff(at(x, y)) + at(x, y).abs_diff(at(x + 1, y))).sum::<u32>();
        across.min(along)
    }

    /// The least difference of patches of 7 x 7 pixels, `down` rows lower, and the least disparity that has it.
    fn best(&self, x: usize, disparities: RangeInclusive<usize>, down: isize) -> Option<(u32, usize)> {
        let [_, span] = self.spans.map(|span| usize::from(span.start) as isize..usize::from(span.end) as isize);
        let there = |disparity: usize| x as isize - disparity as isize;
        let cost = |disparity: usize| -> u32 {
            let patch = (-3..=3).flat_map(|y| (-3..=3).map(move |x| (x, y)));
            let at = |rows: &[Vec<u8>], x: isize, y: isize| u32::from(rows[y as usize][x as usize]);
            patch
                .map(|(dx, dy)| {
                    let mine = at(&self.left, x as isize + dx, 7 + dy);
                    mine.abs_diff(at(&self.right, there(disparity) + dx, 7 + dy + down))
                })
                .sum()
        };
        let inside = |disparity: &usize| there(*disparity) - 3 >= span.start && there(*disparity) + 3 < span.end;
        disparities.filter(inside).map(|disparity| (cost(disparity), disparity)).min()
    }

    /// By how many sixteenths of a row the right picture lies lower at `x`.
    fn error(&self, x: usize, disparity: usize) -> Option<i16> {
        let around = disparity.saturating_sub(3)..=disparity + 3;
        let costs: Option<Vec<u32>> =
            (-4..=4).map(|down| self.best(x, around.clone(), down).map(|(cost, _)| cost)).collect();
        let costs = costs?;
        let least = *costs.iter().min().unwrap();
        let row = costs.iter().position(|cost| *cost == least).unwrap();
        if row == 0 || row == 8 {
            return None;
        }
        // Two rows off it must fit clearly worse: by two grey values for each pixel, and by a quarter.
        for row in [row.checked_sub(2), Some(row + 2)].into_iter().flatten().filter(|row| *row <= 8) {
            if costs[row] < least + 98 || f64::from(costs[row]) < 1.25 * f64::from(least) {
                return None;
            }
        }
        let fraction = refine(costs[row - 1] as i32, least as i32, costs[row + 1] as i32);
        Some((row as i16 - 4) * 16 + fraction as i16)
    }
}

/// What a plain search along the strip adds: errors with their ordinals, places in the lower half, and near ones.
#[derive(Debug, PartialEq)]
struct Said {
    errors: Vec<(i16, u8)>,
    searches_left: usize,
    lower: u16,
    near: u16,
}

fn plain(rows: &Rows, range: SearchRange, lower: bool, mut searches_left: usize) -> Said {
    let mut said = Said { errors: vec![], searches_left, lower: 0, near: 0 };
    let (start, end) = (usize::from(rows.spans[0].start) + 4, usize::from(rows.spans[0].end) - 4);
    for place in 0..8 {
        let at = |place: usize| start + end.saturating_sub(start) * place / 8;
        let usable = |x: &usize| {
            !matches!(rows.pixels[*x].get(), Err(Reason::OutsideValidArea | Reason::Saturated))
                && rows.contrast(*x) >= 40
        };
        let places: Vec<usize> = (at(place)..at(place + 1)).step_by(2).filter(usable).collect();
        let Some(most) = places.iter().map(|x| rows.contrast(*x)).max() else { continue };
        let x = *places.iter().find(|x| rows.contrast(**x) == most).unwrap();
        let known = rows.pixels[x].get().ok().map(|disparity| disparity.to_num::<f64>().round() as usize);
        if lower {
            said.lower += 1;
            let within = match known {
                Some(known) => rows.best(x, known.saturating_sub(1)..=known + 1, 0),
                None => rows.best(x, range.first..=range.last, 0),
            };
            let near = rows.best(x, range.last..=3 * range.last, 0);
            said.near += u16::from(near.is_some_and(|(near, _)| within.is_none_or(|(within, _)| 2 * near < within)));
        }
        let (disparity, ordinal) = match known {
            Some(known) => (known, 0),
            None if searches_left == 0 => continue,
            None => {
                searches_left -= 1;
                let best = (-4..=4).filter_map(|down| rows.best(x, range.first..=range.last, down)).min();
                let Some((_, disparity)) = best else { continue };
                (disparity, (64 - searches_left) as u8)
            }
        };
        said.errors.extend(rows.error(x, disparity).map(|error| (error, ordinal)));
    }
    Said { searches_left, ..said }
}

#[test]
fn matches_are_those_of_a_plain_search() {
    let mut random = Random::seeded("sparse matches", 0x5eed_0190);
    let mut matches = SparseMatches::new();
    let (mut errors, mut searched, mut near, mut lower) = (0, 0, 0, 0);
    for round in 0..1500 {
        let rows = Rows::random(&mut random);
        let first = random.below(3) as usize * 2;
        let range = SearchRange { first, last: first + [0, 7, 15, 31][random.below(4) as usize] };
        matches.begin();
        let searches = random.below(5) as usize * 16;
        matches.searches_left = searches;
        let is_lower = random.below(2) == 0;
        let mut ordinals = Ordinals::new();
        matches.look(&rows.strip(), &rows.pixels, range, is_lower, Some(&mut ordinals));
        let found = Said {
            errors: matches.errors.iter().copied().zip(ordinals.iter().copied()).collect(),
            searches_left: matches.searches_left,
            lower: matches.lower,
            near: matches.near,
        };
        assert_eq!(matches.errors.len(), ordinals.len());
        let expected = plain(&rows, range, is_lower, searches);
        assert_eq!(found, expected, "round {round}: {range:?}, {} wide", rows.pixels.len());
        errors += expected.errors.len();
        searched += expected.errors.iter().filter(|(_, ordinal)| *ordinal > 0).count();
        near += u32::from(expected.near);
        lower += u32::from(expected.lower);
    }
    std::println!("{errors} errors, {searched} after a search, {near} of {lower} near");
    assert!(errors > 500 && searched > 150 && near > 100 && lower > 2000);
}

#[test]
fn few_matches_say_nothing() {
    let mut matches = SparseMatches::new();
    let mut say = |errors: u16, lower: u16, near: u16| {
        matches.begin();
        (0..errors).for_each(|_| matches.errors.push(-24).unwrap());
        (matches.lower, matches.near) = (lower, near);
        let RowSign { error_px, matches, near_percent } = matches.sign();
        (error_px, matches, near_percent)
    };
    assert_eq!(say(11, 0, 0), (0.0, 11, 0.0));
    assert_eq!(say(12, 0, 0), (1.5, 12, 0.0));
    assert_eq!(say(0, 4, 4), (0.0, 0, 50.0), "four of at least eight");
    assert_eq!(say(0, 16, 4), (0.0, 0, 25.0));
}

#[test]
fn of_places_that_fit_alike_the_one_with_the_least_disparity_is_taken() {
    let mut random = Random::seeded("alike", 0x5eed_0196);
    for round in 0..300 {
        let mut rows = Rows::random(&mut random);
        let (width, period) = (rows.pixels.len(), 1 + random.below(25) as usize);
        for (left, right) in rows.left.iter_mut().zip(&mut rows.right) {
            for x in period..width {
                (left[x], right[x]) = (left[x - period], right[x - period]);
            }
        }
        for x in (3..width - 3).step_by(5) {
            let (first, down) = (random.below(8) as usize, random.below(9) as usize);
            let disparities = first..=first + random.below(60) as usize;
            let found = best_at(Chosen::PLAIN, &rows.strip(), x, disparities.clone(), down);
            assert_eq!(found, rows.best(x, disparities, down as isize - 4), "round {round}, period {period}");
        }
    }
}

#[test]
fn near_is_what_fits_more_than_twice_as_well() {
    // The patch of the left picture lies twice in the right one: within the range, and nearer, each with an error.
    let mut random = Random::seeded("twice as well", 0x5eed_0197);
    let near = |within: u8, nearer: u8, random: &mut Random| {
        let mut rows: [Vec<Vec<u8>>; 2] =
            [0, 1].map(|_| (0..15).map(|_| (0..80).map(|_| random.below(200) as u8).collect()).collect());
        let [left, right] = &mut rows;
        for (left, right) in left.iter().zip(right.iter_mut()) {
            for x in 0..7 {
                (right[57 - 3 + x], right[57 - 20 + x]) = (left[57 + x], left[57 + x]);
            }
        }
        right[7][57] += within;
        right[7][40] += nearer;
        let whole = ValidSpan { start: 0, end: 80 };
        let [left, right] = rows;
        let rows = Rows { left, right, spans: [whole; 2], pixels: vec![] };
        let mut matches = SparseMatches::new();
        matches.begin();
        let range = SearchRange { first: 0, last: 7 };
        matches.look_at(&rows.strip(), 60, DisparityPixel::none(Reason::NotUnique), range, true);
        (matches.near, matches.lower)
    };
    for (within, nearer, expected) in [(20, 10, 0), (21, 10, 1), (20, 9, 1), (20, 20, 0), (0, 0, 0)] {
        assert_eq!(near(within, nearer, &mut random), (expected, 1), "{within} within the range, {nearer} beyond");
    }
}

#[test]
fn a_row_is_told_if_two_rows_off_the_patch_fits_worse_by_two_grey_values_for_each_pixel() {
    // Rows of one grey value each, alike in both pictures, brighter from the middle one on and from the third one below it. Two rows
    // higher the seven columns of a patch differ twice by the first step and once by the second; two rows lower twice by each.
    let told = |middle: u8, third: u8, upside_down: bool| {
        let grey = |y: u8| 50 + if y >= 7 { middle } else { 0 } + if y >= 10 { third } else { 0 };
        let rows: Vec<Vec<u8>> = (0..15).map(|y| vec![grey(if upside_down { 14 - y } else { y }); 40]).collect();
        let whole = ValidSpan { start: 0, end: 40 };
        let rows = Rows { left: rows.clone(), right: rows, spans: [whole; 2], pixels: vec![] };
        let found = row_error(Chosen::PLAIN, &rows.strip(), 20, 5);
        assert_eq!(found, rows.error(20, 5));
        found.is_some()
    };
    for upside_down in [false, true] {
        for (middle, third, expected) in [(7, 0, true), (6, 2, true), (6, 1, false), (6, 0, false)] {
            assert_eq!(told(middle, third, upside_down), expected, "{middle} and {third}, {upside_down}");
        }
    }
}
