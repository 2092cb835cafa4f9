//! Joined sets against sums over their points in f64.

use std::vec::Vec;

use nalgebra::{Matrix3, Vector3};

use super::*;
use crate::test_random::Random;

fn exact(points: &[Vector3<f64>]) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let n = points.len() as f64;
    let mean = points.iter().sum::<Vector3<f64>>() / n;
    (n, mean, points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum::<Matrix3<f64>>() / n)
}

fn matrix(scatter: &Scatter) -> Matrix3<f64> {
    let c = &scatter.covariance;
    Matrix3::new(c.xx, c.xy, c.xz, c.xy, c.yy, c.yz, c.xz, c.yz, c.zz).map(f64::from)
}

fn of(points: &[Vector3<f64>]) -> Scatter {
    let (n, mean, c) = exact(points);
    let c = c.map(|c| c as f32);
    let covariance = SymmetricMatrix3 { xx: c.m11, xy: c.m12, xz: c.m13, yy: c.m22, yz: c.m23, zz: c.m33 };
    Scatter { weight: n as f32, mean_m: mean.map(|m| m as f32).into(), covariance }
}

/// Greatest differences: of the mean relative to the farther mean, of the covariance relative to its largest entry.
fn apart(a: &Scatter, b: &Scatter, reach: f64) -> (f64, f64) {
    let mean = |s: &Scatter| Vector3::from(s.mean_m.map(f64::from));
    assert!((a.weight - b.weight).abs() <= 1.0e-6 * a.weight);
    ((mean(a) - mean(b)).norm() / reach, (matrix(a) - matrix(b)).amax() / matrix(b).amax())
}

#[test]
fn joined_sets_are_the_set_of_all_points_in_any_order() {
    let mut random = Random::seeded("joined sets", 0x5eed_0110);
    let mut worst = (0.0_f64, 0.0_f64);
    for round in 0..5000 {
        // Three sets, as far apart as the surfaces of one obstacle or as all the ground of a picture.
        let spread = if round % 2 == 0 { 1.0 } else { 20.0 };
        let mut reach = 0.0_f64;
        let sets: [Vec<Vector3<f64>>; 3] = core::array::from_fn(|_| {
            let middle = Vector3::from_fn(|_, _| random.within(-spread, spread)) + Vector3::new(25.0, 0.0, 0.0);
            let size = random.within(0.05, 2.0);
            reach = reach.max(middle.norm());
            (0..16 + random.below(300)).map(|_| middle + Vector3::from_fn(|_, _| random.within(-size, size))).collect()
        });
        let all: Vec<_> = sets.iter().flatten().copied().collect();
        let [a, b, c] = [of(&sets[0]), of(&sets[1]), of(&sets[2])];
        let truth = of(&all);
        for joined in
            [a.joined(&b).joined(&c), a.joined(&b.joined(&c)), c.joined(&a).joined(&b), b.joined(&a.joined(&c))]
        {
            let (mean, covariance) = apart(&joined, &truth, reach);
            worst = (worst.0.max(mean), worst.1.max(covariance));
            assert!(mean < 1.0e-6 && covariance < 1.0e-5, "round {round}: {mean:.1e}, {covariance:.1e}");
        }
    }
    std::println!("mean within {:.1e}, covariance within {:.1e}", worst.0, worst.1);
}

#[test]
fn sets_without_weight_change_nothing() {
    let mut random = Random::seeded("empty sets", 0x5eed_0111);
    let points: Vec<_> = (0..50).map(|_| Vector3::from_fn(|_, _| random.within(-3.0, 3.0))).collect();
    let set = of(&points);
    let empty = Scatter::default();
    let far = Scatter { weight: 0.0, mean_m: [1.0e6, -1.0e6, 3.0], ..set };
    assert_eq!(empty.joined(&empty), empty);
    assert_eq!(set.joined(&empty), set);
    assert_eq!(set.joined(&far), set);
    for other in [empty.joined(&set), far.joined(&set)] {
        let (mean, covariance) = apart(&other, &set, 1.0);
        assert!(mean < 0.1 && covariance < 1.0e-6, "{other:?}");
    }
    assert_eq!(empty.joined(&set), set);
}

#[test]
fn a_weight_counts_as_that_many_points() {
    // One set three times, the other once.
    let points = |x: f64| -> Vec<_> { (0..20).map(|i| Vector3::new(x, f64::from(i), f64::from(i * i % 7))).collect() };
    let (a, b) = (points(1.0), points(4.0));
    let thrice: Vec<_> = a.iter().chain(&a).chain(&a).chain(&b).copied().collect();
    let weighed = Scatter { weight: 3.0, ..of(&a) }.joined(&Scatter { weight: 1.0, ..of(&b) });
    let truth = Scatter { weight: 4.0, ..of(&thrice) };
    let (mean, covariance) = apart(&weighed, &truth, 1.0);
    assert!(mean < 1.0e-6 && covariance < 1.0e-6);
}

#[test]
fn the_variance_along_a_direction_is_that_of_the_projections() {
    let mut random = Random::seeded("variance along", 0x5eed_0112);
    for _ in 0..2000 {
        let points: Vec<_> = (0..30)
            .map(|_| Vector3::new(random.within(-4.0, 4.0), random.within(-1.0, 1.0), random.within(-0.1, 0.1)))
            .collect();
        let direction = Vector3::from_fn(|_, _| random.within(-1.0, 1.0)).normalize();
        let (_, mean, _) = exact(&points);
        let truth = points.iter().map(|p| (p - mean).dot(&direction).powi(2)).sum::<f64>() / 30.0;
        let found = f64::from(of(&points).variance_along(direction.map(|d| d as f32).into()));
        assert!((found - truth).abs() < 1.0e-5, "{found} instead of {truth}");
    }
}

#[test]
fn the_plane_looks_up_and_knows_its_scatter() {
    for (normal, up) in
        [([0.0, 0.0, 1.0], 1.0), ([0.6, 0.0, 0.8], 0.8), ([-0.6, 0.0, -0.8], 0.8), ([1.0, 0.0, 0.0], 0.0)]
    {
        let normal = Vector3::from(normal);
        let aside = normal.cross(&Vector3::y()).normalize();
        let across = normal.cross(&aside);
        let points: Vec<_> = (0..400)
            .map(|i| {
                let off = if (i / 20 + i) % 2 == 0 { 0.01 } else { -0.01 };
                aside * f64::from(i % 20) * 0.1 + across * f64::from(i / 20) * 0.07 + normal * off
            })
            .collect();
        let (found, variance) = of(&points).plane().unwrap();
        assert!((f64::from(found[2]) - up).abs() < 1.0e-3 && found[2] >= 0.0, "{found:?}");
        assert!((f64::from(variance) - 1.0e-4).abs() < 1.0e-6, "{variance}");
    }
    assert_eq!(Scatter::default().plane(), None);
}
