//! Pairs of pictures with something wrong with a camera, as large as it takes to see it: covered lenses, other moments, rows out of
//! line, exposure, pictures that come again, sides that are exchanged.

use std::cell::RefCell;

use fencepost_core::{
    bands::OneThread,
    detector::{Band, Detector},
    geometry::{CameraModel, Distortion, Mount, RawPair, Rectification, RectifiedPair, StereoCalibration},
    health::{HealthLevel, HealthReason, HealthSettings},
    matching::MatchSettings,
    picture::Picture,
    rectify::grid_nodes,
    settings::Settings,
};

use crate::Source;

const WIDTH: usize = 80;
const HEIGHT: usize = 64;
const DISPARITIES: usize = 8;
const CELLS: usize = 64;

type Large = Detector<{ WIDTH * HEIGHT }, WIDTH, DISPARITIES, { grid_nodes(WIDTH, HEIGHT) }, 16, 3, CELLS>;

struct Detectors {
    whole: Large,
    cut: Large,
    band: [Band<WIDTH, DISPARITIES, CELLS>; 1],
}

thread_local! {
    static DETECTORS: RefCell<Box<Detectors>> = RefCell::new(Box::new(Detectors {
        whole: Large::new(),
        cut: Large::new(),
        band: [const { Band::new() }; 1],
    }));
}

/// A wall, the ground or rails, with a texture that moves up from moment to moment, and what is wrong with the view of it.
struct Scene {
    seed: u32,
    grain: usize,
    disparity: usize,
    /// Rows from one moment to the next.
    speed: usize,
    /// Moments that each side is late, rows that the right one is too low.
    late: [usize; 2],
    lower: usize,
    exchanged: bool,
    /// Which side has its left part of so many columns covered, with which grey.
    covered: Option<(usize, usize, u8)>,
    /// Which side has its grey values shifted, by so many bits down or up.
    exposed: Option<(usize, u8)>,
}

impl Scene {
    fn read(source: &mut Source<'_>) -> Self {
        let wrong = source.below(8);
        let any = |source: &mut Source<'_>, is: usize, below: usize| if wrong == is { source.below(below) } else { 0 };
        Self {
            seed: u32::from(source.byte()),
            grain: 1 + source.below(4),
            disparity: source.below(DISPARITIES - 1),
            speed: source.below(4),
            late: [any(source, 1, 4), any(source, 2, 4)],
            lower: any(source, 3, 5),
            exchanged: wrong == 4,
            covered: (wrong == 5).then(|| (source.below(2), source.below(WIDTH + 1), source.byte())),
            exposed: (wrong == 6).then(|| (source.below(2), source.byte())),
        }
    }

    /// One side's picture of a moment.
    fn draw(&self, side: usize, moment: usize, picture: &mut Vec<u8>) {
        picture.clear();
        let seen = if self.exchanged { 1 - side } else { side };
        let top = 64 + self.speed * moment.saturating_sub(self.late[side]) + self.lower * seen;
        for y in top..top + HEIGHT {
            let row = self.noise(y / 2, 1000) / 2;
            let sixteenths = if seen == 1 { self.sixteenths(y - top) } else { 0 };
            let texture = |at: usize| u32::from(self.noise(y / self.grain, at / self.grain) / 2);
            for x in 0..WIDTH {
                let (at, beyond) = (x + sixteenths / 16, (sixteenths % 16) as u32);
                let grey = (texture(at) * (16 - beyond) + texture(at + 1) * beyond) / 16;
                picture.push(row + grey as u8);
            }
        }
        if let Some((_, columns, grey)) = self.covered.filter(|(which, ..)| *which == side) {
            picture.chunks_exact_mut(WIDTH).for_each(|row| row[..columns].fill(grey));
        }
        if let Some((_, how)) = self.exposed.filter(|(which, _)| *which == side) {
            for grey in picture.iter_mut() {
                *grey = if how & 1 == 0 { *grey >> (how % 8) } else { grey.saturating_add(how) };
            }
        }
    }

