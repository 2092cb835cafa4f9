//! Point sets by their first two moments, which add up.

use super::{Eigen, SymmetricMatrix3};

/// Number, mean and covariance of a set of points. Sets join without looking at a point again.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scatter {
    /// Weight of the set: number of points, or any other positive measure.
    pub weight: f32,
    /// Mean, metres.
    pub mean_m: [f32; 3],
    /// Covariance, m^2.
    pub covariance: SymmetricMatrix3,
}

impl Scatter {
    /// The two sets as one. Source: Chan, Golub, LeVeque, *Updating formulae and a pairwise algorithm for computing sample
    /// variances*, 1979; it subtracts only the means, which are of the size of the set, not of its distance.
    pub fn joined(&self, other: &Self) -> Self {
        let weight = self.weight + other.weight;
        if weight <= 0.0 {
            return *self;
        }
        let share = other.weight / weight;
        let d: [f32; 3] = core::array::from_fn(|i| other.mean_m[i] - self.mean_m[i]);
        let between = share * (self.weight / weight);
        let join = |a: f32, b: f32, di: f32, dj: f32| a + (b - a) * share + between * di * dj;
        let (a, b) = (&self.covariance, &other.covariance);
        Self {
            weight,
            mean_m: core::array::from_fn(|i| self.mean_m[i] + d[i] * share),
            covariance: SymmetricMatrix3 {
                xx: join(a.xx, b.xx, d[0], d[0]),
                xy: join(a.xy, b.xy, d[0], d[1]),
                xz: join(a.xz, b.xz, d[0], d[2]),
                yy: join(a.yy, b.yy, d[1], d[1]),
                yz: join(a.yz, b.yz, d[1], d[2]),
                zz: join(a.zz, b.zz, d[2], d[2]),
            },
        }
    }

    /// The unit normal of the plane through the points, upward (positive z), and the variance across it; `None` where the
    /// points do not define a plane.
    pub fn plane(&self) -> Option<([f32; 3], f32)> {
        let Eigen { values, smallest, .. } = self.covariance.eigen()?;
        let normal = smallest?;
        let sign = if normal[2] < 0.0 { -1.0 } else { 1.0 };
        Some((normal.map(|n| n * sign), values[0].max(0.0)))
    }

    /// Variance along a direction, m^2.
    pub fn variance_along(&self, v: [f32; 3]) -> f32 {
        let c = &self.covariance;
        (v[0] * v[0] * c.xx
            + v[1] * v[1] * c.yy
            + v[2] * v[2] * c.zz
            + 2.0 * (v[0] * v[1] * c.xy + v[0] * v[2] * c.xz + v[1] * v[2] * c.yz))
            .max(0.0)
    }
}

#[cfg(test)]
#[path = "scatter_tests.rs"]
mod tests;
