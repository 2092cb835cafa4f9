//! The whole chain on small pictures: what it refuses, what it survives, what it repeats.

mod parts;

use std::{boxed::Box, string::String, vec, vec::Vec};

use super::*;
use crate::map::CellState;
use crate::{
    error::ConfigProblem,
    geometry::{CameraModel, Distortion, RawPair, Rectification},
    ground::GroundSettings,
    health::{Health, HealthLevel, HealthReason},
    map::{MapGeometry, MapSettings},
    test_random::Random,
};

pub(super) const WIDTH: usize = 160;
pub(super) const HEIGHT: usize = 120;

pub(super) type Small = Detector<{ WIDTH * HEIGHT }, WIDTH, 32, 500, 64, 8, 400>;

const PAIR: RectifiedPair = RectifiedPair {
    width: WIDTH as u32,
    height: HEIGHT as u32,
    focal_px: 120.0,
    cx: 79.5,
    cy: 59.5,
    baseline_m: 0.15,
    disparity_offset_px: 0.0,
};

const MOUNT: Mount =
    Mount { height_m: Some(0.6), pitch_down_deg: 10.0, roll_deg: 0.0, forward_m: 0.0, left_m: 0.0, yaw_left_deg: 0.0 };

fn settings() -> Settings {
    let geometry = MapGeometry { cell_size_mm: 250, x_first: 0, x_count: 20, y_first: -10, y_count: 20 };
    Settings {
        matching: MatchSettings { disparities: 32, ..MatchSettings::DEFAULT },
        map: MapSettings { geometry, ..MapSettings::default() },
        ground: GroundSettings { hold_frames: 0, ..GroundSettings::default() },
        ..Settings::default()
    }
}

pub(super) fn configured() -> Box<Small> {
    let mut detector = Box::new(Small::new());
    detector.configure(&settings(), &StereoCalibration::Rectified(PAIR), &MOUNT).unwrap();
    detector
}

/// Level ground and an upright panel, both with a fine random texture, as left and right pictures.
pub(super) fn good_pair(seed: u64) -> (Vec<u8>, Vec<u8>) {
    let mut random = Random::seeded("texture", seed);
    let texture: Vec<u8> = (0..256 * 256).map(|_| random.below(256) as u8).collect();
    // What a ray meets: grey values.
    let look = |eye_y: f64, [right, down]: [f64; 2]| -> f64 {
        let (sin, cos) = 10.0_f64.to_radians().sin_cos();
        let (dx, dy, dz) = (cos - sin * down, -right, -sin - cos * down);
        // The panel stands 2 m ahead, 0.8 m wide and high; the ground lies below; far away is nothing but sky.
        let (wall, floor) = (2.0 / dx, if dz < 0.0 { -0.6 / dz } else { f64::MAX });
        let (y, z) = (eye_y + wall * dy, 0.6 + wall * dz);
        let (a, b, scale) = if wall < floor && y.abs() < 0.4 && z < 0.8 {
            (y, z, 60.0)
        } else if floor < 30.0 {
            (floor * dx, eye_y + floor * dy, 40.0)
        } else {
            return 128.0;
        };
        let texel =
            |x: f64, y: f64| f64::from(texture[(x.rem_euclid(256.0) as usize) * 256 + y.rem_euclid(256.0) as usize]);
        let (a, b) = (a * scale + 1000.0, b * scale + 1000.0);
        let (fa, fb) = (a.fract(), b.fract());
        let near = texel(a, b) * (1.0 - fb) + texel(a, b + 1.0) * fb;
        let far = texel(a + 1.0, b) * (1.0 - fb) + texel(a + 1.0, b + 1.0) * fb;
        near * (1.0 - fa) + far * fa
    };
    // A pixel is the mean of many rays, as a camera's is: single rays would meet texels at random where they are finer than a pixel,
    // and the ground would show another pattern to each eye.
    const RAYS: usize = 8;
    let draw = |eye_y: f64| -> Vec<u8> {
        let at = |pixel: usize, ray: usize, middle: f64| {
            (pixel as f64 + (ray as f64 + 0.5) / RAYS as f64 - 0.5 - middle) / 120.0
        };
        let rays = || (0..RAYS).flat_map(|i| (0..RAYS).map(move |j| (i, j)));
        (0..WIDTH * HEIGHT)
            .map(|i| {
                let of = |(a, b)| look(eye_y, [at(i % WIDTH, a, 79.5), at(i / WIDTH, b, 59.5)]);
                (rays().map(of).sum::<f64>() / (RAYS * RAYS) as f64) as u8
            })
            .collect()
    };
    (draw(0.0), draw(-0.15))
}

