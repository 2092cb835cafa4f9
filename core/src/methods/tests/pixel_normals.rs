//! Classes of pixels against planes fitted one by one in f64, and against the truth of worlds.

use std::{boxed::Box, collections::VecDeque, vec, vec::Vec};

use nalgebra::{Matrix3, Vector3};

use super::*;
use crate::{
    disparity::Reason,
    test_random::Random,
    test_world::{PAIR, Patch, Point, World},
};

fn classes(world: &World, pixels: &[DisparityPixel], settings: &PixelNormalSettings) -> Vec<u8> {
    let mut detector = Box::new(PixelNormals::<320>::new());
    detector.configure(settings, &SurfaceSettings::default(), 320).unwrap();
    let mut codes = vec![9; pixels.len()];
    let picture = DisparityPicture::new(pixels, 320);
    detector.classify(picture, &world.pair, &world.frame(), &world.depth(), &mut codes);
    codes
}

fn disturb(pixels: &mut [DisparityPixel], random: &mut Random, noise: f64, holes: u32) {
    for pixel in pixels.iter_mut().filter(|pixel| pixel.has_value()) {
        let steps = f64::from(pixel.steps()) + random.within(-noise, noise);
        *pixel = match random.below(100) < holes {
            true => DisparityPixel::none(Reason::NotUnique),
            false => DisparityPixel::from_steps(steps.round().clamp(1.0, 1500.0) as u16),
        };
    }
}

/// Ground, a box, a wall and a ramp.
fn scene(random: &mut Random) -> World {
    let mut world = World::level(random.within(0.8, 1.4), random.within(8.0, 20.0), random.within(-4.0, 4.0));
    let yaw_deg = random.within(0.0, 90.0);
    world.add_box([2.5, -0.3, 0.0], [3.1, 0.5, random.within(0.4, 1.0)], yaw_deg);
    world.patches.push(Patch::new([7.0, 0.0, 0.0], [0.0, 50.0, 0.0], [0.0, 0.0, 50.0]));
    world.patches.push(Patch::new([3.4, -1.6, 0.4], [0.0, 0.7, 0.0], [0.5, 0.0, 0.4]));
    world
}

/// What a window says of its pixel, worked out by itself.
enum Plain {
    /// Too few pixels, or no plane.
    Nothing,
    /// At a limit: either may be told.
    Unsure,
    Class(u8),
}

fn plain(world: &World, pixels: &[DisparityPixel], at: usize, settings: &PixelNormalSettings) -> Plain {
    let radius = i32::from(settings.window / 2);
    let (x, y) = ((at % 320) as i32, (at / 320) as i32);
    let mut points = Vec::new();
    for v in -radius..=radius {
        for u in -radius..=radius {
            let inside = (0..320).contains(&(x + u)) && (0..240).contains(&(y + v));
            let steps = if inside { pixels[((y + v) * 320 + x + u) as usize].steps() } else { 0 };
            if steps != 0 {
                points.push((Vector3::new(f64::from(u), f64::from(v), 1.0), f64::from(steps)));
            }
        }
    }
    let least = f64::from(settings.window).powi(2) * f64::from(settings.min_filled_percent) / 100.0;
    if (points.len() as f64) < least || points.len() < 3 {
        return Plain::Nothing;
    }
    let left: Matrix3<f64> = points.iter().map(|(row, _)| row * row.transpose()).sum();
    let right: Vector3<f64> = points.iter().map(|(row, d)| row * *d).sum();
    let Some(plane) = left.try_inverse().map(|inverse| inverse * right) else { return Plain::Nothing };
    let squares = points.iter().map(|(row, d)| (row.dot(&plane) - d).powi(2)).sum::<f64>() / points.len() as f64;
    let rms = squares.sqrt() / 16.0 / f64::from(settings.max_rms_px);
    if (rms - 1.0).abs() < 1.0e-3 {
        return Plain::Unsure;
    }
    if rms > 1.0 {
        return Plain::Nothing;
    }
    // Three points of the plane in the world; a disparity may be that of a point behind the camera.
    let corner = |u: f64, v: f64| {
        let d = plane.x * u + plane.y * v + plane.z;
        (d > 0.1).then(|| world.direction(f64::from(x) + u, f64::from(y) + v) * (16.0 * 228.0 * 0.2 / d))
    };
    let (Some(a), Some(b), Some(c)) = (corner(0.0, 0.0), corner(0.01, 0.0), corner(0.0, 0.01)) else {
        return Plain::Unsure;
    };
    let angle = (b - a).cross(&(c - a)).normalize().z.abs().acos().to_degrees();
    match angle {
        angle if (angle - 30.0).abs() < 0.1 || (angle - 45.0).abs() < 0.1 => Plain::Unsure,
        angle if angle < 30.0 => Plain::Class(HORIZONTAL),
        angle if angle < 45.0 => Plain::Class(SLANTED),
        _ => Plain::Class(VERTICAL),
    }
}

