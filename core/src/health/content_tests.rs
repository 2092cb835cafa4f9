//! Signs of pictures whose faults are known.

use std::{boxed::Box, vec, vec::Vec};

use super::*;
use crate::{bands::cut, matching::MatchSettings, test_random::Random};

const WIDTH: usize = 256;
const HEIGHT: usize = 192;
const DISPARITIES: usize = 32;

type Picture = Vec<u8>;

/// A scene as a function of the place: smooth random texture, finer near the bottom, with `noise` of each picture's own.
struct Scene {
    texture: Vec<f64>,
}

const SIDE: usize = 640;

impl Scene {
    fn new(seed: u64) -> Self {
        let mut random = Random::seeded("scene", seed);
        let coarse: Vec<f64> = (0..SIDE * SIDE).map(|_| random.within(40.0, 215.0)).collect();
        // The mean of 3 x 3: structure that blocks of 4 x 4 see, and that lies in a certain row.
        let at = |x: usize, y: usize| coarse[(y % SIDE) * SIDE + x % SIDE];
        let texture = (0..SIDE * SIDE).map(|i| {
            let (x, y) = (i % SIDE, i / SIDE);
            let around = (0..9).map(|k| at(x + k % 3, y + k / 3)).sum::<f64>() / 9.0;
            (around - 127.0) * 2.0 + 127.0
        });
        Self { texture: texture.collect() }
    }

    fn at(&self, x: f64, y: f64) -> f64 {
        let get = |x: f64, y: f64| self.texture[(y as usize % SIDE) * SIDE + x as usize % SIDE];
        let (x, y) = (x + 100.0, y + 100.0);
        let (a, b) = (x.fract(), y.fract());
        let upper = (1.0 - a) * get(x.floor(), y.floor()) + a * get(x.floor() + 1.0, y.floor());
        let lower = (1.0 - a) * get(x.floor(), y.floor() + 1.0) + a * get(x.floor() + 1.0, y.floor() + 1.0);
        (1.0 - b) * upper + b * lower
    }

    /// What a camera sees whose pixel (u, v) looks at the place that `look` says.
    fn see(&self, random: &mut Random, look: impl Fn(f64, f64) -> (f64, f64)) -> Picture {
        let pixels = (0..WIDTH * HEIGHT).map(|i| {
            let (x, y) = look((i % WIDTH) as f64, (i / WIDTH) as f64);
            (self.at(x, y) + random.within(-2.0, 2.0)).round().clamp(0.0, 255.0) as u8
        });
        pixels.collect()
    }
}

/// Content and the matcher that it looks into.
struct Eye {
    content: Box<Content<WIDTH>>,
    matcher: Box<Matcher<WIDTH, DISPARITIES>>,
    /// What looks at bands, with what it saw last.
    bands: Vec<(RowLooks<WIDTH>, Ordinals)>,
}

const RANGE: SearchRange = SearchRange { first: 0, last: DISPARITIES - 1 };
const WHOLE: ValidSpan = ValidSpan { start: 0, end: WIDTH as u16 };

impl Eye {
    fn new() -> Self {
        Self::with(MatchSettings::DEFAULT)
    }

    fn with(settings: MatchSettings) -> Self {
        let mut matcher = Box::new(Matcher::new());
        let settings = MatchSettings { disparities: DISPARITIES as u16, ..settings };
        matcher.configure(&settings, WIDTH, HEIGHT).unwrap();
        let bands = (0..5).map(|_| (RowLooks::new(), Ordinals::new())).collect();
        Self { content: Box::new(Content::new()), matcher, bands }
    }

    fn look(&mut self, left: &[u8], right: &[u8]) -> ContentSigns {
        let mut disparity = vec![DisparityPixel::default(); WIDTH * HEIGHT];
        self.matcher.begin();
        self.content.begin(WIDTH, HEIGHT, RANGE);
        let mut next = 0;
        for (y, (left, right)) in left.chunks(WIDTH).zip(right.chunks(WIDTH)).enumerate() {
            self.matcher.push(left, right, WHOLE, WHOLE);
            while disparity.get_mut(next * WIDTH..(next + 1) * WIDTH).is_some_and(|row| self.matcher.pull(next, row)) {
                next += 1;
            }
            self.content.push(y, [left, right], [WHOLE; 2]);
            self.content.look(&self.matcher, &disparity, WIDTH, next);
        }
        self.content.signs(3.0)
    }

