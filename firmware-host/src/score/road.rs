//! The road in a lidar sweep: a plane through as many points as possible.

use std::fmt;

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::draws::Draws;

/// Where the road is looked for in the camera's frame (x right, y down, z forward), metres: from 1.0 to 2.6 m below the camera of a
/// car.
const AHEAD_M: (f64, f64) = (4.0, 20.0);
const ASIDE_M: f64 = 5.0;
const BELOW_M: (f64, f64) = (1.0, 2.6);
/// Planes that are tried, each through three points that are drawn. Seed and number are part of what the truth is.
const ROUNDS: usize = 400;
const SEED: u32 = 0;
/// Points within this distance of a plane belong to it, metres.
const TOLERANCE_M: f64 = 0.06;
/// Least cosine between the plane's normal and the camera's upward axis.
const LEAST_UPRIGHT: f64 = 0.94;
/// Three points span no plane if the cross product of their differences is shorter than this, m^2.
const LEAST_SPAN_M2: f64 = 1.0e-6;

/// A plane `normal . p + offset_m = 0` in the camera's frame; the normal points up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Road {
    pub(super) normal: Vector3<f64>,
    pub(super) offset_m: f64,
}

/// A sweep in which no road is to be found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoRoad;

impl Road {
    /// Finds the road among `points` of the camera's frame, metres.
    ///
    /// # Bound
    /// 400 looks at each point.
    pub(super) fn find(points: &[Vector3<f64>]) -> Result<Self, NoRoad> {
        let candidates: Vec<_> = points.iter().copied().filter(may_be_road).collect();
        let count = u32::try_from(candidates.len()).unwrap_or(u32::MAX);
        let mut draws = Draws::new(SEED);
        let mut best: Option<(usize, Vector3<f64>, Vector3<f64>)> = None;
        for _ in 0..ROUNDS {
            let mut draw = || candidates.get(draws.below(count) as usize).ok_or(NoRoad);
            let [a, b, c] = [*draw()?, *draw()?, *draw()?];
            let Some(normal) = upward((b - a).cross(&(c - a)), LEAST_SPAN_M2) else { continue };
            if -normal.y < LEAST_UPRIGHT {
                continue;
            }
            let support = candidates.iter().filter(|p| is_on(p, &a, &normal)).count();
            if best.is_none_or(|(most, ..)| support > most) {
                best = Some((support, a, normal));
            }
        }
        let (_, a, normal) = best.ok_or(NoRoad)?;
        let on_it: Vec<_> = candidates.into_iter().filter(|p| is_on(p, &a, &normal)).collect();
        Self::fitted(&on_it).ok_or(NoRoad)
    }

    /// Orthogonal distance regression: the direction in which the points scatter least.
    fn fitted(points: &[Vector3<f64>]) -> Option<Self> {
        let centre = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
        let scatter: Matrix3<f64> = points.iter().map(|p| (p - centre) * (p - centre).transpose()).sum();
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(scatter);
        let normal = upward(eigenvectors.column(eigenvalues.imin()).into_owned(), 0.0)?;
        Some(Self { normal, offset_m: -normal.dot(&centre) })
    }
}

fn may_be_road(p: &Vector3<f64>) -> bool {
    let between = |value: f64, (low, high): (f64, f64)| value > low && value < high;
    between(p.z, AHEAD_M) && p.x.abs() < ASIDE_M && between(p.y, BELOW_M)
}

fn is_on(p: &Vector3<f64>, on_plane: &Vector3<f64>, normal: &Vector3<f64>) -> bool {
    (p - on_plane).dot(normal).abs() < TOLERANCE_M
}

/// The unit vector along `direction` that points up (against y); `None` if it is shorter than `least`.
fn upward(direction: Vector3<f64>, least: f64) -> Option<Vector3<f64>> {
    let length = direction.norm();
    if !length.is_finite() || length <= 0.0 || length < least {
        return None;
    }
    let unit = direction / length;
    Some(if unit.y > 0.0 { -unit } else { unit })
}

impl fmt::Display for NoRoad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (near, far) = AHEAD_M;
        let (high, low) = BELOW_M;
        write!(f, "shows no road from {near} to {far} m ahead and {high} to {low} m below the camera")
    }
}

impl std::error::Error for NoRoad {}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane through the point 1.6 m below the camera, with a wall of points beside it that does not reach down to it.
    fn sweep(normal: Vector3<f64>) -> Vec<Vector3<f64>> {
        let on_plane = |x: f64, z: f64| Vector3::new(x, 1.6 - (normal.x * x + normal.z * z) / normal.y, z);
        let grid = (0..60).flat_map(|i| (0..160).map(move |j| (f64::from(i) * 0.2 - 6.0, f64::from(j) * 0.1 + 4.05)));
        let road = grid.clone().map(|(x, z)| on_plane(x, z));
        let wall = grid.map(|(x, z)| Vector3::new(3.0, 1.2 + x * 0.03, z));
        road.chain(wall).collect()
    }

    #[test]
    fn a_tilted_road_is_found_beside_a_wall() {
        for (x, z) in [(0.0, 0.0), (0.05, 0.01), (-0.06, 0.02)] {
            let normal = Vector3::new(x, -1.0, z).normalize();
            let road = Road::find(&sweep(normal)).unwrap();
            assert!((road.normal - normal).norm() < 1.0e-9, "{road:?}");
            assert!((road.offset_m - 1.6 * -normal.y).abs() < 1.0e-9, "{road:?}");
        }
    }

    #[test]
    fn no_points_and_no_plane_are_told() {
        assert_eq!(Road::find(&[]), Err(NoRoad));
        assert_eq!(Road::find(&[Vector3::new(0.0, 1.5, 10.0); 50]), Err(NoRoad), "one point has no plane");
        let on_wall = |i: i32| Vector3::new(1.0, 1.1 + f64::from(i % 30) * 0.05, 5.0 + f64::from(i / 30) * 0.3);
        let wall: Vec<_> = (0..900).map(on_wall).collect();
        assert_eq!(Road::find(&wall), Err(NoRoad), "a wall is no road");
    }
}
