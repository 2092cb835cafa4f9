//! Inputs to begin with.

/// Inputs to begin with, made by a generator from fixed seeds: short and long ones, of small and of large bytes.
pub fn seeds(name: &str) -> Vec<Vec<u8>> {
    let mut state = name
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    let mut seeds = texts(name);
    for length in [0, 1, 40, 120, 300, 600] {
        for mask in [0xFF, 0x3F, 0x07] {
            let bytes = (0..length).map(|_| {
                // SplitMix64 (Steele, Lea, Flood 2014).
                state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
                let mut z = state;
                z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
                z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
                (z ^ (z >> 31)) as u8 & mask
            });
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
