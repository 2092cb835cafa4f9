//! `listen`: the bus, live.

use std::{
    io::{self, BufWriter, IsTerminal, Write},
    thread,
    time::Duration,
};

use fencepost_core::wire::{BaseId, NodeId, VehicleMotionRepr};

use super::Ending;
use crate::{
    cli::ListenArgs,
    console::Console,
    error::Failure,
    listen::{
        controller::Controller,
        plain::Plain,
        session::{Limits, Session},
        source::{LogSource, Source},
        terminal,
    },
};

/// Time between two looks at a bus on which nothing came.
const WAIT: Duration = Duration::from_millis(5);

/// Shows what goes over a bus, or plays a log of one.
///
/// # Errors
/// When the log cannot be read or the terminal not be used. A bus that is down or gone is waited for.
pub fn listen(args: &ListenArgs, console: &Console) -> Result<Ending, Failure> {
    let live = !args.plain && !args.json && io::stdout().is_terminal();
    let mut session = session(args, live)?;
    let name = match (&args.log, &args.interface) {
        (Some(log), _) => log.file_name().unwrap_or(log.as_os_str()).to_string_lossy().into_owned(),
        (None, interface) => interface.clone().unwrap_or_default(),
    };
    let result = if live {
        terminal::run(&mut session, &name)
    } else {
        lines(&mut session, Plain::new(BufWriter::new(io::stdout().lock()), args.json))
    };
    match result {
        Ok(()) => {}
        // Whoever reads the lines has enough of them.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => return Ok(Ending::Good),
        Err(error) if live => {
            return Err(Failure::work(format!("the terminal cannot be used: {error}")).mend("use --plain"));
        }
        Err(error) => return Err(Failure::work(format!("the lines cannot be written: {error}"))),
    }
    if !live && session.listener.nodes().is_empty() {
        let frames = session.listener.traffic().frames();
        console.error(
            Failure::work(format!("no message of fencepost in {frames} frames"))
                .at(name)
                .mend("if the nodes have another base, give it: --base-id 0x500"),
        );
        return Ok(Ending::InputBad);
    }
    Ok(Ending::Good)
}

fn session(args: &ListenArgs, live: bool) -> Result<Session, Failure> {
    let usage = |error: &dyn std::fmt::Display, option: &str, mend: &str| {
        Failure::usage(error.to_string()).at(option).mend(mend)
    };
    let base = BaseId::new(args.base_id)
        .map_err(|error| usage(&error, "--base-id", "give the base of the sender’s settings"))?;
    let node = args
        .node
        .map(NodeId::new)
        .transpose()
        .map_err(|error| usage(&error, "--node", "give the number of the node, 0 to 15"))?;
    let source = match &args.log {
        Some(log) => {
            let speed = args.speed.unwrap_or(if live { 1.0 } else { f64::INFINITY });
            Source::Log(LogSource::open(log, args.interface.as_deref(), speed)?)
        }
        None => open(args.interface.as_deref().unwrap_or_default())?,
    };
    let limits = Limits { scans: args.count, seconds: args.seconds, end_of_log: !live };
    let mut session = Session::new(source, (base, node), limits);
    session.bitrate = args.bitrate;
    session.controller = args.echo.then(|| Controller::new(motion(args)));
    Ok(session)
}

#[cfg(target_os = "linux")]
fn open(interface: &str) -> Result<Source, Failure> {
    Ok(Source::bus(interface))
}

#[cfg(not(target_os = "linux"))]
fn open(interface: &str) -> Result<Source, Failure> {
    Err(Failure::usage("only Linux has CAN interfaces that can be listened to")
        .at(interface)
        .mend("give a log in candump’s format: --log can.log"))
}

fn motion(args: &ListenArgs) -> VehicleMotionRepr {
    let hundredths = |value: f64, factor: f64| (value * factor).round().clamp(-32_768.0, 32_767.0) as i16;
    VehicleMotionRepr {
        speed_mm_per_s: Some(hundredths(args.speed_m_per_s, 1_000.0)),
        yaw_rate_cdeg_per_s: Some(hundredths(args.yaw_rate_deg_per_s, 100.0)),
    }
}

