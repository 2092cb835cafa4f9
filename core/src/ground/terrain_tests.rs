//! Terrain against the ground that a perfect camera sees in steps of 1/16 px.

use std::{boxed::Box, vec::Vec};

use super::*;
use crate::{
    disparity::Reason,
    geometry::{Mount, VehicleFrame},
    ground::GroundSettings,
    obstacles::ObstacleSettings,
    surfaces::SurfaceSettings,
    test_random::Random,
    test_world::{Patch, Stages, World, ground, tile_of_blocks},
};

/// How the ground rises: distance ahead and height, metres, with straight ground between.
type Profile<'a> = &'a [(f64, f64)];

/// Where the first pixels of the ground come from, metres ahead.
const FIRST_M: f64 = 2.5;

fn world(profile: Profile<'_>) -> World {
    let mut world = World::empty(1.2, 12.0, 0.0);
    for piece in profile.windows(2) {
        let [(x0, z0), (x1, z1)] = [piece[0], piece[1]];
        let middle = [(x0 + x1) / 2.0, 0.0, (z0 + z1) / 2.0];
        world.patches.push(Patch::new(middle, [(x1 - x0) / 2.0, 0.0, (z1 - z0) / 2.0], [0.0, 30.0, 0.0]));
    }
    world
}

fn height_at(profile: Profile<'_>, x: f64) -> f64 {
    let piece = profile.windows(2).find(|piece| x <= piece[1].0).expect("within the profile");
    let [(x0, z0), (x1, z1)] = [piece[0], piece[1]];
    z0 + (x - x0) / (x1 - x0) * (z1 - z0)
}

fn terrain(world: &World) -> Terrain {
    let mut stages = Stages::new(&world.mount(), &GroundSettings::default(), &ObstacleSettings::default());
    stages.ground(&world.render()).expect("there is ground");
    stages.ground.terrain().clone()
}

fn steps(from: f64, to: f64) -> impl Iterator<Item = f64> {
    (0..).map(move |i| from + 0.25 * f64::from(i)).take_while(move |&x| x < to)
}

/// Greatest height of true ground above or below the terrain along the path and a metre to both sides.
fn worst(terrain: &Terrain, x: impl Iterator<Item = f64>, truth: impl Fn(f64, f64) -> f64) -> f64 {
    let off = |x: f64, y: f64| f64::from(terrain.height_m([x as f32, y as f32, truth(x, y) as f32])).abs();
    x.flat_map(|x| [-1.0, 0.0, 1.0].map(|y| off(x, y))).fold(0.0, f64::max)
}

#[test]
fn level_ground_is_level() {
    for (height_m, pitch_down_deg, roll_deg) in [(1.2, 12.0, 0.0), (0.6, 20.0, 3.0), (1.7, 5.0, -4.0)] {
        let world = World::level(height_m, pitch_down_deg, roll_deg);
        let terrain = terrain(&world);
        let lift = steps(0.0, 15.0).flat_map(|x| [-1.0, 0.0, 1.0].map(|y| terrain.lift_m(x as f32, y).abs()));
        let lift = lift.fold(0.0, f32::max);
        let off = worst(&terrain, steps(0.0, 15.0), |_, _| 0.0);
        std::println!("{height_m} m: lifted by {lift:.4} m, {off:.4} m off");
        assert!(lift < 0.015 && off < 0.015, "{height_m} m: lifted by {lift} m, {off} m off");
    }
}

