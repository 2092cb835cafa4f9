//! What a person sees, told by what is on the bus.

use std::path::Path;

use embedded_can::Id;
use fencepost_core::{
    health::{HealthLevel, HealthReason},
    wire::{Address, BaseId, ReceiverConfig, ScanReceiver},
};
use fencepost_hal::can::{CandumpLine, ControllerState, parse_candump};
use ratatui::{Terminal, backend::TestBackend, buffer::Buffer, style::Color};

use super::*;
use crate::listen::testing::{Speaker, node};

const OBSTACLE: Color = Color::Indexed(214);
const FREE: Color = Color::Indexed(25);

/// The bus log that belongs to the recording of a clone: 0.8 seconds of it, four scans and more.
fn golden() -> Vec<CandumpLine> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/recordings/trail.can.log");
    let log = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    parse_candump(&log).map(Result::unwrap).filter(|line| line.timestamp_ns <= 800_000_000).collect()
}

fn heard(lines: &[CandumpLine]) -> Listener {
    let mut listener = Listener::new(BaseId::DEFAULT, None);
    lines.iter().for_each(|line| drop(listener.take(&line.frame, line.timestamp_ns)));
    listener
}

fn view(listener: &Listener, now_ms: u64) -> View<'_> {
    View {
        listener,
        name: "can7",
        state: SourceState::Open,
        bitrate: Some(250_000),
        condition: BusCondition::default(),
        unreadable: 0,
        log: None,
        echo: None,
        node: None,
        since_ns: 0,
        open_since_ns: 0,
        now_ns: now_ms * 1_000_000,
        palette: Palette { colours: true },
    }
}

fn drawn(view: &View<'_>, width: u16, height: u16) -> Buffer {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| draw(frame, view)).unwrap();
    terminal.backend().buffer().clone()
}

fn text(buffer: &Buffer) -> String {
    let width = usize::from(buffer.area.width);
    let rows = buffer.content.chunks(width).map(|row| row.iter().map(|cell| cell.symbol()).collect::<String>());
    rows.map(|row| row.trim_end().to_owned() + "\n").collect()
}

/// Half rows of a colour in the rows of the map.
fn squares(buffer: &Buffer, colour: Color) -> usize {
    let columns = buffer.area.width - 53;
    let cells = (3..buffer.area.height - 9).flat_map(|y| (0..columns).map(move |x| (x, y)));
    cells
        .map(|place| &buffer[place])
        .map(|cell| match cell.symbol() {
            "█" => 2 * usize::from(cell.fg == colour),
            "▀" | "▄" => usize::from(cell.fg == colour) + usize::from(cell.bg == colour),
            "·" => 2 * usize::from(cell.bg == colour),
            _ => 0,
        })
        .sum()
}

fn assert_shows(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "`{word}` is missing in\n{text}");
    }
}

#[test]
fn the_golden_log_is_shown_as_the_receiver_of_the_core_understands_it() {
    let lines = golden();
    let address = Address { base: BaseId::DEFAULT, node: node(0) };
    let mut receiver = ScanReceiver::<2040>::new(ReceiverConfig::new(address));
    for line in &lines {
        let Id::Standard(id) = line.frame.id() else { panic!("{line}") };
        receiver.receive(id, line.frame.data(), line.timestamp_ns).unwrap();
    }
    let scan = receiver.scan(850_000_000).unwrap();
    let (obstacles, free): (Vec<_>, Vec<_>) = scan.cells().partition(|(.., obstacle)| *obstacle);
    let listener = heard(&lines);

    // Large enough for a half row for each cell, and for no more.
    let buffer = drawn(&view(&listener, 850), 160, 50);
    assert_eq!(squares(&buffer, OBSTACLE), obstacles.len());
    assert_eq!(squares(&buffer, FREE), free.len());
    let shown = text(&buffer);
    let counts = format!("{} obstacle, {} free", obstacles.len(), free.len());
    let usable = format!("USABLE: scan {}, {} ms old", scan.scan_index, scan.age_ns / 1_000_000);
    let ground = scan.ground.unwrap();
    let height = format!("camera {:.2} m above it", f64::from(ground.camera_height_mm) / 1000.0);
    assert_shows(&shown, &["FENCEPOST can7", "250 kbit/s", "load ≤ ", "node 0", &usable, "● OK", &counts, &height]);
    assert_shows(&shown, &["5.0/s", "running, 50 ms ago", "0 lost, 0 damaged", "20 m┤", "▲", "q quit"]);
    let numbers = shown.lines().rev().nth(1).unwrap();
    let expected: Vec<String> = scan
        .sectors
        .distance_dm
        .iter()
        .map(|dm| match dm {
            255 => "?".to_owned(),
            254 => "clr".to_owned(),
            dm if *dm < 100 => format!("{:.1}", f64::from(*dm) / 10.0),
            dm => format!("{:.0}", f64::from(*dm) / 10.0),
        })
        .collect();
    assert_eq!(numbers.split_whitespace().collect::<Vec<_>>(), expected);
}

