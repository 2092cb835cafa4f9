//! The log format of candump (`candump -L`, can-utils): `(1436509053.249713) can0 4AA#0102`.

use std::io::Write;

use super::{BusCondition, BusError, BusErrorKind, CanBus, CanFrame, FrameParseError};

/// Longest line that is read, bytes: an FD frame with 64 bytes has under 200.
const MAX_LINE: usize = 512;

/// A line of a log: a frame, when and on which bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CandumpLine {
    /// When the frame was on the bus, nanoseconds; the log has microseconds.
    pub timestamp_ns: u64,
    /// Name of the interface.
    pub interface: String,
    /// The frame.
    pub frame: CanFrame,
}

/// A line of a log that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CandumpError {
    /// Line, from 1.
    pub line: usize,
    /// What is wrong with it.
    pub problem: CandumpProblem,
}

/// What is wrong with a line of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CandumpProblem {
    /// Not text, or too long for a line of a log.
    NotText,
    /// No time `(seconds.microseconds)` at the beginning.
    Time,
    /// Not three words: time, interface, frame.
    Words,
    /// The frame.
    Frame(FrameParseError),
}

/// Writes every frame that is sent to a log and passes it on to the bus behind.
///
/// A frame that the bus refuses is not in the log.
#[derive(Debug)]
pub struct CandumpWriter<W, B> {
    log: W,
    bus: B,
    interface: String,
}

/// What can go wrong on a bus with a log.
#[derive(Debug)]
pub enum LoggedBusError<E> {
    /// The bus.
    Bus(E),
    /// The log cannot be written; the frame was sent.
    Log(std::io::Error),
}

impl std::fmt::Display for CandumpLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let micros = self.timestamp_ns / 1_000;
        let (seconds, micros) = (micros / 1_000_000, micros % 1_000_000);
        write!(f, "({seconds:010}.{micros:06}) {} {}", self.interface, self.frame)
    }
}

impl std::str::FromStr for CandumpLine {
    type Err = CandumpProblem;

    fn from_str(text: &str) -> Result<Self, CandumpProblem> {
        let mut words = text.split_ascii_whitespace();
        let timestamp_ns = words.next().and_then(time_ns).ok_or(CandumpProblem::Time)?;
        let interface = words.next().ok_or(CandumpProblem::Words)?.to_owned();
        let frame = words.next().ok_or(CandumpProblem::Words)?.parse().map_err(CandumpProblem::Frame)?;
        // Newer versions of candump add the direction: `T` or `R`.
        match words.next() {
            None | Some("T" | "R") => Ok(Self { timestamp_ns, interface, frame }),
            Some(_) => Err(CandumpProblem::Words),
        }
    }
}

/// The lines of a log, one after another; empty lines and lines that begin with `#` or `;` are passed over.
///
/// The reader goes on behind a line that is wrong.
pub fn parse_candump(log: &[u8]) -> impl Iterator<Item = Result<CandumpLine, CandumpError>> {
    log.split(|byte| *byte == b'\n').enumerate().filter_map(|(index, line)| {
        let line = line.trim_ascii();
        if line.is_empty() || line.starts_with(b"#") || line.starts_with(b";") {
            return None;
        }
        let text = std::str::from_utf8(line).ok().filter(|text| text.len() <= MAX_LINE);
        let parsed = text.ok_or(CandumpProblem::NotText).and_then(str::parse);
        Some(parsed.map_err(|problem| CandumpError { line: index + 1, problem }))
    })
}

impl<W: Write, B: CanBus> CandumpWriter<W, B> {
    /// Logs to `log` what is sent on `bus`, under the name `interface` (`can0`).
    pub fn new(log: W, bus: B, interface: impl Into<String>) -> Self {
        Self { log, bus, interface: interface.into() }
    }

    /// The log and the bus, flushed.
    ///
    /// # Errors
    /// When the last lines cannot be written.
    pub fn into_inner(mut self) -> std::io::Result<(W, B)> {
        self.log.flush()?;
        Ok((self.log, self.bus))
    }
}

