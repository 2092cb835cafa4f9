//! What was heard means, in words: the first thing that a person wants to know.

use fencepost_core::{
    health::HealthLevel,
    wire::{NoScan, NodeState},
};
use fencepost_hal::can::{BusCondition, ControllerState};

use super::{Listener, node::Node, source::SourceState};
use crate::words;

/// Silence that is worth a word.
const SILENCE_NS: u64 = 1_000_000_000;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// As it should be.
    Good,
    /// With care.
    Care,
    /// Not at all.
    Bad,
}

/// A verdict: a short sentence, and what to do where that is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// How bad it is.
    pub severity: Severity,
    /// A short sentence.
    pub text: String,
    /// What to look at, where it is bad.
    pub hint: Option<String>,
}

impl Verdict {
    fn new(severity: Severity, text: impl Into<String>) -> Self {
        Self { severity, text: text.into(), hint: None }
    }

    fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

/// What is wrong with the bus as a whole; `None` if nothing is. `open_since_ns` is since when frames could have come.
pub fn of_bus(listener: &Listener, state: &SourceState, open_since_ns: u64, now_ns: u64) -> Option<Verdict> {
    if let SourceState::Trouble { what, mend } = state {
        return Some(Verdict::new(Severity::Bad, what.as_str()).hint(mend.as_str()));
    }
    if matches!(state, SourceState::Ended) && listener.traffic().frames() == 0 {
        return Some(Verdict::new(Severity::Bad, "the log holds no frame"));
    }
    let traffic = listener.traffic();
    let silent_ns = now_ns.saturating_sub(traffic.newest_ns().unwrap_or(0).max(open_since_ns));
    if silent_ns >= SILENCE_NS {
        let seconds = silent_ns / 1_000_000_000;
        return Some(Verdict::new(Severity::Bad, format!("NOTHING COMES: no frame on the bus for {seconds} s")).hint(
            "Does the node run? Same bit rate at both ends? CAN_H and CAN_L not exchanged, 120 ohms at both ends?",
        ));
    }
    if listener.nodes().is_empty() && traffic.frames() > 0 && now_ns.saturating_sub(open_since_ns) >= SILENCE_NS {
        let base = listener.base().get();
        return Some(
            Verdict::new(
                Severity::Bad,
                format!("NO NODE: {} frames, none of a node at base 0x{base:03X}", traffic.frames()),
            )
            .hint("Does the node run? Has it another base (--base-id), or another number than --node asks for?"),
        );
    }
    None
}

/// Whether a controller may drive by the newest scan of `node`, and if not, why.
pub fn of_node(node: &Node, now_ns: u64) -> Verdict {
    let since = |at_ns: u64| now_ns.saturating_sub(at_ns) as f64 * 1.0e-9;
    match node.objection(now_ns) {
        None => usable(node, now_ns),
        Some(NoScan::NoHeartbeat) => match node.heartbeat() {
            Some((heartbeat, at_ns)) if heartbeat.state == NodeState::Stopping => {
                Verdict::new(Severity::Bad, format!("STOPPED in an orderly way {:.1} s ago", since(*at_ns)))
            }
            Some((_, at_ns)) => Verdict::new(
                Severity::Bad,
                format!("NO HEARTBEAT for {:.1} s: do not drive by this map", since(*at_ns)),
            )
            .hint("The node has stopped, hangs, or cannot send."),
            None => Verdict::new(Severity::Bad, "NO HEARTBEAT yet: do not drive by this map"),
        },
        Some(NoScan::OtherVersion(version)) => {
            Verdict::new(Severity::Bad, format!("OTHER VERSION of the messages: {version}"))
                .hint("Node and listener are of different versions of fencepost.")
        }
        Some(NoScan::NotRunning(state)) => {
            Verdict::new(Severity::Bad, format!("NOT RUNNING: the node is {}", words::state_name(state)))
        }
        Some(NoScan::None) => Verdict::new(Severity::Bad, "NO SCAN yet, but the node lives")
            .hint("Scans that do not come whole are given up: see the losses."),
        Some(NoScan::TooOld) => {
            Verdict::new(Severity::Bad, format!("TOO OLD: the newest scan is {} old", age(node, now_ns)))
                .hint("Do the cameras deliver? See the reasons under health.")
        }
    }
}

/// Short name of an objection.
pub const fn name_of(objection: NoScan) -> &'static str {
    match objection {
        NoScan::NoHeartbeat => "no_heartbeat",
        NoScan::OtherVersion(_) => "other_version",
        NoScan::NotRunning(_) => "not_running",
        NoScan::None => "no_scan",
        NoScan::TooOld => "too_old",
    }
}

