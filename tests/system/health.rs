//! What the detector says about itself: nothing while all is well, and each fault of cameras and lenses within two frames.

use std::{fmt, path::Path};

use fencepost::{cli::FrameRange, config::Config, detector, source::Input};
use fencepost_core::{
    geometry::{Mount, StereoCalibration},
    health::{ContentSigns, Health, HealthLevel, HealthReason},
    map::CellState,
    picture::Picture,
};
use fencepost_hal::{
    camera::Camera,
    scene::{Content, SceneOptions},
};
use fencepost_tests::{at_hand, say};

/// A grey picture of its own.
#[derive(Clone, PartialEq)]
struct Grey {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

/// All pairs of a recording.
struct Sequence {
    name: String,
    calibration: StereoCalibration,
    mount: Mount,
    pairs: Vec<[Grey; 2]>,
}

/// What became of one frame.
struct Seen {
    health: Health,
    free: usize,
    signs: ContentSigns,
}

impl Grey {
    fn of(picture: &Picture<'_>) -> Self {
        let (width, height) = (picture.width(), picture.height());
        let pixels = (0..height).flat_map(|y| picture.row(y).iter().copied()).collect();
        Self { width, height, pixels }
    }

    fn view(&self) -> Picture<'_> {
        Picture::packed(&self.pixels, self.width, self.height).unwrap()
    }

    /// The same picture with every pixel made anew from its place.
    fn remade(&self, make: impl Fn(usize, usize) -> f32) -> Self {
        let places = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        Self { pixels: places.map(|(x, y)| make(x, y).round().clamp(0.0, 255.0) as u8).collect(), ..*self }
    }

    /// Grey value between pixels; the edge goes on outside.
    fn at(&self, x: f32, y: f32) -> f32 {
        let get = |x: f32, y: f32| {
            let x = (x.max(0.0) as usize).min(self.width - 1);
            let y = (y.max(0.0) as usize).min(self.height - 1);
            f32::from(self.pixels[y * self.width + x])
        };
        let (x0, y0) = (x.floor(), y.floor());
        let (a, b) = (x - x0, y - y0);
        let upper = (1.0 - a) * get(x0, y0) + a * get(x0 + 1.0, y0);
        let lower = (1.0 - a) * get(x0, y0 + 1.0) + a * get(x0 + 1.0, y0 + 1.0);
        (1.0 - b) * upper + b * lower
    }

    /// Moved down by a number of rows.
    fn lowered(&self, rows: f32) -> Self {
        self.remade(|x, y| self.at(x as f32, y as f32 - rows))
    }

    /// Turned about its middle.
    fn turned(&self, degrees: f32) -> Self {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let (mx, my) = (self.width as f32 / 2.0, self.height as f32 / 2.0);
        self.remade(|x, y| {
            let (dx, dy) = (x as f32 - mx, y as f32 - my);
            self.at(mx + cos * dx - sin * dy, my + sin * dx + cos * dy)
        })
    }

    /// Covered from the left by something without structure, out of focus, up to `share` of the width.
    fn covered(&self, share: f32, frame: usize) -> Self {
        let mut noise = Noise(frame as u64 ^ 0x5eed);
        let covered = self.remade(|x, y| {
            let edge = (share * self.width as f32 - x as f32) / (0.08 * self.width as f32) + 0.5;
            let cover = edge.clamp(0.0, 1.0);
            let shade = 90.0 + 40.0 * x as f32 / self.width as f32 + 20.0 * y as f32 / self.height as f32;
            cover * shade + (1.0 - cover) * f32::from(self.pixels[y * self.width + x])
        });
        Self { pixels: covered.pixels.iter().map(|&grey| noise.on(grey, 2.0)).collect(), ..covered }
    }

    /// Every grey value changed in the same way.
    fn exposed(&self, frame: usize, change: impl Fn(f32) -> f32) -> Self {
        let mut noise = Noise(frame as u64 ^ 0x5eee);
        let changed = self.pixels.iter().map(|&grey| change(f32::from(grey)).round().clamp(0.0, 255.0) as u8);
        Self { pixels: changed.map(|grey| noise.on(grey, 1.0)).collect(), ..*self }
    }
}

/// Noise of a sensor, repeatable (SplitMix64).
struct Noise(u64);

impl Noise {
    fn on(&mut self, grey: u8, sigma: f32) -> u8 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z ^= z >> 27;
        // Sum of four numbers of 8 bits: nearly normal, with a standard deviation of 147.8.
        let sum: i64 = (0..4).map(|i| (z >> (8 * i + 20) & 0xff) as i64).sum();
        let deviation = (sum - 510) as f32 / 147.8 * sigma;
        (f32::from(grey) + deviation).round().clamp(0.0, 255.0) as u8
    }
}

