//! Points of the disparity picture, and sums over them.

use crate::{
    disparity::DisparityPicture,
    geometry::{DepthTable, Rays},
    planes::{Scatter, SymmetricMatrix3},
};

/// The points of row `y`, each with its column; frame of the rays, metres.
///
/// # Bound
/// The width of the picture.
pub(super) fn row_points<'a, const DISPARITIES: usize>(
    picture: DisparityPicture<'a>,
    depth: &'a DepthTable<DISPARITIES>,
    rays: &'a Rays,
    y: usize,
) -> impl Iterator<Item = (usize, [f32; 3])> + 'a {
    let (start, step) = (rays.direction(0.0, y as f32), rays.along_row);
    let row = picture.row(y);
    (0..row.len()).zip(row).filter_map(move |(x, pixel)| {
        let z = depth.distance_m(pixel.steps());
        let along = |i: usize| rays.origin_m[i] + z * (start[i] + x as f32 * step[i]);
        (z > 0.0).then(|| (x, [along(0), along(1), along(2)]))
    })
}

/// Mean and covariance of many points, in single precision: sums are taken over runs of points, about the first of each, and
/// the runs are joined, so that no sum is large beside what it is to show.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PointSums {
    joined: Scatter,
    first: [f32; 3],
    count: u32,
    sum: [f32; 3],
    /// Of the products xx, xy, xz, yy, yz, zz.
    products: [f32; 6],
}

/// Points of a run.
const RUN: u32 = 64;

impl PointSums {
    /// Adds a point.
    pub(super) fn add(&mut self, point: [f32; 3]) {
        if self.count == 0 {
            self.first = point;
        }
        let d: [f32; 3] = core::array::from_fn(|i| point[i] - self.first[i]);
        let products = [d[0] * d[0], d[0] * d[1], d[0] * d[2], d[1] * d[1], d[1] * d[2], d[2] * d[2]];
        // At most `RUN`: then it begins anew.
        self.count = self.count.wrapping_add(1);
        self.sum.iter_mut().zip(d).for_each(|(sum, d)| *sum += d);
        self.products.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
        if self.count == RUN {
            *self = Self { joined: self.scatter(), ..Self::default() };
        }
    }

    /// The points so far.
    pub(super) fn scatter(&self) -> Scatter {
        if self.count == 0 {
            return self.joined;
        }
        let per_point = 1.0 / self.count as f32;
        let mean = self.sum.map(|sum| sum * per_point);
        let [xx, xy, xz, yy, yz, zz] = self.products.map(|sum| sum * per_point);
        let [x, y, z] = mean;
        let covariance = SymmetricMatrix3 {
            xx: xx - x * x,
            xy: xy - x * y,
            xz: xz - x * z,
            yy: yy - y * y,
            yz: yz - y * z,
            zz: zz - z * z,
        };
        let mean_m = core::array::from_fn(|i| self.first[i] + mean[i]);
        self.joined.joined(&Scatter { weight: self.count as f32, mean_m, covariance })
    }
}

#[cfg(test)]
#[path = "tests/points.rs"]
mod tests;
