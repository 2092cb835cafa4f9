//! Disparity pictures straight into everything behind the matcher, with every method, frame by frame.

use std::cell::RefCell;

use fencepost_core::{disparity::DisparityPixel, geometry::StereoCalibration};

use crate::{
    Source,
    camera::{Camera, Two, draw},
    detection::{assert_same, check},
};

struct Detectors {
    two: Two,
    pixels: Vec<DisparityPixel>,
}

thread_local! {
    static DETECTORS: RefCell<Box<Detectors>> =
        RefCell::new(Box::new(Detectors { two: Two::new(), pixels: Vec::new() }));
}

pub(crate) fn run(bytes: &[u8]) {
    DETECTORS.with_borrow_mut(|detectors| detectors.check(&mut Source::new(bytes)));
}

impl Detectors {
    fn check(&mut self, source: &mut Source<'_>) {
        let Self { two, pixels } = self;
        two.choose(source);
        let Two { first, second, .. } = two;
        let frames = 1 + source.below(3);
        let twice = source.below(4) == 0;
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
        let mut same_alone = frames > 1 && camera.settings.ground.hold_frames == 0;
        for frame in 0..frames {
            draw(source, &camera, pixels);
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
            same_alone &= frame + 1 < frames || source.below(4) == 0;
        }
        // Where nothing is held, no frame has a say in the next.
        if same_alone {
            assert_eq!(second.configure(&camera.settings, &calibration, &camera.mount), Ok(()));
            assert!(second.interpret(pixels, &mut ()).is_ok());
            assert_same(first, second, "the last frame alone");
        }
    }
}