impl Sequence {
    fn read(name: &str) -> Option<Self> {
        Some(Self::open(name, &at_hand::recording(name)?))
    }

    fn open(name: &str, folder: &Path) -> Self {
        let mut input = Input::recording(folder, &FrameRange::default().0).unwrap_or_else(|e| panic!("{name}: {e}"));
        let mut pairs = Vec::new();
        while let Some(()) =
            input.source.next_pair(|pair| pairs.push([Grey::of(&pair.left), Grey::of(&pair.right)])).unwrap()
        {}
        Self { name: name.to_owned(), calibration: input.calibration, mount: input.mount, pairs }
    }

    /// Runs the detector over the pairs that `change` makes of the first frames.
    fn run(&self, frames: usize, change: impl Fn(usize) -> [Grey; 2]) -> Vec<Seen> {
        let width = self.pairs[0][0].width as u32;
        let mut detector = detector::lock();
        detector.configure(&Config::default().settings_for(width), &self.calibration, &self.mount).unwrap();
        (0..frames)
            .map(|frame| {
                let [left, right] = change(frame);
                let detection = detector.detect(&left.view(), &right.view(), &mut ()).unwrap();
                let free = detection.map.cells.iter().filter(|cell| cell.state == CellState::Free).count();
                Seen { health: detection.health, free, signs: *detector.content() }
            })
            .collect()
    }
}

impl fmt::Display for Seen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ContentSigns { coverings, pairing, rows } = self.signs;
        let names: Vec<_> =
            HealthReason::ALL.into_iter().filter(|r| self.health.has(*r)).map(HealthReason::name).collect();
        write!(f, "{:?} {}; free {}; ", self.health.level, names.join(" "), self.free)?;
        for c in coverings {
            write!(f, "covered {}/{} flat {:.0} ", c.covered, c.judged, c.flat_percent)?;
        }
        write!(f, "pairing {:.1} {:.2} {} ", pairing.advantage_sigmas, pairing.likeness, pairing.lag_frames)?;
        write!(f, "rows {:.2} of {} near {:.0}", rows.error_px, rows.matches, rows.near_percent)
    }
}

/// Recordings that move, so that a picture of another moment shows.
const MOVING: [&str; 3] = ["kitti-urban", "kitti-rural", "bridge"];

/// Reasons that undisturbed pictures never give.
const NEVER: [HealthReason; 8] = [
    HealthReason::FrozenPicture,
    HealthReason::Blocked,
    HealthReason::Underexposed,
    HealthReason::Overexposed,
    HealthReason::BadlyPaired,
    HealthReason::BadlyRectified,
    HealthReason::NearZoneBlocked,
    HealthReason::Exchanged,
];

/// The frame with which a camera begins to lag, and the one with which it ends where that is looked at.
const BEGINS: usize = 6;
const ENDS: usize = 8;

impl Sequence {
    fn moving() -> impl Iterator<Item = Self> {
        MOVING.into_iter().filter_map(Self::read)
    }

    fn pair(&self, frame: usize) -> [Grey; 2] {
        self.pairs[frame].clone()
    }

    /// Runs with a fault of the pictures in the second and third frame, and asserts that `reason` is told by the third, and that
    /// nothing is free from the second on where `level` says so.
    fn finds(
        &self,
        what: &str,
        reason: HealthReason,
        level: HealthLevel,
        spoil: impl Fn(usize, [Grey; 2]) -> [Grey; 2],
    ) {
        let seen = self.run(3, |frame| if frame == 0 { self.pair(0) } else { spoil(frame, self.pair(frame)) });
        let name = &self.name;
        say!("{name}, {what}: {}", seen[2]);
        assert!(!seen[0].health.has(reason), "{name}, {what}: {} before it happens", seen[0]);
        assert!(seen[2].health.has(reason), "{name}, {what}: {}", seen[2]);
        assert!(seen[2].health.level >= level, "{name}, {what}: {}", seen[2]);
        if level >= HealthLevel::Blind {
            assert!(seen[1..].iter().all(|seen| seen.free == 0), "{name}, {what}: free cells");
        }
    }
}

#[test]
fn undisturbed_recordings_give_no_reason_to_doubt_the_cameras() {
    let mut alarms = Vec::new();
    for name in at_hand::RECORDINGS {
        let Some(sequence) = Sequence::read(name) else { continue };
        let seen = sequence.run(sequence.pairs.len(), |frame| sequence.pair(frame));
        let worst = |of: &dyn Fn(&Seen) -> f32| seen.iter().map(of).fold(f32::MIN, f32::max);
        let covered = |s: &Seen| {
            let shares = s.signs.coverings.map(|c| f32::from(c.covered) / f32::from(c.judged.max(1)));
            shares[0].max(shares[1]) * 100.0
        };
        say!(
            "{name}: {} frames; at most {:.0} % of a lens covered, other moments better by {:.1} sigma, rows {:.2} px off, \
             {:.0} % too near",
            seen.len(),
            worst(&covered),
            worst(&|s| s.signs.pairing.advantage_sigmas),
            worst(&|s| s.signs.rows.error_px),
            worst(&|s| s.signs.rows.near_percent)
        );
        let doubts = seen.iter().enumerate().filter(|(_, seen)| NEVER.iter().any(|reason| seen.health.has(*reason)));
        alarms.extend(doubts.map(|(frame, seen)| format!("{name} {frame}: {seen}")));
    }
    assert_eq!(alarms, [""; 0]);
}

