//! Cells against plain evaluations in f64.

mod bands;
mod directions;
mod plain;

use std::{boxed::Box, vec, vec::Vec};

use super::*;
use crate::{
    disparity::{DisparityPicture, DisparityPixel, Reason},
    ground::{GroundPlane, GroundSettings},
    obstacles::ObstacleSettings,
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
    make_of(world, world.render(), settings, ground_settings)
}

fn make_of(
    world: &World,
    pixels: Vec<DisparityPixel>,
    settings: MapSettings,
    ground_settings: &GroundSettings,
) -> Made {
    let obstacles = ObstacleSettings::default();
    let mut stages = Stages::new(&world.mount(), ground_settings, &obstacles);
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
fn votes_that_a_detector_gives_by_itself_make_cells() {
    let made = make(&World::level(1.2, 12.0, 0.0), MapSettings::default(), &GroundSettings::default());
    let mut builder = Box::new(MapBuilder::<CELLS>::new());
    builder.configure(&made.settings, (0.25, 2.5)).unwrap();
    builder.begin();
    for [x, y] in [[5.1, 0.2], [6.1, 0.2], [7.1, 0.2], [-1.0, 0.0], [90.0, 0.0]] {
        (0..2000).for_each(|_| builder.vote([x, y], Vote::Ground));
    }
    for (x, height_m) in [(6.1, 0.72), (6.2, 1.49), (8.1, 0.31), (90.0, 1.0)] {
        (0..2000).for_each(|_| builder.vote([x, 0.2], Vote::Obstacle { height_m }));
    }
    let mut map = Box::new(ObstacleMap::EMPTY);
    let mut finish = |verdict: fn(&Evidence, Cell) -> Cell| {
        let (picture, view) = (DisparityPicture::new(&made.pixels, 320), view(&made.stages));
        builder.finish(picture, &view, made.stages.ground.terrain(), true, &mut map, verdict);
        let cell = |x: f32| map.cells[map.geometry.index_at(x, 0.2).unwrap()];
        ([5.1, 6.1, 7.1, 8.1].map(cell), count(&map, CellState::Free) + count(&map, CellState::Obstacle))
    };
    let (cells, known) = finish(|_, cell| cell);
    use CellState::{Free, Obstacle};
    assert_eq!(cells.map(|cell| cell.state), [Free, Obstacle, Free, Obstacle]);
    assert_eq!(cells.map(|cell| (cell.pixels, cell.height_dm)), [(2000, 0), (4000, 14), (2000, 0), (2000, 3)]);
    assert_eq!(known, 4);
    let (cells, _) = finish(|evidence, cell| Cell { cost: evidence.obstacle + 1, ..cell });
    assert_eq!(cells.map(|cell| cell.cost), [1, 4001, 1, 2001], "the verdict has the last word");
}

#[test]
fn cells_are_claimed_up_to_the_range_and_edges_belong_to_the_cell_behind_them() {
    // From this place the middle of a cell lies exactly 2.5 m away, 1.5 m ahead and 2 m to the left.
    let world = World { place: (0.25, 0.25, 0.0), ..World::level(1.2, 12.0, 0.0) };
    let reason = |max_range_m: f32| {
        let made = make(&world, MapSettings { max_range_m, ..MapSettings::default() }, &GroundSettings::default());
        made.map.cells[made.settings.geometry.index(3, 4).unwrap()].state
    };
    let too_far = CellState::Unknown(UnknownReason::TooFar);
    assert!(reason(2.5) != too_far && reason(2.49) == too_far);
    let geometry = MapGeometry::default();
    for (x, i) in [(1.0, 2), (0.999, 1), (0.0, 0), (-0.001, -1), (12.5, 25)] {
        for (y, j) in [(-0.5, -1), (-0.501, -2), (0.0, 0), (3.0, 6)] {
            assert_eq!(geometry.index_at(x, y), geometry.index(i, j), "{x}, {y}");
        }
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
