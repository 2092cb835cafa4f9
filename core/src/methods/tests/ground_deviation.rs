//! The plane against the truth of worlds that it is estimated in, and deviations against rays that meet it.

use std::{vec, vec::Vec};

use super::*;
use crate::{
    disparity::{DisparityPixel, Reason},
    test_random::Random,
    test_world::{PAIR, Patch, Point, World, ground},
};

fn configured(world: &World) -> GroundDeviation {
    let mut detector = GroundDeviation::new();
    let (settings, ground) = (GroundDeviationSettings::default(), GroundSettings::default());
    detector.configure(&settings, &ground, &world.pair, &world.frame(), true).unwrap();
    detector
}

/// Noise of half a pixel, and one of ten pixels anywhere.
fn disturb(pixels: &mut [DisparityPixel], random: &mut Random) {
    for pixel in pixels.iter_mut().filter(|pixel| pixel.has_value()) {
        let noise = random.within(-8.0, 8.0).round() as i32;
        let steps =
            if random.below(10) == 0 { 1 + random.below(1500) as i32 } else { i32::from(pixel.steps()) + noise };
        *pixel = DisparityPixel::from_steps(steps.clamp(1, 1500) as u16);
    }
}

#[test]
fn the_plane_is_that_of_the_ground_among_things_noise_and_false_matches() {
    let mut random = Random::seeded("consensus", 0x5eed_0123);
    let mut worst = (0.0_f64, 0.0_f64);
    for round in 0..40 {
        let mut world = World::empty(random.within(0.6, 2.0), random.within(5.0, 25.0), random.within(-6.0, 6.0));
        let normal = Point::new(random.within(-0.15, 0.15), random.within(-0.15, 0.15), 1.0);
        world.patches.push(Patch::across(normal, Point::new(0.0, 0.0, random.within(-0.2, 0.2)), 500.0));
        for _ in 0..4 {
            let (x, y) = (random.within(3.0, 9.0), random.within(-3.0, 3.0));
            world.add_box([x, y, -1.0], [x + 0.8, y + random.within(0.3, 2.0), random.within(0.5, 2.0)], 15.0);
        }
        let mut pixels = world.render();
        disturb(&mut pixels, &mut random);
        let picture = DisparityPicture::new(&pixels, 320);
        let detector = configured(&world);
        let (disparity, found) = detector.ground(picture).expect("the ground is seen");
        assert_eq!(detector.ground(picture), Some((disparity, found)), "the same picture gives the same plane");
        let truth = world.patches[0].normal();
        let tilt = Point::from(found.normal.map(f64::from));
        let tilt_deg = tilt.cross(&truth).norm().atan2(tilt.dot(&truth)).to_degrees();
        let height = truth.dot(&(Point::new(0.0, 0.0, world.height_m) - world.patches[0].middle));
        let off = (f64::from(found.camera_height_m) - height).abs() / height;
        worst = (worst.0.max(tilt_deg), worst.1.max(off));
        assert!(tilt_deg < 1.0 && off < 0.03, "round {round}: {tilt_deg} degrees, {off} of {height} m");
        assert!(found.height_m(found.normal.map(|n| n * found.offset_m)).abs() < 1.0e-4);
    }
    std::println!("tilt within {:.2} degrees, height within {:.1} %", worst.0, 100.0 * worst.1);
}

#[test]
fn deviations_are_those_from_where_each_ray_meets_the_ground() {
    let mut random = Random::seeded("deviations", 0x5eed_0124);
    let mut counts = [0; 3];
    for _ in 0..10 {
        let mut world = World::level(random.within(0.8, 1.6), random.within(5.0, 20.0), random.within(-5.0, 5.0));
        world.add_box([4.0, -1.0, 0.0], [5.0, 0.5, random.within(0.2, 1.5)], random.within(0.0, 90.0));
        // A ditch.
        world.patches[0].half_a *= 0.005;
        world.patches.push(ground(-0.5));
        let mut pixels = world.render();
        disturb(&mut pixels, &mut random);
        let picture = DisparityPicture::new(&pixels, 320);
        let detector = configured(&world);
        let (disparity, plane) = detector.ground(picture).expect("the ground is seen");
        let mut codes = vec![9; pixels.len()];
        detector.classify(picture, &disparity, &mut codes);
        let limit = f64::from(disparity.noise_steps * 3.0).max(16.0);
        let normal = Point::from(plane.normal.map(f64::from));
        for (i, (pixel, code)) in pixels.iter().zip(codes).enumerate() {
            let (u, v) = ((i % 320) as f64, (i / 320) as f64);
            let fall = -normal.dot(&world.direction(u, v)) / f64::from(plane.camera_height_m);
            let expected = 16.0 * f64::from(PAIR.focal_px) * f64::from(PAIR.baseline_m) * fall;
            let off = f64::from(pixel.steps()) - expected;
            let truth = match off {
                _ if !pixel.has_value() => OTHER,
                off if (off.abs() - limit).abs() < 0.3 => continue,
                off if off > limit => OBSTACLE,
                off if off < -limit => OTHER,
                _ => GROUND,
            };
            assert_eq!(code, truth, "({u}, {v}): {off} of {limit}");
            counts[usize::from(code)] += 1;
        }
    }
    assert!(counts.iter().all(|&pixels| pixels > 10_000), "{counts:?}");
}

#[test]
fn where_nothing_can_be_ground_there_is_none() {
    let world = World::level(1.2, 10.0, 0.0);
    let mut wall = World::empty(1.2, 10.0, 0.0);
    wall.patches.push(Patch::new([3.0, 0.0, 0.0], [0.0, 50.0, 0.0], [0.0, 0.0, 50.0]));
    let mut table = World::empty(1.2, 10.0, 0.0);
    table.patches.push(ground(0.6));
    let none = vec![DisparityPixel::none(Reason::LowTexture); 320 * 240];
    for pixels in [wall.render(), table.render(), none] {
        assert_eq!(configured(&world).ground(DisparityPicture::new(&pixels, 320)), None);
    }
    assert_eq!(GroundDeviation::new().ground(DisparityPicture::new(&world.render(), 320)), None);
    // The mount's own disparities stand in: those of level ground.
    let pixels: Vec<_> = world.render();
    let mut codes = vec![9; pixels.len()];
    let detector = configured(&world);
    detector.classify(DisparityPicture::new(&pixels, 320), &detector.of_mount().unwrap(), &mut codes);
    assert!(pixels.iter().zip(codes).all(|(pixel, code)| code == if pixel.has_value() { GROUND } else { OTHER }));
}
