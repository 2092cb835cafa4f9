//! The table for the terminal.

use super::Outcome;
use crate::{summary, words};

/// A line for each detector: what its cells are worth, how long a frame takes, what it holds in memory.
pub fn table(outcomes: &[Outcome]) -> String {
    let mut lines = vec![format!(
        "{:<20} {:>7} {:>7} {:>7} {:>7} {:>9} {:>9} {:>10}",
        "detector", "F1", "false", "missed", "free", "median ms", "p99 ms", "memory"
    )];
    for Outcome { method, log, memory_bytes, .. } in outcomes {
        let cells = log.scores.as_ref().and_then(|scores| scores.cells);
        let figure = |value: Option<f64>| value.map_or_else(|| "-".to_string(), |value| format!("{value:.4}"));
        let total = summary::stage_times(&log.frames).pop().map(|stage| stage.times).unwrap_or_default();
        lines.push(format!(
            "{:<20} {:>7} {:>7} {:>7} {:>7} {:>9.2} {:>9.2} {:>10}",
            method.name(),
            figure(cells.map(|s| s.f1)),
            figure(cells.map(|s| s.false_alarm)),
            figure(cells.map(|s| s.missed_free)),
            figure(cells.map(|s| s.free_found)),
            total.median_ms,
            total.p99_ms,
            memory_bytes.map_or_else(|| "heap".to_string(), words::bytes),
        ));
    }
    lines.join("\n")
}
