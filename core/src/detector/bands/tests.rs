//! Bands give what one thread gives, to the bit: pictures of all kinds and sizes, any number of bands.

use std::{boxed::Box, string::String, thread, vec::Vec};

use super::*;
use crate::{
    bands::{Job, OneThread},
    geometry::{CameraModel, Distortion, Mount, RawPair, RectifiedPair, StereoCalibration},
    matching::{MatchCost, MatchSettings},
    methods::DetectorKind,
    rectify::grid_nodes,
    settings::Settings,
    test_random::Random,
    validate::ValidateSettings,
    wire::{Frame, Scan, ScanEncoder, WireConfig},
};

const WIDTH: usize = 160;
const HEIGHT: usize = 150;
const CELLS: usize = 400;

type Small = Detector<{ WIDTH * HEIGHT }, WIDTH, 32, 900, 256, 8, CELLS>;
type SmallBand = Band<WIDTH, 32, CELLS>;

const MOUNT: Mount =
    Mount { height_m: Some(0.6), pitch_down_deg: 10.0, roll_deg: 0.0, forward_m: 0.0, left_m: 0.0, yaw_left_deg: 0.0 };

/// A thread for each job.
struct Threads;

impl Workers for Threads {
    fn run<J: Job>(&mut self, jobs: &mut [J]) {
        thread::scope(|scope| {
            for job in jobs {
                scope.spawn(|| job.run());
            }
        });
    }
}

fn pair(width: usize, height: usize) -> RectifiedPair {
    RectifiedPair {
        width: width as u32,
        height: height as u32,
        focal_px: 120.0,
        cx: width as f32 * 0.5,
        cy: height as f32 * 0.5,
        baseline_m: 0.15,
        disparity_offset_px: 0.0,
    }
}

/// The same pair behind lenses that distort.
fn raw(width: usize, height: usize) -> RawPair {
    let camera = |cx: f32| CameraModel {
        width: width as u32,
        height: height as u32,
        fx: 120.0,
        fy: 121.0,
        cx,
        cy: height as f32 * 0.5,
        distortion: Distortion([-0.15, 0.04, 0.001, -0.001, 0.0, 0.0, 0.0, 0.0]),
    };
    RawPair {
        left: camera(width as f32 * 0.5),
        right: camera(width as f32 * 0.49),
        rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        translation_m: [-0.15, 0.0, 0.0],
        rectification: None,
    }
}

fn settings() -> Settings {
    let mut settings = Settings::default();
    settings.matching.disparities = 32;
    settings.map.geometry =
        crate::map::MapGeometry { cell_size_mm: 250, x_first: 0, x_count: 20, y_first: -10, y_count: 20 };
    settings
}

/// Everything that a frame said and left behind, as text: floats are written so that different bits differ.
fn told(detector: &Small) -> String {
    let pixels: Vec<u16> = detector.disparity().pixels().iter().map(|pixel| pixel.bits()).collect();
    let surfaces = detector.surfaces();
    let labels: Vec<u8> = surfaces.labels().to_vec();
    let (width, height) = surfaces.size();
    let tiles = (0..height).step_by(32).flat_map(|y| (0..width).step_by(32).map(move |x| (x, y)));
    let firsts: Vec<usize> = tiles.map(|(x, y)| surfaces.first_of_tile(x, y)).collect();
    std::format!(
        "{:?} {:?} {pixels:?} {:?} {labels:?} {firsts:?}",
        detector.detection(),
        detector.content(),
        surfaces.table()
    )
}

