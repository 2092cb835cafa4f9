//! Cells against plain evaluations in f64.

mod bands;

use std::{boxed::Box, vec, vec::Vec};

use super::*;
use crate::{
    disparity::{DisparityPicture, DisparityPixel, Reason},
    geometry::Place,
    ground::{GroundPlane, GroundSettings},
    obstacles::ObstacleSettings,
    surfaces::{Surface, SurfaceClass, TILE},
    test_random::Random,
    test_world::{DISPARITIES, PAIR, Patch, Point, Stages, World},
};

const CELLS: usize = 2500;

/// Everything that led to a map.
struct Made {
    stages: Stages,
    ground: Option<GroundPlane>,
    map: Box<ObstacleMap<CELLS>>,
    pixels: Vec<DisparityPixel>,
    settings: MapSettings,
}

/// Nearest distance that the disparities of the worlds reach.
fn nearest_m() -> f32 {
    PAIR.distance_m(DISPARITIES as f32 - 2.0)
}

fn make(world: &World, settings: MapSettings, ground_settings: &GroundSettings) -> Made {
    let obstacles = ObstacleSettings::default();
    let mut stages = Stages::new(&world.mount(), ground_settings, &obstacles);
    let pixels = world.render();
    let (ground, _, _) = stages.run::<32>(&pixels);
    let mut builder = Box::new(MapBuilder::<CELLS>::new());
    builder.configure(&settings, (obstacles.min_height_m, obstacles.clearance_m)).unwrap();
    let mut map = Box::new(ObstacleMap::EMPTY);
    let view = view(&stages);
    let picture = DisparityPicture::new(&pixels, 320);
    builder.run(&stages.surfaces, picture, &view, stages.ground.terrain(), ground.is_some(), &mut map);
    Made { stages, ground, map, pixels, settings }
}

fn view(stages: &Stages) -> View<'_, DISPARITIES> {
    let Stages { frame, place, rays, depth, .. } = stages;
    View { pair: &PAIR, frame, place, rays, depth, nearest_m: nearest_m() }
}

