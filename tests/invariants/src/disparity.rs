//! Disparity pictures straight into everything behind the matcher, with every method, frame by frame.

use std::cell::RefCell;

use fencepost_core::{
    detector::DetectError,
    disparity::DisparityPixel,
    geometry::StereoCalibration,
    health::{Health, HealthLevel},
    map::{CellState, Merged},
};

use crate::{
    Source,
    camera::{Camera, Two, draw, frames},
    detection::{Found, assert_same, check},
};

struct Detectors {
    two: Two,
    pixels: Vec<DisparityPixel>,
}

thread_local! {
    static DETECTORS: RefCell<Box<Detectors>> =
        RefCell::new(Box::new(Detectors { two: Two::new(), pixels: Vec::new() }));
}

/// Runs one input.
pub fn run(bytes: &[u8]) {
    DETECTORS.with_borrow_mut(|detectors| detectors.check(&mut Source::new(bytes)));
}

impl Detectors {
    fn check(&mut self, source: &mut Source<'_>) {
        let Self { two, pixels } = self;
        let twice = source.seldom(16);
        two.choose(source, twice);
        let Two { first, second, .. } = two;
        let frames = frames(source);
        let camera = Camera::read(source);
        let calibration = StereoCalibration::Rectified(camera.pair);
        let configured = first.configure(&camera.settings, &calibration, &camera.mount);
        if configured.is_err() {
            assert!(first.interpret(&[], &mut ()).is_err(), "a detector that is not configured");
            return;
        }
        if twice {
            assert_eq!(second.configure(&camera.settings, &calibration, &camera.mount), configured);
        }
        let mut before: Option<Found> = None;
        let mut same_alone = frames > 1 && camera.settings.ground.hold_frames == 0;
        for frame in 0..frames {
            draw(source, &camera, pixels);
            if twice {
                let wrong = first.interpret(&pixels[1..], &mut ()).err();
                assert!(matches!(wrong, Some(DetectError::WrongSize { .. })), "a pixel too few: {wrong:?}");
            }
            assert!(first.interpret(pixels, &mut ()).is_ok(), "a picture of the right size");
            check(first, &camera, false);
            // What is known of a pixel stays, or the pixel is part of a small surface.
            for (before, after) in pixels.iter().zip(first.disparity().pixels()) {
                assert!(before == after || (before.has_value() && !after.has_value()), "{before:?} became {after:?}");
            }
            if twice {
                assert!(second.interpret(pixels, &mut ()).is_ok());
                assert_same(first, second, "the same frames once more");
            }
            if let Some(before) = before.take() {
                check_merged([&before, first.detection()], source.byte());
            } else if frame + 1 < frames && source.below(8) == 7 {
                before = Some(first.detection().clone());
            }
            same_alone &= frame + 1 < frames || source.below(8) == 0;
        }
        // Where nothing is held, no frame has a say in the next.
        if same_alone {
            assert_eq!(second.configure(&camera.settings, &calibration, &camera.mount), Ok(()));
            assert!(second.interpret(pixels, &mut ()).is_ok());
            assert_same(first, second, "the last frame alone");
        }
    }
}

/// Two maps as one, as if they were those of two pairs: an obstacle for one is one, and free is what one that can be trusted calls
/// free and the other does not dispute.
fn check_merged(pairs: [&Found; 2], levels: u8) {
    const LEVELS: [HealthLevel; 4] = [HealthLevel::Ok, HealthLevel::Degraded, HealthLevel::Blind, HealthLevel::Fault];
    let levels = [levels, levels / 4].map(|level| LEVELS[usize::from(level % 4)]);
    let mut merged = Merged::new();
    for (found, level) in pairs.into_iter().zip(levels) {
        let health = Health { level, reasons: 0 };
        assert_eq!(merged.add_parts(&found.map, found.ground.as_ref(), health), Ok(()));
    }
    for (index, cell) in merged.map().cells.iter().enumerate() {
        let states = pairs.map(|pair| pair.map.cells[index].state);
        let is_obstacle = states.contains(&CellState::Obstacle);
        assert_eq!(cell.state == CellState::Obstacle, is_obstacle, "{states:?} became {cell:?}");
        let freed =
            states.iter().zip(levels).any(|(state, level)| *state == CellState::Free && level < HealthLevel::Blind);
        assert!(cell.state != CellState::Free || freed, "{states:?} became {cell:?} with {levels:?}");
    }
    let mut other = pairs[1].map.clone();
    other.geometry.x_first = other.geometry.x_first.wrapping_add(1);
    let known = merged.map().cells.clone();
    assert!(merged.add_parts(&other, None, Health::OK).is_err(), "cells that lie elsewhere");
    assert_eq!(merged.map().cells, known, "what is refused changes nothing");
}
