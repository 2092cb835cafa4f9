//! The command line.

use std::{num::ParseIntError, ops::Range, path::PathBuf, str::FromStr};

use clap::{
    Args, Parser, Subcommand, ValueEnum,
    builder::{PossibleValue, PossibleValuesParser, TypedValueParser},
};
use fencepost_core::{arch::Backend, bands::MAX_BANDS, methods::DetectorKind};

use crate::{compare::Method, live::MAX_PAIRS, words};

/// Stereo obstacle detection: pictures from two cameras in, obstacle cells on a CAN bus out.
#[derive(Debug, Parser)]
#[command(version, about, long_about = None, after_long_help = AFTER_HELP, after_help = "With no command, `fencepost demo` runs. `fencepost --help` shows examples.")]
pub struct Cli {
    /// What to do; `demo` if left out.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Say nothing but warnings and errors.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say more of what is done.
    #[arg(short, long, global = true)]
    pub verbose: bool,
}

const AFTER_HELP: &str = "\
Examples:
  fencepost
      Run the demo: a rendered scene, written to out/demo/
  fencepost check ~/recordings/garden
      What is in a recording, how far and how near it can see
  fencepost replay ~/recordings/garden --out out/garden
      Detect obstacles in every pair; write tables, pictures, a CAN log and
      report.html
  fencepost replay garden --out out --frames 100..200 --write cells,can
      Only frames 100 to 199, only the tables and the CAN log
  fencepost replay garden --out out --detector cost-map
      The same with the detector that the LAGR robot had first
  fencepost replay garden --out out --cross-check pixel-normals
      A second detector checks the first: what they disagree on is never free
  fencepost compare ~/recordings/garden --out out/compare
      Every detector on the same pairs, side by side; scores where there is
      truth
  fencepost bench --recording ~/recordings/garden
      How long a frame takes on this computer, stage by stage
  fencepost cameras
      The cameras that are plugged in, and the lines of a rig's file for them
  fencepost record --config rig.toml --out ~/recordings/yard --seconds 60
      What the cameras of a rig see, as a recording to replay
  fencepost can decode out/garden/can.log
      The messages of a CAN log as text
  fencepost listen can0
      What the nodes on a bus see, live, and whether a vehicle may drive by it

Recordings:
  A folder in the layout of KITTI odometry (image_0/, image_1/, calib.txt,
  times.txt; rectified) or of EuRoC ASL (mav0/cam0/, mav0/cam1/; raw). A file
  mount.json beside it says how high and how far tilted the left camera is:
  {\"height_m\": 0.9, \"pitch_down_deg\": 15.0, \"roll_deg\": 0.0}

Exit status:
  0  everything worked
  1  the work failed or the input is bad: a recording, a picture,
     a calibration, a CAN log, a full disk
  2  the program was called wrongly, or its configuration cannot be used";

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a made-up scene, detect its obstacles and write everything, to see what the program does.
    Demo(DemoArgs),
    /// Detect obstacles in a recording.
    Replay(ReplayArgs),
    /// Run detectors over a recording side by side: pictures, scores, times and memory in one report.
    Compare(CompareArgs),
    /// Measure how long the detector takes for a frame, from a raw pair to CAN payloads.
    Bench(BenchArgs),
    /// Run a rig: from its cameras to the CAN bus, until SIGTERM or SIGINT.
    Run(RunArgs),
    /// Say what a recording, a calibration or a configuration holds, and what the detector can see with it.
    Check(CheckArgs),
    /// Record what a pair of cameras of a rig sees, without loss, to replay it.
    Record(RecordArgs),
    /// List the cameras of this machine, what they offer, and which of them would make a pair.
    Cameras(CamerasArgs),
    /// Work with CAN logs.
    #[command(subcommand)]
    Can(CanCommand),
    /// Show what the nodes on a CAN bus say, live: map, distances, health, losses, load.
    #[command(after_help = LISTEN_HELP)]
    Listen(ListenArgs),
}

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder to write to; made if it is not there.
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    pub out: PathBuf,
    /// Number of frames to render.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub frames: u32,
    /// Also write the rendered pictures to this folder, as a recording to replay.
    #[arg(long, value_name = "DIR")]
    pub record: Option<PathBuf>,
    /// Settings of the detector and of the bus.
    #[command(flatten)]
    pub detector: DetectorArgs,
}

