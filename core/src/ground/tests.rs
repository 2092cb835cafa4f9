//! The ground of worlds whose truth is known, seen by a perfect camera in steps of 1/16 px.

mod rules;

use super::*;
use crate::{
    geometry::Mount,
    obstacles::ObstacleSettings,
    test_random::Random,
    test_world::{Patch, Point, Stages, World, ground},
};

fn stages(mount: &Mount, settings: &GroundSettings) -> Stages {
    Stages::new(mount, settings, &ObstacleSettings::default())
}

fn find(world: &World, mount: &Mount, settings: &GroundSettings) -> Option<GroundPlane> {
    stages(mount, settings).ground(&world.render())
}

/// Errors of height, pitch and roll, metres and degrees.
fn errors(plane: &GroundPlane, world: &World) -> [f64; 3] {
    [
        f64::from(plane.camera_height_m) - world.height_m,
        f64::from(plane.pitch_down_rad).to_degrees() - world.pitch_down_deg,
        f64::from(plane.roll_rad).to_degrees() - world.roll_deg,
    ]
}

/// A slope through the origin that rises ahead, or to the side.
fn slope(ahead_deg: f64, aside_deg: f64) -> Patch {
    let normal = Point::new(-ahead_deg.to_radians().tan(), -aside_deg.to_radians().tan(), 1.0);
    Patch::across(normal, Point::zeros(), 500.0)
}

#[test]
fn height_pitch_and_roll_are_told_though_the_mount_is_wrong() {
    let mut random = Random::seeded("ground", 0x5eed_0130);
    let mut worst = [0.0_f64; 3];
    for round in 0..150 {
        let world = World::level(random.within(0.4, 2.0), random.within(5.0, 35.0), random.within(-12.0, 12.0));
        // Known with an error of up to 0.3 m and 6 degrees, or the height not known at all.
        let height_m = world.height_m + random.within(-0.3, 0.3);
        let mount = Mount {
            height_m: (round % 3 > 0).then_some(height_m as f32),
            pitch_down_deg: (world.pitch_down_deg + random.within(-6.0, 6.0)) as f32,
            roll_deg: (world.roll_deg + random.within(-6.0, 6.0)) as f32,
            ..Mount::default()
        };
        let plane = find(&world, &mount, &GroundSettings::default());
        let plane = plane.unwrap_or_else(|| panic!("round {round}: no ground, {world:?}, {mount:?}"));
        let off = errors(&plane, &world);
        for i in 0..3 {
            worst[i] = worst[i].max(off[i].abs());
        }
        let allowed = off[0].abs() < 0.005 && off[1].abs() < 0.1 && off[2].abs() < 0.1;
        assert!(allowed, "round {round}: off by {off:?}, {world:?}, {mount:?}");
        assert!(plane.age_frames == 0 && plane.support > 1000 && plane.rms_m < 0.05, "{plane:?}");
    }
    std::println!("height within {:.5} m, pitch {:.4} and roll {:.4} degrees", worst[0], worst[1], worst[2]);
}

#[test]
fn the_plane_of_the_mount_has_the_angles_of_the_mount() {
    let mut random = Random::seeded("plane of the mount", 0x5eed_0131);
    for _ in 0..1000 {
        let world = World::level(random.within(0.1, 5.0), random.within(-60.0, 88.0), random.within(-60.0, 60.0));
        let plane = GroundPlane::of_mount(&world.frame());
        let off = errors(&plane, &world);
        assert!(off[0].abs() < 1.0e-5 && off[1].abs() < 0.01 && off[2].abs() < 0.01, "{off:?}, {world:?}");
        let point = [3.0, -2.0, 0.7];
        assert!((plane.height_m(point) - 0.7).abs() < 1.0e-5);
    }
}

#[test]
fn slopes_are_ground_with_their_normal() {
    for (ahead_deg, aside_deg) in [(10.0, 0.0), (-8.0, 0.0), (0.0, 10.0), (6.0, -6.0), (0.0, 0.0)] {
        let mut world = World::empty(1.2, 20.0, 0.0);
        let patch = slope(ahead_deg, aside_deg);
        world.patches.push(patch);
        let mut stages = stages(&world.mount(), &GroundSettings::default());
        let plane = stages.ground(&world.render()).expect("a slope is ground");
        let found = Point::from(plane.normal.map(f64::from));
        let off_deg = found.cross(&patch.normal()).norm().asin().to_degrees();
        assert!(off_deg < 0.5, "{ahead_deg} and {aside_deg} degrees: {off_deg:.2} degrees off");
        assert!(plane.offset_m.abs() < 0.03, "{plane:?}");
        let ground = stages.surfaces.table().iter().filter(|s| s.class == SurfaceClass::Ground).count();
        assert!(ground * 10 > stages.surfaces.table().len() * 6, "{ground} of {}", stages.surfaces.table().len());
    }
}

