//! What goes to the terminal: warnings, notes and the progress bar on stderr, results on stdout.

use std::{
    fmt,
    io::{IsTerminal, Write},
    time::Duration,
};

use indicatif::{ProgressBar, ProgressStyle};

/// How often a warning of one kind is said before the rest are only counted.
const REPEATS: usize = 3;

/// The program's voice. Keeps every warning for the summary.
#[derive(Debug, Default)]
pub struct Console {
    quiet: bool,
    verbose: bool,
    warnings: Vec<WarningCount>,
    errors: Vec<String>,
    /// Counts what it would say.
    muted: bool,
    bar: Option<ProgressBar>,
}

/// One warning and how often it came.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct WarningCount {
    /// The kind, by which repeats are counted.
    #[serde(skip)]
    kind: String,
    /// The text of the first one.
    pub text: String,
    /// How often one of this kind came.
    pub count: usize,
}

impl Console {
    /// `quiet` leaves out all but errors and warnings; `verbose` adds notes.
    pub const fn new(quiet: bool, verbose: bool) -> Self {
        Self { quiet, verbose, warnings: Vec::new(), errors: Vec::new(), muted: false, bar: None }
    }

    /// A voice for work that is done again: it shows progress, and counts warnings and errors without saying them.
    pub const fn muted(&self) -> Self {
        let mut muted = Self::new(self.quiet, self.verbose);
        muted.muted = true;
        muted
    }

    /// Says a warning. Of one `kind` the first few are said, all are counted.
    pub fn warn_of_kind(&mut self, kind: &str, text: impl fmt::Display) {
        let count = match self.warnings.iter_mut().find(|w| w.kind == kind) {
            Some(known) => {
                known.count += 1;
                known.count
            }
            None => {
                self.warnings.push(WarningCount { kind: kind.into(), text: text.to_string(), count: 1 });
                1
            }
        };
        if count <= REPEATS {
            self.say(format_args!("warning: {text}"));
        }
        if count == REPEATS {
            self.say(format_args!("         (further warnings of this kind are only counted)"));
        }
    }

    /// Says a warning once.
    pub fn warn(&mut self, text: impl fmt::Display) {
        let text = text.to_string();
        if !self.warnings.iter().any(|w| w.text == text) {
            self.warn_of_kind(&text, &text);
        }
    }

    /// Says an error; never left out.
    pub fn error(&self, error: impl fmt::Display) {
        self.say(format_args!("error: {error}"));
    }

    /// Says an error that may come again, the first time.
    pub fn error_once(&mut self, error: impl fmt::Display) {
        let text = error.to_string();
        if !self.errors.contains(&text) {
            self.error(&text);
            self.errors.push(text);
        }
    }

    /// Says something that happened while the program runs on; not counted, and not left out when it repeats.
    pub fn event(&self, text: impl fmt::Display) {
        self.say(format_args!("{text}"));
    }

    /// Says something that only matters to who asked for it with `-v`.
    pub fn note(&self, text: impl fmt::Display) {
        if self.verbose {
            self.say(format_args!("{text}"));
        }
    }

    /// A line of the result on stdout.
    pub fn result(&self, text: impl fmt::Display) {
        if !self.quiet {
            // A closed pipe (`fencepost ... | head`) is the reader's choice and not an error.
            let _ = writeln!(std::io::stdout(), "{text}");
        }
    }

    /// Every warning so far.
    pub fn warnings(&self) -> &[WarningCount] {
        &self.warnings
    }

    /// Starts the progress bar, on a terminal only.
    pub fn start_progress(&mut self, frames: usize, what: &'static str) {
        if self.quiet || !std::io::stderr().is_terminal() {
            return;
        }
        let style = ProgressStyle::with_template("{msg} [{bar:32}] {pos}/{len} frames, {per_sec}, {eta} left")
            .map_or_else(|_| ProgressStyle::default_bar(), |style| style.progress_chars("=> "));
        let bar = ProgressBar::new(frames as u64).with_style(style).with_message(what);
        bar.enable_steady_tick(Duration::from_millis(200));
        self.bar = Some(bar);
    }

    /// One frame more is done.
    pub fn progress(&self) {
        if let Some(bar) = &self.bar {
            bar.inc(1);
        }
    }

    /// Takes the progress bar away.
    pub fn end_progress(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }

    fn say(&self, text: fmt::Arguments<'_>) {
        if self.muted {
            return;
        }
        // Whoever listens may be gone, as when the output is piped into `head`: that is no reason to stop the work.
        let write = || {
            let _ = writeln!(std::io::stderr(), "{text}");
        };
        match &self.bar {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_are_counted_by_kind_and_said_once() {
        let mut console = Console::new(true, false);
        for frame in 0..5 {
            console.warn_of_kind("wide", format!("frame {frame}: 16-bit picture"));
        }
        console.warn("times do not rise");
        console.warn("times do not rise");
        let counts: Vec<_> = console.warnings().iter().map(|w| (w.text.as_str(), w.count)).collect();
        assert_eq!(counts, [("frame 0: 16-bit picture", 5), ("times do not rise", 1)]);
    }
}
