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
    let bytes = |state: &mut u64, begin: &[u8], length: usize| -> Vec<u8> {
        begin.iter().copied().chain((0..length).map(|_| next(state) as u8)).collect()
    };
    match name {
        // Pictures with something wrong, and parts.
        "stages" => {
            let pictures = (0..).map(|i| bytes(state, &[192 + (i % 64) as u8], 40 + i % 40));
            let mut seeds: Vec<_> = pictures.filter(|seed| Source::new(seed).seldom(32)).take(96).collect();
            // Behind a matrix, which takes few bytes, and behind sets without points.
            for which in 0..128 {
                seeds.push(bytes(state, &[2, 0, 0, which], 200));
                seeds.push(bytes(state, &[7], 120));
            }
            seeds
        }
        // The matcher alone, with windows and spans of every kind.
        "pairs" => (0..1000)
            .map(|i| bytes(state, &[248 + (i % 8) as u8], 60 + i % 60))
            .filter(|seed| Source::new(seed).seldom(4))
            .take(96)
            .collect(),
        // Settings of any value: bases and nodes that there are, all formats, rates and bit rates at their ends.
        "receiver" => (0..64)
            .map(|i| {
                let ends = if i % 4 == 0 { [255, 255, 0, 0, 0, 0] } else { [10, 0, 0x20, 0xA1, 7, 0] };
                let frames = [1, 2, 12, 255][i / 4 % 4];
                let settings = [0, 0, 0, 0, 255, 0, 1 + (i % 7) as u8, (i % 16) as u8, (i / 16 % 2) as u8, frames];
                bytes(state, &[&settings[..], &ends].concat(), 100)
            })
            .collect(),
        _ => Vec::new(),
    }
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