#[test]
fn ground_that_bends_ahead_is_followed() {
    let rise = |degrees: f64, along_m: f64| degrees.to_radians().tan() * along_m;
    let slope = [(0.0, 0.0), (4.0, 0.0), (30.0, rise(10.0, 26.0))];
    let steep = [(0.0, 0.0), (5.0, 0.0), (30.0, rise(15.0, 25.0))];
    let falling = [(0.0, 0.0), (4.0, 0.0), (30.0, rise(-4.0, 26.0))];
    let crest = [(0.0, 0.0), (4.0, 0.0), (9.0, rise(8.0, 5.0)), (30.0, rise(8.0, 5.0))];
    let dip = [(0.0, 0.0), (4.0, 0.0), (8.0, rise(-5.0, 4.0)), (30.0, rise(-5.0, 4.0) + rise(5.0, 22.0))];
    for (name, profile) in
        [("slope", &slope[..]), ("steep slope", &steep), ("falling", &falling), ("crest", &crest), ("dip", &dip)]
    {
        let terrain = terrain(&world(profile));
        let off = worst(&terrain, steps(FIRST_M, 14.0), |x, _| height_at(profile, x));
        std::println!("{name}: {off:.3} m off");
        // Bends are smoothed over a patch on either side.
        assert!(off < 0.1, "{name}: {off} m off");
    }
}

#[test]
fn ground_that_tilts_aside_is_followed() {
    for (ahead_deg, aside_deg) in [(0.0, 8.0), (6.0, -6.0), (-4.0, 10.0)] {
        let [ahead, aside] = [ahead_deg, aside_deg].map(|degrees: f64| degrees.to_radians().tan());
        let mut world = World::empty(1.2, 12.0, 0.0);
        world.patches.push(Patch::new([0.0; 3], [40.0, 0.0, 40.0 * ahead], [0.0, 40.0, 40.0 * aside]));
        let off = worst(&terrain(&world), steps(FIRST_M, 14.0), |x, y| ahead * x + aside * y);
        std::println!("{ahead_deg} and {aside_deg} degrees: {off:.3} m off");
        assert!(off < 0.05, "{ahead_deg} and {aside_deg} degrees: {off} m off");
    }
}

/// A bank beside the path, 15 degrees steep from 2 m to the left on.
#[test]
fn a_bank_is_followed() {
    let foot = 2.0;
    let rise = 15.0_f64.to_radians().tan();
    let mut world = World::empty(1.2, 12.0, 0.0);
    world.patches.push(Patch::new([0.0, foot - 30.0, 0.0], [60.0, 0.0, 0.0], [0.0, 30.0, 0.0]));
    world.patches.push(Patch::new([0.0, foot + 10.0, 10.0 * rise], [60.0, 0.0, 0.0], [0.0, 10.0, 10.0 * rise]));
    let terrain = terrain(&world);
    let mut worst = 0.0_f64;
    for x in steps(5.0, 12.0) {
        for y in steps(-2.0, 4.5).filter(|y| y.abs() < 0.6 * x) {
            let truth = (y - foot).max(0.0) * rise;
            worst = worst.max(f64::from(terrain.height_m([x as f32, y as f32, truth as f32])).abs());
        }
    }
    std::println!("{worst:.3} m off");
    assert!(worst < 0.12, "{worst} m off");
}

/// How far the terrain lies above the ground under the top of a box that is 0.8 m high, from `near` to `far` ahead.
fn lift_under_a_box(near: f64, far: f64, half_width: f64) -> f32 {
    let mut world = World::level(1.7, 12.0, 0.0);
    world.add_box([near, -half_width, 0.0], [far, half_width, 0.8], 0.0);
    let terrain = terrain(&world);
    let points = steps(near + 0.25, far).flat_map(|x| [-0.5, 0.0, 0.5].map(|y| (x, y)));
    let lift = points.map(|(x, y)| terrain.height_m([x as f32, y, 0.0]).abs()).fold(0.0, f32::max);
    std::println!("box from {near} to {far} m: {lift:.3} m off under it");
    lift
}

/// As level as ground, but not to be reached from it.
#[test]
fn the_top_of_a_box_is_not_followed() {
    let boxes = [(5.0, 9.0, 1.5), (4.0, 8.0, 1.0), (4.4, 7.0, 0.8), (5.6, 9.0, 2.0)];
    let followed: Vec<_> =
        boxes.into_iter().filter(|&(near, far, half_width)| lift_under_a_box(near, far, half_width) > 0.1).collect();
    assert!(followed.is_empty(), "{followed:?}");
}