/// Pictures: grey values of the left one, and the same moved along the row by a disparity that changes from patch to patch and from
/// row to row, with noise, parts that are flat, and parts that have nothing to do with each other.
fn pictures(random: &mut Random, width: usize, height: usize) -> [Vec<u8>; 2] {
    let kind = random.below(6);
    let (patch, flat) = (4 + random.below(40) as usize, random.below(4));
    let columns = width.div_ceil(patch) + 1;
    let disparities: Vec<usize> = (0..columns * (height / patch + 1)).map(|_| random.below(28) as usize).collect();
    let grain = 1 + random.below(3) as usize;
    let mut texture: Vec<u8> = (0..(width + 64) * height).map(|_| random.next() as u8).collect();
    if grain > 1 {
        texture = (0..texture.len()).map(|i| texture[i / grain * grain % texture.len()]).collect();
    }
    let mut left = std::vec![0; width * height];
    let mut right = left.clone();
    for y in 0..height {
        for x in 0..width {
            let place = y / patch * columns + x / patch;
            let disparity = match kind {
                0 => 3,
                1 => 2 + 20 * y / height,
                2 | 3 => disparities[place],
                _ => disparities[y / patch * columns],
            };
            let strength = if disparities[place] < 7 * flat as usize { 8 } else { 1 };
            let grey = |x: usize| 100 + texture[y * (width + 64) + x] / (2 * strength);
            left[y * width + x] = if kind == 5 { random.next() as u8 } else { grey(x) };
            right[y * width + x] = grey(x + disparity).saturating_add((random.below(4) == 0) as u8);
        }
    }
    [left, right]
}

/// Compares the frames of a detector in bands with those of another one on one thread.
fn compare(
    name: &str,
    settings: &Settings,
    calibration: &StereoCalibration,
    frames: &[[Vec<u8>; 2]],
    size: (usize, usize),
) {
    let configured = || {
        let mut detector = Box::new(Small::new());
        detector.configure(settings, calibration, &MOUNT).unwrap_or_else(|error| panic!("{name}: {error:?}"));
        detector
    };
    let mut alone = configured();
    let mut others: Vec<_> = (1..=5).map(|_| configured()).collect();
    // Used by all detectors in turn: a band keeps nothing.
    let mut bands: Vec<SmallBand> = (0..4).map(|_| SmallBand::new()).collect();
    for [left, right] in frames {
        let [left, right] = [left, right].map(|bytes| Picture::packed(bytes, size.0, size.1).unwrap());
        alone.detect(&left, &right, &mut ()).unwrap();
        let expected = told(&alone);
        for (count, detector) in (1..).zip(&mut others) {
            let bands = &mut bands[..count - 1];
            if count == 3 {
                detector.detect_in_bands(&left, &right, bands, &mut OneThread, &mut ()).unwrap();
            } else {
                detector.detect_in_bands(&left, &right, bands, &mut Threads, &mut ()).unwrap();
            }
            assert!(told(detector) == expected, "{name}, {size:?}: {count} bands are not one");
        }
    }
}

#[test]
fn pictures_of_all_sizes_are_the_same_in_bands() {
    let mut random = Random::seeded("pictures in bands", 0x5eed_0501);
    // Lower than the windows of all bands, and than one of them; on a border of the tiles, and beside it.
    for height in [16, 17, 19, 26, 31, 32, 33, 40, 64, 77, 96, 127, 129, 150] {
        let width = 24 + random.below((WIDTH - 24) as u32 + 1) as usize;
        let calibration = StereoCalibration::Rectified(pair(width, height));
        let frames: Vec<_> = (0..3).map(|_| pictures(&mut random, width, height)).collect();
        compare("rectified", &settings(), &calibration, &frames, (width, height));
    }
}

#[test]
fn raw_pictures_are_the_same_in_bands() {
    let mut random = Random::seeded("raw pictures in bands", 0x5eed_0502);
    for height in [33, 64, 90, 121, 150] {
        let width = 100 + random.below(61) as usize;
        let calibration = StereoCalibration::Raw(raw(width, height));
        let frames: Vec<_> = (0..4).map(|_| pictures(&mut random, width, height)).collect();
        compare("raw", &settings(), &calibration, &frames, (width, height));
    }
}

