//! Whether rows of both rectified pictures are in line: features are matched in two dimensions, and the difference of
//! their rows is what rectification has left.

extern crate std;

use std::{boxed::Box, path::Path, println, vec, vec::Vec};

use super::recordings::{self, Grey};
use crate::{
    geometry::{RawPair, StereoCalibration},
    picture::Picture,
    rectify::{Rectifier, Side, grid_nodes},
};

const GRID: usize = grid_nodes(1024, 768);
/// Half of the side of a patch.
const HALF: isize = 6;
/// Rows searched up and down: far more than what is tolerated.
const ROWS: isize = 5;
const DISPARITIES: core::ops::RangeInclusive<isize> = -4..=140;
const MIN_CORRELATION: f64 = 0.9;

#[test]
fn rows_of_matched_features_are_in_line_on_euroc_room() {
    check("euroc-room", 0.25);
}

#[test]
fn rows_of_matched_features_are_in_line_on_k10_rover() {
    check("k10-rover", 0.4);
}

/// The measure itself: rows that are put out of line by a pixel are seen to be.
#[test]
fn rows_out_of_line_are_noticed() {
    let Some(recording) = recordings::find("euroc-room") else { return };
    let mut raw = recordings::calibration(&recording);
    raw.right.cy += 1.0;
    let magnitudes = row_errors(&raw, &recording, 2);
    let median = magnitudes[magnitudes.len() / 2];
    println!("principal point off by 1 px: row error median |{median:.3}| px");
    assert!((0.8..1.3).contains(&median), "{median} px");
}

fn check(name: &str, limit_px: f64) {
    let Some(recording) = recordings::find(name) else { return };
    let magnitudes = row_errors(&recordings::calibration(&recording), &recording, usize::MAX);
    let (median, p90) = (magnitudes[magnitudes.len() / 2], magnitudes[magnitudes.len() * 9 / 10]);
    println!("{name}: {} matches, row error median |{median:.3}| px, 90 % below {p90:.3}", magnitudes.len());
    assert!(magnitudes.len() >= 150, "{name}: only {} matches", magnitudes.len());
    assert!(median <= limit_px, "{name}: {median} px");
}

/// Magnitudes of the row errors in the first pairs of a recording, ascending.
fn row_errors(raw: &RawPair, recording: &Path, pairs: usize) -> Vec<f64> {
    let mut rectifier = Box::new(Rectifier::<GRID>::new());
    rectifier.configure(&StereoCalibration::Raw(*raw)).unwrap();
    let mut magnitudes = Vec::new();
    for [left, right] in recordings::pairs(recording).into_iter().take(pairs) {
        let [left, right] =
            [(Side::Left, left), (Side::Right, right)].map(|(side, raw)| rectified(&rectifier, side, &raw));
        magnitudes
            .extend(corners(&left).into_iter().filter_map(|corner| row_error(&left, &right, corner)).map(f64::abs));
    }
    magnitudes.sort_by(f64::total_cmp);
    magnitudes
}

fn rectified(rectifier: &Rectifier<GRID>, side: Side, raw: &Grey) -> Grey {
    let (width, height) = (rectifier.pair().width as usize, rectifier.pair().height as usize);
    let picture = Picture::packed(&raw.pixels, raw.width, raw.height).unwrap();
    let mut pixels = vec![0; width * height];
    for (y, row) in pixels.chunks_mut(width).enumerate() {
        rectifier.row(side, &picture, y, row);
    }
    Grey { pixels, width, height }
}

impl Grey {
    fn at(&self, x: isize, y: isize) -> f64 {
        f64::from(self.pixels[y as usize * self.width + x as usize])
    }

    fn between(&self, x: f64, y: f64) -> f64 {
        let (column, row) = (x.floor() as isize, y.floor() as isize);
        let (a, b) = (x - x.floor(), y - y.floor());
        (self.at(column, row) * (1.0 - a) + self.at(column + 1, row) * a) * (1.0 - b)
            + (self.at(column, row + 1) * (1.0 - a) + self.at(column + 1, row + 1) * a) * b
    }

    fn slope(&self, x: isize, y: isize) -> [f64; 2] {
        [(self.at(x + 1, y) - self.at(x - 1, y)) / 2.0, (self.at(x, y + 1) - self.at(x, y - 1)) / 2.0]
    }

    /// Whether a patch around the place, with a margin, lies within the picture.
    fn holds(&self, x: isize, y: isize) -> bool {
        let margin = HALF + 3;
        x >= margin && y >= margin && x < self.width as isize - margin && y < self.height as isize - margin
    }
}

fn patch() -> impl Iterator<Item = (isize, isize)> {
    (-HALF..=HALF).flat_map(|dy| (-HALF..=HALF).map(move |dx| (dx, dy)))
}

/// Sums of the squared slopes over a patch: xx, xy, yy.
fn structure(picture: &Grey, x: isize, y: isize) -> [f64; 3] {
    patch().fold([0.0; 3], |[xx, xy, yy], (dx, dy)| {
        let [a, b] = picture.slope(x + dx, y + dy);
        [xx + a * a, xy + a * b, yy + b * b]
    })
}

