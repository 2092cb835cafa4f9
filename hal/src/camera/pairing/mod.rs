//! Which left picture belongs to which right one: those of the same moment, by their times of exposure.

mod sequence;

use sequence::Sequence;

/// Pictures further apart than this come from clocks that do not agree, nanoseconds: no camera waits so long.
const APART_NS: u64 = 1_000_000_000;

/// A time further than this after the one before it has jumped, nanoseconds: a camera that delivered nothing for so long is
/// opened again, which begins anew.
const AHEAD_NS: u64 = 10_000_000_000;

/// One of the two cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Left camera.
    Left,
    /// Right camera.
    Right,
}

impl Side {
    /// The other camera.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }
}

/// What a driver says of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Time of exposure, nanoseconds.
    pub timestamp_ns: u64,
    /// Number that the driver gave it.
    pub sequence: u32,
}

/// Two pictures of the same moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Paired<T> {
    /// Left picture.
    pub left: T,
    /// Right picture.
    pub right: T,
    /// Time of exposure of the left picture, nanoseconds.
    pub timestamp_ns: u64,
    /// Time of exposure of the right picture after that of the left one, nanoseconds.
    pub skew_ns: i64,
    /// Number of the pair, from 0, with a gap for every moment of which a picture was lost or passed over.
    pub sequence: u32,
    /// Pictures of both sides that were lost since the pair before.
    pub missed: u32,
}

/// What was odd since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PairingCounts {
    /// Pairs made.
    pub pairs: u64,
    /// Pictures that came, but had no partner.
    pub unpaired: u64,
    /// Pictures that never came although there was room for them, told by gaps in their numbers, or came damaged.
    pub lost: u64,
    /// Pictures that were passed over because a newer one had come, or the caller was away for longer than there was room.
    pub passed_over: u64,
    /// Times of exposure that were before the one of the same camera's last picture, or more than ten seconds after it.
    pub jumps: u64,
    /// Numbers that began anew.
    pub restarts: u64,
    /// Pictures of both cameras whose times were more than a second apart: their clocks do not agree.
    pub apart: u64,
}

/// Pairs two streams of pictures. `T` is whatever stands for a picture: it is given back when its turn has come.
#[derive(Clone, Debug)]
pub struct Pairing<T> {
    tolerance_ns: u64,
    left: Stream<T>,
    right: Stream<T>,
    next: u32,
    /// How long the caller was away, in this call and the one before, nanoseconds.
    away_ns: [u64; 2],
    /// Pictures for which the driver has room meanwhile.
    room: u32,
    /// Pictures lost in front of a pair that turned out to be damaged.
    carried: u32,
    counts: PairingCounts,
}

#[derive(Clone, Debug)]
struct Stream<T> {
    held: Option<(u64, T)>,
    last_ns: Option<u64>,
    numbers: Sequence,
    /// Pictures lost since the last pair.
    lost: u32,
    /// Pictures passed over since the last pair, or left without a partner by that.
    passed_over: u32,
}

impl<T> Pairing<T> {
    /// Takes pictures for a pair whose exposures lie no more than `tolerance_ns` apart.
    pub const fn new(tolerance_ns: u64) -> Self {
        Self {
            tolerance_ns,
            left: Stream::new(),
            right: Stream::new(),
            next: 0,
            away_ns: [0; 2],
            room: 0,
            carried: 0,
            counts: PairingCounts { pairs: 0, unpaired: 0, lost: 0, passed_over: 0, jumps: 0, restarts: 0, apart: 0 },
        }
    }

    /// The side whose picture is needed next.
    pub const fn wanted(&self) -> Side {
        if self.left.held.is_none() { Side::Left } else { Side::Right }
    }

    /// Whether a picture of this side waits for its partner.
    pub const fn holds(&self, side: Side) -> bool {
        match side {
            Side::Left => self.left.held.is_some(),
            Side::Right => self.right.held.is_some(),
        }
    }

    /// Notes that the caller was away for `away_ns`, while the drivers had room for `room` pictures. When the room is used up
    /// they pass pictures over on the caller's behalf, which is no loss.
    pub const fn away(&mut self, away_ns: u64, room: u32) {
        // The gap is behind the pictures for which there was room, of which the newest fills one call.
        self.away_ns = [away_ns, self.away_ns[0]];
        self.room = room;
    }

    /// Takes a picture. Gives the pair that it completes; every picture that will never have a partner goes to `drop`.
    ///
    /// Of two that do not fit the older one is dropped: nothing that belongs to it can still come. Of two that are further
    /// apart than a second both are, since then the times themselves are wrong.
    pub fn push(&mut self, side: Side, stamp: Stamp, picture: T, mut drop: impl FnMut(Side, T)) -> Option<Paired<T>> {
        self.note(side, stamp);
        if let Some((_, older)) = self.stream(side).held.replace((stamp.timestamp_ns, picture)) {
            self.unpaired(side);
            drop(side, older);
        }
        let (left_ns, right_ns) = (self.left.held.as_ref()?.0, self.right.held.as_ref()?.0);
        let apart_ns = left_ns.abs_diff(right_ns);
        if apart_ns <= self.tolerance_ns {
            return self.pair();
        }
        self.counts.apart += u64::from(apart_ns > APART_NS);
        for (side, other_ns) in [(Side::Left, right_ns), (Side::Right, left_ns)] {
            let stream = self.stream(side);
            if let Some((_, picture)) = stream.held.take_if(|(ns, _)| *ns < other_ns || apart_ns > APART_NS) {
                self.unpaired(side);
                drop(side, picture);
            }
        }
        None
    }