impl Default for DemoArgs {
    fn default() -> Self {
        Self { out: "out/demo".into(), frames: 8, record: None, detector: DetectorArgs::default() }
    }
}

/// Arguments of `replay`.
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// Folder of the recording.
    pub recording: PathBuf,
    /// Folder to write to; made if it is not there. Files of an earlier run are replaced.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// What to write besides summary.json; everything if left out.
    #[arg(long, value_name = "WHAT", value_delimiter = ',', default_values_t = Output::ALL)]
    pub write: Vec<Output>,
    /// Only these frames: `A..B` without B, `A..` to the end, or one number.
    #[arg(long, value_name = "A..B", default_value = "..")]
    pub frames: FrameRange,
    /// Settings of the detector and of the bus.
    #[command(flatten)]
    pub detector: DetectorArgs,
}

/// Arguments of `compare`.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// Folder of the recording.
    pub recording: PathBuf,
    /// The detectors, separated by commas; all of them if left out. `normalized-cuts` takes seconds for a frame.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_values_t = Method::ALL)]
    pub detectors: Vec<Method>,
    /// Folder to write to; made if it is not there. Files of an earlier run are replaced.
    #[arg(long, value_name = "DIR", default_value = "out/compare")]
    pub out: PathBuf,
    /// Only these frames: `A..B` without B, `A..` to the end, or one number.
    #[arg(long, value_name = "A..B", default_value = "..")]
    pub frames: FrameRange,
    /// Most frames whose pictures are in the report, spread over the recording.
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = clap::value_parser!(u16).range(0..=100))]
    pub show: u16,
    /// Settings of the detectors.
    #[command(flatten)]
    pub detector: DetectorArgs,
}

/// Arguments of `bench`.
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Folder of a recording, of which the first 16 pairs are used; a rendered trail if left out.
    #[arg(long, value_name = "DIR")]
    pub recording: Option<PathBuf>,
    /// Size of the pictures: cropped from the middle of the bottom edge, or repeated where they are too small; that of the
    /// recording, or 512x384, if left out.
    #[arg(long, value_name = "WxH")]
    pub size: Option<PictureSize>,
    /// Frames that are measured, on each thread.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub frames: u32,
    /// Pairs that are worked on side by side, each by a thread with a detector of its own.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=MAX_PAIRS as i64))]
    pub threads: u8,
    /// Bands that each picture is cut into, each worked on by a thread of its own. No result depends on it.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=MAX_BANDS as i64))]
    pub bands: u8,
    /// Whose instructions the matching is made of: plain, sse2, sse4.1, avx2, avx512 or neon; the fastest that the processor has
    /// if left out. No result depends on it.
    #[arg(long, value_name = "NAME", value_parser = backend)]
    pub backend: Option<Backend>,
    /// The figures as JSON.
    #[arg(long)]
    pub json: bool,
    /// Settings of the detector and of the bus.
    #[command(flatten)]
    pub detector: DetectorArgs,
}

/// A backend that this processor has.
fn backend(name: &str) -> Result<Backend, String> {
    let named = Backend::ALL.iter().copied().find(|backend| backend.name() == name);
    let available = Backend::ALL.iter().filter(|backend| backend.is_available()).map(|backend| backend.name());
    named
        .filter(|backend| backend.is_available())
        .ok_or_else(|| format!("this processor has {}", available.collect::<Vec<_>>().join(", ")))
}

