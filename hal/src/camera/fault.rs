//! A camera that spoils pictures, for tests of what is behind it.

use core::fmt;

use fencepost_core::picture::Picture;

use super::{Camera, CameraError, CameraErrorKind, StereoPair};

/// More pairs in a row than this are never dropped, so that a call ends whatever the chances are.
const MOST_DROPPED: u32 = 100;

/// What a covered lens lets through, grey value, and the noise of the sensor on top of it.
const COVERED_GREY: u8 = 14;
const COVERED_NOISE: u64 = 4;

/// Spoils pairs on their way from the camera behind. Everything passes until a fault is set.
///
/// While a fault keeps a pair back, the pair is taken from the camera behind and thrown away: time goes by as it would.
/// All memory is taken at the start.
#[derive(Clone, Debug)]
pub struct FaultyCamera<C> {
    camera: C,
    faults: Faults,
}

/// What is set, and the memory to do it in: apart from the camera, which lends its pair meanwhile.
#[derive(Clone, Debug)]
struct Faults {
    size: (usize, usize),
    state: u64,
    stall_calls: u32,
    lost_calls: u32,
    damaged_calls: u32,
    drop_percent: u8,
    damage_percent: u8,
    frozen: Sides,
    dark: Sides,
    saturated: Sides,
    covered: Sides,
    covered_percent: u8,
    lag_pairs: usize,
    shift_rows: i32,
    exchanged: bool,
    time_offset_ns: i64,
    left: Vec<u8>,
    right: Vec<u8>,
    /// Right pictures of the last pairs, the newest at `newest`.
    history: Vec<Vec<u8>>,
    newest: usize,
    counts: FaultyCounts,
}

/// Cameras that a fault is on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sides {
    /// Neither.
    #[default]
    None,
    /// The left one.
    Left,
    /// The right one.
    Right,
    /// Both.
    Both,
}

/// How often each kind of fault was met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultyCounts {
    /// Pairs handed on, spoilt or not.
    pub pairs: u64,
    /// Calls that got no picture.
    pub stalled: u64,
    /// Calls that got the device as lost.
    pub lost: u64,
    /// Calls that got the pair as damaged.
    pub damaged: u64,
    /// Pairs that were dropped without a word.
    pub dropped: u64,
    /// Pairs handed on with pixels or times that are not those of the camera behind.
    pub spoilt: u64,
}

/// An error that was made, or one of the camera behind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultyError<E> {
    /// Made here.
    Made(CameraErrorKind),
    /// Of the camera behind.
    Camera(E),
}

impl Sides {
    /// Whether the left camera is one of them.
    pub const fn left(self) -> bool {
        matches!(self, Self::Left | Self::Both)
    }

    /// Whether the right camera is one of them.
    pub const fn right(self) -> bool {
        matches!(self, Self::Right | Self::Both)
    }
}

impl<C> FaultyCamera<C> {
    /// For a camera with pictures of `size`, width and height in pixels; pairs of another size pass with their pixels as
    /// they are. The right picture can lag by up to `most_lag` pairs. The same seed gives the same faults.
    pub fn new(camera: C, size: (usize, usize), most_lag: usize, seed: u64) -> Self {
        let picture = vec![0; size.0.saturating_mul(size.1)];
        let faults = Faults {
            size,
            state: seed,
            stall_calls: 0,
            lost_calls: 0,
            damaged_calls: 0,
            drop_percent: 0,
            damage_percent: 0,
            frozen: Sides::None,
            dark: Sides::None,
            saturated: Sides::None,
            covered: Sides::None,
            covered_percent: 100,
            lag_pairs: 0,
            shift_rows: 0,
            exchanged: false,
            time_offset_ns: 0,
            left: picture.clone(),
            right: picture.clone(),
            history: vec![picture; most_lag + 1],
            newest: 0,
            counts: FaultyCounts::default(),
        };
        Self { camera, faults }
    }

    /// The next `calls` calls get no picture.
    pub const fn set_stall(&mut self, calls: u32) {
        self.faults.stall_calls = calls;
    }

    /// The next `calls` calls get the device as lost.
    pub const fn set_lost(&mut self, calls: u32) {
        self.faults.lost_calls = calls;
    }

    /// The next `calls` calls get the pair as damaged.
    pub const fn set_damaged(&mut self, calls: u32) {
        self.faults.damaged_calls = calls;
    }

    /// Chance that a pair is dropped, percent; the next one says that it is missed.
    pub const fn set_drop_chance(&mut self, percent: u8) {
        self.faults.drop_percent = percent;
    }

    /// Chance that a pair is damaged, percent.
    pub const fn set_damage_chance(&mut self, percent: u8) {
        self.faults.damage_percent = percent;
    }

