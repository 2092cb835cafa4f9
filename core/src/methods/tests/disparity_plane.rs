//! Planes of disparity against least squares in f64, and against planes of the world that a camera sees.

use std::vec::Vec;

use nalgebra::{Matrix3, Vector3};

use super::*;
use crate::{
    disparity::DisparityPixel,
    test_random::Random,
    test_world::{PAIR, Patch, Point, World},
};

fn sums(points: &[(i32, i32, u16)]) -> PlaneSums {
    let mut sums = PlaneSums::default();
    points.iter().for_each(|&(u, v, d)| sums.add(u, v, d));
    sums
}

#[test]
fn fits_are_those_of_least_squares_in_f64() {
    let mut random = Random::seeded("planes of disparity", 0x5eed_0121);
    let mut told = 0;
    for round in 0..4000 {
        let reach = [3.0, 10.0, 100.0, 1000.0][round % 4];
        let (a, b, noise) = (random.within(-8.0, 8.0), random.within(-8.0, 8.0), random.within(0.0, 30.0));
        let points: Vec<(i32, i32, u16)> = (0..3 + random.below(400))
            .map(|_| {
                let (u, v) = (random.within(-reach, reach).round(), random.within(-reach, reach).round());
                let d = 12_000.0 + a * u + b * v + random.within(-noise, noise);
                (u as i32, v as i32, d.round().clamp(1.0, 32_767.0) as u16)
            })
            .collect();
        let row = |p: &(i32, i32, u16)| Vector3::new(f64::from(p.0), f64::from(p.1), 1.0);
        let normal: Matrix3<f64> = points.iter().map(|p| row(p) * row(p).transpose()).sum();
        let right: Vector3<f64> = points.iter().map(|p| row(p) * f64::from(p.2)).sum();
        let Some((plane, squares)) = sums(&points).fit() else {
            assert!(points.len() < 10, "round {round}: {} points have a plane", points.len());
            continue;
        };
        told += 1;
        let truth = normal.try_inverse().expect("points that span a plane") * right;
        let found = Vector3::new(f64::from(plane.along_u), f64::from(plane.along_v), f64::from(plane.at));
        for corner in [(-reach, -reach), (reach, -reach), (0.0, 0.0), (reach, reach)] {
            let at = |p: Vector3<f64>| p.x * corner.0 + p.y * corner.1 + p.z;
            assert!((at(found) - at(truth)).abs() < 0.1, "round {round}: {} instead of {}", at(found), at(truth));
        }
        let off = |p: &(i32, i32, u16)| (row(p).dot(&truth) - f64::from(p.2)).powi(2);
        let mean = points.iter().map(off).sum::<f64>() / points.len() as f64;
        let tolerance = 1.0e-2 * mean + 2.0e-6 * (reach * 11.0).powi(2) + 1.0e-2;
        assert!((f64::from(squares) - mean).abs() < tolerance, "round {round}: {squares} instead of {mean}");
    }
    assert!(told > 3900, "{told}");
}

#[test]
fn pixels_on_a_line_have_no_plane() {
    assert_eq!(PlaneSums::default().fit(), None);
    for (du, dv) in [(1, 0), (0, 1), (1, 1), (2, -3), (0, 0)] {
        let points: Vec<_> = (0..40).map(|i| (i * du - 7, i * dv + 5, 100 + i as u16)).collect();
        assert_eq!(sums(&points).fit(), None, "along ({du}, {dv})");
    }
    assert!(sums(&[(0, 0, 5), (1, 0, 6), (0, 1, 9)]).fit().is_some());
}

#[test]
fn planes_of_the_world_are_planes_of_disparity_and_back() {
    let mut random = Random::seeded("planes of the world", 0x5eed_0122);
    let mut seen = 0;
    for round in 0..60 {
        let mount = (random.within(0.3, 2.5), random.within(-5.0, 40.0), random.within(-15.0, 15.0));
        let mut world = World::empty(mount.0, mount.1, mount.2);
        world.pair.disparity_offset_px = [0.0, -2.5, 3.0][round % 3];
        let normal = Point::new(random.within(-0.4, 0.4), random.within(-0.4, 0.4), 1.0).normalize();
        world.patches.push(Patch::across(normal, Point::new(0.0, 0.0, random.within(-0.2, 0.2)), 500.0));
        let centre = (160.0, 120.0);
        let pixels: Vec<DisparityPixel> = world.render();
        let points: Vec<_> = pixels
            .iter()
            .enumerate()
            .filter(|(_, pixel)| pixel.has_value())
            .map(|(i, pixel)| ((i % 320) as i32 - 160, (i / 320) as i32 - 120, pixel.steps()))
            .collect();
        if points.len() < 5000 {
            continue;
        }
        seen += 1;
        let thinned: Vec<_> = points.iter().copied().step_by(points.len() / 4000).collect();
        let (plane, squares) = sums(&thinned).fit().unwrap();
        assert!(squares < 0.15, "round {round}: only rounding, but {squares}");
        let (found, height_m) = plane.in_world(&world.pair, &world.frame(), centre).unwrap();
        let found = Point::from(found.map(f64::from));
        let truth = world.patches[0].normal();
        let tilt_deg = found.cross(&truth).norm().atan2(found.dot(&truth)).to_degrees();
        let eye = Point::new(0.0, 0.0, world.height_m);
        let true_height = truth.dot(&(eye - world.patches[0].middle));
        assert!(tilt_deg < 0.2, "round {round}: {tilt_deg} degrees off");
        assert!((f64::from(height_m) - true_height).abs() < 0.01 * true_height.abs() + 0.005, "round {round}");
        // And the other way round.
        let again = DisparityPlane::of_ground(
            truth.map(|n| n as f32).into(),
            true_height as f32,
            &world.pair,
            &world.frame(),
            centre,
        );
        for (u, v, steps) in thinned {
            let expected = again.steps_at(u as f32, v as f32);
            assert!((f32::from(steps) - expected).abs() < 0.6, "round {round}: {steps} at ({u}, {v}), {expected}");
        }
    }
    assert!(seen > 40, "{seen}");
    assert_eq!(DisparityPlane::default().in_world(&PAIR, &World::level(1.0, 0.0, 0.0).frame(), (0.0, 0.0)), None);
}

