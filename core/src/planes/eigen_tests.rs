//! Against nalgebra's iterative solver in f64.

extern crate std;

use std::println;

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::*;
use crate::test_random::Random;

const SEED: u64 = 0x5eed_0e19;
const MATRICES: u32 = 1_000_000;

/// Matrices of every kind.
impl Random {
    /// Ten to a power within `low..high`.
    fn decades(&mut self, low: f64, high: f64) -> f64 {
        self.within(low, high).exp2().powf(core::f64::consts::LOG2_10)
    }

    fn sign(&mut self) -> f64 {
        if self.next() & 1 == 0 { 1.0 } else { -1.0 }
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.within(-1.0, 1.0), self.within(-1.0, 1.0), self.within(-1.0, 1.0))
    }

    fn with_eigenvalues(&mut self, values: [f64; 3]) -> Matrix3<f64> {
        let x = self.vector().normalize();
        let y = x.cross(&self.vector()).normalize();
        let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
        axes * Matrix3::from_diagonal(&Vector3::from(values)) * axes.transpose()
    }

    /// Covariance of the points of a small surface seen by a stereo camera: far, thin, with the noise along the ray.
    fn stereo_surface(&mut self) -> Matrix3<f64> {
        let (focal_px, baseline_m) = (400.0, 0.12);
        let (slope_u, slope_v) = (self.within(-0.3, 0.3), self.within(-0.3, 0.3));
        let start = self.within(3.0, 60.0);
        let (width, height) = (self.within(2.0, 32.0), self.within(2.0, 32.0));
        let noise_px = self.decades(-4.0, -0.5);
        let (u0, v0) = (self.within(-300.0, 300.0), self.within(-200.0, 200.0));
        let points: [Vector3<f64>; 24] = core::array::from_fn(|_| {
            let (u, v) = (self.within(0.0, width), self.within(0.0, height));
            let disparity = (start + slope_u * u + slope_v * v + noise_px * self.within(-1.0, 1.0)).max(1.0);
            let z = focal_px * baseline_m / disparity;
            Vector3::new((u0 + u) * z / focal_px, (v0 + v) * z / focal_px, z)
        });
        let mean = points.iter().sum::<Vector3<f64>>() / 24.0;
        points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum::<Matrix3<f64>>()
    }

    fn symmetric(&mut self, mut entry: impl FnMut(&mut Self) -> f64) -> Matrix3<f64> {
        let [a, b, c, d, e, f] = core::array::from_fn(|_| entry(self));
        Matrix3::new(a, b, c, b, d, e, c, e, f)
    }

    fn matrix(&mut self, kind: u32) -> Matrix3<f64> {
        match kind {
            0 => self.symmetric(|r| r.within(-1.0, 1.0)),
            1 => {
                let values = core::array::from_fn(|_| self.decades(-8.0, 0.0) * self.sign());
                self.with_eigenvalues(values)
            }
            2 => {
                let values = [self.decades(-9.0, -2.0), self.decades(-4.0, 0.0), 1.0];
                self.with_eigenvalues(values)
            }
            // The smallest or the largest gap around the threshold.
            3 | 4 => {
                let (gap, other) = (self.decades(-5.0, -1.0), self.within(0.0, 1.0));
                let values = if kind == 3 { [other, other - gap, 1.0] } else { [1.0, 1.0 - gap, other] };
                self.with_eigenvalues(values)
            }
            // Nearly and wholly equal.
            5 => {
                let values = core::array::from_fn(|_| 1.0 + self.decades(-9.0, -1.0) * self.sign());
                self.with_eigenvalues(values)
            }
            6 => {
                let (single, double) = (self.within(-1.0, 1.0), self.within(-1.0, 1.0));
                self.with_eigenvalues([single, double, double])
            }
            // Rank one.
            7 => {
                let v = self.vector();
                v * v.transpose()
            }
            // Small whole numbers: many exact zeros, repeats and ties.
            8 => self.symmetric(|r| (r.next() % 5) as f64 - 2.0),
            9 => {
                let [a, b, c] = core::array::from_fn(|_| (self.next() % 3) as f64);
                Matrix3::from_diagonal(&Vector3::new(a, b, c))
            }
            // Entries of wholly different size.
            10 => self.symmetric(|r| r.decades(-30.0, 0.0) * r.sign()),
            _ => self.stereo_surface(),
        }
    }

    fn scale(&mut self) -> f64 {
        match self.next() % 4 {
            0 | 1 => 1.0,
            2 => self.decades(-30.0, 30.0),
            _ => self.decades(-44.0, -38.0),
        }
    }
}

/// Ascending eigenvalues with their vectors.
fn reference(matrix: Matrix3<f64>) -> [(f64, Vector3<f64>); 3] {
    // Scaled, so that no threshold inside the iteration meets an extreme.
    let size = matrix.amax();
    let scale = if size > 0.0 { size } else { 1.0 };
    let eigen = SymmetricEigen::new(matrix / scale);
    let mut pairs = [0, 1, 2].map(|i| (eigen.eigenvalues[i] * scale, eigen.eigenvectors.column(i).into_owned()));
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    pairs
}

