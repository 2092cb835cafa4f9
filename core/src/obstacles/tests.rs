//! Obstacles of known place and size, seen by a perfect camera in steps of 1/16 px.

mod rules;

use std::vec::Vec;

use super::*;
use crate::{
    ground::GroundSettings,
    test_random::Random,
    test_world::{Patch, Point, Stages, World},
};

fn find(world: &World, settings: &ObstacleSettings) -> Vec<Obstacle> {
    let (ground, obstacles, dropped) =
        Stages::new(&world.mount(), &GroundSettings::default(), settings).run::<32>(&world.render());
    assert!(ground.is_some() && dropped == 0);
    obstacles
}

/// Upright and flat, `turned_deg` off facing the camera, with its lower edge at `bottom_m`.
fn panel(x: f64, y: f64, turned_deg: f64, width_m: f64, bottom_m: f64, height_m: f64) -> Patch {
    let (sin, cos) = turned_deg.to_radians().sin_cos();
    let half = width_m / 2.0;
    Patch::new([x, y, bottom_m + height_m / 2.0], [sin * half, cos * half, 0.0], [0.0, 0.0, height_m / 2.0])
}

fn with_panel(panel: Patch) -> World {
    let mut world = World::level(1.2, 12.0, 0.0);
    world.patches.push(panel);
    world
}

#[test]
fn a_box_stands_where_it_is_and_is_as_large_as_it_is() {
    let mut random = Random::seeded("boxes", 0x5eed_0140);
    let mut worst = [0.0_f32; 5];
    let (mut close, mut rounds) = (0, 0);
    for round in 0..60 {
        let mut world = World::level(1.2, 12.0, 0.0);
        // At least one and a half tiles wide and high in the picture: smaller ones may share each of their tiles with
        // the ground.
        let (x, y) = (random.within(2.5, 5.0), random.within(-1.0, 1.0));
        let least = 48.0 * x / 228.0;
        let (width, height) = (random.within(least, least + 0.6), random.within(least, 1.15));
        world.add_box([x, y - width / 2.0, 0.0], [x + 0.6, y + width / 2.0, height], 0.0);
        let obstacles = find(&world, &ObstacleSettings::default());
        // A side may be an obstacle of its own, where nothing joins it to the front.
        let joined = obstacles.iter().copied().reduce(|a, b| Obstacle {
            min_m: [0, 1, 2].map(|i| a.min_m[i].min(b.min_m[i])),
            max_m: [0, 1, 2].map(|i| a.max_m[i].max(b.max_m[i])),
            ..a
        });
        let found = &joined.unwrap_or_else(|| panic!("round {round}: no obstacle, {world:?}"));
        let off = [
            found.min_m[0] - x as f32,
            found.min_m[1] - (y - width / 2.0) as f32,
            found.max_m[1] - (y + width / 2.0) as f32,
            found.max_m[2] - height as f32,
            found.distance_m() - x.hypot((y.abs() - width / 2.0).max(0.0)) as f32,
        ];
        for (worst, off) in worst.iter_mut().zip(off) {
            *worst = worst.max(off.abs());
        }
        // Where one tile holds an edge of the box and the ground beside it, both make one surface: the box may seem larger
        // and nearer by the piece of ground that the tile sees there, and never smaller or farther.
        let [front, right, left, top, distance] = off;
        let never_less = front < 0.05 && distance < 0.05 && right < 0.3 && left > -0.3 && top > -0.3;
        assert!(never_less, "round {round}: off by {off:?}, {found:?}");
        close += usize::from(off.iter().all(|off| off.abs() < 0.3));
        rounds += 1;
    }
    assert!(close * 10 >= rounds * 4, "{close} of {rounds} within 0.3 m");
    std::println!("{close} of {rounds} within 0.3 m all round");
    std::println!("front, right, left, top and distance within {worst:.2?} m");
}