#[test]
fn a_cell_is_where_it_belongs() {
    let mut speaker = Speaker::new(0);
    let mut listener = Listener::new(BaseId::DEFAULT, None);
    speaker.heartbeat().iter().chain(&speaker.scan()).for_each(|frame| drop(listener.take(frame, 0)));
    let shown = text(&drawn(&View { palette: Palette { colours: false }, ..view(&listener, 10) }, 80, 24));
    // Obstacles from 2 m left to 2 m right in the row from 5 to 5.5 m ahead, with a free cell at each end, and ten free ones
    // nearer.
    let rows: Vec<&str> = shown.lines().skip(3).take(16).collect();
    let place = rows.iter().position(|row| row.contains('█') || row.contains('▀') || row.contains('▄')).unwrap();
    let robot = rows.len() - 1;
    let column = |row: &str, sign: char| row.chars().position(|c| c == sign).unwrap();
    let first = rows[place].chars().position(|c| "█▀▄".contains(c)).unwrap();
    let count = rows[place].chars().filter(|c| "█▀▄".contains(*c)).count();
    // The smallest map is 10 m by 10 m: 20 cells in the 15 rows that there are, so that a half row takes 0.5 m.
    assert_eq!(count, 8, "{shown}");
    assert!((first + count / 2).abs_diff(column(rows[robot], '▲')) <= 1, "{shown}");
    assert_eq!(robot - place, 6, "{shown}");
    assert_shows(&shown, &["8 obstacle, 12 free", "held for 3 scans", "3.2", " 13 ", "clr", "50° left"]);
}

#[test]
fn everything_has_its_place_in_a_small_window_and_a_smaller_one_is_refused() {
    let listener = heard(&golden());
    for (width, height) in [(80, 24), (100, 30), (120, 40), (200, 60), (60, 16)] {
        let shown = text(&drawn(&view(&listener, 850), width, height));
        let words = ["USABLE", "HEALTH", "SCAN", "GROUND", "HEART", "FRAMES", "VEHICLE", "ECHO", "▲", "q quit"];
        assert_shows(&shown, &words);
        assert_eq!(shown.contains("SECTORS"), height >= 24);
    }
    for (width, height) in [(59, 24), (80, 15), (20, 3), (1, 1)] {
        let shown = text(&drawn(&view(&listener, 850), width, height));
        assert!(!shown.contains("HEALTH"));
    }
}

#[test]
fn a_map_that_is_not_to_be_trusted_is_grey_and_says_so() {
    let listener = heard(&golden());
    let buffer = drawn(&view(&listener, 2_000), 160, 50);
    assert_eq!((squares(&buffer, OBSTACLE), squares(&buffer, FREE)), (0, 0));
    let shown = text(&buffer);
    assert_eq!(shown.matches("NOTHING COMES: no frame on the bus for 1 s").count(), 2, "line and box: {shown}");
    assert_shows(&shown, &["120 ohms", "✖ node 0"]);

    let mut down = view(&listener, 850);
    down.state = SourceState::Trouble { what: "can7 is down".into(), mend: "sudo ip link set can7 up".into() };
    let buffer = drawn(&down, 160, 50);
    assert_eq!(squares(&buffer, OBSTACLE), 0);
    assert_shows(&text(&buffer), &["✖ can7 is down", "sudo ip link set can7 up"]);

    let nothing = Listener::new(BaseId::DEFAULT, None);
    assert_shows(
        &text(&drawn(&view(&nothing, 300), 80, 24)),
        &["waiting for the first frame", "no node heard yet, base 0x400"],
    );
}

#[test]
fn reasons_are_told_in_words_as_far_as_there_is_room() {
    let mut speaker = Speaker::new(0);
    for reason in HealthReason::ALL {
        speaker.status.health.raise(reason, HealthLevel::Degraded);
    }
    let mut listener = Listener::new(BaseId::DEFAULT, None);
    speaker.heartbeat().iter().chain(&speaker.scan()).for_each(|frame| drop(listener.take(frame, 0)));
    let small = text(&drawn(&view(&listener, 10), 80, 24));
    assert_shows(&small, &["▲ DEGRADED", "WITH CARE: scan 0", "more reasons", "ECHO"]);
    let large = text(&drawn(&view(&listener, 10), 200, 100));
    assert!(!large.contains("more reasons"));
    assert_shows(&large, &["the newest picture is too old", "the vehicle's controller no longer says"]);
}

#[test]
fn several_nodes_can_be_looked_at_and_the_bus_tells_its_troubles() {
    let (mut one, mut two) = (Speaker::new(1), Speaker::new(2));
    two.degrade();
    let mut listener = Listener::new(BaseId::DEFAULT, None);
    for frames in [one.heartbeat(), one.scan(), two.heartbeat(), two.scan(), two.commands()] {
        frames.iter().for_each(|frame| drop(listener.take(frame, 0)));
    }
    let mut view = view(&listener, 10);
    assert_shows(
        &text(&drawn(&view, 80, 24)),
        &["● node 1", "▲ node 2", "USABLE", "no scan was echoed", "Tab next node"],
    );
    view.node = Some(node(2));
    view.condition = BusCondition {
        controller: ControllerState::ErrorPassive,
        errors: 12,
        no_acknowledgement: 11,
        ..BusCondition::default()
    };
    view.echo = Some((3, 0));
    let shown = text(&drawn(&view, 100, 34));
    assert_shows(&shown, &["WITH CARE", "no ground plane found", "1.20 m/s, 3.5°/s right (us)", "scan 0 (us)"]);
    assert_shows(&shown, &["▲ error-passive", "12 errors, 11 no ack", "acting as controller"]);
}

#[test]
fn without_colours_nothing_is_told_by_colour() {
    let listener = heard(&golden());
    let buffer = drawn(&View { palette: Palette { colours: false }, ..view(&listener, 850) }, 160, 50);
    assert!(buffer.content.iter().all(|cell| (cell.fg, cell.bg) == (Color::Reset, Color::Reset)));
    let shown = text(&buffer);
    assert_shows(&shown, &["█", "▀", ":", "'"]);
    assert_shows(&shown, &["█ obstacle  : free"]);
}
