//! Instructions, stage by stage.

use core::arch::asm;

use cortex_m::peripheral::{SYST, syst::SystClkSource};
use fencepost_core::detector::{Probe, Stage};

/// Instructions for each tick of the system timer: under `-icount shift=0` an instruction takes a nanosecond, and the board's clock
/// has 25 MHz.
pub(crate) const INSTRUCTIONS_PER_TICK: u32 = 40;

/// Stages of the detector, and what comes before and after them.
const PLACES: usize = Stage::ALL.len() + 1;

/// Where the time goes to that belongs to no stage.
const ELSEWHERE: usize = Stage::ALL.len();

/// Counts ticks for each stage. A stage must not take longer than the timer's 24 bits, 671 million instructions.
pub(crate) struct Clock {
    before: u32,
    place: usize,
    ticks: [u32; PLACES],
}

impl Clock {
    /// Starts the timer.
    pub(crate) fn new(mut timer: SYST) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(0x00ff_ffff);
        timer.clear_current();
        timer.enable_counter();
        Self { before: 0x00ff_ffff, place: ELSEWHERE, ticks: [0; PLACES] }
    }

    /// Forgets what was counted.
    pub(crate) fn begin(&mut self) {
        self.ticks = [0; PLACES];
        self.before = SYST::get_current();
        self.place = ELSEWHERE;
    }

    /// Whether a loop takes the instructions that it has: that the simulator counts, and the board's clock has the rate that is
    /// taken for granted.
    pub(crate) fn counts(&mut self) -> bool {
        const ROUNDS: u32 = 100_000;
        self.begin();
        // SAFETY: counts a register down.
        unsafe { asm!("2:", "subs {0}, #1", "bne 2b", inout(reg) ROUNDS => _, options(nomem, nostack)) };
        let [.., counted] = self.instructions();
        // The timer's own reading takes some, and ticks are not begun together with the loop.
        counted.abs_diff(2 * ROUNDS) <= 2 * INSTRUCTIONS_PER_TICK
    }

    /// What follows belongs to no stage.
    pub(crate) fn leave(&mut self) {
        self.turn(ELSEWHERE);
    }

    /// Instructions of each stage in turn, and those of none.
    pub(crate) fn instructions(&mut self) -> [u32; PLACES] {
        self.turn(self.place);
        self.ticks.map(|ticks| ticks.saturating_mul(INSTRUCTIONS_PER_TICK))
    }

    #[inline]
    fn turn(&mut self, place: usize) {
        let now = SYST::get_current();
        // It counts down.
        if let Some(ticks) = self.ticks.get_mut(self.place) {
            *ticks += self.before.wrapping_sub(now) & 0x00ff_ffff;
        }
        (self.before, self.place) = (now, place);
    }
}

impl Probe for Clock {
    fn enter(&mut self, stage: Stage) {
        self.turn(stage as usize);
    }
}
