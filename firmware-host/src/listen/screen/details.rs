//! What is known of a node, in words and numbers.

use fencepost_core::health::HealthLevel;
use fencepost_hal::can::ControllerState;
use ratatui::text::{Line, Span};

use super::{
    View,
    palette::{Palette, severity, sign},
};
use crate::{
    listen::{
        node::{COMMAND_TIMEOUT_NS, HEARTBEAT_TIMEOUT_NS, Node},
        verdict::{self, Severity},
    },
    words,
};

/// A scan echoes of which are behind by more is worth a word.
const ECHO_BEHIND: u16 = 3;

/// The lines, none longer than `width`.
pub(super) fn lines(node: &Node, view: &View<'_>, width: usize, height: usize) -> Vec<Line<'static>> {
    let palette = view.palette;
    let groups = [
        scan(node, view),
        ground(node, palette),
        heartbeat(node, view),
        link(node, palette),
        vehicle(node, view),
        bus(view),
    ];
    let needed: usize = groups.iter().map(Vec::len).sum();
    // Health takes the room that is left, and the groups stand apart if there is still more.
    let mut lines = health(node, view, width, height.saturating_sub(needed));
    let apart = lines.len() + needed + groups.len() <= height;
    for group in groups.into_iter().filter(|group| !group.is_empty()) {
        if apart {
            lines.push(Line::default());
        }
        lines.extend(group);
    }
    lines
}

fn entry(palette: Palette, name: &'static str, text: impl Into<String>) -> Line<'static> {
    Line::from(vec![Span::styled(format!("{name:<8}"), palette.heading()), Span::raw(text.into())])
}

fn marked(palette: Palette, name: &'static str, severity: Severity, text: impl Into<String>) -> Line<'static> {
    let style = palette.word(severity);
    let text = if severity == Severity::Good { text.into() } else { format!("{} {}", sign(severity), text.into()) };
    Line::from(vec![Span::styled(format!("{name:<8}"), palette.heading()), Span::styled(text, style)])
}

/// Level and reasons: those of the heartbeat, and the level of the newest scan.
fn health(node: &Node, view: &View<'_>, width: usize, height: usize) -> Vec<Line<'static>> {
    let palette = view.palette;
    let Some((heartbeat, at_ns)) = node.heartbeat() else { return vec![entry(palette, "HEALTH", "not told yet")] };
    let health = heartbeat.health;
    if view.now_ns.saturating_sub(*at_ns) > HEARTBEAT_TIMEOUT_NS {
        let text = format!("not known (last: {})", words::level_name(health.level).to_uppercase());
        return vec![marked(palette, "HEALTH", Severity::Bad, text)];
    }
    let level = node.scan().map_or(HealthLevel::Ok, |scan| scan.header.health).max(health.level);
    let severity = severity(level);
    let text = format!("{} {}", sign(severity), words::level_name(level).to_uppercase());
    let mut lines = vec![Line::from(vec![
        Span::styled(format!("{:<8}", "HEALTH"), palette.heading()),
        Span::styled(text, palette.word(severity)),
    ])];
    let reasons = words::reasons_in_words(health);
    let room = height.saturating_sub(1);
    for (index, reason) in reasons.iter().enumerate() {
        let wrapped = wrap(reason, width.saturating_sub(3));
        let others = reasons.len() - index;
        // The last line says how many found no room.
        let needed = wrapped.len() + usize::from(others > 1);
        if lines.len() + needed > room + 1 {
            lines.push(Line::styled(format!(" … and {others} more reasons"), palette.word(severity)));
            break;
        }
        for (k, text) in wrapped.into_iter().enumerate() {
            lines.push(Line::raw(format!(" {} {text}", if k == 0 { "-" } else { " " })));
        }
    }
    lines
}

fn scan(node: &Node, view: &View<'_>) -> Vec<Line<'static>> {
    let palette = view.palette;
    let Some(scan) = node.scan() else { return vec![entry(palette, "SCAN", "none yet")] };
    let age = verdict::age(node, view.now_ns);
    let rate = node.scans_per_s(view.now_ns).map_or_else(|| "-".into(), |rate| format!("{rate:.1}"));
    let (obstacles, free) = scan.counts();
    let nearest = match scan.nearest_m() {
        Some((_, x, y)) if y.abs() < 0.05 => format!("{x:.1} m ahead"),
        Some((_, x, y)) => format!("{x:.1} m ahead, {:.1} {}", y.abs(), if y > 0.0 { "left" } else { "right" }),
        None => "none".into(),
    };
    let mut lines = vec![
        entry(palette, "SCAN", format!("{}  {age} old  {rate}/s", scan.header.scan_index)),
        entry(palette, "cells", format!("{obstacles} obstacle, {free} free")),
        entry(palette, "nearest", nearest),
    ];
    if scan.end.dropped_cells > 0 {
        lines.push(marked(palette, "left out", Severity::Care, format!("{} cells", scan.end.dropped_cells)));
    }
    lines
}

fn ground(node: &Node, palette: Palette) -> Vec<Line<'static>> {
    let Some(scan) = node.scan() else { return vec![] };
    let Some(ground) = scan.ground else { return vec![marked(palette, "GROUND", Severity::Care, "no plane found")] };
    let height_m = f64::from(ground.camera_height_mm) / 1000.0;
    let (pitch, roll) = (words::tilt_deg(ground.pitch_down), words::tilt_deg(ground.roll));
    let first = match ground.age_frames {
        0 => entry(palette, "GROUND", format!("camera {height_m:.2} m above it")),
        age => marked(palette, "GROUND", Severity::Care, format!("{height_m:.2} m, held for {age} scans")),
    };
    vec![first, entry(palette, "", format!("{pitch:.1}° down, {roll:.1}° roll"))]
}

fn heartbeat(node: &Node, view: &View<'_>) -> Vec<Line<'static>> {
    let Some((heartbeat, at_ns)) = node.heartbeat() else {
        return vec![marked(view.palette, "HEART", Severity::Bad, "no beat yet")];
    };
    let ago_ns = view.now_ns.saturating_sub(*at_ns);
    let ago_s = ago_ns as f64 * 1.0e-9;
    // The sign changes with each beat.
    let beat = if node.heartbeats().is_multiple_of(2) { "♥" } else { "♡" };
    let state = words::state_name(heartbeat.state);
    let severity = if ago_ns > HEARTBEAT_TIMEOUT_NS { Severity::Bad } else { Severity::Good };
    let text = if ago_s < 1.0 { format!("{:.0} ms", ago_s * 1000.0) } else { format!("{ago_s:.1} s") };
    let text = format!("{beat} {state}, {text} ago");
    vec![if severity == Severity::Good {
        entry(view.palette, "HEART", text)
    } else {
        marked(view.palette, "HEART", severity, text)
    }]
}

/// What went wrong on the way.
fn link(node: &Node, palette: Palette) -> Vec<Line<'static>> {
    let s = node.statistics();
    let damaged = s.crc_errors.saturating_add(s.refused);
    let wrong = s.lost > 0 || damaged > 0 || s.abandoned_scans > 0 || s.missed_scans > 0;
    let lost = format!("{} lost, {damaged} damaged", s.lost);
    let scans = format!("{} given up, {} missed", s.abandoned_scans, s.missed_scans);
    let first = if wrong { marked(palette, "FRAMES", Severity::Care, lost) } else { entry(palette, "FRAMES", lost) };
    let second = entry(palette, "scans", scans);
    vec![first, second]
}

/// What its controller tells the node.
fn vehicle(node: &Node, view: &View<'_>) -> Vec<Line<'static>> {
    let palette = view.palette;
    let ago = |at_ns: u64| view.now_ns.saturating_sub(at_ns);
    let mut lines = Vec::new();
    let who = if view.echo.is_some() { " (us)" } else { "" };
    lines.push(match node.motion() {
        None => entry(palette, "VEHICLE", "its motion was not told"),
        Some((_, at_ns)) if ago(*at_ns) > COMMAND_TIMEOUT_NS => {
            let text = format!("silent for {:.1} s", ago(*at_ns) as f64 * 1.0e-9);
            marked(palette, "VEHICLE", Severity::Care, text)
        }
        Some((motion, _)) => {
            let speed = motion.speed_mm_per_s.map_or("? m/s".into(), |v| format!("{:.2} m/s", f64::from(v) / 1000.0));
            let turn = motion.yaw_rate_cdeg_per_s.map_or("? °/s".into(), |v| {
                let side = if v > 0 {
                    " left"
                } else if v < 0 {
                    " right"
                } else {
                    ""
                };
                format!("{:.1}°/s{side}", f64::from(v).abs() / 100.0)
            });
            entry(palette, "VEHICLE", format!("{speed}, {turn}{who}"))
        }
    });
    lines.push(match (node.echo(), node.scan()) {
        (None, _) => entry(palette, "ECHO", "no scan was echoed"),
        (Some((index, at_ns)), scan) => {
            let behind = scan.map_or(0, |scan| scan.header.scan_index.wrapping_sub(*index));
            // An echo may come before the scan is whole here.
            let behind = if behind > 0x7FFF { 0 } else { behind };
            let silent = ago(*at_ns) > 2 * COMMAND_TIMEOUT_NS;
            let text = match (behind, silent) {
                (_, true) => format!("scan {index}, {:.1} s ago", ago(*at_ns) as f64 * 1.0e-9),
                (0, false) => format!("scan {index}{who}"),
                (behind, false) => format!("scan {index}, {behind} behind{who}"),
            };
            let severity = if silent || behind > ECHO_BEHIND { Severity::Care } else { Severity::Good };
            if severity == Severity::Good {
                entry(palette, "ECHO", text)
            } else {
                marked(palette, "ECHO", severity, text)
            }
        }
    });
    lines
}

/// What the controller of our own interface tells, where there is something to tell.
fn bus(view: &View<'_>) -> Vec<Line<'static>> {
    let (palette, condition) = (view.palette, view.condition);
    let mut lines = Vec::new();
    if let Some(verdict) = verdict::of_condition(&condition) {
        lines.push(marked(palette, "BUS", verdict.severity, verdict.text));
    } else if condition.errors > 0 {
        debug_assert_eq!(condition.controller, ControllerState::ErrorActive);
        lines.push(entry(palette, "BUS", "all right now"));
    }
    if condition.errors > 0 {
        let mut text = format!("{} errors", condition.errors);
        for (count, what) in [
            (condition.no_acknowledgement, "no ack"),
            (condition.overflows, "overflow"),
            (condition.restarts, "restart"),
        ] {
            if count > 0 {
                text.push_str(&format!(", {count} {what}"));
            }
        }
        lines.push(entry(palette, "", text));
    }
    if let Some((_, failed)) = view.echo.filter(|(_, failed)| *failed > 0) {
        lines.push(marked(palette, "SENDING", Severity::Care, format!("{failed} not taken by the bus")));
    }
    if view.unreadable > 0 {
        lines.push(marked(palette, "LOG", Severity::Care, format!("{} lines unreadable", view.unreadable)));
    }
    lines
}

/// Words of `text` in lines of at most `width`.
pub(super) fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let Some(line) = lines.last_mut() else { break };
        if line.is_empty() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() <= width {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(word.to_owned());
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_wrapped_and_none_is_lost() {
        let text = "more cells than the bus may carry: the farthest are left out";
        for width in 8..70 {
            let lines = wrap(text, width);
            assert_eq!(lines.join(" "), text);
            assert!(lines.iter().all(|line| line.len() <= width));
        }
    }
}