    /// The same in bands, each with a matcher of its own that sees the rows around as well.
    fn look_in_bands(&mut self, left: &[u8], right: &[u8], count: usize) -> ContentSigns {
        self.content.begin(WIDTH, HEIGHT, RANGE);
        let settings = *self.matcher.settings();
        for (number, rows) in cut(HEIGHT, count, unit_of_bands(HEIGHT)).enumerate() {
            let [above, below] =
                rows_around(HEIGHT, &rows, settings.reach()).map(|around| around.max(settings.margins()[1]));
            let seen = rows.start.saturating_sub(above)..(rows.end + below).min(HEIGHT);
            let mut matcher = Box::new(Matcher::<WIDTH, DISPARITIES>::new());
            matcher.configure_as(&self.matcher);
            matcher.set_height(seen.len());
            matcher.begin();
            let (looks, ordinals) = &mut self.bands[number];
            looks.begin_band(&self.content.looks, WIDTH, rows.start);
            ordinals.clear();
            let mut disparity = vec![DisparityPixel::default(); WIDTH * rows.len()];
            let mut next = 0;
            for y in seen.clone() {
                let [left, right] = [left, right].map(|picture| &picture[y * WIDTH..(y + 1) * WIDTH]);
                matcher.push(left, right, WHOLE, WHOLE);
                let row = |next: usize| next * WIDTH..(next + 1) * WIDTH;
                let mut pulled =
                    |next: usize, out: &mut [DisparityPixel]| matcher.pull(rows.start - seen.start + next, out);
                while disparity.get_mut(row(next)).is_some_and(|out| pulled(next, out)) {
                    next += 1;
                }
                if rows.contains(&y) {
                    looks.push(y, [left, right], [WHOLE; 2]);
                }
                let (of_matcher, done) = ((&*matcher, seen.start), rows.start + next);
                looks.look(of_matcher, (&disparity, rows.start), WIDTH, done, Some(&mut *ordinals));
            }
        }
        self.bands[..count].iter().for_each(|(looks, ordinals)| self.content.looks.append(looks, ordinals));
        self.content.signs(3.0)
    }
}

/// A wall 12 px of disparity away, its right picture made by `look` from the place that it should show.
fn wall(seed: u64, look: impl Fn(f64, f64) -> (f64, f64)) -> (Picture, Picture) {
    let (scene, mut random) = (Scene::new(seed), Random::seeded("noise", seed + 1));
    let left = scene.see(&mut random, |u, v| (u, v));
    (left, scene.see(&mut random, |u, v| look(u + 12.0, v)))
}

#[test]
fn the_row_error_is_the_one_that_was_made() {
    for (number, rows) in [0.0, 0.5, 1.0, 1.5, 2.0, 3.0, -1.0, -2.5].into_iter().enumerate() {
        let (left, right) = wall(0x5eed_0170 + number as u64, |x, y| (x, y - rows));
        let signs = Eye::new().look(&left, &right).rows;
        assert!(signs.matches > 60, "{rows}: {signs:?}");
        assert!((f64::from(signs.error_px) - rows.abs()).abs() < 0.25, "{rows} rows: {signs:?}");
    }
    // A turn has no error in the middle and the largest at the sides: half of them lie beyond a quarter of the width.
    let turn = 1.2_f64.to_radians();
    let (left, right) = wall(0x5eed_0180, |x, y| (x, y + turn.tan() * (x - 140.0)));
    let signs = Eye::new().look(&left, &right).rows;
    let expected = turn.tan() * WIDTH as f64 / 4.0;
    assert!((f64::from(signs.error_px) - expected).abs() < 0.35, "{signs:?} instead of {expected}");
}

