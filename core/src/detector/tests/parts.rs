//! What a detector is asked, and the signs of cameras that are exchanged.

use super::*;
use crate::{
    map::{Cell, Doubt, ObstacleMap},
    surfaces::{SurfaceClass, SurfaceReport},
};

#[test]
fn a_detector_says_what_was_configured() {
    let mut detector = Box::new(Small::new());
    let mut settings = settings();
    settings.matching.min_disparity = 3;
    let mount = Mount { forward_m: 1.0, left_m: -0.5, yaw_left_deg: 20.0, ..MOUNT };
    detector.configure(&settings, &StereoCalibration::Rectified(PAIR), &mount).unwrap();
    assert_eq!(detector.pair(), Some(&PAIR));
    assert_eq!(detector.frame(), Some(&VehicleFrame::new(&mount).unwrap()));
    assert_eq!(detector.rectifier().raw_size(Side::Left), (WIDTH, HEIGHT));
    // Of the disparities from 3 to 34 the last one is never reported.
    assert_eq!(detector.nearest_m(), Some(PAIR.distance_m(33.0)));
    let SearchRange { first, last } = detector.search_range();
    assert_eq!((first, last), (3, 34));
    assert!(detector.set_backend(Backend::Plain));
    detector.configure(&settings, &StereoCalibration::Rectified(PAIR), &mount).unwrap();
    assert_eq!(detector.backend(), Backend::Plain);
    let missing = Backend::ALL.iter().find(|backend| !backend.is_available()).unwrap();
    assert!(!detector.set_backend(*missing) && detector.backend() == Backend::Plain);

    look(&mut detector, &good_pair(11));
    let labels = detector.surfaces();
    let mut seen = 0;
    for (x, y) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y))) {
        assert_eq!(detector.surface_at(x, y), labels.surface_at(x, y));
        seen += usize::from(detector.surface_at(x, y).is_some());
    }
    assert!(seen > 5000, "{seen} pixels have a surface");
    assert_ne!(*detector.content(), ContentSigns::UNSET);
}

#[test]
fn parts_of_the_memory_make_up_the_whole() {
    let parts = Small::memory_parts();
    let sum: usize = parts.iter().map(|part| part.bytes).sum();
    assert!(size_of::<Small>().abs_diff(sum) < 1024, "{sum} of {}", size_of::<Small>());
    for (i, part) in parts.iter().enumerate() {
        assert!(!part.name.is_empty() && parts[..i].iter().all(|other| other.name != part.name), "{part:?}");
    }
}

#[test]
fn stages_are_named_as_in_the_code() {
    for stage in Stage::ALL {
        assert_eq!(stage.name(), std::format!("{stage:?}").to_lowercase());
    }
}

#[test]
fn counts_are_those_of_pixels_surfaces_and_cells() {
    let (with, without) = (DisparityPixel::from_steps(100), DisparityPixel::none(Reason::Saturated));
    let pixels = [with, with, without, with];
    let classes = [
        SurfaceClass::Undefined,
        SurfaceClass::Slanted,
        SurfaceClass::Horizontal,
        SurfaceClass::Ground,
        SurfaceClass::Ground,
        SurfaceClass::Vertical,
        SurfaceClass::Obstacle,
        SurfaceClass::Vertical,
        SurfaceClass::Vertical,
    ];
    let surfaces = classes.map(|class| Surface { class, ..Surface::default() });
    let cell = |state, doubt| Cell { state, doubt, ..Cell::default() };
    let unknown = Cell::default().state;
    let mut map = ObstacleMap::<16>::EMPTY;
    map.cells.extend([
        cell(CellState::Obstacle, Doubt::None),
        cell(CellState::Obstacle, Doubt::Disputed),
        cell(CellState::Free, Doubt::Unconfirmed),
        cell(CellState::Free, Doubt::None),
        cell(CellState::Free, Doubt::Unconfirmed),
        cell(unknown, Doubt::Disputed),
        cell(unknown, Doubt::Disputed),
        cell(unknown, Doubt::None),
    ]);
    let mut statistics = Statistics { cells_free: 77, surfaces_vertical: 0, ..Statistics::default() };
    let report = SurfaceReport { found: 20, dropped: 11 };
    statistics.count((DisparityPicture::new(&pixels, 2), crate::arch::Chosen::PLAIN), report, &surfaces, &map);
    let mut expected = [0; 7];
    expected[Reason::Saturated as usize] = 1;
    assert_eq!((statistics.pixels_with_disparity, statistics.pixels_without), (3, expected));
    assert_eq!((statistics.surfaces, statistics.surfaces_dropped), (9, 11));
    assert_eq!((statistics.surfaces_horizontal, statistics.surfaces_vertical), (3, 4));
    assert_eq!((statistics.cells_obstacle, statistics.cells_free), (2, 3));
    assert_eq!((statistics.cells_disputed, statistics.cells_unconfirmed), (3, 2));
}

#[test]
fn free_cells_are_withheld_from_who_is_blind_and_from_nobody_else() {
    let free = |frame: &(Vec<u8>, Vec<u8>)| {
        let mut detector = configured();
        look(&mut detector, frame);
        (detector.detection().statistics.cells_free, detector.detection().health.level)
    };
    let (seen, level) = free(&good_pair(12));
    assert!(seen > 5 && level < HealthLevel::Blind, "{seen} free cells");
    // The same pictures, so often that they are frozen: nothing is told anew by them.
    let mut detector = configured();
    let good = good_pair(12);
    let mut told = vec![];
    for _ in 0..40 {
        look(&mut detector, &good);
        told.push((detector.detection().health.level, detector.detection().statistics.cells_free));
    }
    assert!(told.iter().any(|(level, _)| *level >= HealthLevel::Blind), "{told:?}");
    assert!(told.iter().all(|(level, free)| *level < HealthLevel::Blind || *free == 0), "{told:?}");
}

