//! A bus that fails as a whole, for tests of what is behind it.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{BusCondition, BusError, BusErrorKind, CanBus, CanFrame, ControllerState};

/// Makes the bus behind fail: full, down, gone, disturbed or off, when told to or by chance from a seed.
///
/// Single frames are spoilt by a [`FaultInjector`](super::FaultInjector), which may stand behind this one. Times are those of
/// the frames that are sent: a trouble ends with the first call of `send` after its time, and receiving goes by the newest of
/// these times.
#[derive(Debug)]
pub struct BusFaultInjector<B> {
    bus: B,
    faults: BusFaultControl,
}

/// Tells a [`BusFaultInjector`] to fail, from any thread.
#[derive(Clone, Debug)]
pub struct BusFaultControl(Arc<Mutex<Faults>>);

/// What is going on, and what may come by chance.
#[derive(Debug)]
struct Faults {
    state: u64,
    now_ns: u64,
    /// Sends that still find the bus full.
    full_sends: u32,
    trouble: Option<Trouble>,
    condition: BusCondition,
    chances: [Chance; 5],
    counts: BusFaultCounts,
}

/// A state of the bus that lasts.
#[derive(Clone, Copy, Debug)]
struct Trouble {
    kind: Kind,
    /// `None`: it begins with the next frame that is sent.
    until_ns: Option<u64>,
    lasts_ns: u64,
}

/// What may happen to a bus. The number is the place among the chances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Full = 0,
    Down = 1,
    Gone = 2,
    Passive = 3,
    BusOff = 4,
}

/// One in `one_in` sends; never if 0.
#[derive(Clone, Copy, Debug, Default)]
struct Chance {
    one_in: u32,
    /// Sends for [`Kind::Full`], nanoseconds for the others.
    length: u64,
}

/// How often each fault was met. Counts stay at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusFaultCounts {
    /// Frames that found the bus full.
    pub full: u64,
    /// Times that the bus went down.
    pub down: u64,
    /// Times that the bus was gone.
    pub gone: u64,
    /// Times that the controller became error-passive because nobody acknowledged.
    pub passive: u64,
    /// Times that the controller went off the bus.
    pub bus_off: u64,
    /// Frames that were thrown away in silence while the controller was off the bus.
    pub swallowed: u64,
}

/// An error that was made, or one of the bus behind.
#[derive(Debug)]
pub enum BusFaultError<E> {
    /// Made.
    Made(BusErrorKind),
    /// Of the bus behind.
    Bus(E),
}

impl<B> BusFaultInjector<B> {
    /// Passes everything on to `bus` until it is told otherwise. The same seed and the same frames give the same faults.
    pub fn new(bus: B, seed: u64) -> Self {
        let faults = Faults {
            state: seed,
            now_ns: 0,
            full_sends: 0,
            trouble: None,
            condition: BusCondition::default(),
            chances: [Chance::default(); 5],
            counts: BusFaultCounts::default(),
        };
        Self { bus, faults: BusFaultControl(Arc::new(Mutex::new(faults))) }
    }

    /// What tells it to fail.
    pub fn control(&self) -> BusFaultControl {
        self.faults.clone()
    }

    /// The bus behind.
    pub fn into_inner(self) -> B {
        self.bus
    }
}

impl BusFaultControl {
    /// The next `sends` frames find the bus full.
    pub fn full_for(&self, sends: u32) {
        self.lock().full_sends = sends;
    }

    /// The interface is down for `lasts_ns` from the next frame on.
    pub fn down_for(&self, lasts_ns: u64) {
        self.lock().begin(Kind::Down, lasts_ns);
    }

    /// The interface is gone for `lasts_ns` from the next frame on.
    pub fn gone_for(&self, lasts_ns: u64) {
        self.lock().begin(Kind::Gone, lasts_ns);
    }

    /// Nobody acknowledges, and the controller is error-passive, for `lasts_ns` from the next frame on. Frames find the bus full.
    pub fn passive_for(&self, lasts_ns: u64) {
        self.lock().begin(Kind::Passive, lasts_ns);
    }

    /// The controller is off the bus for `lasts_ns` from the next frame on and is restarted then. Frames are thrown away in
    /// silence, and none arrive.
    pub fn bus_off_for(&self, lasts_ns: u64) {
        self.lock().begin(Kind::BusOff, lasts_ns);
    }

    /// Ends whatever goes on.
    pub fn recover(&self) {
        let mut faults = self.lock();
        faults.full_sends = 0;
        faults.end();
    }

