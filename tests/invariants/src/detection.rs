//! What must hold of everything that a detector says of one frame.

use fencepost_core::{
    detector::{Detection, Statistics},
    disparity::DisparityPicture,
    geometry::Mount,
    health::{Health, HealthLevel, HealthReason},
    map::{Cell, CellState, Doubt, ObstacleMap, SECTOR_CLEAR_DM, SECTOR_COUNT, SectorDistances},
    methods::DetectorKind,
    surfaces::{Surface, SurfaceClass, SurfaceSettings},
};

use crate::camera::{CELLS, Camera, Eye, OBSTACLES, SURFACES, Small};

/// What a frame said.
pub(crate) type Found = Detection<OBSTACLES, CELLS>;

/// Checks the last frame of `detector`. Where `judged`, its health takes part.
pub(crate) fn check(detector: &Small, camera: &Camera, judged: bool) {
    let (found, picture) = (detector.detection(), detector.disparity());
    let settings = &camera.settings;
    assert_eq!(found.map.geometry, settings.map.geometry);
    assert_eq!(found.map.cells.len(), settings.map.geometry.len());
    assert_eq!(picture.pixels().len(), camera.pixels());
    check_counts(&found.statistics, found, picture, detector.surfaces().table());
    for surface in detector.surfaces().table() {
        let normals_decide = settings.detector == DetectorKind::SurfaceNormals;
        if normals_decide { check_surface(surface, &settings.surfaces) } else { check_normal(surface) }
    }
    check_ground(found, camera, picture);
    check_obstacles(found, camera);
    check_cells(detector, found, camera, picture);
    check_sectors(&found.map, &found.sectors);
    if judged {
        check_health(&found.health, found);
    } else {
        assert_eq!(found.health, Health::OK);
    }
}

fn check_counts(statistics: &Statistics, found: &Found, picture: DisparityPicture<'_>, table: &[Surface]) {
    let (mut with, mut without) = (0, [0; 7]);
    for pixel in picture.pixels() {
        match pixel.get() {
            Ok(_) => with += 1,
            Err(reason) => without[reason as usize] += 1,
        }
    }
    assert_eq!((statistics.pixels_with_disparity, statistics.pixels_without), (with, without), "pixels");
    let coverage = with as f32 / picture.pixels().len() as f32;
    assert!((statistics.coverage() - coverage).abs() < 1.0e-6);
    assert_eq!(statistics.surfaces as usize, table.len());
    assert!(
        table.len() <= SURFACES && (statistics.surfaces_dropped == 0 || table.len() == SURFACES),
        "dropped for room"
    );
    let of = |classes: &[SurfaceClass]| table.iter().filter(|s| classes.contains(&s.class)).count() as u32;
    assert_eq!(statistics.surfaces_horizontal, of(&[SurfaceClass::Ground, SurfaceClass::Horizontal]));
    assert_eq!(statistics.surfaces_vertical, of(&[SurfaceClass::Vertical, SurfaceClass::Obstacle]));
    assert!(statistics.obstacles_dropped == 0 || found.obstacles.is_full(), "dropped for room");
    let count = |which: fn(&Cell) -> bool| found.map.cells.iter().filter(|cell| which(cell)).count() as u32;
    assert_eq!(statistics.cells_obstacle, count(|cell| cell.state == CellState::Obstacle));
    assert_eq!(statistics.cells_free, count(|cell| cell.state == CellState::Free));
    assert_eq!(statistics.cells_disputed, count(|cell| cell.doubt == Doubt::Disputed));
    assert_eq!(statistics.cells_unconfirmed, count(|cell| cell.doubt == Doubt::Unconfirmed));
}

/// A normal is a unit vector upward, or zero where there is no plane.
fn check_normal(surface: &Surface) {
    let normal = surface.normal.map(f64::from);
    let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    assert!(length == 0.0 || (length - 1.0).abs() < 1.0e-4, "a normal of length {length}");
    assert!(normal[2] >= 0.0, "a normal downward: {normal:?}");
    assert!(surface.rms_m.is_finite() && surface.rms_m >= 0.0, "{surface:?}");
    assert!(surface.points.mean_m.iter().all(|m| m.is_finite()) && surface.points.weight >= 1.0, "{surface:?}");
}

