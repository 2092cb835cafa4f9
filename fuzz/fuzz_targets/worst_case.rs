#![no_main]
//! Climbs towards the pictures that cost the most: libFuzzer keeps an input that takes more steps of a loop, as a share of its bound,
//! than any before.

use std::{
    cell::RefCell,
    sync::atomic::{AtomicU8, Ordering::Relaxed},
};

use fencepost_work::search::{Attack, Outcome};

/// Loops that a stage has at most, with the sum of all.
const LOOPS: usize = 12;
/// Stages.
const STAGES: usize = 9;
/// Steps are told in parts of the bound.
const PARTS: usize = 512;

/// libFuzzer takes these for places of the code: each that is not zero was reached. It clears them before each input.
// SAFETY: it is a section of bytes, which the fuzzer reads and clears between two inputs.
#[unsafe(link_section = "__libfuzzer_extra_counters")]
#[used]
static REACHED: [AtomicU8; STAGES * LOOPS * PARTS] = [const { AtomicU8::new(0) }; STAGES * LOOPS * PARTS];

thread_local! {
    static ATTACK: RefCell<Attack> = RefCell::new(Attack::new());
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Outcome { stage, steps } = ATTACK.with_borrow_mut(|attack| attack.run(bytes));
    assert!(stage < STAGES && steps.len() <= LOOPS, "more stages or loops than there are counters for");
    for (place, (steps, bound)) in steps.into_iter().enumerate() {
        let part = (steps as usize * (PARTS - 1)).checked_div(bound as usize).unwrap_or(0).min(PARTS - 1);
        REACHED[(stage * LOOPS + place) * PARTS + part].store(1, Relaxed);
    }
});
