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
    Listener, Watch,
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

/// Shows what is heard until the user or the watch ends it.
///
/// # Errors
/// When the terminal cannot be used.
pub fn run(watch: &mut Watch, name: &str) -> io::Result<()> {
    let mut terminal = ratatui::try_init()?;
    let result = show(&mut terminal, watch, name);
    let restored = ratatui::try_restore();
    result.and(restored)
}

fn show(terminal: &mut DefaultTerminal, watch: &mut Watch, name: &str) -> io::Result<()> {
    let palette = Palette::from_environment();
    let mut node = None;
    let mut next_picture = Instant::now();
    loop {
        while let Some((at_ns, frame)) = watch.next_frame() {
            watch.take(at_ns, &frame);
        }
        let over = watch.is_over();
        if Instant::now() >= next_picture || over {
            next_picture = Instant::now() + PICTURE;
            terminal.draw(|frame| screen::draw(frame, &view(watch, name, node, palette)))?;
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
            Wish::Next(steps) => node = next(&watch.listener, node, steps),
            Wish::Nothing | Wish::Hold | Wish::Again | Wish::Faster(_) => play(watch, wish),
        }
    }
}

fn view<'a>(watch: &'a Watch, name: &'a str, node: Option<NodeId>, palette: Palette) -> View<'a> {
    let source = &watch.source;
    let now_ns = source.now_ns();
    View {
        listener: &watch.listener,
        name,
        state: source.state(),
        bitrate: watch.bitrate.or(source.bitrate()),
        condition: source.condition(),
        unreadable: source.unreadable(),
        log: source.as_log().map(|log| {
            let (at_ns, all_ns) = log.progress();
            (at_ns as f64 * 1.0e-9, all_ns as f64 * 1.0e-9, log.speed())
        }),
        echo: watch.controller.as_ref().map(super::controller::Controller::counts),
        node,
        since_ns: watch.since_ns,
        open_since_ns: watch.open_since_ns,
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
fn play(watch: &mut Watch, wish: Wish) {
    let Some(log) = watch.source.log_mut() else { return };
    match wish {
        Wish::Hold => log.pause(),
        Wish::Again => {
            log.restart();
            watch.forget();
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
        source::{LogSource, Source, SourceState},
        testing::{Speaker, node},
        watch::Limits,
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
        let mut watch = Watch::new(source, (BaseId::DEFAULT, None), Limits::default());
        for _ in 0..2 {
            while let Some((at_ns, frame)) = watch.next_frame() {
                watch.take(at_ns, &frame);
            }
            assert_eq!((watch.listener.scans(), watch.source.state()), (1, SourceState::Ended));
            assert!(!watch.is_over(), "the last picture stays until the user has seen it");
            play(&mut watch, Wish::Again);
            assert_eq!(watch.listener.scans(), 0);
        }
        play(&mut watch, Wish::Faster(1e9));
        assert_eq!(watch.source.as_log().unwrap().speed(), 64.0);
    }
}