#[test]
fn whatever_the_settings_bands_give_the_same() {
    let mut random = Random::seeded("settings in bands", 0x5eed_0503);
    for round in 0..40 {
        let (width, height) = (60 + random.below(101) as usize, 50 + random.below(101) as usize);
        let mut settings = settings();
        let any = |random: &mut Random, all: &[u16]| all[random.below(all.len() as u32) as usize];
        settings.matching = MatchSettings {
            disparities: any(&mut random, &[16, 24, 32]),
            min_disparity: any(&mut random, &[0, 3]),
            cost: if round % 4 == 0 { MatchCost::AbsoluteDifferences } else { MatchCost::Census },
            window_width: any(&mut random, &[5, 9, 15]),
            window_height: any(&mut random, &[5, 7, 13, 21]),
            wide_window_width: any(&mut random, &[0, 31]),
            texture: any(&mut random, &[0, 32, 100]),
            ..MatchSettings::DEFAULT
        };
        settings.validate = ValidateSettings {
            min_surface_px: any(&mut random, &[0, 1, 2, 30, 120, 1024]),
            step_sixteenths: any(&mut random, &[0, 8, 40]),
        };
        let kinds = DetectorKind::ALL;
        settings.detector = kinds[random.below(kinds.len() as u32) as usize];
        if round % 3 == 0 {
            settings.cross_check = Some(DetectorKind::SurfaceNormals);
        }
        if settings.cross_check == Some(settings.detector) {
            settings.cross_check = None;
        }
        settings.surfaces.min_pixels = any(&mut random, &[16, 40]);
        let calibration = StereoCalibration::Rectified(pair(width, height));
        let frames: Vec<_> = (0..2).map(|_| pictures(&mut random, width, height)).collect();
        if settings.matching.check().is_ok() {
            compare(&std::format!("round {round}"), &settings, &calibration, &frames, (width, height));
        }
    }
}

#[test]
fn more_surfaces_than_the_table_takes_are_left_out_alike() {
    /// Room for hardly more surfaces than tiles.
    type Narrow = Detector<{ WIDTH * HEIGHT }, WIDTH, 32, 0, 26, 8, CELLS>;
    let mut random = Random::seeded("full tables in bands", 0x5eed_0504);
    let (mut alone, mut cut) = (Box::new(Narrow::new()), Box::new(Narrow::new()));
    let mut settings = settings();
    settings.validate.min_surface_px = 20;
    for detector in [&mut alone, &mut cut] {
        detector.configure(&settings, &StereoCalibration::Rectified(pair(WIDTH, HEIGHT)), &MOUNT).unwrap();
    }
    let mut bands = [SmallBand::new(), SmallBand::new()];
    let mut dropped = 0;
    for _ in 0..12 {
        let [left, right] = pictures(&mut random, WIDTH, HEIGHT);
        let [left, right] = [&left, &right].map(|bytes| Picture::packed(bytes, WIDTH, HEIGHT).unwrap());
        let expected = std::format!("{:?}", alone.detect(&left, &right, &mut ()).unwrap());
        let found =
            std::format!("{:?}", cut.detect_in_bands(&left, &right, &mut bands, &mut Threads, &mut ()).unwrap());
        assert!(found == expected);
        assert_eq!(cut.surfaces().table(), alone.surfaces().table());
        assert_eq!(cut.surfaces().labels(), alone.surfaces().labels());
        dropped += alone.detection().statistics.surfaces_dropped;
    }
    assert!(dropped > 0, "the table was never full");
}

#[test]
fn a_picture_is_cut_into_no_more_bands_than_there_may_be() {
    let mut random = Random::seeded("many bands", 0x5eed_0505);
    let (mut alone, mut cut) = (Box::new(Small::new()), Box::new(Small::new()));
    for detector in [&mut alone, &mut cut] {
        detector.configure(&settings(), &StereoCalibration::Rectified(pair(WIDTH, HEIGHT)), &MOUNT).unwrap();
    }
    let mut bands: Vec<SmallBand> = (0..MAX_BANDS + 1).map(|_| SmallBand::new()).collect();
    // The right picture is darker: what is told of exposures is told of each.
    let [left, mut right] = pictures(&mut random, WIDTH, HEIGHT);
    right.iter_mut().for_each(|grey| *grey /= 3);
    let [left, right] = [&left, &right].map(|bytes| Picture::packed(bytes, WIDTH, HEIGHT).unwrap());
    for others in [0, 1, MAX_BANDS - 2, MAX_BANDS - 1, MAX_BANDS, MAX_BANDS + 1] {
        alone.detect(&left, &right, &mut ()).unwrap();
        cut.detect_in_bands(&left, &right, &mut bands[..others], &mut OneThread, &mut ()).unwrap();
        assert!(told(&alone) == told(&cut), "{others} bands beside the first");
    }
}

