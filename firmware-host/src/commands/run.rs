//! `run`: live, from cameras to the CAN bus.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use fencepost_core::wire::{FrameFormat, Message, WireConfig};
use fencepost_hal::can::{CanInterface, IdFilter, SocketCan, VirtualBus};

use super::Ending;
use crate::{
    cli::RunArgs,
    config::{Config, Rig},
    console::Console,
    error::Failure,
    live::{
        self, BusSettings, LatencySummary, Observation, PairPlan, Plan, Progress, RigCamera, RunReport, Severity,
        Systemd,
    },
    words,
};

/// A thread that has not moved for so long after the longest wait for its camera hangs: opening devices may take seconds.
const HANGS: Duration = Duration::from_secs(10);
/// How often systemd and whoever watches are told how it goes.
const STATUS: Duration = Duration::from_secs(2);

/// Runs a rig until SIGTERM or SIGINT comes, or no camera delivers any more.
///
/// # Errors
/// When the configuration, a calibration or a camera can never be used. A camera or a bus that is not there is no error: it
/// may come.
pub fn run(args: &RunArgs, console: &mut Console) -> Result<Ending, Failure> {
    let mut config = Config::read_rig(&args.config)?;
    config.wire.node = args.node.unwrap_or(config.wire.node);
    config.choose(&args.methods)?;
    let wire = WireConfig::new(config.wire).map_err(|error| Failure::config(error, Some(&args.config)))?;
    let plan = plan(&config, wire, console)?;

    let stop = Arc::new(AtomicBool::new(false));
    live::stop_at_signals(&stop).map_err(|error| Failure::work(format!("signals cannot be caught: {error}")))?;
    let report = start(plan, &config.rig, wire, args, &stop, console)?;
    if let Some(path) = &args.report {
        let mut text = serde_json::to_string_pretty(&report)
            .map_err(|error| Failure::work(format!("the report cannot be made: {error}")))?;
        text.push('\n');
        std::fs::write(path, text).map_err(|error| Failure::cannot_write(path, &error))?;
    }
    console.result(table(&report));
    Ok(Ending::Good)
}

fn plan(config: &Config, wire: WireConfig, console: &mut Console) -> Result<Plan<RigCamera>, Failure> {
    let mut pairs = Vec::new();
    for pair in &config.rig.pairs {
        console.note(format_args!("pair {}: {}", pair.name, pair.source.describe()));
        pair.warnings.iter().for_each(|warning| console.warn(format_args!("pair {}: {warning}", pair.name)));
        let mut camera = RigCamera::open(pair, config.rig.pairs.len() == 1)?;
        camera.take_warnings().iter().for_each(|warning| console.warn(format_args!("pair {}: {warning}", pair.name)));
        pairs.push(PairPlan {
            name: pair.name.clone(),
            camera,
            calibration: pair.calibration,
            mount: pair.mount,
            settings: config.settings_for(pair.picture_size().0),
            cpu: pair.cpu,
            patience: pair.source.longest_wait() + HANGS,
        });
    }
    let sector_width_deg = config.settings_for(0).map.sector_width_deg;
    Ok(Plan { pairs, wire, settings: config.rig.run.clone(), sector_width_deg })
}

fn start(
    plan: Plan<RigCamera>,
    rig: &Rig,
    wire: WireConfig,
    args: &RunArgs,
    stop: &AtomicBool,
    console: &mut Console,
) -> Result<RunReport, Failure> {
    let mut watcher = Watcher::new(args, stop, console);
    if rig.bus.interface == BusSettings::NONE {
        return live::run(plan, VirtualBus::new(0).attach(), stop, |observation| watcher.observe(&observation));
    }
    let fd = wire.format() == FrameFormat::Fd;
    let address = wire.address();
    // All that a node has to hear are the two messages of its controller, and whether somebody else has its number.
    let heard = [Message::VehicleMotion, Message::ScanEcho, Message::Heartbeat];
    let filters = heard.map(|message| IdFilter::exactly(address.id(message)));
    let mut bus = SocketCan::new(&rig.bus.interface, fd).with_filters(&filters);
    if let Err(error) = bus.open_now() {
        watcher.console.warn(format_args!("{error}; the program goes on and waits for it"));
    }
    if let Ok(interface) = CanInterface::look(&rig.bus.interface) {
        odd_about(&interface, fd, rig.bus.bitrate).iter().for_each(|text| watcher.console.warn(text));
    }
    live::run(plan, bus, stop, |observation| watcher.observe(&observation))
}

