//! Times of the stages: `cargo bench -p fencepost-core --bench stages`.

mod common;

use std::hint::black_box;

use common::{HEIGHT, Stages, WIDTH};
use criterion::{Criterion, Throughput};

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mut stages = Stages::new();
    let mut group = criterion.benchmark_group("320x240x48");
    group.throughput(Throughput::Elements((WIDTH * HEIGHT) as u64));
    group.bench_function("rectify", |b| b.iter(|| black_box(&mut stages).rectify()));
    group.bench_function("match", |b| b.iter(|| black_box(&mut stages).match_rows()));
    group.bench_function("validate", |b| b.iter(|| black_box(&mut stages).validate()));
    group.bench_function("surfaces", |b| b.iter(|| black_box(&mut stages).surfaces()));
    group.bench_function("detect", |b| b.iter(|| black_box(&mut stages).detect()));
    group.finish();
    criterion.final_summary();
}