    /// Notes a picture that came, but cannot be used.
    pub fn damaged(&mut self, side: Side, stamp: Stamp) {
        self.note(side, stamp);
        self.counts.lost += 1;
        let stream = self.stream(side);
        stream.lost = stream.lost.saturating_add(1);
    }

    /// Notes a good picture that is not wanted, since a newer one of its side has come. It is no loss.
    pub fn pass_over(&mut self, side: Side, stamp: Stamp) {
        self.note(side, stamp);
        self.counts.passed_over += 1;
        let stream = self.stream(side);
        stream.passed_over = stream.passed_over.saturating_add(1);
    }

    /// Takes back a pair whose pictures turned out to be damaged: both are lost.
    pub fn spoilt(&mut self, pair: &Paired<T>) {
        self.counts.pairs = self.counts.pairs.saturating_sub(1);
        self.counts.lost += 2;
        self.carried = self.carried.saturating_add(pair.missed).saturating_add(2);
    }

    /// Gives back what waits for a partner: too long, or in vain.
    pub fn release(&mut self, mut drop: impl FnMut(Side, T)) {
        for side in [Side::Left, Side::Right] {
            if let Some((_, picture)) = self.stream(side).held.take() {
                self.unpaired(side);
                drop(side, picture);
            }
        }
    }

    /// As [`Pairing::release`], and begins anew: the next pictures come from cameras that were opened again. The numbers of
    /// the pairs go on.
    pub fn restart(&mut self, drop: impl FnMut(Side, T)) {
        self.release(drop);
        self.away_ns = [0; 2];
        for stream in [&mut self.left, &mut self.right] {
            stream.last_ns = None;
            stream.numbers = Sequence::new();
        }
    }

    /// What was odd since the start.
    pub const fn counts(&self) -> PairingCounts {
        self.counts
    }

    fn stream(&mut self, side: Side) -> &mut Stream<T> {
        match side {
            Side::Left => &mut self.left,
            Side::Right => &mut self.right,
        }
    }

    fn note(&mut self, side: Side, stamp: Stamp) {
        let (away_ns, room) = (self.away_ns[0].max(self.away_ns[1]), self.room);
        let stream = match side {
            Side::Left => &mut self.left,
            Side::Right => &mut self.right,
        };
        let now_ns = stamp.timestamp_ns;
        let jumped = |last_ns: u64| now_ns < last_ns || now_ns - last_ns > AHEAD_NS;
        let before_ns = stream.last_ns.replace(now_ns);
        let step = stream.numbers.next(stamp.sequence);
        let period_ns = before_ns.map_or(0, |before_ns| now_ns.saturating_sub(before_ns) / (u64::from(step.lost) + 1));
        let no_room = period_ns > 0 && away_ns > period_ns.saturating_mul(room.into());
        let (total, count) = match no_room {
            true => (&mut stream.passed_over, &mut self.counts.passed_over),
            false => (&mut stream.lost, &mut self.counts.lost),
        };
        *total = total.saturating_add(step.lost);
        *count += u64::from(step.lost);
        self.counts.jumps += u64::from(before_ns.is_some_and(jumped));
        self.counts.restarts += u64::from(step.restarted);
    }

    fn unpaired(&mut self, side: Side) {
        let (own, other) = match side {
            Side::Left => (&mut self.left, &self.right),
            Side::Right => (&mut self.right, &self.left),
        };
        if other.passed_over > own.passed_over {
            // Its partner was passed over.
            self.counts.passed_over += 1;
            own.passed_over += 1;
        } else {
            self.counts.unpaired += 1;
            own.lost = own.lost.saturating_add(1);
        }
    }

    fn pair(&mut self) -> Option<Paired<T>> {
        let ((timestamp_ns, left), (right_ns, right)) = self.left.held.take().zip(self.right.held.take())?;
        let (mut gap, mut missed) = (0, std::mem::take(&mut self.carried));
        for stream in [&mut self.left, &mut self.right] {
            let lost = std::mem::take(&mut stream.lost);
            gap = gap.max(lost.saturating_add(std::mem::take(&mut stream.passed_over)));
            missed = missed.saturating_add(lost);
        }
        let sequence = self.next.wrapping_add(gap);
        self.next = sequence.wrapping_add(1);
        self.counts.pairs += 1;
        // No further apart than the tolerance, which is a fraction of a second.
        let skew_ns = right_ns.wrapping_sub(timestamp_ns).cast_signed();
        Some(Paired { left, right, timestamp_ns, skew_ns, sequence, missed })
    }
}

impl<T> Stream<T> {
    const fn new() -> Self {
        Self { held: None, last_ns: None, numbers: Sequence::new(), lost: 0, passed_over: 0 }
    }
}

#[cfg(test)]
mod tests;
