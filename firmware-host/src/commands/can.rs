//! `can decode`: a CAN log as text.

mod messages;

use std::{
    collections::BTreeMap,
    fs,
    io::{self, BufWriter, Write},
};

use embedded_can::{Id, StandardId};
use fencepost_core::wire::{Address, BaseId, CounterCheck, NodeId, Packet, PacketError, Step};
use fencepost_hal::can::{CandumpLine, parse_candump};
use serde_json::json;

use super::Ending;
use crate::{
    cli::DecodeArgs,
    console::Console,
    error::Failure,
    scans::{Outcome, ScanAssembly},
};
use messages::Decoded;

/// What was found in a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
struct Counts {
    messages: u64,
    other_frames: u64,
    scans: u64,
    unreadable_lines: u64,
    crc_errors: u64,
    refused: u64,
    lost: u64,
    repeated: u64,
    abandoned_scans: u64,
}

impl Counts {
    const fn faults(&self) -> u64 {
        self.unreadable_lines + self.crc_errors + self.refused + self.lost + self.repeated + self.abandoned_scans
    }
}

/// Shows a log message by message, with every fault that its checks find.
///
/// # Errors
/// When the log cannot be read.
pub fn decode(args: &DecodeArgs, console: &Console) -> Result<Ending, Failure> {
    let log = fs::read(&args.log).map_err(|error| {
        Failure::work(format!("the CAN log cannot be read: {error}"))
            .at(args.log.display().to_string())
            .mend("give a log in candump’s format, such as the can.log of a replay")
    })?;
    let base = BaseId::new(args.base_id).map_err(|error| {
        Failure::usage(error.to_string()).at("--base-id").mend("give the base of the sender’s settings")
    })?;
    let mut decoder = Decoder::new(args, base, BufWriter::new(io::stdout().lock()));
    match decoder.run(&log) {
        Ok(()) => {}
        // Whoever reads the text has enough of it: `fencepost can decode can.log | head`.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => return Ok(Ending::Good),
        Err(error) => return Err(Failure::work(format!("the text cannot be written: {error}"))),
    }
    let counts = decoder.counts;
    if counts.messages == 0 && counts.faults() == 0 {
        console.error(
            Failure::work(format!("no message of fencepost in {} frames", counts.other_frames))
                .at(args.log.display().to_string())
                .mend("if the nodes have another base, give it: --base-id 0x500"),
        );
        return Ok(Ending::InputBad);
    }
    Ok(if counts.faults() == 0 { Ending::Good } else { Ending::InputBad })
}

struct Decoder<'a, W> {
    args: &'a DecodeArgs,
    base: BaseId,
    out: W,
    counters: BTreeMap<u16, CounterCheck>,
    scans: BTreeMap<NodeId, ScanAssembly>,
    counts: Counts,
}

impl<'a, W: Write> Decoder<'a, W> {
    fn new(args: &'a DecodeArgs, base: BaseId, out: W) -> Self {
        Self { args, base, out, counters: BTreeMap::new(), scans: BTreeMap::new(), counts: Counts::default() }
    }

    fn run(&mut self, log: &[u8]) -> io::Result<()> {
        for line in parse_candump(log) {
            match line {
                Ok(line) => self.line(&line)?,
                Err(error) => {
                    self.counts.unreadable_lines += 1;
                    let text = error.to_string();
                    self.fault(None, &text)?;
                }
            }
        }
        self.finish()
    }