/// Boxes, a wall without texture, a ditch of ambiguous matches and a low step on level ground.
fn scene() -> World {
    let mut world = World::level(1.2, 12.0, 2.0);
    world.add_box([3.0, 0.3, 0.0], [3.6, 1.1, 0.9], 20.0);
    world.add_box([6.0, -2.5, 0.0], [7.0, -1.0, 1.2], 0.0);
    world.add_box([4.0, -1.0, 0.0], [4.4, -0.7, 0.15], 0.0);
    let hole = |x: f64, y: f64, reason| Patch {
        hole: Some(reason),
        ..Patch::new([x, y, 0.001], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    };
    world.patches.push(hole(3.5, -2.0, Reason::LowTexture));
    world.patches.push(hole(7.5, -0.3, Reason::NotUnique));
    world
}

/// Fewest and most votes that a cell can have, given that pixels very near to a limit may fall to either side.
#[derive(Clone, Copy, Default)]
struct Votes {
    least: [u32; 3],
    most: [u32; 3],
}

/// Votes for obstacle, ground, unclear, by a plain evaluation of every pixel.
fn plain_votes(world: &World, made: &Made) -> Vec<Votes> {
    let geometry = made.settings.geometry;
    let mut votes = vec![Votes::default(); geometry.len()];
    let obstacles = ObstacleSettings::default();
    let terrain = made.stages.ground.terrain();
    let plane = terrain.plane();
    let normal = Point::from(plane.normal.map(f64::from));
    let size = f64::from(geometry.cell_size_mm) / 1000.0;
    for (number, pixel) in made.pixels.iter().enumerate() {
        let (u, v) = (number % 320, number / 320);
        let Some(surface) = made.stages.surfaces.surface_at(u, v) else { continue };
        let disparity = f64::from(pixel.steps()) / 16.0;
        let z = f64::from(PAIR.focal_px) * f64::from(PAIR.baseline_m) / disparity;
        let p = Point::new(0.0, 0.0, world.height_m) + world.direction(u as f64, v as f64) * z;
        let height = normal.dot(&p) - f64::from(plane.offset_m) - f64::from(terrain.lift_m(p.x as f32, p.y as f32));
        // Nearness to any limit that decides, metres; the table of distances is within 3e-5 of the distance.
        let near = 5.0e-5 * z;
        let edge = |x: f64| ((x / size).round() * size - x).abs() < near;
        let noise = plain_noise(world, made, surface, (u, v)).map(|per_m2| per_m2 * (p.x * p.x + p.y * p.y));
        let [least_height, free_max] = [obstacles.min_height_m, made.settings.free_max_height_m]
            .map(|limit| noise.map(|noise| f64::from(limit).max(noise)));
        let clearance = f64::from(obstacles.clearance_m);
        let within = |[low, high]: [f64; 2]| height > low - near && height < high + near;
        let at = world.to_vehicle(p);
        let low = [-free_max[1], -free_max[0]];
        let limits = [least_height, free_max, [clearance; 2], low];
        let uncertain = edge(at.x) || edge(at.y) || limits.into_iter().any(within);
        let on_ground = surface.class == SurfaceClass::Ground;
        let stands = surface.class == SurfaceClass::Obstacle && height > free_max[1];
        let kind = if height > clearance {
            None
        } else if stands || on_ground && height >= least_height[1] {
            Some(0)
        } else if height > free_max[1] || height < low[0] {
            Some(2)
        } else {
            on_ground.then_some(1)
        };
        for (dx, dy) in [(0.0, 0.0), (near, near), (near, -near), (-near, near), (-near, -near)] {
            let (i, j) = (((at.x + dx) / size).floor(), ((at.y + dy) / size).floor());
            let Some(index) = geometry.index(i as i16, j as i16) else { continue };
            if uncertain {
                // Counted at most once per shift, for every kind: generous.
                votes[index].most = votes[index].most.map(|n| n + 1);
            } else if (dx, dy) == (0.0, 0.0)
                && let Some(kind) = kind
            {
                votes[index].least[kind] += 1;
                votes[index].most[kind] += 1;
            }
        }
    }
    votes
}

/// Least and greatest error that the height of a pixel of a surface must be expected to have, for each square metre of its range
/// squared, over the pixels of its tile in its row: the error of the distance times the rate at which a ray there nears the ground.
fn plain_noise(world: &World, made: &Made, surface: &Surface, (u, v): (usize, usize)) -> [f64; 2] {
    let terrain = made.stages.ground.terrain();
    let [x, y, _] = surface.points.mean_m;
    let rise = |(dx, dy): (f32, f32)| {
        let [before, after] = [-0.75, 0.75].map(|s| f64::from(terrain.lift_m(x + s * dx, y + s * dy)));
        (after - before) / 1.5
    };
    let normal =
        Point::from(terrain.plane().normal.map(f64::from)) - Point::new(rise((1.0, 0.0)), rise((0.0, 1.0)), 0.0);
    let distance_error =
        f64::from(made.settings.height_noise_px) / (f64::from(PAIR.focal_px) * f64::from(PAIR.baseline_m));
    let first = u - u % TILE;
    let ends =
        [first, first + TILE - 1].map(|u| distance_error * normal.dot(&world.direction(u as f64, v as f64)).abs());
    [ends[0].min(ends[1]), ends[0].max(ends[1])]
}

/// Votes needed for an obstacle and for a free cell, and the distance of the cell's ground; `None` behind the camera.
fn plain_needs(world: &World, made: &Made, (x, y): (f64, f64)) -> Option<(f64, f64, f64, f64, f64)> {
    let terrain = made.stages.ground.terrain();
    let plane = terrain.plane();
    let n = plane.normal.map(f64::from);
    let z = (f64::from(plane.offset_m) + f64::from(terrain.lift_m(x as f32, y as f32)) - n[0] * x - n[1] * y) / n[2];
    let camera = world.rotation().transpose() * (Point::new(x, y, z) - Point::new(0.0, 0.0, world.height_m));
    if camera.z <= 0.0 {
        return None;
    }
    let s = &made.settings;
    let per_m = f64::from(PAIR.focal_px) / camera.z;
    let across = f64::from(s.geometry.cell_size_mm) / 1000.0 * per_m;
    let along = across * (f64::from(plane.camera_height_m) / camera.z).min(1.0);
    let obstacle = (f64::from(s.obstacle_cover) * across * 0.25 * per_m).max(f64::from(s.obstacle_min_pixels));
    let free = (f64::from(s.free_cover) * across * along).max(f64::from(s.free_min_pixels));
    let (u, v) = (f64::from(PAIR.cx) + camera.x * per_m, f64::from(PAIR.cy) + camera.y * per_m);
    Some((obstacle, free, camera.z, u, v))
}

#[test]
fn cells_are_those_of_a_plain_count_of_votes() {
    let worlds = [
        scene(),
        World { roll_deg: -6.0, pitch_down_deg: 20.0, ..scene() },
        World { height_m: 0.7, ..scene() },
        // Pairs that look to the side, mounted away from the origin: cells lie across their view.
        World { place: (1.3, -0.4, 35.0), ..scene() },
        World { place: (4.8, 3.1, -70.0), roll_deg: 3.0, ..scene() },
        World { place: (12.0, -5.0, 170.0), ..scene() },
    ];
    let small = MapGeometry { cell_size_mm: 250, x_first: 2, x_count: 50, y_first: -20, y_count: 50 };
    for (world, geometry) in worlds.iter().flat_map(|w| [(w, MapGeometry::default()), (w, small)]) {
        // What obstacles smear is looked at for itself.
        let settings = MapSettings { geometry, max_range_m: 14.0, smear_share: 0.0, ..MapSettings::default() };
        let made = make(world, settings, &GroundSettings::default());
        assert!(made.ground.is_some());
        let votes = plain_votes(world, &made);
        let mut counts = [0; 4];
        for (index, (cell, votes)) in made.map.cells.iter().zip(&votes).enumerate() {
            let (i, j) = geometry.cell_at(index);
            let size = f64::from(geometry.cell_size_mm) / 1000.0;
            let centre = ((f64::from(i) + 0.5) * size, (f64::from(j) + 0.5) * size);
            let centre = world.to_pair(Point::new(centre.0, centre.1, 0.0));
            let centre = (centre.x, centre.y);
            let needs = plain_needs(world, &made, centre);
            let what = std::format!("cell {i}, {j}: {cell:?}, votes {:?} to {:?}, {needs:?}", votes.least, votes.most);
            if centre.0.hypot(centre.1) > 14.0 + 1.0e-4 {
                assert_eq!(cell.state, CellState::Unknown(UnknownReason::TooFar), "{what}");
                continue;
            }
            let Some((need_obstacle, need_free, distance, u, v)) = needs else {
                assert_eq!(cell.state, CellState::Unknown(UnknownReason::OutsideView), "{what}");
                continue;
            };
            let share = f64::from(settings.unclear_share);
            let decide = |obstacle: u32, ground: u32, unclear: u32| {
                if f64::from(obstacle) + share * f64::from(unclear) >= need_obstacle {
                    Some(CellState::Obstacle)
                } else if f64::from(ground) >= need_free && f64::from(obstacle + unclear) < 0.5 * need_obstacle {
                    Some(CellState::Free)
                } else {
                    None
                }
            };
            let (l, m) = (votes.least, votes.most);
            let outcomes = [
                decide(l[0], l[1], l[2]),
                decide(l[0], m[1], l[2]),
                decide(m[0], l[1], m[2]),
                decide(m[0], m[1], m[2]),
            ];
            if outcomes.iter().any(|o| *o != outcomes[0]) {
                counts[3] += 1;
                continue;
            }
            match outcomes[0] {
                Some(CellState::Obstacle) => {
                    counts[0] += 1;
                    assert_eq!(cell.state, CellState::Obstacle, "{what}");
                    assert!((l[0]..=m[0]).contains(&u32::from(cell.pixels)) && cell.height_dm >= 2, "{what}");
                }
                Some(_) => {
                    counts[1] += 1;
                    assert_eq!(cell.state, CellState::Free, "{what}");
                    assert!((l[1]..=m[1]).contains(&u32::from(cell.pixels)), "{what}");
                }
                None => {
                    counts[2] += 1;
                    let CellState::Unknown(reason) = cell.state else { panic!("{what}") };
                    let on_edge = [u, v, u - 320.0, v - 240.0].iter().any(|e| e.abs() < 0.01)
                        || (u - u.round()).abs() < 0.01
                        || (v - v.round()).abs() < 0.01
                        || (distance - f64::from(nearest_m())).abs() < 1.0e-3;
                    if on_edge {
                        continue;
                    }
                    let expected = if u < 0.0 || v < 0.0 || u >= 320.0 || v >= 240.0 {
                        UnknownReason::OutsideView
                    } else if distance < f64::from(nearest_m()) {
                        UnknownReason::TooNear
                    } else {
                        match made.pixels[v as usize * 320 + u as usize].get() {
                            Ok(_) => UnknownReason::TooFewPixels,
                            Err(Reason::LowTexture | Reason::Saturated) => UnknownReason::LowTexture,
                            Err(_) => UnknownReason::NoMatch,
                        }
                    };
                    let may_hide = !matches!(expected, UnknownReason::OutsideView | UnknownReason::TooNear);
                    assert!(reason == expected || may_hide && reason == UnknownReason::Hidden, "{expected:?}: {what}");
                }
            }
        }
        std::println!("obstacle, free, unknown, undecided: {counts:?}");
        assert!(counts[0] > 3 && counts[1] > 50 && counts[3] * 25 < geometry.len(), "{counts:?}");
    }
}

fn count(map: &ObstacleMap<CELLS>, state: CellState) -> usize {
    map.cells.iter().filter(|cell| cell.state == state).count()
}

#[test]
fn every_reason_is_given_where_it_belongs() {
    let settings = MapSettings { max_range_m: 9.0, ..MapSettings::default() };
    let made = make(&scene(), settings, &GroundSettings::default());
    let at = |x: f32, y: f32| {
        let place = made.settings.geometry.index((x / 0.5).floor() as i16, (y / 0.5).floor() as i16).unwrap();
        made.map.cells[place].state
    };
    let unknown = CellState::Unknown;
    assert_eq!(at(0.6, 8.0), unknown(UnknownReason::OutsideView));
    assert_eq!(at(11.0, 0.2), unknown(UnknownReason::TooFar));
    assert_eq!(at(5.2, 1.3), unknown(UnknownReason::Hidden));
    assert_eq!(at(3.2, -2.2), unknown(UnknownReason::LowTexture));
    assert_eq!(at(7.2, -0.3), unknown(UnknownReason::NoMatch));
    assert_eq!(at(3.2, 0.6), CellState::Obstacle);
    assert_eq!(at(3.2, -0.2), CellState::Free);

    let needy = MapSettings { free_min_pixels: 10_000, ..settings };
    let needy = make(&scene(), needy, &GroundSettings::default());
    assert!(count(&needy.map, unknown(UnknownReason::TooFewPixels)) > 50);
    assert_eq!(count(&needy.map, CellState::Free), 0);

    // Looking down steeply, so that the ground nearer than the disparity range lies in view.
    let mut low = World::level(0.35, 35.0, 0.0);
    low.add_box([1.5, -0.2, 0.0], [1.7, 0.2, 0.4], 0.0);
    let geometry = MapGeometry { cell_size_mm: 50, x_first: 0, x_count: 50, y_first: -25, y_count: 50 };
    let low = make(&low, MapSettings { geometry, ..settings }, &GroundSettings::default());
    assert!(count(&low.map, unknown(UnknownReason::TooNear)) > 0);
    for (index, cell) in low.map.cells.iter().enumerate() {
        let (i, j) = geometry.cell_at(index);
        let near = f32::from(i) * 0.05 + 0.025 < nearest_m() * 0.5 && j.abs() < 3;
        assert!(!near || cell.state != CellState::Free, "{i}, {j}: free though nearer than the range");
    }
}

#[test]
fn without_ground_nothing_is_free_and_obstacles_remain() {
    let never = GroundSettings { min_support_permille: 1000.0, ..GroundSettings::default() };
    let made = make(&scene(), MapSettings::default(), &never);
    assert_eq!(made.ground, None);
    assert_eq!(count(&made.map, CellState::Free), 0);
    assert!(count(&made.map, CellState::Unknown(UnknownReason::NoGround)) > 50);
    assert!(count(&made.map, CellState::Obstacle) > 3);
}

#[test]
fn no_cell_under_the_front_of_a_box_is_free() {
    let mut random = Random::seeded("boxes on the map", 0x5eed_0150);
    let mut told = 0;
    for round in 0..40 {
        let mut world = World::level(1.2, 12.0, 0.0);
        let (x, y) = (random.within(2.5, 6.0), random.within(-1.2, 1.2));
        let (width, height) = (random.within(0.6, 1.2), random.within(0.5, 1.1));
        world.add_box([x, y - width / 2.0, 0.0], [x + 0.6, y + width / 2.0, height], 0.0);
        let made = make(&world, MapSettings::default(), &GroundSettings::default());
        let (i, j) = ((x / 0.5).floor() as i16, (y / 0.5).floor() as i16);
        let cell = made.map.cells[made.settings.geometry.index(i, j).unwrap()];
        told += u32::from(cell.state == CellState::Obstacle);
        // The front fills at least a tenth of a metre of the cell: what the cell shows is the box.
        let inside = x - f64::from(i) * 0.5;
        assert!(cell.state != CellState::Free || inside > 0.4, "round {round}: {x} {y}, {width} x {height}: {cell:?}");
    }
    std::println!("{told} of 40 are obstacles");
    assert!(told >= 36, "{told} of 40");
}

#[test]
fn pairs_that_look_to_both_sides_make_one_map() {
    // In the vehicle frame: a box on the left, one on the right, one ahead where both look.
    let boxes = [([4.0, 2.5], [4.6, 3.4]), ([5.0, -4.0], [5.6, -3.0]), ([7.0, -0.5], [7.6, 0.5])];
    let made = [(0.2, 0.4, 30.0), (0.2, -0.4, -30.0)].map(|place| {
        let mut world = World { place, ..World::level(1.2, 12.0, 0.0) };
        let ground = world.patches.len();
        for (min, max) in boxes {
            world.add_box([min[0], min[1], 0.0], [max[0], max[1], 1.0], 0.0);
        }
        // The world before a pair lies in the frame of the pair.
        let (here, turn) = (world.clone(), |p| world.to_pair(p) - world.to_pair(Point::zeros()));
        let patches = here.patches.iter().enumerate().map(|(i, patch)| match i < ground {
            true => *patch,
            false => Patch {
                middle: world.to_pair(patch.middle),
                half_a: turn(patch.half_a),
                half_b: turn(patch.half_b),
                ..*patch
            },
        });
        let world = World { patches: patches.collect(), ..world.clone() };
        make(&world, MapSettings::default(), &GroundSettings::default())
    });
    let mut merged = Box::new(Merged::<CELLS>::new());
    for made in &made {
        merged.add_parts(&made.map, made.ground.as_ref(), crate::health::Health::OK).unwrap();
    }
    let geometry = merged.map().geometry;
    for (min, max) in boxes {
        // The cell behind the middle of the face that looks at the vehicle, whoever sees it.
        let at = ((min[0] + 0.05_f64) / 0.5, (min[1] + max[1]) / 2.0 / 0.5 + 0.1_f64);
        let cell = merged.map().cells[geometry.index(at.0.floor() as i16, at.1.floor() as i16).unwrap()];
        assert_eq!(cell.state, CellState::Obstacle, "box at {min:?}");
    }
    for (index, cell) in merged.map().cells.iter().enumerate() {
        let [left, right] = made.each_ref().map(|made| made.map.cells[index].state);
        assert!([left, right].contains(&cell.state));
        let (i, j) = geometry.cell_at(index);
        let (x, y) = (f64::from(i) * 0.5 + 0.25, f64::from(j) * 0.5 + 0.25);
        let inside = boxes.iter().any(|(min, max)| x > min[0] && x < max[0] && y > min[1] && y < max[1]);
        assert!(!(inside && cell.state == CellState::Free), "a box stands at {x}, {y}");
    }
    let free = |map: &ObstacleMap<CELLS>| count(map, CellState::Free);
    let [left, right] = made.each_ref().map(|made| free(&made.map));
    std::println!("free cells: {left} and {right}, together {}", free(merged.map()));
    assert!(free(merged.map()) > left + 40 && free(merged.map()) > right + 40);
    // One of them alone sees nothing on the other side.
    let clear = merged.sectors(6.0).distance_dm.iter().filter(|d| **d != SECTOR_UNKNOWN).count();
    let alone = SectorDistances::of(&made[0].map, 6.0).distance_dm.iter().filter(|d| **d != SECTOR_UNKNOWN).count();
    assert!(clear > alone + 3, "{clear} sectors known, {alone} by one pair");
}

#[test]
fn pictures_of_another_size_make_a_map_without_free_cells() {
    let world = scene();
    let made = make(&world, MapSettings::default(), &GroundSettings::default());
    let mut builder = Box::new(MapBuilder::<CELLS>::new());
    builder.configure(&MapSettings::default(), (0.25, 2.5)).unwrap();
    let mut map = Box::new(ObstacleMap::<CELLS>::EMPTY);
    let terrain = made.stages.ground.terrain();
    for (pixels, width) in [(320 * 240, 160), (320 * 10, 320), (0, 320), (0, 0), (320 * 240, 321), (64, 8)] {
        let picture = DisparityPicture::new(&made.pixels[..pixels], width);
        builder.run(&made.stages.surfaces, picture, &view(&made.stages), terrain, true, &mut map);
        assert_eq!(map.cells.len(), CELLS);
        assert_eq!(count(&map, CellState::Free) + count(&map, CellState::Obstacle), 0);
    }
}

#[test]
fn index_cell_and_centre_are_inverse() {
    for (x_first, y_first) in [(-64, -64), (-64, 63), (0, -25), (63, 0), (-1, -1)] {
        for (x_count, y_count) in [(1, 1), (50, 50), (128, 3), (3, 128), (128, 128), (0, 5), (5, 0)] {
            let geometry = MapGeometry { cell_size_mm: 500, x_first, x_count, y_first, y_count };
            for index in 0..geometry.len() {
                let (i, j) = geometry.cell_at(index);
                assert_eq!(geometry.index(i, j), Some(index));
                let (x, y) = geometry.centre_m(i, j);
                assert_eq!((x, y), ((f32::from(i) + 0.5) * 0.5, (f32::from(j) + 0.5) * 0.5));
                assert_eq!(((x / 0.5).floor() as i16, (y / 0.5).floor() as i16), (i, j));
            }
            let mut inside = 0;
            for i in -200..200 {
                for j in -200..200 {
                    inside += usize::from(geometry.index(i, j).is_some());
                }
            }
            assert_eq!(inside, geometry.len());
            assert_eq!(geometry.is_empty(), x_count == 0 || y_count == 0);
        }
    }
    // Values that no settings allow stay within the numbers.
    let absurd =
        MapGeometry { cell_size_mm: 1, x_first: i16::MAX, x_count: 60_000, y_first: i16::MIN, y_count: 60_000 };
    for index in [0, 1, 59_999, 60_000, usize::MAX] {
        let _ = absurd.cell_at(index);
    }
    assert_eq!(absurd.index(i16::MIN, i16::MAX), None);
}

/// A map of 30 x 40 cells with obstacles, free and unseen cells strewn about.
fn strewn(random: &mut Random) -> ObstacleMap<CELLS> {
    let geometry = MapGeometry { cell_size_mm: 500, x_first: -2, x_count: 30, y_first: -20, y_count: 40 };
    let mut map = ObstacleMap::<CELLS> { geometry, cells: heapless::Vec::new() };
    let obstacles = 1 + random.below(20);
    for _ in 0..geometry.len() {
        let state = match random.below(1000) {
            n if n < obstacles => CellState::Obstacle,
            n if n < 500 => CellState::Free,
            n => CellState::Unknown(match n % 9 {
                0 => UnknownReason::OutsideView,
                1 => UnknownReason::TooNear,
                2 => UnknownReason::TooFar,
                3 => UnknownReason::NoGround,
                4 => UnknownReason::LowTexture,
                5 => UnknownReason::NoMatch,
                _ => UnknownReason::TooFewPixels,
            }),
        };
        map.cells.push(Cell { state, ..Cell::default() }).unwrap();
    }
    map
}

fn centres(map: &ObstacleMap<CELLS>) -> impl Iterator<Item = (f64, f64, CellState)> {
    map.cells.iter().enumerate().map(|(index, cell)| {
        let (i, j) = map.geometry.cell_at(index);
        ((f64::from(i) + 0.5) * 0.5, (f64::from(j) + 0.5) * 0.5, cell.state)
    })
}

#[test]
fn cells_behind_obstacles_are_hidden_as_rays_say() {
    let mut random = Random::seeded("shadows", 0x5eed_0151);
    // Directions are told apart in steps of 1/32 of sideways per ahead.
    let step = 1.0 / 32.0 + 1.0e-4;
    let (mut hidden, mut open) = (0, 0);
    for round in 0..200 {
        let before = strewn(&mut random);
        let mut after = before.clone();
        shadow::mark(&mut after, &Place::ORIGIN);
        // Obstacles as the interval of sideways per ahead that their corners span.
        let shades: Vec<(f64, f64, f64)> = centres(&before)
            .filter(|&(x, _, state)| state == CellState::Obstacle && x > 0.25)
            .map(|(x, y, _)| {
                let corners = [(-0.25, -0.25), (-0.25, 0.25), (0.25, -0.25), (0.25, 0.25)];
                let tangents = corners.map(|(dx, dy)| (y + dy) / (x + dx));
                (x, tangents.into_iter().fold(f64::MAX, f64::min), tangents.into_iter().fold(f64::MIN, f64::max))
            })
            .collect();
        for ((x, y, was), is) in centres(&before).zip(&after.cells) {
            let unseen = matches!(
                was,
                CellState::Unknown(UnknownReason::LowTexture | UnknownReason::NoMatch | UnknownReason::TooFewPixels)
            );
            if !unseen || x <= 0.0 || y.abs() >= 2.0 * x {
                assert_eq!(is.state, was, "round {round}: {x}, {y}");
                continue;
            }
            let crossed = |slack: f64| {
                shades.iter().any(|&(ox, right, left)| ox < x && y / x >= right - slack && y / x <= left + slack)
            };
            let is_hidden = is.state == CellState::Unknown(UnknownReason::Hidden);
            assert!(is_hidden || is.state == was);
            assert!(is_hidden || !crossed(-1.0e-5), "round {round}: {x}, {y} is hidden");
            assert!(!is_hidden || crossed(step), "round {round}: {x}, {y} is open");
            hidden += u32::from(is_hidden);
            open += u32::from(!is_hidden);
        }
    }
    std::println!("{hidden} hidden, {open} open");
    assert!(hidden > 1000 && open > 1000);
}

#[test]
fn sectors_are_those_of_a_plain_search() {
    let mut random = Random::seeded("sectors", 0x5eed_0152);
    for (round, width_deg) in (0..300).zip([5.0, 18.0, 0.5, 7.0].into_iter().cycle()) {
        let map = strewn(&mut random);
        let found = SectorDistances::of(&map, width_deg);
        let width_deg = f64::from(width_deg);
        assert_eq!((f64::from(found.left_deg), f64::from(found.width_deg)), (10.0 * width_deg, width_deg));
        for sector in 0..SECTOR_COUNT {
            let inside = |x: f64, y: f64| {
                let place = 10.0 - y.atan2(x).to_degrees() / width_deg;
                // Centres on an edge belong to the sector on the right of it.
                let place = if (place - place.round()).abs() < 1.0e-5 { place.round() } else { place.floor() };
                place == sector as f64
            };
            let cells: Vec<_> = centres(&map).filter(|&(x, y, _)| inside(x, y)).collect();
            let nearest = cells.iter().filter(|c| c.2 == CellState::Obstacle).map(|c| c.0.hypot(c.1)).reduce(f64::min);
            let free = cells.iter().filter(|c| c.2 == CellState::Free).count();
            let outside = [UnknownReason::OutsideView, UnknownReason::TooFar, UnknownReason::TooNear];
            let in_view = cells.iter().filter(|c| !outside.iter().any(|&r| c.2 == CellState::Unknown(r))).count();
            let expected = match nearest {
                Some(distance) => (distance * 10.0).round().min(253.0) as u8,
                None if free > 0 && 2 * free >= in_view => SECTOR_CLEAR_DM,
                None => SECTOR_UNKNOWN,
            };
            let near = found.distance_dm[sector].abs_diff(expected);
            let rounding = nearest.is_some_and(|d| (d * 10.0).fract() > 0.4999 && (d * 10.0).fract() < 0.5001);
            assert!(near == 0 || rounding && near == 1, "round {round}, sector {sector}: {found:?}, {expected}");
        }
    }
    let empty = ObstacleMap::<CELLS>::EMPTY;
    assert_eq!(SectorDistances::of(&empty, 5.0).distance_dm, [SECTOR_UNKNOWN; SECTOR_COUNT]);
}

#[test]
fn settings_that_cannot_be_are_named() {
    let good = MapSettings::default();
    let field = |settings: MapSettings| settings.check(CELLS).unwrap_err().field;
    let geometry = |geometry: MapGeometry| field(MapSettings { geometry, ..good });
    let default = MapGeometry::default();
    assert_eq!(good.check(CELLS), Ok(()));
    assert_eq!(geometry(MapGeometry { cell_size_mm: 0, ..default }), "map.geometry.cell_size_mm");
    assert_eq!(geometry(MapGeometry { x_first: -65, ..default }), "map.geometry.x_first");
    assert_eq!(geometry(MapGeometry { y_first: 64, ..default }), "map.geometry.y_first");
    assert_eq!(geometry(MapGeometry { x_count: 65, ..default }), "map.geometry.x_count");
    assert_eq!(geometry(MapGeometry { y_count: 0, ..default }), "map.geometry.y_count");
    assert_eq!(geometry(MapGeometry { x_count: 51, ..default }), "map.geometry");
    assert_eq!(field(MapSettings { obstacle_cover: f32::NAN, ..good }), "map.obstacle_cover");
    assert_eq!(field(MapSettings { obstacle_min_pixels: 0, ..good }), "map.obstacle_min_pixels");
    assert_eq!(field(MapSettings { free_cover: 1.1, ..good }), "map.free_cover");
    assert_eq!(field(MapSettings { free_min_pixels: 0, ..good }), "map.free_min_pixels");
    assert_eq!(field(MapSettings { free_max_height_m: 0.0, ..good }), "map.free_max_height_m");
    assert_eq!(field(MapSettings { height_noise_px: -0.1, ..good }), "map.height_noise_px");
    assert_eq!(field(MapSettings { unclear_share: 1.1, ..good }), "map.unclear_share");
    assert_eq!(field(MapSettings { smear_share: -0.1, ..good }), "map.smear_share");
    assert_eq!(field(MapSettings { smear_cells: 9, ..good }), "map.smear_cells");
    assert_eq!(field(MapSettings { max_range_m: f32::INFINITY, ..good }), "map.max_range_m");
    assert_eq!(field(MapSettings { sector_width_deg: 18.5, ..good }), "map.sector_width_deg");
}
