//! Instructions of the stages, counted by callgrind: the same on every run, so that they can be compared with those of before.
//! `tests/instructions` does that; it needs valgrind and the runner of this harness.

#![allow(missing_docs, unreachable_pub, reason = "the harness makes modules and functions of its own")]

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
macro_rules! stage {
    ($name:ident, $run:ident) => {
        #[library_benchmark]
        #[bench::trail(Stages::new())]
        fn $name(mut stages: Stages) -> Stages {
            black_box(stages.$run());
            stages
        }
    };
}

#[cfg(target_arch = "x86_64")]
stage!(rectify, rectify);
#[cfg(target_arch = "x86_64")]
stage!(matching, match_rows);
#[cfg(target_arch = "x86_64")]
stage!(validate, validate);
#[cfg(target_arch = "x86_64")]
stage!(surfaces, surfaces);
#[cfg(target_arch = "x86_64")]
stage!(detect, detect);

#[cfg(target_arch = "x86_64")]
library_benchmark_group!(name = stages, benchmarks = [rectify, matching, validate, surfaces, detect]);
#[cfg(target_arch = "x86_64")]
main!(library_benchmark_groups = stages);

#[cfg(not(target_arch = "x86_64"))]
fn main() {}
