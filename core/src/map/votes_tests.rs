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