/// Whether a pixel with that class of its own lies within reach, along pixels of contiguous disparity.
fn within_reach(pixels: &[DisparityPixel], own: &[Plain], from: usize, class: u8, reach: usize) -> bool {
    let mut away = std::collections::HashMap::from([(from, 0)]);
    let mut open = VecDeque::from([from]);
    while let Some(at) = open.pop_front() {
        if at != from && matches!(own[at], Plain::Unsure) || matches!(own[at], Plain::Class(own) if own == class) {
            return true;
        }
        if away[&at] == reach {
            continue;
        }
        let (x, y) = (at % 320, at / 320);
        let sides = [(x > 0).then(|| at - 1), (x < 319).then(|| at + 1), at.checked_sub(320), Some(at + 320)];
        for next in sides.into_iter().flatten().filter(|&next| next < pixels.len() && y < 240) {
            let (a, b) = (pixels[at].steps(), pixels[next].steps());
            if b != 0 && a.abs_diff(b) <= 16 && !away.contains_key(&next) {
                away.insert(next, away[&at] + 1);
                open.push_back(next);
            }
        }
    }
    false
}

#[test]
fn classes_are_those_of_a_plane_fitted_around_each_pixel() {
    let mut random = Random::seeded("pixel normals", 0x5eed_0129);
    let mut counts = [0; 4];
    let mut adopted = 0;
    for (window, min_filled_percent) in [(3, 60), (7, 0), (11, 50), (21, 30)] {
        let settings = PixelNormalSettings { window, min_filled_percent, ..PixelNormalSettings::default() };
        let world = scene(&mut random);
        let mut pixels = world.render();
        disturb(&mut pixels, &mut random, 3.0, 20);
        // Planes are fitted one by one in a part of the picture only.
        let far = 70 * 320;
        pixels[..far].fill(DisparityPixel::none(Reason::LowTexture));
        let codes = classes(&world, &pixels, &settings);
        let own: Vec<Plain> = (0..pixels.len())
            .map(|at| if pixels[at].has_value() { plain(&world, &pixels, at, &settings) } else { Plain::Nothing })
            .collect();
        for (at, &code) in codes.iter().enumerate() {
            counts[usize::from(code)] += 1;
            match own[at] {
                Plain::Class(class) => assert_eq!(code, class, "({}, {}), window {window}", at % 320, at / 320),
                Plain::Nothing if !pixels[at].has_value() => assert_eq!(code, NONE),
                Plain::Nothing if code != NONE => {
                    adopted += 1;
                    let found = within_reach(&pixels, &own, at, code, usize::from(window) - 1);
                    assert!(found, "({}, {}), window {window}: nothing to take {code} from", at % 320, at / 320);
                }
                Plain::Nothing | Plain::Unsure => {}
            }
        }
    }
    assert!(counts.iter().all(|&pixels| pixels > 2000) && adopted > 3000, "{counts:?}, {adopted}");
}

