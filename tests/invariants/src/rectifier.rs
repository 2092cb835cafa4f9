//! Calibrations of any values into the rectifier, and raw pictures through it.

use std::cell::RefCell;

use fencepost_core::{
    geometry::{CameraModel, Distortion, RawPair, Rectification, RectifiedPair, StereoCalibration},
    picture::Picture,
    rectify::{Rectifier, Side, grid_nodes},
};

use crate::Source;

const WIDTH: usize = 40;
const HEIGHT: usize = 32;
const GRID: usize = grid_nodes(WIDTH, HEIGHT);

thread_local! {
    static RECTIFIERS: RefCell<[Box<Rectifier<GRID>>; 2]> =
        RefCell::new([Box::new(Rectifier::new()), Box::new(Rectifier::new())]);
}

type Matrix = [[f32; 3]; 3];

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let mut source = Source::new(bytes);
    let raw = raw_pair(&mut source);
    if let (Some(chosen), 0) = (raw.rectification, source.below(8)) {
        return check_rectified(chosen.pair);
    }
    RECTIFIERS.with_borrow_mut(|[rectifier, again]| {
        let before = *rectifier.pair();
        let calibration = StereoCalibration::Raw(raw);
        let pair = match rectifier.configure(&calibration) {
            Ok(pair) => pair,
            Err(error) => {
                assert!(error.field.starts_with("calibration"), "{error}");
                assert_eq!(*rectifier.pair(), before, "what is refused changes nothing");
                return;
            }
        };
        assert_eq!(pair.check(), Ok(()), "a pair that cannot be used");
        assert_eq!(*rectifier.pair(), pair);
        let capacity = grid_nodes(pair.width as usize, pair.height as usize);
        assert!(capacity <= GRID, "more than there is room for");
        let matrices = [Side::Left, Side::Right].map(|side| rectifier.rotation(side).copied());
        for rotation in matrices {
            check_rotation(&rotation.expect("raw pictures are turned"));
        }
        if raw.rectification.is_none() {
            check_chosen(&raw, &pair, matrices.map(Option::unwrap_or_default));
        }
        let twice = source.flag();
        if twice {
            assert_eq!(again.configure(&calibration), Ok(pair));
        }
        check_rows(&mut source, rectifier, twice.then_some(again), &raw, &pair);
        // Any place has one in the raw picture that is a number, or none.
        let [u, v] = [0; 2].map(|_| source.any_number(-1.0e4, 1.0e4));
        if let Some((x, y)) = rectifier.source_of(Side::Right, u, v) {
            assert!(x.is_finite() && y.is_finite(), "{x}, {y} for {u}, {v}");
        }
    });
}

/// Pictures that are rectified already go through as they are, as far as they reach.
fn check_rectified(pair: RectifiedPair) {
    RECTIFIERS.with_borrow_mut(|[rectifier, _]| {
        let (width, height) = (pair.width as usize, pair.height as usize);
        let found = rectifier.configure(&StereoCalibration::Rectified(pair));
        assert_eq!(found.is_ok(), pair.check().is_ok(), "{pair:?}");
        if found.is_err() {
            return;
        }
        assert_eq!((found, rectifier.rotation(Side::Left)), (Ok(pair), None));
        assert_eq!(rectifier.raw_size(Side::Right), (width, height));
        assert_eq!(rectifier.source_of(Side::Left, 3.0, -5.5), Some((3.0, -5.5)));
        let pixels: Vec<u8> = (0..width * height).map(|i| (i * 7) as u8).collect();
        for (columns, rows) in [(width, height), (width - 3, height - 1)] {
            let Ok(picture) = Picture::packed(&pixels, columns, rows) else { panic!("{columns} x {rows}") };
            let mut row = [77; WIDTH + 2];
            for y in [0, rows - 1, rows, height] {
                let valid = rectifier.row(Side::Left, &picture, y, &mut row);
                let expected = if y < rows { picture.row(y) } else { &[] };
                assert_eq!((valid.clone(), &row[valid]), (0..expected.len(), expected), "row {y}");
            }
        }
    });
}

/// The smallest and the largest value of the pixels around a place.
fn around(picture: &Picture<'_>, (x, y): (f32, f32)) -> Option<(u8, u8)> {
    let reach = 0.6;
    let columns = (x - reach).floor().max(0.0) as usize..=(x + reach).ceil().max(0.0) as usize;
    let rows = (y - reach).floor().max(0.0) as usize..=(y + reach).ceil().max(0.0) as usize;
    let rows = rows.filter(|y| *y < picture.height()).map(|y| picture.row(y));
    let values = rows.flat_map(|row| columns.clone().filter_map(|x| row.get(x).copied()));
    values.fold(None, |ends, v| Some(ends.map_or((v, v), |(least, most): (u8, u8)| (least.min(v), most.max(v)))))
}

