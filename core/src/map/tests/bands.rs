//! Maps filled in bands against those that are filled whole.

use super::*;
use crate::{
    bands::{Job, OneThread, Workers},
    map::bands::Votes,
};

/// Does nothing of what it is given: the caller must.
struct Idle;

impl Workers for Idle {
    fn run<J: Job>(&mut self, _: &mut [J]) {}
}

#[test]
fn bands_make_the_map_that_one_pass_makes() {
    let mut votes: Vec<Box<Votes<CELLS>>> = (0..4).map(|_| Box::new(Votes::new())).collect();
    let mut builder = Box::new(MapBuilder::<CELLS>::new());
    let small = MapGeometry { cell_size_mm: 250, x_first: 2, x_count: 31, y_first: -20, y_count: 37 };
    let worlds = [
        scene(),
        World { place: (1.3, -0.4, 35.0), ..scene() },
        World { height_m: 0.7, pitch_down_deg: 20.0, roll_deg: -6.0, ..scene() },
    ];
    for (world, geometry) in worlds.iter().flat_map(|world| [(world, MapGeometry::default()), (world, small)]) {
        for ground in [GroundSettings::default(), GroundSettings { min_support_permille: 1000.0, ..Default::default() }]
        {
            let settings = MapSettings { geometry, max_range_m: 14.0, ..MapSettings::default() };
            let made = make(world, settings, &ground);
            let obstacles = ObstacleSettings::default();
            builder.configure(&settings, (obstacles.min_height_m, obstacles.clearance_m)).unwrap();
            assert!(count(&made.map, CellState::Obstacle) > 3);
            // One band takes rows of tiles that another one would, and what bands were told of the picture before is forgotten.
            for others in [0, 1, 4, 2, 3] {
                let mut votes: Vec<&mut Votes<CELLS>> =
                    votes.iter_mut().take(others).map(|votes| &mut **votes).collect();
                let mut map = Box::new(ObstacleMap::EMPTY);
                let (picture, terrain) = (DisparityPicture::new(&made.pixels, 320), made.stages.ground.terrain());
                let (view, seen) = (view(&made.stages), made.ground.is_some());
                let surfaces = &made.stages.surfaces;
                if others == 2 {
                    builder.run_in_bands(surfaces, picture, &view, terrain, seen, &mut map, &mut votes, &mut Idle);
                } else {
                    builder.run_in_bands(surfaces, picture, &view, terrain, seen, &mut map, &mut votes, &mut OneThread);
                }
                assert_eq!((map.geometry, &map.cells), (made.map.geometry, &made.map.cells), "{others} more bands");
            }
        }
    }
}

#[test]
fn in_bands_as_well_pictures_of_another_size_say_nothing() {
    let made = make(&scene(), MapSettings::default(), &GroundSettings::default());
    let mut builder = Box::new(MapBuilder::<CELLS>::new());
    builder.configure(&MapSettings::default(), (0.25, 2.5)).unwrap();
    let (mut votes, mut map) = (Box::new(Votes::new()), Box::new(ObstacleMap::<CELLS>::EMPTY));
    let terrain = made.stages.ground.terrain();
    for (pixels, width) in [(320 * 240, 320), (320 * 240, 160), (320 * 10, 320), (0, 0), (320 * 240, 321)] {
        let picture = DisparityPicture::new(&made.pixels[..pixels], width);
        let view = view(&made.stages);
        let surfaces = &made.stages.surfaces;
        builder.run_in_bands(surfaces, picture, &view, terrain, true, &mut map, &mut [&mut votes], &mut OneThread);
        assert_eq!(map.cells.len(), CELLS);
        let known = count(&map, CellState::Free) + count(&map, CellState::Obstacle);
        assert_eq!(known > 0, (pixels, width) == (320 * 240, 320));
    }
}
