//! The matcher against a slow plain version.

use std::{boxed::Box, vec, vec::Vec};

use super::*;
use crate::test_random::Random;

/// Every step as its definition says, over whole pictures.
struct Plain<'a> {
    left: &'a [Vec<u8>],
    right: &'a [Vec<u8>],
    settings: MatchSettings,
    spans: (ValidSpan, ValidSpan),
}

impl Plain<'_> {
    fn filtered(&self, picture: &[Vec<u8>], x: i32, y: i32) -> i32 {
        let at = |x: i32, y: i32| i32::from(picture[y as usize][x as usize]);
        match self.settings.prefilter {
            Prefilter::Grey => at(x, y) / 2,
            Prefilter::HorizontalSobel => {
                if x == 0 || x as usize + 1 == picture[0].len() {
                    return 31;
                }
                let sum: i32 =
                    [(-1, 1), (0, 2), (1, 1)].iter().map(|&(dy, w)| w * (at(x + 1, y + dy) - at(x - 1, y + dy))).sum();
                sum.clamp(-31, 31) + 31
            }
        }
    }

    fn inside(&self, span: ValidSpan, x: i32, y: i32) -> bool {
        let margin = i32::from(self.settings.window / 2) + 1;
        let height = self.left.len() as i32;
        x >= i32::from(span.start) + margin
            && x < (i32::from(span.end).min(self.left[0].len() as i32)) - margin
            && y >= margin
            && y + margin < height
    }

    fn window(&self) -> impl Iterator<Item = (i32, i32)> {
        let r = i32::from(self.settings.window / 2);
        (-r..=r).flat_map(move |dy| (-r..=r).map(move |dx| (dx, dy)))
    }

    fn cost(&self, x: i32, y: i32, d: i32) -> Option<i32> {
        if !self.inside(self.spans.0, x, y) || !self.inside(self.spans.1, x - d, y) {
            return None;
        }
        let difference =
            |(dx, dy)| (self.filtered(self.left, x + dx, y + dy) - self.filtered(self.right, x - d + dx, y + dy)).abs();
        Some(self.window().map(difference).sum())
    }

    fn range(&self) -> std::ops::Range<i32> {
        let min = i32::from(self.settings.min_disparity);
        min..min + i32::from(self.settings.disparities)
    }

    fn pixel(&self, x: i32, y: i32) -> DisparityPixel {
        if !self.inside(self.spans.0, x, y) {
            return DisparityPixel::none(Reason::OutsideValidArea);
        }
        let costs: Vec<(i32, i32)> = self.range().filter_map(|d| Some((d, self.cost(x, y, d)?))).collect();
        if costs.is_empty() {
            return DisparityPixel::none(Reason::OutsideValidArea);
        }
        let area = i32::from(self.settings.window).pow(2);
        let grey = |(dx, dy): (i32, i32)| self.left[(y + dy) as usize][(x + dx) as usize];
        let saturated = self.window().filter(|&p| matches!(grey(p), 0 | 255)).count() as i32;
        if saturated > area * i32::from(self.settings.saturated_percent) / 100 {
            return DisparityPixel::none(Reason::Saturated);
        }
        let response = |(dx, dy): (i32, i32)| {
            let here = self.filtered(self.left, x + dx, y + dy);
            match self.settings.prefilter {
                Prefilter::HorizontalSobel => (here - 31).abs(),
                Prefilter::Grey if x + dx == 0 => 0,
                Prefilter::Grey => (here - self.filtered(self.left, x + dx - 1, y + dy)).abs(),
            }
        };
        if self.window().map(response).sum::<i32>() < (i32::from(self.settings.texture) * area) / 16 {
            return DisparityPixel::none(Reason::LowTexture);
        }
        // The largest disparity wins a tie.
        let &(d, best) = costs.iter().rev().min_by_key(|&&(_, cost)| cost).unwrap();
        if d == costs[0].0 || d == costs[costs.len() - 1].0 {
            return DisparityPixel::none(Reason::OutOfRange);
        }
        let second = costs.iter().filter(|&&(other, _)| (other - d).abs() > 1).map(|&(_, cost)| cost).min();
        let percent = i32::from(self.settings.uniqueness_percent);
        if percent > 0 && second.is_some_and(|second| second * 100 <= best * (100 + percent)) {
            return DisparityPixel::none(Reason::NotUnique);
        }
        let (farther, nearer) = (self.cost(x, y, d - 1).unwrap(), self.cost(x, y, d + 1).unwrap());
        let slope = farther.max(nearer) - best;
        let offset = if slope == 0 { 0.0 } else { 8.0 * f64::from(farther - nearer) / f64::from(slope) };
        let pixel = DisparityPixel::from_steps((d * 16 + offset.round() as i32) as u16);
        if !self.settings.back_check || !pixel.has_value() {
            return pixel;
        }
        let tolerance = self.settings.back_check_px;
        let rounded = (i32::from(pixel.steps()) + 8) / 16;
        let partner = x - rounded;
        let back = (0..self.left[0].len() as i32)
            .filter(|x| self.range().contains(&(x - partner)))
            .filter_map(|x| Some((self.cost(x, y, x - partner)?, x - partner)))
            .min_by_key(|&(cost, _)| cost);
        if back.is_none_or(|(_, back)| (back - rounded).abs() > i32::from(tolerance)) {
            return DisparityPixel::none(Reason::LeftRightMismatch);
        }
        pixel
    }
}