/// A surface whose class comes from its normal.
pub(crate) fn check_surface(surface: &Surface, settings: &SurfaceSettings) {
    check_normal(surface);
    let limit = |degrees: f32| f64::from(degrees).to_radians().cos();
    let dot = f64::from(surface.normal[2]);
    match surface.class {
        SurfaceClass::Ground | SurfaceClass::Horizontal => assert!(dot >= limit(settings.horizontal_deg) - 1.0e-5),
        SurfaceClass::Vertical => assert!(dot <= limit(settings.vertical_deg) + 1.0e-5),
        SurfaceClass::Slanted => {
            assert!(dot <= limit(settings.horizontal_deg) + 1.0e-5 && dot >= limit(settings.vertical_deg) - 1.0e-5);
        }
        SurfaceClass::Undefined => assert_eq!(surface.normal, [0.0; 3]),
        SurfaceClass::Obstacle => {}
    }
}

fn check_ground(found: &Found, camera: &Camera, picture: DisparityPicture<'_>) {
    let Some(ground) = &found.ground else { return };
    let normal = ground.normal.map(f64::from);
    let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    assert!((length - 1.0).abs() < 1.0e-4, "{ground:?}");
    let tilt = f64::from(camera.settings.ground.max_tilt_deg).to_radians();
    assert!(normal[2] >= tilt.cos() - 1.0e-4, "tilted too far: {ground:?}");
    let numbers = [ground.offset_m, ground.camera_height_m, ground.pitch_down_rad, ground.roll_rad, ground.rms_m];
    assert!(numbers.iter().all(|number| number.is_finite()) && ground.rms_m >= 0.0, "{ground:?}");
    let Mount { forward_m, left_m, height_m, .. } = camera.mount;
    let at = [forward_m, left_m, height_m.unwrap_or(Mount::ASSUMED_HEIGHT_M)].map(f64::from);
    assert!(ground.camera_height_m > 0.0, "ground above the camera: {ground:?}");
    let height = (0..3).map(|i| normal[i] * at[i]).sum::<f64>() - f64::from(ground.offset_m);
    let told = f64::from(ground.camera_height_m);
    assert!((height - told).abs() < 1.0e-4 * (10.0 + told.abs()), "the camera is {height} m above {ground:?}");
    assert!(ground.age_frames <= camera.settings.ground.hold_frames, "{ground:?}");
    assert!(ground.age_frames > 0 || ground.support as usize <= picture.pixels().len(), "{ground:?}");
}

fn check_obstacles(found: &Found, camera: &Camera) {
    let settings = &camera.settings.obstacles;
    let mut before = 0.0;
    let mut pixels = 0;
    for obstacle in &found.obstacles {
        assert!(obstacle.distance_m() >= before, "not nearest first");
        before = obstacle.distance_m();
        let ends = obstacle.min_m.iter().zip(&obstacle.max_m);
        assert!(ends.clone().all(|(min, max)| min <= max && min.is_finite() && max.is_finite()), "{obstacle:?}");
        for ((min, max), mean) in ends.zip(obstacle.mean_m).take(2) {
            let slack = 1.0e-3 * (1.0 + mean.abs());
            assert!((min - slack..=max + slack).contains(&mean), "its middle is outside of it: {obstacle:?}");
        }
        assert!(obstacle.orientation_rad.abs() <= core::f32::consts::FRAC_PI_2 + 1.0e-6, "{obstacle:?}");
        assert!(obstacle.length_m >= 0.0 && obstacle.surfaces >= 1, "{obstacle:?}");
        assert!(obstacle.max_m[2] >= settings.min_height_m && obstacle.min_m[2] <= settings.clearance_m);
        assert!(obstacle.pixels >= u32::from(settings.min_pixels), "{obstacle:?}");
        pixels += obstacle.pixels as usize;
    }
    assert!(pixels <= camera.pixels(), "obstacles of more pixels than there are");
}

