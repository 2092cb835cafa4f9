//! What users of the rectifier can rely on, and what it refuses.

extern crate std;

use std::{boxed::Box, println, vec, vec::Vec};

use super::{Random, camera, made_up, turned};
use crate::{
    error::{ConfigError, ConfigProblem},
    geometry::{CameraModel, Distortion, RawPair, Rectification, RectifiedPair, StereoCalibration},
    picture::Picture,
    rectify::{
        Rectifier, Side,
        grid::STEP,
        grid_nodes,
        sample::{HALF_WEIGHT, Source},
    },
};

const GRID: usize = grid_nodes(640, 480);
const SEED: u64 = 0x5eed_12ec;

/// It can lie in a static, and needs no memory at run time.
static UNCONFIGURED: Rectifier<GRID> = Rectifier::new();

fn rectifier(calibration: &StereoCalibration) -> Box<Rectifier<GRID>> {
    let mut rectifier = Box::new(Rectifier::new());
    rectifier.configure(calibration).unwrap();
    rectifier
}

fn plain(width: u32, height: u32) -> RectifiedPair {
    RectifiedPair { width, height, focal_px: 300.0, cx: 31.5, cy: 23.5, baseline_m: 0.1, disparity_offset_px: 0.0 }
}

fn noise(random: &mut Random, pixels: usize) -> Vec<u8> {
    (0..pixels).map(|_| random.next() as u8).collect()
}

#[test]
fn without_a_calibration_rows_are_empty() {
    let pixels = [7; 64];
    let picture = Picture::packed(&pixels, 8, 8).unwrap();
    let mut out = [9; 8];
    assert_eq!(UNCONFIGURED.row(Side::Left, &picture, 0, &mut out), 0..0);
    assert_eq!(out, [0; 8]);
    assert_eq!(UNCONFIGURED.pair().width, 0);
}

#[test]
fn a_pair_of_512_x_384_takes_at_most_27_kib() {
    assert!(size_of::<Rectifier<{ grid_nodes(512, 384) }>>() <= 27 * 1024);
}

#[test]
fn rectified_pictures_pass_through() {
    let mut random = Random::seeded("rectification", SEED);
    let pixels = noise(&mut random, 70 * 48);
    let picture = Picture::new(&pixels, 64, 48, 70).unwrap();
    let rectifier = rectifier(&StereoCalibration::Rectified(plain(64, 48)));
    let mut out = [1; 66];
    for y in 0..48 {
        assert_eq!(rectifier.row(Side::Right, &picture, y, &mut out), 0..64);
        assert_eq!(&out[..64], picture.row(y));
        assert_eq!(&out[64..], [0; 2]);
    }
    assert_eq!(rectifier.row(Side::Right, &picture, 48, &mut out), 0..0);
    assert_eq!(out, [0; 66]);
    assert_eq!(rectifier.rotation(Side::Left), None);
    // Of a smaller picture there is less.
    let small = Picture::packed(&pixels, 20, 10).unwrap();
    assert_eq!(rectifier.row(Side::Left, &small, 9, &mut out), 0..20);
    assert_eq!(rectifier.row(Side::Left, &small, 10, &mut out), 0..0);
}

#[test]
fn pictures_have_the_size_that_their_calibration_says_and_no_row_below_it() {
    let passed = rectifier(&StereoCalibration::Rectified(plain(64, 48)));
    assert_eq!([Side::Left, Side::Right].map(|side| passed.raw_size(side)), [(64, 48); 2]);
    let mut raw = made_up()[0].1;
    raw.right = CameraModel { width: 500, height: 400, ..raw.right };
    let rotation = turned([0.0; 3]);
    let pair = RectifiedPair { cx: 100.0, cy: 100.0, ..plain(64, 48) };
    raw.rectification = Some(Rectification { left_rotation: rotation, right_rotation: rotation, pair });
    let rectifier = rectifier(&StereoCalibration::Raw(raw));
    assert_eq!([Side::Left, Side::Right].map(|side| rectifier.raw_size(side)), [(512, 384), (500, 400)]);
    let white = vec![255; 512 * 384];
    let picture = Picture::packed(&white, 512, 384).unwrap();
    let mut out = [9; 70];
    assert_eq!(rectifier.row(Side::Left, &picture, 47, &mut out), 0..64);
    // The map reaches a little farther.
    assert_eq!(rectifier.row(Side::Left, &picture, 48, &mut out), 0..0);
    assert_eq!(out, [0; 70]);
}

