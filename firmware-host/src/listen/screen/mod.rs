//! The live view.
//!
//! ```text
//! title       interface, bit rate, load
//! nodes       one tab each
//! verdict     may a controller drive by this?
//! map         details
//! sectors
//! keys
//! ```

mod details;
mod map;
mod palette;
mod sectors;

use fencepost_core::wire::NodeId;
use fencepost_hal::can::BusCondition;
use ratatui::{
    Frame,
    layout::{Alignment, Constraint, Layout, Rect},
    text::{Line, Span, Text},
    widgets::{Block, Clear, Paragraph, Wrap},
};

pub use palette::Palette;
use palette::sign;

use super::{
    Listener,
    node::Node,
    source::SourceState,
    verdict::{self, Severity, Verdict},
};

/// The smallest window in which everything has its place.
const SMALLEST: (u16, u16) = (60, 16);
/// Columns of the details, in small windows and in large ones.
const DETAILS: (u16, u16) = (36, 52);

/// Everything that is shown.
#[derive(Debug)]
pub struct View<'a> {
    /// What was heard.
    pub listener: &'a Listener,
    /// Name of the interface or of the log.
    pub name: &'a str,
    /// How the source stands.
    pub state: SourceState,
    /// Bits per second, if known.
    pub bitrate: Option<u32>,
    /// What the controller of our interface tells.
    pub condition: BusCondition,
    /// Lines of the log that could not be read.
    pub unreadable: usize,
    /// Seconds played, seconds in all and the speed, of a log.
    pub log: Option<(f64, f64, f64)>,
    /// Messages sent and not taken, if we act as a controller.
    pub echo: Option<(u64, u64)>,
    /// The node that is looked at.
    pub node: Option<NodeId>,
    /// When listening began, nanoseconds.
    pub since_ns: u64,
    /// Since when frames could have come, nanoseconds.
    pub open_since_ns: u64,
    /// Now, nanoseconds.
    pub now_ns: u64,
    /// Colours.
    pub palette: Palette,
}

/// Draws the view.
pub fn draw(frame: &mut Frame<'_>, view: &View<'_>) {
    let area = frame.area();
    if area.width < SMALLEST.0 || area.height < SMALLEST.1 {
        let text = format!("The window is too small: {} x {} at least.", SMALLEST.0, SMALLEST.1);
        return frame.render_widget(Paragraph::new(text).wrap(Wrap { trim: true }), area);
    }
    let sector_rows = if area.height >= 40 {
        8
    } else if area.height >= 24 {
        4
    } else {
        0
    };
    let rows = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(1),
        Constraint::Length(1),
        Constraint::Min(6),
        Constraint::Length(sector_rows),
        Constraint::Length(1),
    ]);
    let [title_area, tabs_area, verdict_area, main, sectors_area, keys_area] = rows.areas(area);
    let node = view.selected();
    let of_bus = verdict::of_bus(view.listener, &view.state, view.open_since_ns, view.now_ns);
    let of_node = node.map(|node| verdict::of_node(node, view.now_ns));

    frame.render_widget(title(view, usize::from(title_area.width)), title_area);
    frame.render_widget(tabs(view), tabs_area);
    let verdict = of_bus.clone().or_else(|| of_node.clone());
    frame.render_widget(banner(verdict.as_ref(), view), verdict_area);
    if let Some(node) = node {
        let details_width = if area.width >= 120 { DETAILS.1 } else { DETAILS.0 };
        let [map_area, _, details_area] =
            Layout::horizontal([Constraint::Min(20), Constraint::Length(1), Constraint::Length(details_width)])
                .areas(main);
        let trusted = of_bus.is_none() && of_node.as_ref().is_some_and(|verdict| verdict.severity != Severity::Bad);
        if let Some(scan) = node.scan() {
            let buffer = frame.buffer_mut();
            map::draw(scan, node.extent(), trusted, view.palette, map_area, buffer);
            let range_m = f64::from(node.extent().i_last) * f64::from(scan.end.cell_size_mm) / 1000.0;
            sectors::draw(&scan.sectors, range_m.max(1.0), trusted, view.palette, sectors_area, buffer);
        }
        let lines = details::lines(node, view, usize::from(details_area.width), usize::from(details_area.height));
        frame.render_widget(Paragraph::new(lines), details_area);
        if let Some(verdict) = of_bus.or(of_node).filter(|verdict| verdict.severity == Severity::Bad) {
            notice(frame, view, &verdict, map_area);
        }
    } else {
        let waiting = Verdict { severity: Severity::Good, text: "waiting for the first frame".into(), hint: None };
        notice(frame, view, of_bus.as_ref().unwrap_or(&waiting), main);
    }
    frame.render_widget(keys(view, usize::from(keys_area.width)), keys_area);
}

impl View<'_> {
    /// The node that is looked at: the one that was chosen, or the first that was heard.
    fn selected(&self) -> Option<&Node> {
        let nodes = self.listener.nodes();
        self.node.and_then(|id| nodes.get(&id)).or_else(|| nodes.values().next())
    }
}

