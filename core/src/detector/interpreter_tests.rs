//! Every detector on worlds whose truth is known: what each finds, where each fails as the paper says, and what two say together.

use std::{boxed::Box, vec::Vec};

use super::*;
use crate::{
    disparity::{DisparityPixel, Reason},
    geometry::{Mount, Place, Rays, RectifiedPair, VehicleFrame},
    ground::GroundSettings,
    map::{Cell, CellState, Doubt, UnknownReason},
    matching::MatchSettings,
    surfaces::SurfaceClass,
    test_random::Random,
    test_world::{DISPARITIES, Patch, World},
};

const CELLS: usize = 2500;

type Small = Interpreter<{ 320 * 240 }, 320, DISPARITIES, 1024, CELLS>;
type Found = Detection<32, CELLS>;

fn settings(detector: DetectorKind, cross_check: Option<DetectorKind>) -> Settings {
    Settings {
        detector,
        cross_check,
        matching: MatchSettings { disparities: DISPARITIES as u16, ..MatchSettings::DEFAULT },
        ground: GroundSettings { hold_frames: 0, ..GroundSettings::default() },
        ..Settings::default()
    }
}

fn setup(pair: &RectifiedPair, mount: &Mount) -> Setup {
    let frame = VehicleFrame::new(&mount.without_place()).unwrap();
    Setup {
        pair: *pair,
        picture_sizes: [(320, 240); 2],
        vehicle_frame: VehicleFrame::new(mount).unwrap(),
        frame,
        place: Place::new(mount),
        rays: Rays::new(pair, &frame),
        nearest_m: pair.distance_m(DISPARITIES as f32 - 2.0),
        sector_width_deg: 5.0,
    }
}

struct Look {
    found: Box<Found>,
    classes: Vec<Option<SurfaceClass>>,
}

/// What the detectors make of disparities that a camera in `world` has.
fn look_at(world: &World, pixels: &[DisparityPixel], settings: &Settings) -> Look {
    let mut interpreter = Box::new(Small::new());
    let setup = setup(&world.pair, &world.mount());
    interpreter.configure(settings, &setup, true).unwrap();
    let mut found = Box::new(Found::new());
    found.clear();
    interpreter.run(DisparityPicture::new(pixels, 320), &setup, &mut found, &mut Alone, &mut ());
    let class = |i: usize| interpreter.surfaces.surface_at(i % 320, i / 320).map(|surface| surface.class);
    Look { classes: (0..pixels.len()).map(class).collect(), found }
}

fn look(world: &World, kind: DetectorKind) -> Look {
    look_at(world, &world.render(), &settings(kind, None))
}

impl Look {
    /// Middles of the cells in a state, in the vehicle frame.
    fn cells(&self, state: CellState) -> Vec<(f32, f32)> {
        let map = &self.found.map;
        let of_state = map.cells.iter().enumerate().filter(|(_, cell)| cell.state == state);
        of_state.map(|(index, _)| map.geometry.cell_at(index)).map(|(i, j)| map.geometry.centre_m(i, j)).collect()
    }
}

/// Rectangles on the ground, metres: x from and to, y from and to.
const BOXES: [[f64; 4]; 2] = [[3.0, 3.6, 0.3, 1.1], [6.0, 7.0, -2.5, -1.0]];

fn boxes(lowest_m: f64) -> World {
    let mut world = World::level(1.2, 12.0, 2.0);
    for [x0, x1, y0, y1] in BOXES {
        world.add_box([x0, y0, lowest_m], [x1, y1, lowest_m + 1.0], 0.0);
    }
    world
}

/// Distance of a cell's middle from the nearest box, metres.
fn off_boxes((x, y): (f32, f32)) -> f64 {
    let outside = |low: f64, high: f64, at: f32| (low - f64::from(at)).max(f64::from(at) - high).max(0.0);
    let off = |[x0, x1, y0, y1]: [f64; 4]| outside(x0, x1, x).hypot(outside(y0, y1, y));
    BOXES.into_iter().map(off).fold(f64::INFINITY, f64::min)
}

