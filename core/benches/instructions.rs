//! Instructions of the stages, counted by callgrind: the same on every run, so that they can be compared with those of before.
//! `tests/instructions` does that; it needs valgrind and the runner of this harness.

#![allow(missing_docs, unreachable_pub, reason = "the harness makes modules and functions of its own")]

mod common;

use std::hint::black_box;

use common::Stages;
use gungraun::{library_benchmark, library_benchmark_group, main};

/// Each stage once. What was prepared is handed back: setting free what it holds is not counted.
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

stage!(rectify, rectify);
stage!(matching, match_rows);
stage!(validate, validate);
stage!(surfaces, surfaces);
stage!(detect, detect);

library_benchmark_group!(name = stages, benchmarks = [rectify, matching, validate, surfaces, detect]);
main!(library_benchmark_groups = stages);
