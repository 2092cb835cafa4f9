//! Exact sums over the points of one surface.

use crate::{
    geometry::Rays,
    planes::{Scatter, SymmetricMatrix3},
};

/// Sums over the pixels of a surface inside one tile, with distances `z` in at most 16 bits and pixels `u`, `v` from the
/// tile's middle. A point is `(z, z u, z v)` seen along three fixed directions, so these ten sums hold its mean and
/// covariance in any frame.
///
/// Within a tile of 32 x 32 no sum exceeds 2^50, and no product in [`Self::scatter`] exceeds 2^60: all are exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Moments {
    n: i64,
    z: i64,
    zu: i64,
    zv: i64,
    zz: i64,
    zzu: i64,
    zzv: i64,
    zzuu: i64,
    zzuv: i64,
    zzvv: i64,
}

/// Sums over pixels of one row.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RowMoments {
    n: i64,
    z: i64,
    zu: i64,
    zz: i64,
    zzu: i64,
    zzuu: i64,
}

impl RowMoments {
    /// Adds a pixel.
    pub(super) fn add(&mut self, z: u32, u: i32) {
        let (z, u) = (i64::from(z), i64::from(u));
        self.n += 1;
        self.z += z;
        self.zu += z * u;
        self.zz += z * z;
        self.zzu += z * z * u;
        self.zzuu += z * z * u * u;
    }
}

impl Moments {
    pub(super) const ZERO: Self = Self { n: 0, z: 0, zu: 0, zv: 0, zz: 0, zzu: 0, zzv: 0, zzuu: 0, zzuv: 0, zzvv: 0 };

    /// Adds a row.
    pub(super) fn add(&mut self, row: &RowMoments, v: i32) {
        let v = i64::from(v);
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
        self.n as u16
    }

    /// Mean and covariance in the vehicle frame, for a tile whose middle lies at pixel `(u, v)`, with `unit_m` metres to a
    /// unit of `z`.
    pub(super) fn scatter(&self, rays: &Rays, u: f32, v: f32, unit_m: f32) -> Scatter {
        let n = self.n.max(1);
        let central = |sum: i64, a: i64, b: i64| (n * sum - a * b) as f32;
        let square = unit_m * unit_m / (n * n) as f32;
        // Covariance of (z, zu, zv).
        let c = [
            [central(self.zz, self.z, self.z), central(self.zzu, self.z, self.zu), central(self.zzv, self.z, self.zv)],
            [0.0, central(self.zzuu, self.zu, self.zu), central(self.zzuv, self.zu, self.zv)],
            [0.0, 0.0, central(self.zzvv, self.zv, self.zv)],
        ];
        let c = |i: usize, j: usize| square * if i <= j { c[i][j] } else { c[j][i] };
        let axes = [rays.direction(u, v), rays.along_row, rays.along_column];
        let mean = [self.z, self.zu, self.zv].map(|sum| sum as f32 * (unit_m / n as f32));
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
            weight: n as f32,
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