    /// Chance that the bus becomes full for `sends` frames: one in `one_in` sends; 0 is never.
    pub fn set_full_chance(&self, one_in: u32, sends: u32) {
        self.set_chance(Kind::Full, one_in, u64::from(sends));
    }

    /// Chance that the interface goes down for `lasts_ns`: one in `one_in` sends; 0 is never.
    pub fn set_down_chance(&self, one_in: u32, lasts_ns: u64) {
        self.set_chance(Kind::Down, one_in, lasts_ns);
    }

    /// Chance that the interface is gone for `lasts_ns`: one in `one_in` sends; 0 is never.
    pub fn set_gone_chance(&self, one_in: u32, lasts_ns: u64) {
        self.set_chance(Kind::Gone, one_in, lasts_ns);
    }

    /// Chance that nobody acknowledges for `lasts_ns`: one in `one_in` sends; 0 is never.
    pub fn set_passive_chance(&self, one_in: u32, lasts_ns: u64) {
        self.set_chance(Kind::Passive, one_in, lasts_ns);
    }

    /// Chance that the controller goes off the bus for `lasts_ns`: one in `one_in` sends; 0 is never.
    pub fn set_bus_off_chance(&self, one_in: u32, lasts_ns: u64) {
        self.set_chance(Kind::BusOff, one_in, lasts_ns);
    }

    /// How often each fault was met.
    pub fn counts(&self) -> BusFaultCounts {
        self.lock().counts
    }

    fn set_chance(&self, kind: Kind, one_in: u32, length: u64) {
        if let Some(chance) = self.lock().chances.get_mut(kind as usize) {
            *chance = Chance { one_in, length };
        }
    }

    /// A panic elsewhere leaves whole numbers behind, so the lock stays usable.
    fn lock(&self) -> MutexGuard<'_, Faults> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What becomes of a frame.
enum Verdict {
    Pass,
    Swallow,
    Fail(BusErrorKind),
}

impl Faults {
    /// Judges the frame that is sent at `now_ns`.
    fn judge(&mut self, now_ns: u64) -> Verdict {
        self.now_ns = self.now_ns.max(now_ns);
        self.draw_fate();
        let now_ns = self.now_ns;
        if let Some(trouble) = &mut self.trouble {
            trouble.until_ns.get_or_insert(now_ns.saturating_add(trouble.lasts_ns));
        }
        if self.trouble.is_some_and(|trouble| trouble.until_ns.is_some_and(|until_ns| now_ns >= until_ns)) {
            self.end();
        }
        let verdict = match self.trouble.map(|trouble| trouble.kind) {
            Some(Kind::Down) => Verdict::Fail(BusErrorKind::Down),
            Some(Kind::Gone) => Verdict::Fail(BusErrorKind::Gone),
            Some(Kind::BusOff) => Verdict::Swallow,
            Some(Kind::Passive) => {
                // The controller sends the same frame again and again; each time nobody acknowledges it.
                self.condition.no_acknowledgement = self.condition.no_acknowledgement.saturating_add(1);
                self.condition.errors = self.condition.errors.saturating_add(1);
                Verdict::Fail(BusErrorKind::Full)
            }
            Some(Kind::Full) | None => match self.full_sends.checked_sub(1) {
                Some(left) => {
                    self.full_sends = left;
                    Verdict::Fail(BusErrorKind::Full)
                }
                None => Verdict::Pass,
            },
        };
        match verdict {
            Verdict::Fail(BusErrorKind::Full) => count(&mut self.counts.full),
            Verdict::Swallow => count(&mut self.counts.swallowed),
            Verdict::Fail(_) | Verdict::Pass => {}
        }
        verdict
    }

    /// Something may happen by chance while nothing else goes on.
    fn draw_fate(&mut self) {
        for kind in [Kind::Full, Kind::Down, Kind::Gone, Kind::Passive, Kind::BusOff] {
            // A draw for every chance, set or not: changing one chance leaves the others' draws as they are.
            let draw = self.draw();
            let chance = self.chances.get(kind as usize).copied().unwrap_or_default();
            let happens = chance.one_in > 0 && draw.is_multiple_of(u64::from(chance.one_in));
            if !happens || self.trouble.is_some() || self.full_sends > 0 {
                continue;
            }
            if kind == Kind::Full {
                self.full_sends = u32::try_from(chance.length).unwrap_or(u32::MAX);
            } else {
                self.begin(kind, chance.length);
            }
        }
    }

