//! What only the loop can know: pictures that do not come, a bus that does not carry, a controller that is silent.

use fencepost_core::health::{Health, HealthLevel, HealthReason};
use fencepost_hal::can::{BusErrorKind, CanBus, ControllerState};

use super::{BusLoop, PairState, Severity, Trouble};

impl<B: CanBus> BusLoop<'_, B> {
    /// Everything that only the loop can know.
    pub(super) fn judge(&mut self, now_ns: u64) {
        self.judge_pairs(now_ns);
        self.judge_bus(now_ns);
        self.judge_commands(now_ns);
        self.status.health = self.scan_health_now().and(self.watch.health(now_ns));
    }

    /// Before the first scan nothing is known.
    fn scan_health_now(&self) -> Health {
        if self.status.last_scan.is_none() { Health::default() } else { self.scan_health }
    }

    fn judge_pairs(&mut self, now_ns: u64) {
        let stale_ns = self.stale_ns();
        let since_ns = |pair: &PairState| now_ns.saturating_sub(pair.exposure_ns.unwrap_or(self.start_ns));
        let is_stale = |pair: &PairState| since_ns(pair) > stale_ns && pair.trouble != Some(Trouble::Ended);
        // A rig that still sees something with one of its pairs is degraded; what the others do not see is unknown in its map.
        let some_good = self.pairs().any(|pair| pair.trouble.is_none() && !is_stale(pair));
        let limit = if some_good { HealthLevel::Degraded } else { HealthLevel::Fault };
        let trouble = self.pairs().filter_map(|pair| pair.trouble).filter(|trouble| *trouble != Trouble::Ended);
        let worst = trouble.map(Trouble::level).max();
        let stale = self.pairs().any(is_stale);
        if let Some(level) = worst {
            self.watch.see(HealthReason::MissingPicture, level.min(limit), now_ns);
        }
        if stale {
            self.watch.see(HealthReason::StalePicture, HealthLevel::Blind.min(limit), now_ns);
        }
    }

    fn judge_bus(&mut self, now_ns: u64) {
        let before = std::mem::replace(&mut self.condition, self.transmitter.bus().condition());
        let now = self.condition;
        let rose = now.errors > before.errors
            || now.no_acknowledgement > before.no_acknowledgement
            || now.restarts > before.restarts
            || now.overflows > before.overflows;
        // It is late from its deadline on, not only when it is through or given up.
        let deadline_ns = self.deadline_ns();
        if self.in_flight.is_some_and(|flight| now_ns.saturating_sub(flight.exposure_ns) > deadline_ns) {
            self.watch.see(HealthReason::Late, HealthLevel::Degraded, now_ns);
        }
        if rose || now.controller >= ControllerState::ErrorPassive {
            self.watch.see(HealthReason::BusTrouble, HealthLevel::Degraded, now_ns);
        }
        if now.controller != before.controller {
            let (severity, words) = match now.controller {
                ControllerState::ErrorActive => (Severity::Note, "takes part in full again"),
                ControllerState::Warning => (Severity::Warning, "counts many errors; look at cable, ends and bit rate"),
                ControllerState::ErrorPassive => (
                    Severity::Warning,
                    "is error-passive; look at cable, ends, bit rate and whether another node is there",
                ),
                ControllerState::BusOff => {
                    (Severity::Warning, "is off the bus; look at the cable, and set restart-ms so that it comes back")
                }
            };
            self.shared.events.tell(now_ns, severity, format_args!("bus: the CAN controller {words}"));
        }
    }

    fn judge_commands(&mut self, now_ns: u64) {
        let before = std::mem::replace(&mut self.command_statistics, *self.commands.statistics());
        let now = self.command_statistics;
        let damaged = now.lost > before.lost || now.crc_errors > before.crc_errors || now.refused > before.refused;
        let silent = self.motion_heard && self.commands.vehicle_motion(now_ns).is_none();
        if damaged || silent {
            self.watch.see(HealthReason::CommandTrouble, HealthLevel::Degraded, now_ns);
        }
        if self.echo.is_missing(now_ns) {
            self.watch.see(HealthReason::EchoMissing, HealthLevel::Degraded, now_ns);
        }
    }

    pub(super) fn say_bus_trouble(&mut self, kind: BusErrorKind, now_ns: u64) {
        if self.bus_trouble != Some(kind) {
            self.bus_trouble = Some(kind);
            match self.transmitter.error() {
                Some(error) => {
                    self.shared.events.tell(now_ns, Severity::Warning, format_args!("bus: {error}"));
                }
                None => {
                    self.shared.events.tell(
                        now_ns,
                        Severity::Warning,
                        format_args!("bus: nothing can be sent; look at the cable"),
                    );
                }
            }
        }
    }

    /// Somebody else sends under the number of this node: receivers get two sources of cells in one.
    pub(super) fn other_node(&mut self, now_ns: u64) {
        self.watch.see(HealthReason::BusTrouble, HealthLevel::Degraded, now_ns);
        if !std::mem::replace(&mut self.other_node_told, true) {
            let text =
                format_args!("bus: another node has the same number; give each computer its own `node` in [wire]");
            self.shared.events.tell(now_ns, Severity::Warning, text);
        }
    }

    /// The side that listens has found that something is wrong.
    pub(super) fn bus_trouble(&mut self, kind: BusErrorKind, error: &B::Error, now_ns: u64) {
        self.watch.see(HealthReason::BusTrouble, HealthLevel::Degraded, now_ns);
        if self.bus_trouble != Some(kind) {
            self.bus_trouble = Some(kind);
            self.shared.events.tell(now_ns, Severity::Warning, format_args!("bus: {error}"));
        }
    }

    pub(super) fn bus_good(&mut self, now_ns: u64) {
        if self.bus_trouble.take().is_some() {
            self.shared.events.tell(now_ns, Severity::Note, format_args!("bus: frames go out again"));
        }
    }
}
