//! The stage against a plain flood fill.

use std::{boxed::Box, vec, vec::Vec};

use super::*;
use crate::test_random::Random;

/// Flood fill over the whole picture with a list of pixels to visit.
fn plain(picture: &mut [DisparityPixel], width: usize, settings: &ValidateSettings) {
    let mut seen = vec![false; picture.len()];
    let before = picture.to_vec();
    for start in 0..picture.len() {
        if seen[start] || !before[start].has_value() {
            continue;
        }
        seen[start] = true;
        let mut surface = vec![start];
        let mut next = 0;
        while next < surface.len() {
            let at = surface[next];
            next += 1;
            let (x, y) = (at % width, at / width);
            let mut neighbours = Vec::new();
            if x > 0 {
                neighbours.push(at - 1);
            }
            if x + 1 < width {
                neighbours.push(at + 1);
            }
            if y > 0 {
                neighbours.push(at - width);
            }
            if at + width < picture.len() {
                neighbours.push(at + width);
            }
            for n in neighbours {
                let joined = before[n].steps().abs_diff(before[at].steps()) <= settings.step_sixteenths;
                if !seen[n] && before[n].has_value() && joined {
                    seen[n] = true;
                    surface.push(n);
                }
            }
        }
        if surface.len() < usize::from(settings.min_surface_px) {
            for at in surface {
                picture[at] = DisparityPixel::none(Reason::SmallSurface);
            }
        }
    }
}

#[test]
fn agrees_with_a_plain_flood_fill_on_random_pictures() {
    let mut random = Random::seeded("surface size", 0x5eed_0001);
    let mut stage = Box::new(SurfaceSize::<64>::new());
    for round in 0..3000 {
        let width = 1 + random.below(64) as usize;
        let height = 1 + random.below(40) as usize;
        let settings =
            ValidateSettings { min_surface_px: random.below(60) as u16, step_sixteenths: random.below(20) as u16 };
        let levels = 1 + random.below(6);
        let holes = random.below(50);
        let mut picture: Vec<_> = (0..width * height)
            .map(|_| {
                if random.below(100) < holes {
                    DisparityPixel::none(Reason::LowTexture)
                } else {
                    DisparityPixel::from_steps((16 + random.below(levels) * 12) as u16)
                }
            })
            .collect();
        let mut expected = picture.clone();
        plain(&mut expected, width, &settings);
        stage.configure(&settings, width).unwrap();
        stage.run(&mut picture);
        assert!(picture == expected, "round {round}: {width} x {height}, {settings:?}");
    }
}

#[test]
fn takes_any_bits_for_a_picture() {
    let mut random = Random::seeded("surface size, any bits", 0x5eed_0002);
    let mut stage = Box::new(SurfaceSize::<64>::new());
    let settings = ValidateSettings { min_surface_px: 30, step_sixteenths: 1024 };
    stage.configure(&settings, 50).unwrap();
    for _ in 0..300 {
        let mut picture: Vec<_> =
            (0..50 * 30).map(|_| DisparityPixel::from_bits(random.next() as u16 >> random.below(12))).collect();
        let mut expected = picture.clone();
        plain(&mut expected, 50, &settings);
        stage.run(&mut picture);
        assert!(picture == expected);
    }
}

#[test]
fn bands_take_out_the_same_as_the_whole_picture() {
    let mut random = Random::seeded("surface size in bands", 0x5eed_0003);
    let mut stage = Box::new(SurfaceSize::<64>::new());
    let mut others: Vec<_> = (0..3).map(|_| Box::new(SurfaceSize::<64>::new())).collect();
    let (mut small, mut large) = (0, 0);
    for round in 0..2000 {
        let (width, height) = (1 + random.below(40) as usize, 1 + random.below(48) as usize);
        // Surfaces about as large as the smallest that stays, so that it counts for each whether a seam goes through it.
        let settings =
            ValidateSettings { min_surface_px: 2 + random.below(30) as u16, step_sixteenths: random.below(20) as u16 };
        let (levels, holes) = (1 + random.below(4), random.below(60));
        let (wide, high) = (1 + random.below(9) as usize, 1 + random.below(9) as usize);
        let blocks: Vec<_> = (0..48 * 48).map(|_| (random.below(levels), random.below(100) < holes)).collect();
        let mut picture: Vec<_> = (0..width * height)
            .map(|i| match blocks[i / width / high * 48 + i % width / wide] {
                (_, true) => DisparityPixel::none(Reason::LowTexture),
                (level, false) => DisparityPixel::from_steps((16 + level * 12 + random.below(3)) as u16),
            })
            .collect();
        let mut expected = picture.clone();
        plain(&mut expected, width, &settings);
        let taken = |picture: &[DisparityPixel]| {
            picture.iter().filter(|pixel| pixel.get() == Err(Reason::SmallSurface)).count()
        };
        small += taken(&expected);
        large += expected.iter().filter(|pixel| pixel.has_value()).count();
        stage.configure(&settings, width).unwrap();
        let bands = 1 + random.below(3) as usize;
        let mut others: Vec<&mut SurfaceSize<64>> = others.iter_mut().take(bands).map(|stage| &mut **stage).collect();
        stage.run_in_bands(&mut picture, &mut others, &mut crate::bands::OneThread);
        assert!(picture == expected, "round {round}: {width} x {height}, {settings:?}, {bands} more bands");
    }
    assert!(small > 50_000 && large > 50_000, "{small} taken out, {large} left");
}

#[test]
fn settings_that_cannot_be_are_named() {
    let good = ValidateSettings::default();
    let mut stage = SurfaceSize::<64>::new();
    let mut field = |settings: ValidateSettings| {
        let error = settings.check().unwrap_err();
        assert_eq!(stage.configure(&settings, 64), Err(error));
        error.field
    };
    assert_eq!(field(ValidateSettings { min_surface_px: u16::MAX, ..good }), "validate.min_surface_px");
    assert_eq!(field(ValidateSettings { step_sixteenths: 1025, ..good }), "validate.step_sixteenths");
    assert_eq!(good.check(), Ok(()));
    assert_eq!(ValidateSettings { min_surface_px: MAX_SURFACE_PX as u16, step_sixteenths: 1024 }.check(), Ok(()));
    assert_eq!(stage.configure(&good, 65).unwrap_err().field, "calibration.width");
}
