//! Columns, plane and costs against plain evaluations of every point in f64.

use std::{boxed::Box, vec, vec::Vec};

use nalgebra::{Matrix3, SymmetricEigen};

use super::*;
use crate::{
    disparity::DisparityPixel,
    map::{MapGeometry, MapSettings},
    obstacles::ObstacleSettings,
    test_random::Random,
    test_world::{DISPARITIES, PAIR, Patch, Point, Stages, World, ground},
};

const CELLS: usize = 2500;

struct Made {
    pixels: Vec<DisparityPixel>,
    stages: Stages,
    map: Box<MapBuilder<CELLS>>,
    detector: CostMap,
}

impl Made {
    fn new(world: &World, noise: f64, random: &mut Random) -> Self {
        let (ground, obstacles) = (GroundSettings::default(), ObstacleSettings::default());
        let mut pixels = world.render();
        for pixel in pixels.iter_mut().filter(|pixel| pixel.has_value()) {
            let steps = f64::from(pixel.steps()) + random.within(-noise, noise);
            *pixel = DisparityPixel::from_steps(steps.round().clamp(1.0, 1500.0) as u16);
        }
        let mut map = Box::new(MapBuilder::new());
        map.configure(&MapSettings::default(), (0.25, 2.2)).unwrap();
        let mut detector = CostMap::new();
        detector.configure(&CostMapSettings::default(), &ground, 320 * 240).unwrap();
        Self { pixels, stages: Stages::new(&world.mount(), &ground, &obstacles), map, detector }
    }

    fn run(&mut self) -> (Option<GroundPlane>, Vec<u8>) {
        let Self { pixels, stages, map, detector } = self;
        let picture = DisparityPicture::new(pixels, 320);
        let Stages { frame, place, rays, depth, .. } = stages;
        let nearest_m = PAIR.distance_m(DISPARITIES as f32 - 2.0);
        let view = View { pair: &PAIR, frame, place, rays, depth, nearest_m };
        let ground = detector.ground(picture, &view, map);
        let mut codes = vec![9; pixels.len()];
        detector.count(picture, &view, &ground.unwrap_or(GroundPlane::of_mount(frame)), map, &mut codes);
        (ground, codes)
    }

    /// Every point, with its column.
    fn points(&self, world: &World) -> Vec<(Point, Option<usize>)> {
        let scale = f64::from(PAIR.focal_px) * f64::from(PAIR.baseline_m) * 16.0;
        let numbered = self.pixels.iter().enumerate().filter(|(_, pixel)| pixel.has_value());
        numbered
            .map(|(i, pixel)| {
                let z = scale / f64::from(pixel.steps());
                let p = Point::new(0.0, 0.0, world.height_m) + world.direction((i % 320) as f64, (i / 320) as f64) * z;
                let at = world.to_vehicle(p);
                let (i, j) = ((at.x / 0.5).floor(), (at.y / 0.5).floor());
                let inside = i.abs() < 1000.0 && j.abs() < 1000.0;
                (p, if inside { MapGeometry::default().index(i as i16, j as i16) } else { None })
            })
            .collect()
    }
}

fn scene(random: &mut Random) -> World {
    let mut world = World::level(random.within(0.8, 1.6), random.within(5.0, 20.0), random.within(-4.0, 4.0));
    world.place = (random.within(-1.0, 1.0), random.within(-1.0, 1.0), random.within(-40.0, 40.0));
    for _ in 0..4 {
        let (x, y) = (random.within(2.5, 9.0), random.within(-3.0, 3.0));
        world.add_box([x, y, 0.0], [x + 0.6, y + random.within(0.3, 2.0), random.within(0.1, 2.0)], 25.0);
    }
    world
}