/// Width and height of pictures, px.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureSize {
    /// Width.
    pub width: u32,
    /// Height.
    pub height: u32,
}

impl FromStr for PictureSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |text: &str| text.parse().ok().filter(|side| (32..=4096).contains(side));
        let (width, height) = text.split_once('x').unwrap_or((text, ""));
        match (side(width), side(height)) {
            (Some(width), Some(height)) => Ok(Self { width, height }),
            _ => Err("give width and height, 32 to 4096 px, as in 640x480".to_string()),
        }
    }
}

/// Arguments of `run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// The rig in TOML: cameras, mounts, bus. `docs/files.md` lists all settings, `fencepost check FILE` tries them.
    #[arg(long, value_name = "FILE")]
    pub config: PathBuf,
    /// Node id on the bus, in place of the one in the file.
    #[arg(long, value_name = "N")]
    pub node: Option<u8>,
    /// How obstacles are found.
    #[command(flatten)]
    pub methods: MethodArgs,
    /// Stop after so many seconds.
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub seconds: Option<f64>,
    /// At the end, write counts and times to this file as JSON.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|error| format!("{error}"))?;
    // Also refuses what is not a number.
    if (0.0..=1.0e9).contains(&seconds) { Ok(seconds) } else { Err("give a number of seconds".to_string()) }
}

/// Settings of the detector and of the bus, for every command that detects.
#[derive(Debug, Default, Args)]
pub struct DetectorArgs {
    /// Settings in TOML; `docs/files.md` lists them all.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// How obstacles are found.
    #[command(flatten)]
    pub methods: MethodArgs,
    /// Number of disparities searched, px; an eighth of the picture's width if left out.
    #[arg(long, value_name = "N")]
    pub disparities: Option<u16>,
    /// Node id on the bus.
    #[arg(long, value_name = "N")]
    pub node: Option<u8>,
    /// Use CAN FD frames instead of classic ones.
    #[arg(long)]
    pub can_fd: bool,
}

/// How obstacles are found.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct MethodArgs {
    /// Detector, in place of the one in the file.
    #[arg(long, value_name = "NAME", value_parser = detector_names())]
    pub detector: Option<DetectorKind>,
    /// Second detector that looks at the same disparities: a cell that the two disagree on is never free.
    #[arg(long, value_name = "NAME", value_parser = detector_names())]
    pub cross_check: Option<DetectorKind>,
}

/// The names of all detectors: any other is an error that lists them.
fn detector_names() -> impl TypedValueParser<Value = DetectorKind> {
    let names = DetectorKind::ALL.map(|kind| PossibleValue::new(kind.name()).help(words::detector_words(kind)));
    PossibleValuesParser::new(names)
        .try_map(|name| DetectorKind::from_name(&name).ok_or_else(|| format!("`{name}` is no detector")))
}

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Folder of a recording, calibration file (KITTI calib.txt, EuRoC sensor.yaml, OpenCV or ROS YAML), or
    /// configuration in TOML.
    pub path: PathBuf,
    /// Calibration of the right camera, where each camera has a file of its own.
    pub right: Option<PathBuf>,
    /// Settings of the detector.
    #[command(flatten)]
    pub detector: DetectorArgs,
}

/// Arguments of `record`.
#[derive(Debug, Args)]
pub struct RecordArgs {
    /// The rig in TOML.
    #[arg(long, value_name = "FILE")]
    pub config: PathBuf,
    /// Folder of the recording; made if it is not there.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Name of the pair, where the rig has more than one.
    #[arg(long, value_name = "NAME")]
    pub pair: Option<String>,
    /// Stop after so many pairs of pictures.
    #[arg(long, value_name = "N", conflicts_with = "seconds")]
    pub frames: Option<u64>,
    /// Stop after so many seconds.
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub seconds: Option<f64>,
    /// Pairs in memory between camera and disk; 64 MB of them if left out.
    #[arg(long, value_name = "N", value_parser = pairs)]
    pub queue: Option<usize>,
}

