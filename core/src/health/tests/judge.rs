//! Each finding by itself: at its limit it is there, just before it is not.

use std::vec;

use super::*;
use crate::disparity::DisparityPixel;

/// What a good frame gives to judge by, and the limits.
struct Frame {
    exposures: [Exposure; 2],
    came_again: [bool; 2],
    content: ContentSigns,
    pixels: Vec<DisparityPixel>,
    statistics: Statistics,
    ground: Option<GroundPlane>,
    exchanged: bool,
    settings: HealthSettings,
}

/// Pixels of the lower half of the picture.
const LOWER: usize = 100;

fn good() -> Frame {
    let exposure = Exposure { mean: 100.0, ..Exposure::default() };
    let statistics = Statistics { pixels_with_disparity: 100, ..Statistics::default() };
    let frame = crate::test_world::World::level(1.2, 12.0, 0.0).frame();
    Frame {
        exposures: [exposure; 2],
        came_again: [false; 2],
        content: ContentSigns::UNSET,
        pixels: vec![DisparityPixel::from_steps(100); 2 * LOWER],
        statistics,
        ground: Some(GroundPlane::of_mount(&frame)),
        exchanged: false,
        settings: HealthSettings {
            dark_percent: 30.0,
            dark_blind_percent: 60.0,
            bright_percent: 20.0,
            bright_blind_percent: 50.0,
            exposure_ratio: 2.0,
            low_coverage_percent: 20.0,
            blind_coverage_percent: 10.0,
            near_zone_percent: 25.0,
            covered_percent: 10.0,
            covered_blind_percent: 40.0,
            flat_percent: 80.0,
            flat_excess_percent: 30.0,
            pairing_sigmas: 4.0,
            pairing_likeness: 0.5,
            row_error_px: 0.75,
            row_error_blind_px: 1.5,
            ..HealthSettings::default()
        },
    }
}

/// What is found in a frame that is good but for a change.
#[track_caller]
fn found(change: impl FnOnce(&mut Frame), expected: &[(HealthReason, HealthLevel)]) {
    let mut frame = good();
    change(&mut frame);
    let signs = Signs {
        exposures: frame.exposures,
        came_again: frame.came_again,
        content: frame.content,
        picture: DisparityPicture::new(&frame.pixels, 10),
        statistics: &frame.statistics,
        ground: frame.ground.as_ref(),
        exchanged: frame.exchanged,
    };
    let findings = judge(&signs, &frame.settings);
    for reason in HealthReason::ALL {
        let level =
            expected.iter().find(|(expected, _)| *expected == reason).map_or(HealthLevel::Ok, |(_, level)| *level);
        assert_eq!(findings.level(reason), level, "{reason:?}");
    }
}

const NOTHING: &[(HealthReason, HealthLevel)] = &[];

#[test]
fn a_good_frame_has_nothing_to_say() {
    found(|_| {}, NOTHING);
}

#[test]
fn exposure_is_judged_picture_by_picture() {
    use HealthLevel::{Blind, Degraded};
    use HealthReason::{ExposureMismatch, FrozenPicture, Overexposed, Underexposed};
    for side in 0..2 {
        for (percent, level) in [(29.9, None), (30.0, Some(Degraded)), (59.9, Some(Degraded)), (60.0, Some(Blind))] {
            let expected: Vec<_> = level.map(|level| (Underexposed, level)).into_iter().collect();
            found(|frame| frame.exposures[side].dark_percent = percent, &expected);
        }
        for (percent, level) in [(19.9, None), (20.0, Some(Degraded)), (49.9, Some(Degraded)), (50.0, Some(Blind))] {
            let expected: Vec<_> = level.map(|level| (Overexposed, level)).into_iter().collect();
            found(|frame| frame.exposures[side].bright_percent = percent, &expected);
        }
        found(|frame| frame.exposures[side].mean = 200.0, NOTHING);
        found(|frame| frame.exposures[side].mean = 201.0, &[(ExposureMismatch, Degraded)]);
        found(|frame| frame.exposures[side].mean = 50.0, NOTHING);
        found(|frame| frame.exposures[side].mean = 49.0, &[(ExposureMismatch, Degraded)]);
        found(|frame| frame.came_again[side] = true, &[(FrozenPicture, Blind)]);
    }
    // Where both are nearly black, a grey value more or less is no difference.
    found(|frame| [frame.exposures[0].mean, frame.exposures[1].mean] = [0.0, 2.0], NOTHING);
    found(|frame| [frame.exposures[0].mean, frame.exposures[1].mean] = [0.0, 2.1], &[(ExposureMismatch, Degraded)]);
}

#[test]
fn coverage_ground_and_full_tables_are_judged() {
    use HealthLevel::{Blind, Degraded, Fault};
    use HealthReason::{Exchanged, GroundHeld, LowCoverage, NoGround, TableFull};
    let covered = |percent: u32| {
        move |frame: &mut Frame| {
            frame.statistics.pixels_with_disparity = percent;
            frame.statistics.pixels_without[0] = 100 - percent;
        }
    };
    found(covered(20), NOTHING);
    found(covered(19), &[(LowCoverage, Degraded)]);
    found(covered(10), &[(LowCoverage, Degraded)]);
    found(covered(9), &[(LowCoverage, Blind)]);
    found(|frame| frame.ground = None, &[(NoGround, Degraded)]);
    found(|frame| frame.ground.as_mut().unwrap().age_frames = 1, &[(GroundHeld, Degraded)]);
    found(|frame| frame.statistics.surfaces_dropped = 1, &[(TableFull, Degraded)]);
    found(|frame| frame.statistics.obstacles_dropped = 1, &[(TableFull, Degraded)]);
    found(|frame| frame.exchanged = true, &[(Exchanged, Fault)]);
}