pub(super) fn picture(bytes: &[u8]) -> Picture<'_> {
    Picture::packed(bytes, WIDTH, HEIGHT).unwrap()
}

/// Everything that a frame said, as text: floats are written so that different bits differ.
fn look(detector: &mut Small, (left, right): &(Vec<u8>, Vec<u8>)) -> String {
    let detection = detector.detect(&picture(left), &picture(right), &mut ()).unwrap();
    let text = std::format!("{detection:?}");
    let pixels: Vec<u16> = detector.disparity().pixels().iter().map(|pixel| pixel.bits()).collect();
    std::format!("{text} {pixels:?} {:?}", detector.surfaces().table())
}

/// Pictures that no camera should send.
fn garbage(random: &mut Random) -> (Vec<u8>, Vec<u8>) {
    let n = WIDTH * HEIGHT;
    let kind = random.below(8);
    let (period, phase, level) = (2 + random.below(30), random.below(40), random.below(256) as u8);
    let mut one = |shift: u32| -> Vec<u8> {
        (0..n as u32)
            .map(|i| {
                let (x, y) = (i % WIDTH as u32 + shift, i / WIDTH as u32);
                match kind {
                    0 => random.next() as u8,
                    1 => level,
                    2 => 255,
                    3 => 255 * (x / period % 2) as u8,
                    4 => 255 * (y / period % 2) as u8,
                    5 => ((x * 7 + y * period) % 256) as u8,
                    6 => (random.next() & random.next() & random.next()) as u8,
                    _ => {
                        if (x / period + y / period) % 2 == 0 {
                            255
                        } else {
                            random.next() as u8
                        }
                    }
                }
            })
            .collect()
    };
    (one(0), one(phase))
}

#[test]
fn a_good_pair_shows_ground_and_panel() {
    let mut detector = configured();
    look(&mut detector, &good_pair(1));
    let detection = detector.detection();
    let ground = detection.ground.expect("the ground is seen");
    assert!((ground.camera_height_m - 0.6).abs() < 0.03, "{ground:?}");
    assert!((ground.pitch_down_rad.to_degrees() - 10.0).abs() < 1.0, "{ground:?}");
    let nearest = detection.obstacles.first().expect("the panel is an obstacle");
    assert!((nearest.mean_m[0] - 2.0).abs() < 0.2 && nearest.mean_m[1].abs() < 0.15, "{nearest:?}");
    let statistics = detection.statistics;
    assert!(statistics.cells_obstacle > 0 && statistics.cells_free > 5, "{statistics:?}");
    let pixels = statistics.pixels_with_disparity + statistics.pixels_without.iter().sum::<u32>();
    assert_eq!(pixels as usize, WIDTH * HEIGHT);
    let states = |state| detection.map.cells.iter().filter(|cell| cell.state == state).count() as u32;
    assert_eq!(statistics.cells_obstacle, states(CellState::Obstacle));
    assert_eq!(statistics.cells_free, states(CellState::Free));
    assert_eq!(statistics.surfaces as usize, detector.surfaces().table().len());
}

