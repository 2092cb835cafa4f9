//! One time of listening: frames from the source to the listener, until it is over.

use fencepost_core::wire::{BaseId, NodeId};
use fencepost_hal::can::CanFrame;

use super::{Event, Listener, controller::Controller, source::Source, source::SourceState};

/// When listening ends by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Whole scans.
    pub scans: Option<u64>,
    /// Seconds; of a log, recorded ones.
    pub seconds: Option<f64>,
    /// Whether the end of a log is the end.
    pub end_of_log: bool,
}

/// What listens, to what, and how long.
#[derive(Debug)]
pub struct Session {
    /// What was heard.
    pub listener: Listener,
    /// Where frames come from.
    pub source: Source,
    /// Answers, if we act as a controller.
    pub controller: Option<Controller>,
    /// Bits per second that the user gave.
    pub bitrate: Option<u32>,
    /// When it began, nanoseconds.
    pub since_ns: u64,
    /// Since when frames could have come: as above, or since the interface came back.
    pub open_since_ns: u64,
    limits: Limits,
    whom: (BaseId, Option<NodeId>),
}

impl Session {
    /// Listens to `source`: to the nodes of a base, or to one of them.
    pub fn new(source: Source, whom: (BaseId, Option<NodeId>), limits: Limits) -> Self {
        let since_ns = source.now_ns();
        Self {
            listener: Listener::new(whom.0, whom.1),
            source,
            controller: None,
            bitrate: None,
            since_ns,
            open_since_ns: since_ns,
            limits,
            whom,
        }
    }

    /// The next frame and when it came; `None` if none has come yet, or it is over. It is to be [taken](Self::take) then.
    pub fn next_frame(&mut self) -> Option<(u64, CanFrame)> {
        if let Some(controller) = &mut self.controller {
            controller.tell_motion(&mut self.source, &mut self.listener);
        }
        if self.is_over() {
            return None;
        }
        let frame = self.source.next_frame();
        if self.source.is_in_trouble() {
            self.open_since_ns = self.source.now_ns();
        }
        frame
    }

    /// Takes a frame that came at `at_ns`, and answers it. Gives what it brought, where that is worth a word.
    pub fn take(&mut self, at_ns: u64, frame: &CanFrame) -> Option<(NodeId, Event)> {
        let event = self.listener.take(frame, at_ns);
        if let (Some(controller), Some((node, event))) = (&mut self.controller, &event) {
            controller.answer(*node, event, &mut self.source, &mut self.listener);
        }
        event
    }

    /// Whether it is over.
    pub fn is_over(&self) -> bool {
        let Limits { scans, seconds, end_of_log } = self.limits;
        let passed_s = self.source.now_ns().saturating_sub(self.since_ns) as f64 * 1.0e-9;
        let ended = end_of_log || scans.is_some() || seconds.is_some();
        scans.is_some_and(|scans| self.listener.scans() >= scans)
            || seconds.is_some_and(|seconds| passed_s >= seconds)
            || (ended && self.source.state() == SourceState::Ended)
    }

    /// Begins anew, as if nothing had been heard.
    pub fn forget(&mut self) {
        self.listener = Listener::new(self.whom.0, self.whom.1);
        self.since_ns = self.source.now_ns();
        self.open_since_ns = self.since_ns;
    }
}
