//! Each rule of the ground by itself, on surfaces made by hand.

use std::vec::Vec;

use nalgebra::{Matrix3, Vector3};

use super::*;

/// Settings whose numbers are easy to reckon with.
fn settings() -> GroundSettings {
    GroundSettings {
        max_tilt_deg: 45.0,
        height_tolerance_m: 0.5,
        fit_tolerance_m: 0.1,
        fit_noise_factor: 2.0,
        fit_roughness: 1.5,
        surface_tolerance_m: 0.1,
        surface_tolerance_per_m: 0.02,
        max_range_m: 10.0,
        corridor_m: 4.0,
        min_support_permille: 0.0,
        other_height_support_permille: 0.0,
        ..GroundSettings::default()
    }
}

/// A finder of a camera 1.2 m above the ground, 0.5 m ahead of the origin and 0.3 m to its right.
fn finder(settings: &GroundSettings) -> GroundFinder {
    let mount = Mount { height_m: Some(1.2), pitch_down_deg: 20.0, forward_m: 0.5, left_m: -0.3, ..Mount::default() };
    let mut finder = GroundFinder::new();
    finder.configure(settings, &VehicleFrame::new(&mount).unwrap(), true, 1000).unwrap();
    finder
}

const CAMERA_M: [f32; 3] = [0.5, -0.3, 1.2];

fn horizontal(mean_m: [f32; 3]) -> Surface {
    let points = Scatter { weight: 100.0, mean_m, ..Scatter::default() };
    Surface { points, normal: [0.0, 0.0, 1.0], rms_m: 0.0, class: SurfaceClass::Horizontal }
}

/// A plane at a height above the origin.
fn level(offset_m: f32, camera_height_m: f32, support: u32) -> GroundPlane {
    GroundPlane { normal: [0.0, 0.0, 1.0], offset_m, camera_height_m, support, ..GroundPlane::UNSET }
}

#[test]
fn heights_are_measured_from_the_plane_of_another_detector() {
    let mut finder = finder(&settings());
    for offset_m in [0.4, -0.3] {
        finder.flatten(level(offset_m, 1.2 - offset_m, 50));
        assert_eq!(finder.terrain().plane().offset_m, offset_m);
        for p in [[3.0, 0.0, 1.0], [5.0, -4.0, 0.0], [9.0, 7.0, -1.0]] {
            assert!((finder.terrain().height_m(p) - (p[2] - offset_m)).abs() < 1.0e-6, "{p:?}");
        }
    }
}

#[test]
fn ground_can_be_as_high_and_low_as_tilt_and_tolerance_let_it() {
    let finder = finder(&settings());
    // 5 m away, at 45 degrees: 5 m up or down, and half a metre that the height of the mount may be wrong.
    for (z, may_be) in [(5.49, true), (5.51, false), (-5.49, true), (-5.51, false), (0.0, true)] {
        assert_eq!(finder.may_be_ground(&horizontal([3.0, 4.0, z]), Height::OfMount), may_be, "{z} m");
    }
    for height in [Height::NotOfMount, Height::Unknown] {
        for z in [-100.0, 0.0, 100.0] {
            assert!(finder.may_be_ground(&horizontal([3.0, 4.0, z]), height), "{z} m");
        }
    }
    for class in [SurfaceClass::Vertical, SurfaceClass::Slanted, SurfaceClass::Undefined] {
        let surface = Surface { class, ..horizontal([3.0, 4.0, 0.0]) };
        assert!(!finder.may_be_ground(&surface, Height::OfMount) && !finder.tells_plane(&surface, Height::OfMount));
    }
}

#[test]
fn what_is_far_does_not_tell_of_the_plane() {
    let finder = finder(&settings());
    for (x, y, tells) in [(6.0, 7.99, true), (6.0, 8.01, false), (-6.0, -7.99, true), (0.0, 10.01, false)] {
        assert_eq!(finder.tells_plane(&horizontal([x, y, 0.0]), Height::OfMount), tells, "{x}, {y}");
    }
    assert!(!finder.tells_plane(&horizontal([1.0, 1.0, 3.0]), Height::OfMount), "too high");
}

#[test]
fn a_surface_belongs_to_the_plane_within_a_tolerance_that_grows_with_its_distance() {
    let finder = finder(&settings());
    // 0.1 m and 0.02 m for each of five metres.
    for (z, lies) in [(0.699, true), (0.701, false), (0.301, true), (0.299, false)] {
        assert_eq!(finder.lies_on(&level(0.5, 1.2, 0), &horizontal([3.0, 4.0, z])), lies, "{z} m");
    }
}

