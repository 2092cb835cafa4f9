//! Planes of known tilt, seen by a perfect camera with disparities in steps of 1/16 px.

use super::*;
use crate::test_world::{Patch, Point, World};

struct Seen {
    /// Surfaces that cover a good part of their tile, with the largest error of dot and of the normal's tilt, degrees.
    surfaces: Vec<Surface>,
    dot: f32,
    tilt_deg: f64,
}

/// A plane that fills the view at `range_m`, its normal `tilt_deg` off the vertical and towards `azimuth_deg`.
fn see(tilt_deg: f64, azimuth_deg: f64, range_m: f64, mount: (f64, f64)) -> Seen {
    let (sin, cos) = tilt_deg.to_radians().sin_cos();
    let azimuth = azimuth_deg.to_radians();
    let normal = Point::new(sin * azimuth.cos(), sin * azimuth.sin(), cos);
    let mut world = World::empty(1.2, mount.0, mount.1);
    let middle = Point::new(0.0, 0.0, 1.2) + world.direction(159.5, 119.5) * range_m;
    let patch = Patch::across(normal, middle, 500.0);
    world.patches.push(patch);
    let pixels = world.render();
    let mut stage = Box::new(Surfaces::<{ 320 * 240 }, 512>::new());
    stage.configure(&SurfaceSettings::default(), 320, 240).unwrap();
    stage.run(DisparityPicture::new(&pixels, 320), &world.depth(), &world.rays());
    let near = |s: &&Surface| {
        let [x, y, z] = s.points.mean_m.map(f64::from);
        s.pixels() >= 500 && (Point::new(x, y, z) - middle).norm() < 0.3 * range_m
    };
    let surfaces: Vec<Surface> = stage.table().iter().filter(near).copied().collect();
    let truth = patch.normal();
    let (mut dot, mut tilt) = (0.0_f32, 0.0_f64);
    for surface in &surfaces {
        dot = dot.max((surface.dot() - cos as f32).abs());
        let found = Point::from(surface.normal.map(f64::from));
        tilt = tilt.max(found.cross(&truth).norm().atan2(found.dot(&truth).abs()).to_degrees());
        assert!((surface.dot().powi(2) + surface.cross().powi(2) - 1.0).abs() < 1.0e-5);
        assert!(surface.normal[2] >= 0.0);
    }
    Seen { surfaces, dot, tilt_deg: tilt }
}

#[test]
fn slopes_have_the_dot_and_the_class_of_their_tilt() {
    // Tolerances: rounding to 1/16 px at these ranges; a tile at 8 m is as long as the distance of one step.
    for (range_m, tolerance_deg) in [(2.0, 0.5), (4.0, 1.0), (8.0, 3.0)] {
        let mut worst = (0.0_f32, 0.0_f64);
        let mut count = 0;
        for mount in [(20.0, 0.0), (15.0, 8.0), (35.0, -5.0)] {
            for tilt_deg in [0.0, 20.0, 30.0, 45.0, 60.0, 90.0] {
                for azimuth_deg in [180.0, 150.0, 210.0] {
                    let seen = see(tilt_deg, azimuth_deg, range_m, mount);
                    assert!(!seen.surfaces.is_empty(), "{tilt_deg} degrees at {range_m} m: no surface");
                    count += seen.surfaces.len();
                    worst = (worst.0.max(seen.dot), worst.1.max(seen.tilt_deg));
                    assert!(
                        seen.tilt_deg <= tolerance_deg,
                        "{tilt_deg} degrees to {azimuth_deg} at {range_m} m: {:.2} degrees off",
                        seen.tilt_deg
                    );
                    for surface in &seen.surfaces {
                        let expected: &[SurfaceClass] = match tilt_deg as i32 {
                            0 | 20 => &[SurfaceClass::Horizontal],
                            30 => &[SurfaceClass::Horizontal, SurfaceClass::Slanted],
                            45 => &[SurfaceClass::Slanted, SurfaceClass::Vertical],
                            _ => &[SurfaceClass::Vertical],
                        };
                        assert!(expected.contains(&surface.class), "{tilt_deg}: {surface:?}");
                    }
                }
            }
        }
        std::println!("{range_m} m: {count} surfaces, dot within {:.4}, tilt within {:.2} degrees", worst.0, worst.1);
    }
}