impl<W: Write, B: CanBus> CanBus for CandumpWriter<W, B> {
    type Error = LoggedBusError<B::Error>;

    fn send(&mut self, frame: &CanFrame, now_ns: u64) -> Result<(), Self::Error> {
        self.bus.send(frame, now_ns).map_err(LoggedBusError::Bus)?;
        let line = CandumpLine { timestamp_ns: now_ns, interface: self.interface.clone(), frame: *frame };
        writeln!(self.log, "{line}").map_err(LoggedBusError::Log)
    }

    fn receive(&mut self) -> Result<Option<(u64, CanFrame)>, Self::Error> {
        self.bus.receive().map_err(LoggedBusError::Bus)
    }

    fn condition(&self) -> BusCondition {
        self.bus.condition()
    }
}

impl<E: std::fmt::Display> std::fmt::Display for LoggedBusError<E> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Bus(error) => error.fmt(f),
            Self::Log(error) => write!(f, "the CAN log cannot be written ({error}); check the space on the disk"),
        }
    }
}

impl<E: std::error::Error + 'static> std::error::Error for LoggedBusError<E> {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Bus(error) => Some(error),
            Self::Log(error) => Some(error),
        }
    }
}

impl<E: BusError + 'static> BusError for LoggedBusError<E> {
    fn kind(&self) -> BusErrorKind {
        match self {
            Self::Bus(error) => error.kind(),
            Self::Log(_) => BusErrorKind::Other,
        }
    }
}

impl std::fmt::Display for CandumpError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "line {}: {}; a line is `(seconds.microseconds) interface id#data`", self.line, self.problem)
    }
}

impl std::error::Error for CandumpError {}

