//! Comparisons of moments against a plain search through all that came before.

use std::vec::Vec;

use super::*;
use crate::{matching::ValidSpan, test_random::Random};

/// A picture as a grey value for each of its rows, striped so that it has a contrast.
fn profile(rows: &[f64]) -> Profile {
    let mut profile = Profile::new();
    profile.begin(rows.len());
    for (y, grey) in rows.iter().enumerate() {
        let row: Vec<u8> = (0..40).map(|x| (grey + f64::from(x % 4) * grey / 12.0).round() as u8).collect();
        profile.push(y, &row, ValidSpan { start: 0, end: 40 });
    }
    profile
}

fn signature(profile: &Profile) -> Signature {
    let mut signature = Signature::NONE;
    profile.sign(&mut signature);
    signature
}

#[test]
fn the_best_pair_of_two_moments_is_that_of_a_plain_search() {
    // One row to a band, and two.
    search(200, 200, 8);
    search(300, 150, 4);
}

/// Sequences of pictures of `rows` rows; four rows either way are `reach` half bands.
fn search(rows: usize, bands: usize, reach: isize) {
    let mut random = Random::seeded("moments", 0x5eed_0194);
    let mut pairing = Pairing::new();
    let (mut lags, mut stills, mut advantages) = ([0; 11], 0, 0);
    for round in 0..40 {
        pairing.clear();
        // What both sides showed, newest first.
        let mut before: Vec<[Signature; 2]> = Vec::new();
        let mut scenes: Vec<Vec<f64>> = Vec::new();
        for frame in 0..9 {
            // New, nearly as before, or very much the same, frame by frame.
            let mix = [1.0, 0.35, 0.12][random.below(3) as usize];
            let mut scene: Vec<f64> = (0..rows).map(|_| random.within(40.0, 150.0)).collect();
            if let Some(last) = scenes.last() {
                scene.iter_mut().zip(last).for_each(|(new, last)| *new = mix * *new + (1.0 - mix) * last);
            }
            scenes.push(scene);
            // Either side may be late.
            let sides = [0, 1].map(|side| {
                let late = if round % 3 == side { 1 + round as usize % 6 } else { 0 };
                let scene = &scenes[scenes.len().saturating_sub(1 + late)];
                let noise = [0.0, 3.0][random.below(2) as usize];
                let moved = if round % 7 == 6 && side == 1 { 2 } else { 0 };
                let rows = (0..rows).map(|y| scene[(y + moved) % rows] + noise * random.within(-1.0, 1.0));
                profile(&rows.collect::<Vec<f64>>())
            });
            let now = sides.each_ref().map(signature);
            let found = pairing.compare(&sides);
            let as_given = (-reach..=reach).map(|halves| now[0].likeness(&now[1], halves)).fold(-1.0, f32::max);
            let still = [0, 1].map(|side| {
                before.first().is_some_and(|before| (0.9..0.9995).contains(&now[side].likeness(&before[side], 0)))
            });
            let mut best: Option<(f32, i8)> = None;
            for ([left, right], age) in before.iter().zip(1_i8..=5) {
                for (still, likeness, lag) in
                    [(still[1], left.likeness(&now[1], 0), age), (still[0], now[0].likeness(right, 0), -age)]
                {
                    if !still && best.is_none_or(|(most, _)| likeness > most) {
                        best = Some((likeness, lag));
                    }
                }
            }
            let expected = best.unwrap_or_default();
            assert_eq!((found.likeness, found.lag_frames), expected, "round {round}, frame {frame}");
            let z = |correlation: f32| f64::from(correlation).clamp(-0.999, 0.999).atanh();
            let error = 1.0 / ((bands - 3) as f64).sqrt();
            let sigmas = if best.is_some() { (z(expected.0) - z(as_given)) / error } else { 0.0 };
            assert!((f64::from(found.advantage_sigmas) - sigmas).abs() < 2.0e-2, "{found:?}, {sigmas}");
            lags[usize::from((found.lag_frames + 5) as u8)] += 1;
            stills += usize::from(still[0]) + usize::from(still[1]);
            advantages += usize::from(sigmas > 3.0);
            before.insert(0, now);
        }
    }
    std::println!("lags {lags:?}, {stills} still, {advantages} told apart");
    assert!(lags.iter().all(|lag| *lag > 2) && stills > 20 && advantages > 20, "{lags:?}, {stills}, {advantages}");
}

#[test]
fn a_picture_of_few_rows_says_nothing_of_its_moment() {
    let mut pairing = Pairing::new();
    for rows in [[60.0, 140.0, 90.0], [100.0, 50.0, 130.0], [60.0, 140.0, 90.0]] {
        let sign = pairing.compare(&[profile(&rows), profile(&[130.0, 50.0, 100.0])]);
        assert_eq!(sign.advantage_sigmas, 0.0, "three bands have no standard error");
    }
}