    fn begin(&mut self, kind: Kind, lasts_ns: u64) {
        self.end();
        self.trouble = Some(Trouble { kind, until_ns: None, lasts_ns });
        match kind {
            Kind::Full => {}
            Kind::Down => count(&mut self.counts.down),
            Kind::Gone => count(&mut self.counts.gone),
            Kind::Passive => {
                count(&mut self.counts.passive);
                self.condition.controller = ControllerState::ErrorPassive;
                self.condition.errors = self.condition.errors.saturating_add(1);
            }
            Kind::BusOff => {
                count(&mut self.counts.bus_off);
                self.condition.controller = ControllerState::BusOff;
                self.condition.errors = self.condition.errors.saturating_add(1);
            }
        }
    }

    fn end(&mut self) {
        if self.trouble.take().is_some_and(|trouble| trouble.kind == Kind::BusOff) {
            self.condition.restarts = self.condition.restarts.saturating_add(1);
        }
        self.condition.controller = ControllerState::ErrorActive;
    }

    /// SplitMix64 (Steele, Lea, Flood: Fast splittable pseudorandom number generators, 2014).
    const fn draw(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
}

impl<B: CanBus> CanBus for BusFaultInjector<B> {
    type Error = BusFaultError<B::Error>;

    fn send(&mut self, frame: &CanFrame, now_ns: u64) -> Result<(), Self::Error> {
        // The lock is not held while the bus behind works: whoever tells this one to fail need not wait for it.
        let verdict = self.faults.lock().judge(now_ns);
        match verdict {
            Verdict::Pass => self.bus.send(frame, now_ns).map_err(BusFaultError::Bus),
            Verdict::Swallow => Ok(()),
            Verdict::Fail(kind) => Err(BusFaultError::Made(kind)),
        }
    }

    fn receive(&mut self) -> Result<Option<(u64, CanFrame)>, Self::Error> {
        let kind = self.faults.lock().trouble.map(|trouble| trouble.kind);
        let lost = matches!(kind, Some(Kind::Down | Kind::Gone | Kind::BusOff));
        // What others send meanwhile never arrives.
        while lost && self.bus.receive().map_err(BusFaultError::Bus)?.is_some() {}
        match kind {
            Some(Kind::Down) => Err(BusFaultError::Made(BusErrorKind::Down)),
            Some(Kind::Gone) => Err(BusFaultError::Made(BusErrorKind::Gone)),
            _ => self.bus.receive().map_err(BusFaultError::Bus),
        }
    }

    /// That of the bus behind, with what was made added to it.
    fn condition(&self) -> BusCondition {
        let behind = self.bus.condition();
        let made = self.faults.lock().condition;
        BusCondition {
            controller: behind.controller.max(made.controller),
            no_acknowledgement: behind.no_acknowledgement.saturating_add(made.no_acknowledgement),
            errors: behind.errors.saturating_add(made.errors),
            restarts: behind.restarts.saturating_add(made.restarts),
            ..behind
        }
    }
}

impl<E: std::fmt::Display> std::fmt::Display for BusFaultError<E> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Made(kind) => write!(f, "the bus was told to fail: {kind:?}"),
            Self::Bus(error) => error.fmt(f),
        }
    }
}

impl<E: std::error::Error + 'static> std::error::Error for BusFaultError<E> {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Made(_) => None,
            Self::Bus(error) => Some(error),
        }
    }
}

impl<E: BusError + 'static> BusError for BusFaultError<E> {
    fn kind(&self) -> BusErrorKind {
        match self {
            Self::Made(kind) => *kind,
            Self::Bus(error) => error.kind(),
        }
    }
}

const fn count(counter: &mut u64) {
    *counter = counter.saturating_add(1);
}

#[cfg(test)]
mod tests {
    use embedded_can::StandardId;

    use super::*;
    use crate::can::{VirtualBus, VirtualNode};

    const MS: u64 = 1_000_000;

    struct Bench {
        faulty: BusFaultInjector<VirtualNode>,
        control: BusFaultControl,
        other: VirtualNode,
    }

    impl Bench {
        fn new(seed: u64) -> Self {
            println!("seed {seed}");
            let bus = VirtualBus::new(100_000);
            let (node, other) = (bus.attach(), bus.attach());
            let faulty = BusFaultInjector::new(node, seed);
            let control = faulty.control();
            Self { faulty, control, other }
        }

        fn send(&mut self, now_ms: u64) -> Result<(), BusErrorKind> {
            let frame = CanFrame::new(StandardId::new(0x400).unwrap(), &[1], false).unwrap();
            self.faulty.send(&frame, now_ms * MS).map_err(|error| error.kind())
        }

        fn arrived(&mut self) -> usize {
            std::iter::from_fn(|| self.other.receive().unwrap()).count()
        }