/// What does not go together with the rig.
fn odd_about(interface: &CanInterface, fd: bool, bitrate: u32) -> Vec<String> {
    let name = &interface.name;
    let mut odd = Vec::new();
    if fd && !interface.takes_fd() {
        odd.push(format!(
            "{name} takes no CAN FD frames, but wire.format is \"fd\": no scan will go out; set it up with `fd on` and a \
             dbitrate, or set wire.format to \"classic\""
        ));
    }
    if let Some(timing) = &interface.timing
        && timing.bitrate != bitrate
    {
        odd.push(format!("{name} runs at {} bit/s, bus.bitrate says {bitrate}: set them alike", timing.bitrate));
    }
    if interface.restart_ms == Some(0) {
        odd.push(format!(
            "{name} stays away for ever once it had to leave the bus (bus-off): `ip link set {name} type can restart-ms 100`"
        ));
    }
    odd
}

/// Tells people and systemd how it goes.
struct Watcher<'a> {
    systemd: Systemd,
    stop: &'a AtomicBool,
    console: &'a mut Console,
    end: Option<Duration>,
    start: Instant,
    last_status: Option<(Instant, u64)>,
    alive: bool,
}

impl<'a> Watcher<'a> {
    fn new(args: &RunArgs, stop: &'a AtomicBool, console: &'a mut Console) -> Self {
        Self {
            systemd: Systemd::new(),
            stop,
            console,
            end: args.seconds.map(Duration::from_secs_f64),
            start: Instant::now(),
            last_status: None,
            alive: true,
        }
    }

    fn observe(&mut self, observation: &Observation<'_>) {
        match observation {
            Observation::Refused(text) => self.console.warn(text),
            Observation::Started => {
                self.start = Instant::now();
                self.systemd.ready();
                self.console.note("running");
            }
            Observation::Event(event) => match event.severity {
                Severity::Warning => self.console.event(format_args!("warning: {}", event.text)),
                Severity::Note => self.console.event(&event.text),
            },
            Observation::Look { progress, alive } => self.look(progress, *alive),
        }
    }

    fn look(&mut self, progress: &Progress, alive: bool) {
        let now = Instant::now();
        if self.end.is_some_and(|end| now - self.start >= end) {
            self.stop.store(true, Ordering::Relaxed);
        }
        if self.stop.load(Ordering::Relaxed) {
            self.systemd.stopping();
            return;
        }
        if !alive && self.alive {
            self.console.error("a thread of the loop hangs");
        }
        self.alive = alive;
        // Systemd that watches is told twice in the time that it waits. When it hears nothing more, it starts the program anew.
        let often = self.systemd.watchdog().map_or(STATUS, |watchdog| STATUS.min(watchdog / 2));
        if alive && self.last_status.is_none_or(|(at, _)| now - at >= often) {
            let (before, scans) = self.last_status.unwrap_or((self.start, 0));
            let rate = progress.scans.saturating_sub(scans) as f64 / (now - before).as_secs_f64().max(1.0e-3);
            let status = status_line(progress, rate);
            self.systemd.alive(&status);
            self.console.note(&status);
            self.last_status = Some((now, progress.scans));
        }
    }
}

fn status_line(progress: &Progress, rate_hz: f64) -> String {
    let Progress { scans, late, health, age_ms, .. } = progress;
    let level = words::level_name(health.level);
    let reasons = words::reason_names(*health, ", ");
    let why = if reasons.is_empty() { String::new() } else { format!(" ({reasons})") };
    format!("{scans} scans, {rate_hz:.1} a second, age {age_ms:.0} ms, {late} late, health {level}{why}")
}

/// How the run went, for people.
fn table(report: &RunReport) -> String {
    use std::fmt::Write as _;
    let mut text = String::new();
    for pair in &report.pairs {
        let _ = writeln!(
            text,
            "pair {:<8}  {} frames; {} pictures missed, {} time-outs, {} damaged, {} calls without camera",
            pair.name, pair.frames, pair.missed, pair.no_picture, pair.damaged, pair.lost
        );
        let _ = writeln!(text, "  detector     {}", pair.detect);
    }
    let bus = &report.bus;
    let _ = writeln!(
        text,
        "bus            {} scans, {} whole on the bus, {} abandoned; {} frames, {} heartbeats",
        bus.scans, bus.sent.whole_scans, bus.sent.abandoned_scans, bus.sent.frames, bus.sent.heartbeats
    );
    let LatencySummary { count, .. } = bus.latency;
    let _ = writeln!(text, "latency        {} (exposure to last CAN frame, {count} scans)", bus.latency);
    let _ = write!(text, "late           {} of {} scans; {} detections overtaken", bus.late, bus.scans, bus.overtaken);
    text
}