#[test]
fn undisturbed_scenes_give_no_reason_to_doubt_the_cameras() {
    let usual = SceneOptions { width: 320, height: 240, focal_px: 262.5, frames: 4, ..SceneOptions::default() };
    let lens = SceneOptions {
        distortion: Some(SceneOptions::USUAL_DISTORTION),
        misalignment: Some(SceneOptions::USUAL_MISALIGNMENT),
        ..usual
    };
    for options in
        [usual, lens, SceneOptions { seed: 3, ..usual }, SceneOptions { content: Content::OpenGround, ..usual }]
    {
        say!("{} frames of {options:?}", options.frames);
        super::cells::for_each_frame(options, |_, frame, detector| {
            let health = detector.detection().health;
            assert!(!NEVER.iter().any(|reason| health.has(*reason)), "{options:?}, frame {frame}: {health:?}");
        });
    }
}

#[test]
fn a_camera_that_lags_is_found_within_two_frames_and_forgiven() {
    for sequence in Sequence::moving() {
        let name = &sequence.name;
        for (side, lag, is_forgiven) in
            [(0, 1, false), (1, 1, false), (0, 2, false), (1, 2, true), (0, 5, false), (1, 5, false)]
        {
            // No more frames of before than it takes to recognise the picture that is late, and one that is before that.
            let first = BEGINS - lag - 1;
            let end = if is_forgiven { sequence.pairs.len().min(ENDS + 6) } else { ENDS };
            let seen = sequence.run(end - first, |frame| {
                let frame = first + frame;
                let mut pair = sequence.pair(frame);
                if (BEGINS..ENDS).contains(&frame) {
                    pair[side] = sequence.pairs[frame - lag][side].clone();
                }
                pair
            });
            let seen = |frame: usize| &seen[frame - first];
            let which = ["left", "right"][side];
            say!("{name}, frames {first} to {}, {which} lags by {lag}: {}", end - 1, seen(BEGINS + 1));
            let has = |frame: usize| seen(frame).health.has(HealthReason::BadlyPaired);
            assert!((first..BEGINS).all(|frame| !has(frame)), "{name}, {which} lags by {lag}: not yet");
            assert!((BEGINS + 1..ENDS).all(has), "{name}, {which} lags by {lag}: {}", seen(BEGINS + 1));
            assert!((BEGINS..ENDS).all(|frame| seen(frame).free == 0), "{name}, {which} lags by {lag}: free cells");
            let found = seen(BEGINS + 1).signs.pairing.lag_frames;
            assert_eq!(i32::from(found), [-1, 1][side] * lag as i32, "{name}, {which} lags by {lag}");
            // Told for some frames more, and then no longer.
            if end > ENDS + 5 {
                let seen = seen(ENDS + 5);
                assert!(!seen.health.has(HealthReason::BadlyPaired) && seen.free > 0, "{name}: {seen}");
            }
        }
    }
}

#[test]
fn rows_out_of_line_are_found_within_two_frames() {
    let names = MOVING.into_iter().chain(["euroc-room", "stereoboard-take21"]);
    for sequence in names.filter_map(Sequence::read) {
        let (reason, wide) = (HealthReason::BadlyRectified, sequence.pairs[0][0].width > 300);
        // The rows of this one are off by 0.7 px as it is.
        let rows = if sequence.name == "bridge" { [-1.5, -3.0] } else { [1.5, 3.0] };
        for (rows, level) in rows.into_iter().zip([HealthLevel::Degraded, HealthLevel::Blind]) {
            sequence.finds(&format!("right {rows} rows lower"), reason, level, |_, [l, r]| [l, r.lowered(rows)]);
        }
        sequence.finds("left 3 rows lower", reason, HealthLevel::Blind, |_, [l, r]| {
            [l.lowered(-3.0 * rows[0].signum()), r]
        });
        if wide {
            sequence.finds("right turned", reason, HealthLevel::Degraded, |_, [l, r]| [l, r.turned(0.5)]);
            sequence.finds("left turned", reason, HealthLevel::Degraded, |_, [l, r]| [l.turned(-0.5), r]);
        }
    }
}