#[test]
fn classes_are_those_of_the_world_up_to_the_edges_of_things() {
    let mut random = Random::seeded("true classes", 0x5eed_012a);
    let (mut right, mut all, mut at_edges) = (0, 0, [0; 3]);
    for _ in 0..6 {
        let world = scene(&mut random);
        let mut pixels = world.render();
        disturb(&mut pixels, &mut random, 2.0, 5);
        let codes = classes(&world, &pixels, &PixelNormalSettings::default());
        let truth = |x: usize, y: usize| {
            let (z, patch) = world.hit(x as f64, y as f64)?;
            let angle = patch.normal().z.clamp(-1.0, 1.0).acos().to_degrees();
            Some((
                if angle < 30.0 {
                    HORIZONTAL
                } else if angle < 45.0 {
                    SLANTED
                } else {
                    VERTICAL
                },
                z,
            ))
        };
        for y in (3..237).step_by(2) {
            for x in (3..317).step_by(2) {
                let Some((class, z)) = truth(x, y).filter(|_| pixels[y * 320 + x].has_value()) else { continue };
                // Far away a window holds too little of a plane for the noise.
                if z > 8.0 {
                    continue;
                }
                let jumps = [(x - 3, y), (x + 3, y), (x, y - 3), (x, y + 3)].map(|(x, y)| truth(x, y));
                let edge = jumps.iter().any(|beside| beside.is_none_or(|(_, far)| (far - z).abs() > 0.3 * z));
                let found = codes[y * 320 + x] == class;
                all += 1;
                right += usize::from(found);
                at_edges[0] += usize::from(edge);
                at_edges[1] += usize::from(edge && found);
                at_edges[2] += usize::from(edge && codes[y * 320 + x] == NONE);
            }
        }
    }
    std::println!("{right} of {all} pixels right; at edges {at_edges:?}: all, right, without class");
    assert!(right as f64 >= 0.95 * all as f64, "{right} of {all}");
    assert!(at_edges[0] > 500 && at_edges[1] as f64 >= 0.7 * at_edges[0] as f64, "{at_edges:?}");
}

#[test]
fn a_level_plane_tilted_towards_the_camera_has_the_class_of_its_angle() {
    for (angle, class) in [(10.0, HORIZONTAL), (28.0, HORIZONTAL), (33.0, SLANTED), (43.0, SLANTED), (47.0, VERTICAL)] {
        let mut world = World::empty(1.2, 15.0, 3.0);
        let (sin, cos) = f64::to_radians(angle).sin_cos();
        let middle = Point::new(0.0, 0.0, 1.2) + world.direction(159.5, 119.5) * 2.0;
        world.patches.push(Patch::across(Point::new(-sin, 0.0, cos), middle, 100.0));
        let codes = classes(&world, &world.render(), &PixelNormalSettings::default());
        let around = (80..160).flat_map(|y| (100..220).map(move |x| y * 320 + x));
        let wrong = around.filter(|&at| codes[at] != class).count();
        assert!(wrong < 100, "{angle} degrees: {wrong} pixels are not {class}");
    }
    assert_eq!((PAIR.width, PAIR.height), (320, 240));
}

#[test]
fn rows_that_are_wider_than_there_is_room_for_are_refused() {
    let mut detector = PixelNormals::<8>::new();
    let (settings, surfaces) = (PixelNormalSettings::default(), SurfaceSettings::default());
    assert_eq!(detector.configure(&settings, &surfaces, 8), Ok(()));
    let refused = detector.configure(&settings, &surfaces, 9).unwrap_err();
    let problem = ConfigProblem::OverCapacity { needed: 9, capacity: 8 };
    assert_eq!((refused.field, refused.problem), ("calibration.width", problem));
}

