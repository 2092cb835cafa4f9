//! Exact sums over the points of one surface.

use core::{num::Wrapping, ops::Range};

use super::TILE;
use crate::{
    geometry::Rays,
    planes::{Scatter, SymmetricMatrix3},
    work::{self, Loop},
};

/// Sums over the pixels of a surface inside one tile, with distances `z` in at most 16 bits and pixels `u`, `v` from the
/// tile's middle. A point is `(z, z u, z v)` seen along three fixed directions, so these ten sums hold its mean and
/// covariance in any frame.
///
/// Within a tile of 32 x 32 no sum exceeds 2^50, and no product in [`Self::scatter`] exceeds 2^60: all are exact, and nothing wraps
/// that is written so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Moments {
    n: Sum,
    z: Sum,
    zu: Sum,
    zv: Sum,
    zz: Sum,
    zzu: Sum,
    zzv: Sum,
    zzuu: Sum,
    zzuv: Sum,
    zzvv: Sum,
}

/// Sums over pixels of one row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RowMoments {
    n: Sum,
    z: Sum,
    zu: Sum,
    zz: Sum,
    zzu: Sum,
    zzuu: Sum,
}

/// A sum with its sign.
type Sum = Wrapping<i64>;

const NOTHING: Sum = Wrapping(0);

/// From so many pixels on a run is summed up side by side with the rest of its row.
const LONG_RUN: usize = 10;

impl RowMoments {
    /// Sums over a run of pixels of a row of a tile, whose distances are `z` without their lowest `shift` bits; of 16 bits then.
    #[inline(always)]
    pub(super) fn of_run(z: &[u32; TILE], run: Range<usize>, shift: u32) -> Self {
        const MIDDLE: i64 = (TILE / 2) as i64;
        const WIDE: Sum = Wrapping(MIDDLE);
        let Range { start, end } = run;
        let length = run.len();
        work::count(Loop::SurfaceSums, if length < LONG_RUN { length } else { TILE });
        if length < LONG_RUN {
            let z = z.get(run).unwrap_or_default().iter().map(|z| z >> (shift & 31));
            return Self::of(z, end as i32 - MIDDLE as i32);
        }
        // The pixels of other runs add nothing. Columns are counted from the first of the tile, so that no number is negative.
        let (mut z0, mut z1) = (0u32, 0u32);
        let mut squares = [0u32; TILE];
        for ((z, square), column) in z.iter().zip(&mut squares).zip(0u32..) {
            let belongs = column.wrapping_sub(start as u32) < length as u32;
            let z = if belongs { z >> (shift & 31) } else { 0 };
            z0 = z0.wrapping_add(z);
            z1 = z1.wrapping_add(z.wrapping_mul(column));
            *square = z.wrapping_mul(z);
        }
        let (mut q0, mut q1, mut q2) = (0u64, 0u64, 0u64);
        for (&square, column) in squares.iter().zip(0u32..) {
            q0 = q0.wrapping_add(u64::from(square));
            q1 = q1.wrapping_add(u64::from(square).wrapping_mul(column.into()));
            q2 = q2.wrapping_add(u64::from(square).wrapping_mul(column.wrapping_mul(column).into()));
        }
        let (z0, z1) = (Wrapping(i64::from(z0)), Wrapping(i64::from(z1)));
        let [q0, q1, q2] = [q0, q1, q2].map(|sum| Wrapping(sum as i64));
        Self {
            n: Wrapping(length as i64),
            z: z0,
            zu: z1 - WIDE * z0,
            zz: q0,
            zzu: q1 - WIDE * q0,
            zzuu: q2 - Wrapping(2 * MIDDLE) * q1 + Wrapping(MIDDLE * MIDDLE) * q0,
        }
    }

    /// Sums over neighbouring pixels with the distances `z`, at most a tile's row of them, each of 16 bits; `end` is the column after
    /// the last.
    ///
    /// Sums of sums need no product with the column: with `m` counted from the end, from 1, they are the sums of `z m` and of
    /// `z m (m + 1) / 2`, and a column is `end - m`.
    #[inline(always)]
    pub(super) fn of(z: impl Iterator<Item = u32>, end: i32) -> Self {
        let (mut n, mut z0, mut z1) = (0u32, 0u32, 0u32);
        let (mut q0, mut q1, mut q2) = (0u64, 0u64, 0u64);
        for z in z {
            let square = u64::from(z.wrapping_mul(z));
            n = n.wrapping_add(1);
            z0 = z0.wrapping_add(z);
            z1 = z1.wrapping_add(z0);
            q0 = q0.wrapping_add(square);
            q1 = q1.wrapping_add(q0);
            q2 = q2.wrapping_add(q1);
        }
        let (end, two) = (Wrapping(i64::from(end)), Wrapping(2));
        let (z0, z1) = (Wrapping(i64::from(z0)), Wrapping(i64::from(z1)));
        let [q0, q1, q2] = [q0, q1, q2].map(|sum| Wrapping(sum as i64));
        Self {
            n: Wrapping(i64::from(n)),
            z: z0,
            zu: end * z0 - z1,
            zz: q0,
            zzu: end * q0 - q1,
            zzuu: end * (end * q0 - two * q1) + (two * q2 - q1),
        }
    }
}