/// Where the raw picture shows a pixel by the full model, if the lens does not bend there: the grid of the rectifier is bilinear
/// between its nodes, and a lens that no camera has bends more than that follows.
fn straight_source(rectifier: &Rectifier<GRID>, side: Side, x: usize, y: usize) -> Option<(f32, f32)> {
    const STEP: f32 = 8.0;
    let node = [x, y].map(|place| (place / 8 * 8) as f32);
    let mut places = [[(0.0, 0.0); 4]; 4];
    for (j, row) in places.iter_mut().enumerate() {
        for (i, place) in row.iter_mut().enumerate() {
            let at = [node[0] + (i as f32 - 1.0) * STEP, node[1] + (j as f32 - 1.0) * STEP];
            *place = rectifier.source_of(side, at[0], at[1])?;
        }
    }
    let bends = |a: (f32, f32), b: (f32, f32), c: (f32, f32)| {
        (a.0 - 2.0 * b.0 + c.0).abs().max((a.1 - 2.0 * b.1 + c.1).abs()) > 0.5
    };
    let bent = (0..4).any(|k| {
        (0..2).any(|i| {
            bends(places[k][i], places[k][i + 1], places[k][i + 2])
                || bends(places[i][k], places[i + 1][k], places[i + 2][k])
        })
    });
    let at = rectifier.source_of(side, x as f32, y as f32)?;
    (!bent && at.0.abs().max(at.1.abs()) < 100.0).then_some(at)
}

/// Rows are as long as they say, zero where they show nothing, and show what lies at the place that the model has.
fn check_rows(
    source: &mut Source<'_>,
    rectifier: &Rectifier<GRID>,
    again: Option<&mut Box<Rectifier<GRID>>>,
    raw: &RawPair,
    pair: &RectifiedPair,
) {
    let (width, height) = (pair.width as usize, pair.height as usize);
    let side = if source.flag() { Side::Left } else { Side::Right };
    let camera = if side == Side::Left { &raw.left } else { &raw.right };
    let (raw_width, raw_height) = (camera.width as usize, camera.height as usize);
    assert_eq!(rectifier.raw_size(side), (raw_width, raw_height));
    // Pictures that are larger or smaller than was said, too.
    let (raw_width, raw_height) = match source.byte() {
        0..=199 => (raw_width, raw_height),
        other => (1 + usize::from(other) % 48, 1 + usize::from(other) / 5),
    };
    let (kind, mut noise) = (source.byte(), u32::from(source.byte()) | 1);
    let raw_pixels: Vec<u8> = (0..raw_width.min(64) * raw_height.min(64))
        .map(|i| match kind % 3 {
            0 => {
                noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (noise >> 24) as u8
            }
            1 => (i * 3) as u8,
            _ => 200,
        })
        .collect();
    let Ok(picture) = Picture::packed(&raw_pixels, raw_width.min(64), raw_height.min(64)) else { return };
    let (mut row, mut other) = ([77; WIDTH + 2], [78; WIDTH + 2]);
    for y in [0, height / 2, height - 1, height, source.below(height)] {
        row.fill(77);
        let valid = rectifier.row(side, &picture, y, &mut row);
        assert!(valid.start <= valid.end && valid.end <= width, "{valid:?} of {width}");
        assert!(y < height || valid.is_empty(), "a row below the picture");
        let outside = row.iter().enumerate().filter(|(x, _)| !valid.contains(x));
        assert!(outside.into_iter().all(|(_, grey)| *grey == 0), "grey values where nothing is seen");
        let x = valid.start + source.below(valid.len());
        if valid.contains(&x)
            && let Some(at) = straight_source(rectifier, side, x, y)
            && let Some((least, most)) = around(&picture, at)
        {
            let found = row[x];
            assert!((least..=most).contains(&found), "{found} at {at:?}, where there is {least} to {most}");
        }
        if let Some(again) = &again {
            other.fill(78);
            assert_eq!(again.row(side, &picture, y, &mut other), valid);
            assert_eq!(row, other, "the same row again");
        }
        // A row that is too short gets its beginning.
        let mut short = [9; 5];
        rectifier.row(side, &picture, y, &mut short);
        assert!(y >= height || short.iter().zip(&row).all(|(a, b)| a == b || !valid.contains(&0)));
    }
}