#[test]
fn agrees_with_a_plain_version_on_random_pictures() {
    let mut random = Random::seeded("matcher", 0x5eed_0003);
    let mut matcher = Box::new(Matcher::<80, 32>::new());
    for round in 0..150 {
        let settings = MatchSettings {
            disparities: 8 + random.below(25) as u16,
            min_disparity: if random.below(3) == 0 { random.below(6) as u16 } else { 0 },
            window: 5 + 2 * random.below(if round % 10 == 0 { 9 } else { 3 }) as u16,
            prefilter: if random.below(2) == 0 { Prefilter::Grey } else { Prefilter::HorizontalSobel },
            texture: random.below(60) as u16,
            uniqueness_percent: random.below(12) as u16,
            back_check: random.below(4) > 0,
            back_check_px: random.below(3) as u16,
            saturated_percent: 5 + random.below(96) as u16,
        };
        let width = 16 + random.below(60) as usize;
        let height = 16 + random.below(16) as usize;
        let shift = random.below(12) as usize;
        let noise = 1 + random.below(40);
        let wide: Vec<Vec<u8>> =
            (0..height).map(|_| (0..width + 16).map(|_| (random.next() >> random.below(3)) as u8).collect()).collect();
        let picture = |from: usize, random: &mut Random| -> Vec<Vec<u8>> {
            wide.iter()
                .map(|row| {
                    row[from..from + width].iter().map(|&grey| grey.saturating_add(random.below(noise) as u8)).collect()
                })
                .collect()
        };
        let (left, right) = (picture(0, &mut random), picture(shift, &mut random));
        let span = |random: &mut Random| ValidSpan {
            start: random.below(4) as u16,
            end: width as u16 - random.below(4) as u16,
        };
        let spans = (span(&mut random), span(&mut random));
        matcher.configure(&settings, width, height).unwrap();
        let found = run(&mut matcher, &left, &right, spans);
        let plain = Plain { left: &left, right: &right, settings, spans };
        for y in 0..height {
            for x in 0..width {
                let expected = plain.pixel(x as i32, y as i32);
                let found = found[y * width + x];
                assert!(
                    found == expected,
                    "round {round}, ({x}, {y}): {:?}, not {:?}; {settings:?} {spans:?} {width} x {height}",
                    found.get(),
                    expected.get()
                );
            }
        }
    }
}

fn run(
    matcher: &mut Matcher<80, 32>,
    left: &[Vec<u8>],
    right: &[Vec<u8>],
    spans: (ValidSpan, ValidSpan),
) -> Vec<DisparityPixel> {
    let width = left[0].len();
    let mut picture = vec![DisparityPixel::default(); width * left.len()];
    let mut next = 0;
    matcher.begin();
    for (left, right) in left.iter().zip(right) {
        matcher.push(left, right, spans.0, spans.1);
        while matcher.pull(next, picture.get_mut(next * width..(next + 1) * width).unwrap_or_default()) {
            next += 1;
        }
    }
    assert_eq!(next, left.len(), "every row comes out");
    picture
}
