//! Structure and coverings against a plain evaluation of every block.

use std::{boxed::Box, vec::Vec};

use super::*;
use crate::test_random::Random;

const WIDTH: usize = 330;

/// A picture with the valid columns of its rows.
struct Shown {
    width: usize,
    rows: Vec<(Vec<u8>, ValidSpan)>,
}

impl Shown {
    /// Parts of `patch` pixels with more or less structure, seen through a border that is not valid.
    fn random(random: &mut Random, width: usize, height: usize) -> Self {
        let patch = 8 + random.below(50) as usize;
        let strengths: Vec<u32> = (0..50 * 50).map(|_| [1, 5, 20, 60, 200][random.below(5) as usize]).collect();
        let (left, right) = (random.below(20) as usize, random.below(20) as usize);
        let row = |y: usize, random: &mut Random| {
            let grey = |x: usize| strengths[(y / patch * 50 + x / patch) % strengths.len()];
            let row = (0..width).map(|x| 20 + random.below(grey(x)) as u8).collect();
            let start = (left + y % 3).min(width);
            (row, ValidSpan { start: start as u16, end: width.saturating_sub(right + y / 9).max(start) as u16 })
        };
        Self { width, rows: (0..height).map(|y| row(y, random)).collect() }
    }

    fn tiles(&self) -> Box<Tiles<WIDTH>> {
        let mut tiles = Box::new(Tiles::new());
        tiles.begin(self.width, self.rows.len());
        self.rows.iter().enumerate().for_each(|(y, (row, span))| tiles.push(y, row, *span));
        tiles
    }

    /// Sum of a block, if all of it is valid.
    fn block(&self, x: usize, y: usize) -> Option<f64> {
        let inside = |span: &ValidSpan| usize::from(span.start) <= 4 * x && 4 * x + 4 <= usize::from(span.end);
        let rows = &self.rows[4 * y..4 * y + 4];
        rows.iter()
            .all(|(_, span)| inside(span))
            .then(|| rows.iter().flat_map(|(row, _)| &row[4 * x..4 * x + 4]).map(|grey| f64::from(*grey)).sum())
    }

    /// Tiles across and down, and their blocks across and down: as many tiles of at least four blocks as there may be.
    fn layout(&self) -> [usize; 4] {
        let (across, down) = (self.width / 4, self.rows.len() / 4);
        let [columns, rows] = [(across, 16), (down, 12)].map(|(blocks, most)| (blocks / 4).clamp(1, most));
        [columns, rows, (across / columns).max(1), (down / rows).max(1)]
    }

    /// Mean difference of neighbouring blocks of a tile and of its last with the next, if half of them are known.
    fn structure(&self, column: usize, row: usize) -> Option<f64> {
        let [_, _, across, down] = self.layout();
        let blocks = self.width / 4;
        let mut steps = Vec::new();
        for y in row * down..((row + 1) * down).min(self.rows.len() / 4) {
            for x in (column * across..(column + 1) * across).filter(|x| x + 1 < blocks) {
                if let (Some(a), Some(b)) = (self.block(x, y), self.block(x + 1, y)) {
                    steps.push((a - b).abs() / 16.0);
                }
            }
        }
        (2 * steps.len() >= across * down).then(|| steps.iter().sum::<f64>() / (steps.len() as f64).max(1.0))
    }

    /// What this picture lacks beside `other`: tiles covered, without and with those that rounding decides on; judged; flat.
    fn lacks(&self, other: &Self, range_px: (usize, usize), structure_grey: f64) -> ([u16; 2], u16, f64) {
        let [columns, rows, across, _] = self.layout();
        let tiles = |px: usize| 1 + px.div_ceil(4 * across);
        let (before, after) = (tiles(range_px.0), tiles(range_px.1));
        let (mut covered, mut judged, mut flat, mut seen) = ([0; 2], 0, 0, 0);
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let Some(mine) = self.structure(column, row) else { continue };
            seen += 1;
            flat += u32::from(mine < structure_grey / 2.0);
            // All that may be seen there lies in the other picture, but for the outermost tile on either side.
            if column + 1 < before || column + after > columns {
                continue;
            }
            let places = column.saturating_sub(before)..=(column + after).min(columns - 1);
            let theirs = places.map(|column| other.structure(column, row).unwrap_or(0.0)).fold(f64::MAX, f64::min);
            if theirs >= structure_grey {
                judged += 1;
                for (covered, slack) in covered.iter_mut().zip([1.0e-6, -1.0e-6]) {
                    *covered += u16::from(mine < structure_grey / 2.0 && theirs > 3.0 * mine + slack);
                }
            }
        }
        (covered, judged, 100.0 * f64::from(flat) / f64::from(seen.max(1)))
    }
}