fn lines<W: Write>(session: &mut Session, mut plain: Plain<W>) -> io::Result<()> {
    loop {
        let mut quiet = true;
        while let Some((at_ns, frame)) = session.next_frame() {
            quiet = false;
            // What was missing until now is said before what has come.
            plain.look(&session.listener, &session.source.state(), session.open_since_ns, at_ns)?;
            if let Some((node, event)) = session.take(at_ns, &frame) {
                plain.event(node, &event, at_ns)?;
            }
        }
        plain.look(&session.listener, &session.source.state(), session.open_since_ns, session.source.now_ns())?;
        if session.is_over() {
            return plain.finish(&session.listener, &session.source);
        }
        if quiet {
            plain.flush()?;
            thread::sleep(WAIT);
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::{
        cli::{Cli, Command},
        listen::testing::Speaker,
    };

    fn args(words: &[&str]) -> ListenArgs {
        let words = ["fencepost", "listen"].iter().chain(words);
        let Some(Command::Listen(args)) = Cli::try_parse_from(words).unwrap().command else { panic!("not listen") };
        args
    }

    /// What is said of a log.
    fn said(log: &str, words: &[&str]) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("can.log");
        std::fs::write(&path, log).unwrap();
        let words: Vec<&str> = ["--log", path.to_str().unwrap()].iter().chain(words).copied().collect();
        let args = args(&words);
        let mut session = session(&args, false).unwrap();
        let mut out = Vec::new();
        lines(&mut session, Plain::new(&mut out, args.json)).unwrap();
        String::from_utf8(out).unwrap()
    }

    /// A second of a node: a heartbeat and a scan each 100 ms; degraded from the sixth on. Then nothing for two seconds but
    /// frames of others, then one more.
    fn log() -> String {
        let mut speaker = Speaker::new(3);
        let mut log = String::new();
        let mut add = |ms: u64, frames: &[fencepost_hal::can::CanFrame]| {
            for frame in frames {
                log.push_str(&format!("({}.{:03}000) can0 {frame}\n", ms / 1000, ms % 1000));
            }
        };
        for tenth in 0..10 {
            if tenth == 5 {
                speaker.degrade();
            }
            add(10_000 + tenth * 100, &speaker.heartbeat());
            add(10_000 + tenth * 100, &speaker.scan());
        }
        (11..30).for_each(|tenth| add(10_000 + tenth * 100, &["123#01".parse().unwrap()]));
        add(13_000, &speaker.heartbeat());
        add(13_000, &speaker.scan());
        log
    }

    #[test]
    fn every_scan_and_every_change_has_a_line() {
        let text = said(&log(), &[]);
        let lines = |what: &str| text.lines().filter(|line| line.contains(what)).count();
        assert_eq!(lines(" scan      "), 11, "{text}");
        assert_eq!(lines(" heartbeat "), 2, "{text}");
        assert!(text.contains("degraded: no ground plane found; the vehicle's controller no longer says"), "{text}");
        assert!(text.contains("8 obstacle cells, the nearest 5.2") && text.contains("45 ms old; ground 1.28 m below"));
        assert!(text.contains("node 3  verdict   NO HEARTBEAT for 0.4 s"), "{text}");
        assert_eq!(lines("a controller may drive by its scans"), 2, "at first and after the silence: {text}");
        assert!(
            text.contains("node 3: 11 scans, 11 heartbeats; 0 scans given up, 0 missed; messages: 0 lost"),
            "{text}"
        );
    }

    #[test]
    fn a_silence_of_the_whole_bus_is_said_by_the_time_of_the_next_frame() {
        let log: String = log().lines().filter(|line| !line.contains("123#")).map(|line| format!("{line}\n")).collect();
        let text = said(&log, &[]);
        assert!(text.contains("13.000000 bus     bus       NOTHING COMES: no frame on the bus for 2 s"), "{text}");
        assert!(text.contains("13.000000 node 3  verdict   NO HEARTBEAT for 2.1 s"), "{text}");
        assert!(text.contains("frames come again"), "{text}");
    }

    #[test]
    fn lines_of_json_hold_the_same() {
        let values: Vec<serde_json::Value> =
            said(&log(), &["--json"]).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        let of = |what: &str| values.iter().filter(|value| value["message"] == what).collect::<Vec<_>>();
        assert_eq!((of("scan").len(), of("heartbeat").len()), (11, 2));
        assert_eq!(of("heartbeat")[1]["reasons"], serde_json::json!(["no_ground", "echo_missing"]));
        assert_eq!(of("scan")[0]["sectors_dm"][2], 32);
        let objections: Vec<_> = of("verdict").iter().map(|value| value["objection"].as_str()).collect();
        assert_eq!(objections, [None, Some("no_heartbeat"), Some("too_old"), None]);
        let summary = &values.last().unwrap()["summary"];
        assert_eq!((summary["nodes"][0]["scans"].as_u64(), summary["of_others"].as_u64()), (Some(11), Some(19)));
    }

    #[test]
    fn listening_ends_after_so_many_scans_or_seconds() {
        let scans = |words: &[&str]| said(&log(), words).lines().filter(|line| line.contains(" scan      ")).count();
        assert_eq!(scans(&["--count", "4"]), 4);
        assert_eq!(scans(&["--seconds", "0.45"]), 5);
        assert_eq!(scans(&["--node", "2"]), 0);
    }

    #[test]
    fn the_motion_that_is_told_is_the_one_that_was_asked_for() {
        let args = args(&["can0", "--echo", "--speed-m-per-s", "1.25", "--yaw-rate-deg-per-s=-3.5"]);
        let expected = VehicleMotionRepr { speed_mm_per_s: Some(1_250), yaw_rate_cdeg_per_s: Some(-350) };
        assert_eq!(motion(&args), expected);
        assert!(Cli::try_parse_from(["fencepost", "listen"]).is_err(), "neither interface nor log");
        assert!(
            Cli::try_parse_from(["fencepost", "listen", "--log", "x", "--echo"]).is_err(),
            "a log cannot be answered"
        );
    }
}
