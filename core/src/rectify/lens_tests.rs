//! The lens against its definition in f64 and against differences of it.

use super::*;
use crate::test_random::Random;

fn lens(coefficients: [f32; 8]) -> Lens {
    Lens::new(&Distortion(coefficients))
}

const LENSES: [[f32; 8]; 5] = [
    [-0.312, 0.109, 0.0007, -0.0004, 0.0, 0.0, 0.0, 0.0],
    [-0.348, 0.151, -0.006, 0.009, -0.0342, 0.0, 0.0, 0.0],
    [0.412, -0.02, 0.004, -0.011, 0.0061, 0.731, 0.058, -0.0032],
    [0.11, 0.02, 0.05, 0.08, 0.0, 0.0, 0.0, 0.0],
    [0.2, 0.1, 0.01, 0.02, 0.03, 0.15, 0.2, 0.1],
];

/// OpenCV's definition.
fn plain(coefficients: [f32; 8], [x, y]: [f64; 2]) -> [f64; 2] {
    let [k1, k2, p1, p2, k3, k4, k5, k6] = coefficients.map(f64::from);
    let s = x * x + y * y;
    let radial = (1.0 + k1 * s + k2 * s.powi(2) + k3 * s.powi(3)) / (1.0 + k4 * s + k5 * s.powi(2) + k6 * s.powi(3));
    [x * radial + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x), y * radial + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y]
}

#[test]
fn points_and_their_slopes_are_those_of_the_definition() {
    let mut random = Random::seeded("lenses", 0x5eed_019a);
    for coefficients in LENSES {
        let lens = lens(coefficients);
        for _ in 0..200 {
            let ray = [0, 1].map(|_| random.within(-0.6, 0.6) as f32);
            let Some(Image { point, jacobian, determinant }) = lens.image(ray) else {
                panic!("{coefficients:?}, {ray:?}")
            };
            let ray = ray.map(f64::from);
            let expected = plain(coefficients, ray);
            let moved = |axis: usize, by: f64| {
                let mut there = ray;
                there[axis] += by;
                plain(coefficients, there)
            };
            let slopes = [0, 1].map(|axis| {
                let (before, behind) = (moved(axis, -1.0e-4), moved(axis, 1.0e-4));
                [0, 1].map(|i| (behind[i] - before[i]) / 2.0e-4)
            });
            for i in 0..2 {
                assert!((f64::from(point[i]) - expected[i]).abs() < 1.0e-6, "{coefficients:?}, {ray:?}");
                for axis in 0..2 {
                    let found = f64::from(jacobian[i][axis]);
                    assert!(
                        (found - slopes[axis][i]).abs() < 1.0e-5,
                        "{coefficients:?}, {ray:?}: {jacobian:?}, {slopes:?}"
                    );
                }
            }
            let expected = slopes[0][0] * slopes[1][1] - slopes[0][1] * slopes[1][0];
            assert!((f64::from(determinant) - expected).abs() < 1.0e-5);
        }
    }
}

#[test]
fn rays_come_back_from_where_they_meet_the_picture() {
    let mut random = Random::seeded("rays", 0x5eed_019b);
    for coefficients in LENSES {
        let lens = lens(coefficients);
        for _ in 0..200 {
            let ray = [0, 1].map(|_| random.within(-0.6, 0.6) as f32);
            let back = lens.distort(ray).and_then(|point| lens.undistort(point)).unwrap();
            assert!((0..2).all(|i| (back[i] - ray[i]).abs() < 1.0e-3), "{coefficients:?}: {ray:?}, {back:?}");
        }
    }
    // The first step leads far beyond the range, and is halved.
    let wide = lens([0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let back = wide.distort([7.9, 0.0]).and_then(|point| wide.undistort(point)).unwrap();
    assert!((back[0] - 7.9).abs() < 1.0e-3 && back[1].abs() < 1.0e-6, "{back:?}");
    // A lens that folds has a largest radius, beyond which there is no ray.
    let barrel = lens([-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(barrel.undistort([0.69, 0.0]).is_some());
    assert_eq!((barrel.undistort([0.72, 0.0]), barrel.undistort([0.0, -0.8])), (None, None));
}

#[test]
fn the_model_ends_where_it_cannot_be_believed() {
    // Eight focal lengths at most.
    let ideal = lens([0.0; 8]);
    assert_eq!(ideal.distort([8.0, 0.0]), Some([8.0, 0.0]));
    assert_eq!((ideal.distort([8.01, 0.0]), ideal.distort([6.0, -6.0])), (None, None));
    assert_eq!((ideal.distort([f32::NAN, 0.0]), ideal.distort([0.0, f32::INFINITY])), (None, None));
    // A denominator that falls through zero.
    let pole = lens([0.0, 0.0, 0.0, 0.0, 0.0, -2.0, 0.0, 0.0]);
    assert!(pole.radial(0.25).is_some());
    assert!(pole.radial(0.4951).is_none() && pole.radial(0.5).is_none() && pole.radial(0.6).is_none());
    assert!(pole.radial(f32::NAN).is_none() && pole.distort([0.9, 0.0]).is_none());
    // A slope beyond all numbers, though the factor is not.
    assert!(lens([0.0, 0.0, 0.0, 0.0, 3.0e38, 0.0, 0.0, 0.0]).radial(0.9).is_none());
    // Tangential terms that turn the picture over, or fold it, at (1, 0).
    let tangential = |p2: f32| lens([0.0, 0.0, 0.0, p2, 0.0, 0.0, 0.0, 0.0]).distort([1.0, 0.0]).is_some();
    assert!(tangential(0.5) && tangential(-0.1656), "the picture still grows");
    assert!(!tangential(-0.166_64) && !tangential(-0.3), "folded");
    assert!(!tangential(-1.0), "turned over");
}

/// Coefficients that no calibration may have: what is told is a number, or nothing is.
#[test]
fn what_grows_beyond_all_numbers_is_no_image() {
    let any_radius = |coefficients| Lens { coefficients, max_radius_squared: f32::INFINITY };
    let grows = any_radius([f32::MAX, f32::MAX, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(grows.radial(2.0).is_none(), "the factor is too large");
    assert!(grows.radial(0.1).is_none(), "its slope is");
    assert!(grows.image([0.1, 0.3]).is_none());
    let steep = any_radius([1.0e25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(steep.radial(1.0).is_some());
    assert!(steep.image([1.0, 0.0]).is_none(), "a determinant of 3e50");
}
