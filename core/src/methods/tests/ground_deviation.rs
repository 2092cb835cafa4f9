//! The plane against the truth of worlds that it is estimated in, and deviations against rays that meet it.

use std::{vec, vec::Vec};

use super::*;
use crate::{
    disparity::{DisparityPixel, Reason},
    geometry::{Mount, Place},
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

/// A pair for small pictures, from a camera that looks at nothing but the ground.
fn small_pair(width: u32, height: u32) -> RectifiedPair {
    let (cx, cy) = (width as f32 / 2.0 - 0.5, height as f32 / 2.0 - 0.5);
    RectifiedPair { width, height, focal_px: 60.0, cx, cy, ..PAIR }
}

fn with(pair: RectifiedPair, settings: GroundDeviationSettings, ground: GroundSettings) -> GroundDeviation {
    let world = World { pair, ..World::level(1.2, 45.0, 0.0) };
    let mut detector = GroundDeviation::new();
    detector.configure(&settings, &ground, &pair, &world.frame(), true).unwrap();
    detector
}

#[test]
fn samples_are_every_so_many_pixels_from_the_middle_of_the_first_ones_on() {
    for (width, height, samples, stride) in
        [(40, 30, 1200, 1), (40, 30, 1199, 2), (41, 31, 336, 2), (41, 31, 335, 3), (40, 30, 100, 4), (7, 300, 100, 6)]
    {
        let settings = GroundDeviationSettings { samples, ..GroundDeviationSettings::default() };
        let detector = with(small_pair(width, height), settings, GroundSettings::default());
        let (width, height) = (width as usize, height as usize);
        // A pixel says where it lies; one of five has no disparity.
        let steps = |place: usize| if place % 5 == 3 { 0 } else { place as u16 + 1 };
        let pixels: Vec<_> = (0..width * height).map(|place| DisparityPixel::from_bits(steps(place))).collect();
        let found: Vec<_> = detector.samples(DisparityPicture::new(&pixels, width)).collect();
        let mut expected = vec![];
        for place in 0..width * height {
            let (x, y) = (place % width, place / width);
            if x % stride == stride / 2 && y % stride == stride / 2 && steps(place) != 0 {
                expected.push((x as i32 - width as i32 / 2, y as i32 - height as i32 / 2, steps(place)));
            }
        }
        assert_eq!(found, expected, "{width} x {height}, {samples} samples");
        assert!(expected.len() <= usize::from(samples));
    }
}

#[test]
fn pixels_are_chosen_all_over_the_picture() {
    let detector = with(small_pair(40, 30), GroundDeviationSettings::default(), GroundSettings::default());
    let steps = |place: usize| if place.is_multiple_of(2) { 0 } else { place as u16 + 1 };
    let pixels: Vec<_> = (0..1200).map(|place| DisparityPixel::from_bits(steps(place))).collect();
    let picture = DisparityPicture::new(&pixels, 40);
    let mut random = Choice(SEED);
    let mut times = vec![0; 1200];
    for _ in 0..60_000 {
        // Eight tries fail one time in 256.
        let Some((u, v, steps)) = detector.choose(picture, &mut random) else { continue };
        let place = usize::from(steps) - 1;
        assert_eq!((u, v), ((place % 40) as i32 - 20, (place / 40) as i32 - 15));
        times[place] += 1;
    }
    // A hundred each, and those that have no disparity never.
    let of = |odd: usize| times.iter().skip(odd).step_by(2);
    assert!(of(0).all(|&times| times == 0) && of(1).all(|times| (55..150).contains(times)), "{times:?}");
    let nothing = vec![DisparityPixel::none(Reason::LowTexture); 1200];
    assert_eq!(detector.choose(DisparityPicture::new(&nothing, 40), &mut random), None);
}

/// Source: the first numbers of the reference implementation from 1234567 on.
#[test]
fn choices_are_those_of_splitmix64() {
    let expected: [u64; 5] = [
        6_457_827_717_110_365_317,
        3_203_168_211_198_807_973,
        9_817_491_932_198_370_423,
        4_593_380_528_125_082_431,
        16_408_922_859_458_223_821,
    ];
    let mut random = Choice(1_234_567);
    for number in expected {
        assert_eq!(random.below(1 << 32) as u64, number >> 32);
    }
    // Another one of the kind, from the same beginning on.
    let (mut random, mut other) = (Choice(0x5eed_013a), Random::seeded("choices", 0x5eed_013a));
    assert!((0..200).all(|_| random.below(1 << 32) as u64 == other.next() >> 32));
    assert!((0..100).all(|_| random.below(7) < 7 && random.below(1) == 0 && random.below(0) == 0));
}

#[test]
fn a_plane_is_ground_within_the_limits_of_tilt_and_height() {
    let pair = small_pair(40, 30);
    let frame = World { pair, ..World::level(0.3, 45.0, 0.0) }.frame();
    let tilted = |deg: f64| [0.0, deg.to_radians().sin() as f32, deg.to_radians().cos() as f32];
    for height_known in [true, false] {
        let mut detector = GroundDeviation::new();
        let ground = GroundSettings { max_tilt_deg: 15.0, height_tolerance_m: 0.5, ..GroundSettings::default() };
        detector.configure(&GroundDeviationSettings::default(), &ground, &pair, &frame, height_known).unwrap();
        for tilt_deg in [-30.0, -15.2, -14.8, 0.0, 14.8, 15.2, 30.0] {
            for height_m in [-0.15_f32, -0.01, 0.01, 0.04, 0.06, 0.3, 0.79, 0.81, 3.0] {
                let normal = tilted(tilt_deg);
                // Below the camera along the normal; above it, along its opposite.
                let sign = height_m.signum();
                let plane =
                    DisparityPlane::of_ground(normal.map(|n| n * sign), height_m.abs(), &pair, &frame, centre(&pair));
                let found = detector.plausible(&plane);
                let high = if height_known { height_m < 0.8 } else { height_m > 0.05 };
                let can_be = tilt_deg.abs() < 15.0 && high && height_m > 0.0;
                assert_eq!(found.is_some(), can_be, "{tilt_deg} degrees, {height_m} m, known: {height_known}");
                if let Some((n, height)) = found {
                    let off = (0..3).map(|i| (n[i] - normal[i]).abs()).fold((height - height_m).abs(), f32::max);
                    assert!(off < 1.0e-4, "{n:?}, not {normal:?}, {height} m, not {height_m} m");
                }
            }
        }
    }
}

#[test]
fn limits_of_deviation_are_those_of_the_settings_or_of_the_noise() {
    let settings =
        GroundDeviationSettings { deviation_px: 2.0, deviation_sigmas: 3.0, ..GroundDeviationSettings::default() };
    let detector = with(small_pair(40, 30), settings, GroundSettings::default());
    for (noise_steps, limit) in [(0.0, 32), (10.0, 32), (12.0, 36)] {
        let plane = DisparityPlane { at: 400.0, along_u: 2.0, along_v: 5.0 };
        let on_plane = |place: usize| 400 + 2 * (place as i32 % 40 - 20) + 5 * (place as i32 / 40 - 15);
        for (off, class) in [
            (-limit - 1, OTHER),
            (-limit, GROUND),
            (-3, GROUND),
            (0, GROUND),
            (limit - 1, GROUND),
            (limit, GROUND),
            (limit + 1, OBSTACLE),
        ] {
            let steps = |place| if place == 77 { 0 } else { (on_plane(place) + off) as u16 };
            let pixels: Vec<_> = (0..1200).map(|place| DisparityPixel::from_bits(steps(place))).collect();
            let mut codes = vec![9; 1200];
            let ground = GroundDisparity { plane, noise_steps };
            detector.classify(DisparityPicture::new(&pixels, 40), &ground, &mut codes);
            assert_eq!(codes.remove(77), OTHER, "no disparity");
            assert!(codes.iter().all(|&code| code == class), "{off} of {limit}: {codes:?}");
        }
    }
    // Where the ground is as far away as can be, no disparity still is none.
    let far = GroundDisparity { plane: DisparityPlane { at: 5.0, ..DisparityPlane::default() }, noise_steps: 0.0 };
    let (mut codes, nothing) = (vec![9; 1200], vec![DisparityPixel::none(Reason::NotUnique); 1200]);
    detector.classify(DisparityPicture::new(&nothing, 40), &far, &mut codes);
    assert!(codes.iter().all(|&code| code == OTHER));
}

#[test]
fn support_and_scatter_are_those_of_the_pixels_near_the_plane() {
    let mut random = Random::seeded("support", 0x5eed_0133);
    // In the first picture every fourth column has no disparities.
    for (offset_px, tilt, samples, support) in
        [(0.0, 0.0, 4800, 2400), (-2.5, 0.06, 4800, 3200), (1.5, -0.05, 1200, 3200)]
    {
        let pair = RectifiedPair { disparity_offset_px: offset_px, ..small_pair(80, 60) };
        let mut world = World { pair, ..World::empty(1.2, 45.0, 0.0) };
        let middle = Point::new(0.0, 0.0, 0.1);
        world.patches.push(Patch::across(Point::new(tilt, -tilt, 1.0), middle, 100.0));
        let truth = world.patches[0].normal();
        let mut pixels = world.render();
        assert!(pixels.iter().all(|pixel| pixel.has_value()), "nothing but ground");
        let clean: Vec<_> = pixels.iter().map(|pixel| pixel.steps()).collect();
        // Of three pixels two lie near the plane, and the third just beyond what is near, and on one side of it.
        let mut squares = (0.0_f64, 0.0_f64);
        for (i, pixel) in pixels.iter_mut().enumerate() {
            if support == 2400 && i % 4 == 0 {
                *pixel = DisparityPixel::none(Reason::LowTexture);
                continue;
            }
            let far = (i % 80 + i / 80) % 3 == 0;
            let noise = if far { random.within(17.0, 22.0) } else { random.within(-5.0, 5.0) };
            *pixel = DisparityPixel::from_steps((f64::from(clean[i]) + noise).round() as u16);
            if !far {
                // A point that is off along its ray is off the plane by the same share of the height.
                let (u, v) = ((i % 80) as f64, (i / 80) as f64);
                let ray = world.direction(u, v);
                let z = 60.0 * 0.2 / (f64::from(pixel.steps()) / 16.0 + f64::from(offset_px));
                let off = truth.dot(&(Point::new(0.0, 0.0, 1.2) + ray * z - middle));
                squares = (squares.0 + off * off, squares.1 + 1.0);
            }
        }
        let picture = DisparityPicture::new(&pixels, 80);
        let settings = GroundDeviationSettings { samples, ..GroundDeviationSettings::default() };
        let under = |permille: f32| {
            let ground = GroundSettings { min_support_permille: permille, ..GroundSettings::default() };
            with(pair, settings, ground).ground(picture)
        };
        let (_, found) = under(1.0).expect("the ground is seen");
        assert_eq!(found.support, support, "two of three pixels");
        let (rms, told) = ((squares.0 / squares.1).sqrt(), f64::from(found.rms_m));
        assert!((told / rms - 1.0).abs() < 0.08, "{told} m off the plane, not {rms} m");
        let (height, offset) = (truth.dot(&(Point::new(0.0, 0.0, 1.2) - middle)), truth.dot(&middle));
        assert!((f64::from(found.camera_height_m) - height).abs() < 0.01, "{found:?}, not {height} m");
        assert!((f64::from(found.offset_m) - offset).abs() < 0.01, "{found:?}, not {offset} m");
        // 3200 of 4800 are 666.7 permille; just as many as there have to be are enough.
        let permille = support as f32 / 4.8;
        assert!(under(permille - 0.7).is_some() && under(permille + 0.7).is_none());
        assert!(support != 2400 || under(500.0).is_some());
        // In the frame of a vehicle that the camera does not stand in the middle of, the plane is the same, moved.
        let mount = Mount { forward_m: 1.5, left_m: -0.7, ..world.mount() };
        let mut placed = GroundDeviation::new();
        let (ground, frame) = (GroundSettings::default(), VehicleFrame::new(&mount).unwrap());
        placed.configure(&settings, &ground, &pair, &frame, true).unwrap();
        let (_, moved) = placed.ground(picture).unwrap();
        let expected = found.moved(&Place::new(&mount));
        assert!((moved.offset_m - expected.offset_m).abs() < 1.0e-4, "{moved:?}, not {expected:?}");
        assert!((moved.camera_height_m - found.camera_height_m).abs() < 1.0e-4);
    }
}

#[test]
fn without_a_pair_nothing_is_promised_and_no_pixel_gets_a_class() {
    let (detector, world) = (GroundDeviation::new(), World::level(1.0, 10.0, 0.0));
    assert!(detector.of_mount().is_none());
    let promised = configured(&world).of_mount().expect("a pair on a mount");
    let pixels = world.render();
    let mut codes = vec![9; pixels.len()];
    detector.classify(DisparityPicture::new(&pixels, 320), &promised, &mut codes);
    assert!(codes.iter().all(|code| *code == 9));
}