/// Age of the newest scan, in words.
pub fn age(node: &Node, now_ns: u64) -> String {
    let Some(scan) = node.scan() else { return "-".into() };
    match scan.age_ns(now_ns) {
        None => "1.275 s or more".into(),
        Some(age_ns) if age_ns >= 1_000_000_000 => format!("{:.1} s", age_ns as f64 * 1.0e-9),
        Some(age_ns) => format!("{} ms", age_ns / 1_000_000),
    }
}

/// How the controller of our own interface stands, where it is not as it should be.
pub fn of_condition(condition: &BusCondition) -> Option<Verdict> {
    match condition.controller {
        ControllerState::ErrorActive => None,
        ControllerState::Warning => Some(Verdict::new(Severity::Care, "many errors (warning)")),
        ControllerState::ErrorPassive => Some(Verdict::new(Severity::Care, "error-passive")),
        ControllerState::BusOff => Some(Verdict::new(Severity::Bad, "off the bus (bus-off)")),
    }
}

fn usable(node: &Node, now_ns: u64) -> Verdict {
    let Some(scan) = node.scan() else { return Verdict::new(Severity::Bad, "NO SCAN yet") };
    let (index, age) = (scan.header.scan_index, age(node, now_ns));
    let reported = node.heartbeat().map_or(HealthLevel::Ok, |(heartbeat, _)| heartbeat.health.level);
    match scan.header.health.max(reported) {
        HealthLevel::Ok => Verdict::new(Severity::Good, format!("USABLE: scan {index}, {age} old")),
        HealthLevel::Degraded => Verdict::new(Severity::Care, format!("WITH CARE: scan {index}, {age} old, degraded")),
        HealthLevel::Blind => {
            Verdict::new(Severity::Bad, "BLIND: the cells say nothing").hint("See the reasons under health.")
        }
        HealthLevel::Fault => {
            Verdict::new(Severity::Bad, "FAULT: the cells say nothing").hint("See the reasons under health.")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Speaker, node};
    use super::*;
    use fencepost_core::wire::BaseId;

    fn said(speaker: &mut Speaker, now_ns: u64) -> Verdict {
        let mut listener = Listener::new(BaseId::DEFAULT, None);
        for frame in speaker.heartbeat().iter().chain(&speaker.scan()) {
            listener.take(frame, 0);
        }
        of_node(&listener.nodes()[&node(0)], now_ns)
    }

    #[test]
    fn the_verdict_is_that_of_a_careful_controller() {
        let good = said(&mut Speaker::new(0), 5_000_000);
        assert_eq!((good.severity, good.text.as_str()), (Severity::Good, "USABLE: scan 0, 50 ms old"));
        let mut degraded = Speaker::new(0);
        degraded.degrade();
        assert_eq!(said(&mut degraded, 0).severity, Severity::Care);
        assert!(said(&mut Speaker::new(0), 2_000_000_000).text.starts_with("NO HEARTBEAT for 2.0 s"));
        let mut stopping = Speaker::new(0);
        stopping.status.state = NodeState::Stopping;
        assert_eq!(said(&mut stopping, 0).text, "NOT RUNNING: the node is stopping");
        assert_eq!(said(&mut stopping, 2_000_000_000).text, "STOPPED in an orderly way 2.0 s ago");
        let mut blind = Speaker::new(0);
        blind.status.health.level = HealthLevel::Blind;
        assert!(said(&mut blind, 0).text.starts_with("BLIND"));
    }

    #[test]
    fn a_bus_without_frames_without_nodes_or_without_interface_is_said_first() {
        let mut listener = Listener::new(BaseId::DEFAULT, None);
        let second = 1_000_000_000;
        assert_eq!(of_bus(&listener, &SourceState::Open, 0, second / 2), None);
        assert!(of_bus(&listener, &SourceState::Open, 0, 3 * second).unwrap().text.contains("for 3 s"));
        assert_eq!(of_bus(&listener, &SourceState::Open, 5 * second / 2, 3 * second), None, "it was down until now");
        listener.take(&"123#01".parse().unwrap(), 2 * second);
        assert!(of_bus(&listener, &SourceState::Open, 0, 2 * second).unwrap().text.starts_with("NO NODE: 1 frames"));
        let down = SourceState::Trouble { what: "can0 is down".into(), mend: "ip link set can0 up".into() };
        let verdict = of_bus(&listener, &down, 0, 2 * second).unwrap();
        assert_eq!((verdict.text.as_str(), verdict.hint.as_deref()), ("can0 is down", Some("ip link set can0 up")));
        listener.take(&Speaker::new(0).heartbeat()[0], 2 * second);
        assert_eq!(of_bus(&listener, &SourceState::Open, 0, 2 * second), None);
    }
}