#[test]
fn the_near_zone_is_blocked_by_either_sign() {
    let blocked = &[(HealthReason::NearZoneBlocked, HealthLevel::Degraded)];
    found(|frame| frame.content.rows.near_percent = 24.9, NOTHING);
    found(|frame| frame.content.rows.near_percent = 25.0, blocked);
    // A pixel that says so, and one that was never written.
    for pixel in [DisparityPixel::none(Reason::OutOfRange), DisparityPixel::from_bits(0)] {
        found(|frame| frame.pixels[LOWER..LOWER + 24].fill(pixel), NOTHING);
        found(|frame| frame.pixels[LOWER..LOWER + 25].fill(pixel), blocked);
        found(|frame| frame.pixels[..LOWER].fill(pixel), NOTHING);
    }
    found(|frame| frame.pixels[LOWER..].fill(DisparityPixel::none(Reason::LowTexture)), NOTHING);
}

#[test]
fn covered_lenses_are_told_from_flat_pictures() {
    use HealthLevel::{Blind, Degraded};
    use HealthReason::Blocked;
    for side in 0..2 {
        let flat = |percent: f32, other: f32| {
            move |frame: &mut Frame| {
                frame.content.coverings[side].flat_percent = percent;
                frame.content.coverings[1 - side].flat_percent = other;
            }
        };
        found(flat(79.9, 79.9), NOTHING);
        found(flat(80.0, 70.0), &[(Blocked, Blind)]);
        found(flat(29.9, 0.0), NOTHING);
        found(flat(30.0, 0.0), &[(Blocked, Degraded)]);
        found(flat(75.0, 45.0), &[(Blocked, Degraded)]);
        found(flat(75.0, 46.0), NOTHING);
        let covered = |covered: u16, judged: u16| {
            move |frame: &mut Frame| {
                frame.content.coverings[side] = Covering { covered, judged, flat_percent: 0.0 };
            }
        };
        found(covered(3, 30), &[(Blocked, Degraded)]);
        found(covered(3, 31), NOTHING);
        found(covered(2, 2), NOTHING);
        found(covered(39, 100), &[(Blocked, Degraded)]);
        found(covered(40, 100), &[(Blocked, Blind)]);
    }
}

#[test]
fn pictures_of_different_moments_are_told_if_they_show_enough() {
    use HealthLevel::{Blind, Degraded};
    use HealthReason::{BadlyPaired, BadlyRectified, Blocked, Overexposed, Underexposed};
    let pairing = |advantage_sigmas: f32, likeness: f32| {
        move |frame: &mut Frame| frame.content.pairing = PairingSign { advantage_sigmas, likeness, lag_frames: 1 }
    };
    found(pairing(4.0, 0.5), &[(BadlyPaired, Blind)]);
    found(pairing(3.9, 0.5), NOTHING);
    found(pairing(4.0, 0.49), NOTHING);
    // What shows little says nothing of its moment.
    let and = |change: fn(&mut Frame)| {
        move |frame: &mut Frame| {
            pairing(4.0, 0.5)(frame);
            change(frame);
        }
    };
    found(and(|frame| frame.exposures[0].dark_percent = 60.0), &[(Underexposed, Blind)]);
    found(and(|frame| frame.exposures[1].bright_percent = 50.0), &[(Overexposed, Blind)]);
    found(and(|frame| frame.exposures[0].dark_percent = 30.0), &[(Underexposed, Degraded), (BadlyPaired, Blind)]);
    found(and(|frame| frame.content.coverings[0].flat_percent = 30.0), &[(Blocked, Degraded)]);
    found(
        and(|frame| frame.content.coverings = [Covering { flat_percent: 80.0, ..Covering::default() }; 2]),
        &[(Blocked, Blind)],
    );
    for (error_px, level) in [(0.74, None), (0.75, Some(Degraded)), (1.49, Some(Degraded)), (1.5, Some(Blind))] {
        let expected: Vec<_> = level.map(|level| (BadlyRectified, level)).into_iter().collect();
        found(|frame| frame.content.rows.error_px = error_px, &expected);
    }
}

#[test]
fn rows_out_of_line_are_explained_by_bad_pairing_and_by_nothing_else() {
    let bits = |reasons: &[HealthReason]| reasons.iter().fold(0, |bits, reason| bits | 1 << *reason as u8);
    for other in HealthReason::ALL {
        let rows = HealthReason::BadlyRectified;
        let told = Health { level: HealthLevel::Blind, reasons: bits(&[rows, other]) };
        let expected = if other == HealthReason::BadlyPaired { bits(&[other]) } else { told.reasons };
        assert_eq!(explained(told), Health { reasons: expected, ..told }, "{other:?}");
        let alone = Health { level: HealthLevel::Degraded, reasons: bits(&[other]) };
        assert_eq!(explained(alone), alone);
        // A reason of both is one of the two together.
        assert_eq!(told.and(alone), told);
        assert_eq!(alone.and(Health::OK), alone);
    }
}
