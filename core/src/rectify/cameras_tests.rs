//! Rotations against nalgebra's, and cameras that have little in common.

use nalgebra::{Matrix3, Rotation3, Unit, UnitQuaternion, Vector3};

use super::*;
use crate::{geometry::Distortion, test_random::Random};

fn rows(m: &Matrix3<f64>) -> Matrix {
    core::array::from_fn(|i| core::array::from_fn(|j| m[(i, j)] as f32))
}

#[track_caller]
fn near(found: &Matrix, expected: &Matrix3<f64>, within: f64) {
    let worst = (0..9).map(|k| (f64::from(found[k / 3][k % 3]) - expected[(k / 3, k % 3)]).abs()).fold(0.0, f64::max);
    assert!(worst < within, "{found:?}, not {expected}");
}

#[test]
fn rotations_are_halved_about_any_axis_and_by_any_angle() {
    let mut random = Random::seeded("half rotations", 0x5eed_0198);
    let mut axes: std::vec::Vec<Vector3<f64>> =
        (0..400).map(|_| Vector3::from_fn(|_, _| random.within(-1.0, 1.0))).collect();
    axes.extend([Vector3::x(), Vector3::y(), Vector3::z(), -Vector3::x(), -Vector3::y(), -Vector3::z()]);
    for axis in axes {
        let axis = Unit::new_normalize(axis);
        for degrees in [0.0_f64, 0.1, 5.0, 60.0, 119.0, 121.0, 150.0, 175.0] {
            let angle = degrees.to_radians();
            let whole = rows(Rotation3::from_axis_angle(&axis, angle).matrix());
            near(&half_rotation(&whole), Rotation3::from_axis_angle(&axis, angle / 2.0).matrix(), 2.0e-5);
            let expected = UnitQuaternion::from_axis_angle(&axis, angle);
            let found = quaternion(&whole);
            for (found, expected) in found.iter().zip([expected.w, expected.i, expected.j, expected.k]) {
                assert!((f64::from(*found) - expected).abs() < 1.0e-5, "{axis:?}, {degrees} degrees: {found:?}");
            }
        }
    }
}

#[test]
fn products_of_vectors_are_those_of_their_definition() {
    let mut random = Random::seeded("products", 0x5eed_0199);
    for _ in 0..100 {
        let mut vector = || -> [f32; 3] { core::array::from_fn(|_| random.within(-2.0, 2.0) as f32) };
        let (a, b) = (vector(), vector());
        let [va, vb] = [a, b].map(|v| Vector3::from(v.map(f64::from)));
        let (found, expected) = (cross(a, b), va.cross(&vb));
        assert!((0..3).all(|i| (f64::from(found[i]) - expected[i]).abs() < 1.0e-5));
        assert!((f64::from(dot(a, b)) - va.dot(&vb)).abs() < 1.0e-5);
    }
}

fn camera(fx: f32) -> CameraModel {
    CameraModel { width: 512, height: 384, fx, fy: fx, cx: 255.5, cy: 191.5, distortion: Distortion::default() }
}

#[test]
fn cameras_that_see_nothing_in_common_keep_the_mean_focal_length() {
    let half = Rotation3::from_axis_angle(&Vector3::y_axis(), 1.0);
    let turned = half * half;
    let to_left = half * Vector3::new(-0.1, 0.0, 0.0);
    let raw = RawPair {
        left: camera(300.0),
        right: camera(340.0),
        rotation: rows(turned.matrix()),
        translation_m: core::array::from_fn(|i| to_left[i] as f32),
        rectification: None,
    };
    let (pair, _) = CameraMap::pair(&raw).unwrap();
    assert_eq!((pair.focal_px, pair.cx, pair.cy), (320.0, 255.5, 191.5));
}

#[test]
fn rays_that_point_backwards_have_no_source() {
    let forward = rows(&Matrix3::identity());
    let backward = rows(Rotation3::from_axis_angle(&Vector3::y_axis(), core::f64::consts::PI).matrix());
    let pair = RectifiedPair {
        width: 512,
        height: 384,
        focal_px: 300.0,
        cx: 255.5,
        cy: 191.5,
        baseline_m: 0.1,
        disparity_offset_px: 0.0,
    };
    let rectification = Some(Rectification { left_rotation: forward, right_rotation: backward, pair });
    let (left, right) = (camera(300.0), camera(300.0));
    let raw = RawPair { left, right, rotation: forward, translation_m: [-0.1, 0.0, 0.0], rectification };
    let (_, [left, right]) = CameraMap::pair(&raw).unwrap();
    for (u, v) in [(255.5, 191.5), (100.0, 50.0), (400.0, 300.0)] {
        assert_eq!((left.source(u, v), right.source(u, v)), (Some([u, v]), None));
    }
}