#[test]
fn the_plane_is_that_through_the_points_of_flat_columns() {
    let mut random = Random::seeded("flat columns", 0x5eed_0125);
    for round in 0..15 {
        let world = scene(&mut random);
        let mut made = Made::new(&world, 2.0, &mut random);
        let (found, _) = made.run();
        let found = found.expect("level ground is seen");
        let points = made.points(&world);
        let mut columns = vec![Vec::new(); CELLS];
        points.iter().for_each(|(p, column)| {
            if let Some(column) = column {
                columns[*column].push(*p);
            }
        });
        let mean = |points: &[Point]| points.iter().sum::<Point>() / points.len().max(1) as f64;
        let flat = columns.iter().filter(|points| {
            let level = mean(points).z;
            let variance = points.iter().map(|p| (p.z - level).powi(2)).sum::<f64>() / points.len() as f64;
            points.len() >= 10 && variance.sqrt() <= 0.03 && level.abs() <= 0.5
        });
        let flat: Vec<Point> = flat.flatten().copied().collect();
        let middle = mean(&flat);
        let scatter: Matrix3<f64> = flat.iter().map(|p| (p - middle) * (p - middle).transpose()).sum();
        let eigen = SymmetricEigen::new(scatter);
        let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        let normal = if normal.z < 0.0 { -normal } else { normal };
        let tilt = Point::from(found.normal.map(f64::from));
        let tilt_deg = tilt.cross(&normal).norm().atan2(tilt.dot(&normal)).to_degrees();
        let height = normal.dot(&(Point::new(0.0, 0.0, world.height_m) - middle));
        // A column at the limit may fall to either side.
        assert!(tilt_deg < 0.1, "round {round}: {tilt_deg} degrees off");
        assert!((f64::from(found.camera_height_m) - height).abs() < 0.005, "round {round}");
        assert!((height - world.height_m).abs() < 0.05, "round {round}: the ground is found");
        assert!((f64::from(found.support) / flat.len() as f64 - 1.0).abs() < 0.02, "round {round}");
    }
}

#[test]
fn costs_are_the_numbers_of_points_in_the_band_above_the_plane() {
    let mut random = Random::seeded("costs", 0x5eed_0126);
    let (mut costly, mut points_seen) = (0, 0);
    for round in 0..15 {
        let world = scene(&mut random);
        let mut made = Made::new(&world, 6.0, &mut random);
        let (ground, _) = made.run();
        let frame = &made.stages.frame;
        let plane = ground.unwrap_or(GroundPlane::of_mount(frame));
        let normal = Point::from(plane.normal.map(f64::from));
        let (mut counts, mut unsure) = (vec![[0_i32; 2]; CELLS], vec![0_i32; CELLS]);
        for (p, column) in made.points(&world) {
            let height = normal.dot(&p) - f64::from(plane.offset_m);
            let near = 1.0e-4 * (1.0 + p.norm());
            let at = world.to_vehicle(p);
            let edge = |x: f64| ((x / 0.5).round() * 0.5 - x).abs() < near;
            let limit = |h: f64| (height - h).abs() < near;
            if edge(at.x) || edge(at.y) || limit(0.25) || limit(-0.25) || limit(1.25) {
                for (dx, dy) in [(near, near), (near, -near), (-near, near), (-near, -near)] {
                    let (i, j) = (((at.x + dx) / 0.5).floor(), ((at.y + dy) / 0.5).floor());
                    if let Some(column) = MapGeometry::default().index(i as i16, j as i16) {
                        unsure[column] += 1;
                    }
                }
                continue;
            }
            let Some(column) = column else { continue };
            counts[column][0] += i32::from((0.25..=1.25).contains(&height));
            counts[column][1] += i32::from(height.abs() < 0.25);
            points_seen += 1;
        }
        for (index, slot) in made.map.table().iter().enumerate() {
            let found = [i32::from(slot.obstacle), i32::from(slot.ground)];
            for (found, expected) in found.into_iter().zip(counts[index]) {
                let off = found - expected;
                assert!(off >= 0 && off <= unsure[index], "round {round}, column {index}: {found}, not {expected}");
            }
            costly += i32::from(found[0] > 0);
        }
    }
    assert!(costly > 300 && points_seen > 500_000, "{costly}, {points_seen}");
}