#[test]
fn a_plane_has_the_class_of_its_angle_wherever_it_faces() {
    let mut random = Random::seeded("angles", 0x5eed_0137);
    let mut detector = PixelNormals::<8>::new();
    detector.configure(&PixelNormalSettings::default(), &SurfaceSettings::default(), 8).unwrap();
    for round in 0..400 {
        let world = World::empty(1.0, random.within(-30.0, 40.0), random.within(-15.0, 15.0));
        let (pair, frame) = (&world.pair, &world.frame());
        let at = (random.within(0.0, 320.0) as f32, random.within(0.0, 240.0) as f32);
        for (angle, class) in [
            (0.0, HORIZONTAL),
            (29.7, HORIZONTAL),
            (30.3, SLANTED),
            (44.7, SLANTED),
            (45.3, VERTICAL),
            (90.0, VERTICAL),
            (150.3, HORIZONTAL),
        ] {
            let (sin, cos) = f64::to_radians(angle).sin_cos();
            let (aside, ahead) = random.within(0.0, std::f64::consts::TAU).sin_cos();
            let normal = Point::new(sin * ahead, sin * aside, cos).map(|n| n as f32).into();
            let plane = DisparityPlane::of_ground(normal, random.within(0.5, 3.0) as f32, pair, frame, at);
            assert_eq!(detector.class(&plane, pair, frame, at), class, "round {round}: {angle} degrees");
        }
    }
    let world = World::level(1.0, 0.0, 0.0);
    assert_eq!(detector.class(&DisparityPlane::default(), &world.pair, &world.frame(), (9.0, 9.0)), NONE);
}

#[test]
fn pixels_without_a_class_take_that_of_the_nearest_one_on_their_surface() {
    const SIZE: (usize, usize) = (23, 11);
    let mut random = Random::seeded("nearest classes", 0x5eed_0138);
    let mut taken = 0;
    for window in [3_u16, 7, 11, 21] {
        let mut detector = PixelNormals::<23>::new();
        let settings = PixelNormalSettings { window, ..PixelNormalSettings::default() };
        detector.configure(&settings, &SurfaceSettings { step_sixteenths: 16, ..Default::default() }, 23).unwrap();
        for _ in 0..7 {
            // Upright strips, one beside the other, whose disparities are just contiguous with the next, or just not; some have none,
            // and small disparities lie beside those.
            let (mut strips, mut steps, mut strip) = (vec![], vec![], 0);
            let mut value = 1 + random.below(8) as u16;
            while steps.len() < SIZE.0 {
                let wide = 1 + random.below(9) as usize;
                steps.extend((0..wide).map(|_| value));
                strips.extend((0..wide).map(|_| strip));
                let before = value;
                value = match random.below(4) {
                    0 => 0,
                    1 => before + 17,
                    2 if before > 17 => before - 17,
                    _ => before.max(1) + 15 + u16::from(before > 0),
                };
                let apart = before == 0 || value == 0 || before.abs_diff(value) > 16;
                strip += u16::from(apart);
            }
            let rare = 2 + random.below(60);
            let mut codes: Vec<u8> = (0..SIZE.0 * SIZE.1)
                .map(|at| match random.below(rare) {
                    0 if steps[at % SIZE.0] != 0 => 1 + random.below(3) as u8,
                    _ => NONE,
                })
                .collect();
            let before = codes.clone();
            let pixels: Vec<_> = (0..codes.len()).map(|at| DisparityPixel::from_bits(steps[at % SIZE.0])).collect();
            let picture = DisparityPicture::new(&pixels, SIZE.0);
            detector.adopt(picture, &|pixel: &DisparityPixel| pixel.steps(), &mut codes);
            for at in 0..codes.len() {
                let (x, y) = (at % SIZE.0, at / SIZE.0);
                let away = |other: &usize| (other % SIZE.0).abs_diff(x) + (other / SIZE.0).abs_diff(y);
                let beside = |other: &usize| before[*other] != NONE && strips[other % SIZE.0] == strips[x];
                let nearest = (0..codes.len()).filter(beside).map(|other| away(&other)).min();
                match nearest.filter(|&nearest| nearest < usize::from(window) && steps[x] != 0) {
                    None => assert_eq!(codes[at], NONE, "({x}, {y}), window {window}"),
                    Some(nearest) => {
                        let class = |other: usize| before[other] == codes[at];
                        let found = (0..codes.len()).filter(beside).filter(|other| away(other) == nearest);
                        assert!(found.into_iter().any(class), "({x}, {y}), window {window}: {}", codes[at]);
                        taken += usize::from(nearest > 0);
                    }
                }
            }
        }
    }
    assert!(taken > 1500, "{taken}");
}

