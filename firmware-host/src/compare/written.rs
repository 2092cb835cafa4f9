//! `compare.json`.

use serde_json::{Value, json};

use super::Outcome;
use crate::{pipeline::FrameRecord, source::Input};

/// Parts of a detector's `summary.json` that are worth setting side by side.
const PARTS: [&str; 6] = ["frames", "stages", "score", "counts", "ground", "health"];

/// What is written of all detectors.
pub fn written<S>(input: &Input<S>, outcomes: &[Outcome]) -> Value {
    json!({
        "program": concat!("fencepost ", env!("CARGO_PKG_VERSION")),
        "recording": {"name": input.name, "description": input.description},
        "detectors": outcomes.iter().map(detector).collect::<Vec<_>>(),
    })
}

fn detector(outcome: &Outcome) -> Value {
    let mut fields = serde_json::Map::new();
    fields.insert("name".to_string(), json!(outcome.method.name()));
    fields.insert("folder".to_string(), json!(outcome.method.name()));
    fields.insert("memory_bytes".to_string(), json!(outcome.memory_bytes));
    fields.insert("own_memory_bytes".to_string(), json!(outcome.own_memory_bytes));
    for part in PARTS {
        fields.insert(part.to_string(), outcome.summary[part].clone());
    }
    fields.insert("by_frame".to_string(), outcome.log.frames.iter().map(frame).collect());
    Value::Object(fields)
}

fn frame(record: &FrameRecord) -> Value {
    json!({
        "frame": record.number,
        "total_ms": record.times.total_ms,
        "obstacle_cells": record.statistics.cells_obstacle,
        "free_cells": record.statistics.cells_free,
        "cells": record.cell_counts.and_then(|counts| counts.score()),
    })
}
