//! How far the surfaces at a seam are walked over.

use std::{boxed::Box, vec::Vec};

use super::*;
use crate::validate::ValidateSettings;

/// At a seam only what may be small is walked over, and only as far as it takes to know. Where it is walked over nothing of the picture
/// changes by it: what was walked over last is looked at.
#[test]
fn what_is_known_to_be_large_is_not_walked_over_at_a_seam() {
    const WIDTH: usize = 9;
    let mut stage = Box::new(SurfaceSize::<64>::new());
    stage.configure(&ValidateSettings { min_surface_px: 4, step_sixteenths: 8 }, WIDTH).unwrap();
    let mut walked = |rows: &[&str], y: usize, settled: Option<usize>| {
        let pixel = |letter: u8| match letter {
            b'.' => DisparityPixel::none(Reason::LowTexture),
            // Letters are farther apart than what is contiguous.
            letter => DisparityPixel::from_steps(u16::from(letter - b'a' + 1) * 20),
        };
        let mut picture: Vec<_> = rows.iter().flat_map(|row| row.bytes()).map(pixel).collect();
        let before = picture.iter().filter(|pixel| pixel.has_value()).count();
        stage.walk.clear();
        stage.settle_row(&mut picture, y, settled);
        (stage.walk.len(), before - picture.iter().filter(|pixel| pixel.has_value()).count())
    };
    // Columns and rows that are walked over, and pixels that are taken out.
    assert_eq!(walked(&["aaaabbbbb", "c.......c"], 0, None), (0, 0), "runs that are long enough");
    assert_eq!(walked(&["....aaa..", "........."], 0, None), (3, 3), "one that is too short");
    assert_eq!(walked(&["....aaa..", ".....aa.."], 0, None).1, 0, "one that goes on below");
    assert_eq!(walked(&["....aaa..", ".....aa.."], 1, Some(0)), (0, 0), "one that touches what is settled");
    assert_eq!(walked(&["....a....", ".....aa.."], 1, Some(0)), (2, 2), "one that is beside it");
    assert_eq!(walked(&["....b....", "....aaaa."], 1, Some(0)), (0, 0), "a long one that does not touch it");
    // As far as it takes, and no farther: a line is found pixel by pixel.
    assert_eq!(walked(&["a........"; 7], 0, None), (4, 0), "a line of seven pixels");
    // Behind the last pixel of a row comes the first of the next one, which is no part of it.
    assert_eq!(walked(&["........a", "a........"], 0, None), (1, 1), "the last pixel of the row");
    assert_eq!(walked(&["a........", "........."], 0, None), (1, 1), "no disparity is not walked over");
}

/// In bands as well nothing is taken out by a stage that is not configured, or for which every surface is large enough.
#[test]
fn without_a_size_nothing_is_taken_out_in_bands() {
    let before: Vec<_> = (0..40 * 64).map(|i| DisparityPixel::from_steps(1 + i % 7 * 90)).collect();
    let [mut stage, mut other] = [0; 2].map(|_| Box::new(SurfaceSize::<64>::new()));
    for min_surface_px in [None, Some(0), Some(1), Some(2)] {
        if let Some(min_surface_px) = min_surface_px {
            stage.configure(&ValidateSettings { min_surface_px, step_sixteenths: 8 }, 64).unwrap();
        }
        let mut picture = before.clone();
        stage.run_in_bands(&mut picture, &mut [&mut other], &mut crate::bands::OneThread);
        assert_eq!(picture == before, min_surface_px != Some(2), "{min_surface_px:?}");
    }
}

/// Nor is it in a picture without columns, which no size of a surface divides.
#[test]
fn a_picture_without_columns_is_left_alone_in_bands() {
    let [mut stage, mut other] = [0; 2].map(|_| Box::new(SurfaceSize::<64>::new()));
    stage.configure(&ValidateSettings { min_surface_px: 8, step_sixteenths: 8 }, 0).unwrap();
    let before = [DisparityPixel::from_steps(90); 3];
    let mut picture = before;
    stage.run_in_bands(&mut picture, &mut [&mut other], &mut crate::bands::OneThread);
    assert_eq!(picture, before);
}