#[test]
fn of_two_levels_the_one_ahead_is_the_ground() {
    // A verge 0.15 m above the road, on the left; the road is 3 m wide there and open to the right.
    let mut world = World::level(1.2, 15.0, 0.0);
    world.patches.push(Patch::new([0.0, 101.5, 0.15], [200.0, 0.0, 0.0], [0.0, 100.0, 0.0]));
    let mut stages = stages(&world.mount(), &GroundSettings::default());
    let plane = stages.ground(&world.render()).unwrap();
    let off = errors(&plane, &world);
    assert!(off[0].abs() < 0.03 && off[1].abs() < 0.5 && off[2].abs() < 0.8, "{off:?}");

    // Higher than any tolerance and apart from the ground: a table top stays horizontal and does not become ground.
    world.patches[1] = Patch::new([3.5, 0.9, 0.5], [0.7, 0.0, 0.0], [0.0, 0.7, 0.0]);
    let plane = stages.ground(&world.render()).unwrap();
    assert!(errors(&plane, &world)[0].abs() < 0.03, "{plane:?}");
    let deck = |s: &&Surface| (s.points.mean_m[2] - 0.5).abs() < 0.05 && s.points.mean_m[0] < 5.0;
    let (mut horizontal, mut ground) = (0, 0);
    for surface in stages.surfaces.table().iter().filter(deck) {
        horizontal += u32::from(surface.class == SurfaceClass::Horizontal);
        ground += u32::from(surface.class == SurfaceClass::Ground);
    }
    assert!(horizontal > 0 && ground == 0, "{horizontal} horizontal, {ground} ground");
}

#[test]
fn without_ground_there_is_no_plane() {
    let known = World::empty(1.2, 10.0, 0.0);
    let settings = GroundSettings::default();
    let mounts = [known.mount(), Mount { height_m: None, ..known.mount() }];
    for mount in mounts {
        assert_eq!(find(&known, &mount, &settings), None, "nothing");
        let mut wall = known.clone();
        wall.patches.push(Patch::new([4.0, 0.0, 0.0], [0.0, 500.0, 0.0], [0.0, 0.0, 500.0]));
        assert_eq!(find(&wall, &mount, &settings), None, "a wall");
        let mut corner = wall.clone();
        corner.patches.push(Patch::new([0.0, 2.0, 0.0], [500.0, 0.0, 0.0], [0.0, 0.0, 500.0]));
        assert_eq!(find(&corner, &mount, &settings), None, "a corner");
        let mut ceiling = World { pitch_down_deg: -15.0, ..known.clone() };
        ceiling.patches.push(ground(2.6));
        let mount = Mount { pitch_down_deg: -15.0, ..mount };
        assert_eq!(find(&ceiling, &mount, &settings), None, "a ceiling");
        let tolerant = GroundSettings { height_tolerance_m: 5.0, ..settings };
        assert_eq!(find(&ceiling, &mount, &tolerant), None, "a ceiling within the tolerance");
    }
}

#[test]
fn a_frame_without_ground_holds_the_last_plane_for_a_while() {
    let world = World::level(1.2, 15.0, 0.0);
    let (seen, nothing) = (world.render(), World::empty(1.2, 15.0, 0.0).render());
    let settings = GroundSettings { hold_frames: 3, ..GroundSettings::default() };
    let mut stages = stages(&world.mount(), &settings);
    assert_eq!(stages.ground(&nothing), None, "nothing to hold yet");
    for _ in 0..2 {
        let first = stages.ground(&seen).unwrap();
        assert_eq!(first.age_frames, 0);
        for age_frames in 1..=3 {
            assert_eq!(stages.ground(&nothing), Some(GroundPlane { age_frames, ..first }));
        }
        for _ in 0..3 {
            assert_eq!(stages.ground(&nothing), None, "given up");
        }
    }
    assert!(stages.ground(&seen).is_some());
    stages.ground.configure(&settings, &world.frame(), true, 320 * 240).unwrap();
    assert_eq!(stages.ground(&nothing), None, "configuring forgets");

    stages.ground.configure(&GroundSettings { hold_frames: 0, ..settings }, &world.frame(), true, 320 * 240).unwrap();
    assert!(stages.ground(&seen).is_some());
    assert_eq!(stages.ground(&nothing), None, "nothing is held");
}

