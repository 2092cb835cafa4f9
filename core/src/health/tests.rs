//! Each reason is said when its cause is there, and not otherwise.

mod judge;

use std::{boxed::Box, vec::Vec};

use super::*;
use crate::{
    detector::Detector,
    geometry::{Mount, RectifiedPair, StereoCalibration},
    matching::MatchSettings,
    picture::Picture,
    settings::Settings,
    test_random::Random,
};

const WIDTH: usize = 160;
const HEIGHT: usize = 96;

type Small = Detector<{ WIDTH * HEIGHT }, WIDTH, 32, 500, 64, 8, 2500>;

fn detector() -> Box<Small> {
    let pair = RectifiedPair {
        width: WIDTH as u32,
        height: HEIGHT as u32,
        focal_px: 120.0,
        cx: 79.5,
        cy: 47.5,
        baseline_m: 0.15,
        disparity_offset_px: 0.0,
    };
    let settings =
        Settings { matching: MatchSettings { disparities: 32, ..MatchSettings::DEFAULT }, ..Settings::default() };
    let mut detector = Box::new(Small::new());
    detector.configure(&settings, &StereoCalibration::Rectified(pair), &Mount::default()).unwrap();
    detector
}

/// A random texture on a wall across the optical axis, seen by both cameras `shift` pixels apart.
fn wall(shift: usize, change: impl Fn(u8) -> u8) -> (Vec<u8>, Vec<u8>) {
    let mut random = Random::seeded("wall", 0x5eed_0070);
    let texture: Vec<Vec<u8>> =
        (0..HEIGHT).map(|_| (0..WIDTH + 64).map(|_| 40 + random.below(160) as u8).collect()).collect();
    let see =
        |from: usize| texture.iter().flat_map(|row| row[from..from + WIDTH].iter().map(|&grey| change(grey))).collect();
    (see(0), see(shift))
}

fn health((left, right): &(Vec<u8>, Vec<u8>)) -> Health {
    let view = |picture| Picture::packed(picture, WIDTH, HEIGHT).unwrap();
    detector().detect(&view(left), &view(right), &mut ()).unwrap().health
}

#[test]
fn a_wall_has_no_ground_and_nothing_else_to_say() {
    let health = health(&wall(10, |grey| grey));
    assert_eq!(health, { Health { level: HealthLevel::Degraded, reasons: 1 << HealthReason::NoGround as u8 } });
}

#[test]
fn exchanged_pictures_are_noticed() {
    let (left, right) = wall(10, |grey| grey);
    let health = health(&(right, left));
    assert!(health.has(HealthReason::Exchanged) && health.level == HealthLevel::Fault, "{health:?}");
}

#[test]
fn pictures_of_two_places_are_not_taken_for_exchanged_ones() {
    let mut random = Random::seeded("two places", 0x5eed_0071);
    let mut noise = || (0..WIDTH * HEIGHT).map(|_| random.next() as u8).collect::<Vec<u8>>();
    let health = health(&(noise(), noise()));
    assert!(!health.has(HealthReason::Exchanged) && health.has(HealthReason::LowCoverage), "{health:?}");
}

#[test]
fn dark_bright_and_unequal_pictures_are_noticed() {
    let dark = health(&wall(10, |grey| grey / 40));
    assert!(dark.has(HealthReason::Underexposed) && !dark.has(HealthReason::Overexposed), "{dark:?}");
    let bright = health(&wall(10, |grey| grey.saturating_mul(3)));
    assert!(bright.has(HealthReason::Overexposed) && !bright.has(HealthReason::Underexposed), "{bright:?}");
    let (left, right) = wall(10, |grey| grey);
    let unequal = health(&(left, right.iter().map(|grey| grey / 3).collect()));
    assert!(unequal.has(HealthReason::ExposureMismatch), "{unequal:?}");
}

#[test]
fn without_texture_the_detector_is_blind() {
    let health = health(&wall(10, |_| 100));
    assert!(health.level == HealthLevel::Blind && health.has(HealthReason::LowCoverage), "{health:?}");
}

#[test]
fn what_is_too_near_is_said_to_block_the_view() {
    // The largest disparity is searched, but a match there may be that of something nearer.
    let near = health(&wall(31, |grey| grey));
    assert!(near.has(HealthReason::NearZoneBlocked), "{near:?}");
    assert!(!health(&wall(28, |grey| grey)).has(HealthReason::NearZoneBlocked));
}

