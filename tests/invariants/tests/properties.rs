//! Every target with inputs from proptest, from a fixed seed: `FENCEPOST_CASES` is the number of cases of each, and another
//! `FENCEPOST_SEED` gives others.

use fencepost_invariants::{TARGETS, run};
use proptest::{
    collection::vec,
    prelude::*,
    test_runner::{Config, RngAlgorithm, TestRng, TestRunner},
};

const SEED: u64 = 20_261_129;

fn number(name: &str, usual: u64) -> u64 {
    std::env::var(name).map_or(usual, |text| text.parse().unwrap_or_else(|_| panic!("{name} is no number: {text}")))
}

/// Runs a target with inputs of random length; some have small bytes only, which choose the first of what can be chosen.
fn check(name: &str, cases: u64) {
    let (cases, seed) = (number("FENCEPOST_CASES", cases), number("FENCEPOST_SEED", SEED));
    println!("{name}: {cases} cases, seed {seed}");
    let mut bytes = [0; 32];
    bytes.iter_mut().zip(seed.to_le_bytes()).for_each(|(to, from)| *to = from);
    let config = Config { cases: cases as u32, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &bytes));
    let inputs = (vec(any::<u8>(), 0..500), prop_oneof![3 => Just(0xFFu8), 1 => Just(0x3F), 1 => Just(0x07)]);
    let result = runner.run(&inputs, |(bytes, mask)| {
        let bytes: Vec<u8> = bytes.iter().map(|byte| byte & mask).collect();
        run(name, &bytes);
        Ok(())
    });
    if let Err(error) = result {
        panic!("{name}: {error}");
    }
}

/// A test for each target, and one that there is none without.
macro_rules! properties {
    ($($name:ident: $cases:literal,)*) => {
        $(
            #[test]
            fn $name() {
                check(stringify!($name), $cases);
            }
        )*

        #[test]
        fn every_target_has_a_test() {
            let tested = [$(stringify!($name)),*];
            for target in TARGETS {
                assert!(tested.contains(&target.name), "{} has no test", target.name);
            }
        }
    };
}

#[cfg(feature = "host")]
properties! {
    surfaces: 2000,
    disparity: 8000,
    pairs: 3000,
    rectifier: 3000,
    receiver: 3000,
    command: 3000,
    stages: 10000,
    calibration: 2000,
    recording: 500,
    rig: 500,
    pixels: 3000,
    live: 3000,
}

#[cfg(not(feature = "host"))]
properties! {
    surfaces: 2000,
    disparity: 8000,
    pairs: 3000,
    rectifier: 3000,
    receiver: 3000,
    command: 3000,
    stages: 10000,
}