fn pairs(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(pairs @ 1..=10_000) => Ok(pairs),
        _ => Err("give a number from 1 to 10000".to_string()),
    }
}

/// Arguments of `cameras`.
#[derive(Debug, Default, Args)]
pub struct CamerasArgs {
    /// Everything that is known of them, as JSON.
    #[arg(long)]
    pub json: bool,
}

/// What to do with a CAN log.
#[derive(Debug, Subcommand)]
pub enum CanCommand {
    /// Show the messages of a log in candump's format as text. Exit status 1 if one is damaged or missing.
    Decode(DecodeArgs),
}

/// Arguments of `can decode`.
#[derive(Debug, Args)]
pub struct DecodeArgs {
    /// The log, as `candump -L` writes it.
    pub log: PathBuf,
    /// One line of JSON for each message.
    #[arg(long, conflicts_with = "map")]
    pub json: bool,
    /// Draw a map of each scan.
    #[arg(long)]
    pub map: bool,
    /// Only messages of this node.
    #[arg(long, value_name = "N")]
    pub node: Option<u8>,
    /// First identifier of the nodes, decimal or as 0x500.
    #[arg(long, value_name = "ID", default_value = "0x400", value_parser = identifier)]
    pub base_id: u16,
}

fn identifier(text: &str) -> Result<u16, ParseIntError> {
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u16::from_str_radix(digits, 16),
        None => text.parse(),
    }
}

const LISTEN_HELP: &str = "\
Without a terminal, as in a pipe, a line is written for each scan and for each
change. Listening needs no rights; bringing the interface up needs root:
  sudo ip link set can0 up type can bitrate 500000";

/// Arguments of `listen`.
#[derive(Debug, Args)]
pub struct ListenArgs {
    /// CAN interface, such as can0; of a log, only the frames of this interface.
    #[arg(required_unless_present = "log")]
    pub interface: Option<String>,
    /// Play a log in candump's format instead of listening to an interface.
    #[arg(long, value_name = "FILE")]
    pub log: Option<PathBuf>,
    /// Play the log that many times as fast; without a terminal it is read at once if this is left out.
    #[arg(long, value_name = "X", requires = "log", value_parser = positive)]
    pub speed: Option<f64>,
    /// Only this node.
    #[arg(long, value_name = "N")]
    pub node: Option<u8>,
    /// First identifier of the nodes, decimal or as 0x500.
    #[arg(long, value_name = "ID", default_value = "0x400", value_parser = identifier)]
    pub base_id: u16,
    /// Bit rate of the bus, bit/s, for its load; that of the interface if left out.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1_000..=100_000_000))]
    pub bitrate: Option<u32>,
    /// Act as a vehicle's controller: say which scans were taken over and how the vehicle moves.
    #[arg(long, conflicts_with = "log")]
    pub echo: bool,
    /// Speed that --echo tells, m/s.
    #[arg(long, value_name = "V", default_value_t = 0.0, requires = "echo", allow_negative_numbers = true)]
    pub speed_m_per_s: f64,
    /// Turning rate to the left that --echo tells, degrees/s.
    #[arg(long, value_name = "W", default_value_t = 0.0, requires = "echo", allow_negative_numbers = true)]
    pub yaw_rate_deg_per_s: f64,
    /// A line for each scan and each change instead of the live view.
    #[arg(long)]
    pub plain: bool,
    /// The same lines as JSON.
    #[arg(long)]
    pub json: bool,
    /// End after that many whole scans.
    #[arg(long, value_name = "N")]
    pub count: Option<u64>,
    /// End after that many seconds.
    #[arg(long, value_name = "S", value_parser = positive)]
    pub seconds: Option<f64>,
}

fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if value > 0.0 { Ok(value) } else { Err("must be above zero".to_owned()) }
}

