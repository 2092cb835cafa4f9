//! The map against the full model, written down once more in f64.

extern crate std;

use std::{ops::Range, println, vec, vec::Vec};

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::{made_up, recordings};
use crate::{
    geometry::{CameraModel, RawPair, Rectification, RectifiedPair, StereoCalibration},
    rectify::{Rectifier, Side, grid::PLACE_SHIFT, grid::STEP, grid_nodes, sample::WEIGHT_SHIFT},
};

/// Enough for every picture here.
const GRID: usize = grid_nodes(1280, 1024);
const MAX_ERROR_PX: f64 = 0.05;

/// Place in the raw picture by the full model, OpenCV's definition; `None` for rays that point backwards.
fn full_model(
    camera: &CameraModel,
    rotation: &Matrix3<f64>,
    pair: &RectifiedPair,
    cx: f64,
    u: f64,
    v: f64,
) -> Option<[f64; 2]> {
    let f = f64::from(pair.focal_px);
    let ray = rotation.transpose() * Vector3::new((u - cx) / f, (v - f64::from(pair.cy)) / f, 1.0);
    if ray.z <= 0.0 {
        return None;
    }
    let (x, y) = (ray.x / ray.z, ray.y / ray.z);
    let [k1, k2, p1, p2, k3, k4, k5, k6] = camera.distortion.0.map(f64::from);
    let r2 = x * x + y * y;
    let radial =
        (1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3)) / (1.0 + k4 * r2 + k5 * r2.powi(2) + k6 * r2.powi(3));
    let xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
    let yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
    Some([f64::from(camera.fx) * xd + f64::from(camera.cx), f64::from(camera.fy) * yd + f64::from(camera.cy)])
}

fn longest_run<T>(items: &[T], holds: impl Fn(&T) -> bool) -> Range<usize> {
    let (mut start, mut longest) = (0, 0..0);
    for (index, item) in items.iter().enumerate() {
        if !holds(item) {
            start = index + 1;
        } else if index + 1 - start > longest.len() {
            longest = start..index + 1;
        }
    }
    longest
}

