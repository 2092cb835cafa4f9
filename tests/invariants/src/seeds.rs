//! Inputs to begin with.

use crate::{Source, source::next};

/// Inputs to begin with, made by a generator from fixed seeds: short and long ones, of small and of large bytes.
pub fn seeds(name: &str) -> Vec<Vec<u8>> {
    let mut state = name
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    let mut seeds = texts(name);
    for length in [0, 1, 40, 120, 300, 600] {
        for mask in [0xFF, 0x3F, 0x07] {
            let bytes = (0..length).map(|_| next(&mut state) as u8 & mask);
            seeds.push(bytes.collect());
        }
    }
    seeds.extend(rare(name, &mut state));
    seeds
}

/// More of those that lead to what few inputs are chosen for, or to what more than one byte must be right for.
fn rare(name: &str, state: &mut u64) -> Vec<Vec<u8>> {
    let mut seeds = Vec::new();
    // Only the hash of all bytes says whether an input is one of many: `chosen` are the questions of it that are to be answered by yes,
    // one in so many; one in one always is.
    let mut add = |begin: &[u8], length: usize, chosen: &[u64]| {
        loop {
            let seed: Vec<u8> = begin.iter().copied().chain((0..length).map(|_| next(state) as u8)).collect();
            let mut source = Source::new(&seed);
            if chosen.iter().all(|many| source.seldom(*many)) {
                return seeds.push(seed);
            }
        }
    };
    match name {
        "stages" => {
            (192..=255).for_each(|which| add(&[which], 40 + usize::from(which % 40), &[32]));
            // Cameras with one thing wrong: size, limits, whether raw; what is wrong, the scene, the side and how much of it.
            for wrong in 0..8 {
                for much in (0..80).step_by(5) {
                    add(
                        &[200, 0, 0, 1, 1, 0, wrong, much, 1, 3, 1, 0, much, 9, 7],
                        30,
                        &[32, 1 + u64::from(much % 2) * 2],
                    );
                }
            }
            // Parts, behind a matrix, which takes few bytes; and any stage.
            for which in 0..128 {
                add(&[2, 0, 0, which], 200, &[]);
                add(&[7], 120, &[]);
                add(&[which % 2], 30, &[]);
            }
        }
        "pairs" => {
            // The matcher alone: with all that its settings are refused for, and with every number of vectors.
            for i in 0..=255 {
                let [cost, wide] = [i / 16 % 2, 1 + i / 32 % 2];
                let settings = [0, 0, cost, i % 3, i % 2, wide, 0, 0, 0, 0, 1, 0];
                add(&[&[250, i, i % 6], &settings[..], &[240 + i % 16, i % 4]].concat(), 90, &[4]);
                let settings = [0, i % 4, 0, i % 3, i / 3 % 2, 0, 0, 0, 0, 0, 1, 0];
                let disparities = if i % 3 == 0 { [0, 232] } else { [i % 6, 0] };
                let begin = [&[250, i, disparities[0]], &settings[..], &[disparities[1], 1 + i % 4, 3]].concat();
                add(&begin, 90, &[4]);
            }
            // Whole detectors in bands, with the smallest pictures and the largest.
            (0..64).for_each(|i| add(&[i], 250, &[16]));
            (0..128).for_each(|i| add(&[9, i, 1 + i % 5, 0, 0, 250, 0], 250, &[16, 1, 1, 1, 12]));
        }
        "disparity" => {
            (0..192).for_each(|i| add(&[i], 250, &[if i % 4 == 0 { 16 } else { 1 }]));
            (0..64).for_each(|i| add(&[9, i, 0, 0, 250, 0], 300, &[1, 1, 1, 12]));
        }
        "rectifier" => (0..255).for_each(|i| add(&[i], 150, &[])),
        "receiver" => {
            // Settings of any value: bases and nodes that there are, all formats, rates and bit rates at their ends.
            for i in 0..64 {
                let ends = if i % 4 == 0 { [255, 255, 0, 0, 0, 0] } else { [10, 0, 0x20, 0xA1, 7, 0] };
                let frames = [1, 2, 12, 255][usize::from(i / 4 % 4)];
                let settings = [0, 0, 0, 0, 255, 0, 1 + i % 7, i % 16, i / 16 % 2, frames];
                add(&[&settings[..], &ends].concat(), 100, &[]);
            }
            (0..255).for_each(|i| add(&[0, 0, i % 2, 1, 0], 300, &[]));
        }
        _ => {}
    }
    seeds
}

#[cfg(not(feature = "host"))]
fn texts(_: &str) -> Vec<Vec<u8>> {
    Vec::new()
}

#[cfg(feature = "host")]
fn texts(name: &str) -> Vec<Vec<u8>> {
    match name {
        "calibration" => crate::calibration::seeds(),
        "recording" => crate::recording::seeds(),
        "rig" => crate::rig::seeds(),
        "pixels" => crate::pixels::seeds(),
        _ => Vec::new(),
    }
}