#[test]
fn rounding_makes_no_plane_of_a_long_line() {
    let mut random = Random::seeded("long lines", 0x5eed_0135);
    for round in 0..300 {
        let direction = loop {
            let direction = (random.below(61) as i32 - 30, random.below(61) as i32 - 30);
            if direction != (0, 0) {
                break direction;
            }
        };
        let from = (random.below(300) as i32 - 150, random.below(300) as i32 - 150);
        let points: Vec<_> = (0..40 + random.below(20) as i32)
            .map(|i| (from.0 + i * direction.0, from.1 + i * direction.1, 1 + random.below(30_000) as u16))
            .collect();
        assert_eq!(sums(&points).fit(), None, "round {round}: along {direction:?} from {from:?}");
    }
    // Two pixels, and none.
    assert_eq!(sums(&[(3, 4, 100), (900, -700, 200)]).fit(), None);
    // A strip that is two pixels wide and a hundred long spans a plane.
    let strip: Vec<_> = (0..200).map(|i| (i / 2, i % 2, 500 + i as u16)).collect();
    let (plane, squares) = sums(&strip).fit().unwrap();
    assert!((plane.along_u - 2.0).abs() < 1.0e-3 && (plane.along_v - 1.0).abs() < 1.0e-3 && squares < 1.0e-3);
}

#[test]
fn disparities_of_a_plane_are_those_of_the_points_that_rays_meet() {
    let mut random = Random::seeded("rays to planes", 0x5eed_0136);
    for round in 0..200 {
        let mut world = World::empty(random.within(0.3, 2.5), random.within(-30.0, 40.0), random.within(-15.0, 15.0));
        world.pair.disparity_offset_px = [0.0, -2.5, 3.0][round % 3];
        let (pair, frame) = (&world.pair, &world.frame());
        let normal = Point::new(random.within(-0.6, 0.6), random.within(-0.6, 0.6), 1.0).normalize();
        // Below the camera, or above it.
        let height = random.within(0.3, 2.0) * if round % 2 == 0 { 1.0 } else { -1.0 };
        let down = normal.map(|n| (n * height.signum()) as f32).into();
        let centre = (random.within(0.0, 320.0) as f32, random.within(0.0, 240.0) as f32);
        let plane = DisparityPlane::of_ground(down, height.abs() as f32, pair, frame, centre);
        for _ in 0..20 {
            let (u, v) = (random.within(-100.0, 100.0), random.within(-100.0, 100.0));
            let ray = world.direction(u + f64::from(centre.0), v + f64::from(centre.1));
            // Infinitely far is no disparity, and behind the camera it is negative.
            let away = -normal.dot(&ray) / height;
            let expected = 16.0 * (228.0 * 0.2 * away - f64::from(pair.disparity_offset_px));
            let found = f64::from(plane.steps_at(u as f32, v as f32));
            assert!(
                (found - expected).abs() < 2.0e-3 * (1.0 + expected.abs()),
                "round {round}: {found}, not {expected}"
            );
        }
        let (n, found) = plane.in_world(pair, frame, centre).unwrap();
        let off = (Point::from(n.map(f64::from)) - normal).norm();
        assert!(off < 1.0e-3 && (f64::from(found) / height - 1.0).abs() < 1.0e-3, "{n:?}, {found} m, not {height} m");
        // The vector that is not made a unit has the same direction, or the opposite one.
        let vector = frame.direction(plane.normal(pair, centre)).map(f64::from);
        assert!(Point::from(vector).normalize().cross(&normal).norm() < 1.0e-3, "round {round}");
    }
    let at_infinity = DisparityPlane::default();
    assert_eq!(at_infinity.in_world(&PAIR, &World::level(1.0, 0.0, 0.0).frame(), (160.0, 120.0)), None);
}

#[test]
fn a_plane_beyond_all_numbers_is_none_in_the_world() {
    let plane = DisparityPlane { at: 1.0, along_u: f32::MAX, along_v: 0.0 };
    assert_eq!(plane.in_world(&PAIR, &World::level(1.0, 0.0, 0.0).frame(), (160.0, 120.0)), None);
}