#[test]
fn what_cannot_be_looked_at_is_refused_as_without_bands() {
    let mut detector = Box::new(Small::new());
    let bytes = [0; 40 * 40];
    let picture = Picture::packed(&bytes, 40, 40).unwrap();
    let mut bands = [SmallBand::new()];
    let refused = detector.detect_in_bands(&picture, &picture, &mut bands, &mut Threads, &mut ()).map(|_| ());
    assert_eq!(refused, Err(DetectError::NotConfigured));
    detector.configure(&settings(), &StereoCalibration::Rectified(pair(64, 48)), &MOUNT).unwrap();
    let refused = detector.detect_in_bands(&picture, &picture, &mut bands, &mut Threads, &mut ()).map(|_| ());
    assert_eq!(refused, Err(DetectError::WrongSize { found: (40, 40), expected: (64, 48) }));
}

/// Frames of the committed recording, rectified and through a lens: all that is found, and the bytes that go on the bus.
#[test]
fn the_recording_says_the_same_on_the_bus_in_bands() {
    const WIDTH: usize = 320;
    const HEIGHT: usize = 240;
    const CELLS: usize = 2500;
    type Recorded = Detector<{ WIDTH * HEIGHT }, WIDTH, 48, { grid_nodes(WIDTH, HEIGHT) }, 400, 64, CELLS>;
    let read = |side: usize, frame: usize| -> Vec<u8> {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/recordings/trail");
        let path = folder.join(std::format!("image_{side}/{frame:06}.png"));
        let file = std::fs::File::open(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().unwrap();
        let mut pixels = std::vec![0; WIDTH * HEIGHT];
        reader.next_frame(&mut pixels).unwrap();
        pixels
    };
    let frames: Vec<_> = (0..4).map(|frame| [read(0, frame), read(1, frame)]).collect();
    let mut settings = Settings::default();
    settings.matching.disparities = 48;
    let rectified = RectifiedPair { focal_px: 262.5, cx: 159.5, cy: 119.5, baseline_m: 0.12, ..pair(WIDTH, HEIGHT) };
    for calibration in [StereoCalibration::Rectified(rectified), StereoCalibration::Raw(raw(WIDTH, HEIGHT))] {
        let look = |count: usize| -> Vec<String> {
            let mut encoder = ScanEncoder::<CELLS>::new(WireConfig::default()).unwrap();
            let mut detector = Box::new(Recorded::new());
            let mount = Mount { height_m: Some(1.1), ..MOUNT };
            detector.configure(&settings, &calibration, &mount).unwrap();
            let mut bands: Vec<Band<WIDTH, 48, CELLS>> = (1..count).map(|_| Band::new()).collect();
            let mut say = |(index, [left, right]): (usize, &[Vec<u8>; 2])| {
                let [left, right] = [left, right].map(|bytes| Picture::packed(bytes, WIDTH, HEIGHT).unwrap());
                match count {
                    0 => detector.detect(&left, &right, &mut ()),
                    _ => detector.detect_in_bands(&left, &right, &mut bands, &mut Threads, &mut ()),
                }
                .unwrap();
                let found = detector.detection();
                let scan = Scan {
                    scan_index: index as u16,
                    age_ns: 0,
                    health: found.health,
                    geometry: &found.map.geometry,
                    cells: &found.map.cells,
                    sectors: &found.sectors,
                    ground: found.ground.as_ref(),
                };
                let mut payloads = Box::new(heapless::Vec::<Frame, 600>::new());
                encoder.encode(&scan, payloads.as_mut_view()).unwrap();
                let pixels: Vec<u16> = detector.disparity().pixels().iter().map(|pixel| pixel.bits()).collect();
                std::format!("{found:?} {pixels:?} {:?} {payloads:?}", detector.surfaces().table())
            };
            frames.iter().enumerate().map(&mut say).collect()
        };
        let expected = look(0);
        for count in 1..=5 {
            assert!(look(count) == expected, "{count} bands are not one");
        }
    }
}