    /// These cameras show what they showed last, with times that go on.
    pub const fn set_frozen(&mut self, sides: Sides) {
        self.faults.frozen = sides;
    }

    /// These cameras are underexposed: a thirty-second part of every grey value.
    pub const fn set_dark(&mut self, sides: Sides) {
        self.faults.dark = sides;
    }

    /// These cameras are overexposed: nearly everything is white.
    pub const fn set_saturated(&mut self, sides: Sides) {
        self.faults.saturated = sides;
    }

    /// These cameras have something on their lens that covers `percent` of each row, from the left.
    pub const fn set_covered(&mut self, sides: Sides, percent: u8) {
        self.faults.covered = sides;
        self.faults.covered_percent = if percent > 100 { 100 } else { percent };
    }

    /// The right picture is that of `pairs` pairs before, with times that agree. No more than the camera was made for.
    pub const fn set_right_lag(&mut self, pairs: usize) {
        self.faults.lag_pairs = if pairs < self.faults.history.len() { pairs } else { self.faults.history.len() - 1 };
    }

    /// The right picture is moved down by `rows`, or up where that is negative.
    pub const fn set_row_shift(&mut self, rows: i32) {
        self.faults.shift_rows = rows;
    }

    /// Left and right are exchanged.
    pub const fn set_exchanged(&mut self, exchanged: bool) {
        self.faults.exchanged = exchanged;
    }

    /// Times of exposure are moved by this, nanoseconds; they go round at 2^64.
    pub const fn set_time_offset(&mut self, offset_ns: i64) {
        self.faults.time_offset_ns = offset_ns;
    }

    /// Takes every fault away.
    pub const fn heal(&mut self) {
        self.faults.stall_calls = 0;
        self.faults.lost_calls = 0;
        self.faults.damaged_calls = 0;
        self.faults.drop_percent = 0;
        self.faults.damage_percent = 0;
        self.faults.frozen = Sides::None;
        self.faults.dark = Sides::None;
        self.faults.saturated = Sides::None;
        self.faults.covered = Sides::None;
        self.faults.lag_pairs = 0;
        self.faults.shift_rows = 0;
        self.faults.exchanged = false;
        self.faults.time_offset_ns = 0;
    }

    /// How often each kind of fault was met.
    pub const fn counts(&self) -> FaultyCounts {
        self.faults.counts
    }

    /// The camera behind.
    pub const fn camera(&mut self) -> &mut C {
        &mut self.camera
    }

    /// The camera behind.
    pub fn into_inner(self) -> C {
        self.camera
    }
}

impl Faults {
    fn happens(&mut self, percent: u8) -> bool {
        // A draw for every chance, set or not: changing one chance leaves the others' draws as they are.
        draw(&mut self.state) % 100 < u64::from(percent)
    }

    /// The error that the next pair becomes, if it becomes one. `stall` comes before `lost` comes before `damaged`.
    fn error(&mut self) -> Option<CameraErrorKind> {
        let by_chance = self.happens(self.damage_percent);
        let (left, kind, count) = if self.stall_calls > 0 {
            (&mut self.stall_calls, CameraErrorKind::NoPicture, &mut self.counts.stalled)
        } else if self.lost_calls > 0 {
            (&mut self.lost_calls, CameraErrorKind::Lost, &mut self.counts.lost)
        } else if self.damaged_calls > 0 || by_chance {
            (&mut self.damaged_calls, CameraErrorKind::Damaged, &mut self.counts.damaged)
        } else {
            return None;
        };
        *left = left.saturating_sub(1);
        *count += 1;
        Some(kind)
    }

    fn is_spoilt(&self) -> bool {
        let is_set = |sides: Sides| !matches!(sides, Sides::None);
        is_set(self.frozen)
            || is_set(self.dark)
            || is_set(self.saturated)
            || is_set(self.covered)
            || self.lag_pairs > 0
            || self.shift_rows != 0
            || self.exchanged
            || self.time_offset_ns != 0
    }

    /// The pair with the pixels that were taken over; none where it has another size.
    fn lend<'a>(&'a self, pair: &StereoPair<'a>) -> Option<StereoPair<'a>> {
        let (width, height) = self.size;
        if !self.fits(pair) {
            return None;
        }
        let left = Picture::packed(&self.left, width, height).ok()?;
        let right = Picture::packed(&self.right, width, height).ok()?;
        let (left, right) = if self.exchanged { (right, left) } else { (left, right) };
        Some(StereoPair { left, right, ..*pair })
    }

    fn fits(&self, pair: &StereoPair<'_>) -> bool {
        [pair.left, pair.right].iter().all(|picture| (picture.width(), picture.height()) == self.size)
    }

