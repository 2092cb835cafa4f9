//! Numbers that all backends work with, against their meaning; and what no backend may touch.

mod slices;

use std::{string::String, vec, vec::Vec};

use super::*;
use crate::{
    disparity::{DisparityPixel, Reason},
    test_random::Random,
};

fn search(range: core::ops::Range<usize>) -> Search {
    Search {
        range,
        follows: false,
        radius: 2,
        stride: 16,
        disparities: 16,
        min_disparity: 0,
        right_first: 2,
        right_end: 98,
        uniqueness_percent: [5, 40],
        is_small: true,
    }
}

#[test]
fn backends_are_named_as_in_the_code() {
    for backend in Backend::ALL {
        let letters: String = backend.name().chars().filter(|letter| *letter != '.').collect();
        assert_eq!(letters, std::format!("{backend:?}").to_lowercase());
    }
}

#[test]
fn bits_are_counted_by_halves() {
    for bits in 0..=u8::MAX {
        assert_eq!(u32::from(plain::ones(bits)), bits.count_ones());
    }
}

/// A cost is nearly as good as another one if it is not larger by more than so many percent.
#[test]
fn what_is_nearly_as_good_lies_below_the_limit_of_keys_and_costs() {
    let percents = [0, 5, 40, 100];
    for weak in 0..2 {
        for percent in percents {
            let mut both = [77; 2];
            both[weak] = percent;
            let mut limits = KeyLimits::new();
            limits.fill(both);
            let key = |cost: u32, place: u32| ((cost << 7 | place) as u16 as i16).wrapping_add(i16::MIN);
            for cost in 0..=510 {
                let above = limits.above(key(cost, cost % 128), weak);
                for other in 0..=510 {
                    let near = other * 100 <= cost * (100 + u32::from(percent));
                    assert!((key(other, 0) < above) == near && (key(other, 127) < above) == near, "{cost} {other}");
                }
            }
            let search = Search { uniqueness_percent: both, ..search(10..20) };
            let number = |cost: u32| (cost as u16 as i16).wrapping_add(i16::MIN);
            for cost in (0..0xffff).step_by(37) {
                let above = search.above(number(cost), weak);
                let limit = (u64::from(cost) * (100 + u64::from(percent)) / 100).min(0xfffe) as u32;
                assert!(number(limit) < above && number(limit + 1) >= above, "{cost}: {above}");
            }
        }
    }
}

#[test]
fn the_limits_that_count_are_those_of_the_texture_of_the_pixel() {
    let mut found = Found::new();
    for i in 0..CHUNK {
        found.weak[i] = u8::from(i % 3 == 0);
    }
    for i in 0..CHUNK {
        assert_eq!(found.weak(i), usize::from(i % 3 == 0));
    }
}

#[test]
fn candidates_are_the_places_whose_right_pixel_can_hold_a_window() {
    let mut random = Random::seeded("candidates", 0x5eed_0140);
    let (mut some, mut inner) = (0, 0);
    for _ in 0..2000 {
        let start = random.below(60) as usize;
        let range = start..start + random.below(40) as usize;
        let (first, wide) = (random.below(20) as usize, random.below(80) as usize);
        let (disparities, min_disparity) = (1 + random.below(40) as usize, random.below(10) as usize);
        // Now and then there is no right pixel at all, or one.
        let right_end = if random.below(8) == 0 { first.saturating_sub(1) } else { first + wide };
        let search = Search { disparities, min_disparity, right_first: first, right_end, ..search(range.clone()) };
        let top = min_disparity + disparities - 1;
        let can_be = |x: usize, place: usize| {
            x.checked_sub(top - place).is_some_and(|right| (first..right_end).contains(&right))
        };
        let mut whole: Vec<usize> = vec![];
        for x in range {
            let expected: Vec<usize> = (0..disparities).filter(|&place| can_be(x, place)).collect();
            assert_eq!(search.candidates(x).collect::<Vec<_>>(), expected, "{x} of {search:?}");
            some += usize::from(!expected.is_empty());
            whole.extend((expected.len() == disparities).then_some(x));
        }
        #[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon"), dsp))]
        assert_eq!(search.inner().collect::<Vec<_>>(), whole, "{search:?}");
        inner += whole.len();
    }
    assert!(some > 5000 && inner > 2000, "{some} {inner}");
}

