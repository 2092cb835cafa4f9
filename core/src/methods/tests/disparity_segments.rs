//! Segments against union-find over all pixels.

use std::{boxed::Box, vec, vec::Vec};

use super::*;
use crate::{
    disparity::DisparityPixel,
    map::{MapGeometry, MapSettings},
    obstacles::ObstacleSettings,
    test_random::Random,
    test_world::{PAIR, Stages, World},
};

/// Number of the segment of each pixel that belongs to a surface: contiguous disparity, over the whole picture.
fn plain(pixels: &[DisparityPixel], stages: &Stages) -> Vec<Option<usize>> {
    let part = |i: usize| stages.surfaces.place_at(i % 320, i / 320).is_some();
    let mut segments = vec![None; pixels.len()];
    let mut count = 0;
    for start in 0..pixels.len() {
        if segments[start].is_some() || !part(start) {
            continue;
        }
        segments[start] = Some(count);
        let mut open = vec![start];
        while let Some(at) = open.pop() {
            let (x, y) = (at % 320, at / 320);
            let left = (x > 0).then(|| at - 1);
            let right = (x < 319).then(|| at + 1);
            let (above, below) = (at.checked_sub(320), (y < 239).then(|| at + 320));
            for next in [left, right, above, below].into_iter().flatten() {
                let apart = pixels[at].steps().abs_diff(pixels[next].steps());
                if segments[next].is_none() && part(next) && apart <= 16 {
                    segments[next] = Some(count);
                    open.push(next);
                }
            }
        }
        count += 1;
    }
    segments
}

#[test]
fn every_segment_has_one_class_by_how_high_it_reaches() {
    let mut random = Random::seeded("segments", 0x5eed_0128);
    let mut classes = [0; 2];
    for round in 0..12 {
        let mut world = World::level(random.within(0.8, 1.4), random.within(8.0, 20.0), 0.0);
        for _ in 0..3 {
            // Some stand on the ground, some hang above it.
            let (x, y, z) = (random.within(2.5, 6.0), random.within(-2.0, 2.0), [0.0, 0.4][random.below(2) as usize]);
            let top = z + random.within(0.1, 1.2);
            world.add_box([x, y, z], [x + 0.5, y + random.within(0.3, 1.5), top], random.within(0.0, 45.0));
        }
        let pixels = world.render();
        let picture = DisparityPicture::new(&pixels, 320);
        let (ground, obstacles) = (GroundSettings::default(), ObstacleSettings::default());
        let mut stages = Stages::new(&world.mount(), &ground, &obstacles);
        stages.surfaces.run(picture, &stages.depth, &stages.rays);
        let mut detector = DisparitySegments::new();
        detector.configure(&DisparitySegmentSettings::default(), &ground, 320 * 240).unwrap();
        let found = detector.run(&mut stages.surfaces, &mut stages.regions, picture, &stages.frame);
        let segments = plain(&pixels, &stages);
        let count = segments.iter().flatten().max().map_or(0, |last| last + 1);
        let mut of_ground = 0;
        for segment in 0..count {
            let members: Vec<usize> = (0..pixels.len()).filter(|&i| segments[i] == Some(segment)).collect();
            let class = |i: usize| stages.surfaces.surface_at(i % 320, i / 320).unwrap().class;
            let first = class(members[0]);
            assert!(members.iter().all(|&i| class(i) == first), "round {round}: a segment has two classes");
            let height = |&i: &usize| {
                let z = 16.0 * 228.0 * 0.2 / f64::from(pixels[i].steps());
                world.height_m + world.direction((i % 320) as f64, (i / 320) as f64).z * z
            };
            let mut heights: Vec<f64> = members.iter().map(height).collect();
            heights.sort_by(f64::total_cmp);
            // The extent is told from the moments: what is clear whichever way it is told must be right.
            let (most, all) = (heights[heights.len() * 95 / 100], heights[heights.len() - 1]);
            if all < 0.2 {
                assert_eq!(first, SurfaceClass::Ground, "round {round}: {all} m high");
                of_ground += members.len();
                classes[0] += 1;
            } else if most > 0.4 {
                assert_eq!(first, SurfaceClass::Vertical, "round {round}: {most} m high");
                classes[1] += 1;
            }
        }
        let level = GroundPlane::of_mount(&stages.frame);
        assert_eq!(found.is_some(), of_ground as f32 >= 0.002 * 320.0 * 240.0, "round {round}");
        assert!(found.is_none_or(|found| found.normal == level.normal && found.support as usize >= of_ground));
    }
    assert!(classes[0] >= 3 && classes[1] > 12, "{classes:?}");
}