#[test]
fn classes_of_some_pixels_are_those_of_planes_fitted_around_them() {
    let mut random = Random::seeded("some pixel normals", 0x5eed_0139);
    let world = World::empty(1.1, 14.0, 2.0);
    let mut counts = [0; 4];
    for (window, min_filled_percent) in [(3, 60), (3, 0), (7, 50), (11, 70)] {
        let settings = PixelNormalSettings { window, min_filled_percent, ..PixelNormalSettings::default() };
        // Planes in blocks of 40 x 30 pixels, the upper part of the picture without disparities.
        let blocks: Vec<[f64; 3]> = (0..64)
            .map(|_| [random.within(100.0, 900.0), random.within(-2.0, 2.0), random.within(-2.0, 9.0)])
            .collect();
        let pixels: Vec<DisparityPixel> = (0..320 * 240)
            .map(|at| {
                let (x, y) = (at % 320, at / 320);
                let [d, u, v] = blocks[y / 30 * 8 + x / 40];
                let steps = d + u * (x % 40) as f64 + v * (y % 30) as f64 + random.within(-4.0, 4.0);
                match y < 170 || random.below(100) < 30 {
                    true => DisparityPixel::none(Reason::LowTexture),
                    false => DisparityPixel::from_steps(steps.round().clamp(1.0, 1500.0) as u16),
                }
            })
            .collect();
        let codes = classes(&world, &pixels, &settings);
        for _ in 0..150 {
            let at = 170 * 320 + random.below(70 * 320) as usize;
            if !pixels[at].has_value() {
                assert_eq!(codes[at], NONE);
                continue;
            }
            if let Plain::Class(class) = plain(&world, &pixels, at, &settings) {
                assert_eq!(codes[at], class, "({}, {}), window {window}", at % 320, at / 320);
                counts[usize::from(class)] += 1;
            }
        }
    }
    assert!(counts[1..].iter().all(|&pixels| pixels > 10), "{counts:?}");
}

#[test]
fn a_plane_without_a_direction_has_no_class() {
    let world = World::level(1.0, 10.0, 0.0);
    let detector = Box::new(PixelNormals::<320>::new());
    for at in [(0.0, 0.0), (160.0, 120.0)] {
        assert_eq!(detector.class(&DisparityPlane::default(), &world.pair, &world.frame(), at), NONE);
    }
}

/// A class goes from pixel to pixel where both have disparities that are near to each other, and nowhere else.
#[test]
fn classes_are_adopted_along_contiguous_disparities_alone() {
    let mut detector = Box::new(PixelNormals::<320>::new());
    detector.configure(&PixelNormalSettings::default(), &SurfaceSettings::default(), 320).unwrap();
    let near = 320;
    let far = near + detector.step_sixteenths + 1;
    let adopted = |left: u16, right: u16| {
        let of = |steps| {
            if steps == 0 { DisparityPixel::none(Reason::NotUnique) } else { DisparityPixel::from_steps(steps) }
        };
        let pixels = [of(left), of(right)];
        let mut codes = [2, NONE];
        detector.adopt(DisparityPicture::new(&pixels, 2), &|pixel| pixel.steps(), &mut codes);
        codes[1] == 2
    };
    let found = [(near, near), (near, far), (0, near), (near, 0), (0, 0)].map(|(left, right)| adopted(left, right));
    assert_eq!(found, [true, false, false, false, false]);
}