#[test]
fn covered_lenses_are_found_within_two_frames() {
    for sequence in Sequence::moving().chain(Sequence::read("euroc-room")) {
        let (reason, blind) = (HealthReason::Blocked, HealthLevel::Blind);
        let (width, height) = (sequence.pairs[0][0].width, sequence.pairs[0][0].height);
        let grey =
            |frame, level: u8| Grey { width, height, pixels: vec![level; width * height] }.exposed(frame, |grey| grey);
        sequence.finds("hand over the left", reason, HealthLevel::Degraded, |i, [l, r]| [l.covered(0.6, i), r]);
        sequence.finds("hand over the right", reason, HealthLevel::Degraded, |i, [l, r]| [l, r.covered(0.6, i)]);
        sequence.finds("left covered", reason, blind, |i, [l, r]| [l.covered(1.2, i), r]);
        sequence.finds("right covered", reason, blind, |i, [l, r]| [l, r.covered(1.2, i)]);
        sequence.finds("left grey", reason, blind, |i, [_, r]| [grey(i, 110), r]);
        sequence.finds("right black", reason, blind, |i, [l, _]| [l, grey(i, 0)]);
        sequence.finds("both grey", reason, blind, |i, _| [grey(i, 110), grey(i + 100, 115)]);
    }
}

#[test]
fn bad_exposure_is_found_and_nothing_is_free() {
    for sequence in Sequence::moving() {
        let dark = |i: usize, p: Grey| p.exposed(i, |grey| grey / 40.0);
        let bright = |i: usize, p: Grey| p.exposed(i, |grey| 30.0 + 12.0 * grey);
        let (under, over, blind) = (HealthReason::Underexposed, HealthReason::Overexposed, HealthLevel::Blind);
        sequence.finds("both dark", under, blind, |i, [l, r]| [dark(i, l), dark(i + 50, r)]);
        sequence.finds("right dark", under, blind, |i, [l, r]| [l, dark(i, r)]);
        sequence.finds("both bright", over, blind, |i, [l, r]| [bright(i, l), bright(i + 50, r)]);
        sequence.finds("left bright", over, blind, |i, [l, r]| [bright(i, l), r]);
        sequence.finds("unequal", HealthReason::ExposureMismatch, HealthLevel::Degraded, |i, [l, r]| {
            [l, r.exposed(i, |grey| grey / 3.0)]
        });
    }
}

#[test]
fn frozen_pictures_are_found_at_once_and_forgiven() {
    for sequence in Sequence::moving().chain(Sequence::read("euroc-room")) {
        for (sides, is_forgiven) in [([true, false], false), ([false, true], true), ([true, true], false)] {
            let frozen = 2..4;
            let seen = sequence.run(if is_forgiven { 10 } else { frozen.end }, |frame| {
                let mut pair = sequence.pair(frame);
                for side in (0..2).filter(|side| sides[*side] && frozen.contains(&frame)) {
                    pair[side] = sequence.pairs[frozen.start - 1][side].clone();
                }
                pair
            });
            let name = &sequence.name;
            let has = |frame: usize| seen[frame].health.has(HealthReason::FrozenPicture);
            say!("{name}, {} frames, frozen {sides:?}: {}", seen.len(), seen[2]);
            assert!(!has(0) && !has(1) && has(2) && has(3), "{name}, {sides:?}: {}", seen[2]);
            assert!(seen[2..4].iter().all(|seen| seen.free == 0), "{name}, {sides:?}: free cells");
            assert!(seen[0].free > 0, "{name}, {sides:?}: {}", seen[0]);
            if is_forgiven {
                assert!(!has(9) && seen[9].free > 0, "{name}, {sides:?}: {}", seen[9]);
            }
        }
    }
}

#[test]
fn something_nearer_than_the_disparity_range_is_said_to_block_the_view() {
    for sequence in Sequence::moving() {
        let width = sequence.pairs[0][0].width;
        let disparities = usize::from(Config::default().settings_for(width as u32).matching.disparities);
        // The upper half of the picture once more, upside down, so near that it is shifted by more than is searched.
        for part in [12, 18] {
            let shift = disparities * part / 10;
            let near = |picture: &Grey, moved: usize| {
                picture.remade(|x, y| {
                    let mirrored = picture.height - 1 - y;
                    let source = if 2 * y < picture.height { (x, y) } else { ((x + moved) % picture.width, mirrored) };
                    f32::from(picture.pixels[source.1 * picture.width + source.0])
                })
            };
            let what = format!("something at {part}0 % of the range");
            sequence.finds(&what, HealthReason::NearZoneBlocked, HealthLevel::Degraded, |_, [l, r]| {
                // Both see the same thing there.
                let mut there = near(&l, shift);
                let half = there.height / 2 * there.width;
                there.pixels[..half].copy_from_slice(&r.pixels[..half]);
                [near(&l, 0), there]
            });
        }
    }
}
