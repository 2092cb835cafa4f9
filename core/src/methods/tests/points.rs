//! Points against rays and sums in f64.

use std::vec::Vec;

use nalgebra::{Matrix3, Vector3};

use super::*;
use crate::{
    disparity::{DisparityPixel, Reason},
    test_random::Random,
    test_world::{DISPARITIES, World},
};

#[test]
fn points_lie_where_the_rays_of_their_pixels_end() {
    let mut random = Random::seeded("row points", 0x5eed_0130);
    let mut seen = 0;
    for _ in 0..20 {
        let world = World::empty(random.within(0.5, 2.0), random.within(-10.0, 30.0), random.within(-8.0, 8.0));
        let pixels: Vec<DisparityPixel> = (0..320 * 4)
            .map(|_| match random.below(3) {
                0 => DisparityPixel::none(Reason::NotUnique),
                // Some are beyond the table.
                _ => DisparityPixel::from_steps(1 + random.below(16 * DISPARITIES as u32 + 50) as u16),
            })
            .collect();
        let (depth, rays) = (world.depth(), world.rays());
        for y in 0..4 {
            let found: Vec<_> = row_points(DisparityPicture::new(&pixels, 320), &depth, &rays, y).collect();
            let has_point = |x: &usize| (1..16 * DISPARITIES as u16).contains(&pixels[y * 320 + x].steps());
            let expected: Vec<usize> = (0..320).filter(has_point).collect();
            assert_eq!(found.iter().map(|(x, _)| *x).collect::<Vec<_>>(), expected);
            for (x, point) in found {
                let z = 16.0 * 228.0 * 0.2 / f64::from(pixels[y * 320 + x].steps());
                let truth = Vector3::new(0.0, 0.0, world.height_m) + world.direction(x as f64, y as f64) * z;
                let off = (Vector3::from(point.map(f64::from)) - truth).norm();
                assert!(off < 1.0e-5 * (1.0 + truth.norm()), "({x}, {y}): {point:?}, not {truth}");
                seen += 1;
            }
        }
    }
    assert!(seen > 10_000, "{seen}");
}

#[test]
fn sums_are_those_of_all_points() {
    let mut random = Random::seeded("point sums", 0x5eed_0131);
    assert_eq!(PointSums::default().scatter(), Scatter::default());
    // Runs that are not full, just full, and several.
    for count in (1..=200).chain([640, 1000]) {
        // As far off as ground is, beside which the points lie close together.
        let middle = Vector3::from_fn(|_, _| random.within(-20.0, 20.0));
        let size = Vector3::from_fn(|_, _| random.within(0.3, 2.0));
        let turn = nalgebra::Rotation3::from_euler_angles(random.within(0.0, 3.0), random.within(0.0, 3.0), 1.0);
        let points: Vec<[f32; 3]> = (0..count)
            .map(|_| {
                let off = Vector3::from_fn(|i: usize, _| random.within(-size[i], size[i]));
                (middle + turn * off).map(|at| at as f32).into()
            })
            .collect();
        let mut sums = PointSums::default();
        points.iter().for_each(|point| sums.add(*point));
        let found = sums.scatter();
        let exact: Vec<Vector3<f64>> = points.iter().map(|point| Vector3::from(point.map(f64::from))).collect();
        let mean = exact.iter().sum::<Vector3<f64>>() / f64::from(count);
        let truth = exact.iter().map(|p| (p - mean) * (p - mean).transpose()).sum::<Matrix3<f64>>() / f64::from(count);
        let c = &found.covariance;
        let told = Matrix3::new(c.xx, c.xy, c.xz, c.xy, c.yy, c.yz, c.xz, c.yz, c.zz).map(f64::from);
        assert_eq!(f64::from(found.weight), f64::from(count));
        assert!((Vector3::from(found.mean_m.map(f64::from)) - mean).norm() < 1.0e-5, "{count} points");
        // One by one: what is no number is not the largest of all.
        let near = (told - truth).iter().all(|off| off.abs() < 1.0e-5 * (1.0 + truth.amax()));
        assert!(near, "{count} points: {told}, not {truth}");
    }
}

#[test]
fn of_no_points_and_of_whole_runs_all_that_is_known_is_told() {
    let mut sums = PointSums::default();
    assert_eq!(sums.scatter(), Scatter::default());
    for count in 1..=3 * RUN {
        sums.add([count as f32, 2.0, -1.0]);
        let (found, mean) = (sums.scatter(), 0.5 * (count + 1) as f32);
        assert_eq!(found.weight, count as f32);
        assert!((found.mean_m[0] - mean).abs() < 1.0e-4 && found.mean_m[1..] == [2.0, -1.0], "{count}: {found:?}");
    }
}
