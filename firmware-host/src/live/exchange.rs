//! What passes between the threads of the loop, in memory that is there from the start.

use std::{
    sync::{
        Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use fencepost_core::{detector::Detection, health::HealthLevel};
use fencepost_hal::camera::CameraErrorKind;

use crate::detector::{CELLS, OBSTACLES};

/// The newest that a pair's thread has to say.
#[derive(Debug)]
pub(super) struct Newest {
    /// Counts the detections; 0 before the first.
    pub(super) published: u64,
    /// Exposure of the pictures, nanoseconds of the monotonic clock; never later than now, whatever the camera says.
    pub(super) exposure_ns: u64,
    /// Pictures that were lost before these.
    pub(super) missed: u32,
    /// What was seen.
    pub(super) detection: Detection<OBSTACLES, CELLS>,
    /// What has gone wrong since; `None` after a good pair.
    pub(super) trouble: Option<Trouble>,
}

/// Why a pair of cameras says nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Trouble {
    /// An error of the camera.
    Camera(CameraErrorKind),
    /// Pictures of the wrong size.
    NotLookedAt,
    /// No further pictures will come.
    Ended,
}

/// One pair's place, written by its thread and read by the bus thread.
#[derive(Debug)]
pub(super) struct Place {
    newest: Mutex<Box<Newest>>,
    /// Rises as long as the thread lives.
    pub(super) alive: AtomicU64,
}

impl Place {
    pub(super) fn new() -> Self {
        let newest = Newest { published: 0, exposure_ns: 0, missed: 0, detection: Detection::new(), trouble: None };
        Self { newest: Mutex::new(Box::new(newest)), alive: AtomicU64::new(0) }
    }

    /// Nobody holds it for longer than it takes to copy a detection.
    pub(super) fn lock(&self) -> MutexGuard<'_, Box<Newest>> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn publish(&self, exposure_ns: u64, missed: u32, now_ns: u64, detection: &Detection<OBSTACLES, CELLS>) {
        let mut newest = self.lock();
        newest.published += 1;
        // A time of exposure that lies ahead would make the data young for ever.
        newest.exposure_ns = exposure_ns.min(now_ns);
        newest.missed = missed;
        newest.trouble = None;
        copy(&mut newest.detection, detection);
    }

    /// Says what has gone wrong. What was seen before stays, and ages.
    pub(super) fn fail(&self, trouble: Trouble) {
        self.lock().trouble = Some(trouble);
    }

    /// Whether its camera has nothing more to deliver.
    pub(super) fn has_ended(&self) -> bool {
        self.lock().trouble == Some(Trouble::Ended)
    }

    pub(super) fn count_alive(&self) {
        self.alive.fetch_add(1, Ordering::Relaxed);
    }
}

/// Copies without a table on the stack in between.
pub(super) fn copy(to: &mut Detection<OBSTACLES, CELLS>, from: &Detection<OBSTACLES, CELLS>) {
    to.map.geometry = from.map.geometry;
    to.map.cells.clear();
    // Both tables have the same capacity.
    let _ = to.map.cells.extend_from_slice(&from.map.cells);
    to.obstacles.clear();
    let _ = to.obstacles.extend_from_slice(&from.obstacles);
    to.sectors = from.sectors;
    to.ground = from.ground;
    to.health = from.health;
    to.statistics = from.statistics;
}

impl Trouble {
    /// How far a pair of cameras in this trouble can be trusted.
    pub(super) const fn level(self) -> HealthLevel {
        match self {
            Self::Camera(CameraErrorKind::NoPicture | CameraErrorKind::Damaged) | Self::Ended => HealthLevel::Blind,
            Self::Camera(CameraErrorKind::Lost | CameraErrorKind::Unusable) | Self::NotLookedAt => HealthLevel::Fault,
        }
    }
}

/// Wakes the bus thread.
#[derive(Debug, Default)]
pub(super) struct Bell {
    rung: Mutex<bool>,
    condition: Condvar,
}

impl Bell {
    pub(super) fn ring(&self) {
        *self.rung.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.condition.notify_one();
    }

    /// Waits for the bell, but no longer than `longest`.
    pub(super) fn wait(&self, longest: Duration) {
        let rung = self.rung.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.condition.wait_timeout_while(rung, longest, |rung| !*rung);
        let (mut rung, _) = waited.unwrap_or_else(PoisonError::into_inner);
        *rung = false;
    }
}
