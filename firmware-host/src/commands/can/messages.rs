//! Single messages as text and as JSON.

use fencepost_core::map::{SECTOR_CLEAR_DM, SECTOR_UNKNOWN};
use fencepost_core::wire::{
    CellsRepr, EndRepr, GroundRepr, HeaderRepr, HeartbeatRepr, MeaninglessValue, Message, Packet, ScanEchoRepr,
    SectorsRepr, VehicleMotionRepr, WireGround,
};
use serde_json::{Value, json};

use crate::words;

/// A message in words.
#[derive(Debug)]
pub(super) struct Decoded {
    pub(super) name: &'static str,
    pub(super) text: String,
    pub(super) fields: Value,
}

impl Decoded {
    /// Reads the signals of a message.
    pub(super) fn new(packet: &Packet<'_>) -> Result<Self, MeaninglessValue> {
        let data = packet.data();
        let name = packet.message().name();
        let (text, fields) = match packet.message() {
            Message::Heartbeat => heartbeat(&HeartbeatRepr::parse(data)?),
            Message::Header => header(&HeaderRepr::parse(data)?),
            Message::Cells | Message::CellsFd => cells(&CellsRepr::parse(data)?),
            Message::Sectors => sectors(&SectorsRepr::parse(data)?),
            Message::Ground => ground(&GroundRepr::parse(data)?),
            Message::End => end(&EndRepr::parse(data)?),
            Message::VehicleMotion => motion(&VehicleMotionRepr::parse(data)?),
            Message::ScanEcho => {
                let echo = ScanEchoRepr::parse(data)?;
                (format!("scan {} was taken over", echo.scan_index), json!({"scan": echo.scan_index}))
            }
        };
        Ok(Self { name, text, fields })
    }
}

fn heartbeat(heartbeat: &HeartbeatRepr) -> (String, Value) {
    let state = words::state_name(heartbeat.state);
    let level = words::level_name(heartbeat.health.level);
    let reasons = words::reason_names(heartbeat.health, ", ");
    let last = heartbeat.last_scan.map_or_else(|| "no scan yet".to_string(), |scan| format!("last scan {scan}"));
    let why = if reasons.is_empty() { String::new() } else { format!(": {reasons}") };
    let fields = json!({
        "state": state,
        "health": level,
        "reasons": words::reason_names(heartbeat.health, " ").split_whitespace().collect::<Vec<_>>(),
        "last_scan": heartbeat.last_scan,
        "protocol_version": heartbeat.protocol_version,
    });
    (format!("{state}, health {level}{why}, {last}"), fields)
}

fn header(header: &HeaderRepr) -> (String, Value) {
    let age_ms = header.age_ns().map(|ns| ns / 1_000_000);
    let age = age_ms.map_or_else(|| "age unknown".to_string(), |ms| format!("{ms} ms old"));
    let level = words::level_name(header.health);
    let text = format!(
        "scan {}, {} cells in {} frames, health {level}, {age}",
        header.scan_index, header.cell_count, header.frame_count
    );
    let fields = json!({
        "scan": header.scan_index,
        "cell_count": header.cell_count,
        "frame_count": header.frame_count,
        "health": level,
        "age_ms": age_ms,
    });
    (text, fields)
}

fn cells(cells: &CellsRepr) -> (String, Value) {
    let runs: Vec<_> = cells.runs.iter().flatten().collect();
    let text: Vec<_> = runs
        .iter()
        .map(|run| {
            let state = if run.obstacle { "obstacle" } else { "free" };
            match run.length {
                1 => format!("{state} ({}, {})", run.i, run.j),
                length => format!("{state} ({}, {}) and {} on", run.i, run.j, length - 1),
            }
        })
        .collect();
    let json_runs: Vec<_> = runs
        .iter()
        .map(|run| json!({"i": run.i, "j": run.j, "length": run.length, "obstacle": run.obstacle}))
        .collect();
    let fields = json!({"scan_low": cells.scan_low, "sequence": cells.sequence, "runs": json_runs});
    (format!("number {}: {}", cells.sequence, text.join(", ")), fields)
}

fn sectors(sectors: &SectorsRepr) -> (String, Value) {
    match sectors {
        SectorsRepr::Distances { scan_low, part, distance_dm } => {
            let words: Vec<_> = distance_dm.iter().map(|distance| distance_in_words(*distance)).collect();
            let fields = json!({"scan_low": scan_low, "part": part, "distance_dm": distance_dm});
            (format!("part {part}: {}", words.join(", ")), fields)
        }
        SectorsRepr::Layout { scan_low, layout } => {
            let (left, width) = (f64::from(layout.left_cdeg) / 100.0, f64::from(layout.width_cdeg) / 100.0);
            let fields = json!({"scan_low": scan_low, "left_deg": left, "width_deg": width, "count": layout.count});
            (
                format!("{} sectors of {width} degrees, the first begins {left} degrees to the left", layout.count),
                fields,
            )
        }
    }
}

fn distance_in_words(distance_dm: u8) -> String {
    match distance_dm {
        SECTOR_UNKNOWN => "not seen".to_string(),
        SECTOR_CLEAR_DM => "clear".to_string(),
        dm => format!("{}.{} m", dm / 10, dm % 10),
    }
}

fn ground(ground: &GroundRepr) -> (String, Value) {
    match &ground.ground {
        Some(WireGround { age_frames, camera_height_mm, pitch_down, roll }) => {
            let height_m = f64::from(*camera_height_mm) / 1000.0;
            let (pitch, roll) = (words::tilt_deg(*pitch_down), words::tilt_deg(*roll));
            let held = if *age_frames > 0 { format!(", {age_frames} frames old") } else { String::new() };
            let fields = json!({
                "scan_low": ground.scan_low,
                "camera_height_m": height_m,
                "pitch_down_deg": pitch,
                "roll_deg": roll,
                "age_frames": age_frames,
            });
            (
                format!("camera {height_m:.3} m above it, pitched down {pitch:.2}, rolled {roll:.2} degrees{held}"),
                fields,
            )
        }
        None => ("no plane".to_string(), json!({"scan_low": ground.scan_low, "camera_height_m": null})),
    }
}

fn end(end: &EndRepr) -> (String, Value) {
    let dropped = match end.dropped_cells {
        0 => String::new(),
        count => format!(", {count} cells found no room"),
    };
    let fields = json!({
        "scan": end.scan_index,
        "cell_size_mm": end.cell_size_mm,
        "dropped_cells": end.dropped_cells,
        "scan_crc": end.scan_crc,
    });
    (format!("scan {}, cells of {} mm{dropped}", end.scan_index, end.cell_size_mm), fields)
}

fn motion(motion: &VehicleMotionRepr) -> (String, Value) {
    let speed = motion.speed_mm_per_s.map(|v| f64::from(v) / 1000.0);
    let yaw_rate = motion.yaw_rate_cdeg_per_s.map(|v| f64::from(v) / 100.0);
    let words = |value: Option<f64>, unit: &str| value.map_or("not known".to_string(), |v| format!("{v} {unit}"));
    let text = format!("speed {}, yaw rate {}", words(speed, "m/s"), words(yaw_rate, "degrees/s"));
    (text, json!({"speed_m_per_s": speed, "yaw_rate_deg_per_s": yaw_rate}))
}
