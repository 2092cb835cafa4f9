//! Pairs of pictures into the whole detector, frame by frame: garbage, then a good frame, and the other way round.

use std::cell::RefCell;

use fencepost_core::{
    bands::OneThread,
    detector::DetectError,
    geometry::StereoCalibration,
    health::{Health, HealthLevel},
    picture::Picture,
};

use crate::{
    Source,
    camera::{Camera, Piece, Small, Two, frames},
    detection::{assert_found_same, assert_same, check},
    matchers,
};

struct Detectors {
    two: Two,
    bands: [Piece; 7],
    pictures: [Vec<u8>; 2],
}

thread_local! {
    static DETECTORS: RefCell<Box<Detectors>> =
        RefCell::new(Box::new(Detectors {
            two: Two::new(),
            bands: [const { Piece::new() }; 7],
            pictures: Default::default(),
        }));
}

/// Runs one input.
pub fn run(bytes: &[u8]) {
    match bytes.split_first() {
        // The matcher alone, now and then: its search range is larger, and takes longer.
        Some((248.., rest)) if Source::new(bytes).seldom(4) => matchers::check(&mut Source::new(rest)),
        _ => DETECTORS.with_borrow_mut(|detectors| detectors.check(&mut Source::new(bytes))),
    }
}

impl Detectors {
    fn check(&mut self, source: &mut Source<'_>) {
        let Self { two, bands, pictures } = self;
        let twice = source.seldom(16);
        two.choose(source, twice);
        let Two { first, second, .. } = two;
        let frames = frames(source);
        // How many bands the second detector cuts its pictures into, besides the first.
        let cuts = if twice { source.one_of(&[0, 1, 2, 1, 2, 7]) } else { 0 };
        let alone = source.seldom(16);
        let camera = Camera::read(source);
        let size = (camera.pair.width as usize, camera.pair.height as usize);
        let calibration = StereoCalibration::Rectified(camera.pair);
        if first.configure(&camera.settings, &calibration, &camera.mount).is_err() {
            let grey = vec![0; size.0 * size.1];
            let Ok(picture) = Picture::packed(&grey, size.0, size.1) else { return };
            assert_eq!(first.detect(&picture, &picture, &mut ()).err(), Some(DetectError::NotConfigured));
            return;
        }
        if twice {
            assert_eq!(second.configure(&camera.settings, &calibration, &camera.mount), Ok(()));
        }
        // What other inputs have drawn is none of this one's.
        pictures.iter_mut().for_each(Vec::clear);
        for _ in 0..frames {
            draw(source, size, pictures);
            let Some([left, right]) = views(pictures, size) else { return };
            let forget = source.below(16) == 15;
            let told = first.detection().health;
            if forget {
                first.forget();
                assert!(first.detection().map.cells.is_empty() && first.detection().ground.is_none());
            }
            if forget {
                check_wrong_sizes(first, &left, pictures, size);
            }
            assert!(first.detect(&left, &right, &mut ()).is_ok(), "pictures of the right size");
            check(first, &camera, true);
            if twice {
                if forget {
                    second.forget();
                }
                let found = match &mut bands[..cuts] {
                    [] => second.detect(&left, &right, &mut ()),
                    bands => second.detect_in_bands(&left, &right, bands, &mut OneThread, &mut ()),
                };
                assert!(found.is_ok());
                assert_same(first, second, "the same frames once more, in bands or as a whole");
            } else if forget {
                Self::check_forgotten(first, second, &camera, [&left, &right], told);
            }
        }
        if alone && !twice && camera.settings.ground.hold_frames == 0 {
            let Some([left, right]) = views(pictures, size) else { return };
            assert_eq!(second.configure(&camera.settings, &calibration, &camera.mount), Ok(()));
            assert!(second.detect(&left, &right, &mut ()).is_ok());
            assert_found_same(first, second, "the last frame alone");
        }
    }