#[test]
fn a_segment_is_judged_by_its_top_and_by_its_middle() {
    let mut detector = DisparitySegments::new();
    let settings = DisparitySegmentSettings { ground_tolerance_m: 0.15, min_height_m: 0.25 };
    detector.configure(&settings, &GroundSettings::default(), 1).unwrap();
    let level = GroundPlane::of_mount(&World::level(1.0, 12.0, 3.0).frame());
    // Points spread evenly over a height are as high as their mean and half of that.
    let surface = |low: f32, high: f32, weight: f32| {
        let mut points = Scatter { weight, mean_m: [5.0, 1.0, (low + high) / 2.0], ..Scatter::default() };
        (points.covariance.xx, points.covariance.zz) = (0.3, (high - low) * (high - low) / 12.0);
        Surface { points, ..Surface::default() }
    };
    for (members, class) in [
        (vec![surface(0.0, 0.24, 50.0)], SurfaceClass::Ground),
        (vec![surface(0.0, 0.26, 50.0)], SurfaceClass::Vertical),
        (vec![surface(-0.4, 0.26, 50.0)], SurfaceClass::Vertical),
        (vec![surface(-0.14, -0.14, 50.0)], SurfaceClass::Ground),
        (vec![surface(-0.16, -0.16, 50.0)], SurfaceClass::Horizontal),
        (vec![surface(0.16, 0.16, 50.0)], SurfaceClass::Horizontal),
        // The top is that of the highest part; the middle is that of all points.
        (vec![surface(0.1, 0.3, 1.0), surface(-0.1, 0.0, 999.0)], SurfaceClass::Vertical),
        (vec![surface(0.2, 0.2, 10.0), surface(0.0, 0.0, 90.0)], SurfaceClass::Ground),
        (vec![surface(0.2, 0.2, 90.0), surface(0.0, 0.0, 10.0)], SurfaceClass::Horizontal),
    ] {
        let (found, points) = detector.judge(members.iter(), &level);
        assert_eq!(found, class, "{members:?}");
        assert_eq!(points.weight, members.iter().map(|surface| surface.points.weight).sum::<f32>());
    }
}

/// Level ground that lies below the level of the mount, with two boxes that hang above it.
fn apart() -> World {
    let mut world = World::empty(1.0, 15.0, 0.0);
    world.patches.push(crate::test_world::ground(-0.1));
    world.add_box([3.0, -1.0, 0.5], [3.5, -0.2, 1.2], 20.0);
    world.add_box([4.0, 0.3, 0.4], [4.5, 1.0, 0.9], 20.0);
    world
}

#[test]
fn the_ground_is_the_level_of_the_mount_with_what_was_seen_to_lie_on_it() {
    let world = apart();
    let pixels = world.render();
    let picture = DisparityPicture::new(&pixels, 320);
    let under = |min_support_permille: f32| {
        let ground = GroundSettings { min_support_permille, ..GroundSettings::default() };
        let mut stages = Stages::new(&world.mount(), &ground, &ObstacleSettings::default());
        stages.surfaces.run(picture, &stages.depth, &stages.rays);
        let mut detector = DisparitySegments::new();
        detector.configure(&DisparitySegmentSettings::default(), &ground, 320 * 240).unwrap();
        let found = detector.run(&mut stages.surfaces, &mut stages.regions, picture, &stages.frame);
        (found, stages)
    };
    let (found, stages) = under(1.0);
    let found = found.expect("ground is seen");
    let of_ground = |x: usize, y: usize| {
        stages.surfaces.surface_at(x, y).is_some_and(|surface| surface.class == SurfaceClass::Ground)
    };
    let pixels_of_ground = (0..320 * 240).filter(|i| of_ground(i % 320, i / 320)).count();
    assert_eq!(found.support as usize, pixels_of_ground);
    // Every point lies 10 cm below the level, but for the rounding of disparities.
    assert!((found.rms_m - 0.1).abs() < 0.01, "{found:?}");
    let permille = |support: f32| support / 76.8;
    let support = found.support as f32;
    assert!(under(permille(support - 5.0)).0.is_some() && under(permille(support + 5.0)).0.is_none());
}

