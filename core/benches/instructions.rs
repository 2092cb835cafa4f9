//! Instructions of the stages, counted by callgrind: the same on every run, so that they can be compared with those of before.
//! `tests/instructions` does that; it needs valgrind and the runner of this harness.

#![allow(missing_docs, unreachable_pub, reason = "the harness makes modules and functions of its own")]
// The harness is there for this processor only.
#[cfg(target_arch = "x86_64")]
mod common;

#[cfg(target_arch = "x86_64")]
use std::hint::black_box;

#[cfg(target_arch = "x86_64")]
use common::Stages;
#[cfg(target_arch = "x86_64")]
use gungraun::{library_benchmark, library_benchmark_group, main};

/// Each stage once. What was prepared is handed back: setting free what it holds is not counted.
#[cfg(target_arch = "x86_64")]
macro_rules! stages {
    ($($name:ident: $run:ident of $pictures:ident,)*) => {
        $(
            #[library_benchmark]
            #[bench::once(Stages::$pictures())]
            fn $name(mut stages: Stages) -> Stages {
                black_box(stages.$run());
                stages
            }
        )*
        library_benchmark_group!(name = stages, benchmarks = [$($name),*]);
        main!(library_benchmark_groups = stages);
    };
}

#[cfg(target_arch = "x86_64")]
stages! {
    rectify: rectify of new,
    matching: match_rows of new,
    validate: validate of new,
    surfaces: surfaces of new,
    detect: detect of new,
    // Pictures that are made to cost much.
    matching_noise: match_rows of noise,
    detect_noise: detect of noise,
    matching_blocks: match_rows of blocks,
    detect_blocks: detect of blocks,
}

#[cfg(not(target_arch = "x86_64"))]
fn main() {}