    fn line(&mut self, line: &CandumpLine) -> io::Result<()> {
        let Some((id, address)) = self.address(line) else {
            self.counts.other_frames += 1;
            return Ok(());
        };
        if self.args.node.is_some_and(|node| node != address.node.get()) {
            return Ok(());
        }
        let packet = match Packet::check(address, id, line.frame.data()) {
            None => {
                self.counts.other_frames += 1;
                return Ok(());
            }
            Some(Ok(packet)) => packet,
            Some(Err(error)) => {
                match error {
                    PacketError::WrongCrc => self.counts.crc_errors += 1,
                    _ => self.counts.refused += 1,
                }
                // The receiver has to know, so that it does not take the scan for whole.
                self.assemble(address.node, id, line, None);
                return self.fault(Some(line), &error.to_string());
            }
        };
        match self.counters.entry(id.as_raw()).or_default().step(&packet) {
            Step::First | Step::Next => {}
            Step::Repeated => {
                self.counts.repeated += 1;
                self.fault(Some(line), "the message came twice")?;
            }
            Step::Lost(count) => {
                self.counts.lost += u64::from(count);
                self.fault(Some(line), &format!("{count} messages or more are missing before this one"))?;
            }
        }
        match Decoded::new(&packet) {
            Ok(decoded) => {
                self.counts.messages += 1;
                self.message(line, address, packet.counter(), &decoded)?;
            }
            Err(error) => {
                self.counts.refused += 1;
                self.fault(Some(line), &error.to_string())?;
            }
        }
        self.scan(line, address.node, id, &packet)
    }

    /// The address that the frame's identifier belongs to.
    fn address(&self, line: &CandumpLine) -> Option<(StandardId, Address)> {
        let Id::Standard(id) = line.frame.id() else { return None };
        if line.frame.is_remote() || id.as_raw() & 0x700 != self.base.get() {
            return None;
        }
        let node = NodeId::new((id.as_raw() >> 4 & 0xF) as u8).ok()?;
        Some((id, Address { base: self.base, node }))
    }

    fn message(&mut self, line: &CandumpLine, address: Address, counter: u8, decoded: &Decoded) -> io::Result<()> {
        if self.args.json {
            let mut object = json!({
                "time_s": seconds(line),
                "interface": line.interface,
                "node": address.node.get(),
                "message": decoded.name,
                "counter": counter,
            });
            if let (Some(object), Some(fields)) = (object.as_object_mut(), decoded.fields.as_object()) {
                object.extend(fields.clone());
            }
            return writeln!(self.out, "{object}");
        }
        if self.args.map {
            return Ok(());
        }
        let Decoded { name, text, .. } = decoded;
        writeln!(self.out, "{:>16} {} node {:<2} {name:<13} {text}", time(line), line.interface, address.node.get())
    }

    fn scan(&mut self, line: &CandumpLine, node: NodeId, id: StandardId, packet: &Packet<'_>) -> io::Result<()> {
        let whole = match self.assemble(node, id, line, Some(packet)) {
            Outcome::Quiet => return Ok(()),
            Outcome::GivenUp(reason) => {
                self.counts.abandoned_scans += 1;
                return self.fault(Some(line), &format!("the scan is given up: {reason}"));
            }
            Outcome::Whole(whole) => whole,
        };
        self.counts.scans += 1;
        if self.args.json {
            return writeln!(self.out, "{}", whole.json(seconds(line), node.get()));
        }
        let (time, interface, node) = (time(line), &line.interface, node.get());
        writeln!(self.out, "{time:>16} {interface} node {node:<2} {:<13} {}", "whole scan", whole.text())?;
        if self.args.map { writeln!(self.out, "{}\n", whole.map()) } else { Ok(()) }
    }

    fn assemble(&mut self, node: NodeId, id: StandardId, line: &CandumpLine, packet: Option<&Packet<'_>>) -> Outcome {
        let assembly = self.scans.entry(node).or_insert_with(|| ScanAssembly::new(Address { base: self.base, node }));
        assembly.receive(id, line.frame.data(), line.timestamp_ns, packet)
    }

    fn fault(&mut self, line: Option<&CandumpLine>, what: &str) -> io::Result<()> {
        if self.args.json {
            let frame = line.map(|line| line.frame.to_string());
            return writeln!(self.out, "{}", json!({"time_s": line.map(seconds), "error": what, "frame": frame}));
        }
        match line {
            Some(line) => {
                writeln!(
                    self.out,
                    "{:>16} {} {:<7} {:<13} {what}: {}",
                    time(line),
                    line.interface,
                    "",
                    "ERROR",
                    line.frame
                )
            }
            None => writeln!(self.out, "{:>16} {:<13} {what}", "", "ERROR"),
        }
    }

