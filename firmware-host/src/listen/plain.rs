//! A line for each thing that happens, for pipes, logs and scripts.

use std::io::{self, Write};

use fencepost_core::{health::Health, wire::NodeId};
use serde_json::{Value, json};

use super::{
    Event, Listener,
    source::{Source, SourceState},
    verdict::{self, Severity, Verdict},
};
use crate::words;

/// Writes lines, as text or as JSON.
#[derive(Debug)]
pub struct Plain<W> {
    out: W,
    json: bool,
    bus: Option<Verdict>,
    nodes: Vec<(NodeId, Option<&'static str>)>,
}

impl<W: Write> Plain<W> {
    /// Writes to `out`.
    pub const fn new(out: W, json: bool) -> Self {
        Self { out, json, bus: None, nodes: Vec::new() }
    }

    /// Writes what a frame brought, at `at_ns`. Echoes and motion are left out: they come too often.
    ///
    /// # Errors
    /// When the line cannot be written.
    pub fn event(&mut self, node: NodeId, event: &Event, at_ns: u64) -> io::Result<()> {
        match event {
            Event::Scan(scan) if self.json => {
                let mut line = scan.json(seconds(at_ns), node.get());
                if let Some(line) = line.as_object_mut() {
                    line.insert("sectors_dm".into(), json!(scan.sectors.distance_dm));
                }
                writeln!(self.out, "{line}")
            }
            Event::Scan(scan) => {
                let age = scan.age_ns(at_ns).map_or("age unknown".into(), |age| format!("{} ms old", age / 1_000_000));
                let ground = scan.ground.map_or("no ground".into(), |ground| {
                    let (pitch, roll) = (words::tilt_deg(ground.pitch_down), words::tilt_deg(ground.roll));
                    let held = if ground.age_frames > 0 { ", held" } else { "" };
                    let height_m = f64::from(ground.camera_height_mm) / 1000.0;
                    format!("ground {height_m:.2} m below, pitch {pitch:.1}, roll {roll:.1}{held}")
                });
                self.line(at_ns, Some(node), "scan", &format!("{}; {age}; {ground}", scan.text()), Value::Null)
            }
            Event::Heartbeat { heartbeat, changed: true } => {
                let (state, health) = (words::state_name(heartbeat.state), heartbeat.health);
                let fields = json!({
                    "state": state,
                    "health": words::level_name(health.level),
                    "reasons": words::reason_names(health, " ").split_whitespace().collect::<Vec<_>>(),
                });
                self.line(at_ns, Some(node), "heartbeat", &format!("{state}, {}", health_in_words(health)), fields)
            }
            Event::GivenUp(why) => {
                let text = format!("a scan is given up: {why}");
                self.line(at_ns, Some(node), "given_up", &text, json!({"reason": why}))
            }
            Event::Damaged(why) => {
                let text = format!("a message cannot be used: {why}");
                self.line(at_ns, Some(node), "damaged", &text, json!({"reason": why}))
            }
            Event::Heartbeat { changed: false, .. } | Event::Motion(_) | Event::Echo(_) => Ok(()),
        }
    }