#[test]
fn all_but_the_segments_find_what_stands_on_level_ground() {
    let world = boxes(0.0);
    for kind in DetectorKind::ALL.into_iter().filter(|kind| *kind != DetectorKind::DisparitySegments) {
        let name = kind.name();
        let look = look(&world, kind);
        assert_eq!(look.found.detectors, Detectors::new(kind, None));
        let plane = look.found.ground.unwrap_or_else(|| panic!("{name}: no ground"));
        assert!((plane.camera_height_m - 1.2).abs() < 0.03, "{name}: {plane:?}");
        let (obstacles, free) = (look.cells(CellState::Obstacle), look.cells(CellState::Free));
        std::println!("{name}: {} obstacle cells, {} free", obstacles.len(), free.len());
        for x_y in &obstacles {
            assert!(off_boxes(*x_y) < 0.75, "{name}: obstacle at {x_y:?}");
        }
        for (number, [x0, _, y0, y1]) in BOXES.into_iter().enumerate() {
            let front = |&(x, y): &(f32, f32)| {
                (f64::from(x) - x0).abs() < 0.5 && f64::from(y) > y0 - 0.25 && f64::from(y) < y1 + 0.25
            };
            assert!(obstacles.iter().any(front), "{name}: box {number} is not found");
            let near = |o: &&crate::obstacles::Obstacle| (f64::from(o.mean_m[0]) - x0).abs() < 0.6;
            let listed = look.found.obstacles.iter().find(near);
            assert!(listed.is_some_and(|o| (o.max_m[2] - 1.0).abs() < 0.25), "{name}: {:?}", look.found.obstacles);
        }
        assert!(free.len() > 100, "{name}: {} free cells", free.len());
        // Ground is free up to the foot of a box, never beyond it.
        let inside = |&(x, y): &(f32, f32)| {
            let deep = |at: f32, low: f64, high: f64| f64::from(at) > low + 0.25 && f64::from(at) < high - 0.25;
            BOXES.into_iter().any(|[x0, x1, y0, y1]| deep(x, x0, x1) && deep(y, y0, y1))
        };
        assert!(!free.iter().any(inside), "{name}: free inside a box");
        let costs = look.found.map.cells.iter().filter(|cell| cell.cost > 0).count();
        assert_eq!(costs > 0, kind == DetectorKind::CostMap, "{name}");
        let certain = |cell: &Cell| match cell.state {
            CellState::Unknown(_) => cell.confidence_percent == 0,
            _ => cell.confidence_percent == 100,
        };
        assert!(look.found.map.cells.iter().all(|cell| certain(cell) && cell.doubt == Doubt::None), "{name}");
    }
}

/// The paper, section 4.3 and Figure 10: an object that stands on the ground is one segment with it, and cells are obstacles
/// where none exist. One that hangs free of the ground in the picture is found as it should be.
#[test]
fn segments_melt_into_the_ground_that_they_stand_on() {
    // How many cells are wrong follows from how few pixels one takes: as few as this count was made for.
    let mut few = settings(DetectorKind::DisparitySegments, None);
    few.map.obstacle_min_pixels = 24;
    let standing = look_at(&boxes(0.0), &boxes(0.0).render(), &few);
    let false_cells = standing.cells(CellState::Obstacle).into_iter().filter(|at| off_boxes(*at) > 1.0).count();
    assert!(false_cells > 100, "{false_cells} obstacle cells on bare ground");
    assert!(standing.cells(CellState::Free).len() < 20 && standing.found.ground.is_none());

    // The same boxes, without disparities where they touch the ground.
    let world = boxes(0.0);
    let mut pixels = world.render();
    for (i, pixel) in pixels.iter_mut().enumerate() {
        let at = |x: usize, y: usize| world.hit(x as f64, y as f64).map_or(0.0, |(_, patch)| patch.normal().z);
        let (x, y) = (i % 320, i / 320);
        let touches =
            (y.saturating_sub(3)..y + 4).any(|row| (x.saturating_sub(3)..x + 4).any(|col| at(col, row) < 0.5));
        if touches && at(x, y) > 0.5 {
            *pixel = DisparityPixel::none(Reason::NotUnique);
        }
    }
    let apart = look_at(&world, &pixels, &settings(DetectorKind::DisparitySegments, None));
    let obstacles = apart.cells(CellState::Obstacle);
    assert!(!obstacles.is_empty() && obstacles.iter().all(|at| off_boxes(*at) < 0.75), "{obstacles:?}");
    assert!(apart.cells(CellState::Free).len() > 100 && apart.found.ground.is_some());

    // What melts into the ground there is told apart from it inside tiles.
    let surfaces = look(&boxes(0.0), DetectorKind::SurfaceNormals);
    assert!(surfaces.cells(CellState::Obstacle).into_iter().all(|at| off_boxes(at) < 0.75));
}

/// Ground that rises by `slope_deg` from `from_m` ahead on.
fn hill(slope_deg: f64, from_m: f64) -> World {
    let mut world = World::empty(1.0, 10.0, 0.0);
    let (sin, cos) = slope_deg.to_radians().sin_cos();
    let half = 15.0;
    world.patches.push(Patch::new([from_m - 20.0, 0.0, 0.0], [20.0, 0.0, 0.0], [0.0, 100.0, 0.0]));
    let middle = [from_m + half * cos, 0.0, half * sin];
    world.patches.push(Patch::new(middle, [half * cos, 0.0, half * sin], [0.0, 100.0, 0.0]));
    world
}