    /// Takes over the pixels of a pair, spoilt as is set.
    fn spoil(&mut self, pair: &StereoPair<'_>) {
        if !self.fits(pair) {
            return;
        }
        let (width, height) = self.size;
        let count = self.history.len();
        self.newest = (self.newest + 1) % count;
        if let Some(newest) = self.history.get_mut(self.newest) {
            copy(&pair.right, newest);
        }
        let lagging = (self.newest + count - self.lag_pairs) % count;
        if !self.frozen.left() {
            copy(&pair.left, &mut self.left);
        }
        if !self.frozen.right()
            && let Some(right) = self.history.get(lagging)
        {
            for (y, row) in self.right.chunks_exact_mut(width).enumerate() {
                // Rows that nothing is known of repeat the first or the last one.
                let from = (y as i64 - i64::from(self.shift_rows)).clamp(0, height as i64 - 1) as usize;
                row.copy_from_slice(&right[from * width..][..width]);
            }
        }
        let covered = width * usize::from(self.covered_percent) / 100;
        let Self { dark, saturated, covered: covers, frozen, state, .. } = self;
        let sides = [
            (&mut self.left, [dark.left(), saturated.left(), covers.left()], frozen.left()),
            (&mut self.right, [dark.right(), saturated.right(), covers.right()], frozen.right()),
        ];
        for (picture, [dark, saturated, is_covered], frozen) in sides {
            if frozen {
                continue;
            }
            for row in picture.chunks_exact_mut(width) {
                if dark {
                    row.iter_mut().for_each(|pixel| *pixel /= 32);
                }
                if saturated {
                    row.iter_mut().for_each(|pixel| *pixel = pixel.saturating_mul(8).saturating_add(160));
                }
                if is_covered {
                    let noise = |pixel: &mut u8| *pixel = COVERED_GREY + (draw(state) % COVERED_NOISE) as u8;
                    row.iter_mut().take(covered).for_each(noise);
                }
            }
        }
    }
}

impl<C: Camera> Camera for FaultyCamera<C> {
    type Error = FaultyError<C::Error>;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error> {
        let Self { camera, faults } = self;
        if let Some(kind) = faults.error() {
            return match camera.next_pair(|_| ()).map_err(FaultyError::Camera)? {
                Some(()) => Err(FaultyError::Made(kind)),
                None => Ok(None),
            };
        }
        let mut missed = 0_u32;
        for _ in 0..MOST_DROPPED {
            if !faults.happens(faults.drop_percent) {
                break;
            }
            let Some(before) = camera.next_pair(|pair| pair.missed).map_err(FaultyError::Camera)? else {
                return Ok(None);
            };
            missed = missed.saturating_add(before).saturating_add(2);
            faults.counts.dropped += 1;
        }
        let lent = camera.next_pair(|pair| {
            faults.counts.pairs += 1;
            faults.counts.spoilt += u64::from(faults.is_spoilt());
            let timestamp_ns = pair.timestamp_ns.wrapping_add_signed(faults.time_offset_ns);
            let pair = StereoPair { timestamp_ns, missed: pair.missed.saturating_add(missed), ..*pair };
            faults.spoil(&pair);
            consume(&faults.lend(&pair).unwrap_or(pair))
        });
        lent.map_err(FaultyError::Camera)
    }

    fn take_warning(&mut self) -> Option<String> {
        self.camera.take_warning()
    }
}

impl<E: CameraError> CameraError for FaultyError<E> {
    fn kind(&self) -> CameraErrorKind {
        match self {
            Self::Made(kind) => *kind,
            Self::Camera(error) => error.kind(),
        }
    }
}

impl<E: fmt::Display> fmt::Display for FaultyError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Made(CameraErrorKind::NoPicture) => write!(f, "no picture has come, as was set"),
            Self::Made(CameraErrorKind::Damaged) => write!(f, "the picture is damaged, as was set"),
            Self::Made(CameraErrorKind::Lost) => write!(f, "the camera is gone, as was set"),
            Self::Made(CameraErrorKind::Unusable) => write!(f, "the camera cannot be used, as was set"),
            Self::Camera(error) => error.fmt(f),
        }
    }
}

impl<E: core::error::Error> core::error::Error for FaultyError<E> {}

/// Copies a picture of the same size; of a smaller one what there is.
fn copy(from: &Picture<'_>, to: &mut [u8]) {
    for (y, row) in to.chunks_exact_mut(from.width()).take(from.height()).enumerate() {
        row.copy_from_slice(from.row(y));
    }
}

/// SplitMix64 (Steele, Lea, Flood: Fast splittable pseudorandom number generators, 2014).
const fn draw(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
#[path = "fault_tests.rs"]
mod tests;