fn check_cells(detector: &Small, found: &Found, camera: &Camera, picture: DisparityPicture<'_>) {
    let settings = &camera.settings;
    let eye = Eye::new(&camera.pair, &camera.mount);
    let mut known = false;
    for (index, cell) in found.map.cells.iter().enumerate() {
        let (i, j) = found.map.geometry.cell_at(index);
        match cell.state {
            CellState::Unknown(_) => {
                assert!(cell.pixels == 0 && cell.confidence_percent == 0 && cell.height_dm == 0, "{cell:?}");
                continue;
            }
            CellState::Free => {
                assert!(found.ground.is_some(), "free without ground");
                let least = match settings.detector {
                    DetectorKind::CostMap => settings.cost_map.min_points,
                    _ => settings.map.free_min_pixels,
                };
                assert!(cell.pixels >= least, "{cell:?}, {camera:?}");
            }
            CellState::Obstacle => {}
        }
        known = true;
        let (x, y) = found.map.geometry.centre_m(i, j);
        let range = eye.range_m([x, y].map(f64::from));
        assert!(range <= f64::from(settings.map.max_range_m) + 1.0e-3, "known beyond the range: {range} m");
        let undoubted = cell.confidence_percent == 100 && cell.doubt == Doubt::None;
        assert!(undoubted || settings.cross_check.is_some(), "{cell:?}");
    }
    if known {
        check_evidence(detector, found, camera, picture, &eye);
    }
}

/// A cell is known only where there are pixels that see it, and free only where as many of them as it says see ground.
fn check_evidence(detector: &Small, found: &Found, camera: &Camera, picture: DisparityPicture<'_>, eye: &Eye) {
    let geometry = &found.map.geometry;
    let size = f64::from(geometry.cell_size_mm) * 1.0e-3;
    let by_surfaces = matches!(
        camera.settings.detector,
        DetectorKind::SurfaceNormals | DetectorKind::PixelNormals | DetectorKind::GroundDeviation
    );
    let (mut seen, mut ground) = ([0u32; CELLS], [0u32; CELLS]);
    for (place, pixel) in picture.pixels().iter().enumerate().filter(|(_, pixel)| pixel.has_value()) {
        let (x, y) = (place % picture.width(), place / picture.width());
        let class = detector.surfaces().surface_at(x, y).map(|surface| surface.class);
        if by_surfaces && class.is_none() {
            continue;
        }
        let [ahead, aside, _] = eye.point(x, y, pixel.steps());
        let is_ground = class == Some(SurfaceClass::Ground);
        // Where a point lies at the edge of a cell, rounding decides: it counts for both.
        let slack = 1.0e-4 + 2.0e-5 * (ahead.abs() + aside.abs()) * (1.0 + 40.0 / f64::from(camera.pair.focal_px));
        let cells = |at: f64| ((at - slack) / size).floor() as i16..=((at + slack) / size).floor() as i16;
        for i in cells(ahead).take(3) {
            for j in cells(aside).take(3) {
                if let Some(index) = geometry.index(i, j) {
                    seen[index] += 1;
                    ground[index] += u32::from(is_ground);
                }
            }
        }
    }
    for (index, cell) in found.map.cells.iter().enumerate() {
        let counted = u32::from(cell.pixels);
        match cell.state {
            CellState::Unknown(_) => {}
            CellState::Free if by_surfaces => {
                assert!(
                    ground[index] >= counted.max(1),
                    "free where no ground was seen: {cell:?}, {}, {camera:?}",
                    ground[index]
                );
            }
            CellState::Free | CellState::Obstacle => {
                assert!(
                    seen[index] >= counted.max(1),
                    "known where nothing was seen: {index} {cell:?}, {}, {camera:?}",
                    seen[index]
                );
            }
        }
    }
}