#[test]
fn limits_of_the_classes_are_those_of_the_settings() {
    let mut stage = Box::new(Surfaces::<1024, 4>::new());
    let settings = SurfaceSettings { horizontal_deg: 20.0, vertical_deg: 70.0, ..SurfaceSettings::default() };
    stage.configure(&settings, 32, 32).unwrap();
    for tenths in 0..=900_u16 {
        let tilt = f64::from(tenths) / 10.0;
        let (sin, cos) = tilt.to_radians().sin_cos();
        // Points of a disc across the normal.
        let normal = nalgebra::Vector3::new(sin, 0.0, cos);
        let c = nalgebra::Matrix3::identity() - normal * normal.transpose();
        let covariance = crate::planes::SymmetricMatrix3 {
            xx: c.m11 as f32,
            xy: c.m12 as f32,
            xz: c.m13 as f32,
            yy: c.m22 as f32,
            yz: c.m23 as f32,
            zz: c.m33 as f32,
        };
        let class = stage.limits.classify(Scatter { weight: 100.0, mean_m: [5.0, 0.0, 0.0], covariance }).class;
        if (tilt - 20.0).abs() < 0.05 || (tilt - 70.0).abs() < 0.05 {
            continue;
        }
        let expected = match tilt {
            t if t < 20.0 => SurfaceClass::Horizontal,
            t if t < 70.0 => SurfaceClass::Slanted,
            _ => SurfaceClass::Vertical,
        };
        assert_eq!(class, expected, "{tilt} degrees");
    }
    let line = crate::planes::SymmetricMatrix3 { xx: 1.0, ..Default::default() };
    for covariance in [line, crate::planes::SymmetricMatrix3::default()] {
        let surface = stage.limits.classify(Scatter { weight: 100.0, mean_m: [5.0, 0.0, 0.0], covariance });
        assert_eq!((surface.class, surface.normal), (SurfaceClass::Undefined, [0.0; 3]));
    }
}

#[test]
fn a_box_does_not_melt_into_the_ground_it_stands_on() {
    let mut world = World::level(1.2, 20.0, 0.0);
    world.add_box([3.0, -0.6, 0.0], [3.6, 0.6, 1.0], 0.0);
    let pixels = world.render();
    let mut stage = Box::new(Surfaces::<{ 320 * 240 }, 512>::new());
    stage.configure(&SurfaceSettings::default(), 320, 240).unwrap();
    stage.run(DisparityPicture::new(&pixels, 320), &world.depth(), &world.rays());
    let (mut ground, mut front) = ((0, 0), (0, 0));
    for v in 0..240 {
        for u in 0..320 {
            let Some((_, patch)) = world.hit(u as f64, v as f64) else { continue };
            let Some(surface) = stage.surface_at(u, v) else { continue };
            let level = patch.normal().z > 0.5;
            let right = surface.class == if level { SurfaceClass::Horizontal } else { SurfaceClass::Vertical };
            let count = if level { &mut ground } else { &mut front };
            count.0 += usize::from(right);
            count.1 += 1;
        }
    }
    std::println!("ground {ground:?}, front {front:?}");
    assert!(ground.0 * 100 > ground.1 * 75 && front.0 * 100 > front.1 * 60, "ground {ground:?}, front {front:?}");
}

#[test]
fn settings_out_of_range_are_named() {
    let good = SurfaceSettings::default();
    let field = |settings: SurfaceSettings| {
        let error = settings.check().unwrap_err();
        let mut stage = Box::new(Surfaces::<{ 64 * 48 }, 64>::new());
        assert_eq!(stage.configure(&settings, 64, 48), Err(error));
        error.field
    };
    assert_eq!(good.check(), Ok(()));
    assert_eq!(field(SurfaceSettings { step_sixteenths: 1025, ..good }), "surfaces.step_sixteenths");
    for min_pixels in [0, 15, 1025] {
        assert_eq!(field(SurfaceSettings { min_pixels, ..good }), "surfaces.min_pixels");
    }
    for horizontal_deg in [0.5, 90.0, f32::NAN] {
        assert_eq!(field(SurfaceSettings { horizontal_deg, ..good }), "surfaces.horizontal_deg");
    }
    // Nothing is both.
    for vertical_deg in [29.0, 90.0, f32::INFINITY] {
        assert_eq!(field(SurfaceSettings { vertical_deg, ..good }), "surfaces.vertical_deg");
    }
}