#[test]
fn what_is_nearer_than_the_range_is_seen() {
    for (disparity, near) in [(12.0, false), (28.0, false), (40.0, true), (70.0, true)] {
        let (scene, mut random) = (Scene::new(0x5eed_0181), Random::seeded("noise", 0x5eed_0182));
        let left = scene.see(&mut random, |u, v| (u, v));
        let right = scene.see(&mut random, |u, v| (u + if v > 96.0 { disparity } else { 12.0 }, v));
        let signs = Eye::new().look(&left, &right).rows;
        assert_eq!(signs.near_percent > 40.0, near, "{disparity} px: {signs:?}");
        assert!(near || signs.near_percent < 5.0, "{disparity} px: {signs:?}");
    }
}

#[test]
fn a_part_that_is_flat_in_one_picture_alone_is_covered() {
    let flat = |picture: &Picture, share: f64| -> Picture {
        let covered = |i: usize| ((i % WIDTH) as f64) < share * WIDTH as f64;
        picture.iter().enumerate().map(|(i, grey)| if covered(i) { 99 + (i % 3) as u8 } else { *grey }).collect()
    };
    let (left, right) = wall(0x5eed_0183, |x, y| (x, y));
    for share in [0.0, 0.3, 0.6, 1.0] {
        let [l, r] = Eye::new().look(&flat(&left, share), &right).coverings;
        let found = f64::from(l.covered) / f64::from(l.judged.max(1));
        assert!((found - share).abs() < 0.2 && r.covered == 0, "left, {share}: {l:?} {r:?}");
        let [l, r] = Eye::new().look(&left, &flat(&right, share)).coverings;
        let found = f64::from(r.covered) / f64::from(r.judged.max(1));
        assert!((found - share).abs() < 0.2 && l.covered == 0, "right, {share}: {l:?} {r:?}");
        // What both do not show is not covered: a wall without texture.
        let [l, r] = Eye::new().look(&flat(&left, share), &flat(&right, share)).coverings;
        assert!(u32::from(l.covered + r.covered) * 8 <= u32::from(l.judged + r.judged), "both, {share}: {l:?} {r:?}");
        assert!((f64::from(l.flat_percent) / 100.0 - share).abs() < 0.1);
    }
}

#[test]
fn a_late_picture_is_told_by_how_late_it_is() {
    let scene = Scene::new(0x5eed_0184);
    let mut random = Random::seeded("drive", 0x5eed_0185);
    // Coming nearer: everything moves away from the middle, by two hundredths from frame to frame.
    let frames: Vec<(Picture, Picture)> = (0..14)
        .map(|t| {
            let scale = 1.0 / (1.0 + 0.02 * f64::from(t));
            let look = |u: f64, v: f64| ((u - 128.0) * scale + 128.0, (v - 96.0) * scale + 96.0);
            let left = scene.see(&mut random, look);
            (left, scene.see(&mut random, |u, v| look(u + 12.0, v)))
        })
        .collect();
    for (side, lag) in [(0, 0), (0, 1), (1, 1), (0, 3), (1, 3), (0, 5), (1, 5)] {
        let mut eye = Eye::new();
        for frame in 4..frames.len() {
            let late = |late: bool| frame - if late && frame >= 9 { lag } else { 0 };
            let (left, right) = (&frames[late(side == 0)].0, &frames[late(side == 1)].1);
            let sign = eye.look(left, right).pairing;
            if lag == 0 || frame < 9 {
                assert!(sign.advantage_sigmas <= 0.0, "frame {frame}: {sign:?}");
            } else {
                assert!(sign.advantage_sigmas > 4.0 && sign.likeness > 0.7, "{side} late by {lag}, {frame}: {sign:?}");
                assert_eq!(i32::from(sign.lag_frames), [-1, 1][side] * lag as i32, "frame {frame}: {sign:?}");
            }
        }
    }
}

#[test]
fn while_nothing_moves_no_picture_is_late() {
    let mut eye = Eye::new();
    for frame in 0..8 {
        // Each with noise of its own; in the end the rows get out of line, which is another matter.
        let rows = if frame < 6 { 0.0 } else { 2.0 };
        let scene = Scene::new(0x5eed_0186);
        let mut random = Random::seeded("noise", 0x5eed_0187 + frame);
        let left = scene.see(&mut random, |u, v| (u, v));
        let right = scene.see(&mut random, |u, v| (u + 12.0, v - rows));
        let sign = eye.look(&left, &right).pairing;
        assert!(sign.advantage_sigmas < 2.0, "frame {frame}: {sign:?}");
    }
}