/// The paper, section 4.1 and Figure 8: a sloping hill gives no column that is flat enough, the level of the mount takes the
/// place of the ground, and the hill is an obstacle.
#[test]
fn a_hill_is_an_obstacle_for_the_cost_map_and_ground_for_the_surfaces() {
    for (slope_deg, from_m) in [(15.0, 1.0), (15.0, 2.0), (18.0, 1.0)] {
        let what = std::format!("{slope_deg} degrees from {from_m} m");
        let world = hill(slope_deg, from_m);
        let costs = look(&world, DetectorKind::CostMap);
        let surfaces = look(&world, DetectorKind::SurfaceNormals);
        let count = |look: &Look, state| look.cells(state).len();
        let (false_alarms, free) = (count(&costs, CellState::Obstacle), count(&costs, CellState::Free));
        std::println!(
            "{what}: cost-map calls {false_alarms} cells obstacles, {free} free, ground {:?}",
            costs.found.ground
        );
        assert!(false_alarms > 30, "{what}: cost-map calls {false_alarms} cells of the hill obstacles");
        if from_m == 1.0 {
            assert!(costs.found.ground.is_none() && free == 0, "{what}: nothing is flat");
        }
        assert_eq!(count(&surfaces, CellState::Obstacle), 0, "{what}: {:?}", surfaces.found.obstacles);
        assert!(count(&surfaces, CellState::Free) > 100, "{what}: {} free", count(&surfaces, CellState::Free));
    }
    // A gentle one is ground for both.
    let gentle = look(&hill(5.0, 1.0), DetectorKind::CostMap);
    assert_eq!(gentle.cells(CellState::Obstacle), []);
    assert!(gentle.found.ground.is_some());
}

#[test]
fn ground_that_bends_deviates_from_one_plane() {
    // What one plane for the whole picture cannot follow, the surfaces do.
    let world = hill(12.0, 5.0);
    assert!(look(&world, DetectorKind::GroundDeviation).cells(CellState::Obstacle).len() > 20);
    assert_eq!(look(&world, DetectorKind::SurfaceNormals).cells(CellState::Obstacle), []);
}

#[test]
fn a_checked_frame_is_the_unchecked_one_but_for_doubts() {
    let worlds = [boxes(0.0), hill(15.0, 2.0), World::level(1.2, 10.0, 0.0)];
    let mut disputed = 0;
    for world in &worlds {
        let pixels = world.render();
        let alone: Vec<Look> =
            DetectorKind::ALL.map(|kind| look_at(world, &pixels, &settings(kind, None))).into_iter().collect();
        for (main, kind) in DetectorKind::ALL.into_iter().enumerate() {
            for (check, other) in DetectorKind::ALL.into_iter().enumerate().filter(|(check, _)| *check != main) {
                let what = std::format!("{} checked by {}", kind.name(), other.name());
                let both = look_at(world, &pixels, &settings(kind, Some(other)));
                let (one, two) = (&alone[main], &alone[check]);
                assert_eq!(both.found.detectors.cross_check(), Some(other));
                assert_eq!(
                    (&both.found.obstacles, both.found.ground),
                    (&one.found.obstacles, one.found.ground),
                    "{what}"
                );
                assert!(both.classes == one.classes, "{what}: the classes that are left are those of the first");
                let mut doubts = [0; 3];
                for ((cell, one), two) in
                    both.found.map.cells.iter().zip(&one.found.map.cells).zip(&two.found.map.cells)
                {
                    doubts[cell.doubt as usize] += 1;
                    assert_eq!(cell.state == CellState::Obstacle, one.state == CellState::Obstacle, "{what}");
                    match (one.state, two.state) {
                        (CellState::Free, CellState::Obstacle) => {
                            assert_eq!(cell.state, CellState::Unknown(UnknownReason::Disputed), "{what}");
                        }
                        _ => assert_eq!(cell.state, one.state, "{what}"),
                    }
                    let less = cell.confidence_percent < one.confidence_percent;
                    assert_eq!(less, cell.doubt != Doubt::None, "{what}: {cell:?}");
                }
                let counted = both.found.statistics;
                assert_eq!([counted.cells_unconfirmed, counted.cells_disputed], [doubts[1], doubts[2]], "{what}");
                disputed += doubts[2];
            }
        }
    }
    assert!(disputed > 100, "{disputed} cells are disputed");
}