/// A rectifier of cameras that are the rectified ones already, without a lens.
fn unchanged<const NODES: usize>(pair: RectifiedPair) -> Box<Rectifier<NODES>> {
    let RectifiedPair { width, height, focal_px, cx, cy, .. } = pair;
    let ideal = CameraModel { width, height, fx: focal_px, fy: focal_px, cx, cy, distortion: Distortion::default() };
    let rotation = turned([0.0; 3]);
    let rectification = Some(Rectification { left_rotation: rotation, right_rotation: rotation, pair });
    let raw = RawPair { left: ideal, right: ideal, rotation, translation_m: [-0.1, 0.0, 0.0], rectification };
    let mut rectifier = Box::new(Rectifier::new());
    rectifier.configure(&StereoCalibration::Raw(raw)).unwrap();
    rectifier
}

/// Where raw and rectified camera are the same, every pixel keeps its value, those of the last row and column too.
#[test]
fn the_same_camera_gives_the_same_picture() {
    let rectifier = unchanged::<GRID>(plain(64, 48));
    let pixels = noise(&mut Random::seeded("rectification", SEED), 64 * 48);
    let picture = Picture::packed(&pixels, 64, 48).unwrap();
    let mut out = [0; 64];
    for y in 0..48 {
        assert_eq!(rectifier.row(Side::Left, &picture, y, &mut out), 0..64, "row {y}");
        assert_eq!(out, picture.row(y), "row {y}");
    }
}

/// So it is where the lens ends, at eight focal lengths, before it comes to the middle of the picture, from which the plane of the
/// map is taken: far from the origin, where nodes hold the way from a plane and not that from the origin.
#[test]
fn a_picture_whose_middle_shows_nothing_is_the_same_elsewhere() {
    let (width, height, first) = (1280, 48, 1100 - 8 * 40);
    let rectifier =
        unchanged::<{ grid_nodes(1280, 48) }>(RectifiedPair { focal_px: 40.0, cx: 1100.0, ..plain(1280, 48) });
    assert_eq!(rectifier.source_of(Side::Left, 640.0, 24.0), None);
    let pixels = noise(&mut Random::seeded("rectification", SEED), width * height);
    let picture = Picture::packed(&pixels, width, height).unwrap();
    let mut out = [0; 1280];
    for y in 0..height {
        let span = rectifier.row(Side::Left, &picture, y, &mut out);
        // Between nodes of which one lies beyond the lens there is no place.
        assert!((first..first + 2 * STEP).contains(&span.start) && span.end == width, "row {y}: {span:?}");
        assert_eq!(out[span.clone()], picture.row(y)[span], "row {y}");
    }
}

/// Grey values against bilinear interpolation in f64 at the place that the model gives.
#[test]
fn grey_values_are_bilinear() {
    for (name, raw) in made_up() {
        let rectifier = rectifier(&StereoCalibration::Raw(raw));
        let (width, height) = (512, 384);
        // Smooth: a place wrong by 1/20 px moves a grey value by a third of a level.
        let grey = |x: f64, y: f64| 127.5 + 60.0 * (x / 13.0).sin() + 60.0 * (y / 11.0 + x / 40.0).cos();
        let pixels: Vec<u8> =
            (0..width * height).map(|i| grey((i % width) as f64, (i / width) as f64).round() as u8).collect();
        let picture = Picture::packed(&pixels, width, height).unwrap();
        let mut out = vec![0; width];
        let mut worst = 0.0_f64;
        for y in 0..height {
            let span = rectifier.row(Side::Right, &picture, y, &mut out);
            for x in span {
                let (u, v) = rectifier.source_of(Side::Right, x as f32, y as f32).unwrap();
                worst = worst.max((f64::from(out[x]) - grey(f64::from(u), f64::from(v))).abs());
            }
        }
        println!("{name}: grey values within {worst:.2}");
        assert!(worst < 1.8, "{name}: {worst}");
    }
}

/// Eight pixels at once give what one after the other gives.
#[test]
fn whole_segments_are_as_their_pixels() {
    for (name, raw) in made_up() {
        let rectifier = rectifier(&StereoCalibration::Raw(raw));
        let (width, height) = (512, 384);
        let pixels = noise(&mut Random::seeded("rectification", SEED), width * height);
        let picture = Picture::packed(&pixels, width, height).unwrap();
        let source = Source::new(&picture, (width, height));
        let mut out = vec![0; width];
        for y in 0..height {
            let span = rectifier.row(Side::Left, &picture, y, &mut out);
            let segments: Vec<_> = rectifier.left.grid.segments(y).collect();
            for x in span {
                let segment = segments[x / STEP].unwrap();
                let place = [0, 1].map(|i| segment.start[i] + segment.slope[i] * (x % STEP) as i32 + HALF_WEIGHT);
                assert_eq!(Some(out[x]), source.at(place), "{name} ({x}, {y})");
            }
        }
    }
}

