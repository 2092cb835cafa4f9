//! How long the detector takes for a frame, from a raw pair to CAN payloads, with the pictures in memory.

mod fit;
mod lens;
mod measure;
mod pictures;

pub use measure::{Job, Measurement, measure};
pub use pictures::{BenchPictures, Pair};

use fencepost_core::{
    arch::Backend,
    detector::{Capacities, Stage, band_bytes, memory_bytes},
};
use serde_json::{Map, Value, json};

use crate::{stopwatch::TimeSummary, words};

/// What was measured, and where.
#[derive(Clone, Debug)]
pub struct Report {
    /// The pictures, in words.
    pub pictures: String,
    /// Width and height of the pictures, px.
    pub size: (u32, u32),
    /// Disparities searched.
    pub disparities: u16,
    /// Whose instructions the matching used.
    pub backend: Backend,
    /// The times.
    pub measurement: Measurement,
}

impl Report {
    /// Bytes of a detector that is just large enough, and of what it takes for more bands than one.
    pub fn memory_bytes(&self) -> usize {
        let (width, height) = self.size;
        let capacities = Capacities::for_pictures(width as usize, height as usize, usize::from(self.disparities));
        memory_bytes(&capacities) + (self.measurement.bands - 1) * band_bytes(&capacities)
    }

    /// All threads together: the median of a frame by the number of frames that are worked on at once, milliseconds.
    fn total_ms(&self) -> f64 {
        self.frame_times().median_ms / self.measurement.threads.max(1) as f64
    }

    fn frame_times(&self) -> TimeSummary {
        TimeSummary::of(self.measurement.frames.iter().map(|frame| frame.total_ms))
    }

    /// Every stage in the order in which they run, the last of them the making of the CAN payloads.
    fn stages(&self) -> Vec<(&'static str, TimeSummary)> {
        let frames = &self.measurement.frames;
        let stage =
            |stage: Stage| (stage.name(), TimeSummary::of(frames.iter().map(|frame| frame.stages_ms[stage as usize])));
        let wire = ("wire", TimeSummary::of(frames.iter().map(|frame| frame.wire_ms)));
        Stage::ALL.into_iter().map(stage).chain([wire]).collect()
    }

    /// For programs.
    pub fn json(&self) -> Value {
        let times = self.frame_times();
        let stages: Map<String, Value> =
            self.stages().into_iter().map(|(name, times)| (name.to_string(), json!(times.median_ms))).collect();
        json!({
            "total_ms": self.total_ms(),
            "p99_ms": times.p99_ms,
            "max_ms": times.max_ms,
            "stages": stages,
            "memory_bytes": self.memory_bytes(),
            "backend": self.backend.name(),
            "threads": self.measurement.threads,
            "bands": self.measurement.bands,
            "frames": self.measurement.frames.len(),
            "pictures": self.pictures,
            "width": self.size.0,
            "height": self.size.1,
            "disparities": self.disparities,
        })
    }

    /// For people.
    pub fn table(&self) -> String {
        let (width, height) = self.size;
        let Measurement { threads, bands, frames } = &self.measurement;
        let mut lines = vec![
            format!("{:<11} {}", "pictures", self.pictures),
            format!("{:<11} {width} × {height} px, {} disparities", "size", self.disparities),
            match threads {
                1 => format!("{:<11} {} frames on one thread", "measured", frames.len()),
                threads => format!("{:<11} {} frames on {threads} threads at once", "measured", frames.len()),
            },
            format!("{:<11} {}", "backend", self.backend.name()),
            format!("{:<11} {} of state", "memory", words::bytes(self.memory_bytes())),
            String::new(),
            format!("{:<11} {:>10} {:>10} {:>10}", "stage", "median ms", "p99 ms", "max ms"),
        ];
        let row = |name: &str, times: TimeSummary| {
            let TimeSummary { median_ms, p99_ms, max_ms } = times;
            format!("{name:<11} {median_ms:>10.3} {p99_ms:>10.3} {max_ms:>10.3}")
        };
        if *bands > 1 {
            lines
                .insert(3, format!("{:<11} {bands}, a thread for each; rectify and health are told as match", "bands"));
        }
        lines.extend(self.stages().into_iter().map(|(name, times)| row(name, times)));
        lines.push(row("total", self.frame_times()));
        if *threads > 1 {
            lines.push(format!("\n{:<11} {:.3} ms for a frame", "together", self.total_ms()));
        }
        lines.join("\n")
    }
}