#[test]
fn bands_say_what_the_whole_picture_says() {
    let (scene, mut random) = (Scene::new(0x5eed_0188), Random::seeded("noise", 0x5eed_0189));
    let mut pair = |moved: fn(f64, f64) -> (f64, f64), flat: usize| {
        let left = scene.see(&mut random, |u, v| (u, v));
        let mut right = scene.see(&mut random, |u, v| moved(u + 12.0, v));
        right.iter_mut().enumerate().filter(|(i, _)| i % WIDTH < flat).for_each(|(_, grey)| *grey = 100);
        (left, right)
    };
    // In line; partly covered; out of line, so that nearly every place is searched for; so in the lower part alone; near there; and
    // nothing that fits at all.
    let pairs = [
        pair(|x, y| (x, y), 0),
        pair(|x, y| (x, y), 100),
        pair(|x, y| (x, y - 3.0), 0),
        pair(|x, y| (x, if y > 80.0 { y - 2.5 } else { y }), 0),
        pair(|x, y| (if y > 100.0 { x + 40.0 } else { x }, y), 0),
        pair(|x, y| (y * 3.0, x), 0),
    ];
    let mut alone = Eye::new();
    let mut eyes = [1, 2, 3, 4, 5].map(|count| (count, Eye::new()));
    let mut signs = Vec::new();
    for (left, right) in &pairs {
        let expected = alone.look(left, right);
        for (count, eye) in &mut eyes {
            assert_eq!(eye.look_in_bands(left, right, *count), expected, "{count} bands");
        }
        signs.push(expected);
    }
    assert!(
        signs[2].rows.error_px > 2.5 && signs[3].rows.error_px > 0.5 && signs[4].rows.near_percent > 30.0,
        "{signs:?}"
    );
    assert!(signs[1].coverings[1].covered > 3, "{signs:?}");
}

#[test]
fn bands_see_blocks_rows_of_profiles_and_what_strips_need_whole() {
    for height in 1..3000 {
        let (unit, rows) = (unit_of_bands(height), height.div_ceil(256));
        assert!(unit > 0 && unit.is_multiple_of(BLOCK) && unit.is_multiple_of(rows), "{height}: {unit}");
        assert!((1..unit).all(|less| !less.is_multiple_of(BLOCK) || !less.is_multiple_of(rows)), "{height}: {unit}");
    }
    for (height, count, reach) in [(192, 3, 1), (240, 4, 2), (480, 5, 2), (64, 2, 1), (33, 3, 2), (1080, 8, 1)] {
        for band in cut(height, count, BLOCK).filter(|band| !band.is_empty()) {
            let strips = (1..=16).map(|strip| height * strip / 17).filter(|y| band.contains(y));
            // Three rows of a patch, four rows that are searched.
            let [mut above, mut below] = [0, 0];
            for y in strips {
                above = above.max((band.start + 7 + reach).saturating_sub(y));
                below = below.max((y + 7 + reach + 1).saturating_sub(band.end));
            }
            assert_eq!(rows_around(height, &band, reach), [above, below], "{height} rows, {band:?}");
        }
    }
}

#[test]
fn a_place_is_looked_at_when_its_disparity_is_known() {
    // A high window says disparities some rows after the last row that the look needs; without them most places were searched for.
    let (left, right) = wall(0x5eed_018a, |x, y| (x, y));
    for window_height in [5, 13, 21] {
        let signs = Eye::with(MatchSettings { window_height, ..MatchSettings::DEFAULT }).look(&left, &right).rows;
        assert!(signs.matches > 90, "{window_height} rows: {signs:?}");
    }
}

#[test]
fn what_was_cleared_is_no_moment_to_compare_with() {
    let [first, second] = [0x5eed_018b, 0x5eed_018d].map(|seed| wall(seed, |x, y| (x, y)));
    let mut eye = Eye::new();
    assert_eq!(eye.look(&first.0, &first.1).pairing, PairingSign::default());
    assert_ne!(eye.look(&second.0, &second.1).pairing, PairingSign::default());
    eye.content.clear();
    assert_eq!(eye.look(&first.0, &first.1).pairing, PairingSign::default());
}