#[test]
fn weights_fall_with_the_square_of_the_distance_and_noise_leaves_the_spread() {
    let mut random = Random::seeded("weights of surfaces", 0x5eed_0135);
    let finder = finder(&settings());
    for _ in 0..500 {
        let mean = Vector3::new(random.within(1.0, 10.0), random.within(-8.0, 8.0), random.within(-1.0, 1.0));
        let root = Matrix3::from_fn(|_, _| random.within(-0.5, 0.5));
        let (spread, noise_per_m) = (root * root.transpose(), random.within(0.0, 0.01));
        let [c, mean_m] = [spread.map(|c| c as f32), Matrix3::from_diagonal(&mean.map(|m| m as f32))];
        let covariance = SymmetricMatrix3 { xx: c.m11, xy: c.m12, xz: c.m13, yy: c.m22, yz: c.m23, zz: c.m33 };
        let points = Scatter { weight: 300.0, mean_m: mean_m.diagonal().into(), covariance };
        let found = finder.weighed(&Surface { points, ..horizontal([0.0; 3]) }, noise_per_m as f32);

        let weight = 300.0 / ((1.0 + mean.x.powi(2) + mean.y.powi(2)) * (1.0 + (mean.y / 4.0).powi(2)));
        assert!((f64::from(found.weight) - weight).abs() < 1.0e-5 * weight, "{found:?}, not {weight}");
        assert_eq!(found.mean_m, points.mean_m);
        // A point moves along its ray, by its distance for each of its metres.
        let ray = mean - Vector3::from(CAMERA_M.map(f64::from));
        let moved = ray * ray.norm() * noise_per_m;
        let truth = spread - moved * moved.transpose();
        let f = found.covariance;
        let found = Matrix3::new(f.xx, f.xy, f.xz, f.xy, f.yy, f.yz, f.xz, f.yz, f.zz).map(f64::from);
        assert!((found - truth).amax() < 1.0e-5, "{found}, not {truth}");
    }
}

#[test]
fn a_shift_along_the_ray_is_told_from_how_far_points_lie_off_their_plane() {
    // The camera 2 m up, the surface 7 m away and 6 m below it.
    let camera_m = [0.0, 0.0, 2.0];
    let rough = |normal, rms_m| Surface { normal, rms_m, ..horizontal([2.0, 3.0, -4.0]) };
    let near = |found: Option<f32>, truth: f32| assert!((found.unwrap() - truth).abs() < 1.0e-6 * truth, "{found:?}");
    near(shift_per_m(&rough([0.0, 0.0, 1.0], 0.21), camera_m), 0.005);
    near(shift_per_m(&rough([0.6, 0.0, 0.8], 0.21), camera_m), 0.21 / (7.0 * 3.6));
    near(shift_per_m(&rough([0.0, 0.6, 0.8], 0.21), camera_m), 0.21 / (7.0 * 3.0));
    // Planes that lead to the camera, and one that passes it by as far as is too little.
    for (normal, mean_m) in [([0.0, 0.0, 1.0], [4.0, 1.0, 2.0]), ([0.0, 1.0, 0.0], [4.0, 0.05, 1.0])] {
        let surface = Surface { normal, rms_m: 0.1, ..horizontal(mean_m) };
        assert_eq!(shift_per_m(&surface, camera_m), None);
        assert!(Noise { camera_m, shift_per_m: 0.0, most_per_m: 0.0 }.allows(&surface));
    }
    for (most_per_m, allowed) in [(0.0051, true), (0.0049, false)] {
        let noise = Noise { camera_m, shift_per_m: 0.0, most_per_m };
        assert_eq!(noise.allows(&rough([0.0, 0.0, 1.0], 0.21)), allowed, "{most_per_m}");
    }
}

#[test]
fn noise_is_the_quadratic_mean_without_what_is_rough() {
    let mut finder = finder(&settings());
    finder.most_noise_per_m = 1.0;
    let noisy = |weight: f32, shift_per_m: f32| {
        let mut surface = horizontal([3.5, -0.3, 0.0]);
        surface.points.weight = weight;
        // The ray is 3 m ahead and 1.2 m down.
        surface.rms_m = shift_per_m * 1.2 * (9.0_f32 + 1.44).sqrt();
        surface
    };
    let near = |found: f32, truth: f32| assert!((found - truth).abs() < 1.0e-5 * truth, "{found}, not {truth}");
    let table = [noisy(100.0, 0.001), noisy(300.0, 0.002), noisy(20.0, 0.02)];
    let noise = finder.noise(&table, Height::OfMount);
    assert_eq!(noise.camera_m, CAMERA_M);
    // In 1e-6: of all three (100 + 1200 + 8000) / 420; half as much again is the most, which leaves the third out.
    near(noise.most_per_m, 1.5 * (9300.0e-6_f32 / 420.0).sqrt());
    near(noise.shift_per_m, 2.0 * (1300.0e-6_f32 / 400.0).sqrt());
    // Never more than the settings let.
    finder.most_noise_per_m = 1.0e-4;
    assert_eq!(finder.noise(&table, Height::OfMount).shift_per_m, 1.0e-4);
    let nothing = finder.noise(&[], Height::OfMount);
    assert_eq!((nothing.shift_per_m, nothing.most_per_m), (0.0, 0.0));
}