fn tilt_deg(found: [f32; 3], truth: &Vector3<f64>) -> f64 {
    let found = Vector3::from(found.map(f64::from));
    assert!((found.norm() - 1.0).abs() < 1.0e-6, "not a unit vector: {found}");
    found.cross(truth).norm().atan2(found.dot(truth).abs()).to_degrees()
}

fn rounded(m: &Matrix3<f64>) -> SymmetricMatrix3 {
    let [xx, xy, xz, yy, yz, zz] = [m[(0, 0)], m[(0, 1)], m[(0, 2)], m[(1, 1)], m[(1, 2)], m[(2, 2)]].map(|e| e as f32);
    SymmetricMatrix3 { xx, xy, xz, yy, yz, zz }
}

fn exact(m: &SymmetricMatrix3) -> Matrix3<f64> {
    let [xx, xy, xz, yy, yz, zz] = m.entries().map(f64::from);
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

#[test]
fn a_million_matrices_agree_with_nalgebra_in_f64() {
    println!("{MATRICES} matrices");
    let mut random = Random::seeded("eigen-solver", SEED);
    let (mut worst_value, mut worst_tilt, mut worst_rounded_tilt) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut told, mut flagged) = (0_u32, 0_u32);
    for index in 0..MATRICES {
        let kind = index % 12;
        let scale = random.scale();
        let unrounded = random.matrix(kind) * scale;
        let input = rounded(&unrounded);
        let truth = reference(exact(&input));
        let found = input.eigen().unwrap_or_else(|| panic!("{index}: finite matrix refused: {input:?}"));

        let largest = truth[0].0.abs().max(truth[2].0.abs());
        // A result below the normal range of f32 is rounded to the nearest of its few values, whatever the solver does.
        let representable = f64::from(f32::from_bits(1)) / 2.0;
        for (value, (expected, _)) in found.values.iter().zip(&truth) {
            let error = ((f64::from(*value) - expected).abs() - representable).max(0.0);
            assert!(error <= 1.0e-5 * largest, "{index}: {input:?} has {expected:e}, found {value:e}");
            worst_value = worst_value.max(if largest > 0.0 { error / largest } else { 0.0 });
        }
        assert!(found.values.is_sorted(), "{index}: {found:?}");
        if largest > 1.0e-35 {
            for (gap, pair) in [(found.lower_gap(), &truth[..2]), (found.upper_gap(), &truth[1..])] {
                let error = f64::from(gap) - (pair[1].0 - pair[0].0) / largest;
                assert!(error.abs() <= 4.0e-5, "{index}: {input:?}: a gap of {gap:e}, off by {error:e}");
            }
        }

        // Where the matrix was rounded relative to its size, not to the smallest number, the vector must be that of the
        // matrix before rounding as well.
        let before = (largest > 1.0e-35).then(|| reference(unrounded));
        for (vector, end, gap) in [
            (found.smallest, 0, (truth[1].0 - truth[0].0) / largest),
            (found.largest, 2, (truth[2].0 - truth[1].0) / largest),
        ] {
            let Some(vector) = vector else {
                flagged += 1;
                let least = f64::from(MIN_RELATIVE_GAP) * (1.0 + 1.0e-5);
                assert!(gap.is_nan() || gap < least, "{index}: {input:?}: gap {gap:e}, but no vector");
                continue;
            };
            told += 1;
            assert!(
                gap > f64::from(MIN_RELATIVE_GAP) * (1.0 - 1.0e-5),
                "{index}: {input:?}: gap {gap:e}, but a vector"
            );
            let tilt = tilt_deg(vector, &truth[end].1);
            worst_tilt = worst_tilt.max(tilt);
            assert!(tilt <= f64::from(MAX_TILT_DEG), "{index}: {input:?}: gap {gap:e}, off by {tilt} degrees");
            if let Some(before) = before {
                let tilt = tilt_deg(vector, &before[end].1);
                worst_rounded_tilt = worst_rounded_tilt.max(tilt);
                assert!(tilt <= f64::from(MAX_TILT_DEG), "{index}: {unrounded}: gap {gap:e}, off by {tilt} degrees");
            }
        }
    }
    println!("eigenvalues within {worst_value:.2e} of the largest; {told} vectors told, {flagged} flagged");
    println!("tilt at most {worst_tilt:.2e} degrees, against the matrix before rounding {worst_rounded_tilt:.2e}");
    // Neither branch may go untested.
    assert!(told > MATRICES / 2 && flagged > MATRICES / 10);
}