    /// After forgetting, the next frame is found to be what it is for a new detector; what was told before goes on being told.
    fn check_forgotten(
        first: &Small,
        fresh: &mut Small,
        camera: &Camera,
        [left, right]: [&Picture<'_>; 2],
        told: Health,
    ) {
        let calibration = StereoCalibration::Rectified(camera.pair);
        assert_eq!(fresh.configure(&camera.settings, &calibration, &camera.mount), Ok(()));
        assert!(fresh.detect(left, right, &mut ()).is_ok());
        assert_found_same(first, fresh, "after forgetting");
        assert_eq!(first.content(), fresh.content(), "after forgetting: signs of the pictures");
        let (now, alone) = (first.detection().health, fresh.detection().health);
        if told.level == HealthLevel::Ok {
            assert_eq!(now, alone, "after forgetting: health");
        }
    }
}

/// Pictures that are not as large as it was said are refused, on either side, and whatever cannot be a picture is none.
fn check_wrong_sizes(
    detector: &mut Small,
    good: &Picture<'_>,
    pictures: &[Vec<u8>; 2],
    (width, height): (usize, usize),
) {
    let bytes = &pictures[1];
    let Ok(short) = Picture::new(bytes, width, height - 1, width + GAP) else { panic!("a row less") };
    let wrong = DetectError::WrongSize { found: (width, height - 1), expected: (width, height) };
    assert_eq!(detector.detect(&short, good, &mut ()).err(), Some(wrong));
    assert_eq!(detector.detect(good, &short, &mut ()).err(), Some(wrong));
    assert!(detector.detection().map.cells.is_empty(), "cells of pictures that were refused");
    assert!(Picture::new(bytes, 0, height, width).is_err() && Picture::new(bytes, width, 0, width).is_err());
    assert!(Picture::new(bytes, width, height, width - 1).is_err(), "rows that lie in each other");
    assert!(Picture::new(bytes, width, height + 2, width + GAP).is_err(), "more rows than there are");
}

/// Rows lie farther apart than they are long.
pub(crate) const GAP: usize = 3;

fn views(pictures: &[Vec<u8>; 2], (width, height): (usize, usize)) -> Option<[Picture<'_>; 2]> {
    let view = |bytes| Picture::new(bytes, width, height, width + GAP).ok();
    Some([view(&pictures[0])?, view(&pictures[1])?])
}

/// A pair of pictures, stroke by stroke over what the frame before had.
pub(crate) fn draw(source: &mut Source<'_>, (width, height): (usize, usize), pictures: &mut [Vec<u8>; 2]) {
    let stride = width + GAP;
    for picture in pictures.iter_mut() {
        picture.resize(stride * height, 0);
    }
    for _ in 0..1 + source.below(5) {
        let kind = source.below(10);
        let (left, top) = (source.below(width), source.below(height));
        let (columns, rows) = (1 + source.below(width - left), 1 + source.below(height - top));
        let whole = source.below(4) > 0;
        let (left, top, columns, rows) = if whole { (0, 0, width, height) } else { (left, top, columns, rows) };
        let (disparity, slope) = (source.below(14), source.byte() as i8);
        let (mut noise, grain) = (u32::from(source.word()) | 1, 1 + source.below(4));
        let mut next = || {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (noise >> 24) as u8
        };
        for y in top..top + rows {
            let shift =
                (disparity as i32 + i32::from(slope) * (y - top) as i32 / 64).clamp(0, width as i32 - 1) as usize;
            for x in left..left + columns {
                let place = y * stride + x;
                let value = match kind {
                    // A texture, and the same moved by a disparity that changes from row to row.
                    0..=4 => {
                        if (x - left) % grain == 0 {
                            next()
                        } else {
                            pictures[0][place - 1]
                        }
                    }
                    5 => slope as u8,
                    6 => {
                        if (x / (1 + disparity)).is_multiple_of(2) {
                            255
                        } else {
                            0
                        }
                    }
                    7 => {
                        if (y / (1 + disparity)).is_multiple_of(2) {
                            250
                        } else {
                            5
                        }
                    }
                    8 => pictures[1][place],
                    _ => {
                        pictures[1][place] = next();
                        pictures[0][place]
                    }
                };
                pictures[0][place] = value;
                if kind <= 7 {
                    let moved = x.saturating_sub(shift);
                    pictures[1][y * stride + moved] = value;
                }
            }
        }
        if kind == 9 && disparity == 13 {
            let bytes = source.bytes(width * height);
            pictures[0].iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        }
    }
}