#[test]
fn structure_and_coverings_are_those_of_every_block() {
    let mut random = Random::seeded("tiles", 0x5eed_0195);
    let (mut covered, mut judged, mut unknown, mut undecided) = (0, 0, 0, 0);
    let sizes = [(330, 250), (320, 240), (64, 48), (63, 200), (40, 30), (16, 16), (15, 9), (7, 5), (3, 3), (270, 195)];
    for (round, (width, height)) in (0..60).zip(sizes.into_iter().cycle()) {
        let [a, b] = [0, 1].map(|_| Shown::random(&mut random, width, height));
        let (mine, other) = (a.tiles(), b.tiles());
        let [columns, rows, ..] = a.layout();
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let (found, expected) = (mine.structure(row, column).map(f64::from), a.structure(column, row));
            assert_eq!(found.is_some(), expected.is_some(), "round {round}: {column}, {row} of {width} x {height}");
            assert!((found.unwrap_or(0.0) - expected.unwrap_or(0.0)).abs() < 1.0e-4, "{found:?}, {expected:?}");
            unknown += usize::from(found.is_none());
        }
        assert_eq!(
            (mine.structure(rows, 0), mine.structure(0, 16)),
            (mine.structure(rows, 0).filter(|_| rows < 12), None)
        );
        for range_px in [(0, 0), (8, 0), (0, 16), (40, 3), (1, 1), (20, 80), (400, 0)] {
            for structure_grey in [0.5, 2.0, 5.0] {
                let found = mine.lacks(&other, range_px, structure_grey);
                let expected = a.lacks(&b, range_px, f64::from(structure_grey));
                let what = std::format!("round {round}: {range_px:?}, {structure_grey}, {width} x {height}");
                assert!((expected.0[0]..=expected.0[1]).contains(&found.covered), "{what}");
                assert_eq!(found.judged, expected.1, "{what}");
                undecided += expected.0[1] - expected.0[0];
                assert!((f64::from(found.flat_percent) - expected.2).abs() < 1.0e-3, "{what}");
                covered += u32::from(found.covered);
                judged += u32::from(found.judged);
            }
        }
    }
    std::println!("{covered} covered of {judged}, {unknown} tiles that are not known");
    assert!(covered > 300 && judged > 3000 && unknown > 300 && undecided < 20);
}

#[test]
fn a_tile_is_covered_if_the_other_has_more_than_three_times_its_structure() {
    // One tile of blocks that differ by so many sixteenths of a grey value.
    let tile = |sixteenths: usize| {
        let grey = |x: usize, y: usize| {
            50 + u8::from(x / 4 % 2 == 1) * (sixteenths / 16 + usize::from(x % 4 + y % 4 * 4 < sixteenths % 16)) as u8
        };
        let rows = (0..16).map(|y| ((0..16).map(|x| grey(x, y)).collect(), ValidSpan { start: 0, end: 16 }));
        Shown { width: 16, rows: rows.collect() }.tiles()
    };
    for (mine, theirs, covered) in [(12, 36, 0), (11, 36, 1), (12, 37, 1), (16, 64, 0), (15, 64, 1)] {
        let found = tile(mine).lacks(&tile(theirs), (0, 0), 2.0);
        assert_eq!((found.covered, found.judged), (covered, 1), "{mine} and {theirs} sixteenths");
    }
}

#[test]
fn rows_below_the_picture_count_for_nothing() {
    let mut random = Random::seeded("tiles", 0x5eed_0197);
    let shown = Shown::random(&mut random, 100, 80);
    let (expected, mut found) = (shown.tiles(), shown.tiles());
    for y in 400_000..400_008 {
        found.push(y, &shown.rows[0].0, ValidSpan { start: 0, end: 100 });
    }
    assert_eq!((found.steps, found.counts), (expected.steps, expected.counts));
}
