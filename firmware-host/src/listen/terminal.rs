//! The live view in a terminal: keys in, pictures out.

use std::{
    io,
    time::{Duration, Instant},
};

use fencepost_core::wire::NodeId;
use ratatui::{
    DefaultTerminal,
    crossterm::event::{self, Event as TerminalEvent, KeyCode, KeyEvent, KeyEventKind, KeyModifiers},
};

use super::{
    Listener, Session,
    screen::{self, Palette, View},
};

/// Time between two pictures.
const PICTURE: Duration = Duration::from_millis(50);
/// Longest time that a key is waited for: frames are fetched as often.
const WAIT: Duration = Duration::from_millis(10);

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wish {
    Nothing,
    Quit,
    Next(isize),
    Hold,
    Again,
    Faster(f64),
}

/// Shows what is heard until the user or the session ends it.
///
/// # Errors
/// When the terminal cannot be used.
pub fn run(session: &mut Session, name: &str) -> io::Result<()> {
    let mut terminal = ratatui::try_init()?;
    let result = show(&mut terminal, session, name);
    let restored = ratatui::try_restore();
    result.and(restored)
}

fn show(terminal: &mut DefaultTerminal, session: &mut Session, name: &str) -> io::Result<()> {
    let palette = Palette::from_environment();
    let mut node = None;
    let mut next_picture = Instant::now();
    loop {
        while let Some((at_ns, frame)) = session.next_frame() {
            session.take(at_ns, &frame);
        }
        let over = session.is_over();
        if Instant::now() >= next_picture || over {
            next_picture = Instant::now() + PICTURE;
            terminal.draw(|frame| screen::draw(frame, &view(session, name, node, palette)))?;
        }
        if over {
            return Ok(());
        }
        if !event::poll(WAIT)? {
            continue;
        }
        let wish = match event::read()? {
            TerminalEvent::Key(key) => wish(key),
            // A new size is drawn at once.
            TerminalEvent::Resize(..) => {
                next_picture = Instant::now();
                Wish::Nothing
            }
            _ => Wish::Nothing,
        };
        match wish {
            Wish::Quit => return Ok(()),
            Wish::Next(steps) => node = next(&session.listener, node, steps),
            Wish::Nothing | Wish::Hold | Wish::Again | Wish::Faster(_) => play(session, wish),
        }
    }
}

fn view<'a>(session: &'a Session, name: &'a str, node: Option<NodeId>, palette: Palette) -> View<'a> {
    let source = &session.source;
    let now_ns = source.now_ns();
    View {
        listener: &session.listener,
        name,
        state: source.state(),
        bitrate: session.bitrate.or(source.bitrate()),
        condition: source.condition(),
        unreadable: source.unreadable(),
        log: source.as_log().map(|log| {
            let (at_ns, all_ns) = log.progress();
            (at_ns as f64 * 1.0e-9, all_ns as f64 * 1.0e-9, log.speed())
        }),
        echo: session.controller.as_ref().map(super::controller::Controller::counts),
        node,
        since_ns: session.since_ns,
        open_since_ns: session.open_since_ns,
        now_ns,
        palette,
    }
}

fn wish(key: KeyEvent) -> Wish {
    if key.kind == KeyEventKind::Release {
        return Wish::Nothing;
    }
    match key.code {
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => Wish::Quit,
        KeyCode::Char('q') | KeyCode::Esc => Wish::Quit,
        KeyCode::Tab | KeyCode::Right | KeyCode::Down => Wish::Next(1),
        KeyCode::BackTab | KeyCode::Left | KeyCode::Up => Wish::Next(-1),
        KeyCode::Char(' ') => Wish::Hold,
        KeyCode::Char('r') => Wish::Again,
        KeyCode::Char('+' | '=') => Wish::Faster(2.0),
        KeyCode::Char('-') => Wish::Faster(0.5),
        _ => Wish::Nothing,
    }
}

/// What can be done with a log only.
fn play(session: &mut Session, wish: Wish) {
    let Some(log) = session.source.log_mut() else { return };
    match wish {
        Wish::Hold => log.pause(),
        Wish::Again => {
            log.restart();
            session.forget();
        }
        Wish::Faster(factor) => {
            let speed = log.speed() * factor;
            log.set_speed(speed.clamp(1.0 / 16.0, 64.0));
        }
        Wish::Nothing | Wish::Quit | Wish::Next(_) => {}
    }
}

/// The node `steps` behind the one that is looked at, around and around.
fn next(listener: &Listener, node: Option<NodeId>, steps: isize) -> Option<NodeId> {
    let nodes: Vec<NodeId> = listener.nodes().keys().copied().collect();
    let count = isize::try_from(nodes.len()).ok().filter(|count| *count > 0)?;
    let place = nodes.iter().position(|id| Some(*id) == node).unwrap_or(0);
    nodes.get((place as isize + steps).rem_euclid(count) as usize).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::listen::{
        session::Limits,
        source::{LogSource, Source, SourceState},
        testing::{Speaker, node},
    };
    use fencepost_core::wire::BaseId;

    #[test]
    fn keys_do_what_the_last_line_says() {
        let press = |code| wish(KeyEvent::new(code, KeyModifiers::NONE));
        for code in [KeyCode::Char('q'), KeyCode::Esc] {
            assert_eq!(press(code), Wish::Quit);
        }
        assert_eq!(wish(KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL)), Wish::Quit);
        assert_eq!((press(KeyCode::Tab), press(KeyCode::BackTab)), (Wish::Next(1), Wish::Next(-1)));
        assert_eq!((press(KeyCode::Char('c')), press(KeyCode::Enter)), (Wish::Nothing, Wish::Nothing));
        assert_eq!(press(KeyCode::Char('+')), Wish::Faster(2.0));
    }

    #[test]
    fn nodes_are_gone_through_around_and_around() {
        let mut listener = Listener::new(BaseId::DEFAULT, None);
        assert_eq!(next(&listener, None, 1), None);
        for number in [1, 5, 9] {
            listener.take(&Speaker::new(number).heartbeat()[0], 0);
        }
        let seen: Vec<u8> = std::iter::successors(next(&listener, None, 1), |node| next(&listener, Some(*node), 1))
            .map(NodeId::get)
            .take(4)
            .collect();
        assert_eq!(seen, [5, 9, 1, 5], "the first is shown to begin with");
        assert_eq!(next(&listener, Some(node(1)), -1), Some(node(9)));
    }

    #[test]
    fn a_log_that_is_played_again_is_heard_anew() {
        let mut speaker = Speaker::new(0);
        let frames: Vec<_> = speaker.heartbeat().into_iter().chain(speaker.scan()).collect();
        let log: String = frames.iter().map(|frame| format!("(5.000000) can0 {frame}\n")).collect();
        let source = Source::Log(LogSource::new(log.as_bytes(), None, 1.0));
        let mut session = Session::new(source, (BaseId::DEFAULT, None), Limits::default());
        for _ in 0..2 {
            while let Some((at_ns, frame)) = session.next_frame() {
                session.take(at_ns, &frame);
            }
            assert_eq!((session.listener.scans(), session.source.state()), (1, SourceState::Ended));
            assert!(!session.is_over(), "the last picture stays until the user has seen it");
            play(&mut session, Wish::Again);
            assert_eq!(session.listener.scans(), 0);
        }
        play(&mut session, Wish::Faster(1e9));
        assert_eq!(session.source.as_log().unwrap().speed(), 64.0);
    }
}