#[test]
fn all_pixels_of_an_obstacle_and_of_the_ground_speak_for_their_cells() {
    const CELLS: usize = 2500;
    let world = apart();
    let pixels = world.render();
    let picture = DisparityPicture::new(&pixels, 320);
    let mut stages = Stages::new(&world.mount(), &GroundSettings::default(), &ObstacleSettings::default());
    stages.surfaces.run(picture, &stages.depth, &stages.rays);
    let mut detector = DisparitySegments::new();
    detector.configure(&DisparitySegmentSettings::default(), &GroundSettings::default(), 320 * 240).unwrap();
    detector.run(&mut stages.surfaces, &mut stages.regions, picture, &stages.frame);
    for surface in stages.surfaces.table_mut().iter_mut().filter(|surface| surface.class == SurfaceClass::Vertical) {
        surface.class = SurfaceClass::Obstacle;
    }
    let mut map = Box::new(MapBuilder::<CELLS>::new());
    map.configure(&MapSettings::default(), (0.25, 2.2)).unwrap();
    let Stages { surfaces, frame, place, rays, depth, .. } = &stages;
    let view = View { pair: &PAIR, frame, place, rays, depth, nearest_m: 0.5 };
    map.begin();
    detector.vote(surfaces, picture, &view, &mut map);
    let (mut counts, mut unsure) = (vec![[0_i32; 2]; CELLS], vec![0_i32; CELLS]);
    for (i, pixel) in pixels.iter().enumerate().filter(|(_, pixel)| pixel.has_value()) {
        let kind = match surfaces.surface_at(i % 320, i / 320).map(|surface| surface.class) {
            Some(SurfaceClass::Obstacle) => 0,
            Some(SurfaceClass::Ground) => 1,
            _ => continue,
        };
        let z = 16.0 * 228.0 * 0.2 / f64::from(pixel.steps());
        let at = world.direction((i % 320) as f64, (i / 320) as f64) * z;
        let cell = |dx: f64, dy: f64| {
            let [i, j] = [at.x + dx, at.y + dy].map(|at| (at / 0.5).floor() as i16);
            MapGeometry::default().index(i, j)
        };
        if let Some(cell) = cell(0.0, 0.0) {
            counts[cell][kind] += 1;
        }
        // Beside a border of two cells a point may count for either.
        let near =
            [(-1.0e-4, -1.0e-4), (-1.0e-4, 1.0e-4), (1.0e-4, -1.0e-4), (1.0e-4, 1.0e-4)].map(|(x, y)| cell(x, y));
        if near.iter().any(|other| *other != near[0]) {
            near.into_iter().flatten().for_each(|cell| unsure[cell] += 1);
        }
    }
    let mut seen = [0; 2];
    for (cell, slot) in map.table().iter().enumerate() {
        for (kind, found) in [slot.obstacle, slot.ground].into_iter().enumerate() {
            assert!((i32::from(found) - counts[cell][kind]).abs() <= unsure[cell], "{slot:?}, not {:?}", counts[cell]);
            seen[kind] += i32::from(found);
        }
        let high = if slot.obstacle > 0 { 4..=12 } else { 0..=0 };
        assert!(high.contains(&slot.height_dm), "{slot:?}");
    }
    assert!(seen[0] > 2000 && seen[1] > 10_000, "{seen:?}");
}
