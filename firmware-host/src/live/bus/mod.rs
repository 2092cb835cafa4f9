//! The bus thread: joins what the pairs saw, says it on the bus, and listens to the vehicle's controller.

mod judge;
mod report;

pub use report::{BusReport, CommandReport, SentReport};

use std::{
    sync::{
        Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::Duration,
};

use embedded_can::Id;
use fencepost_core::{
    health::{Health, HealthLevel, HealthReason},
    map::Merged,
    wire::{
        CellsRepr, Command, CommandReceiver, CommandStatistics, FIXED_FRAMES_PER_SCAN, Frame, HEARTBEAT_RATE_HZ,
        MAX_HEARTBEAT_RATE_HZ, Message, NodeState, Scan, ScanEncoder, Status, WireConfig,
    },
};
use fencepost_hal::{
    can::{BusCondition, BusError, BusErrorKind, CanBus, Pump, Transmitter},
    clock::Clock,
};
use heapless::Vec as FixedVec;

use super::{
    event::{Events, Severity},
    exchange::{Bell, Place, Trouble},
    latency::{Latency, LatencySummary},
    settings::{MAX_PAIRS, RunSettings},
    watch::{EchoWatch, Watch},
};
use crate::{detector::CELLS, error::Failure};

/// Most runs of cells in a scan: 255 frames of 8.
const RUNS: usize = 255 * CellsRepr::FD_RUNS;
const FRAMES: usize = 255 + FIXED_FRAMES_PER_SCAN;
const HEARTBEAT_NS: u64 = 1_000_000_000 / HEARTBEAT_RATE_HZ as u64;
/// News are said at once, but not more often than this.
const NEWS_NS: u64 = 1_000_000_000 / MAX_HEARTBEAT_RATE_HZ as u64;
/// A queue that is full for so long is too slow: the largest scan of the default settings takes 56 ms at 500 kbit/s.
const LONG_FULL_NS: u64 = 80_000_000;
/// How often is looked for frames of others, and for room in a full queue.
const LISTEN: Duration = Duration::from_millis(5);
const RETRY: Duration = Duration::from_millis(1);
/// Frames of others that are taken in one go.
const LISTEN_FRAMES: usize = 256;
/// How long the bus has for what still waits, and for the last heartbeat.
const FAREWELL_NS: u64 = 100_000_000;

/// What the bus thread last said, for whoever watches the loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Scans encoded.
    pub scans: u64,
    /// Scans that came too late.
    pub late: u64,
    /// What was said last.
    pub health: Health,
    /// Time since exposure when the last scan was encoded, milliseconds.
    pub age_ms: f64,
    /// Speed of the vehicle, m/s, where the controller says it.
    pub speed_m_s: Option<f32>,
}

/// What the bus thread is to do.
#[derive(Clone, Copy)]
pub(super) struct BusPlan<'a> {
    pub(super) wire: WireConfig,
    pub(super) settings: &'a RunSettings,
    pub(super) sector_width_deg: f32,
}

/// What the bus thread shares with the others.
pub(super) struct BusShared<'a> {
    pub(super) places: &'a [Place],
    pub(super) bell: &'a Bell,
    pub(super) events: &'a Events,
    pub(super) stop: &'a AtomicBool,
    pub(super) progress: &'a Mutex<Progress>,
    pub(super) alive: &'a AtomicU64,
    pub(super) clock: &'a dyn Clock,
}