    /// Writes what has changed without a frame: the bus fell silent, a node's heartbeat stopped. `open_since_ns` is since when
    /// frames could have come.
    ///
    /// # Errors
    /// When the line cannot be written.
    pub fn look(
        &mut self,
        listener: &Listener,
        state: &SourceState,
        open_since_ns: u64,
        now_ns: u64,
    ) -> io::Result<()> {
        let bus = verdict::of_bus(listener, state, open_since_ns, now_ns);
        // Its seconds rise: the sentence's beginning tells whether it is a new one.
        let kind = |verdict: &Option<Verdict>| verdict.as_ref().map(|v| v.text.split(':').next().map(str::to_owned));
        if kind(&bus) != kind(&self.bus) {
            match &bus {
                Some(Verdict { text, hint, .. }) => {
                    let hint = hint.as_deref().unwrap_or_default();
                    self.line(now_ns, None, "bus", &format!("{text}; {hint}"), json!({"what": text, "mend": hint}))?;
                }
                None => self.line(now_ns, None, "bus", "frames come again", json!({"what": null, "mend": null}))?,
            }
            self.bus = bus;
        }
        for (id, node) in listener.nodes() {
            let (verdict, kind) = (verdict::of_node(node, now_ns), node.objection(now_ns).map(verdict::name_of));
            let known = self.nodes.iter_mut().find(|(known, _)| known == id);
            let before = match known {
                Some((_, before)) => std::mem::replace(before, kind),
                None => {
                    self.nodes.push((*id, kind));
                    // Nothing is to be said of a node that has just begun to speak.
                    kind
                }
            };
            if before != kind {
                let good = verdict.severity != Severity::Bad || kind.is_none();
                let text = if good { "a controller may drive by its scans" } else { verdict.text.as_str() };
                self.line(now_ns, Some(*id), "verdict", text, json!({"objection": kind, "what": text}))?;
            }
        }
        Ok(())
    }

    /// Writes the counts and hands everything on.
    ///
    /// # Errors
    /// When the lines cannot be written.
    pub fn finish(&mut self, listener: &Listener, source: &Source) -> io::Result<()> {
        let (traffic, condition) = (listener.traffic(), source.condition());
        let nodes: Vec<Value> = listener
            .nodes()
            .iter()
            .map(|(id, node)| {
                let s = node.statistics();
                json!({
                    "node": id.get(),
                    "scans": s.scans,
                    "heartbeats": node.heartbeats(),
                    "given_up": s.abandoned_scans,
                    "missed": s.missed_scans,
                    "lost": s.lost,
                    "damaged": s.crc_errors.saturating_add(s.refused),
                    "repeated": s.repeated,
                })
            })
            .collect();
        if self.json {
            let summary = json!({
                "frames": traffic.frames(),
                "of_others": traffic.of_others(),
                "unreadable_lines": source.unreadable(),
                "bus_errors": condition.errors,
                "nodes": nodes,
            });
            writeln!(self.out, "{}", json!({"summary": summary}))?;
        } else {
            writeln!(self.out, "\n{} frames, {} of others", traffic.frames(), traffic.of_others())?;
            if source.unreadable() > 0 {
                writeln!(self.out, "{} lines of the log cannot be read", source.unreadable())?;
            }
            for node in &nodes {
                writeln!(
                    self.out,
                    "node {}: {} scans, {} heartbeats; {} scans given up, {} missed; messages: {} lost, {} damaged, {} repeated",
                    node["node"],
                    node["scans"],
                    node["heartbeats"],
                    node["given_up"],
                    node["missed"],
                    node["lost"],
                    node["damaged"],
                    node["repeated"]
                )?;
            }
        }
        self.out.flush()
    }

    /// Hands on what was written.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    fn line(&mut self, at_ns: u64, node: Option<NodeId>, what: &str, text: &str, fields: Value) -> io::Result<()> {
        if self.json {
            let mut line = json!({"time_s": seconds(at_ns), "node": node.map(NodeId::get), "message": what});
            if let (Some(line), Value::Object(fields)) = (line.as_object_mut(), fields) {
                line.extend(fields);
            }
            return writeln!(self.out, "{line}");
        }
        let who = node.map_or_else(|| "bus".to_owned(), |node| format!("node {}", node.get()));
        writeln!(self.out, "{:>16.6} {who:<7} {what:<9} {text}", seconds(at_ns))
    }
}

fn seconds(at_ns: u64) -> f64 {
    at_ns as f64 * 1.0e-9
}

fn health_in_words(health: Health) -> String {
    let reasons = words::reasons_in_words(health);
    let level = words::level_name(health.level);
    if reasons.is_empty() { level.to_owned() } else { format!("{level}: {}", reasons.join("; ")) }
}