#[test]
fn right_partners_are_asked_within_the_tolerance() {
    let mut random = Random::seeded("back check", 0x5eed_0141);
    let (mut kept, mut refused) = (0, 0);
    for round in 0..60_u16 {
        let tolerance = round % 4;
        let first = random.below(70) as usize;
        let right: Vec<i16> =
            (0..150).map(|_| if random.below(9) == 0 { NO_PARTNER } else { random.below(40) as i16 }).collect();
        let before: Vec<DisparityPixel> = (0..1 + random.below(150))
            .map(|_| match random.below(6) {
                0 => DisparityPixel::none(Reason::Saturated),
                _ => DisparityPixel::from_steps(1 + random.below(16 * 40) as u16),
            })
            .collect();
        let mut out = before.clone();
        back_check(tolerance, first, &mut out, &right);
        for (i, (found, before)) in out.iter().zip(&before).enumerate() {
            // The nearest whole disparity, and what its right pixel says.
            let disparity = (usize::from(before.steps()) + 8) / 16;
            let told = (first + i).checked_sub(disparity).and_then(|x| right.get(x)).copied();
            let agrees = told.is_some_and(|told| disparity.abs_diff(told as usize) <= usize::from(tolerance));
            let expected =
                if before.has_value() && !agrees { DisparityPixel::none(Reason::LeftRightMismatch) } else { *before };
            assert_eq!(*found, expected, "{i} of {before:?}, first {first}");
            *(if before.has_value() && agrees { &mut kept } else { &mut refused }) += 1;
        }
    }
    assert!(kept > 100 && refused > 1000, "{kept} {refused}");
}

#[test]
fn sums_and_what_is_weak_are_those_of_the_columns_under_the_window() {
    let mut random = Random::seeded("evidence", 0x5eed_0142);
    for _ in 0..200 {
        let pixels: Vec<(u8, bool)> = (0..110).map(|_| (random.below(128) as u8, random.below(5) == 0)).collect();
        let columns: Vec<u32> = pixels.iter().map(|&(response, saturated)| evidence(response, saturated)).collect();
        let start = 3 + random.below(20) as usize;
        let search = search(start..start + 1 + random.below(64) as usize);
        let mut sums = Sums::new();
        sums.make(&search, &columns);
        let under = |x: usize| &pixels[x - 2..=x + 2];
        let texture = |x: usize| under(x).iter().map(|pixel| u32::from(pixel.0)).sum::<u32>();
        // A limit that some pixel just reaches.
        let limit = texture(start);
        let mut weak = [9; CHUNK];
        sums.weak(limit, &mut weak);
        for (i, x) in search.range.clone().enumerate() {
            assert_eq!(weak[i], u8::from(texture(x) < limit), "{x}");
        }
        let saturated = |x: usize| under(x).iter().filter(|pixel| pixel.1).count() as u32;
        let most = saturated(start);
        let decide = Decide {
            min_texture: limit,
            max_saturated: most,
            weak_texture: 0,
            only_weak: false,
            unique: [false; 2],
            keys: false,
        };
        let (mut out, mut weak) = (vec![DisparityPixel::default(); search.range.len()], vec![false; CHUNK]);
        let mut found = Found::new();
        found.place.fill(5);
        decide.run(&Search { right_first: 0, right_end: 1000, ..search.clone() }, &found, &sums, &mut out, &mut weak);
        for (x, pixel) in search.range.clone().zip(&out).filter(|(x, _)| *x >= 16) {
            // At place 5 of 16 lies disparity 10.
            let expected = match x {
                _ if saturated(x) > most => Err(Reason::Saturated),
                _ if texture(x) < limit => Err(Reason::LowTexture),
                _ => Ok(160),
            };
            assert_eq!(pixel.get().map(|_| pixel.steps()), expected, "{x}");
        }
    }
}

/// Where no right pixel can hold a window, nothing is decided, and what was decided before stays.
#[test]
fn without_right_pixels_nothing_is_decided() {
    let decide =
        Decide { min_texture: 0, max_saturated: 9, weak_texture: 0, only_weak: false, unique: [false; 2], keys: false };
    for (right_end, decides) in [(30, true), (2, false), (0, false)] {
        let search = Search { right_end, ..search(20..30) };
        let before = DisparityPixel::none(Reason::NotUnique);
        let (mut out, mut weak) = (vec![before; 10], vec![true; 10]);
        let mut found = Found::new();
        found.place.fill(5);
        decide.run(&search, &found, &Sums::new(), &mut out, &mut weak);
        assert_eq!(out.iter().any(|pixel| *pixel != before), decides, "up to {right_end}");
        assert!(decides || weak == [true; 10], "up to {right_end}");
    }
}