/// The ground that each of the two holds is its own, and both forget it.
#[test]
fn the_ground_is_held_by_each_detector_for_itself() {
    let world = World::level(1.0, 12.0, 0.0);
    let (ground, nothing) = (world.render(), std::vec![DisparityPixel::none(Reason::LowTexture); 320 * 240]);
    let mut held = settings(DetectorKind::SurfaceNormals, Some(DetectorKind::PixelNormals));
    held.ground.hold_frames = 3;
    let setup = setup(&world.pair, &world.mount());
    let mut interpreter = Box::new(Small::new());
    let mut found = Box::new(Found::new());
    // For each picture the frames since the main detector saw the ground, and since the other one did.
    let mut ages = |interpreter: &mut Small, pixels: &[DisparityPixel]| {
        found.clear();
        interpreter.run(DisparityPicture::new(pixels, 320), &setup, &mut found, &mut Alone, &mut ());
        [found.ground, interpreter.ground_of_check].map(|plane| plane.map(|plane| plane.age_frames))
    };
    interpreter.configure(&held, &setup, true).unwrap();
    assert_eq!(ages(&mut interpreter, &ground), [Some(0), Some(0)]);
    assert_eq!(ages(&mut interpreter, &nothing), [Some(1), Some(1)]);
    assert_eq!(ages(&mut interpreter, &nothing), [Some(2), Some(2)]);
    assert_eq!(ages(&mut interpreter, &ground), [Some(0), Some(0)]);
    interpreter.forget();
    assert_eq!(ages(&mut interpreter, &nothing), [None, None]);
}

#[test]
fn a_detector_does_not_check_itself() {
    let mut interpreter = Box::new(Small::new());
    let world = World::level(1.0, 10.0, 0.0);
    for kind in DetectorKind::ALL {
        let refused = interpreter.configure(&settings(kind, Some(kind)), &setup(&world.pair, &world.mount()), true);
        assert_eq!(refused.map_err(|error| error.field), Err("cross_check"));
    }
}

#[test]
fn any_disparities_are_survived_and_leave_nothing_behind() {
    let mut random = Random::seeded("any disparities", 0x5eed_012b);
    let good = boxes(0.0).render();
    let mut interpreter = Box::new(Small::new());
    let mut fresh = Box::new(Small::new());
    let mut found = [Box::new(Found::new()), Box::new(Found::new())];
    for round in 0..60 {
        let mut pick = |values: &[f32]| values[random.below(values.len() as u32) as usize];
        let pair = RectifiedPair {
            focal_px: pick(&[1.0, 228.0, 1.0e5]),
            cx: pick(&[-1.0e5, 159.5, 1.0e5]),
            cy: pick(&[-1.0e5, 119.5, 1.0e5]),
            baseline_m: pick(&[1.0e-3, 0.2, 100.0]),
            disparity_offset_px: pick(&[-1.0e4, -3.5, 0.0, 1.0e4]),
            ..World::level(1.0, 0.0, 0.0).pair
        };
        let mount = Mount {
            height_m: Some(pick(&[0.02, 1.2, 20.0])),
            pitch_down_deg: pick(&[-60.0, 12.0, 89.0]),
            roll_deg: pick(&[-60.0, 2.0, 60.0]),
            forward_m: pick(&[-50.0, 0.0, 50.0]),
            left_m: pick(&[-50.0, 0.0, 50.0]),
            yaw_left_deg: pick(&[-180.0, 0.0, 90.0]),
        };
        let usual = World::level(1.2, 12.0, 2.0);
        let setup = if round % 2 == 0 { setup(&usual.pair, &usual.mount()) } else { setup(&pair, &mount) };
        let kinds = [random.below(5), random.below(5)].map(|kind| DetectorKind::ALL[kind as usize]);
        let mut settings = settings(kinds[0], Some(kinds[1]).filter(|kind| *kind != kinds[0]));
        settings.pixel_normals.window = 3 + 2 * random.below(10) as u16;
        let kind = random.below(4);
        let mut any: Vec<DisparityPixel> = good.clone();
        for pixel in &mut any {
            match kind {
                0 => *pixel = DisparityPixel::from_bits(random.next() as u16),
                1 => *pixel = DisparityPixel::from_bits(0x7fff - random.below(3) as u16),
                2 if random.below(3) == 0 => *pixel = DisparityPixel::from_bits(random.next() as u16),
                2 => {}
                _ => *pixel = DisparityPixel::from_steps(1 + random.below(4) as u16),
            }
        }
        let height_known = random.below(2) == 0;
        interpreter.configure(&settings, &setup, height_known).unwrap();
        let [found, expected] = &mut found;
        let see = |interpreter: &mut Small, pixels: &[DisparityPixel], found: &mut Found| {
            found.clear();
            interpreter.run(DisparityPicture::new(pixels, 320), &setup, found, &mut Alone, &mut ());
            assert!(found.ground.is_some() || found.statistics.cells_free == 0, "round {round}: free without ground");
            std::format!("{found:?} {:?}", interpreter.surfaces.table())
        };
        see(&mut interpreter, &any, found);
        let after = see(&mut interpreter, &good, found);
        // Another detector that has seen nothing says the same.
        fresh.configure(&settings, &setup, height_known).unwrap();
        assert!(see(&mut fresh, &good, expected) == after, "round {round}: the frame before has a say");
    }
}