#[test]
fn a_plane_is_plausible_at_some_heights_only() {
    let finder = finder(&settings());
    let plausible = |camera_height_m, height| finder.plausible(&level(0.0, camera_height_m, 100), &[], height);
    for (camera_height_m, found) in [(0.71, true), (0.69, false), (1.69, true), (1.71, false)] {
        assert_eq!(plausible(camera_height_m, Height::OfMount), found, "{camera_height_m} m");
    }
    for (camera_height_m, found) in [(LEAST_HEIGHT_M, false), (0.051, true), (50.0, true)] {
        assert_eq!(plausible(camera_height_m, Height::Unknown), found, "{camera_height_m} m");
    }
    // A third of 1.2 m.
    let least = 0.33 * 1.2;
    for (camera_height_m, found) in [(0.39, false), (least, false), (0.40, true), (50.0, true)] {
        assert_eq!(plausible(camera_height_m, Height::NotOfMount), found, "{camera_height_m} m");
    }
    // At the height of the camera there is no ground, however large the tolerance.
    let tolerant = self::finder(&GroundSettings { height_tolerance_m: 2.0, ..settings() });
    for (camera_height_m, found) in [(0.0, false), (-0.01, false), (0.01, true)] {
        assert_eq!(tolerant.plausible(&level(0.0, camera_height_m, 100), &[], Height::OfMount), found);
    }
    // Tilted by more than 45 degrees.
    for (upright, found) in [(0.70, false), (0.71, true)] {
        let tilted = GroundPlane { normal: [0.0, 0.0, upright], ..level(0.0, 1.2, 100) };
        assert_eq!(finder.plausible(&tilted, &[], Height::OfMount), found);
    }
}

#[test]
fn hardly_anything_lies_below_the_lowest_plane() {
    let finder = finder(&settings());
    let plane = level(0.0, 1.2, 2000);
    let below = |x, y, z| finder.is_lowest(&plane, &[horizontal([x, y, z]), horizontal([1.0, 0.0, -1.0])]);
    // A hundred pixels are a twentieth of two thousand; two hundred are too many.
    assert!(finder.is_lowest(&plane, &[horizontal([1.0, 0.0, -1.0])]));
    assert!(!below(3.0, 4.0, -0.51));
    assert!(below(3.0, 4.0, -0.5), "as far below as the height may be wrong");
    assert!(!below(6.0, 7.99, -1.0));
    assert!(below(6.0, 8.01, -1.0), "too far to tell");
    assert!(!below(0.5, 0.5, -1.0));
}

#[test]
fn a_first_plane_is_forgiven_more() {
    let finder = finder(&GroundSettings { fit_roughness: 10.0, ..settings() });
    let noise = Noise { camera_m: CAMERA_M, shift_per_m: 0.0, most_per_m: f32::INFINITY };
    let table: Vec<_> = (0..40_u16)
        .map(|i| {
            let mut surface = horizontal([1.0 + f32::from(i % 8) * 0.5, f32::from(i / 8) * 0.6 - 1.2, 0.0]);
            surface.points.covariance = SymmetricMatrix3 { xx: 0.02, yy: 0.02, ..SymmetricMatrix3::default() };
            surface
        })
        .collect();
    let frame = finder.frame.unwrap();
    // Two and a half times the tolerance, at first.
    for (offset_m, found) in [(0.24, true), (-0.24, true), (0.26, false), (-0.26, false)] {
        let grown = finder.grow(level(offset_m, 1.2, 0), &table, &frame, Height::OfMount, &noise);
        assert_eq!(grown.is_some(), found, "{offset_m} m");
        if let Some((_, plane)) = grown {
            assert!(plane.offset_m.abs() < 1.0e-4 && plane.support == 4000, "{plane:?}");
        }
    }
}