#[test]
fn limits_of_tilt_height_and_support_hold() {
    let mut sloping = World::empty(1.2, 20.0, 0.0);
    sloping.patches.push(slope(14.0, 0.0));
    let mount = sloping.mount();
    let settings = GroundSettings::default();
    assert!(find(&sloping, &mount, &settings).is_some());
    assert_eq!(find(&sloping, &mount, &GroundSettings { max_tilt_deg: 12.0, ..settings }), None);

    let level = World::level(1.2, 20.0, 0.0);
    // More than 1000 of 1000 pixels: never at another height than that of the mount.
    let strict = GroundSettings { other_height_support_permille: 1001.0, ..settings };
    for (height_m, found) in [(1.2, true), (0.8, true), (1.6, true), (0.6, false), (1.8, false)] {
        let mount = Mount { height_m: Some(height_m), ..level.mount() };
        assert_eq!(find(&level, &mount, &strict).is_some(), found, "{height_m} m");
    }
    let far_off = Mount { height_m: None, ..level.mount() };
    let high = World::level(3.2, 40.0, 0.0);
    assert!(find(&high, &Mount { pitch_down_deg: 40.0, ..far_off }, &settings).is_some(), "height not known");

    let support = |permille| GroundSettings { min_support_permille: permille, ..settings };
    let plane = find(&level, &level.mount(), &support(0.0)).unwrap();
    let permille = plane.support as f32 * 1000.0 / (320.0 * 240.0);
    assert!(find(&level, &level.mount(), &support(permille - 1.0)).is_some());
    assert_eq!(find(&level, &level.mount(), &support(permille + 1.0)), None);
}

#[test]
fn ground_at_another_height_than_that_of_the_mount_is_large_and_the_lowest() {
    let settings = GroundSettings::default();
    let level = World::level(1.2, 20.0, 0.0);
    for height_m in [0.6, 1.8, 2.4] {
        let mount = Mount { height_m: Some(height_m), ..level.mount() };
        let plane = find(&level, &mount, &settings).unwrap_or_else(|| panic!("{height_m} m: no ground"));
        assert!(errors(&plane, &level)[0].abs() < 0.005, "{plane:?}");
        let permille = plane.support as f32 * 1000.0 / (320.0 * 240.0);
        let support = |permille| GroundSettings { other_height_support_permille: permille, ..settings };
        assert!(find(&level, &mount, &support(permille - 1.0)).is_some());
        assert_eq!(find(&level, &mount, &support(permille + 1.0)), None);
    }
    // A table before the camera, the ground under it out of the reach of the mount's height: the table is not the ground.
    let mut room = World::empty(1.2, 20.0, 0.0);
    room.patches.push(ground(-1.2));
    room.patches.push(Patch::new([4.0, 0.0, 0.6], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]));
    let plane = find(&room, &room.mount(), &settings).expect("the floor");
    assert!((plane.camera_height_m - 2.4).abs() < 0.02, "{plane:?}");
    // With a part of the floor that is smaller than the table, neither is: the table has something below it.
    let demanding = GroundSettings { other_height_support_permille: 40.0, ..settings };
    let mut table = World::empty(1.2, 20.0, 0.0);
    table.patches.push(Patch::new([4.0, 0.0, 0.6], [2.0, 0.0, 0.0], [0.0, 0.8, 0.0]));
    let alone = find(&table, &table.mount(), &demanding).expect("nothing lies below it");
    assert!((alone.camera_height_m - 0.6).abs() < 0.02, "{alone:?}");
    table.patches.push(Patch::new([9.0, 0.0, -1.2], [0.4, 0.0, 0.0], [0.0, 20.0, 0.0]));
    assert_eq!(find(&table, &table.mount(), &demanding), None);
}

#[test]
fn what_is_large_and_near_and_cannot_be_ground_does_not_keep_others_from_being_tried() {
    // The floor is far away. Of two tables before it the nearer one weighs the most of all three, but too few pixels lie on either.
    let mut world = World::empty(1.2, 20.0, 0.0);
    world.patches.push(Patch::new([8.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 30.0, 0.0]));
    world.patches.push(Patch::new([1.7, 0.0, 0.6], [0.1, 0.0, 0.0], [0.0, 0.2, 0.0]));
    world.patches.push(Patch::new([1.1, 0.0, 0.3], [0.2, 0.0, 0.0], [0.0, 0.3, 0.0]));
    let mount = Mount { height_m: None, ..world.mount() };
    let support = |permille| GroundSettings { min_support_permille: permille, ..GroundSettings::default() };
    for (permille, height_m) in [(100.0, 1.2), (0.0, 0.9)] {
        let plane = find(&world, &mount, &support(permille)).expect("a plane");
        assert!((plane.camera_height_m - height_m).abs() < 0.02, "{permille} permille: {plane:?}");
    }
    world.patches.remove(0);
    assert_eq!(find(&world, &mount, &support(100.0)), None, "the tables alone");
}