/// The best corner of every 24 x 24 pixels by the smaller eigenvalue of the structure (Shi and Tomasi), if it is one.
fn corners(picture: &Grey) -> Vec<(isize, isize)> {
    const CELL: usize = 24;
    let mut found = Vec::new();
    for top in (0..picture.height).step_by(CELL) {
        for left in (0..picture.width).step_by(CELL) {
            let places = (0..CELL).step_by(2).flat_map(|y| (0..CELL).step_by(2).map(move |x| (left + x, top + y)));
            let best = places
                .map(|(x, y)| (x as isize, y as isize))
                .filter(|(x, y)| picture.holds(*x, *y))
                .map(|(x, y)| {
                    let [xx, xy, yy] = structure(picture, x, y);
                    ((xx + yy) / 2.0 - ((xx - yy) / 2.0).hypot(xy), (x, y))
                })
                .max_by(|a, b| a.0.total_cmp(&b.0));
            found.extend(best.filter(|(strength, _)| *strength > 3000.0).map(|(_, place)| place));
        }
    }
    found
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (a_mean, b_mean) = (a.iter().sum::<f64>() / a.len() as f64, b.iter().sum::<f64>() / b.len() as f64);
    let (mut ab, mut aa, mut bb) = (0.0, 1.0e-9, 1.0e-9);
    for (a, b) in a.iter().zip(b) {
        ab += (a - a_mean) * (b - b_mean);
        aa += (a - a_mean) * (a - a_mean);
        bb += (b - b_mean) * (b - b_mean);
    }
    ab / (aa * bb).sqrt()
}

/// Best place of the patch of `from` at `(x, y)` in `to`, moved by `sign` times the disparity; with its correlation, and
/// the best one that is not a neighbour of it.
fn search(from: &Grey, to: &Grey, (x, y): (isize, isize), sign: isize) -> Option<((isize, isize), f64, f64)> {
    let wanted: Vec<f64> = patch().map(|(dx, dy)| from.at(x + dx, y + dy)).collect();
    let mut scores = Vec::new();
    let mut there = Vec::new();
    for row in y - ROWS..=y + ROWS {
        for column in DISPARITIES.map(|d| x + sign * d) {
            if to.holds(column, row) {
                there.clear();
                there.extend(patch().map(|(dx, dy)| to.at(column + dx, row + dy)));
                scores.push(((column, row), correlation(&wanted, &there)));
            }
        }
    }
    let (place, best) = scores.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let far = scores.iter().filter(|((c, _), _)| (c - place.0).abs() > 3);
    Some((place, best, far.map(|s| s.1).fold(-1.0, f64::max)))
}

/// Row of the match in the right picture minus that in the left one, for a feature that is matched beyond doubt.
fn row_error(left: &Grey, right: &Grey, (x, y): (isize, isize)) -> Option<f64> {
    let (there, best, second) = search(left, right, (x, y), -1)?;
    if best < MIN_CORRELATION || best - second < 0.1 {
        return None;
    }
    let (back, ..) = search(right, left, there, 1)?;
    if (back.0 - x).abs() > 1 || (back.1 - y).abs() > 1 {
        return None;
    }
    // Lucas and Kanade's steps, with gain and offset of the grey values taken out, find the place between the pixels.
    let wanted: Vec<f64> = patch().map(|(dx, dy)| left.at(x + dx, y + dy)).collect();
    let slopes: Vec<[f64; 2]> = patch().map(|(dx, dy)| left.slope(x + dx, y + dy)).collect();
    let [xx, xy, yy] = structure(left, x, y);
    let determinant = xx * yy - xy * xy;
    let (mut column, mut row) = (there.0 as f64, there.1 as f64);
    for _ in 0..20 {
        let seen: Vec<f64> = patch().map(|(dx, dy)| right.between(column + dx as f64, row + dy as f64)).collect();
        let n = seen.len() as f64;
        let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
        let spread = |v: &[f64], m: f64| (v.iter().map(|e| (e - m).powi(2)).sum::<f64>() / n).sqrt().max(1.0e-6);
        let (wanted_mean, seen_mean) = (mean(&wanted), mean(&seen));
        let gain = spread(&wanted, wanted_mean) / spread(&seen, seen_mean);
        let (mut bx, mut by) = (0.0, 0.0);
        for ((wanted, seen), [a, b]) in wanted.iter().zip(&seen).zip(&slopes) {
            let difference = (wanted - wanted_mean) - gain * (seen - seen_mean);
            bx += difference * a;
            by += difference * b;
        }
        let step = [(yy * bx - xy * by) / determinant, (xx * by - xy * bx) / determinant];
        column += step[0];
        row += step[1];
        let strayed = (column - there.0 as f64).abs() > 1.5 || (row - there.1 as f64).abs() > 1.5;
        if strayed || !step[0].is_finite() || !step[1].is_finite() {
            return None;
        }
    }
    Some(row - y as f64)
}