fn check_rotation(m: &Matrix) {
    let dot = |a: [f32; 3], b: [f32; 3]| (0..3).map(|i| f64::from(a[i]) * f64::from(b[i])).sum::<f64>();
    for i in 0..3 {
        for j in 0..3 {
            let expected = f64::from(u8::from(i == j));
            assert!((dot(m[i], m[j]) - expected).abs() < 5.0e-3, "no rotation: {m:?}");
        }
    }
}

/// Cameras that were chosen lie along their rows: the baseline, turned, points along x and has the length that is told.
fn check_chosen(raw: &RawPair, pair: &RectifiedPair, [left, right]: [Matrix; 2]) {
    assert_eq!((pair.width, pair.height, pair.disparity_offset_px), (raw.left.width, raw.left.height, 0.0));
    let length = raw.translation_m.iter().map(|t| f64::from(*t).powi(2)).sum::<f64>().sqrt();
    assert!((f64::from(pair.baseline_m) - length).abs() < 5.0e-3 * length, "baseline {} of {length}", pair.baseline_m);
    let along = right.map(|row| (0..3).map(|i| f64::from(row[i]) * f64::from(raw.translation_m[i])).sum::<f64>());
    assert!((along[0] + length).abs() < 5.0e-3 * length, "the right camera lies at {along:?}");
    assert!(along[1].hypot(along[2]) < 5.0e-3 * length, "the rows do not lie along the baseline: {along:?}");
    // Left and right are turned to the same frame: right = left after the rotation between the cameras.
    for i in 0..3 {
        for j in 0..3 {
            let turned = (0..3).map(|k| f64::from(right[i][k]) * f64::from(raw.rotation[k][j])).sum::<f64>();
            assert!((turned - f64::from(left[i][j])).abs() < 1.0e-2, "the two frames differ: {left:?}, {right:?}");
        }
    }
}

fn raw_pair(source: &mut Source<'_>) -> RawPair {
    let left = camera(source);
    let right = if source.flag() { left } else { camera(source) };
    let rectification = (source.below(3) == 0).then(|| Rectification {
        left_rotation: rotation(source, 0.2),
        right_rotation: rotation(source, 0.2),
        pair: RectifiedPair {
            width: source.one_of(&[40, 16, 33]),
            height: source.one_of(&[32, 16, 17]),
            focal_px: source.any_number(5.0, 100.0),
            cx: source.any_number(-10.0, 50.0),
            cy: source.any_number(-10.0, 50.0),
            baseline_m: source.any_number(0.01, 1.0),
            disparity_offset_px: source.any_number(-4.0, 4.0),
        },
    });
    RawPair {
        left,
        right,
        rotation: rotation(source, 1.5),
        translation_m: [source.any_number(-1.0, 0.05), source.any_number(-0.3, 0.3), source.any_number(-0.3, 0.3)],
        rectification,
    }
}

fn camera(source: &mut Source<'_>) -> CameraModel {
    let size = |source: &mut Source<'_>, usual: u32| match source.byte() {
        0..=200 => usual,
        other => u32::from(other - 200) + 10,
    };
    let (width, height) = (size(source, WIDTH as u32), size(source, HEIGHT as u32));
    let fx = source.any_number(10.0, 100.0);
    let strength = source.one_of(&[0.0, 0.1, 1.0, 100.0]);
    let mut distortion = [0.0; 8];
    for k in distortion.iter_mut().take(source.one_of(&[0, 4, 5, 8])) {
        *k = source.any_number(-strength, strength);
    }
    CameraModel {
        width,
        height,
        fx,
        fy: if source.flag() { fx } else { source.any_number(10.0, 100.0) },
        cx: source.any_number(0.0, WIDTH as f32),
        cy: source.any_number(0.0, HEIGHT as f32),
        distortion: Distortion(distortion),
    }
}

/// A rotation by up to `most` radians about an axis of any direction, or something that is none.
fn rotation(source: &mut Source<'_>, most: f32) -> Matrix {
    let mut m = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for axis in 0..3 {
        let any = source.within(-most, most);
        let angle = source.one_of(&[0.0, 0.0, 0.02, any]);
        let (sin, cos) = angle.sin_cos();
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        for row in &mut m {
            (row[a], row[b]) = (row[a] * cos - row[b] * sin, row[a] * sin + row[b] * cos);
        }
    }
    if source.byte() >= 240 {
        let place = source.below(9);
        m[place / 3][place % 3] = source.any_number(-2.0, 2.0);
    }
    m
}