impl Moments {
    pub(super) const ZERO: Self = Self {
        n: NOTHING,
        z: NOTHING,
        zu: NOTHING,
        zv: NOTHING,
        zz: NOTHING,
        zzu: NOTHING,
        zzv: NOTHING,
        zzuu: NOTHING,
        zzuv: NOTHING,
        zzvv: NOTHING,
    };

    /// Adds a row.
    #[inline(always)]
    pub(super) fn add(&mut self, row: &RowMoments, v: i32) {
        let v = Wrapping(i64::from(v));
        self.n += row.n;
        self.z += row.z;
        self.zu += row.zu;
        self.zv += row.z * v;
        self.zz += row.zz;
        self.zzu += row.zzu;
        self.zzv += row.zz * v;
        self.zzuu += row.zzuu;
        self.zzuv += row.zzu * v;
        self.zzvv += row.zz * v * v;
    }

    /// Number of pixels.
    pub(super) fn pixels(&self) -> u16 {
        self.n.0 as u16
    }

    /// Mean and covariance in the vehicle frame, for a tile whose middle lies at pixel `(u, v)`, with `unit_m` metres to a
    /// unit of `z`.
    pub(super) fn scatter(&self, rays: &Rays, u: f32, v: f32, unit_m: f32) -> Scatter {
        let n = self.n.max(Wrapping(1));
        let central = |sum: Sum, a: Sum, b: Sum| (n * sum - a * b).0 as f32;
        let square = unit_m * unit_m / (n * n).0 as f32;
        // Covariance of (z, zu, zv).
        let c = [
            [central(self.zz, self.z, self.z), central(self.zzu, self.z, self.zu), central(self.zzv, self.z, self.zv)],
            [0.0, central(self.zzuu, self.zu, self.zu), central(self.zzuv, self.zu, self.zv)],
            [0.0, 0.0, central(self.zzvv, self.zv, self.zv)],
        ];
        let c = |i: usize, j: usize| square * if i <= j { c[i][j] } else { c[j][i] };
        let axes = [rays.direction(u, v), rays.along_row, rays.along_column];
        let mean = [self.z, self.zu, self.zv].map(|sum| sum.0 as f32 * (unit_m / n.0 as f32));
        let entry = |a: usize, b: usize| {
            let mut sum = 0.0;
            for i in 0..3 {
                for j in 0..3 {
                    sum += axes[i][a] * c(i, j) * axes[j][b];
                }
            }
            sum
        };
        Scatter {
            weight: n.0 as f32,
            mean_m: core::array::from_fn(|a| {
                rays.origin_m[a] + axes[0][a] * mean[0] + axes[1][a] * mean[1] + axes[2][a] * mean[2]
            }),
            covariance: SymmetricMatrix3 {
                xx: entry(0, 0),
                xy: entry(0, 1),
                xz: entry(0, 2),
                yy: entry(1, 1),
                yz: entry(1, 2),
                zz: entry(2, 2),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::test_random::Random;

    #[test]
    fn sums_of_a_run_are_those_of_its_pixels_alone() {
        let mut random = Random::seeded("moments of runs", 0x5eed_0209);
        for _ in 0..3000 {
            let shift = random.below(12);
            let z: [u32; TILE] = core::array::from_fn(|_| random.below(1 << (16 + shift)));
            let start = random.below(TILE as u32) as usize;
            let end = start + 1 + random.below((TILE - start) as u32) as usize;
            let expected = RowMoments::of(z[start..end].iter().map(|z| z >> shift), end as i32 - 16);
            assert_eq!(RowMoments::of_run(&z, start..end, shift), expected, "{start}..{end} >> {shift}: {z:?}");
        }
    }

    #[test]
    fn sums_of_sums_are_the_sums_of_products() {
        let mut random = Random::seeded("row moments", 0x5eed_0201);
        for _ in 0..3000 {
            let (first, length) = (random.below(32) as i32 - 16, random.below(33) as i32);
            let end = (first + length).min(16);
            let most = [1, 200, 65_536][random.below(3) as usize];
            let row: Vec<u32> = (first..end).map(|_| random.below(most).max(most / 2 * random.below(2))).collect();
            let found = RowMoments::of(row.iter().copied(), end);
            let sum = |term: fn(i64, i64) -> i64| -> i64 {
                row.iter().zip(first..end).map(|(&z, u)| term(i64::from(z), i64::from(u))).sum()
            };
            assert_eq!(found.n.0, row.len() as i64);
            assert_eq!((found.z.0, found.zu.0), (sum(|z, _| z), sum(|z, u| z * u)));
            let expected = (sum(|z, _| z * z), sum(|z, u| z * z * u), sum(|z, u| z * z * u * u));
            assert_eq!((found.zz.0, found.zzu.0, found.zzuu.0), expected, "{first}..{end}: {row:?}");
        }
    }
}