#[test]
fn what_stands_on_the_ground_does_not_lift_it() {
    let mut random = Random::seeded("boxes on the terrain", 0x5eed_0132);
    let mut worst = 0.0_f32;
    for round in 0..30 {
        let mut world = World::level(1.2, 12.0, 0.0);
        let (x, y) = (random.within(2.5, 8.0), random.within(-1.5, 1.5));
        let (width, height) = (random.within(0.3, 1.0), random.within(0.25, 1.1));
        world.add_box([x, y - width / 2.0, 0.0], [x + 0.6, y + width / 2.0, height], random.within(-45.0, 45.0));
        let terrain = terrain(&world);
        for ahead in steps(x - 1.5, x + 1.5) {
            for aside in steps(y - 1.0, y + 1.0) {
                let off = terrain.height_m([ahead as f32, aside as f32, 0.0]).abs();
                worst = worst.max(off);
                assert!(off < 0.06, "round {round}: {off} m off at {ahead}, {aside}; {width} x {height} at {x}, {y}");
            }
        }
    }
    std::println!("ground lifted by up to {worst:.3} m");
}

#[test]
fn a_gap_lies_between_its_edges() {
    // Rising from 6 m on, but not seen between 6 m and 7.5 m.
    let rise = 3.0_f64.to_radians().tan();
    let profile = [(0.0, 0.0), (6.0, 0.0), (30.0, 24.0 * rise)];
    let mut world = world(&profile);
    let unseen = Patch::new([6.75, 0.0, 0.75 * rise + 0.001], [0.75, 0.0, 0.75 * rise], [0.0, 30.0, 0.0]);
    world.patches.push(Patch { hole: Some(Reason::LowTexture), ..unseen });
    let terrain = terrain(&world);
    let height = |x: f64| -f64::from(terrain.height_m([x as f32, 0.0, 0.0]));
    for x in steps(6.0, 7.5) {
        assert!((-0.02..=1.5 * rise + 0.02).contains(&height(x)), "{} m at {x} m", height(x));
    }
    for x in steps(FIRST_M, 5.5).chain(steps(8.25, 14.0)) {
        assert!((height(x) - height_at(&profile, x)).abs() < 0.06, "{} m at {x} m", height(x));
    }
}

#[test]
fn without_surfaces_the_plane_remains() {
    let mut stages = Stages::new(&Mount::default(), &GroundSettings::default(), &ObstacleSettings::default());
    let level = GroundPlane::of_mount(&VehicleFrame::new(&Mount::default()).unwrap());
    let world = World { patches: std::vec![ground(0.0)], ..World::empty(1.2, 12.0, 0.0) };
    stages.ground(&world.render());
    stages.ground.forget();
    assert_eq!(stages.ground(&World::empty(1.2, 12.0, 0.0).render()), None);
    let terrain = stages.ground.terrain();
    assert_eq!(*terrain.plane(), level);
    assert!(steps(-5.0, 60.0).all(|x| [-40.0, 0.0, 40.0].iter().all(|&y| terrain.lift_m(x as f32, y) == 0.0)));
}