impl std::fmt::Display for CandumpProblem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NotText => write!(f, "not text, or longer than {MAX_LINE} bytes"),
            Self::Time => write!(f, "does not begin with a time"),
            Self::Words => write!(f, "is not time, interface and frame"),
            Self::Frame(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for CandumpProblem {}

fn time_ns(word: &str) -> Option<u64> {
    let (seconds, fraction) = word.strip_prefix('(')?.strip_suffix(')')?.split_once('.')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(seconds) || !digits(fraction) || fraction.len() > 9 {
        return None;
    }
    let nanos: u64 = format!("{fraction:0<9}").parse().ok()?;
    seconds.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(nanos)
}

#[cfg(test)]
mod tests {
    use embedded_can::StandardId;

    use super::*;
    use crate::can::VirtualBus;

    #[test]
    fn what_is_sent_is_logged_and_passed_on_and_read_again() {
        let bus = VirtualBus::new(8);
        let (sender, mut receiver) = (bus.attach(), bus.attach());
        let mut writer = CandumpWriter::new(Vec::new(), sender, "can0");
        let id = StandardId::new(0x4AA).unwrap();
        let frames = [
            CanFrame::new(id, &[1, 2], false).unwrap(),
            CanFrame::new(id, &[], false).unwrap(),
            CanFrame::new(id, &[0xA5; 12], true).unwrap(),
        ];
        for (i, frame) in frames.iter().enumerate() {
            writer.send(frame, 1_436_509_053_249_713_000 + i as u64 * 1_000).unwrap();
        }
        let (log, _) = writer.into_inner().unwrap();
        let text = String::from_utf8(log.clone()).unwrap();
        assert_eq!(
            text,
            "(1436509053.249713) can0 4AA#0102\n(1436509053.249714) can0 4AA#\n\
             (1436509053.249715) can0 4AA##1A5A5A5A5A5A5A5A5A5A5A5A5\n"
        );
        let lines: Vec<CandumpLine> = parse_candump(&log).map(Result::unwrap).collect();
        for (line, frame) in lines.iter().zip(frames) {
            assert_eq!((line.frame, line.interface.as_str()), (frame, "can0"));
            assert_eq!(receiver.receive().unwrap(), Some((line.timestamp_ns, frame)));
        }
        assert_eq!(lines.len(), 3);
    }

    #[test]
    fn small_times_are_padded_as_candump_does() {
        let frame = "123#".parse().unwrap();
        let line = CandumpLine { timestamp_ns: 100_000_999, interface: "vcan0".to_owned(), frame };
        assert_eq!(line.to_string(), "(0000000000.100000) vcan0 123#");
    }

    #[test]
    fn windows_line_ends_comments_and_remote_frames_are_read() {
        let log = b"# comment\r\n\r\n(1.5) can0 123#R\r\n(0000000002.000001) can1 123#11 T\r\n(3.000001)  can0  123##0";
        let lines: Vec<CandumpLine> = parse_candump(log).map(Result::unwrap).collect();
        let times: Vec<u64> = lines.iter().map(|line| line.timestamp_ns).collect();
        assert_eq!(times, [1_500_000_000, 2_000_001_000, 3_000_001_000]);
        assert!(lines[0].frame.is_remote() && !lines[1].frame.is_remote());
        assert!(lines[2].frame.is_fd() && !lines[2].frame.bit_rate_switch());
    }

    #[test]
    fn a_wrong_line_is_named_and_the_next_one_read() {
        use CandumpProblem::{Frame, NotText, Time, Words};
        for (line, problem) in [
            (&b"can0 123#"[..], Time),
            (b"(1) can0 123#", Time),
            (b"(+1.0) can0 123#", Time),
            (b"(1.0000000001) can0 123#", Time),
            (b"(99999999999999999999.0) can0 123#", Time),
            (b"(1.0)", Words),
            (b"(1.0) can0", Words),
            (b"(1.0) can0 123# X", Words),
            (b"(1.0) can0 123", Frame(FrameParseError::NoSeparator)),
            (b"\xff\xfe", NotText),
            (&[b'1'; 600], NotText),
        ] {
            let log = [b"(0.1) can0 1AB#00\n", line, b"\n(0.2) can0 1AB#01\n"].concat();
            let lines: Vec<_> = parse_candump(&log).collect();
            assert_eq!(lines.len(), 3);
            assert_eq!(lines[1], Err(CandumpError { line: 2, problem }), "{}", line.escape_ascii());
            assert!(lines[0].is_ok() && lines[2].is_ok());
            assert!(lines[1].as_ref().unwrap_err().to_string().starts_with("line 2: "));
        }
    }

    #[test]
    fn a_log_that_cannot_be_written_is_said() {
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
                Err(std::io::ErrorKind::StorageFull.into())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        let bus = VirtualBus::new(1);
        let mut receiver = bus.attach();
        let mut writer = CandumpWriter::new(Full, bus.attach(), "can0");
        let error = writer.send(&"123#".parse().unwrap(), 0).unwrap_err();
        assert!(matches!(error, LoggedBusError::Log(_)), "{error}");
        assert!(receiver.receive().unwrap().is_some(), "the frame was sent nevertheless");
    }

    #[test]
    fn any_bytes_are_read_without_panic() {
        let log = b"(1436509053.249713) can0 4AA#0102\n(0.5) can0 1F334455##1A5A5\r\n(1.0) vcan0 123#R4\n";
        let seed = 7;
        println!("seed {seed}");
        let mut state: u64 = seed;
        let mut draw = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) % below) as usize
        };
        let (mut good, mut bad) = (0, 0);
        for _ in 0..20_000 {
            let mut bytes = log.to_vec();
            for _ in 0..=draw(3) {
                let at = draw(bytes.len() as u64);
                bytes[at] = if draw(2) == 0 { draw(256) as u8 } else { b"#R().\n \xc3\xa90F"[draw(11)] };
            }
            for line in parse_candump(&bytes) {
                match line {
                    // What is read can be written and is the same when read again, up to the microsecond of the format.
                    Ok(line) => {
                        let again: CandumpLine = line.to_string().parse().unwrap();
                        assert_eq!((again.frame, again.timestamp_ns), (line.frame, line.timestamp_ns / 1_000 * 1_000));
                        good += 1;
                    }
                    Err(_) => bad += 1,
                }
            }
        }
        assert!(good > 1000 && bad > 1000, "{good} good and {bad} bad lines");
    }
}