#[test]
fn exactly_degenerate_matrices_are_flagged() {
    let diagonal = |xx, yy, zz| SymmetricMatrix3 { xx, yy, zz, ..Default::default() };
    for size in [f32::from_bits(1), 1.0e-38, 1.0e-30, 1.0, 3.0, 1.0e30, f32::MAX] {
        let equal = diagonal(size, size, size).eigen().unwrap();
        assert_eq!((equal.smallest, equal.largest), (None, None), "{size:e}");
        let disc = diagonal(size, 0.0, size).eigen().unwrap();
        assert_eq!(disc.largest, None, "{size:e}");
        assert_eq!(disc.smallest.map(|v| v.map(f32::abs)), Some([0.0, 1.0, 0.0]), "{size:e}");
        let rod = diagonal(0.0, 0.0, size).eigen().unwrap();
        assert_eq!(rod.smallest, None, "{size:e}");
        assert_eq!(rod.largest.map(|v| v.map(f32::abs)), Some([0.0, 0.0, 1.0]), "{size:e}");
    }
    let zero = SymmetricMatrix3::default().eigen().unwrap();
    assert_eq!((zero.values, zero.smallest, zero.largest), ([0.0; 3], None, None));
    assert_eq!((zero.lower_gap(), zero.upper_gap()), (0.0, 0.0));
}

#[test]
fn what_is_not_finite_is_refused() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for place in 0..6 {
            let mut entries = [1.0, 0.5, 0.25, 2.0, 0.125, 3.0];
            entries[place] = bad;
            let [xx, xy, xz, yy, yz, zz] = entries;
            assert_eq!(SymmetricMatrix3 { xx, xy, xz, yy, yz, zz }.eigen(), None);
        }
    }
}

#[test]
fn any_bits_give_finite_values_and_unit_vectors() {
    let mut random = Random::seeded("eigen-solver", SEED);
    for _ in 0..200_000 {
        let [xx, xy, xz, yy, yz, zz] = core::array::from_fn(|_| f32::from_bits(random.next() as u32));
        let matrix = SymmetricMatrix3 { xx, xy, xz, yy, yz, zz };
        let Some(eigen) = matrix.eigen() else {
            assert!(matrix.entries().iter().any(|e| !e.is_finite()));
            continue;
        };
        assert!(eigen.values.iter().all(|v| v.is_finite()) && eigen.values.is_sorted(), "{matrix:?}: {eigen:?}");
        for vector in [eigen.smallest, eigen.largest].into_iter().flatten() {
            let length: f32 = vector.iter().map(|c| c * c).sum();
            assert!((length - 1.0).abs() < 1.0e-5, "{matrix:?}: {eigen:?}");
        }
    }
}

/// A number of 24 bits, of either sign, at most `2^20` times as large as another: sums and products of two fit into f64 as they are.
fn short(random: &mut Random) -> f32 {
    let bits = (random.within(-1.0, 1.0) * f64::from(1 << 24)) as f32;
    libm::ldexpf(bits, random.below(4) as i32 * 5 - 30)
}

/// The number that a pair stands for, to as many bits as f64 has.
fn whole(pair: Pair) -> f64 {
    f64::from(pair.hi) + f64::from(pair.lo)
}

#[test]
fn sums_and_products_of_two_numbers_are_exact() {
    let mut random = Random::seeded("pairs of two numbers", SEED);
    for _ in 0..20_000 {
        let (a, b) = (short(&mut random), short(&mut random));
        assert_eq!(whole(Pair::sum(a, b)), f64::from(a) + f64::from(b), "{a:e} + {b:e}");
        assert_eq!(whole(Pair::product(a, b)), f64::from(a) * f64::from(b), "{a:e} x {b:e}");
    }
}

#[test]
fn pairs_keep_more_than_forty_bits() {
    let mut random = Random::seeded("pairs", SEED);
    let near = |found: Pair, truth: f64, size: f64, what: &str| {
        let error = (whole(found) - truth).abs();
        assert!(error <= size * 2.0_f64.powi(-44), "{what}: {} instead of {truth}", whole(found));
    };
    for _ in 0..20_000 {
        let [a, b, c, d] = core::array::from_fn(|_| short(&mut random));
        let (x, y) = (Pair::product(a, b), Pair::product(c, d));
        let (exact_x, exact_y) = (whole(x), whole(y));
        near(x.add(y), exact_x + exact_y, exact_x.abs() + exact_y.abs(), "sum");
        near(x.times(c), exact_x * f64::from(c), (exact_x * f64::from(c)).abs(), "product");
        assert_eq!(whole(x.negated()), -exact_x);
    }
}

#[test]
fn nothing_has_no_direction() {
    assert_eq!(unit([0.0; 3]), None);
    assert_eq!(unit([0.0, -0.0, 0.0]), None);
    assert_eq!(unit([0.0, -3.0, 4.0]), Some([0.0, -0.6, 0.8]));
}

#[test]
fn what_has_no_length_has_no_direction() {
    assert_eq!(unit([0.0; 3]), None);
    assert_eq!(unit([0.0, -2.0, 0.0]), Some([0.0, -1.0, 0.0]));
}