fn matrix(rows: &[[f32; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| f64::from(rows[i][j]))
}

fn configured(raw: &RawPair) -> std::boxed::Box<Rectifier<GRID>> {
    let mut rectifier = std::boxed::Box::new(Rectifier::new());
    rectifier.configure(&StereoCalibration::Raw(*raw)).unwrap();
    rectifier
}

/// Error of the places that pixels are read from, largest and mean, and the share of pixels that are valid.
fn map_errors(name: &str, raw: &RawPair) {
    let rectifier = configured(raw);
    let pair = *rectifier.pair();
    let (width, height) = (pair.width as usize, pair.height as usize);
    for (side, camera, cx) in [
        (Side::Left, &raw.left, f64::from(pair.cx)),
        (Side::Right, &raw.right, f64::from(pair.cx) + f64::from(pair.disparity_offset_px)),
    ] {
        let rotation = matrix(rectifier.rotation(side).unwrap());
        let white = vec![255_u8; (camera.width * camera.height) as usize];
        let picture = crate::picture::Picture::packed(&white, camera.width as usize, camera.height as usize).unwrap();
        let mut out = vec![0_u8; width];
        let last = [camera.width, camera.height].map(|n| f64::from(n) - 1.0);
        let (mut worst, mut worst_exact, mut sum, mut valid) = (0.0_f64, 0.0_f64, 0.0, 0_usize);
        for v in 0..height {
            let span = rectifier.row(side, &picture, v, &mut out);
            let places: Vec<_> =
                (0..width).map(|u| full_model(camera, &rotation, &pair, cx, u as f64, v as f64)).collect();
            let seen = longest_run(&places, |p| p.is_some_and(|p| (0..2).all(|i| p[i] >= 0.0 && p[i] <= last[i])));
            assert!(
                span.len() + 4 >= seen.len(),
                "{name} {side:?} row {v}: {span:?}, but {seen:?} lies in the picture"
            );
            let segments: Vec<_> = rectifier.camera(side).grid.segments(v).collect();
            for (u, expected) in places.into_iter().enumerate() {
                if !span.contains(&u) {
                    assert_eq!(out[u], 0, "{name} {side:?} ({u}, {v})");
                    continue;
                }
                assert_eq!(out[u], 255, "{name} {side:?} ({u}, {v})");
                let expected = expected.unwrap();
                let segment = segments[u / STEP].unwrap();
                let exact = rectifier.source_of(side, u as f32, v as f32).unwrap();
                let exact = [f64::from(exact.0), f64::from(exact.1)];
                let error = (0..2).map(|i| {
                    // The place as the bilinear weights see it, rounded.
                    let place = segment.start[i] + segment.slope[i] * (u % STEP) as i32;
                    let seen = (place + (1 << (PLACE_SHIFT - WEIGHT_SHIFT - 1))) >> (PLACE_SHIFT - WEIGHT_SHIFT);
                    (f64::from(seen) / f64::from(1 << WEIGHT_SHIFT) - expected[i]).powi(2)
                });
                let error = error.sum::<f64>().sqrt();
                worst = worst.max(error);
                worst_exact = worst_exact.max((exact[0] - expected[0]).hypot(exact[1] - expected[1]));
                sum += error;
                valid += 1;
            }
        }
        let pixels = width * height;
        println!(
            "{name} {side:?}: error at most {worst:.4} px, mean {:.4}; f32 model at most {worst_exact:.5}; {:.2} % valid; \
             focal {:.2} px",
            sum / valid as f64,
            100.0 * valid as f64 / pixels as f64,
            pair.focal_px
        );
        assert!(worst <= MAX_ERROR_PX, "{name} {side:?}: {worst} px");
        assert!(worst_exact <= 0.005, "{name} {side:?}: {worst_exact} px");
        if raw.rectification.is_none() {
            assert_eq!(valid, pixels, "{name} {side:?}: pixels that the raw picture does not fill");
        }
    }
}

#[test]
fn map_is_that_of_the_full_model_on_made_up_calibrations() {
    for (name, raw) in made_up() {
        map_errors(name, &raw);
    }
}

#[test]
fn map_is_that_of_the_full_model_for_given_rectified_cameras() {
    for (name, mut raw) in made_up() {
        // Wider and of another size than the raw pictures, so that there is a border; with an offset between the cameras.
        let chosen = *configured(&raw).pair();
        let rectifier = configured(&raw);
        let pair = RectifiedPair {
            width: 640,
            height: 360,
            focal_px: 0.9 * chosen.focal_px,
            cx: 300.5,
            cy: 190.0,
            disparity_offset_px: 11.5,
            ..chosen
        };
        let rotations = [Side::Left, Side::Right].map(|side| *rectifier.rotation(side).unwrap());
        raw.rectification = Some(Rectification { left_rotation: rotations[0], right_rotation: rotations[1], pair });
        map_errors(name, &raw);
    }
}

#[test]
fn map_is_that_of_the_full_model_on_recordings() {
    for name in ["euroc-room", "k10-rover"] {
        let Some(recording) = recordings::find(name) else { continue };
        map_errors(name, &recordings::calibration(&recording));
    }
}

#[test]
fn chosen_cameras_split_the_rotation_and_lie_along_the_baseline() {
    for (name, raw) in made_up() {
        let rectifier = configured(&raw);
        let [left, right] = [Side::Left, Side::Right].map(|side| matrix(rectifier.rotation(side).unwrap()));
        let between = matrix(&raw.rotation);
        // Both turn into the same frame.
        assert!((right * between - left).amax() < 1.0e-6, "{name}: {}", right * between - left);
        // In it, the left camera lies on the negative x axis of the right one.
        let translation = right * Vector3::from(raw.translation_m.map(f64::from));
        let baseline_m = f64::from(rectifier.pair().baseline_m);
        assert!((translation - Vector3::new(-baseline_m, 0.0, 0.0)).amax() < 1.0e-6 * baseline_m.max(1.0), "{name}");
        // Bouguet: each takes half of the rotation, then both the shortest turn that lays the baseline along x.
        let half = Rotation3::from_matrix(&between).powf(0.5);
        let toward = -(half.inverse() * Vector3::from(raw.translation_m.map(f64::from)));
        let align = Rotation3::rotation_between(&toward, &Vector3::x()).unwrap();
        assert!(((align * half).matrix() - left).amax() < 1.0e-6, "{name}");
        assert!(((align * half.inverse()).matrix() - right).amax() < 1.0e-6, "{name}");
    }
}