/// Where the raw picture ends within a segment, its pixels are told one by one, at all four edges.
#[test]
fn segments_at_the_edges_are_as_their_pixels() {
    let mut random = Random::seeded("edges", SEED);
    let pixels = noise(&mut random, 70 * 48);
    let picture = Picture::new(&pixels, 64, 48, 70).unwrap();
    let source = Source::new(&picture, (64, 48));
    let ideal = CameraModel { width: 64, height: 48, cx: 31.5, cy: 23.5, fx: 300.0, fy: 300.0, ..camera([0.0; 8]) };
    let rotation = turned([0.0; 3]);
    for round in 0..60 {
        let moved = [0, 1].map(|_| random.within_f32(-12.0, 30.0));
        let focal_px = [300.0, 297.0, 330.0, 200.0][round % 4];
        let pair = RectifiedPair { focal_px, cx: 31.5 + moved[0], cy: 23.5 + moved[1], ..plain(96, 72) };
        let rectification = Some(Rectification { left_rotation: rotation, right_rotation: rotation, pair });
        let translation_m = [-0.1, 0.0, 0.0];
        let raw = RawPair { left: ideal, right: ideal, rotation, translation_m, rectification };
        let rectifier = rectifier(&StereoCalibration::Raw(raw));
        let mut out = [9; 96];
        for y in 0..72 {
            let span = rectifier.row(Side::Left, &picture, y, &mut out);
            let segments: Vec<_> = rectifier.left.grid.segments(y).collect();
            let expected = (0..96).map(|x| {
                let segment = segments[x / STEP].unwrap();
                source.at([0, 1].map(|i| segment.start[i] + segment.slope[i] * (x % STEP) as i32 + HALF_WEIGHT))
            });
            let expected: Vec<Option<u8>> = expected.collect();
            // One picture without holes: what is valid hangs together.
            let valid = expected.iter().filter(|value| value.is_some()).count();
            assert_eq!(span.len(), valid, "round {round}, row {y}: {span:?}");
            for (x, value) in expected.into_iter().enumerate() {
                assert_eq!(
                    (out[x], span.contains(&x)),
                    (value.unwrap_or(0), value.is_some()),
                    "round {round}: {x}, {y}"
                );
            }
        }
    }
}

/// The same bits on every processor: FNV-1a over both rectified pictures and the chosen cameras.
#[test]
fn the_bits_are_the_same_everywhere() {
    let found = made_up().map(|(name, raw)| {
        let rectifier = rectifier(&StereoCalibration::Raw(raw));
        let pixels = noise(&mut Random::seeded("rectification", SEED), 512 * 384);
        let picture = Picture::packed(&pixels, 512, 384).unwrap();
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut add = |bytes: &[u8]| {
            for byte in bytes {
                hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
            }
        };
        let pair = rectifier.pair();
        for value in [pair.focal_px, pair.cx, pair.cy, pair.baseline_m] {
            add(&value.to_bits().to_le_bytes());
        }
        let mut out = [0; 512];
        for side in [Side::Left, Side::Right] {
            for y in 0..384 {
                rectifier.row(side, &picture, y, &mut out);
                add(&out);
            }
        }
        println!("{name}: {hash:#018x}");
        hash
    });
    assert_eq!(found, GOLDEN);
}

const GOLDEN: [u64; 5] =
    [0x6dd0_64f2_6f90_e6b1, 0x5ead_8bf2_6b4f_11a1, 0x58a1_fca2_c63d_8556, 0xa609_670a_e5dc_a37c, 0x8a28_686e_e6b2_1ae8];