    /// Disparity of a row: that of a wall, of the ground that the mount promises, or of rails, which are more surfaces than there is
    /// room for.
    fn sixteenths(&self, y: usize) -> usize {
        match self.seed % 8 {
            7 => {
                // From 1 m high, 20 degrees down: with 70 px of focal length and 0.1 m between the cameras.
                let down = 20_f32.to_radians().sin() + (y as f32 - 32.0) / 70.0 * 20_f32.to_radians().cos();
                (16.0 * 7.0 * down).max(0.0) as usize
            }
            6 => 16 * (1 + 3 * (y / 8 % 2)),
            _ => 16 * self.disparity,
        }
    }

    fn noise(&self, y: usize, x: usize) -> u8 {
        let mixed = (y as u32).wrapping_mul(0x9E37_79B1) ^ (x as u32).wrapping_mul(0x85EB_CA77) ^ self.seed;
        (mixed ^ mixed >> 15).wrapping_mul(0x2C1B_3C6D).rotate_left(7) as u8
    }
}

/// A few frames of a scene. Reasons are told at once and forgotten at once, so that what is told is what is found.
pub(crate) fn check(source: &mut Source<'_>) {
    let (width, height) = (WIDTH - 16 * source.below(2), HEIGHT - 16 * source.below(2));
    let pair = RectifiedPair {
        width: width as u32,
        height: height as u32,
        focal_px: 70.0,
        cx: 0.5 * width as f32,
        cy: 0.5 * height as f32,
        baseline_m: 0.1,
        disparity_offset_px: 0.0,
    };
    let health = HealthSettings {
        covered_percent: source.one_of(&[10.0, 1.0, 60.0]),
        pairing_sigmas: source.one_of(&[3.5, 1.0]),
        trigger_frames: 1,
        release_frames: 1,
        ..HealthSettings::default()
    };
    let matching = MatchSettings { disparities: DISPARITIES as u16, min_disparity: 0, ..MatchSettings::DEFAULT };
    let settings = Settings {
        matching,
        health,
        map: fencepost_core::map::MapSettings {
            geometry: fencepost_core::map::MapGeometry {
                cell_size_mm: 500,
                x_first: 0,
                x_count: 8,
                y_first: -4,
                y_count: 8,
            },
            ..Default::default()
        },
        ..Settings::default()
    };
    let mount = Mount { height_m: Some(1.0), pitch_down_deg: 20.0, ..Mount::default() };
    let (in_bands, raw) = (source.seldom(3), source.below(4) == 3);
    DETECTORS.with_borrow_mut(|detectors| {
        let Detectors { whole, cut, band } = &mut **detectors;
        let calibration = if raw { seen_in_part(source, pair) } else { StereoCalibration::Rectified(pair) };
        assert_eq!(whole.configure(&settings, &calibration, &mount), Ok(()));
        if in_bands {
            assert_eq!(cut.configure(&settings, &calibration, &mount), Ok(()));
        }
        let mut pictures = [Vec::new(), Vec::new()];
        let mut seen: [Vec<Vec<u8>>; 2] = Default::default();
        let mut scene = Scene::read(source);
        for moment in 0..1 + source.below(8) {
            if source.below(4) == 3 {
                scene = Scene::read(source);
            }
            for (side, picture) in pictures.iter_mut().enumerate() {
                scene.draw(side, moment, picture);
            }
            let [left, right] =
                pictures.each_ref().map(|bytes| Picture::new(bytes, width, height, WIDTH).expect("a picture"));
            let found = whole.detect(&left, &right, &mut ()).expect("pictures of the right size");
            let looked = [&left, &right].map(looked_at);
            check_told(found, &settings.health, &looked, &mut seen);
            let all_covered = !raw && scene.covered.is_some_and(|(_, columns, _)| columns >= width);
            assert!(
                !all_covered || found.health.has(HealthReason::Blocked),
                "a lens that is covered: {:?}",
                found.health
            );
            if in_bands {
                let cut = cut.detect_in_bands(&left, &right, band, &mut OneThread, &mut ()).expect("the same pictures");
                assert_eq!((cut.health, cut.statistics), (found.health, found.statistics), "in bands");
            }
        }
    });
}