        fn send_back(&mut self, now_ms: u64) -> Result<bool, BusErrorKind> {
            self.other.send(&CanFrame::new(StandardId::new(0x40F).unwrap(), &[], false).unwrap(), now_ms * MS).unwrap();
            self.faulty.receive().map(|frame| frame.is_some()).map_err(|error| error.kind())
        }
    }

    #[test]
    fn each_fault_does_what_its_name_says_for_as_long_as_it_was_told() {
        let mut bench = Bench::new(1);
        assert_eq!((bench.send(0), bench.send_back(0)), (Ok(()), Ok(true)));
        bench.control.full_for(2);
        let full = Err(BusErrorKind::Full);
        assert_eq!([bench.send(1), bench.send(1), bench.send(1)], [full, full, Ok(())]);
        assert_eq!(bench.arrived(), 2);

        for (kind, lasting) in [
            (BusErrorKind::Down, BusFaultControl::down_for as fn(&BusFaultControl, u64)),
            (BusErrorKind::Gone, BusFaultControl::gone_for),
        ] {
            lasting(&bench.control, 50 * MS);
            assert_eq!([bench.send(10), bench.send(59)], [Err(kind); 2]);
            assert_eq!(bench.send_back(59), Err(kind));
            assert_eq!(bench.send(60), Ok(()));
            assert_eq!(bench.send_back(60), Ok(true), "only what came since");
            assert_eq!(bench.faulty.receive().unwrap(), None);
            bench.faulty.faults.lock().now_ns = 0;
        }
        assert_eq!(bench.arrived(), 2);
        assert_eq!(bench.faulty.condition(), BusCondition::default());
    }

    #[test]
    fn a_controller_without_company_is_passive_and_full_and_one_off_the_bus_is_silent() {
        let mut bench = Bench::new(2);
        bench.control.passive_for(20 * MS);
        assert_eq!([bench.send(0), bench.send(19)], [Err(BusErrorKind::Full); 2]);
        let condition = bench.faulty.condition();
        assert_eq!((condition.controller, condition.no_acknowledgement), (ControllerState::ErrorPassive, 2));
        assert_eq!(bench.send(20), Ok(()));
        assert_eq!(bench.faulty.condition().controller, ControllerState::ErrorActive);
        assert_eq!(bench.arrived(), 1);

        bench.control.bus_off_for(30 * MS);
        assert_eq!([bench.send(20), bench.send(49)], [Ok(()); 2]);
        assert_eq!((bench.send_back(49), bench.arrived()), (Ok(false), 0));
        assert_eq!(bench.faulty.condition().controller, ControllerState::BusOff);
        assert_eq!(bench.send(50), Ok(()));
        assert_eq!((bench.arrived(), bench.send_back(50)), (1, Ok(true)));
        let condition = bench.faulty.condition();
        assert_eq!((condition.controller, condition.restarts), (ControllerState::ErrorActive, 1));

        bench.control.bus_off_for(u64::MAX);
        assert_eq!(bench.send(60), Ok(()));
        bench.control.recover();
        assert_eq!((bench.send(60), bench.arrived(), bench.faulty.condition().restarts), (Ok(()), 1, 2));
        let counts = BusFaultCounts { full: 2, passive: 1, bus_off: 2, swallowed: 3, ..BusFaultCounts::default() };
        assert_eq!(bench.control.counts(), counts);
    }

    #[test]
    fn chances_come_as_often_as_they_say_and_the_same_seed_gives_the_same() {
        let run = |seed| {
            let mut bench = Bench::new(seed);
            bench.control.set_full_chance(100, 3);
            bench.control.set_down_chance(500, 10 * MS);
            bench.control.set_gone_chance(500, 10 * MS);
            bench.control.set_passive_chance(500, 10 * MS);
            bench.control.set_bus_off_chance(500, 10 * MS);
            let answers: Vec<_> = (0..20_000).map(|now_ms| bench.send(now_ms)).collect();
            (answers, bench.control.counts(), bench.arrived())
        };
        let (answers, counts, arrived) = run(3);
        // A fault of 3 sends or 10 ms in about 500 / 9 sends.
        for times in [counts.down, counts.gone, counts.passive, counts.bus_off] {
            assert!((20..60).contains(&times), "{counts:?}");
        }
        assert_eq!(answers.iter().filter(|answer| answer.is_ok()).count(), arrived + counts.swallowed as usize);
        assert_eq!(run(3), (answers, counts, arrived));
        assert_ne!(run(4).1, counts);
    }
}