    fn finish(&mut self) -> io::Result<()> {
        let Counts { messages, other_frames, scans, .. } = self.counts;
        if self.args.json {
            writeln!(self.out, "{}", json!({"summary": self.counts}))?;
        } else {
            let Counts { unreadable_lines, crc_errors, refused, lost, repeated, abandoned_scans, .. } = self.counts;
            writeln!(self.out, "\n{messages} messages, {scans} whole scans, {other_frames} frames of others")?;
            writeln!(
                self.out,
                "{crc_errors} with a wrong checksum, {refused} refused, {lost} missing, {repeated} repeated, \
                 {abandoned_scans} scans given up, {unreadable_lines} lines unreadable"
            )?;
        }
        self.out.flush()
    }
}

fn seconds(line: &CandumpLine) -> f64 {
    line.timestamp_ns as f64 * 1.0e-9
}

fn time(line: &CandumpLine) -> String {
    let micros = line.timestamp_ns / 1_000;
    format!("{}.{:06}", micros / 1_000_000, micros % 1_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(log: &str, json: bool) -> (Counts, String) {
        let args = DecodeArgs { log: "log".into(), json, map: false, node: None, base_id: 0x400 };
        let mut out = Vec::new();
        let mut decoder = Decoder::new(&args, BaseId::DEFAULT, &mut out);
        decoder.run(log.as_bytes()).unwrap();
        let counts = decoder.counts;
        (counts, String::from_utf8(out).unwrap())
    }

    /// The log of two scans of a made-up frame.
    fn log() -> String {
        use crate::{can_log::CanLog, output::OutputFolder, view::testing::MadeUp};
        let folder = tempfile::tempdir().unwrap();
        let out = OutputFolder::open(folder.path()).unwrap();
        let mut can = CanLog::create(Some(&out), fencepost_core::wire::WireConfig::default()).unwrap();
        MadeUp::new().view(|view| {
            can.scan(view).unwrap();
            can.scan(&crate::view::FrameView { number: 8, timestamp_ns: 1_600_000_000, ..*view }).unwrap();
        });
        can.finish().unwrap();
        fs::read_to_string(folder.path().join("can.log")).unwrap()
    }

    #[test]
    fn a_good_log_is_decoded_without_a_fault() {
        let (counts, text) = run(&log(), false);
        assert_eq!((counts.scans, counts.faults()), (2, 0), "{text}");
        assert!(text.contains("Heartbeat") && text.contains("stopping"), "{text}");
        let (_, json) = run(&log(), true);
        let scans: Vec<serde_json::Value> = json
            .lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .filter(|value: &serde_json::Value| value["message"] == "scan")
            .collect();
        let obstacles = scans[0]["cells"].as_array().unwrap().iter().filter(|c| c["state"] == "obstacle").count();
        assert_eq!(obstacles, 8);
    }

    #[test]
    fn every_kind_of_damage_is_counted() {
        let log = log();
        let lines: Vec<&str> = log.lines().collect();
        // The second cell frame: before the first one nothing can be missed.
        let cells = 1 + lines.iter().position(|line| line.contains(" 402#")).unwrap();

        let mut flipped = lines.clone();
        let damaged = match lines[cells].strip_suffix('0') {
            Some(rest) => format!("{rest}1"),
            None => format!("{}0", &lines[cells][..lines[cells].len() - 1]),
        };
        flipped[cells] = &damaged;
        let (counts, text) = run(&flipped.join("\n"), false);
        assert_eq!((counts.crc_errors, counts.scans), (1, 1), "{text}");

        let mut short = lines.clone();
        short.remove(cells);
        let (counts, text) = run(&short.join("\n"), false);
        assert!(counts.lost >= 1 && counts.abandoned_scans == 1 && counts.scans == 1, "{text}");

        let mut doubled = lines.clone();
        doubled.insert(cells, lines[cells]);
        assert_eq!(run(&doubled.join("\n"), false).0.repeated, 1);

        let mut garbage = lines.clone();
        garbage.push("what is this");
        assert_eq!(run(&garbage.join("\n"), false).0.unreadable_lines, 1);
    }

    #[test]
    fn frames_of_others_are_no_fault() {
        let (counts, _) = run("(1.000000) can0 123#0102\n(1.000001) can0 1F334455#R\n(1.0) can0 40D#00\n", false);
        assert_eq!((counts.other_frames, counts.messages, counts.faults()), (3, 0, 0));
    }
}
