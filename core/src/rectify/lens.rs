//! The radial-tangential lens, with the end of the range in which it can be believed.

use crate::geometry::Distortion;

/// Radii are tried in steps of this for the end of the model's range, in units of the focal length.
const RADIUS_STEP: f32 = 1.0 / 64.0;

/// Steps tried: up to 8 focal lengths, 83 degrees off the axis.
const RADIUS_STEPS: u16 = 512;

/// Where the picture grows less than this with the radius, relative to the centre, the polynomial is about to turn back.
const MIN_RADIAL_SLOPE: f32 = 0.02;

/// Newton steps from a distorted point to the ray; it converges in about five.
const NEWTON_STEPS: u8 = 16;

/// A lens whose polynomial is known to rise up to a radius.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lens {
    coefficients: [f32; 8],
    /// Square of the radius up to which the distorted radius rises. Beyond, a ray far outside of the picture would be bent
    /// back into it, and what is seen there would be taken for something else.
    max_radius_squared: f32,
}

/// Where a ray leaves the lens, and how that moves with the ray.
struct Image {
    point: [f32; 2],
    jacobian: [[f32; 2]; 2],
    determinant: f32,
}

impl Lens {
    pub(super) const fn ideal() -> Self {
        Self { coefficients: [0.0; 8], max_radius_squared: 0.0 }
    }

    /// # Bound
    /// At most 512 evaluations of the polynomial.
    pub(super) fn new(distortion: &Distortion) -> Self {
        let mut lens = Self { coefficients: distortion.0, max_radius_squared: 0.0 };
        for step in 1..=RADIUS_STEPS {
            let radius = f32::from(step) * RADIUS_STEP;
            let radius_squared = radius * radius;
            let Some((factor, slope)) = lens.radial(radius_squared) else { break };
            if factor + 2.0 * radius_squared * slope < MIN_RADIAL_SLOPE {
                break;
            }
            lens.max_radius_squared = radius_squared;
        }
        lens
    }

    /// Where the ray through `(x, y, 1)` meets the picture, in units of the focal length from the principal point; `None`
    /// beyond the range of the model.
    pub(super) fn distort(&self, ray: [f32; 2]) -> Option<[f32; 2]> {
        self.image(ray).map(|image| image.point)
    }

    /// The ray that [`Self::distort`] takes to `point`, by Newton's method; `None` if there is none in the model's range.
    pub(super) fn undistort(&self, point: [f32; 2]) -> Option<[f32; 2]> {
        let mut ray = [0.0, 0.0];
        let mut residual = [f32::MAX; 2];
        let mut image = self.image(ray)?;
        for _ in 0..NEWTON_STEPS {
            residual = [point[0] - image.point[0], point[1] - image.point[1]];
            let [[a, b], [c, d]] = image.jacobian;
            let step = [
                (d * residual[0] - b * residual[1]) / image.determinant,
                (a * residual[1] - c * residual[0]) / image.determinant,
            ];
            // A step beyond the range of the model is halved until it stays within.
            let mut length = 1.0;
            let reached = loop {
                let candidate = [ray[0] + length * step[0], ray[1] + length * step[1]];
                if let Some(image) = self.image(candidate) {
                    break (candidate, image);
                }
                length *= 0.5;
                if length < 1.0e-3 {
                    return None;
                }
            };
            let is_there = ray == reached.0;
            (ray, image) = reached;
            // From here on every step would be the same.
            if is_there {
                break;
            }
        }
        (residual[0].abs().max(residual[1].abs()) < 1.0e-4).then_some(ray)
    }

    /// The radial factor and its derivative by the squared radius.
    fn radial(&self, s: f32) -> Option<(f32, f32)> {
        let [k1, k2, _, _, k3, k4, k5, k6] = self.coefficients;
        let numerator = 1.0 + s * (k1 + s * (k2 + s * k3));
        let denominator = 1.0 + s * (k4 + s * (k5 + s * k6));
        if denominator.is_nan() || denominator < 1.0e-2 {
            return None;
        }
        let factor = numerator / denominator;
        let slope = (k1 + s * (2.0 * k2 + 3.0 * s * k3) - factor * (k4 + s * (2.0 * k5 + 3.0 * s * k6))) / denominator;
        (factor.is_finite() && slope.is_finite()).then_some((factor, slope))
    }

    fn image(&self, [x, y]: [f32; 2]) -> Option<Image> {
        let s = x * x + y * y;
        if s.is_nan() || s > self.max_radius_squared {
            return None;
        }
        let (factor, slope) = self.radial(s)?;
        let [_, _, p1, p2, ..] = self.coefficients;
        let point = [
            x * factor + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
            y * factor + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
        ];
        let beside = 2.0 * (x * y * slope + p1 * x + p2 * y);
        let jacobian = [
            [factor + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, beside],
            [beside, factor + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x],
        ];
        let determinant = jacobian[0][0] * jacobian[1][1] - beside * beside;
        // Strong tangential terms fold the picture too: behind the fold it is a mirror image.
        let upright = determinant > MIN_RADIAL_SLOPE * MIN_RADIAL_SLOPE && jacobian[0][0] > 0.0;
        (upright && determinant.is_finite() && point.iter().all(|p| p.is_finite())).then_some(Image {
            point,
            jacobian,
            determinant,
        })
    }
}

#[cfg(test)]
#[path = "lens_tests.rs"]
mod tests;
