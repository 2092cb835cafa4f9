//! Pixels between pixels against blends in f64, and each way to fill a segment against one place after the other.

extern crate std;

use std::{vec, vec::Vec};

use super::*;
use crate::test_random::Random;

const ONE: i32 = 1 << PLACE_SHIFT;

/// Grey values of a picture whose rows may lie farther apart than they are long, and that may be larger than it was said to be.
struct Raw {
    bytes: Vec<u8>,
    size: (usize, usize),
    whole: (usize, usize),
    stride: usize,
}

impl Raw {
    fn new(random: &mut Random) -> Self {
        let size = (1 + random.below(50) as usize, 1 + random.below(30) as usize);
        let whole = (size.0 + random.below(3) as usize, size.1 + random.below(3) as usize);
        let stride = whole.0 + random.below(20) as usize;
        let bytes = (0..stride * whole.1).map(|_| [0, 255, random.next() as u8][random.below(3) as usize]).collect();
        Self { bytes, size, whole, stride }
    }

    fn source(&self) -> Source<'_> {
        Source::new(&Picture::new(&self.bytes, self.whole.0, self.whole.1, self.stride).unwrap(), self.size)
    }

    /// The grey value at a place, in 64ths of a pixel; `None` outside of the picture.
    fn between(&self, [x, y]: [i32; 2]) -> Option<f64> {
        let most = [64 * (self.size.0 as i32 - 1), 64 * (self.size.1 as i32 - 1)];
        if x < 0 || y < 0 || x > most[0] || y > most[1] {
            return None;
        }
        let (a, b) = (f64::from(x % 64) / 64.0, f64::from(y % 64) / 64.0);
        let grey = |dx: i32, dy: i32| {
            // What lies behind the last one has no weight.
            let (x, y) = ((x / 64 + dx).min(most[0] / 64), (y / 64 + dy).min(most[1] / 64));
            f64::from(self.bytes[y as usize * self.stride + x as usize])
        };
        let row = |dy: i32| grey(0, dy) * (1.0 - a) + grey(1, dy) * a;
        Some(row(0) * (1.0 - b) + row(1) * b)
    }
}

#[test]
fn pixels_between_pixels_are_blends_of_four() {
    let mut random = Random::seeded("blends", 0x5eed_0150);
    let (mut there, mut outside) = (0, 0);
    for _ in 0..60 {
        let raw = Raw::new(&mut random);
        let source = raw.source();
        for _ in 0..200 {
            // In 64ths of a pixel, often just on a column or row and at the edges, and anything below that.
            let mut along = |length: usize| match random.below(4) {
                0 => 64 * random.below(length as u32 + 1) as i32,
                1 => 64 * (length as i32 - 1) + random.below(5) as i32 - 2,
                _ => random.within(-70.0, 64.0 * length as f64) as i32,
            };
            let place = [along(raw.size.0), along(raw.size.1)];
            let below = [random.below(ONE as u32 / 64) as i32, random.below(ONE as u32 / 64) as i32];
            let found = source.at([0, 1].map(|i| place[i] * (ONE / 64) + below[i]));
            let expected = raw.between(place);
            match (found, expected) {
                // Rounded twice: to a quarter of a grey level, and to a whole one.
                (Some(found), Some(expected)) => {
                    assert!((f64::from(found) - expected).abs() <= 0.63, "{found}, not {expected} at {place:?}");
                    there += 1;
                }
                _ => {
                    assert_eq!(found.is_some(), expected.is_some(), "{place:?} of {:?}", raw.size);
                    outside += 1;
                }
            }
        }
    }
    assert!(there > 5000 && outside > 1000, "{there} {outside}");
}

/// Rounding makes pixels neither brighter nor darker.
#[test]
fn blends_are_rounded_to_the_nearest() {
    let mut random = Random::seeded("rounding", 0x5eed_0151);
    let mut sum = 0.0;
    const ROUNDS: u32 = 20_000;
    for _ in 0..ROUNDS {
        let [a, b, c, d] = [(); 4].map(|()| random.below(256) as u16);
        let (across, down) = (random.below(64) as u16, random.below(64) as u16);
        let (x, y) = (f64::from(across) / 64.0, f64::from(down) / 64.0);
        let [a64, b64, c64, d64] = [a, b, c, d].map(f64::from);
        let exact = (a64 * (1.0 - x) + b64 * x) * (1.0 - y) + (c64 * (1.0 - x) + d64 * x) * y;
        let found = f64::from(blend([a, b], [c, d], across, down));
        assert!((found - exact).abs() <= 0.63, "{found}, not {exact}");
        sum += found - exact;
    }
    // Halves are rounded up, which makes it a little more than nothing.
    assert!((sum / f64::from(ROUNDS)).abs() < 0.05, "{} grey levels brighter", sum / f64::from(ROUNDS));
}

#[test]
fn a_segment_has_the_same_bits_however_it_is_filled() {
    let mut random = Random::seeded("segments", 0x5eed_0152);
    let mut filled = [0; 2];
    for _ in 0..300 {
        let raw = Raw::new(&mut random);
        let source = raw.source();
        for _ in 0..60 {
            // Some segments are hardly moved by the lens, others run anyhow; most lie within the picture, many at its edges.
            let (far, turn) = if random.below(2) == 0 { (0.14, 0.14) } else { (2.5, 0.6) };
            let slope = [
                ONE + (random.within(-far, far) * f64::from(ONE)) as i32,
                (random.within(-turn, turn) * f64::from(ONE)) as i32,
            ];
            let mut start = [raw.size.0, raw.size.1]
                .map(|length| (random.within(-2.0, length as f64 + 1.0) * f64::from(ONE)) as i32);
            if random.below(3) == 0 {
                // Just so that the last pixel lies on the last column, or a little beside it.
                start[0] = (raw.size.0 as i32 - 1) * ONE - 7 * slope[0] + random.below(3) as i32 - 1;
            }
            if random.below(3) == 0 {
                start[1] = random.below(3) as i32 - 1;
            }
            let places = (0..STEP as i32).map(|k| [start[0] + k * slope[0], start[1] + k * slope[1]]);
            let expected: Vec<Option<u8>> = places.map(|place| source.at(place)).collect();
            let mut out = [[77; STEP]; 2];
            let done = [source.fill_plain(start, slope, &mut out[0]), source.fill_inside(start, slope, &mut out[1])];
            for (way, done) in done.into_iter().enumerate().filter(|(_, done)| *done) {
                let found: Vec<Option<u8>> = out[way].iter().copied().map(Some).collect();
                assert_eq!(found, expected, "way {way} from {start:?} along {slope:?} in {:?}, {done}", raw.size);
                filled[way] += 1;
            }
        }
    }
    assert!(filled.iter().all(|&segments| segments > 500), "{filled:?}");
}

#[test]
fn the_longest_run_is_the_first_of_those_that_are_as_long() {
    let mut runs = Runs::default();
    let mut ends = vec![];
    for (start, end) in [(0, 2), (3, 3), (5, 8), (9, 12), (13, 14), (20, 24), (30, 29)] {
        runs.start = start;
        runs.end_at(end);
        ends.push(runs.longest.clone());
    }
    assert_eq!(ends, [0..2, 0..2, 5..8, 5..8, 5..8, 20..24, 20..24]);
}
