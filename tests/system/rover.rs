//! What a rover sees: three boulders in a line on tarmac.

use fencepost::detector::ProgramDetector;
use fencepost_core::{map::CellState, rectify::Side, surfaces::SurfaceClass};
use fencepost_tests::{at_hand, replay, say};

/// The boulders in the raw left picture: columns and rows, px.
const BOULDERS: [(&str, [f32; 4]); 3] = [
    ("near boulder", [430.0, 710.0, 310.0, 595.0]),
    ("second boulder", [540.0, 650.0, 170.0, 275.0]),
    ("third boulder", [575.0, 650.0, 130.0, 180.0]),
];

/// Tarmac between the rover's nose and the near boulder in the raw left picture: columns and rows, px.
const TARMAC: [f32; 4] = [350.0, 790.0, 610.0, 767.0];

/// Pixels of a field of the raw left picture.
#[derive(Debug, Default)]
struct Field {
    with_disparity: usize,
    obstacle: usize,
    ground: usize,
    /// Distance ahead and to the left of each pixel of an obstacle, metres.
    places_m: Vec<[f32; 2]>,
}

#[test]
fn boulders_are_obstacles_at_three_distances() {
    let Some(folder) = at_hand::recording("k10-rover") else { return };
    let mut frames = 0;
    replay::for_each_detection(&folder, |detector, _| {
        frames += 1;
        let places_m = BOULDERS.map(|(name, bounds)| {
            let mut field = look(detector, bounds);
            let share = field.obstacle as f32 / field.with_disparity.max(1) as f32;
            let place_m = field.median_m();
            say!(
                "{name}: {} pixels with disparity, {:.1} % obstacle, {} ground; {:.2} m ahead, {:.2} m left",
                field.with_disparity,
                100.0 * share,
                field.ground,
                place_m[0],
                place_m[1]
            );
            // The boxes were drawn by eye and hold tarmac beside and behind the boulders.
            assert!(share >= 0.33, "{name}: {share} of its pixels are obstacle");
            let held = |o: &&fencepost_core::obstacles::Obstacle| {
                (0..2).all(|k| (o.min_m[k] - 0.25..=o.max_m[k] + 0.25).contains(&place_m[k]))
            };
            let obstacle = detector.detection().obstacles.iter().position(|o| held(&o));
            assert!(obstacle.is_some(), "{name}: no obstacle at {place_m:?}");
            assert!(is_obstacle_near(detector, place_m), "{name}: no cell at {place_m:?} or beside it is an obstacle");
            (place_m, obstacle)
        });
        let [(near, a), (second, b), (third, c)] = places_m;
        assert!(near[0] + 1.0 < second[0] && second[0] + 1.0 < third[0], "three distances: {places_m:?}");
        assert!(a != b && b != c && a != c, "three obstacles: {places_m:?}");
    });
    assert_eq!(frames, 1);
}

#[test]
fn tarmac_before_the_boulders_is_no_obstacle() {
    let Some(folder) = at_hand::recording("k10-rover") else { return };
    replay::for_each_detection(&folder, |detector, _| {
        let tarmac = look(detector, TARMAC);
        let near = look(detector, BOULDERS[0].1).nearest_m();
        let map = &detector.detection().map;
        let half_m = map.geometry.cell_size_m() / 2.0;
        let (mut obstacles, mut free) = (Vec::new(), 0);
        for (index, cell) in map.cells.iter().enumerate() {
            let (i, j) = map.geometry.cell_at(index);
            let (x, y) = map.geometry.centre_m(i, j);
            if x + half_m < near {
                free += usize::from(cell.state == CellState::Free);
                if cell.state == CellState::Obstacle {
                    obstacles.push((x, y));
                }
            }
        }
        say!(
            "tarmac up to {near:.2} m: {} pixels with disparity, {} obstacle, {} ground; {} obstacle cells, {free} free cells",
            tarmac.with_disparity,
            tarmac.obstacle,
            tarmac.ground,
            obstacles.len()
        );
        assert_eq!(tarmac.obstacle, 0, "pixels of obstacles on the tarmac");
        assert_eq!(obstacles, [], "obstacle cells before the near boulder");
        assert!(tarmac.ground > 1000, "the tarmac was seen: {} pixels", tarmac.ground);
    });
}

/// What was made of the pixels whose places in the raw left picture lie within bounds.
fn look(detector: &ProgramDetector, [left, right, top, bottom]: [f32; 4]) -> Field {
    let (picture, pair, frame) = (detector.disparity(), detector.pair().unwrap(), detector.frame().unwrap());
    let mut field = Field::default();
    for y in 0..picture.height() {
        for x in 0..picture.width() {
            let Some((raw_x, raw_y)) = detector.rectifier().source_of(Side::Left, x as f32, y as f32) else { continue };
            let steps = picture.row(y)[x].steps();
            if steps == 0 || !(left..=right).contains(&raw_x) || !(top..=bottom).contains(&raw_y) {
                continue;
            }
            field.with_disparity += 1;
            match detector.surface_at(x, y).map(|surface| surface.class) {
                Some(SurfaceClass::Obstacle) => {
                    let ahead_m = pair.distance_m(f32::from(steps) / 16.0);
                    let across = [(x as f32 - pair.cx) / pair.focal_px, (y as f32 - pair.cy) / pair.focal_px];
                    let point = frame.point([across[0] * ahead_m, across[1] * ahead_m, ahead_m]);
                    field.obstacle += 1;
                    field.places_m.push([point[0], point[1]]);
                }
                Some(SurfaceClass::Ground) => field.ground += 1,
                _ => {}
            }
        }
    }
    field
}

impl Field {
    fn median_m(&mut self) -> [f32; 2] {
        [0, 1].map(|k| {
            let mut values: Vec<f32> = self.places_m.iter().map(|place| place[k]).collect();
            values.sort_by(f32::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(f32::NAN)
        })
    }

    /// Distance ahead that all but a hundredth of the pixels of obstacles exceed.
    fn nearest_m(&self) -> f32 {
        let mut ahead: Vec<f32> = self.places_m.iter().map(|place| place[0]).collect();
        ahead.sort_by(f32::total_cmp);
        ahead.get(ahead.len() / 100).copied().unwrap_or(f32::NAN)
    }
}

/// Whether the cell at a place or one beside it is an obstacle.
fn is_obstacle_near(detector: &ProgramDetector, [x, y]: [f32; 2]) -> bool {
    let map = &detector.detection().map;
    let size = map.geometry.cell_size_m();
    let (i, j) = ((x / size).floor() as i16, (y / size).floor() as i16);
    let mut around = (-1..=1).flat_map(|a| (-1..=1).map(move |b| (i + a, j + b)));
    around.any(|(i, j)| {
        let index = map.geometry.index(i, j);
        index.and_then(|index| map.cells.get(index)).is_some_and(|cell| cell.state == CellState::Obstacle)
    })
}