#[test]
fn between_the_middles_of_patches_the_ground_is_straight() {
    let mut random = Random::seeded("patches", 0x5eed_0133);
    let mut terrain = Terrain { patch_m: 0.5, ..Terrain::new() };
    let (slope, aside, level) = (0.3_f32, -0.2_f32, 0.1_f32);
    for (i, row) in terrain.lift_m.iter_mut().enumerate() {
        for (j, lift) in row.iter_mut().enumerate() {
            let (x, y) = ((i as f32 + 0.5) * 0.5, (j as f32 + 0.5 - 20.0) * 0.5);
            *lift = level + slope * x + aside * y;
        }
    }
    for _ in 0..1000 {
        let (x, y) = (random.within(0.25, 19.75) as f32, random.within(-9.75, 9.75) as f32);
        let truth = level + slope * x + aside * y;
        assert!((terrain.lift_m(x, y) - truth).abs() < 1.0e-4, "{x}, {y}");
    }
    // Beyond the patches the last one counts.
    let corner = (19.75, 9.75);
    for (x, y, at) in
        [(25.0, 0.0, (19.75, 0.0)), (-3.0, 2.0, (0.25, 2.0)), (5.0, 40.0, (5.0, 9.75)), (25.0, 40.0, corner)]
    {
        assert!((terrain.lift_m(x, y) - (level + slope * at.0 + aside * at.1)).abs() < 1.0e-4, "{x}, {y}");
    }
}

#[test]
fn each_patch_takes_in_what_the_others_know_by_distance() {
    let mut random = Random::seeded("spread", 0x5eed_0134);
    let patches: [[f32; ACROSS]; AHEAD] = core::array::from_fn(|_| {
        core::array::from_fn(|_| if random.below(8) == 0 { random.within(0.0, 50.0) as f32 } else { 0.0 })
    });
    for share in [0.0_f32, 0.15, 0.9] {
        let mut found = patches;
        spread(&mut found, share);
        for (i, row) in found.iter().enumerate() {
            for (j, found) in row.iter().enumerate() {
                let mut expected = 0.0;
                for (k, row) in patches.iter().enumerate() {
                    for (l, own) in row.iter().enumerate() {
                        let steps = (i.abs_diff(k) + j.abs_diff(l)) as i32;
                        expected += f64::from(*own) * f64::from(share).powi(steps);
                    }
                }
                let off = (f64::from(*found) - expected).abs();
                assert!(off <= 1.0e-5 * expected + 1.0e-6, "share {share}, patch {i}, {j}: {found}, not {expected}");
            }
        }
    }
}

#[test]
fn no_place_is_out_of_reach() {
    let terrain = terrain(&World::level(1.2, 12.0, 0.0));
    let places = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 29.9, 30.0, -15.0, 15.0, 1.0e30, -1.0e30];
    for (x, y) in places.into_iter().flat_map(|x| places.map(|y| (x, y))) {
        let _ = terrain.lift_m(x, y);
    }
}

/// Bends whose numbers are exact.
const BEND: Bend = Bend { patch_m: 0.5, share: 0.0, max_slope: 0.5, tolerance_m: 0.25, tolerance_per_m: 0.125 };

/// A terrain of patches of half a metre, on a plane with exact numbers, of which some patches are known: with their lifts.
fn known(patches: &[(usize, usize, f32)]) -> Terrain {
    let plane = GroundPlane { normal: [0.125, 0.25, 0.5], ..GroundPlane::UNSET };
    let mut terrain = Terrain { plane, patch_m: 0.5, ..Terrain::new() };
    for &(i, j, lift_m) in patches {
        terrain.weight[i][j] = LEAST_WEIGHT;
        terrain.sum_m[i][j] = LEAST_WEIGHT * lift_m;
    }
    terrain
}

/// One point, and behind it what is not there.
fn point(x: f32, y: f32, height: f32, sure: bool) -> Points {
    Points { count: 1, x_m: [x; LANES], y_m: [y; LANES], height_m: [height; LANES], sure: [sure; LANES] }
}