/// The bus thread.
pub(super) struct BusLoop<'a, B: CanBus> {
    shared: BusShared<'a>,
    settings: RunSettings,
    encoder: Box<ScanEncoder<RUNS>>,
    frames: Box<FixedVec<Frame, FRAMES>>,
    transmitter: Transmitter<B>,
    commands: CommandReceiver,
    command_statistics: CommandStatistics,
    motion_heard: bool,
    echo: EchoWatch,
    watch: Watch,
    merged: Box<Merged<CELLS>>,
    sector_width_deg: f32,
    pairs: [PairState; MAX_PAIRS],
    condition: BusCondition,
    bus_trouble: Option<BusErrorKind>,
    full_since_ns: Option<u64>,
    /// Whether another node with the same number was told of.
    other_node_told: bool,
    status: Status,
    said: Health,
    /// What the newest scan said of itself.
    scan_health: Health,
    next_heartbeat_ns: u64,
    last_heartbeat_ns: u64,
    start_ns: u64,
    /// When the first of the detections came that are not sent yet.
    first_fresh_ns: Option<u64>,
    in_flight: Option<InFlight>,
    /// Scans that were abandoned so far.
    abandoned_scans: u64,
    latency: Latency,
    report: BusReport,
}

/// What the bus thread knows of a pair.
#[derive(Clone, Copy, Debug, Default)]
struct PairState {
    published: u64,
    fresh: bool,
    exposure_ns: Option<u64>,
    trouble: Option<Trouble>,
}

/// The scan that is being sent.
#[derive(Clone, Copy, Debug)]
struct InFlight {
    scan_index: u16,
    exposure_ns: u64,
    begun_ns: u64,
}

impl<'a, B: CanBus> BusLoop<'a, B> {
    /// Takes all the memory that it will ever need.
    ///
    /// # Errors
    /// When the settings ask for more cells than there is room for.
    pub(super) fn new(shared: BusShared<'a>, bus: B, plan: BusPlan<'_>) -> Result<Self, Failure> {
        let BusPlan { wire, settings, .. } = plan;
        let encoder = ScanEncoder::new(wire).map_err(|error| Failure::config(error, None))?;
        let ns = |ms: u32| u64::from(ms) * 1_000_000;
        let now_ns = shared.clock.now_ns();
        let status = Status { state: NodeState::Starting, health: Health::default(), last_scan: None };
        Ok(Self {
            encoder: Box::new(encoder),
            frames: Box::default(),
            transmitter: Transmitter::new(bus, FRAMES),
            commands: CommandReceiver::new(wire.address(), ns(settings.command_timeout_ms)),
            command_statistics: CommandStatistics::default(),
            motion_heard: settings.controller_required,
            echo: EchoWatch::new(ns(settings.echo_timeout_ms), settings.controller_required),
            watch: Watch::new(ns(settings.hold_ms)),
            merged: Box::new(Merged::new()),
            sector_width_deg: plan.sector_width_deg,
            pairs: [PairState::default(); MAX_PAIRS],
            condition: BusCondition::default(),
            bus_trouble: None,
            full_since_ns: None,
            other_node_told: false,
            status,
            said: status.health,
            scan_health: Health::default(),
            next_heartbeat_ns: now_ns,
            last_heartbeat_ns: 0,
            start_ns: now_ns,
            first_fresh_ns: None,
            in_flight: None,
            abandoned_scans: 0,
            latency: Latency::new(),
            report: BusReport::default(),
            settings: settings.clone(),
            shared,
        })
    }

    /// Works until it is told to stop, or until no pair will see anything any more.
    pub(super) fn run(mut self) -> BusReport {
        self.begin();
        while let Some(longest) = self.step() {
            self.shared.bell.wait(longest);
        }
        self.end()
    }

    /// The first word is that it starts, also where this thread comes so late that pictures were seen already.
    pub(super) fn begin(&mut self) {
        let now_ns = self.now_ns();
        self.judge(now_ns);
        self.heartbeat_if_due(now_ns);
        // A heartbeat that waits gives way to a newer one. What becomes of it is looked at with the next.
        let _ = self.pump();
    }