/// Of three frames the last says that left and right seem to be exchanged.
fn tells_exchanged(frame: &(Vec<u8>, Vec<u8>), exchange_test_percent: f32) -> bool {
    let mut detector = configured();
    let mut settings = settings();
    settings.health.exchange_test_percent = exchange_test_percent;
    detector.configure(&settings, &StereoCalibration::Rectified(PAIR), &MOUNT).unwrap();
    (0..3).for_each(|_| drop(look(&mut detector, frame)));
    detector.detection().health.has(HealthReason::Exchanged)
}

#[test]
fn cameras_that_are_exchanged_are_told_where_little_matches() {
    let (left, right) = good_pair(13);
    let exchanged = (right.clone(), left.clone());
    assert!(tells_exchanged(&exchanged, 100.0));
    assert!(!tells_exchanged(&(left, right), 100.0));
    let mut random = Random::seeded("noise for both cameras", 0x5eed_0163);
    let mut noise = || (0..WIDTH * HEIGHT).map(|_| random.next() as u8).collect::<Vec<u8>>();
    let noise = (noise(), noise());
    assert!(!tells_exchanged(&noise, 100.0), "neither way matches");

    // The rows are looked at the other way round below the limit only, and not at it.
    let mut detector = configured();
    look(&mut detector, &exchanged);
    let percent = 100.0 * detector.detection().statistics.coverage();
    assert!(percent > 0.1, "false matches");
    assert!(!tells_exchanged(&exchanged, percent) && tells_exchanged(&exchanged, percent.next_up()));
}

const TALL: usize = 304;
const NARROW: usize = 96;

/// A picture that is far higher than the strips that are looked at.
type Tall = Detector<{ NARROW * TALL }, NARROW, 16, 0, 64, 8, 400>;

/// Nothing to see, and in rows that `is_matched` noise that lies 5 columns farther to the right in the right picture: exchanged.
fn tall_pair(is_matched: impl Fn(usize) -> bool) -> (Vec<u8>, Vec<u8>) {
    let mut random = Random::seeded("exchanged rows", 0x5eed_0164);
    let (mut left, mut right) = (vec![128; NARROW * TALL], vec![128; NARROW * TALL]);
    for y in (0..TALL).filter(|y| is_matched(*y)) {
        let row = y * NARROW..(y + 1) * NARROW;
        left[row.clone()].fill_with(|| random.next() as u8);
        right[row.start + 5..row.end].copy_from_slice(&left[row.start..row.end - 5]);
    }
    (left, right)
}

#[test]
fn exchanged_cameras_are_looked_for_in_strips_all_over_the_picture() {
    let mut settings = settings();
    settings.matching = MatchSettings { disparities: 16, window_height: 5, ..settings.matching };
    let pair = RectifiedPair { width: NARROW as u32, height: TALL as u32, ..PAIR };
    let mut detector = Box::new(Tall::new());
    detector.configure(&settings, &StereoCalibration::Rectified(pair), &MOUNT).unwrap();
    let mut exchanged = |(left, right): &(Vec<u8>, Vec<u8>), matched: u32, small: u32| {
        let [left, right] = [left, right].map(|bytes| Picture::packed(bytes, NARROW, TALL).unwrap());
        let statistics = &mut detector.detection.statistics;
        statistics.pixels_with_disparity = matched;
        statistics.pixels_without[Reason::SmallSurface as usize] = small;
        detector.matches_exchanged(&left, &right, NARROW, TALL)
    };
    // The middles of eight strips, evenly apart, and what their windows reach: two rows, and three of the codes.
    let reach = 5;
    let strip_of = |y: usize| (1..=8).find(|i| y.abs_diff(TALL * i / 9) <= reach);
    let strips = tall_pair(|y| strip_of(y).is_some());
    assert!(exchanged(&strips, 0, 0));
    assert!(!exchanged(&tall_pair(|y| strip_of(y).is_none()), 0, 0), "between the strips");
    // One strip in eight is too few, though nothing at all matches as given.
    assert!(!exchanged(&tall_pair(|y| strip_of(y) == Some(4)), 0, 0), "one strip");

    // It must be more than twice as much as matches as given, small surfaces included: matched / (8 x width) against
    // n / (width x height) gives way at 19 matched, of 8 x width and more than half of them.
    let most = NARROW * 8 * 19;
    let mut gives_way_at = |pair: &(Vec<u8>, Vec<u8>)| {
        let (mut some, mut too_many) = (0, most as u32);
        while too_many - some > 1 {
            let n = some.midpoint(too_many);
            *(if exchanged(pair, n, 0) { &mut some } else { &mut too_many }) = n;
        }
        too_many
    };
    let gives_way = gives_way_at(&strips);
    assert!(gives_way.is_multiple_of(19), "{gives_way}");
    assert!((0.5..1.0).contains(&(f64::from(gives_way) / most as f64)), "{gives_way} of {most}");
    // Each strip counts.
    for missing in 1..=8 {
        let fewer = gives_way_at(&tall_pair(|y| strip_of(y).is_some_and(|strip| strip != missing)));
        assert!(fewer + 19 * 30 < gives_way, "without strip {missing}: {fewer} of {gives_way}");
    }
    assert!(!exchanged(&strips, 0, gives_way) && exchanged(&strips, 1, gives_way - 2));
}
