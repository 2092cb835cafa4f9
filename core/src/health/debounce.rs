//! Against flicker: a reason is told when it has been seen often enough, and until it has been gone for long enough.

use super::{Health, HealthLevel, HealthReason};

/// Number of reasons.
const REASONS: usize = HealthReason::ALL.len();

/// What was found at one moment: a level for each reason, [`HealthLevel::Ok`] where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Findings {
    levels: [HealthLevel; REASONS],
}

/// Decides which findings are told.
///
/// A reason is told from the `trigger_frames`-th update in a row on that finds it, at once if it [is
/// plain](HealthReason::is_plain), and until `release_frames` updates in a row have not found it. The level that is told with it
/// rises at once and falls in the same way.
#[derive(Clone, Copy, Debug)]
pub struct Debounce {
    trigger_frames: u8,
    release_frames: u8,
    told: Findings,
    found_for: [u8; REASONS],
    milder_for: [u8; REASONS],
}

impl Findings {
    /// Nothing found.
    pub const NONE: Self = Self { levels: [HealthLevel::Ok; REASONS] };

    /// Adds a reason, at `level` at least.
    pub fn raise(&mut self, reason: HealthReason, level: HealthLevel) {
        if let Some(known) = self.levels.get_mut(reason as usize) {
            *known = level.max(*known);
        }
    }

    /// How bad `reason` is.
    pub fn level(&self, reason: HealthReason) -> HealthLevel {
        self.levels.get(reason as usize).copied().unwrap_or(HealthLevel::Ok)
    }

    /// All of it: the worst level and every reason.
    pub fn health(&self) -> Health {
        let mut health = Health::OK;
        for reason in HealthReason::ALL {
            let level = self.level(reason);
            if level > HealthLevel::Ok {
                health.raise(reason, level);
            }
        }
        health
    }
}

impl Default for Findings {
    fn default() -> Self {
        Self::NONE
    }
}

impl Debounce {
    /// Tells nothing yet. Zero counts as one.
    pub const fn new(trigger_frames: u8, release_frames: u8) -> Self {
        let told = Findings::NONE;
        Self { trigger_frames, release_frames, told, found_for: [0; REASONS], milder_for: [0; REASONS] }
    }

    /// Takes what was found now, and returns what is to be told.
    pub fn update(&mut self, found: &Findings) -> Health {
        let counts = self.found_for.iter_mut().zip(&mut self.milder_for);
        for (((told, (found_for, milder_for)), &found), reason) in
            self.told.levels.iter_mut().zip(counts).zip(&found.levels).zip(HealthReason::ALL)
        {
            *found_for = if found > HealthLevel::Ok { found_for.saturating_add(1) } else { 0 };
            let is_told = *told > HealthLevel::Ok;
            if found >= *told {
                *milder_for = 0;
                if is_told || reason.is_plain() || *found_for >= self.trigger_frames {
                    *told = found;
                }
                continue;
            }
            *milder_for = milder_for.saturating_add(1);
            if *milder_for >= self.release_frames {
                *told = found;
                *milder_for = 0;
            }
        }
        self.told.health()
    }

    /// Begins every count anew: the next update does not follow on those before. What is told goes on being told.
    pub const fn interrupt(&mut self) {
        self.found_for = [0; REASONS];
        self.milder_for = [0; REASONS];
    }

    /// What is being told.
    pub fn told(&self) -> Health {
        self.told.health()
    }
}

#[cfg(test)]
#[path = "debounce_tests.rs"]
mod tests;