    /// Does what there is to do now. Returns how long it can wait for the bell, or `None` where nothing more is to come.
    pub(super) fn step(&mut self) -> Option<Duration> {
        let stopping = self.shared.stop.load(Ordering::Relaxed);
        let now_ns = self.now_ns();
        self.listen(now_ns);
        self.collect(now_ns);
        let waiting = self.wait_for_others(now_ns);
        if self.first_fresh_ns.is_some() && waiting.is_none() && !self.is_busy(now_ns) {
            self.scan(now_ns);
        }
        self.judge(now_ns);
        self.heartbeat_if_due(now_ns);
        let pump = self.pump();
        self.tell_progress();
        self.shared.alive.fetch_add(1, Ordering::Relaxed);
        let ended = self.pairs().all(|pair| pair.trouble == Some(Trouble::Ended) && !pair.fresh);
        if stopping || ended {
            return None;
        }
        let until_heartbeat = Duration::from_nanos(self.next_heartbeat_ns.saturating_sub(self.now_ns()));
        let longest = if pump.waiting > 0 { RETRY } else { LISTEN };
        Some(longest.min(until_heartbeat).min(waiting.unwrap_or(LISTEN)))
    }

    /// Says that nothing more will come, and sums up.
    pub(super) fn end(mut self) -> BusReport {
        self.farewell();
        self.finish()
    }

    fn now_ns(&self) -> u64 {
        self.shared.clock.now_ns()
    }

    fn pairs(&self) -> impl Iterator<Item = &PairState> {
        self.pairs.iter().take(self.shared.places.len())
    }

    /// Takes the frames that have arrived.
    fn listen(&mut self, now_ns: u64) {
        for _ in 0..LISTEN_FRAMES {
            match self.transmitter.receive() {
                Ok(None) => break,
                Ok(Some((arrived_ns, frame))) => {
                    let Id::Standard(id) = frame.id() else { continue };
                    if self.encoder.config().address().message(id) == Some(Message::Heartbeat) {
                        self.other_node(now_ns);
                        continue;
                    }
                    // What waited is as old as it is. What is wrong with a message is in the statistics.
                    let arrived_ns = arrived_ns.min(now_ns);
                    match self.commands.receive(id, frame.data(), arrived_ns) {
                        Ok(Command::VehicleMotion(_)) => self.motion_heard = true,
                        Ok(Command::ScanEcho(echo)) => self.echo.echo(echo.scan_index, arrived_ns),
                        Ok(Command::NotOurs | Command::Repeated) | Err(_) => {}
                    }
                }
                Err(error) => {
                    self.bus_trouble(error.kind(), &error, now_ns);
                    break;
                }
            }
        }
    }

    /// Looks what is new at the pairs.
    fn collect(&mut self, now_ns: u64) {
        for (pair, place) in self.pairs.iter_mut().zip(self.shared.places) {
            let newest = place.lock();
            pair.trouble = newest.trouble;
            if newest.published > pair.published {
                let overtaken = newest.published - pair.published - 1 + u64::from(pair.fresh);
                self.report.overtaken += overtaken;
                pair.published = newest.published;
                pair.exposure_ns = Some(newest.exposure_ns);
                pair.fresh = true;
                self.first_fresh_ns.get_or_insert(now_ns);
                // What was overtaken was seen, and something newer is in its place.
                if newest.missed > 0 {
                    self.watch.see(HealthReason::MissingPicture, HealthLevel::Degraded, now_ns);
                }
            }
        }
    }

    /// How long the pictures of one pair still wait for those of the others, so that one scan holds what was seen together.
    fn wait_for_others(&self, now_ns: u64) -> Option<Duration> {
        let waits = |pair: &PairState| !pair.fresh && pair.trouble.is_none() && pair.published > 0;
        let longest = u64::from(self.settings.merge_wait_ms) * 1_000_000;
        let waited = now_ns.saturating_sub(self.first_fresh_ns?);
        let left = longest.saturating_sub(waited);
        (left > 0 && self.pairs().any(waits)).then(|| Duration::from_nanos(left))
    }

    /// Whether a scan is on its way that may still come in time. If each new one cut off the one before, a bus that is a little
    /// too slow would never carry a whole one.
    fn is_busy(&self, now_ns: u64) -> bool {
        self.in_flight.is_some_and(|flight| now_ns.saturating_sub(flight.begun_ns) < self.deadline_ns())
    }