#[test]
fn ground_is_expected_where_its_neighbours_and_the_slope_of_the_plane_let_it() {
    // What is known, where, and for ground that is known to be some: lift and reach. A patch ahead the plane falls by
    // 0.125 / 0.5 x 0.5 m, a patch to the left by twice as much; and ground rises by half a metre in a metre.
    type Case = (&'static [(usize, usize, f32)], (usize, usize), (f32, f32));
    let cases: [Case; 9] = [
        (&[(7, 9, 0.5), (6, 9, 2.0)], (7, 9), (0.5, 0.5)),
        (&[(6, 9, 0.5), (6, 10, 2.0)], (7, 9), (0.5 + 0.125, 0.5)),
        (&[(6, 10, 0.5), (7, 10, 2.0)], (7, 9), (0.5 + 0.125 - 0.25, 0.5)),
        (&[(6, 19, 0.5), (7, 19, 2.0)], (7, 20), (0.5 + 0.125 + 0.25, 0.5)),
        (&[(6, 20, 0.5), (7, 20, 2.0)], (7, 19), (0.5 + 0.125 - 0.25, 0.5)),
        (&[(7, 10, 0.5), (4, 9, 2.0)], (7, 9), (0.5 - 0.25, 0.5)),
        (&[(7, 29, 0.5), (4, 30, 2.0)], (7, 30), (0.5 + 0.25, 0.5)),
        (&[(4, 9, 0.5), (3, 9, 2.0)], (7, 9), (0.5 + 0.375, 1.0)),
        (&[], (7, 9), (0.0, 0.25 + 0.5 * 3.0)),
    ];
    for (patches, (i, j), expected) in cases {
        let terrain = known(patches);
        assert_eq!(terrain.expected_m(i, j, 3.0, true, &BEND), expected, "{i}, {j} of {patches:?}");
        // What may be something else goes on as it was, and does not begin.
        let unsure = if patches.is_empty() { (0.0, -1.0) } else { (0.5, 0.25) };
        assert_eq!(terrain.expected_m(i, j, 3.0, false, &BEND), unsure, "{i}, {j} of {patches:?}");
    }
    let mut terrain = known(&[(7, 9, 0.5)]);
    terrain.weight[7][9] = LEAST_WEIGHT - 0.5;
    assert_eq!(terrain.expected_m(7, 9, 3.0, false, &BEND), (0.0, -1.0), "too few pixels");
}

#[test]
fn points_within_reach_are_followed_and_what_stands_there_hides_the_ground() {
    // Expected at 0.5 m, within half a metre if it is sure, within a quarter if not.
    let followed = |height_m, sure| {
        let mut terrain = known(&[(7, 20, 0.5)]);
        terrain.follow(&point(3.75, 0.25, height_m, sure), &BEND);
        (terrain.weight[7][20] - 4.0, terrain.sum_m[7][20] - 2.0)
    };
    for (height_m, sure, counted) in [
        (0.5, true, (1.0, 0.5)),
        (1.0, true, (1.0, 1.0)),
        (0.0, true, (1.0, 0.0)),
        (-0.25, true, (0.0, 0.0)),
        (3.0, true, (1.0, 0.5)),
        (0.75, false, (1.0, 0.75)),
        (0.875, false, (0.0, 0.0)),
        (3.0, false, (0.0, 0.0)),
    ] {
        assert_eq!(followed(height_m, sure), counted, "{height_m} m, {sure}");
    }
    // Where nothing is known, what is not sure does not begin.
    let mut terrain = known(&[]);
    terrain.follow(&point(3.75, 0.25, 0.0, false), &BEND);
    assert_eq!(terrain.weight[7][20], 0.0);
}

#[test]
fn what_rises_above_the_terrain_or_lies_far_below_is_left_out() {
    // Two metres ahead: a quarter of a metre and an eighth for each.
    for (height_m, counted) in [(0.5, true), (0.51, false), (-2.0, true), (-2.01, false), (0.0, true)] {
        let mut terrain = known(&[]);
        terrain.trim(&point(2.0, 0.25, height_m, true), &BEND);
        let found = (terrain.weight[4][20], terrain.sum_m[4][20]);
        assert_eq!(found, if counted { (1.0, height_m) } else { (0.0, 0.0) }, "{height_m} m");
    }
}

#[test]
fn points_lie_in_their_patch_or_in_none() {
    let terrain = known(&[]);
    let patch = |x, y| terrain.patches(&point(x, y, 0.0, true))[0];
    for (x, i) in [(0.0, Some(0)), (0.49, Some(0)), (0.5, Some(1)), (19.99, Some(39)), (-0.01, None), (20.0, None)] {
        for (y, j) in [(-10.0, Some(0)), (0.0, Some(20)), (9.99, Some(39)), (-10.01, None), (10.0, None)] {
            let expected = i.zip(j).map(|(i, j)| i * ACROSS + j);
            assert_eq!(patch(x, y), expected, "{x}, {y}");
        }
    }
}

#[test]
fn a_round_begins_with_the_plane_under_the_robot() {
    let mut terrain = known(&[(3, 3, 1.0), (0, 19, 2.0), (0, 20, 2.0)]);
    terrain.begin();
    for (i, row) in terrain.weight.iter().enumerate() {
        for (j, &weight) in row.iter().enumerate() {
            let expected = if i == 0 && (j == 19 || j == 20) { PLANE_WEIGHT } else { 0.0 };
            assert_eq!((weight, terrain.sum_m[i][j]), (expected, 0.0), "{i}, {j}");
        }
    }
    // Each patch on its own: what nothing is known of lies on the plane.
    terrain.sum_m[0][19] = 50.0;
    terrain.settle(0.0);
    assert_eq!((terrain.lift_m[0][19], terrain.lift_m[0][20], terrain.lift_m[5][5]), (2.0, 0.0, 0.0));
    // Flat ground keeps its patches, and has some before there was any.
    terrain.flatten(GroundPlane::UNSET);
    assert_eq!((terrain.patch_m, terrain.lift_m[0][19]), (0.5, 0.0));
    let mut terrain = Terrain::new();
    terrain.flatten(GroundPlane::UNSET);
    assert!(terrain.patch_m > 0.0 && terrain.lift_m(0.0, 0.0) == 0.0);
}

#[test]
fn what_stands_upright_says_nothing_of_the_ground() {
    for (class, says) in [
        (SurfaceClass::Vertical, Says::Nothing),
        (SurfaceClass::Ground, Says::Ground),
        (SurfaceClass::Horizontal, Says::MayBeGround),
        (SurfaceClass::Slanted, Says::MayBeGround),
        (SurfaceClass::Undefined, Says::MayBeGround),
    ] {
        assert!(Says::of(class) == says, "{class:?}");
    }
}

#[test]
fn each_surface_of_a_tile_is_asked() {
    let pixels = tile_of_blocks();
    let picture = DisparityPicture::new(&pixels, 32);
    let world = World::empty(1.2, 12.0, 0.0);
    let Stages { depth, rays, .. } =
        Stages::new(&world.mount(), &GroundSettings::default(), &ObstacleSettings::default());
    let mut surfaces = Box::new(Surfaces::<{ 32 * 32 }, MAX_TILE_SURFACES>::new());
    surfaces.configure(&SurfaceSettings { min_pixels: 16, ..SurfaceSettings::default() }, 32, 32).unwrap();
    assert_eq!(surfaces.run(picture, &depth, &rays).found, 64);
    let bend = Bend { tolerance_m: 100.0, ..BEND };
    for ground in 0..64 {
        for (k, surface) in surfaces.table_mut().iter_mut().enumerate() {
            surface.class = if k == ground { SurfaceClass::Ground } else { SurfaceClass::Vertical };
        }
        let mut terrain = known(&[]);
        let (depth, rays, bend) = (&depth, &rays, &bend);
        Gather { terrain: &mut terrain, round: Round::Trim, surfaces: &surfaces, picture, depth, rays, bend }.run();
        // Of the columns one in four is looked at, of the rows one in two.
        assert_eq!(terrain.weight.as_flattened().iter().sum::<f32>(), 2.0, "{ground}");
    }
}