pub(crate) fn check_sectors(map: &ObstacleMap<CELLS>, sectors: &SectorDistances) {
    let mut clear = [false; SECTOR_COUNT];
    for (index, cell) in map.cells.iter().enumerate() {
        // Of those that are not known nothing is said.
        if !matches!(cell.state, CellState::Free | CellState::Obstacle) {
            continue;
        }
        let (i, j) = map.geometry.cell_at(index);
        let (x, y) = map.geometry.centre_m(i, j);
        let (x, y) = (f64::from(x), f64::from(y));
        let place = (f64::from(sectors.left_deg) - y.atan2(x).to_degrees()) / f64::from(sectors.width_deg);
        // At the edge rounding decides.
        if (place - place.round()).abs() < 1.0e-3 {
            for place in [place.round() - 1.0, place.round()] {
                if cell.state == CellState::Free && (0.0..SECTOR_COUNT as f64).contains(&place) {
                    clear[place as usize] = true;
                }
            }
            continue;
        }
        if !(0.0..SECTOR_COUNT as f64).contains(&place) {
            continue;
        }
        clear[place as usize] |= cell.state == CellState::Free;
        if cell.state == CellState::Obstacle {
            let told = sectors.distance_dm[place as usize];
            let limit = (10.0 * x.hypot(y) + 0.51).min(253.0);
            assert!(f64::from(told) <= limit, "sector {place} is {told} dm, an obstacle at {x}, {y}");
        }
    }
    for (told, clear) in sectors.distance_dm.iter().zip(clear) {
        assert!(*told != SECTOR_CLEAR_DM || clear, "clear where nothing is free");
    }
}

fn check_health(health: &Health, found: &Found) {
    let known = HealthReason::ALL.iter().fold(0, |bits, reason| bits | 1 << *reason as u8);
    assert_eq!(health.reasons & !known, 0, "unknown reasons");
    assert!(health.level == HealthLevel::Ok || health.reasons != 0, "a level without a reason");
    assert!(health.level != HealthLevel::Ok || health.reasons == 0, "a reason without a level");
    if health.level >= HealthLevel::Blind {
        assert_eq!(found.statistics.cells_free, 0, "free in pictures that cannot be trusted");
    }
}

/// Both say the same, to the bit. What is not a number is no bit pattern that may come out, and equals nothing.
pub(crate) fn assert_same(a: &Small, b: &Small, what: &str) {
    assert_same_picture(a, b, what);
    let (a, b) = (a.detection(), b.detection());
    assert_eq!(a.map.cells, b.map.cells, "{what}: cells");
    assert_eq!(a.sectors, b.sectors, "{what}: sectors");
    assert_eq!(a.ground, b.ground, "{what}: ground");
    assert_eq!(a.obstacles, b.obstacles, "{what}: obstacles");
    assert_eq!(a.health, b.health, "{what}: health");
    assert_eq!(a.statistics, b.statistics, "{what}: statistics");
}

/// The same disparities and signs.
fn assert_same_picture(a: &Small, b: &Small, what: &str) {
    assert_eq!(a.disparity().pixels(), b.disparity().pixels(), "{what}: disparities");
    assert_eq!(a.surfaces().table(), b.surfaces().table(), "{what}: surfaces");
}

/// Both have found the same, whatever was told of the cameras by the frames before: that may only take free cells away.
pub(crate) fn assert_found_same(a: &Small, b: &Small, what: &str) {
    assert_same_picture(a, b, what);
    let (a, b) = (a.detection(), b.detection());
    assert_eq!(a.ground, b.ground, "{what}: ground");
    assert_eq!(a.obstacles, b.obstacles, "{what}: obstacles");
    for (a, b) in a.map.cells.iter().zip(&b.map.cells) {
        let one_is_free = a.state == CellState::Free || b.state == CellState::Free;
        assert!(a == b || one_is_free, "{what}: {a:?} and {b:?}");
    }
    assert_eq!(a.statistics.pixels_without, b.statistics.pixels_without, "{what}: pixels");
    assert_eq!(a.statistics.surfaces_dropped, b.statistics.surfaces_dropped, "{what}: surfaces");
}
