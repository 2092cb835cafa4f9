//! Colours and signs.
//!
//! Every meaning has a sign or a word besides its colour. The colours differ in lightness as well as in hue, orange for what stands
//! and blue for what is free, so that they can be told apart with every kind of colour blindness; they are those of the 256
//! colours that all terminals have.

use fencepost_core::health::HealthLevel;
use ratatui::style::{Color, Modifier, Style};

use crate::listen::verdict::Severity;

/// Colours, or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Palette {
    /// Without, everything is told by signs.
    pub colours: bool,
}

impl Palette {
    /// Colours, unless the user does not want any (<https://no-color.org>).
    pub fn from_environment() -> Self {
        Self { colours: std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty()) }
    }

    const fn indexed(self, index: u8) -> Style {
        if self.colours { Style::new().fg(Color::Indexed(index)) } else { Style::new() }
    }

    /// What is less important.
    pub const fn faint(self) -> Style {
        if self.colours { self.indexed(245) } else { Style::new().add_modifier(Modifier::DIM) }
    }

    /// Headings.
    pub const fn heading(self) -> Style {
        self.indexed(110).add_modifier(Modifier::BOLD)
    }

    /// Something stands there.
    pub const fn obstacle(self) -> Style {
        self.indexed(214)
    }

    /// Nothing stands there.
    pub const fn free(self) -> Style {
        self.indexed(39)
    }

    /// Colours of the map's squares: obstacle, free, unknown. Grey if the map is not to be trusted.
    pub const fn squares(self, trusted: bool) -> [Color; 3] {
        match trusted {
            true => [Color::Indexed(214), Color::Indexed(25), Color::Indexed(234)],
            false => [Color::Indexed(250), Color::Indexed(240), Color::Indexed(234)],
        }
    }

    /// The robot.
    pub const fn robot(self) -> Style {
        self.indexed(231).add_modifier(Modifier::BOLD)
    }

    /// A line that says how it stands.
    pub const fn banner(self, severity: Severity) -> Style {
        let style = Style::new().add_modifier(Modifier::BOLD);
        match (self.colours, severity) {
            (true, Severity::Good) => style.fg(Color::Indexed(231)).bg(Color::Indexed(24)),
            (true, Severity::Care) => style.fg(Color::Indexed(16)).bg(Color::Indexed(220)),
            (true, Severity::Bad) => style.fg(Color::Indexed(231)).bg(Color::Indexed(124)),
            (false, Severity::Good) => style,
            (false, _) => style.add_modifier(Modifier::REVERSED),
        }
    }

    /// A word that says how it stands.
    pub const fn word(self, severity: Severity) -> Style {
        match severity {
            Severity::Good => self.indexed(39),
            Severity::Care => self.indexed(220).add_modifier(Modifier::BOLD),
            Severity::Bad => self.indexed(203).add_modifier(Modifier::BOLD),
        }
    }
}

/// The sign of a severity.
pub(super) const fn sign(severity: Severity) -> &'static str {
    match severity {
        Severity::Good => "●",
        Severity::Care => "▲",
        Severity::Bad => "✖",
    }
}

/// How bad a level is.
pub(super) const fn severity(level: HealthLevel) -> Severity {
    match level {
        HealthLevel::Ok => Severity::Good,
        HealthLevel::Degraded => Severity::Care,
        HealthLevel::Blind | HealthLevel::Fault => Severity::Bad,
    }
}
