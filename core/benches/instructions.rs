//! Instructions of the stages, counted by callgrind: the same on every run, so that they can be compared with those of before.
//! `tests/instructions` does that; it needs valgrind and the runner of this harness.

#![allow(missing_docs, unreachable_pub, reason = "the harness makes modules and functions of its own")]
// The harness is there for this processor only.
#![cfg_attr(not(target_arch = "x86_64"), no_main)]
#![cfg(target_arch = "x86_64")]

mod common;

use std::hint::black_box;

use common::Stages;
use gungraun::{library_benchmark, library_benchmark_group, main};

/// Each stage once. What was prepared is handed back: setting free what it holds is not counted.
macro_rules! stage {
    ($name:ident, $run:ident, $pictures:expr) => {
        #[library_benchmark]
        #[bench::once($pictures)]
        fn $name(mut stages: Stages) -> Stages {
            black_box(stages.$run());
            stages
        }
    };
}

stage!(rectify, rectify, Stages::new());
stage!(matching, match_rows, Stages::new());
stage!(validate, validate, Stages::new());
stage!(surfaces, surfaces, Stages::new());
stage!(detect, detect, Stages::new());
// Pictures that are made to cost much.
stage!(matching_noise, match_rows, Stages::noise());
stage!(detect_noise, detect, Stages::noise());
stage!(matching_blocks, match_rows, Stages::blocks());
stage!(detect_blocks, detect, Stages::blocks());

library_benchmark_group!(name = stages, benchmarks = [rectify, matching, validate, surfaces, detect]);
library_benchmark_group!(name = worst, benchmarks = [matching_noise, detect_noise, matching_blocks, detect_blocks]);
main!(library_benchmark_groups = stages, worst);