#[test]
fn garbage_never_panics_and_leaves_nothing_behind() {
    let mut random = Random::seeded("garbage", 0x5eed_0160);
    let good = good_pair(2);
    let alone = look(&mut configured(), &good);
    let mut detector = configured();
    assert_eq!(look(&mut detector, &good), alone);
    for round in 0..300 {
        let frame = garbage(&mut random);
        look(&mut detector, &frame);
        let detection = detector.detection();
        assert!(
            detection.ground.is_some() || detection.statistics.cells_free == 0,
            "round {round}: free without ground"
        );
        if round % 10 == 0 {
            // The frames before have a say in what is told of the cameras, until the detector is configured anew.
            let mut anew = |frame| {
                detector.configure(&settings(), &StereoCalibration::Rectified(PAIR), &MOUNT).unwrap();
                look(&mut detector, frame)
            };
            assert_eq!(anew(&frame), look(&mut configured(), &frame), "round {round}: a new detector says the same");
            assert_eq!(anew(&good), alone, "round {round}: the frame before has no say");
        }
    }
}

#[test]
fn what_is_forgotten_has_no_say_in_the_next_frame() {
    let settings = Settings { ground: GroundSettings::default(), ..settings() };
    assert!(settings.ground.hold_frames > 0);
    let fresh = || {
        let mut detector = Box::new(Small::new());
        detector.configure(&settings, &StereoCalibration::Rectified(PAIR), &MOUNT).unwrap();
        detector
    };
    // Without what is told of the cameras, and what that takes away: reasons of before go on being told.
    let found = |detector: &mut Small, frame: &(Vec<u8>, Vec<u8>), blind: bool| {
        look(detector, frame);
        let mut detection = detector.detection().clone();
        detection.health = Health::OK;
        if blind {
            detection.map.withhold_free();
            detection.statistics.cells_free = 0;
            detection.sectors = SectorDistances::of(&detection.map, settings.map.sector_width_deg);
        }
        let pixels: Vec<u16> = detector.disparity().pixels().iter().map(|pixel| pixel.bits()).collect();
        std::format!("{detection:?} {pixels:?} {:?} {:?}", detector.surfaces().table(), detector.content())
    };
    let (good, other) = (good_pair(8), good_pair(9));
    let flat = (vec![90; WIDTH * HEIGHT], vec![90; WIDTH * HEIGHT]);
    let mut random = Random::seeded("forgetting", 0x5eed_0162);
    let mut detector = fresh();
    for round in 0..8 {
        let noise = garbage(&mut random);
        // The last frame before has most to say: held ground, the same picture again, another scene, garbage.
        for before in [[&noise, &good], [&good, &flat], [&flat, &other], [&good, &noise]] {
            for next in [&good, &flat, &noise] {
                detector.configure(&settings, &StereoCalibration::Rectified(PAIR), &MOUNT).unwrap();
                before.into_iter().for_each(|frame| drop(look(&mut detector, frame)));
                let told = detector.detection().health;
                detector.forget();
                assert!(detector.detection().map.cells.is_empty() && detector.detection().ground.is_none());
                let mut alone = fresh();
                let blind = told.level >= HealthLevel::Blind;
                let expected = found(&mut alone, next, blind);
                assert!(found(&mut detector, next, false) == expected, "round {round}: the frames before have a say");
                let (now, alone) = (detector.detection().health, alone.detection().health);
                assert_eq!(now.reasons & !told.reasons, alone.reasons & !told.reasons, "round {round}: nothing new");
                assert_eq!(now.reasons & told.reasons, told.reasons, "round {round}: what was told is still told");
            }
        }
        if round == 0 {
            // It is the forgetting that does it.
            detector.configure(&settings, &StereoCalibration::Rectified(PAIR), &MOUNT).unwrap();
            let expected = found(&mut fresh(), &flat, false);
            look(&mut detector, &good);
            assert!(found(&mut detector, &flat, false) != expected, "the ground is held");
        }
    }
}

