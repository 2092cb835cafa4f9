//! Segments against union-find over all pixels.

use std::{vec, vec::Vec};

use super::*;
use crate::{
    disparity::DisparityPixel,
    obstacles::ObstacleSettings,
    test_random::Random,
    test_world::{Stages, World},
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
