//! Frames by hand-made examples and against matrices in f64.

use std::boxed::Box;

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::*;
use crate::{
    error::{ConfigError, ConfigProblem},
    test_random::Random,
    test_world::{self, World},
};

fn frame(height_m: f32, pitch_down_deg: f32, roll_deg: f32) -> VehicleFrame {
    VehicleFrame::new(&Mount { height_m: Some(height_m), pitch_down_deg, roll_deg, ..Mount::default() }).unwrap()
}

#[track_caller]
fn near(found: [f32; 3], expected: [f32; 3]) {
    let apart = (0..3).map(|i| (found[i] - expected[i]).abs()).fold(0.0, f32::max);
    assert!(apart < 1.0e-5, "{found:?} instead of {expected:?}");
}

#[test]
fn a_level_camera_looks_along_x() {
    let frame = frame(1.5, 0.0, 0.0);
    near(frame.point([0.0, 0.0, 4.0]), [4.0, 0.0, 1.5]);
    near(frame.point([1.0, 0.0, 4.0]), [4.0, -1.0, 1.5]);
    near(frame.point([0.0, 1.0, 4.0]), [4.0, 0.0, 0.5]);
    near(frame.to_camera([1.0, 0.0, 0.0]), [0.0, 0.0, 1.0]);
}

#[test]
fn a_camera_tilted_down_sees_the_ground_ahead() {
    // 45 degrees from 2 m: the optical axis meets the ground 2 m ahead.
    let frame = frame(2.0, 45.0, 0.0);
    near(frame.point([0.0, 0.0, 8.0_f32.sqrt()]), [2.0, 0.0, 0.0]);
    // Straight to the right stays level.
    near(frame.direction([1.0, 0.0, 0.0]), [0.0, -1.0, 0.0]);
}

#[test]
fn a_camera_that_leans_to_the_right_has_its_right_side_low() {
    let frame = frame(1.0, 0.0, 30.0);
    near(frame.direction([1.0, 0.0, 0.0]), [0.0, -(30.0_f32.to_radians().cos()), -0.5]);
    near(frame.direction([0.0, 0.0, 1.0]), [1.0, 0.0, 0.0]);
}

#[test]
fn the_camera_stands_at_the_height_of_the_mount_or_at_the_assumed_one() {
    assert_eq!(frame(0.625, 12.0, 3.0).camera_height_m(), 0.625);
    let mount = Mount::default();
    assert_eq!(VehicleFrame::new(&mount).unwrap().camera_height_m(), Mount::ASSUMED_HEIGHT_M);
}

#[test]
fn frames_are_those_of_rotations_about_the_vehicles_axes() {
    let mut random = Random::seeded("frames", 0x5eed_0120);
    for _ in 0..5000 {
        let world = World::empty(random.within(0.1, 5.0), random.within(-60.0, 89.0), random.within(-60.0, 60.0));
        let place = (random.within(-9.0, 9.0), random.within(-9.0, 9.0), random.within(-180.0, 180.0));
        let mounted = World { place, ..world.clone() };
        let frame = world.frame();
        let camera = Vector3::from_fn(|_, _| random.within(-10.0, 10.0));
        let truth = world.rotation() * camera + Vector3::new(0.0, 0.0, world.height_m);
        let found = Vector3::from(frame.point(camera.map(|c| c as f32).into()).map(f64::from));
        assert!((found - truth).norm() < 2.0e-5, "{found} instead of {truth}, {world:?}");
        let back = frame.to_camera(frame.direction(camera.map(|c| c as f32).into()));
        assert!((Vector3::from(back.map(f64::from)) - camera).norm() < 2.0e-5);

        // The same camera elsewhere on the vehicle, by both ways: its frame, and the place that its own frame has.
        let truth_moved = mounted.to_vehicle(truth);
        let camera_f32: [f32; 3] = camera.map(|c| c as f32).into();
        let found = VehicleFrame::new(&mounted.mount()).unwrap().point(camera_f32);
        assert!((Vector3::from(found.map(f64::from)) - truth_moved).norm() < 5.0e-5);
        let there = Place::new(&mounted.mount());
        let [x, y, z] = frame.point(camera_f32);
        let [x, y] = there.to_vehicle([x, y]);
        assert!((Vector3::new(x, y, z).map(f64::from) - truth_moved).norm() < 5.0e-5);
        let [x, y] = there.to_pair([x, y]);
        assert!((Vector3::new(x, y, z).map(f64::from) - truth).norm() < 5.0e-5);

        // A camera turned against the mounted one: the same thing seen by both lies at the same place.
        let turn =
            Rotation3::from_euler_angles(random.within(-0.3, 0.3), random.within(-0.3, 0.3), random.within(-0.3, 0.3));
        let rotation: [[f32; 3]; 3] = core::array::from_fn(|i| core::array::from_fn(|j| turn[(i, j)] as f32));
        let found = frame.turned(&rotation).point((turn * camera).map(|c| c as f32).into());
        assert!((Vector3::from(found.map(f64::from)) - truth).norm() < 5.0e-5);
    }
}