#[test]
fn what_is_told_is_released_by_count_after_forgetting() {
    let mut detector = configured();
    let good = good_pair(10);
    let dark = (vec![0; WIDTH * HEIGHT], vec![0; WIDTH * HEIGHT]);
    let mut is_dark = |frame: &(Vec<u8>, Vec<u8>), forget: bool| {
        if forget {
            detector.forget();
        }
        look(&mut detector, frame);
        detector.detection().health.has(HealthReason::Underexposed)
    };
    assert!((0..3).all(|_| is_dark(&dark, false)));
    assert!((0..4).all(|_| is_dark(&good, false)));
    // Four of five frames without it have come, but not in a row with the next.
    let told: Vec<bool> = (0..6).map(|frame| is_dark(&good, frame == 0)).collect();
    assert_eq!(told, [true, true, true, true, false, false]);
}

#[test]
fn every_backend_finds_the_same() {
    const IDENTITY: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let distortion = Distortion([-0.05, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let camera = CameraModel {
        width: PAIR.width,
        height: PAIR.height,
        fx: PAIR.focal_px,
        fy: PAIR.focal_px,
        cx: PAIR.cx,
        cy: PAIR.cy,
        distortion,
    };
    let raw = StereoCalibration::Raw(RawPair {
        left: camera,
        right: camera,
        rotation: IDENTITY,
        translation_m: [-PAIR.baseline_m, 0.0, 0.0],
        rectification: Some(Rectification { left_rotation: IDENTITY, right_rotation: IDENTITY, pair: PAIR }),
    });
    let mut random = Random::seeded("pictures for every backend", 0x5eed_020a);
    let mut pairs = vec![good_pair(4), good_pair(5)];
    pairs.extend((0..6).map(|_| garbage(&mut random)));
    for calibration in [StereoCalibration::Rectified(PAIR), raw] {
        let found = |backend: Backend| -> Option<Vec<String>> {
            let mut detector = Box::new(Small::new());
            detector.set_backend(backend).then(|| {
                detector.configure(&settings(), &calibration, &MOUNT).unwrap();
                pairs.iter().map(|pair| look(&mut detector, pair)).collect()
            })
        };
        let plain = found(Backend::Plain).unwrap();
        assert!(plain[0].contains("state: Free"), "the stages have something to find");
        for &backend in Backend::ALL {
            match found(backend) {
                Some(texts) => assert!(texts == plain, "{} finds something else than plain Rust", backend.name()),
                None => std::println!("NOT RUN: this processor has no {}", backend.name()),
            }
        }
    }
}

#[test]
fn the_same_frame_gives_the_same_bytes_again() {
    let good = good_pair(3);
    let mut detector = configured();
    let first = look(&mut detector, &good);
    let again = |detector: &mut Small| {
        let detection = detector.detect(&picture(&good.0), &picture(&good.1), &mut ()).unwrap();
        std::format!("{:?} {:?} {:?}", detection.obstacles, detection.ground, detection.statistics.pixels_without)
    };
    let found = again(&mut detector);
    for _ in 0..3 {
        assert_eq!(again(&mut detector), found, "what is found is the same, though the camera is frozen");
    }
    assert!(detector.detection().health.has(crate::health::HealthReason::FrozenPicture));
    let mut other = Box::new(Small::default());
    // What was configured before has no say.
    let turned = Mount { height_m: None, pitch_down_deg: 30.0, roll_deg: 4.0, yaw_left_deg: 60.0, ..MOUNT };
    other
        .configure(
            &Settings { map: settings().map, matching: settings().matching, ..Settings::default() },
            &StereoCalibration::Rectified(PAIR),
            &turned,
        )
        .unwrap();
    look(&mut other, &good);
    other.configure(&settings(), &StereoCalibration::Rectified(PAIR), &MOUNT).unwrap();
    assert_eq!(look(&mut other, &good), first);
}

#[test]
fn a_detector_that_is_not_configured_says_so() {
    let mut detector = Box::new(Small::new());
    let bytes = vec![0; WIDTH * HEIGHT];
    let (left, right) = (picture(&bytes), picture(&bytes));
    assert_eq!(detector.detect(&left, &right, &mut ()).unwrap_err(), DetectError::NotConfigured);
    assert_eq!((detector.pair(), detector.frame(), detector.nearest_m()), (None, None, None));
    assert_eq!((detector.disparity().width(), detector.disparity().height()), (0, 0));
    assert!(detector.surface_at(0, 0).is_none() && detector.detection().map.cells.is_empty());

    // A bad configuration leaves it so, and takes back what was seen.
    let mut detector = configured();
    look(&mut detector, &good_pair(4));
    let bad = RectifiedPair { focal_px: f32::NAN, ..PAIR };
    assert!(detector.configure(&settings(), &StereoCalibration::Rectified(bad), &MOUNT).is_err());
    assert!(detector.detection().map.cells.is_empty() && detector.detection().ground.is_none());
    assert_eq!(detector.detect(&left, &right, &mut ()).unwrap_err(), DetectError::NotConfigured);
}

#[test]
fn pictures_of_another_size_are_refused_and_forget_the_last_frame() {
    let mut detector = configured();
    let good = good_pair(5);
    let bytes = vec![0; 4 * WIDTH * HEIGHT];
    for (width, height) in
        [(WIDTH - 1, HEIGHT), (WIDTH, HEIGHT - 1), (WIDTH + 1, HEIGHT), (1, 1), (2 * WIDTH, 2 * HEIGHT)]
    {
        look(&mut detector, &good);
        let other = Picture::packed(&bytes, width, height).unwrap();
        let same = picture(&good.0);
        let error = DetectError::WrongSize { found: (width, height), expected: (WIDTH, HEIGHT) };
        for (left, right) in [(&other, &same), (&same, &other), (&other, &other)] {
            assert_eq!(detector.detect(left, right, &mut ()).unwrap_err(), error);
            assert!(detector.detection().map.cells.is_empty() && detector.detection().ground.is_none());
        }
    }
    // Rows may lie farther apart than they are long.
    let wide =
        |bytes: &[u8]| -> Vec<u8> { bytes.chunks(WIDTH).flat_map(|row| row.iter().copied().chain([77; 9])).collect() };
    let (left, right) = (wide(&good.0), wide(&good.1));
    let strided = |bytes| Picture::new(bytes, WIDTH, HEIGHT, WIDTH + 9).unwrap();
    let expected = look(&mut detector, &good);
    let detection = std::format!("{:?}", detector.detect(&strided(&left), &strided(&right), &mut ()).unwrap());
    assert!(expected.starts_with(&detection));
}

#[test]
fn raw_pictures_may_have_another_size_than_the_rectified_ones() {
    let camera = CameraModel {
        width: 140,
        height: 110,
        fx: 120.0,
        fy: 120.0,
        cx: 69.5,
        cy: 54.5,
        distortion: Distortion::default(),
    };
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let raw = RawPair {
        left: camera,
        right: CameraModel { width: 150, ..camera },
        rotation: identity,
        translation_m: [-0.15, 0.0, 0.0],
        rectification: Some(Rectification { left_rotation: identity, right_rotation: identity, pair: PAIR }),
    };
    let mut detector = Box::new(Small::new());
    detector.configure(&settings(), &StereoCalibration::Raw(raw), &MOUNT).unwrap();
    let bytes = vec![90; 150 * 110];
    let left = Picture::packed(&bytes, 140, 110).unwrap();
    let right = Picture::packed(&bytes, 150, 110).unwrap();
    assert!(detector.detect(&left, &right, &mut ()).is_ok());
    assert_eq!((detector.disparity().width(), detector.disparity().height()), (WIDTH, HEIGHT));
    let error = DetectError::WrongSize { found: (140, 110), expected: (150, 110) };
    assert_eq!(detector.detect(&left, &left, &mut ()).unwrap_err(), error);
}

#[test]
fn what_does_not_fit_is_named() {
    let fails = |settings: Settings, pair: RectifiedPair, mount: Mount| {
        let mut detector = Box::new(Small::new());
        let error = detector.configure(&settings, &StereoCalibration::Rectified(pair), &mount).unwrap_err();
        assert!(detector.pair().is_none());
        error
    };
    let good = settings();
    let wide = fails(good, RectifiedPair { width: 161, height: 100, ..PAIR }, MOUNT);
    assert_eq!(wide.field, "calibration.width");
    assert_eq!(wide.problem, ConfigProblem::OverCapacity { needed: 161, capacity: 160 });
    let large = fails(good, RectifiedPair { height: 121, ..PAIR }, MOUNT);
    assert_eq!(large.field, "calibration.width x calibration.height");
    let deep = Settings { matching: MatchSettings { disparities: 33, ..good.matching }, ..good };
    let deep = fails(deep, PAIR, MOUNT);
    assert_eq!(deep.field, "matching.disparities");
    assert_eq!(deep.problem, ConfigProblem::OverCapacity { needed: 33, capacity: 32 });
    let geometry = MapGeometry { x_count: 21, ..good.map.geometry };
    let cells = fails(Settings { map: MapSettings { geometry, ..good.map }, ..good }, PAIR, MOUNT);
    assert_eq!(cells.field, "map.geometry");
    assert_eq!(cells.problem, ConfigProblem::OverCapacity { needed: 420, capacity: 400 });
    assert_eq!(fails(good, PAIR, Mount { roll_deg: f32::NAN, ..MOUNT }).field, "mount.roll_deg");
    assert_eq!(fails(good, RectifiedPair { baseline_m: -0.15, ..PAIR }, MOUNT).problem, ConfigProblem::Exchanged);
    for error in [wide, large, deep, cells] {
        assert!(std::format!("{error}").contains("room for"), "{error}");
    }
}

#[test]
fn extreme_calibrations_do_not_panic() {
    let frame = good_pair(6);
    let mut random = Random::seeded("extremes", 0x5eed_0161);
    for _ in 0..60 {
        let mut pick = |values: &[f32]| values[random.below(values.len() as u32) as usize];
        let pair = RectifiedPair {
            focal_px: pick(&[1.0, 120.0, 1.0e5]),
            cx: pick(&[-1.0e5, 79.5, 1.0e5]),
            cy: pick(&[-1.0e5, 59.5, 1.0e5]),
            baseline_m: pick(&[1.0e-3, 0.15, 100.0]),
            disparity_offset_px: pick(&[-1.0e4, -3.5, 0.0, 1.0e4]),
            ..PAIR
        };
        let mount = Mount {
            height_m: [None, Some(0.02), Some(20.0)][pick(&[0.0, 1.0, 2.0]) as usize],
            pitch_down_deg: pick(&[-60.0, 0.0, 89.0]),
            roll_deg: pick(&[-60.0, 0.0, 60.0]),
            forward_m: pick(&[-50.0, 0.0, 50.0]),
            left_m: pick(&[-50.0, 0.0, 50.0]),
            yaw_left_deg: pick(&[-180.0, 0.0, 90.0, 180.0]),
        };
        let mut detector = Box::new(Small::new());
        detector.configure(&settings(), &StereoCalibration::Rectified(pair), &mount).unwrap();
        look(&mut detector, &frame);
    }
}

#[test]
fn the_stages_go_by_in_order() {
    struct Log(Vec<Stage>);
    impl Probe for Log {
        fn enter(&mut self, stage: Stage) {
            self.0.push(stage);
        }
    }
    let (left, right) = good_pair(7);
    let mut log = Log(Vec::new());
    configured().detect(&picture(&left), &picture(&right), &mut log).unwrap();
    let (rows, rest) = log.0.split_at(3 * HEIGHT);
    assert!(rows.chunks(3).all(|row| row == [Stage::Rectify, Stage::Match, Stage::Health]));
    assert_eq!(rest, &Stage::ALL[2..]);
    for (i, stage) in Stage::ALL.into_iter().enumerate() {
        assert_eq!(stage as usize, i);
    }
}
