//! Moments by exact sums, against sums over the points in f64.

use nalgebra::{Matrix3, Vector3};

use super::*;
use crate::geometry::{Mount, VehicleFrame};

/// Mean and covariance of points in f64, and the same as the stage says, with the greatest errors: of the mean relative to
/// the distance, of the covariance relative to its largest entry.
fn errors(points: &[Vector3<f64>], scatter: &Scatter, origin: Vector3<f64>) -> (f64, f64) {
    let n = points.len() as f64;
    let mean = points.iter().sum::<Vector3<f64>>() / n;
    let covariance = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum::<Matrix3<f64>>() / n;
    let c = &scatter.covariance;
    let found = Matrix3::new(c.xx, c.xy, c.xz, c.xy, c.yy, c.yz, c.xz, c.yz, c.zz).map(f64::from);
    let found_mean = Vector3::from(scatter.mean_m.map(f64::from));
    assert_eq!(f64::from(scatter.weight), n);
    ((found_mean - mean).norm() / (mean - origin).norm(), (found - covariance).amax() / covariance.amax())
}

#[test]
fn mean_and_covariance_are_those_of_the_points() {
    let mut random = Random::seeded("moments", 0x5eed_0104);
    let mut stage = Box::new(Surfaces::<{ 128 * 96 }, 64>::new());
    let mut depth = Box::new(DepthTable::<160>::new());
    let (mut worst_mean, mut worst_covariance, mut surfaces, mut coarse) = (0.0_f64, 0.0_f64, 0, 0);
    for round in 0..2000 {
        let pair = RectifiedPair {
            width: 1 + 32 + random.below(96),
            height: 1 + 32 + random.below(64),
            focal_px: random.within(60.0, 1200.0) as f32,
            cx: random.within(-100.0, 200.0) as f32,
            cy: random.within(-100.0, 200.0) as f32,
            baseline_m: random.within(0.04, 0.6) as f32,
            disparity_offset_px: random.within(-0.4, 5.0) as f32,
        };
        let mount = Mount {
            height_m: Some(random.within(0.1, 3.0) as f32),
            pitch_down_deg: random.within(-30.0, 60.0) as f32,
            roll_deg: random.within(-30.0, 30.0) as f32,
            ..Mount::default()
        };
        let frame = VehicleFrame::new(&mount).unwrap();
        let rays = Rays::new(&pair, &frame);
        depth.configure(&pair, 0, 160);
        let (width, height) = (pair.width as usize, pair.height as usize);
        // A slanted plane with noise, near or far; far ones have few steps of disparity.
        let base = if round % 2 == 0 { random.within(24.0, 200.0) } else { random.within(200.0, 2400.0) };
        let slopes = (random.within(-1.0, 1.0) * base / 400.0, random.within(-1.0, 1.0) * base / 400.0);
        let noise = 1 + random.below(8);
        let pixels: Vec<_> = (0..width * height)
            .map(|i| {
                let steps = base + slopes.0 * (i % width) as f64 + slopes.1 * (i / width) as f64;
                DisparityPixel::from_steps((steps + f64::from(random.below(noise))).clamp(8.0, 2540.0) as u16)
            })
            .collect();
        stage.configure(&SurfaceSettings::default(), width, height).unwrap();
        stage.run(DisparityPicture::new(&pixels, width), &depth, &rays);

        let scale = f64::from(pair.focal_px) * f64::from(pair.baseline_m);
        let rotation = Matrix3::from_fn(|i, j| f64::from(frame.rows()[i][j]));
        let origin = Vector3::new(0.0, 0.0, f64::from(frame.camera_height_m()));
        let mut points = vec![Vec::new(); stage.table().len()];
        for (i, pixel) in pixels.iter().enumerate() {
            let Some(place) = stage.place_at(i % width, i / width) else { continue };
            let z = scale / (f64::from(pixel.steps()) / 16.0 + f64::from(pair.disparity_offset_px));
            let right = ((i % width) as f64 - f64::from(pair.cx)) / f64::from(pair.focal_px);
            let down = ((i / width) as f64 - f64::from(pair.cy)) / f64::from(pair.focal_px);
            points[place].push(origin + rotation * Vector3::new(right, down, 1.0) * z);
        }
        for (surface, points) in stage.table().iter().zip(&points) {
            let (mean, covariance) = errors(points, &surface.points, origin);
            worst_mean = worst_mean.max(mean);
            worst_covariance = worst_covariance.max(covariance);
            surfaces += 1;
            // Distances have 14 to 16 bits: that shows where a long lens sees a small surface, whose extent is then a
            // hundredth of its distance.
            coarse += usize::from(covariance > 1.0e-3);
            assert!(mean < 1.0e-4 && covariance < 5.0e-3, "round {round}: {mean:.1e}, {covariance:.1e}, {pair:?}");
        }
    }
    std::println!("{surfaces} surfaces: mean within {worst_mean:.1e}, covariance within {worst_covariance:.1e}");
    std::println!("{coarse} covariances are off by more than 1e-3");
    assert!(surfaces > 5000 && coarse * 100 < surfaces, "{coarse} of {surfaces}");
}