    /// Joins what the pairs saw and hands it to the transmitter.
    fn scan(&mut self, now_ns: u64) {
        self.first_fresh_ns = None;
        let stale_ns = self.stale_ns();
        self.merged.clear();
        let mut oldest_ns: Option<u64> = None;
        let mut oldest_fresh_ns: Option<u64> = None;
        for (pair, place) in self.pairs.iter_mut().zip(self.shared.places) {
            let fresh = std::mem::take(&mut pair.fresh);
            let newest = place.lock();
            let mut health = Health::default();
            // What a pair saw before it got into trouble is not mixed with what the others see now.
            match newest.trouble.filter(|trouble| *trouble != Trouble::Ended) {
                Some(trouble) => health.raise(HealthReason::MissingPicture, trouble.level()),
                None if newest.published == 0 || now_ns.saturating_sub(newest.exposure_ns) > stale_ns => {
                    health.raise(HealthReason::StalePicture, HealthLevel::Blind);
                }
                // The pairs of a rig have the same settings, and so the same cells.
                None if self.merged.add(&newest.detection).is_ok() => {
                    let older =
                        |known: Option<u64>| Some(known.map_or(newest.exposure_ns, |k| k.min(newest.exposure_ns)));
                    oldest_ns = older(oldest_ns);
                    oldest_fresh_ns = if fresh { older(oldest_fresh_ns) } else { oldest_fresh_ns };
                    continue;
                }
                None => {}
            }
            self.merged.add_health(health);
        }
        // The age is that of the oldest pictures in the map; late are only those that are new in it.
        let (Some(oldest_ns), Some(exposure_ns)) = (oldest_ns, oldest_fresh_ns) else { return };
        let age_ns = now_ns.saturating_sub(oldest_ns);
        if now_ns.saturating_sub(exposure_ns) > self.deadline_ns() {
            self.watch.see(HealthReason::Late, HealthLevel::Degraded, now_ns);
        }
        let seen = self.merged.health();
        let health = seen.and(self.watch.health(now_ns));
        // What goes on being told for a while belongs to this scan as well: a node that is blind calls nothing free.
        if health.level >= HealthLevel::Blind {
            self.merged.withhold_free();
        }
        let (map, sectors) = (self.merged.map(), self.merged.sectors(self.sector_width_deg));
        // Counts the scans and not the frames: a gap would tell a receiver that it has missed something.
        let scan_index = self.report.scans as u16;
        self.scan_health = seen;
        let scan = Scan {
            scan_index,
            age_ns,
            health,
            geometry: &map.geometry,
            cells: &map.cells,
            sectors: &sectors,
            ground: self.merged.ground(),
        };
        self.frames.clear();
        // There is room for the frames of any scan.
        let Ok(encoded) = self.encoder.encode(&scan, self.frames.as_mut_view()) else { return };
        self.report.scans += 1;
        if encoded.dropped_cells > 0 {
            self.scan_health.raise(HealthReason::MapTruncated, HealthLevel::Degraded);
        }
        let taken = self.transmitter.scan(&self.frames).is_ok();
        // One that was still on its way is abandoned now.
        self.look_for_abandoned(now_ns);
        if taken {
            self.in_flight = Some(InFlight { scan_index, exposure_ns, begun_ns: now_ns });
        }
        let first = self.status.last_scan.is_none();
        self.status.state = NodeState::Running;
        self.status.last_scan = Some(scan_index);
        if first {
            // A receiver takes no scan from a node that is not running: it hears at once that this one is.
            self.next_heartbeat_ns = now_ns;
        }
        if let Ok(mut progress) = self.shared.progress.try_lock() {
            progress.age_ms = age_ns as f64 * 1.0e-6;
        }
    }

    fn stale_ns(&self) -> u64 {
        u64::from(self.settings.stale_ms) * 1_000_000
    }

