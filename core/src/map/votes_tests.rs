//! What surfaces have in common, and votes beyond the map.

use std::{vec, vec::Vec};

use super::*;
use crate::{
    disparity::DisparityPixel,
    ground::GroundSettings,
    obstacles::ObstacleSettings,
    test_world::{Patch, Stages, World},
};

/// The stages after ground that rises ahead and to the left from 4 m on.
fn stages() -> (Stages, Vec<DisparityPixel>) {
    let mut world = World::empty(1.2, 12.0, 0.0);
    let aside = 6.0_f64.to_radians().tan();
    world.patches.push(Patch::new([0.0; 3], [4.0, 0.0, 0.0], [0.0, 30.0, 30.0 * aside]));
    world.patches.push(Patch::new([17.0, 0.0, 1.6], [13.0, 0.0, 1.6], [0.0, 30.0, 30.0 * aside]));
    let pixels = world.render();
    let mut stages = Stages::new(&world.mount(), &GroundSettings::default(), &ObstacleSettings::default());
    stages.run::<8>(&pixels).0.expect("there is ground");
    (stages, pixels)
}

#[test]
fn a_surface_is_seen_along_the_normal_of_the_ground_where_it_lies() {
    let (stages, _) = stages();
    let terrain = stages.ground.terrain();
    let [nx, ny, nz] = terrain.plane().normal.map(f64::from);
    let mut slopes = [0.0_f64; 2];
    for surface in stages.surfaces.table() {
        let [x, y, _] = surface.points.mean_m;
        // Over a metre and a half, ahead and to the left.
        let lift = |x: f32, y: f32| f64::from(terrain.lift_m(x, y));
        let rises =
            [lift(x + 0.75, y) - lift(x - 0.75, y), lift(x, y + 0.75) - lift(x, y - 0.75)].map(|rise| rise / 1.5);
        let common = Common::of(surface, terrain);
        let expected = [nx - rises[0], ny - rises[1], nz];
        for (found, expected) in common.across.iter().zip(expected) {
            assert!((f64::from(*found) - expected).abs() < 1.0e-5, "{common:?} at {x}, {y}: {expected:?}");
        }
        slopes = [0, 1].map(|i| slopes[i].max(rises[i].abs()));
    }
    assert!(slopes.iter().all(|slope| *slope > 0.02), "{slopes:?}");
}

#[test]
fn pixels_beyond_the_largest_map_count_nowhere() {
    let (stages, pixels) = stages();
    // The last cell has the last number that a key can hold.
    let geometry = MapGeometry { cell_size_mm: 100, x_first: -64, x_count: 128, y_first: -64, y_count: 128 };
    let settings = MapSettings { geometry, ..MapSettings::default() };
    let mut evidence = vec![Evidence::default(); geometry.len()];
    let Stages { surfaces, frame, place, rays, depth, ground, .. } = &stages;
    let view = View { pair: &crate::test_world::PAIR, frame, place, rays, depth, nearest_m: 0.5 };
    Collect {
        settings: &settings,
        obstacle_heights_m: (0.25, 2.5),
        evidence: &mut evidence,
        common: &mut [Common::UNSET; MAX_TILE_SURFACES],
        surfaces,
        picture: DisparityPicture::new(&pixels, 320),
        view: &view,
        ground: ground.terrain(),
        rows: TileRows::ALL,
    }
    .run();
    // The last cell lies far aside, where nothing is seen.
    assert_eq!(geometry.len(), 1 << 14);
    assert!(evidence.iter().filter(|cell| cell.ground > 0).count() > 100);
    let last = evidence.last().unwrap();
    assert_eq!((last.obstacle, last.ground, last.unclear, last.height_dm), (0, 0, 0, 0));
}

#[test]
fn heights_are_the_less_certain_the_faster_the_ray_drops_towards_the_ground() {
    let (stages, pixels) = stages();
    let settings = MapSettings { height_noise_px: 0.8, ..MapSettings::default() };
    let Stages { surfaces, frame, place, rays, depth, ground, .. } = &stages;
    let pair = &crate::test_world::PAIR;
    // Two surfaces side by side, seen along normals that are far from upright, and pixels of none between them.
    let across = [[0.25_f32, -0.5, 0.5], [-0.125, 0.25, 2.0]];
    let roles = [Role::Ground, Role::Obstacle];
    let mut common = [Common::UNSET; MAX_TILE_SURFACES];
    for (common, (across, role)) in common.iter_mut().zip(across.into_iter().zip(roles)) {
        *common = Common { role, across };
    }
    let collect = Collect {
        settings: &settings,
        obstacle_heights_m: (0.25, 2.5),
        evidence: &mut [],
        common: &mut common,
        surfaces,
        picture: DisparityPicture::new(&pixels, 320),
        view: &View { pair, frame, place, rays, depth, nearest_m: 0.5 },
        ground: ground.terrain(),
        rows: TileRows::ALL,
    };
    let labels: [u8; TILE] = core::array::from_fn(|x| [1, 0, 2, 1][x / 8]);
    let ray = |x: usize| [1.0 + x as f32 / 64.0, 0.5 - x as f32 / 32.0, -0.25 + x as f32 / 128.0];
    let mut row = Row { rays: [[0.0; TILE]; 4], camera_height_m: 1.2 };
    for (i, rays) in row.rays.iter_mut().take(3).enumerate() {
        *rays = core::array::from_fn(|x| ray(x)[i]);
    }
    let mut noise_per_m2 = [0.0; TILE];
    let found = collect.spread(&labels, &row, &mut noise_per_m2);
    let bits = |label: u8| (0..TILE).filter(|&x| labels[x] == label).fold(0_u32, |bits, x| bits | 1 << x);
    assert_eq!([found.any, found.ground, found.obstacle], [bits(1) | bits(2), bits(1), bits(2)]);
    for (x, label) in labels.iter().enumerate().filter(|(_, label)| **label > 0) {
        // That of the first pixel of the run.
        let normal = across[usize::from(*label) - 1];
        let drop: f64 = ray(x / 8 * 8).iter().zip(normal).map(|(r, n)| f64::from(*r) * f64::from(n)).sum();
        let expected = f64::from(settings.height_noise_px) * drop.abs() / f64::from(pair.focal_px * pair.baseline_m);
        let found = f64::from(noise_per_m2[x]);
        assert!((found - expected).abs() < 1.0e-6 * expected, "{x}: {found}, not {expected}");
    }
}