fn title(view: &View<'_>, width: usize) -> Line<'static> {
    let palette = view.palette;
    let (frames_per_s, bits_per_s) = view.listener.traffic().per_s(view.now_ns);
    let mut left = vec![Span::styled(" FENCEPOST ", palette.heading()), Span::raw(view.name.to_owned())];
    match view.bitrate {
        Some(bitrate) => {
            let percent = bits_per_s * 100.0 / f64::from(bitrate.max(1));
            left.push(Span::styled(format!(" {} kbit/s", bitrate / 1000), palette.faint()));
            let severity = if percent > 80.0 {
                Severity::Bad
            } else if percent > 60.0 {
                Severity::Care
            } else {
                Severity::Good
            };
            left.push(Span::raw("  load "));
            left.push(Span::styled(format!("≤ {percent:.0} % {}", gauge(percent, 10)), palette.word(severity)));
        }
        None => left.push(Span::raw(format!("  load ≤ {:.0} kbit/s", bits_per_s / 1000.0))),
    }
    left.push(Span::raw(format!("  {frames_per_s:.0} frames/s")));
    let right = match (&view.state, view.log) {
        (SourceState::Paused, Some((at, all, _))) => format!("HELD at {at:.1} of {all:.1} s "),
        (SourceState::Ended, Some((_, all, _))) => format!("END OF THE LOG {all:.1} s "),
        (_, Some((at, all, speed))) => format!("log {at:.1} of {all:.1} s, x{speed} "),
        _ => format!("{:.0} s ", view.now_ns.saturating_sub(view.since_ns) as f64 * 1.0e-9),
    };
    let used: usize = left.iter().map(|span| span.content.chars().count()).sum();
    let gap = width.saturating_sub(used + right.chars().count());
    if gap > 0 {
        left.push(Span::raw(" ".repeat(gap)));
        left.push(Span::styled(right, palette.faint()));
    }
    Line::from(left)
}

fn gauge(percent: f64, width: usize) -> String {
    let filled = ((percent / 100.0 * width as f64).round() as usize).min(width);
    format!("▕{}{}▏", "█".repeat(filled), "░".repeat(width - filled))
}

fn tabs(view: &View<'_>) -> Line<'static> {
    let palette = view.palette;
    let selected = view.selected().map(|node| node.address().node);
    let mut spans = vec![Span::raw(" ")];
    for (id, node) in view.listener.nodes() {
        let severity = verdict::of_node(node, view.now_ns).severity;
        let text = format!(" {} node {} ", sign(severity), id.get());
        let style = palette.word(severity);
        spans.push(match selected == Some(*id) {
            true => Span::styled(text, style.reversed()),
            false => Span::styled(text, style),
        });
        spans.push(Span::raw(" "));
    }
    if view.listener.nodes().is_empty() {
        let base = view.listener.base().get();
        spans.push(Span::styled(format!("no node heard yet, base 0x{base:03X}"), palette.faint()));
    }
    Line::from(spans)
}

fn banner(verdict: Option<&Verdict>, view: &View<'_>) -> Paragraph<'static> {
    let Some(Verdict { severity, text, .. }) = verdict else { return Paragraph::default() };
    Paragraph::new(format!(" {} {text}", sign(*severity))).style(view.palette.banner(*severity))
}

/// A box over the map that cannot be overlooked.
fn notice(frame: &mut Frame<'_>, view: &View<'_>, verdict: &Verdict, area: Rect) {
    let width = area.width.saturating_sub(4).min(56);
    let mut lines: Vec<Line<'static>> = Vec::new();
    let inner = usize::from(width.saturating_sub(4));
    lines.extend(details::wrap(&verdict.text, inner).into_iter().map(Line::raw));
    if let Some(hint) = &verdict.hint {
        lines.push(Line::default());
        lines.extend(details::wrap(hint, inner).into_iter().map(Line::raw));
    }
    let height = (lines.len() as u16 + 2).min(area.height);
    let place = Rect { x: area.x + (area.width - width) / 2, y: area.y + (area.height - height) / 2, width, height };
    let style = view.palette.banner(verdict.severity);
    let block = Block::bordered().style(style);
    frame.render_widget(Clear, place);
    frame.render_widget(Paragraph::new(Text::from(lines)).alignment(Alignment::Center).block(block), place);
}

fn keys(view: &View<'_>, width: usize) -> Line<'static> {
    let mut keys = vec![("q", "quit")];
    if view.listener.nodes().len() > 1 {
        keys.push(("Tab", "next node"));
    }
    if view.log.is_some() {
        keys.extend([("space", "hold"), ("r", "again"), ("+ -", "speed")]);
    }
    let mut spans = Vec::new();
    for (key, what) in keys {
        spans.push(Span::styled(format!(" {key} "), view.palette.heading()));
        spans.push(Span::raw(format!("{what} ")));
    }
    if view.echo.is_some() {
        spans.push(Span::styled(" acting as controller ", view.palette.heading()));
    }
    // As much of the legend as there is room for.
    let legend = ["█ obstacle", if view.palette.colours { "· free" } else { ": free" }, "blank: not seen"];
    let mut used: usize = spans.iter().map(|span| span.content.chars().count()).sum();
    for sign in legend {
        used += 2 + sign.chars().count();
        if used <= width {
            spans.push(Span::styled(format!("  {sign}"), view.palette.faint()));
        }
    }
    Line::from(spans)
}

#[cfg(test)]
mod tests;