/// One kind of output of `replay`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Output {
    /// cells.csv, obstacles.csv and ground.csv
    Cells,
    /// can.log
    Can,
    /// disparity/NNNNNN.png
    Disparity,
    /// classes/NNNNNN.png
    Classes,
    /// map/NNNNNN.png
    Map,
    /// report.html
    Report,
}

impl Output {
    /// Everything.
    pub const ALL: [Self; 6] = [Self::Cells, Self::Can, Self::Disparity, Self::Classes, Self::Map, Self::Report];
}

impl std::fmt::Display for Output {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Cells => "cells",
            Self::Can => "can",
            Self::Disparity => "disparity",
            Self::Classes => "classes",
            Self::Map => "map",
            Self::Report => "report",
        })
    }
}

/// Frame numbers from `start` up to, but without, `end`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameRange(pub Range<u32>);

impl Default for FrameRange {
    fn default() -> Self {
        Self(0..u32::MAX)
    }
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str, absent| match text.trim() {
            "" => Ok(absent),
            text => text.parse().map_err(|error: ParseIntError| format!("`{text}`: {error}")),
        };
        let range = match text.split_once("..") {
            Some((start, end)) => number(start, 0)?..number(end, u32::MAX)?,
            None => {
                let one: u32 = text.trim().parse().map_err(|_| "give it as A..B, as in 10..20".to_string())?;
                one..one.saturating_add(1)
            }
        };
        if range.is_empty() {
            return Err("holds no frame: A must be less than B".to_string());
        }
        Ok(Self(range))
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn frame_ranges() {
        for (text, range) in [("..", 0..u32::MAX), ("3..7", 3..7), ("3..", 3..u32::MAX), ("..7", 0..7), ("5", 5..6)] {
            assert_eq!(text.parse(), Ok(FrameRange(range)), "{text}");
        }
        for text in ["7..3", "3..3", "x", "1..y", "", "-1", "1...2"] {
            assert!(text.parse::<FrameRange>().is_err(), "{text}");
        }
    }

    #[test]
    fn picture_sizes() {
        assert_eq!("640x480".parse(), Ok(PictureSize { width: 640, height: 480 }));
        for text in ["640", "640x", "x480", "640x480x3", "640X480", "31x480", "640x4097", "-640x480", "640 x 480", ""] {
            assert!(text.parse::<PictureSize>().is_err(), "{text}");
        }
    }

    #[test]
    fn outputs_can_be_picked() {
        let cli = Cli::try_parse_from(["fencepost", "replay", "r", "--out", "o", "--write", "cells,can"]).unwrap();
        let Some(Command::Replay(args)) = cli.command else { panic!("not replay") };
        assert_eq!(args.write, [Output::Cells, Output::Can]);
        assert_eq!(args.frames, FrameRange::default());
    }

    #[test]
    fn detectors_have_names_and_a_wrong_one_lists_them() {
        let parse = |name: &str| {
            Cli::try_parse_from(["fencepost", "replay", "r", "--out", "o", "--detector", name, "--cross-check", name])
        };
        for kind in DetectorKind::ALL {
            let Some(Command::Replay(args)) = parse(kind.name()).unwrap().command else { panic!("not replay") };
            let MethodArgs { detector, cross_check } = args.detector.methods;
            assert_eq!((detector, cross_check), (Some(kind), Some(kind)));
        }
        let error = parse("costmap").unwrap_err().to_string();
        for kind in DetectorKind::ALL {
            assert!(error.contains(kind.name()), "{error}");
        }
        let run = ["fencepost", "run", "--config", "f", "--detector", "cost-map"];
        let Some(Command::Run(args)) = Cli::try_parse_from(run).unwrap().command else { panic!("not run") };
        assert_eq!(args.methods.detector, Some(DetectorKind::CostMap));
    }

    #[test]
    fn no_command_is_the_demo() {
        assert!(Cli::try_parse_from(["fencepost"]).unwrap().command.is_none());
    }
}