/// A strong lens folds far outside of the picture; what lies behind the fold must not come out as valid.
#[test]
fn behind_the_fold_of_a_lens_nothing_is_valid() {
    // The radius 1 - 0.3 r^2 has its maximum at r = 1.054, and comes back to the centre at 1.826.
    let mut raw = made_up()[1].1;
    raw.left = camera([-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let rotation = turned([0.0; 3]);
    let pair = RectifiedPair { focal_px: 100.0, cx: 256.0, cy: 192.0, ..plain(512, 384) };
    raw.rectification = Some(Rectification { left_rotation: rotation, right_rotation: rotation, pair });
    let rectifier = rectifier(&StereoCalibration::Raw(raw));
    let white = vec![255; 512 * 384];
    let picture = Picture::packed(&white, 512, 384).unwrap();
    let mut out = [0; 512];
    let mut valid = 0;
    for y in 0..384 {
        for x in rectifier.row(Side::Left, &picture, y, &mut out) {
            let radius = ((x as f32 - 256.0) / 100.0).hypot((y as f32 - 192.0) / 100.0);
            assert!(radius < 1.06, "({x}, {y}) lies behind the fold");
            valid += 1;
        }
    }
    assert!(valid > 20_000, "only {valid} px are valid");
    assert_eq!(rectifier.source_of(Side::Left, 256.0 + 150.0, 192.0), None);
}

#[test]
fn what_cannot_be_used_is_refused_by_name() {
    type Spoil = fn(&mut RawPair);
    let cases: [(&str, ConfigProblem, Spoil); 14] = [
        ("calibration.left.fx", ConfigProblem::NotFinite, |p| p.left.fx = f32::NAN),
        ("calibration.right.fy", OUT_OF_FOCAL, |p| p.right.fy = 0.0),
        ("calibration.left.fx", OUT_OF_FOCAL, |p| p.left.fx = -300.0),
        ("calibration.right.cx", ConfigProblem::NotFinite, |p| p.right.cx = f32::INFINITY),
        ("calibration.left.width", OUT_OF_SIZE, |p| p.left.width = 0),
        ("calibration.right.height", OUT_OF_SIZE, |p| p.right.height = 100_000),
        ("calibration.left.distortion", ConfigProblem::NotFinite, |p| p.left.distortion.0[7] = f32::NAN),
        ("calibration.rotation", ConfigProblem::NotFinite, |p| p.rotation[1][2] = f32::NAN),
        ("calibration.rotation", ConfigProblem::NotARotation, |p| p.rotation[0][0] += 0.01),
        ("calibration.rotation", ConfigProblem::NotARotation, |p| p.rotation[2] = p.rotation[2].map(|e| -e)),
        ("calibration.translation_m", ConfigProblem::NotFinite, |p| p.translation_m[0] = f32::NAN),
        ("calibration.translation_m", OUT_OF_BASELINE, |p| p.translation_m = [0.0; 3]),
        ("calibration.translation_m", ConfigProblem::Exchanged, |p| p.translation_m[0] = 0.1),
        ("calibration.left.width", OUT_OF_SIZE, |p| p.left.width = 15),
    ];
    for (field, problem, spoil) in cases {
        let mut raw = made_up()[1].1;
        spoil(&mut raw);
        let mut rectifier = Box::new(Rectifier::<GRID>::new());
        let found = rectifier.configure(&StereoCalibration::Raw(raw));
        assert_eq!(found, Err(ConfigError::new(field, problem)));
    }
}

const OUT_OF_FOCAL: ConfigProblem = ConfigProblem::OutOfRange { min: 1.0, max: 1.0e5 };
const OUT_OF_SIZE: ConfigProblem = ConfigProblem::OutOfRange { min: 16.0, max: 8192.0 };
const OUT_OF_BASELINE: ConfigProblem = ConfigProblem::OutOfRange { min: 1.0e-3, max: 100.0 };

#[test]
fn cameras_without_rows_in_common_are_refused() {
    for translation_m in [[0.01, -0.2, 0.0], [-0.01, 0.0, 0.2]] {
        let mut raw = made_up()[0].1;
        raw.translation_m = translation_m;
        let error = Rectifier::<GRID>::new().configure(&StereoCalibration::Raw(raw)).unwrap_err();
        assert!(error.field.starts_with("calibration.translation_m"), "{error}");
    }
}

#[test]
fn given_rectified_cameras_are_checked() {
    let good = Rectification { left_rotation: turned([0.0; 3]), right_rotation: turned([0.0; 3]), pair: plain(64, 48) };
    let cases = [
        ("calibration.rectification.left_rotation", Rectification { left_rotation: [[0.5; 3]; 3], ..good }),
        ("calibration.rectification.right_rotation", Rectification { right_rotation: [[f32::NAN; 3]; 3], ..good }),
        ("calibration.focal_px", Rectification { pair: RectifiedPair { focal_px: 0.0, ..good.pair }, ..good }),
        ("calibration.baseline_m", Rectification { pair: RectifiedPair { baseline_m: -0.1, ..good.pair }, ..good }),
    ];
    for (field, rectification) in cases {
        let mut raw = made_up()[0].1;
        raw.rectification = Some(rectification);
        let error = Rectifier::<GRID>::new().configure(&StereoCalibration::Raw(raw)).unwrap_err();
        assert_eq!(error.field, field, "{error}");
    }
}

#[test]
fn a_refused_calibration_changes_nothing() {
    let mut rectifier = rectifier(&StereoCalibration::Rectified(plain(64, 48)));
    let mut large = made_up()[0].1;
    (large.left.width, large.left.height) = (8192, 8192);
    let error = rectifier.configure(&StereoCalibration::Raw(large)).unwrap_err();
    let needed = grid_nodes(8192, 8192);
    assert_eq!(error.problem, ConfigProblem::OverCapacity { needed, capacity: GRID });
    assert_eq!(*rectifier.pair(), plain(64, 48));
}

/// Whatever passes the checks gives rows, with pixels of 0 outside of the valid columns, and never a panic.
#[test]
fn wild_calibrations_do_no_harm() {
    let mut random = Random::seeded("rectification", SEED);
    let mut rectifier = Box::new(Rectifier::<GRID>::new());
    let white = vec![255; 640 * 480];
    let (mut taken, mut refused, mut valid) = (0, 0, 0_usize);
    for _ in 0..2000 {
        let camera = |random: &mut Random| {
            let spread = 10.0_f32.powf(random.within_f32(-3.0, 6.0));
            CameraModel {
                width: random.within_f32(16.0, 640.0) as u32,
                height: random.within_f32(16.0, 480.0) as u32,
                fx: 10.0_f32.powf(random.within_f32(0.0, 5.0)),
                fy: 10.0_f32.powf(random.within_f32(0.0, 5.0)),
                cx: random.within_f32(-1.0, 1.0) * 10.0_f32.powf(random.within_f32(0.0, 5.0)),
                cy: random.within_f32(-1.0, 1.0) * 10.0_f32.powf(random.within_f32(0.0, 5.0)),
                distortion: Distortion(core::array::from_fn(|_| random.within_f32(-spread, spread))),
            }
        };
        let angles = |random: &mut Random| {
            let reach = 10.0_f32.powf(random.within_f32(-3.0, 0.5));
            core::array::from_fn(|_| f64::from(random.within_f32(-reach, reach)))
        };
        let left = camera(&mut random);
        let right = camera(&mut random);
        let given = random.next() & 1 == 0;
        let pair = RectifiedPair {
            width: random.within_f32(16.0, 640.0) as u32,
            height: random.within_f32(16.0, 480.0) as u32,
            focal_px: 10.0_f32.powf(random.within_f32(0.0, 5.0)),
            cx: random.within_f32(-1.0e5, 1.0e5),
            cy: random.within_f32(-1.0e3, 1.0e3),
            baseline_m: random.within_f32(1.0e-3, 100.0),
            disparity_offset_px: random.within_f32(-1.0e4, 1.0e4),
        };
        let rectification = given.then(|| Rectification {
            left_rotation: turned(angles(&mut random)),
            right_rotation: turned(angles(&mut random)),
            pair,
        });
        let raw = RawPair {
            left,
            right,
            rotation: turned(angles(&mut random)),
            translation_m: core::array::from_fn(|_| random.within_f32(-1.0, 0.5)),
            rectification,
        };
        let Ok(pair) = rectifier.configure(&StereoCalibration::Raw(raw)) else {
            refused += 1;
            continue;
        };
        taken += 1;
        for (side, camera) in [(Side::Left, left), (Side::Right, right)] {
            let picture = Picture::packed(&white, camera.width as usize, camera.height as usize).unwrap();
            for y in (0..pair.height as usize).step_by(7).chain([usize::MAX]) {
                let mut out = [77; 650];
                let span = rectifier.row(side, &picture, y, &mut out);
                assert!(span.start <= span.end && span.end <= pair.width as usize, "{raw:?}: {span:?}");
                for (x, pixel) in out.iter().enumerate() {
                    assert_eq!(*pixel, if span.contains(&x) { 255 } else { 0 }, "{raw:?}: ({x}, {y})");
                }
                valid += span.len();
            }
        }
    }
    println!("{taken} taken, {refused} refused, {valid} px valid in the rows tried");
    assert!(taken > 500 && refused > 100 && valid > 10_000);
}

/// A picture that is not the one of the calibration: no panic, and no pixel from beyond it.
#[test]
fn a_picture_of_another_size_is_read_within_its_bounds() {
    let rectifier = rectifier(&StereoCalibration::Raw(made_up()[1].1));
    let white = vec![255; 600 * 500];
    for (width, height) in [(1, 1), (2, 2), (100, 384), (512, 17), (600, 500)] {
        let picture = Picture::packed(&white, width, height).unwrap();
        for y in 0..384 {
            let mut out = [3; 512];
            let span = rectifier.row(Side::Left, &picture, y, &mut out);
            assert!(out.iter().enumerate().all(|(x, p)| *p == if span.contains(&x) { 255 } else { 0 }));
        }
    }
}