#[test]
fn a_cell_is_what_its_counts_say() {
    let mut detector = CostMap::new();
    detector.configure(&CostMapSettings::default(), &GroundSettings::default(), 1).unwrap();
    let far = Cell { state: CellState::Unknown(UnknownReason::TooFar), ..Cell::default() };
    let free = Cell { state: CellState::Free, pixels: 3, ..Cell::CERTAIN };
    for cell in [Cell::default(), free, far] {
        for (obstacle, ground, ground_seen) in
            (0..40).flat_map(|o| [0, 9, 10, 500].into_iter().flat_map(move |g| [(o, g, true), (o, g, false)]))
        {
            let counted = Evidence { obstacle, ground, unclear: 3, height_dm: 8 };
            let found = detector.verdict(&counted, cell, ground_seen);
            let unknown = |state| Cell { state, cost: obstacle, ..Cell::default() };
            let expected = match obstacle {
                _ if cell == far => unknown(far.state),
                20.. => {
                    Cell { state: CellState::Obstacle, pixels: obstacle, height_dm: 8, cost: obstacle, ..Cell::CERTAIN }
                }
                0 if ground >= 10 && ground_seen => Cell { state: CellState::Free, pixels: ground, ..Cell::CERTAIN },
                _ if cell == free => unknown(CellState::Unknown(UnknownReason::TooFewPixels)),
                _ => unknown(cell.state),
            };
            assert_eq!(found, expected, "{counted:?}");
        }
    }
}

/// The plane of a world under these limits, with at least so many columns, and how many are flat.
fn plane_under(world: &World, ground: GroundSettings, min_columns: u16) -> (Option<GroundPlane>, u16) {
    let mut made = Made::new(world, 0.0, &mut Random::seeded("no noise", 0));
    let settings = CostMapSettings { min_columns, max_level_m: 1.2, ..CostMapSettings::default() };
    made.detector.configure(&settings, &ground, 320 * 240).unwrap();
    let Made { pixels, stages, map, detector } = &mut made;
    let Stages { frame, place, rays, depth, .. } = stages;
    let view = View { pair: &PAIR, frame, place, rays, depth, nearest_m: 0.0 };
    let found = detector.ground(DisparityPicture::new(pixels, 320), &view, map);
    (found, map.table().iter().filter(|slot| detector.is_flat(Column::of(slot))).count() as u16)
}

#[test]
fn a_plane_that_is_too_steep_or_above_the_camera_or_hardly_seen_is_none() {
    let (world, usual) = (World::level(1.2, 12.0, 2.0), GroundSettings::default());
    let (found, flat) = plane_under(&world, usual, 1);
    let support = found.expect("level ground is seen").support as f32;
    assert!(flat > 10 && support > 1000.0, "{flat} columns, {support} points");
    assert!(plane_under(&world, usual, flat).0.is_some());
    assert_eq!(plane_under(&world, usual, flat + 1).0, None, "one column is missing");
    let permille = |support: f32| GroundSettings { min_support_permille: support / 76.8, ..usual };
    assert!(plane_under(&world, permille(support - 9.0), 1).0.is_some());
    assert_eq!(plane_under(&world, permille(support + 9.0), 1).0, None, "points are missing");

    // A slope that is gentle enough for columns to be flat.
    let mut slope = World::empty(1.2, 12.0, 0.0);
    slope.patches.push(Patch::across(Point::new(-2.0_f64.to_radians().tan(), 0.0, 1.0), Point::zeros(), 100.0));
    assert!(plane_under(&slope, GroundSettings { max_tilt_deg: 2.4, ..usual }, 1).0.is_some());
    assert_eq!(plane_under(&slope, GroundSettings { max_tilt_deg: 1.6, ..usual }, 1).0, None);

    let mut ceiling = World::empty(0.4, -12.0, 0.0);
    ceiling.patches.push(ground(1.1));
    let (found, flat) = plane_under(&ceiling, usual, 1);
    assert!(flat > 10 && found.is_none(), "{flat} columns, {found:?}");
}