#[test]
fn of_two_planes_that_were_tried_more_lies_on_the_one_that_is_found() {
    let mut finder = finder(&settings());
    let frame = finder.frame.unwrap();
    // Level pieces of ground at a height, as far away and as many at each.
    let pieces = |z: f32, rows: u16| {
        (0..8 * rows).map(move |i| {
            let mut surface = horizontal([1.0 + f32::from(i / 8) * 0.6, f32::from(i % 8) * 0.5 - 2.0, z]);
            surface.points.covariance = SymmetricMatrix3 { xx: 0.02, yy: 0.02, ..SymmetricMatrix3::default() };
            surface
        })
    };
    let mut found = |above: u16, below: u16| {
        finder.last = Some(level(0.4, 0.8, 0));
        let table: Vec<_> = pieces(0.4, above).chain(pieces(0.0, below)).collect();
        let plane = finder.find(&table, &Regions::<64>::new(), &frame, Height::OfMount);
        plane.expect("either is plausible").offset_m
    };
    // The last plane lies 0.4 m high, that of the mount at none.
    assert!((found(3, 2) - 0.4).abs() < 1.0e-4);
    assert!(found(2, 3).abs() < 1.0e-4);
    assert!((found(3, 3) - 0.4).abs() < 1.0e-4, "of equals the last frame's stays");
}

#[test]
fn without_holding_no_plane_is_kept_and_detectors_exchange_theirs() {
    let world = World::level(1.2, 15.0, 0.0);
    let seen = world.render();
    for hold_frames in [0, 1] {
        let mut stages = stages(&world.mount(), &GroundSettings { hold_frames, ..GroundSettings::default() });
        let plane = stages.ground(&seen);
        assert!(plane.is_some());
        assert_eq!(stages.ground.last, plane.filter(|_| hold_frames > 0));
    }
    let (mut finder, mut other) = (finder(&settings()), Some(level(0.1, 1.1, 7)));
    finder.last = Some(level(0.2, 1.0, 8));
    finder.exchange(&mut other);
    assert_eq!((finder.last, other), (Some(level(0.1, 1.1, 7)), Some(level(0.2, 1.0, 8))));
}

#[test]
fn the_most_noise_is_that_of_the_settings_at_a_metre() {
    let world = World::level(1.2, 15.0, 0.0);
    let settings = GroundSettings { fit_noise_max_px: 0.5, ..GroundSettings::default() };
    let mut stages = stages(&world.mount(), &settings);
    stages.ground(&world.render());
    let pair = crate::test_world::PAIR;
    let truth = 0.5 / (pair.focal_px * pair.baseline_m);
    assert!((stages.ground.most_noise_per_m - truth).abs() < 1.0e-6 * truth);
}

#[test]
fn a_plane_seen_from_elsewhere_is_the_same_plane() {
    let mut random = Random::seeded("moved planes", 0x5eed_0136);
    for _ in 0..200 {
        let normal = Vector3::new(random.within(-0.3, 0.3), random.within(-0.3, 0.3), 1.0).normalize();
        let offset_m = random.within(-1.0, 1.0) as f32;
        let plane = GroundPlane { normal: normal.map(|n| n as f32).into(), ..level(offset_m, 1.2, 5) };
        let mount = Mount {
            forward_m: random.within(-3.0, 3.0) as f32,
            left_m: random.within(-3.0, 3.0) as f32,
            yaw_left_deg: random.within(-180.0, 180.0) as f32,
            ..Mount::default()
        };
        let place = crate::geometry::Place::new(&mount);
        let moved = plane.moved(&place);
        for _ in 0..10 {
            let p: [f32; 3] = core::array::from_fn(|_| random.within(-5.0, 5.0) as f32);
            let [x, y] = place.to_vehicle([p[0], p[1]]);
            assert!((moved.height_m([x, y, p[2]]) - plane.height_m(p)).abs() < 1.0e-5, "{plane:?}, {moved:?}");
        }
        assert_eq!(GroundPlane { normal: plane.normal, offset_m, ..moved }, plane, "what it says of the camera stays");
    }
    // The distance of the points from the plane through them is told.
    let covariance = SymmetricMatrix3 { xx: 1.0, yy: 2.0, zz: 0.0025, ..SymmetricMatrix3::default() };
    let points = Scatter { weight: 50.0, mean_m: [4.0, 0.0, 0.1], covariance };
    let plane = GroundPlane::through(&points, &World::level(1.2, 15.0, 0.0).frame()).unwrap();
    assert!((plane.rms_m - 0.05).abs() < 1.0e-5 && plane.support == 50, "{plane:?}");
}