/// Raw pictures that fill only a part of the rectified ones.
fn seen_in_part(source: &mut Source<'_>, pair: RectifiedPair) -> StereoCalibration {
    let RectifiedPair { width, height, focal_px, cx, cy, .. } = pair;
    let distortion = Distortion::default();
    let camera = CameraModel { width, height, fx: focal_px, fy: focal_px, cx, cy, distortion };
    let same = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let pair = RectifiedPair { cx: cx + source.within(-80.0, 80.0), cy: cy + source.within(-40.0, 40.0), ..pair };
    let rectification = Some(Rectification { left_rotation: same, right_rotation: same, pair });
    let translation_m = [-pair.baseline_m, 0.0, 0.0];
    StereoCalibration::Raw(RawPair { left: camera, right: camera, rotation: same, translation_m, rectification })
}

/// Every fourth pixel of every fourth row.
fn looked_at(picture: &Picture<'_>) -> Vec<u8> {
    (0..picture.height()).step_by(4).flat_map(|y| picture.row(y).iter().step_by(4).copied()).collect()
}

/// What can be counted is told if it is so, and only then.
fn check_told(
    found: &fencepost_core::detector::Detection<3, CELLS>,
    settings: &HealthSettings,
    looked: &[Vec<u8>; 2],
    seen: &mut [Vec<Vec<u8>>; 2],
) {
    let health = &found.health;
    let share = |which: &dyn Fn(u8) -> bool| {
        let of =
            |pixels: &Vec<u8>| 100.0 * pixels.iter().filter(|grey| which(**grey)).count() as f64 / pixels.len() as f64;
        looked.iter().map(of).fold(0.0, f64::max)
    };
    // Rounding decides at the limit.
    let told = |reason: HealthReason, amount: f64, limit: f32| {
        let far = (amount - f64::from(limit)).abs() > 1.0e-3;
        assert!(
            !far || health.has(reason) == (amount > f64::from(limit)),
            "{reason:?}: {amount} of {limit}, {health:?}"
        );
    };
    told(HealthReason::Underexposed, share(&|grey| grey <= 12), settings.dark_percent.min(settings.dark_blind_percent));
    told(
        HealthReason::Overexposed,
        share(&|grey| grey >= 250),
        settings.bright_percent.min(settings.bright_blind_percent),
    );
    let [a, b] =
        looked.each_ref().map(|pixels| pixels.iter().map(|g| f64::from(*g)).sum::<f64>() / pixels.len() as f64);
    told(HealthReason::ExposureMismatch, a.max(b) / a.min(b).max(1.0), settings.exposure_ratio);
    let coverage = 100.0 * f64::from(found.statistics.coverage());
    told(HealthReason::LowCoverage, -coverage, -settings.low_coverage_percent);
    assert_eq!(health.has(HealthReason::NoGround), found.ground.is_none(), "{health:?}");
    let held = found.ground.is_some_and(|ground| ground.age_frames > 0);
    assert_eq!(health.has(HealthReason::GroundHeld), held, "{health:?}");
    let mut again = false;
    for (looked, seen) in looked.iter().zip(seen) {
        let says_something = looked.iter().any(|grey| *grey != looked[0]);
        again |= says_something && seen.iter().rev().take(3).any(|before| before == looked);
        seen.push(looked.clone());
    }
    assert_eq!(health.has(HealthReason::FrozenPicture), again, "{health:?}");
    assert!(!again || health.level >= HealthLevel::Blind, "{health:?}");
    if health.has(HealthReason::BadlyPaired) {
        assert!(health.level >= HealthLevel::Blind && !health.has(HealthReason::BadlyRectified), "{health:?}");
    }
    assert!(!health.has(HealthReason::Exchanged) || health.level == HealthLevel::Fault, "{health:?}");
    assert!(
        health.level < HealthLevel::Blind || found.statistics.cells_free == 0,
        "free in pictures not to be trusted"
    );
}