#[test]
fn a_pair_at_the_origin_leaves_every_bit() {
    let mut random = Random::seeded("places", 0x5eed_0123);
    let place = Place::new(&Mount::default());
    assert_eq!(place, Place::ORIGIN);
    for _ in 0..10_000 {
        let point = [random.within(-99.0, 99.0) as f32, random.within(-99.0, 99.0) as f32];
        for found in [place.to_vehicle(point), place.to_pair(point), place.turn(point), place.turn_back(point)] {
            assert_eq!(found.map(f32::to_bits), point.map(f32::to_bits));
        }
    }
    let mount = Mount { height_m: Some(1.3), pitch_down_deg: 17.0, roll_deg: -3.0, ..Mount::default() };
    assert_eq!(VehicleFrame::new(&mount), VehicleFrame::new(&mount.without_place()));
}

#[test]
fn a_camera_that_looks_to_the_left_sees_along_y() {
    let mount = Mount { height_m: Some(1.0), forward_m: 2.0, left_m: -0.5, yaw_left_deg: 90.0, ..Mount::default() };
    let frame = VehicleFrame::new(&mount).unwrap();
    near(frame.point([0.0, 0.0, 4.0]), [2.0, 3.5, 1.0]);
    near(frame.point([1.0, 0.0, 4.0]), [3.0, 3.5, 1.0]);
    near(frame.to_camera([0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
    let place = Place::new(&mount);
    assert!((place.yaw_left_rad() - core::f32::consts::FRAC_PI_2).abs() < 1.0e-6);
    assert_eq!((place.origin_m(), frame.origin_m()), ([2.0, -0.5], [2.0, -0.5, 1.0]));
    assert_eq!(mount.without_place(), Mount { height_m: Some(1.0), ..Mount::default() });
}

#[test]
fn rays_are_the_projection_turned_round() {
    let mut random = Random::seeded("rays", 0x5eed_0121);
    for _ in 0..2000 {
        let mut world = World::empty(random.within(0.1, 3.0), random.within(-30.0, 60.0), random.within(-30.0, 30.0));
        world.pair = RectifiedPair {
            focal_px: random.within(50.0, 2000.0) as f32,
            cx: random.within(0.0, 1000.0) as f32,
            cy: random.within(0.0, 1000.0) as f32,
            ..test_world::PAIR
        };
        let (u, v, z) = (random.within(0.0, 1000.0), random.within(0.0, 1000.0), random.within(0.5, 50.0));
        let truth = Vector3::new(0.0, 0.0, world.height_m) + world.direction(u, v) * z;
        let found = Vector3::from(world.rays().point_m(u as f32, v as f32, z as f32).map(f64::from));
        assert!((found - truth).norm() < 2.0e-5 * (truth.norm() + 1.0), "{found} instead of {truth}");
        // And forth again, through the pinhole.
        let seen = world.frame().to_camera([found.x as f32, found.y as f32, found.z as f32 - world.height_m as f32]);
        let pixel = world.pair.cx + world.pair.focal_px * seen[0] / seen[2];
        assert!((f64::from(pixel) - u).abs() < 0.02, "{pixel} instead of {u}");
    }
    assert_eq!(Rays::UNSET, Rays::default());
}

#[test]
fn distances_are_those_of_the_formula_for_every_step() {
    let mut random = Random::seeded("distances", 0x5eed_0122);
    let mut table = Box::new(DepthTable::<128>::new());
    assert!((0..=u16::MAX).all(|steps| table.inverse(steps) == 0), "an empty table has no distance");
    for round in 0..40 {
        let pair = RectifiedPair {
            focal_px: random.within(50.0, 3000.0) as f32,
            baseline_m: random.within(0.02, 2.0) as f32,
            disparity_offset_px: if round % 2 == 0 { 0.0 } else { random.within(-40.0, 40.0) as f32 },
            ..test_world::PAIR
        };
        let first = if round % 4 == 1 { 0 } else { random.below(100) as u16 };
        let (min_disparity, disparities) = (first, 8 + random.below(121) as u16);
        table.configure(&pair, min_disparity, disparities);
        let scale = f64::from(pair.focal_px) * f64::from(pair.baseline_m);
        assert!((f64::from(table.focal_baseline_px_m()) - scale).abs() < 1.0e-6 * scale, "{pair:?}");
        for steps in 0..=u16::MAX {
            let disparity = f64::from(steps) / 16.0 + f64::from(pair.disparity_offset_px);
            // A disparity of 0 is none, also where an offset would give it a distance.
            let in_range = steps > 0 && steps >= min_disparity * 16 && steps < (min_disparity + disparities) * 16;
            let found = f64::from(table.distance_m(steps));
            // At the very end of what meets the rounding of the offset decides.
            if (disparity - 1.0 / 16.0).abs() < 1.0e-4 {
                continue;
            }
            if !in_range || disparity < 1.0 / 16.0 {
                assert_eq!((table.inverse(steps), found), (0, 0.0), "{steps}, {pair:?}");
                continue;
            }
            let truth = scale / disparity;
            let unit = f64::from(table.scale_m());
            assert!((f64::from(table.inverse(steps)) * unit - found).abs() <= found * 1.0e-6, "{steps}, {pair:?}");
            // Half a unit of the inverse.
            let tolerance = 0.5 * unit + truth * 2.0e-5;
            assert!((found - truth).abs() <= tolerance, "{steps}: {found} instead of {truth}, {pair:?}");
        }
    }
}

#[test]
fn distance_and_disparity_are_inverse() {
    let pair = RectifiedPair { disparity_offset_px: 3.5, ..test_world::PAIR };
    for tenths in 1..1000_u16 {
        let distance = f32::from(tenths) * 0.1;
        assert!(
            (pair.distance_m(pair.disparity_px(distance)) - distance).abs() < 1.0e-3 * distance * distance.max(1.0)
        );
    }
    assert_eq!(pair.distance_m(-3.5), f32::INFINITY);
    assert_eq!(pair.distance_m(-10.0), f32::INFINITY);
    // No disparity is no distance behind the camera either, whatever sign its zero has.
    let far = RectifiedPair { disparity_offset_px: -0.0, ..pair };
    assert_eq!([0.0, -0.0].map(|disparity_px| far.distance_m(disparity_px)), [f32::INFINITY; 2]);
}

#[test]
fn what_cannot_be_is_named() {
    let problem = |pair: RectifiedPair| pair.check().unwrap_err();
    let nan = ConfigProblem::NotFinite;
    let good = test_world::PAIR;
    assert_eq!(good.check(), Ok(()));
    assert_eq!(problem(RectifiedPair { focal_px: f32::NAN, ..good }), ConfigError::new("calibration.focal_px", nan));
    assert_eq!(problem(RectifiedPair { cx: f32::INFINITY, ..good }), ConfigError::new("calibration.cx", nan));
    assert_eq!(problem(RectifiedPair { cy: f32::NAN, ..good }), ConfigError::new("calibration.cy", nan));
    assert_eq!(problem(RectifiedPair { width: 0, ..good }).field, "calibration.width");
    assert_eq!(problem(RectifiedPair { height: u32::MAX, ..good }).field, "calibration.height");
    assert_eq!(problem(RectifiedPair { focal_px: 0.0, ..good }).field, "calibration.focal_px");
    assert_eq!(problem(RectifiedPair { focal_px: -500.0, ..good }).field, "calibration.focal_px");
    // Cameras at one place are not exchanged.
    let out_of_range = ConfigProblem::OutOfRange { min: 1.0e-3, max: 100.0 };
    assert_eq!(
        problem(RectifiedPair { baseline_m: 0.0, ..good }),
        ConfigError::new("calibration.baseline_m", out_of_range)
    );
    assert_eq!(
        problem(RectifiedPair { baseline_m: f32::NAN, ..good }),
        ConfigError::new("calibration.baseline_m", nan)
    );
    let exchanged = problem(RectifiedPair { baseline_m: -0.2, ..good });
    assert_eq!(exchanged, ConfigError::new("calibration.baseline_m", ConfigProblem::Exchanged));
    assert_eq!(problem(RectifiedPair { disparity_offset_px: 1.0e6, ..good }).field, "calibration.disparity_offset_px");

    let mount = |height_m, pitch_down_deg, roll_deg| {
        VehicleFrame::new(&Mount { height_m, pitch_down_deg, roll_deg, ..Mount::default() }).unwrap_err().field
    };
    assert_eq!(mount(Some(0.0), 0.0, 0.0), "mount.height_m");
    assert_eq!(mount(Some(f32::NAN), 0.0, 0.0), "mount.height_m");
    assert_eq!(mount(None, 90.0, 0.0), "mount.pitch_down_deg");
    assert_eq!(mount(None, f32::NAN, 0.0), "mount.pitch_down_deg");
    assert_eq!(mount(None, 0.0, -61.0), "mount.roll_deg");
    let place = |forward_m, left_m, yaw_left_deg| {
        VehicleFrame::new(&Mount { forward_m, left_m, yaw_left_deg, ..Mount::default() }).unwrap_err().field
    };
    assert_eq!(place(51.0, 0.0, 0.0), "mount.forward_m");
    assert_eq!(place(0.0, f32::NAN, 0.0), "mount.left_m");
    assert_eq!(place(0.0, 0.0, 181.0), "mount.yaw_left_deg");
}

#[test]
fn frames_are_rotations() {
    for (pitch, roll) in [(0.0, 0.0), (-60.0, 60.0), (89.0, -60.0), (33.0, 12.0)] {
        let rows = Matrix3::from_fn(|i, j| f64::from(frame(1.0, pitch, roll).rows()[i][j]));
        assert!((rows * rows.transpose() - Matrix3::identity()).amax() < 1.0e-6);
        assert!((rows.determinant() - 1.0).abs() < 1.0e-6, "a mirror image");
    }
}

#[test]
fn disparities_with_a_distance_lie_side_by_side() {
    for (offset_px, min, disparities) in
        [(0.0, 0, 16), (0.0, 5, 9), (-3.3, 0, 16), (2.0, 0, 12), (-50.0, 0, 16), (0.0, 0, 0), (0.0, 2040, 16)]
    {
        let pair = RectifiedPair {
            width: 64,
            height: 48,
            focal_px: 100.0,
            cx: 0.0,
            cy: 0.0,
            baseline_m: 0.1,
            disparity_offset_px: offset_px,
        };
        let mut depth = DepthTable::<16>::new();
        depth.configure(&pair, min, disparities);
        let covered = depth.covered();
        for steps in 0..=u16::MAX {
            let pixel = crate::disparity::DisparityPixel::from_bits(steps);
            let has_distance = pixel.has_value() && depth.inverse(steps) != 0;
            assert_eq!(covered.contains(&steps), has_distance, "{steps} of {min} + {disparities}, {offset_px} px");
            // Side by side they have what each has alone.
            if let (true, Some(next)) = (has_distance, steps.checked_add(1).filter(|next| covered.contains(next))) {
                let pair = [next, steps];
                assert_eq!(depth.inverses(&pair), pair.map(|steps| depth.inverse(steps)));
                assert_eq!(depth.distances_m(&pair), pair.map(|steps| depth.distance_m(steps)));
            }
        }
    }
}