    fn deadline_ns(&self) -> u64 {
        u64::from(self.settings.deadline_ms) * 1_000_000
    }

    fn late(&mut self, now_ns: u64) {
        self.report.late += 1;
        self.watch.see(HealthReason::Late, HealthLevel::Degraded, now_ns);
    }

    /// At 10 Hz, and at once when there are news.
    fn heartbeat_if_due(&mut self, now_ns: u64) {
        let news = self.status.health != self.said && now_ns.saturating_sub(self.last_heartbeat_ns) >= NEWS_NS;
        if news || now_ns >= self.next_heartbeat_ns {
            self.heartbeat(now_ns);
        }
    }

    fn heartbeat(&mut self, now_ns: u64) {
        let frame = self.encoder.heartbeat(&self.status);
        self.transmitter.heartbeat(&frame);
        self.said = self.status.health;
        self.last_heartbeat_ns = now_ns;
        self.next_heartbeat_ns = now_ns.saturating_add(HEARTBEAT_NS);
    }

    fn pump(&mut self) -> Pump {
        let now_ns = self.now_ns();
        let pump = self.transmitter.pump(now_ns);
        match pump.trouble {
            None => self.full_since_ns = None,
            // The queue of the kernel is short, and full whenever a scan goes out. That is nothing to worry about as long as it
            // does go out.
            Some(BusErrorKind::Full) => {
                let since_ns = *self.full_since_ns.get_or_insert(now_ns);
                if now_ns.saturating_sub(since_ns) > LONG_FULL_NS {
                    self.watch.see(HealthReason::BusTrouble, HealthLevel::Degraded, now_ns);
                }
            }
            Some(kind) => {
                self.watch.see(HealthReason::BusTrouble, HealthLevel::Degraded, now_ns);
                self.say_bus_trouble(kind, now_ns);
            }
        }
        self.look_for_abandoned(now_ns);
        if let (Some(finished), Some(flight)) = (pump.scan_finished, self.in_flight)
            && flight.scan_index == finished
        {
            self.in_flight = None;
            self.bus_good(now_ns);
            self.echo.sent(finished, now_ns);
            let latency_ns = now_ns.saturating_sub(flight.exposure_ns);
            self.latency.record(latency_ns);
            if latency_ns > self.deadline_ns() {
                self.late(now_ns);
            }
        }
        pump
    }

    /// A scan that was abandoned is one that no controller will ever have.
    fn look_for_abandoned(&mut self, now_ns: u64) {
        let abandoned = self.transmitter.counters().abandoned_scans;
        if abandoned > self.abandoned_scans {
            self.abandoned_scans = abandoned;
            self.in_flight = None;
            self.late(now_ns);
            self.watch.see(HealthReason::BusTrouble, HealthLevel::Degraded, now_ns);
        }
    }

    fn tell_progress(&self) {
        // Whoever looks at it never holds it for long.
        if let Ok(mut progress) = self.shared.progress.try_lock() {
            progress.scans = self.report.scans;
            progress.late = self.report.late;
            progress.health = self.status.health;
            progress.speed_m_s = self
                .commands
                .vehicle_motion(self.now_ns())
                .and_then(|motion| motion.speed_mm_per_s)
                .map(|speed| f32::from(speed) * 1.0e-3);
        }
    }

    /// Sends what still waits, and then says that nothing more will come.
    fn farewell(&mut self) {
        self.drain();
        self.status.state = NodeState::Stopping;
        self.heartbeat(self.now_ns());
        self.drain();
    }

    fn drain(&mut self) {
        let end_ns = self.now_ns().saturating_add(FAREWELL_NS);
        while self.pump().waiting > 0 && self.now_ns() < end_ns {
            self.shared.clock.sleep(RETRY);
        }
    }

    fn finish(self) -> BusReport {
        BusReport {
            latency: self.latency.summary(),
            sent: self.transmitter.counters().into(),
            commands: self.commands.statistics().into(),
            ..self.report
        }
    }
}