#[test]
fn the_terrain_is_trimmed_by_what_an_error_of_a_disparity_makes_of_heights() {
    let pair = crate::test_world::PAIR;
    for height_m in [0.5, 1.2] {
        let mut world = World::level(height_m, 25.0, 0.0);
        let mut random = Random::seeded("boxes", 0x5eed_0137);
        for _ in 0..12 {
            let (x, y, top) = (random.within(1.5, 6.0), random.within(-2.0, 2.0), random.within(0.05, 0.3));
            world.add_box([x, y, 0.0], [x + 0.5, y + 0.5, top], 0.0);
        }
        let settings = GroundSettings { terrain_noise_px: 2.0, ..GroundSettings::default() };
        let mut stages = stages(&world.mount(), &settings);
        let pixels = world.render();
        let plane = stages.ground(&pixels).expect("the floor");
        // Ground `x` ahead has the disparity `fb / x`; with two pixels less of it it would lie `2 x^2 / fb` farther away, and by
        // `camera height / x` of that lower.
        let tolerance_per_m = 2.0 * plane.camera_height_m / (pair.focal_px * pair.baseline_m);
        let fit = |tolerance_per_m| {
            let bend = Bend {
                patch_m: settings.terrain_patch_m,
                share: settings.terrain_share,
                max_slope: settings.terrain_max_slope_deg.to_radians().tan(),
                tolerance_m: settings.surface_tolerance_m,
                tolerance_per_m,
            };
            let mut terrain = Terrain::new();
            let picture = DisparityPicture::new(&pixels, 320);
            let geometry = (&stages.depth, &stages.rays);
            terrain.fit(plane, &stages.surfaces, picture, geometry, &bend, Chosen::PLAIN);
            core::array::from_fn::<f32, 60, _>(|i| terrain.lift_m(1.0 + 0.1 * i as f32, 0.0))
        };
        let [truth, half, twice] = [1.0, 0.5, 2.0].map(|factor| fit(factor * tolerance_per_m));
        let found = core::array::from_fn::<f32, 60, _>(|i| stages.ground.terrain().lift_m(1.0 + 0.1 * i as f32, 0.0));
        let off = |other: [f32; 60]| found.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        std::println!("{height_m} m: {} m off, {} with half of it, {} with twice", off(truth), off(half), off(twice));
        assert!(off(truth) < 1.0e-4, "{height_m} m");
        assert!(off(half) > 1.0e-3 && off(twice) > 1.0e-3, "{height_m} m: it does not matter there");
    }
}

#[test]
fn settings_that_cannot_be_are_named() {
    let good = GroundSettings::default();
    let field = |settings: GroundSettings| settings.check().unwrap_err().field;
    assert_eq!(good.check(), Ok(()));
    assert_eq!(field(GroundSettings { max_tilt_deg: 46.0, ..good }), "ground.max_tilt_deg");
    assert_eq!(field(GroundSettings { height_tolerance_m: -1.0, ..good }), "ground.height_tolerance_m");
    assert_eq!(field(GroundSettings { fit_tolerance_m: 0.0, ..good }), "ground.fit_tolerance_m");
    assert_eq!(field(GroundSettings { fit_noise_max_px: 4.1, ..good }), "ground.fit_noise_max_px");
    assert_eq!(field(GroundSettings { surface_tolerance_m: f32::NAN, ..good }), "ground.surface_tolerance_m");
    assert_eq!(field(GroundSettings { surface_tolerance_per_m: 1.0, ..good }), "ground.surface_tolerance_per_m");
    assert_eq!(field(GroundSettings { max_range_m: f32::INFINITY, ..good }), "ground.max_range_m");
    assert_eq!(field(GroundSettings { corridor_m: 0.0, ..good }), "ground.corridor_m");
    assert_eq!(field(GroundSettings { terrain_patch_m: 0.0, ..good }), "ground.terrain_patch_m");
    assert_eq!(field(GroundSettings { terrain_max_slope_deg: 61.0, ..good }), "ground.terrain_max_slope_deg");
    assert_eq!(field(GroundSettings { terrain_share: 1.0, ..good }), "ground.terrain_share");
    assert_eq!(field(GroundSettings { min_support_permille: 1001.0, ..good }), "ground.min_support_permille");
    let other = GroundSettings { other_height_support_permille: 2001.0, ..good };
    assert_eq!(field(other), "ground.other_height_support_permille");
    assert_eq!(field(GroundSettings { hold_frames: 1001, ..good }), "ground.hold_frames");
}
