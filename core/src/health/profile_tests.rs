//! Profiles and signatures against plain evaluations in f64.

use std::vec::Vec;

use super::*;
use crate::test_random::Random;

/// Rows of a picture with its valid columns, of `height` rows.
fn rows(random: &mut Random, width: usize, height: usize) -> Vec<(Vec<u8>, ValidSpan)> {
    let row = |random: &mut Random| {
        let (base, range) = (random.below(150), 1 + random.below(105));
        (0..width).map(|_| (base + random.below(range)) as u8).collect()
    };
    let span = |random: &mut Random| {
        let start = random.below(width as u32 + 2) as u16;
        // Now and then too few columns, none, or more than there are.
        ValidSpan { start, end: start + random.below(width as u32) as u16 }
    };
    (0..height).map(|_| (row(random), span(random))).collect()
}

fn profile(rows: &[(Vec<u8>, ValidSpan)]) -> Profile {
    let mut profile = Profile::new();
    profile.begin(rows.len());
    rows.iter().enumerate().for_each(|(y, (row, span))| profile.push(y, row, *span));
    profile
}

#[test]
fn bands_of_rows_add_up_mean_grey_and_contrast() {
    let mut random = Random::seeded("profiles", 0x5eed_0191);
    for height in [1, 2, 100, 255, 256, 257, 400, 512, 513, 1000] {
        let rows = rows(&mut random, 30, height);
        let found = profile(&rows);
        let per_band = (1..).find(|rows| rows * 256 >= height).unwrap();
        assert_eq!((Profile::rows_of_band(height), found.bands()), (per_band, height / per_band), "{height}");
        for rows in 0..10 {
            assert_eq!(found.bands_in(rows), if rows >= 2 * per_band { rows / per_band } else { 1 });
        }
        let (mut grey, mut contrast) = ([0.0; BANDS], [0.0; BANDS]);
        for (y, (row, span)) in rows.iter().enumerate() {
            let (start, end) = (usize::from(span.start), usize::from(span.end));
            if end > row.len() || start + 3 > end || y / per_band >= BANDS {
                continue;
            }
            let valid: Vec<f64> = row[start..end].iter().map(|grey| f64::from(*grey)).collect();
            grey[y / per_band] += valid.iter().sum::<f64>() / valid.len() as f64;
            let steps: f64 = valid.windows(3).map(|three| (three[2] - three[0]).abs().min(32.0)).sum();
            contrast[y / per_band] += steps / (valid.len() - 2) as f64;
        }
        let near = |found: &[f32; BANDS], expected: &[f64; BANDS]| {
            found.iter().zip(expected).all(|(found, expected)| (f64::from(*found) - expected).abs() < 1.0e-3)
        };
        assert!(near(&found.grey, &grey) && near(&found.contrast, &contrast), "{height}");
    }
    // Of each band one of two has seen all rows.
    let rows = rows(&mut random, 30, 300);
    let (mut upper, mut lower) = (Profile::new(), Profile::new());
    upper.begin(300);
    lower.begin(300);
    for (y, (row, span)) in rows.iter().enumerate() {
        if y < 128 { &mut upper } else { &mut lower }.push(y, row, *span);
    }
    upper.append(&lower);
    let whole = profile(&rows);
    assert_eq!((upper.grey, upper.contrast), (whole.grey, whole.contrast));
    let mut unset = Profile::new();
    unset.push(3, &[1, 2, 3, 4], ValidSpan { start: 0, end: 4 });
    assert_eq!((unset.bands(), unset.bands_in(7)), (0, 7), "no picture was begun");
}

#[test]
fn a_signature_is_what_stands_out_from_around() {
    let mut random = Random::seeded("signatures", 0x5eed_0192);
    for height in [3, 9, 120, 256, 300] {
        let mut found = profile(&rows(&mut random, 30, height));
        let bands = found.bands();
        // Whatever was valid.
        for values in [&mut found.grey, &mut found.contrast] {
            values.iter_mut().take(bands).for_each(|value| *value = 50.0 + random.below(1000) as f32 / 10.0);
        }
        let mut signature = Signature { values: [[77; BANDS]; 2] };
        found.sign(&mut signature);
        for (profile, values) in [(&found.grey, &signature.values[0]), (&found.contrast, &signature.values[1])] {
            let out: Vec<f64> = (0..bands)
                .map(|band| {
                    let around: Vec<f64> = (0..bands)
                        .filter(|other| other.abs_diff(band) <= 4)
                        .map(|other| f64::from(profile[other]))
                        .collect();
                    f64::from(profile[band]) - around.iter().sum::<f64>() / around.len() as f64
                })
                .collect();
            let mean = out.iter().map(|out| out.abs()).sum::<f64>() / bands as f64;
            for (band, value) in values.iter().enumerate() {
                let expected = out.get(band).map_or(0.0, |out| (out / mean).clamp(-2.0, 2.0) * 32.0);
                assert!((f64::from(*value) - expected).abs() < 0.51, "{height} rows, band {band}: {value}, {expected}");
            }
        }
    }
    // Without structure there is none: rounding is not taken for it.
    let mut flat = profile(&rows(&mut random, 30, 200));
    flat.grey.fill(99.9);
    flat.contrast.fill(0.3);
    let mut signature = Signature { values: [[77; BANDS]; 2] };
    flat.sign(&mut signature);
    assert_eq!(signature.values, [[0; BANDS]; 2]);
}

#[test]
fn likeness_is_a_correlation_half_bands_apart() {
    let mut random = Random::seeded("likeness", 0x5eed_0193);
    for round in 0..60 {
        let mut any = || core::array::from_fn(|_| core::array::from_fn(|_| (random.below(129) as i16 - 64) as i8));
        let (a, b) = (Signature { values: any() }, Signature { values: any() });
        for halves in -9..=9_isize {
            let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
            for (a, b) in a.values.iter().zip(&b.values) {
                for (place, b) in b.iter().enumerate() {
                    // Twice the band of the first, at the place of the second.
                    let twice = 2 * place as isize + halves;
                    let at =
                        |band: isize| usize::try_from(band).ok().and_then(|band| a.get(band)).map(|a| f64::from(*a));
                    let (Some(upper), Some(lower)) = (at(twice.div_euclid(2)), at((twice + 1).div_euclid(2))) else {
                        continue;
                    };
                    let (a, b) = (upper + lower, f64::from(*b));
                    (ab, aa, bb) = (ab + a * b, aa + a * a, bb + b * b);
                }
            }
            let found = f64::from(a.likeness(&b, halves));
            assert!((found - ab / (aa * bb).sqrt()).abs() < 1.0e-5, "round {round}, {halves} half bands: {found}");
        }
        assert!((a.likeness(&a, 0) - 1.0).abs() < 1.0e-6);
        assert_eq!((a.likeness(&Signature::NONE, 0), Signature::NONE.likeness(&a, 1)), (0.0, 0.0));
    }
}

#[test]
fn rows_below_the_picture_count_for_nothing() {
    let mut random = Random::seeded("profiles", 0x5eed_0196);
    let rows = rows(&mut random, 30, 300);
    let (expected, mut found) = (profile(&rows), profile(&rows));
    for y in [BANDS * Profile::rows_of_band(300), 1_000_000, usize::MAX] {
        found.push(y, &rows[0].0, ValidSpan { start: 0, end: 30 });
    }
    assert_eq!((found.grey, found.contrast), (expected.grey, expected.contrast));
}
