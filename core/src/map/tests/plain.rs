//! Every cell against a plain count of the votes of all pixels.

use super::*;
use crate::{
    surfaces::{Surface, SurfaceClass, TILE},
    test_world::Point,
};

/// Ground that is level at first and then rises as steeply ahead and to the left, in degrees, with a trench across the way if there is
/// one; boxes stand far away.
fn hill(ahead_deg: f64, aside_deg: f64, trench_m: f64) -> World {
    let [ahead, aside] = [ahead_deg, aside_deg].map(|degrees| degrees.to_radians().tan());
    let mut world = World::empty(1.2, 12.0, 0.0);
    // From and to metres ahead, and the height there.
    let rise = |x: f64| ahead * (x - 5.0).max(0.0);
    for (from, to, down) in [(-5.0, 5.0, 0.0), (5.0, 7.0, 0.0), (7.0, 8.5, trench_m), (8.5, 40.0, 0.0)] {
        let (half, middle) = ((to - from) / 2.0, (from + to) / 2.0);
        let (before, behind) = (rise(from), rise(to));
        world.patches.push(Patch::new(
            [middle, 0.0, (before + behind) / 2.0 - down],
            [half, 0.0, (behind - before) / 2.0],
            [0.0, 30.0, 30.0 * aside],
        ));
    }
    for (x, y, height) in [(6.0, 1.0, 0.3), (9.5, -2.5, 0.5), (11.0, 0.5, 1.1), (12.0, 3.0, 3.5)] {
        let foot = rise(x) + aside * y - 0.3;
        world.add_box([x, y - 0.5, foot], [x + 0.8, y + 0.5, foot + 0.3 + height], 10.0);
    }
    world
}

/// Pixels strewn over the picture that belong to nothing around them, and to no surface.
fn speckled(mut pixels: Vec<DisparityPixel>) -> Vec<DisparityPixel> {
    for (number, pixel) in pixels.iter_mut().enumerate().filter(|(number, _)| number % 37 == 5) {
        *pixel = DisparityPixel::from_steps(60 + (number * 7 % 500) as u16);
    }
    pixels
}

/// Fewest and most votes that a cell can have, given that pixels very near to a limit may fall to either side.
#[derive(Clone, Copy, Default)]
struct Votes {
    least: [u32; 3],
    most: [u32; 3],
    /// Height of the highest obstacle pixel, metres.
    height_m: [f64; 2],
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
                votes[index].height_m[1] = votes[index].height_m[1].max(height);
            } else if (dx, dy) == (0.0, 0.0)
                && let Some(kind) = kind
            {
                votes[index].least[kind] += 1;
                votes[index].most[kind] += 1;
                if kind == 0 {
                    votes[index].height_m = votes[index].height_m.map(|most| most.max(height));
                }
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
        hill(7.0, 0.0, 0.0),
        hill(-3.0, 6.0, 0.0),
        hill(4.0, -8.0, 0.7),
        World { roll_deg: 7.0, ..hill(0.0, 0.0, 0.6) },
    ];
    let small = MapGeometry { cell_size_mm: 250, x_first: 2, x_count: 50, y_first: -20, y_count: 50 };
    // Its first cell is seen by many neighbouring pixels.
    let ahead = MapGeometry { cell_size_mm: 1000, x_first: 3, x_count: 8, y_first: 0, y_count: 5 };
    let mut seen = [0; 3];
    for (world, geometry) in
        worlds.iter().flat_map(|w| [MapGeometry::default(), small, ahead].map(|geometry| (w, geometry)))
    {
        // What obstacles smear is looked at for itself.
        let settings = MapSettings { geometry, max_range_m: 14.0, smear_share: 0.0, ..MapSettings::default() };
        let pixels = if geometry == small { world.render() } else { speckled(world.render()) };
        let made = make_of(world, pixels, settings, &GroundSettings::default());
        assert!(made.ground.is_some());
        let votes = plain_votes(world, &made);
        votes.iter().for_each(|votes| (0..3).for_each(|kind| seen[kind] += votes.least[kind]));
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
                    let [least, most] = votes.height_m;
                    let [low, high] = [least - 0.002, most + 0.002].map(|height| (height * 10.0) as u8);
                    assert!((low..=high).contains(&cell.height_dm), "{least} to {most} m: {what}");
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
        let enough = counts[0] > 3 && counts[1] > 50 && counts[3] * 25 < geometry.len();
        assert!(enough || geometry == ahead, "{counts:?}");
    }
    std::println!("votes for obstacle, ground, unclear: {seen:?}");
    assert!(seen.iter().all(|votes| *votes > 2000), "{seen:?}");
}