#[test]
fn panels_have_their_direction_and_length() {
    let mut worst = (0.0_f64, 0.0_f64);
    for (x, width_m) in [(3.0, 1.5), (4.5, 2.0), (6.0, 2.5)] {
        for turned_deg in [-45.0, -20.0, 0.0, 20.0, 45.0] {
            let world = with_panel(panel(x, 0.0, turned_deg, width_m, 0.4, 0.8));
            let obstacles = find(&world, &ObstacleSettings::default());
            assert_eq!(obstacles.len(), 1, "{turned_deg} degrees at {x} m: {obstacles:?}");
            let found = &obstacles[0];
            // The long axis runs along +y, turned from there towards +x.
            let truth = 90.0 - turned_deg;
            let off_deg = (f64::from(found.orientation_rad).to_degrees() - truth + 90.0).rem_euclid(180.0) - 90.0;
            let off_m = f64::from(found.length_m) - width_m;
            worst = (worst.0.max(off_deg.abs()), worst.1.max(off_m.abs()));
            assert!(off_deg.abs() < 3.0, "{turned_deg} degrees at {x} m: {off_deg:.1} degrees off");
            assert!(off_m.abs() < 0.08 * width_m, "{turned_deg} degrees at {x} m: {off_m:.2} m off");
            let mean = [found.mean_m[0] - x as f32, found.mean_m[1], found.mean_m[2] - 0.8];
            assert!(mean.iter().all(|m| m.abs() < 0.15), "{found:?}");
        }
    }
    std::println!("direction within {:.2} degrees, length within {:.3} m", worst.0, worst.1);
}

#[test]
fn elsewhere_on_the_vehicle_the_same_obstacles_are_moved_and_turned() {
    let mut world = with_panel(panel(4.5, 0.3, 25.0, 2.0, 0.4, 0.8));
    world.add_box([3.0, -1.6, 0.0], [3.6, -0.8, 0.9], 0.0);
    let here = find(&world, &ObstacleSettings::default());
    for place in [(1.5, -0.7, 0.0), (0.0, 0.0, 40.0), (-2.0, 1.0, -125.0), (0.3, 0.2, 180.0)] {
        let mut there = find(&World { place, ..world.clone() }, &ObstacleSettings::default());
        assert!(there.is_sorted_by_key(|obstacle| obstacle.distance_m()), "nearest to the vehicle's origin first");
        // By size, so that they can be paired whatever their order.
        let mut before = here.clone();
        before.sort_by_key(|obstacle| obstacle.pixels);
        there.sort_by_key(|obstacle| obstacle.pixels);
        assert_eq!(before.len(), there.len());
        for (a, b) in before.iter().zip(&there) {
            let moved = World { place, ..world.clone() }.to_vehicle(a.mean_m.map(f64::from).into());
            let off = (moved - Point::from(b.mean_m.map(f64::from))).norm();
            let turned = f64::from(b.orientation_rad - a.orientation_rad).to_degrees() - place.2;
            let turned = (turned + 90.0).rem_euclid(180.0) - 90.0;
            assert!(off < 1.0e-4 && turned.abs() < 1.0e-2, "{place:?}: {a:?} became {b:?}");
            assert!(b.orientation_rad.abs() <= core::f32::consts::FRAC_PI_2 + 1.0e-6);
            assert_eq!((a.length_m, a.pixels, a.surfaces), (b.length_m, b.pixels, b.surfaces));
            assert_eq!((a.min_m[2], a.max_m[2]), (b.min_m[2], b.max_m[2]));
            // A box along other axes holds the same points: no farther than the corners of the first one.
            let corners = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(i, j)| {
                let (x, y) = ([a.min_m[0], a.max_m[0]][i], [a.min_m[1], a.max_m[1]][j]);
                World { place, ..world.clone() }.to_vehicle(Point::new(f64::from(x), f64::from(y), 0.0))
            });
            for axis in 0..2 {
                let reach = |f: fn(f64, f64) -> f64, start| corners.iter().map(|c| c[axis]).fold(start, f);
                assert!(b.min_m[axis] < b.mean_m[axis] && b.mean_m[axis] < b.max_m[axis]);
                assert!(f64::from(b.min_m[axis]) > reach(f64::min, f64::MAX) - 0.1, "{place:?}: {a:?} became {b:?}");
                assert!(f64::from(b.max_m[axis]) < reach(f64::max, f64::MIN) + 0.1, "{place:?}: {a:?} became {b:?}");
            }
        }
    }
}