#[test]
fn extremes_do_not_overflow() {
    let mut rays = Rays::UNSET;
    (rays.along_row, rays.along_column) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    // The largest distance in 16 bits, or none, in every pixel of a whole tile.
    for near in [0, u32::from(u16::MAX)] {
        let mut moments = Moments::ZERO;
        for y in -16..16 {
            let row = (-16..16).map(|x| if x < 0 { near } else { u32::from(u16::MAX) });
            moments.add(&RowMoments::of(row, 16), y);
        }
        assert_eq!(moments.pixels(), 1024);
        let scatter = moments.scatter(&rays, 8000.0, 8000.0, 1.0e3);
        let finite =
            |c: &crate::planes::SymmetricMatrix3| [c.xx, c.xy, c.xz, c.yy, c.yz, c.zz].iter().all(|c| c.is_finite());
        assert!(finite(&scatter.covariance) && scatter.mean_m.iter().all(|m| m.is_finite()), "{scatter:?}");
    }
    // The farthest distance that any calibration can have, and the nearest, in one picture.
    let pair = RectifiedPair { width: 32, height: 32, focal_px: 1.0e5, cx: -1.0e5, baseline_m: 100.0, ..PAIR };
    let pair = RectifiedPair { disparity_offset_px: 0.0, ..pair };
    let mut depth = Box::new(DepthTable::<2048>::new());
    depth.configure(&pair, 0, 2047);
    let mut stage = Box::new(Surfaces::<1024, 8>::new());
    let settings = SurfaceSettings { step_sixteenths: 1024, ..SurfaceSettings::default() };
    stage.configure(&settings, 32, 32).unwrap();
    for pixels in [[1, 1], [1, 32_751], [32_751, 32_751], [1, 1024]] {
        let pixels: Vec<_> = (0..1024).map(|i| DisparityPixel::from_steps(pixels[i / 32 % 2])).collect();
        stage.run(
            DisparityPicture::new(&pixels, 32),
            &depth,
            &Rays::new(&pair, &crate::test_world::World::level(1.0, 0.0, 0.0).frame()),
        );
        for surface in stage.table() {
            assert!(surface.points.mean_m.iter().chain(&surface.normal).all(|m| m.is_finite()), "{surface:?}");
        }
    }
}

#[test]
fn moments_of_nothing_are_nothing() {
    let scatter = Moments::ZERO.scatter(&rays(), 10.0, 10.0, 1.0);
    assert_eq!(scatter.covariance, crate::planes::SymmetricMatrix3::default());
    assert!(scatter.mean_m.iter().all(|m| m.is_finite()));
}
