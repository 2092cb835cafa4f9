//! Inputs to begin with.

use crate::source::next;

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