#[test]
fn every_threshold_counts() {
    let world = with_panel(panel(3.5, 0.0, 0.0, 1.0, 0.5, 0.5));
    // Loose limits, so that each can be tried alone.
    let loose = ObstacleSettings {
        min_height_m: 0.25,
        platform_height_m: 5.0,
        clearance_m: 5.0,
        min_pixels: 0,
        min_area_m2: 0.0,
        min_size_m: 0.0,
        max_range_m: 50.0,
    };
    let obstacles = find(&world, &loose);
    let [found] = obstacles[..] else { panic!("{obstacles:?}") };
    assert!((found.min_m[2] - 0.5).abs() < 0.1 && (found.max_m[2] - 1.0).abs() < 0.1, "{found:?}");
    let size = found.length_m.max(found.max_m[2] - found.min_m[2]);
    let pixels = found.pixels as u16;
    for (settings, expected) in [
        (ObstacleSettings { min_height_m: found.max_m[2] - 1.0e-3, ..loose }, 1),
        (ObstacleSettings { min_height_m: found.max_m[2] + 1.0e-3, ..loose }, 0),
        (ObstacleSettings { clearance_m: found.min_m[2] + 1.0e-3, ..loose }, 1),
        (ObstacleSettings { clearance_m: found.min_m[2] - 1.0e-3, ..loose }, 0),
        (ObstacleSettings { max_range_m: 3.7, ..loose }, 1),
        (ObstacleSettings { max_range_m: 3.4, ..loose }, 0),
        (ObstacleSettings { min_pixels: pixels, ..loose }, 1),
        (ObstacleSettings { min_pixels: pixels + 1, ..loose }, 0),
        // A panel of 1 m x 0.5 m, to the pixel.
        (ObstacleSettings { min_area_m2: 0.47, ..loose }, 1),
        (ObstacleSettings { min_area_m2: 0.53, ..loose }, 0),
        (ObstacleSettings { min_size_m: size - 1.0e-3, ..loose }, 1),
        (ObstacleSettings { min_size_m: size + 1.0e-3, ..loose }, 0),
    ] {
        assert_eq!(find(&world, &settings).len(), expected, "{settings:?}");
    }
}

#[test]
fn a_table_top_is_an_obstacle_from_the_height_of_a_platform_on() {
    let mut world = World::level(1.2, 20.0, 0.0);
    world.patches.push(Patch::new([3.5, 0.0, 0.7], [0.8, 0.0, 0.0], [0.0, 0.8, 0.0]));
    let settings = |platform_height_m| ObstacleSettings { platform_height_m, ..ObstacleSettings::default() };
    assert_eq!(find(&world, &settings(0.8)).len(), 0);
    let found = find(&world, &settings(0.6));
    assert_eq!(found.len(), 1, "{found:?}");
    assert!((found[0].mean_m[2] - 0.7).abs() < 0.05, "{found:?}");
}

#[test]
fn only_surfaces_of_obstacles_have_that_class() {
    let world = with_panel(panel(3.5, 0.0, 0.0, 1.0, 0.5, 0.5));
    let pixels = world.render();
    for (min_pixels, class) in [(40, SurfaceClass::Obstacle), (10_000, SurfaceClass::Vertical)] {
        let settings = ObstacleSettings { min_pixels, ..ObstacleSettings::default() };
        let mut stages = Stages::new(&world.mount(), &GroundSettings::default(), &settings);
        stages.run::<32>(&pixels);
        let [right, down, z] = world.frame().to_camera([3.5, 0.0, 0.75 - 1.2]);
        let (u, v) = (159.5 + 228.0 * right / z, 119.5 + 228.0 * down / z);
        let surface = stages.surfaces.surface_at(u as usize, v as usize).expect("the panel has a surface");
        assert_eq!(surface.class, class);
    }
}