#[test]
fn pixels_are_obstacle_or_ground_up_to_the_limits_and_at_them() {
    let world = World::empty(1.0, 10.0, 0.0);
    let mut made = Made::new(&world, 0.0, &mut Random::seeded("no noise", 0));
    made.pixels.fill(DisparityPixel::from_steps(300));
    let Made { pixels, stages, map, detector } = &mut made;
    let Stages { frame, place, rays, depth, .. } = stages;
    let view = View { pair: &PAIR, frame, place, rays, depth, nearest_m: 0.0 };
    let (picture, level) = (DisparityPicture::new(pixels, 320), GroundPlane::of_mount(frame));
    let heights: Vec<f32> =
        (0..240).map(|y| level.height_m(row_points(picture, depth, rays, y).next().unwrap().1)).collect();
    let mut codes = vec![9; pixels.len()];
    for (low, high) in [(0.3, 0.9), (heights[30], heights[9]), (-heights[220], heights[2])] {
        let settings = CostMapSettings { min_height_m: low, max_height_m: high, ..CostMapSettings::default() };
        detector.configure(&settings, &GroundSettings::default(), 1).unwrap();
        detector.count(picture, &view, &level, map, &mut codes);
        for (y, &height) in heights.iter().enumerate() {
            let expected = match height {
                h if h >= low && h <= high => OBSTACLE,
                h if h > -low && h < low => GROUND,
                _ => OTHER,
            };
            assert_eq!(codes[y * 320], expected, "{height} m, from {low} to {high} m");
        }
    }
}

#[test]
fn columns_hold_as_many_points_as_they_have_room_for() {
    // All of the picture in one column: more points than 16 bits count.
    let mut world = World::empty(1.0, 0.0, 0.0);
    world.place = (0.0, 0.5, 0.0);
    let mut made = Made::new(&world, 0.0, &mut Random::seeded("full columns", 0));
    made.pixels.fill(DisparityPixel::from_steps(16 * 91));
    let geometry = MapGeometry { cell_size_mm: 1000, x_first: 0, x_count: 4, y_first: -2, y_count: 4 };
    made.map.configure(&MapSettings { geometry, ..MapSettings::default() }, (0.25, 2.2)).unwrap();
    let Made { pixels, stages, map, detector } = &mut made;
    let Stages { frame, place, rays, depth, .. } = stages;
    let view = View { pair: &PAIR, frame, place, rays, depth, nearest_m: 0.0 };
    detector.measure(DisparityPicture::new(pixels, 320), &view, map);
    let points: Vec<u16> =
        map.table().iter().map(|slot| Column::of(slot).points).filter(|&points| points > 0).collect();
    assert_eq!(points, [u16::MAX]);
}

#[test]
fn numbers_of_a_column_come_back_from_where_its_votes_will_lie() {
    let mut random = Random::seeded("slots", 0x5eed_0127);
    for _ in 0..10_000 {
        let (points, level_cm, sum) = (random.next() as u16, random.next() as i8, random.next() as u32);
        let column = Column { points, level_cm, sum };
        let mut slot = Evidence::default();
        column.put(&mut slot);
        assert_eq!(Column::of(&slot), column);
    }
}

/// Before it is configured no column has to be flat, and none is.
#[test]
fn a_cost_map_without_settings_finds_no_plane() {
    let Made { pixels, stages, mut map, .. } =
        Made::new(&World::level(1.2, 12.0, 2.0), 0.0, &mut Random::seeded("no noise", 0));
    let Stages { frame, place, rays, depth, .. } = &stages;
    let view = View { pair: &PAIR, frame, place, rays, depth, nearest_m: 0.0 };
    assert_eq!(CostMap::new().ground(DisparityPicture::new(&pixels, 320), &view, &mut map), None);
}
