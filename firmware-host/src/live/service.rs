//! The program as a service: signals that end it, and what systemd is told.

use std::{
    io,
    sync::{Arc, atomic::AtomicBool},
    time::Duration,
};

use sd_notify::NotifyState;

/// Sets `stop` at SIGTERM and SIGINT. A second signal ends the program at once: whoever asks twice does not want to wait.
///
/// # Errors
/// When the signals cannot be caught.
pub fn stop_at_signals(stop: &Arc<AtomicBool>) -> io::Result<()> {
    use signal_hook::{
        consts::{SIGINT, SIGTERM},
        flag,
    };
    for signal in [SIGTERM, SIGINT] {
        // In this order: the first signal finds `stop` unset and sets it.
        flag::register_conditional_shutdown(signal, 1, Arc::clone(stop))?;
        flag::register(signal, Arc::clone(stop))?;
    }
    Ok(())
}

/// The line to systemd, if the program runs under it.
#[derive(Clone, Copy, Debug)]
pub struct Systemd {
    watchdog: Option<Duration>,
}

impl Systemd {
    /// Finds out what systemd expects.
    pub fn new() -> Self {
        Self { watchdog: sd_notify::watchdog_enabled() }
    }

    /// Time after which systemd takes the program for hung, if it watches.
    pub const fn watchdog(&self) -> Option<Duration> {
        self.watchdog
    }

    /// The loop runs.
    pub fn ready(&self) {
        self.say(&[NotifyState::Ready]);
    }

    /// The loop is alive, and this is how it goes.
    pub fn alive(&self, status: &str) {
        match self.watchdog {
            Some(_) => self.say(&[NotifyState::Watchdog, NotifyState::Status(status)]),
            None => self.say(&[NotifyState::Status(status)]),
        }
    }

    /// The program is about to end.
    pub fn stopping(&self) {
        self.say(&[NotifyState::Stopping]);
    }

    fn say(&self, state: &[NotifyState<'_>]) {
        // Where nobody listens there is nothing to mend: without systemd the call does nothing at all.
        let _ = sd_notify::notify(state);
    }
}

impl Default for Systemd {
    fn default() -> Self {
        Self::new()
    }
}