#[test]
fn nearest_first_and_the_farthest_are_dropped_and_counted() {
    let places = [(7.0, 3.0), (3.0, -1.0), (5.0, 1.6), (4.0, 0.5), (6.0, -2.6)];
    let mut world = World::level(1.2, 12.0, 0.0);
    world.patches.extend(places.map(|(x, y)| panel(x, y, 0.0, 0.7, 0.4, 0.7)));
    let pixels = world.render();
    let run = |obstacles: &dyn Fn(&mut Stages) -> (Vec<Obstacle>, u32)| {
        let settings = ObstacleSettings::default();
        obstacles(&mut Stages::new(&world.mount(), &GroundSettings::default(), &settings))
    };
    let of = |(_, obstacles, dropped): (_, Vec<Obstacle>, u32)| (obstacles, dropped);
    let (all, dropped) = run(&|stages| of(stages.run::<32>(&pixels)));
    assert_eq!((all.len(), dropped), (5, 0), "{all:?}");
    assert!(all.is_sorted_by_key(|obstacle| obstacle.distance_m()));
    for (found, x) in all.iter().zip([3.0, 4.0, 5.0, 6.0, 7.0]) {
        assert!((found.mean_m[0] - x).abs() < 0.3, "{found:?} instead of {x}");
    }
    for (kept, (some, dropped)) in [
        (3, run(&|stages| of(stages.run::<3>(&pixels)))),
        (1, run(&|stages| of(stages.run::<1>(&pixels)))),
        (5, run(&|stages| of(stages.run::<5>(&pixels)))),
        (0, run(&|stages| of(stages.run::<0>(&pixels)))),
    ] {
        assert_eq!(some, all[..kept], "room for {kept}");
        assert_eq!(dropped as usize, 5 - kept);
    }
}

#[test]
fn any_order_of_insertion_gives_the_nearest() {
    let mut random = Random::seeded("insertion", 0x5eed_0141);
    for _ in 0..2000 {
        let at = |x: f32| Obstacle { min_m: [x, -0.5, 0.0], max_m: [x + 1.0, 0.5, 1.0], ..Obstacle::default() };
        let all: Vec<Obstacle> = (0..random.below(12)).map(|_| at(random.below(9) as f32)).collect();
        let mut list = heapless::Vec::<Obstacle, 5, u16>::new();
        let dropped: u32 = all.iter().map(|&obstacle| insert(&mut list, obstacle)).sum();
        let mut sorted = all.clone();
        sorted.sort_by(|a, b| a.min_m[0].total_cmp(&b.min_m[0]));
        sorted.truncate(5);
        assert_eq!(list.to_vec(), sorted);
        assert_eq!(dropped as usize, all.len() - sorted.len());
    }
}

#[test]
fn the_distance_is_that_of_the_nearest_corner() {
    let at = |min_m, max_m| Obstacle { min_m, max_m, ..Obstacle::default() }.distance_m();
    assert_eq!(at([3.0, 4.0, 0.0], [5.0, 6.0, 1.0]), 5.0);
    assert_eq!(at([3.0, -6.0, 0.0], [5.0, -4.0, 1.0]), 5.0);
    assert_eq!(at([3.0, -1.0, 0.0], [5.0, 1.0, 1.0]), 3.0);
    assert_eq!(at([-1.0, -1.0, 0.0], [5.0, 1.0, 1.0]), 0.0);
    assert_eq!(at([-7.0, -1.0, 0.0], [-6.0, 1.0, 1.0]), 6.0);
}

#[test]
fn settings_that_cannot_be_are_named() {
    let good = ObstacleSettings::default();
    let field = |settings: ObstacleSettings| settings.check().unwrap_err().field;
    assert_eq!(good.check(), Ok(()));
    assert_eq!(field(ObstacleSettings { min_height_m: 0.0, ..good }), "obstacles.min_height_m");
    assert_eq!(field(ObstacleSettings { platform_height_m: 0.1, ..good }), "obstacles.platform_height_m");
    assert_eq!(field(ObstacleSettings { clearance_m: 0.1, ..good }), "obstacles.clearance_m");
    assert_eq!(field(ObstacleSettings { min_pixels: 10_001, ..good }), "obstacles.min_pixels");
    assert_eq!(field(ObstacleSettings { min_area_m2: 10.1, ..good }), "obstacles.min_area_m2");
    assert_eq!(field(ObstacleSettings { min_size_m: f32::NAN, ..good }), "obstacles.min_size_m");
    assert_eq!(field(ObstacleSettings { max_range_m: 0.0, ..good }), "obstacles.max_range_m");
}