#[test]
fn a_frozen_picture_frees_nothing_and_is_forgiven() {
    let mut random = Random::seeded("sensor noise", 0x5eed_0072);
    let wall = wall(10, |grey| grey);
    let mut noisy = |picture: &[u8]| -> Vec<u8> { picture.iter().map(|grey| grey + random.below(3) as u8).collect() };
    let mut detector = detector();
    let mut look = |left: &[u8], right: &[u8]| {
        let view = |picture| Picture::packed(picture, WIDTH, HEIGHT).unwrap();
        let detection = detector.detect(&view(left), &view(right), &mut ()).unwrap();
        (detection.health.has(HealthReason::FrozenPicture), detection.health.level)
    };
    let first = noisy(&wall.0);
    assert!(!look(&first, &noisy(&wall.1)).0);
    // The same thing before the camera is not the same picture.
    assert!(!look(&noisy(&wall.0), &noisy(&wall.1)).0);
    let last = noisy(&wall.0);
    assert!(!look(&last, &noisy(&wall.1)).0);
    assert_eq!(look(&last, &noisy(&wall.1)), (true, HealthLevel::Blind));
    let told = (0..6).map(|_| look(&noisy(&wall.0), &noisy(&wall.1)).0).collect::<Vec<_>>();
    assert_eq!(told, [true, true, true, true, false, false], "five frames without it");
}

#[test]
fn a_ring_of_old_pictures_is_frozen_and_a_short_recording_is_not() {
    let (left, right) = wall(10, |grey| grey);
    for (ring, sides, is_frozen) in
        [(2, [true; 2], true), (3, [true, false], true), (3, [false, true], true), (4, [true; 2], false)]
    {
        let mut random = Random::seeded("sensor noise", 0x5eed_0073);
        let mut noisy =
            |picture: &[u8]| -> Vec<u8> { picture.iter().map(|grey| grey + random.below(3) as u8).collect() };
        let mut detector = detector();
        let pictures: Vec<_> = (0..12).map(|_| [noisy(&left), noisy(&right)]).collect();
        // The first frames are new; from then on the newest of them come in turn.
        for frame in 0..12 {
            let shown = |side: usize| if sides[side] && frame >= 4 { 4 - ring + frame % ring } else { frame };
            let view = |side: usize| Picture::packed(&pictures[shown(side)][side], WIDTH, HEIGHT).unwrap();
            let health = detector.detect(&view(0), &view(1), &mut ()).unwrap().health;
            let expected = is_frozen && frame >= 4;
            assert_eq!(health.has(HealthReason::FrozenPicture), expected, "ring of {ring}, {sides:?}, frame {frame}");
        }
    }
}

#[test]
fn settings_that_cannot_be_are_named() {
    let good = HealthSettings::default();
    assert_eq!(good.check(), Ok(()));
    let field = |settings: HealthSettings| settings.check().unwrap_err().field;
    assert_eq!(field(HealthSettings { dark_blind_percent: f32::NAN, ..good }), "health.dark_blind_percent");
    assert_eq!(field(HealthSettings { bright_blind_percent: 102.0, ..good }), "health.bright_blind_percent");
    assert_eq!(field(HealthSettings { structure_grey: 0.0, ..good }), "health.structure_grey");
    assert_eq!(field(HealthSettings { covered_percent: 0.0, ..good }), "health.covered_percent");
    assert_eq!(field(HealthSettings { covered_blind_percent: 0.0, ..good }), "health.covered_blind_percent");
    assert_eq!(field(HealthSettings { flat_percent: -1.0, ..good }), "health.flat_percent");
    assert_eq!(field(HealthSettings { flat_excess_percent: 0.0, ..good }), "health.flat_excess_percent");
    assert_eq!(field(HealthSettings { pairing_sigmas: 0.5, ..good }), "health.pairing_sigmas");
    assert_eq!(field(HealthSettings { pairing_likeness: 1.5, ..good }), "health.pairing_likeness");
    assert_eq!(field(HealthSettings { row_error_px: 0.0, ..good }), "health.row_error_px");
    assert_eq!(field(HealthSettings { row_error_blind_px: f32::INFINITY, ..good }), "health.row_error_blind_px");
    assert_eq!(field(HealthSettings { trigger_frames: 3, ..good }), "health.trigger_frames");
    assert_eq!(field(HealthSettings { release_frames: 0, ..good }), "health.release_frames");
}

#[test]
fn every_reason_has_a_bit_and_a_name_of_its_own() {
    for (bit, reason) in HealthReason::ALL.iter().enumerate() {
        assert_eq!(*reason as usize, bit);
        let same = HealthReason::ALL.iter().filter(|other| other.name() == reason.name()).count();
        assert_eq!(same, 1, "{}", reason.name());
    }
    let mut health = Health::OK;
    health.raise(HealthReason::Late, HealthLevel::Blind);
    health.raise(HealthReason::NoGround, HealthLevel::Degraded);
    assert_eq!(health.level, HealthLevel::Blind, "the worse level stays");
}
