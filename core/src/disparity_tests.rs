//! All 65,536 pixels, and pictures of every shape.

use std::{format, string::String, vec::Vec};

use super::*;
use crate::test_random::Random;

#[test]
fn any_bits_are_a_disparity_or_a_reason() {
    for bits in 0..=u16::MAX {
        let pixel = DisparityPixel::from_bits(bits);
        assert_eq!(pixel.bits(), bits);
        match bits {
            0 => assert_eq!(pixel.get(), Err(Reason::OutOfRange)),
            1..0x8000 => {
                let disparity = pixel.get().unwrap();
                assert_eq!(disparity.to_num::<f64>(), f64::from(bits) / 16.0);
                assert_eq!(pixel, DisparityPixel::from_steps(bits));
            }
            _ => {
                let code = usize::from(bits - 0x8000);
                let reason = *Reason::ALL.get(code).unwrap_or(&Reason::OutsideValidArea);
                assert_eq!(pixel.get(), Err(reason));
                assert_eq!(DisparityPixel::from_steps(bits), DisparityPixel::none(Reason::OutOfRange));
            }
        }
        assert_eq!(pixel.has_value(), pixel.get().is_ok());
        assert_eq!(pixel.steps(), if pixel.has_value() { bits } else { 0 });
    }
    for (code, reason) in Reason::ALL.into_iter().enumerate() {
        assert_eq!(reason as usize, code);
        assert_eq!(DisparityPixel::none(reason).get(), Err(reason));
    }
}

#[test]
fn reasons_are_called_as_in_the_code() {
    for reason in Reason::ALL {
        let mut name = String::new();
        for letter in format!("{reason:?}").chars() {
            if letter.is_uppercase() && !name.is_empty() {
                name.push('_');
            }
            name.extend(letter.to_lowercase());
        }
        assert_eq!(reason.name(), name);
    }
}

#[test]
fn pictures_have_whole_rows_only() {
    let pixels: [DisparityPixel; 24] = core::array::from_fn(|i| DisparityPixel::from_steps(i as u16 + 1));
    for len in 0..=24 {
        for width in 0..=26 {
            let picture = DisparityPicture::new(&pixels[..len], width);
            let height = len.checked_div(width).unwrap_or(0);
            assert_eq!((picture.width(), picture.height()), (width, height));
            assert_eq!(picture.pixels(), &pixels[..width * height]);
            for y in 0..height {
                assert_eq!(picture.row(y), &pixels[y * width..(y + 1) * width]);
            }
            assert!(picture.row(height).is_empty() && picture.row(usize::MAX).is_empty());
        }
    }
}

#[test]
fn counts_are_those_of_looking_at_each_pixel() {
    let mut random = Random::seeded("counts of pixels", 0x5eed_0208);
    for len in [0, 1, 31, 4095, 4096, 4097, 10_000] {
        let any = |random: &mut Random| match random.below(4) {
            0 => random.below(0x1_0000) as u16,
            1 => 0x8000 + random.below(9) as u16,
            2 => random.below(2) as u16 * 0x7fff,
            _ => random.below(0x8000) as u16,
        };
        let pixels: Vec<_> = (0..len).map(|_| DisparityPixel::from_bits(any(&mut random))).collect();
        let (mut with, mut without) = (0, [0; 7]);
        for pixel in &pixels {
            match pixel.get() {
                Ok(_) => with += 1,
                Err(reason) => without[reason as usize] += 1,
            }
        }
        assert_eq!(DisparityPicture::new(&pixels, 1).counts(crate::arch::Chosen::PLAIN), (with, without));
    }
}
