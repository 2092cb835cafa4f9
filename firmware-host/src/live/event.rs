//! What the threads of the loop have to tell: kept in a table of fixed size until the main thread says it.

use std::{
    fmt::{self, Write as _},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
};

use heapless::{Deque, String};

/// Longest text of an event, bytes. What is longer is cut off.
const TEXT_BYTES: usize = 600;
/// Events that wait to be said. Those that find no room are counted.
const WAITING: usize = 64;

/// Something that happened in the loop.
#[derive(Clone, Debug)]
pub struct Event {
    /// When, nanoseconds of the monotonic clock.
    pub at_ns: u64,
    /// Whether it is bad.
    pub severity: Severity,
    /// What happened, and the mend where there is one.
    pub text: String<TEXT_BYTES>,
}

/// How bad an event is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Good to know.
    Note,
    /// Something does not work.
    Warning,
}

/// The events that wait to be said.
#[derive(Debug, Default)]
pub(super) struct Events {
    waiting: Mutex<Deque<Event, WAITING>>,
    dropped: AtomicU64,
}

impl Events {
    /// Takes no memory; drops the event where the main thread is far behind.
    pub(super) fn tell(&self, at_ns: u64, severity: Severity, text: fmt::Arguments<'_>) {
        let mut event = Event { at_ns, severity, text: String::new() };
        let _ = write!(Cutter(&mut event.text), "{text}");
        // The main thread holds the table for a moment at a time, but may be held up itself meanwhile: a thread of the loop does
        // not wait for it.
        let kept = self.waiting.try_lock().is_ok_and(|mut waiting| waiting.push_back(event).is_ok());
        if !kept {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// The event that waits longest.
    pub(super) fn next(&self) -> Option<Event> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }

    /// Events that were dropped so far.
    pub(super) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }
}

/// Keeps what fits, at a whole character.
struct Cutter<'a>(&'a mut String<TEXT_BYTES>);

impl fmt::Write for Cutter<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let room = self.0.capacity() - self.0.len();
        self.0.push_str(&text[..text.floor_char_boundary(room)]).map_err(|_| fmt::Error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_are_cut_and_full_tables_count() {
        let events = Events::default();
        events.tell(1, Severity::Note, format_args!("{}", "é".repeat(TEXT_BYTES)));
        for at_ns in 2..100 {
            events.tell(at_ns, Severity::Warning, format_args!("event {at_ns}"));
        }
        let first = events.next().unwrap();
        assert_eq!((first.text.len(), first.severity), (TEXT_BYTES, Severity::Note));
        assert_eq!(events.next().unwrap().text, "event 2");
        assert_eq!(events.dropped(), 99 - WAITING as u64);
        assert_eq!(std::iter::from_fn(|| events.next()).count(), WAITING - 2);
    }
}
