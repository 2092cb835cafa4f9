//! Pairs of pictures on their way from the camera to the disk, in memory that is taken at the start.

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel},
    time::Duration,
};

use fencepost_core::picture::Picture;
use fencepost_hal::camera::StereoPair;

/// A pair of pictures that waits to be written.
#[derive(Debug)]
pub(super) struct Filled {
    size: (usize, usize),
    left: Vec<u8>,
    right: Vec<u8>,
    timestamp_ns: u64,
    skew_ns: i64,
    sequence: u32,
    missed: u32,
}

/// The camera's end.
#[derive(Debug)]
pub(super) struct Filler {
    size: (usize, usize),
    empty: Receiver<Filled>,
    filled: SyncSender<Filled>,
}

/// The disk's end.
#[derive(Debug)]
pub(super) struct Stored {
    empty: SyncSender<Filled>,
    filled: Receiver<Filled>,
}

/// What comes to the disk's end.
#[derive(Debug)]
pub(super) enum Next {
    /// A pair.
    Pair(Filled),
    /// Nothing yet.
    NoneYet,
    /// The camera's end is gone, and everything is written.
    Ended,
}

/// What became of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Offer {
    /// It will be written.
    Taken,
    /// There is no room: it is dropped.
    Full,
    /// It has another size than the calibration: it is dropped.
    WrongSize,
    /// The disk's end is gone: there will be no room any more.
    Ended,
    /// Its time is not after the last one's: it is dropped.
    NotRising,
}

/// Room for `pairs` pairs (at least one) of pictures of `size`.
pub(super) fn queue(pairs: usize, size: (usize, usize)) -> (Filler, Stored) {
    let pairs = pairs.max(1);
    let (empty_in, empty_out) = sync_channel(pairs);
    let (filled_in, filled_out) = sync_channel(pairs);
    for _ in 0..pairs {
        let pixels = vec![0; size.0 * size.1];
        let pair =
            Filled { size, left: pixels.clone(), right: pixels, timestamp_ns: 0, skew_ns: 0, sequence: 0, missed: 0 };
        // There is room for all of them, and the other end is here.
        let _ = empty_in.try_send(pair);
    }
    (Filler { size, empty: empty_out, filled: filled_in }, Stored { empty: empty_in, filled: filled_out })
}

impl Filler {
    /// Copies the pair, if there is room. Never waits.
    pub(super) fn offer(&mut self, pair: &StereoPair<'_>) -> Offer {
        let fits = |picture: &Picture<'_>| (picture.width(), picture.height()) == self.size;
        if !fits(&pair.left) || !fits(&pair.right) {
            return Offer::WrongSize;
        }
        let mut slot = match self.empty.try_recv() {
            Ok(slot) => slot,
            Err(TryRecvError::Empty) => return Offer::Full,
            Err(TryRecvError::Disconnected) => return Offer::Ended,
        };
        copy(&pair.left, &mut slot.left);
        copy(&pair.right, &mut slot.right);
        slot.timestamp_ns = pair.timestamp_ns;
        slot.skew_ns = pair.skew_ns;
        slot.sequence = pair.sequence;
        slot.missed = pair.missed;
        match self.filled.try_send(slot) {
            Ok(()) => Offer::Taken,
            Err(_) => Offer::Ended,
        }
    }
}

impl Stored {
    /// Waits for the next pair, but no longer than `timeout`.
    pub(super) fn next(&self, timeout: Duration) -> Next {
        match self.filled.recv_timeout(timeout) {
            Ok(pair) => Next::Pair(pair),
            Err(RecvTimeoutError::Timeout) => Next::NoneYet,
            Err(RecvTimeoutError::Disconnected) => Next::Ended,
        }
    }

    /// Makes room again.
    pub(super) fn give_back(&self, pair: Filled) {
        // When the camera's end is gone, nobody needs it.
        let _ = self.empty.try_send(pair);
    }
}

impl Filled {
    /// Lends the pair; none where there are no pixels.
    pub(super) fn view<R>(&self, look: impl FnOnce(&StereoPair<'_>) -> R) -> Option<R> {
        let view = |pixels| Picture::packed(pixels, self.size.0, self.size.1).ok();
        let (left, right) = (view(&self.left)?, view(&self.right)?);
        let Self { timestamp_ns, skew_ns, sequence, missed, .. } = *self;
        Some(look(&StereoPair { left, right, timestamp_ns, skew_ns, sequence, missed }))
    }
}

fn copy(from: &Picture<'_>, to: &mut [u8]) {
    for (y, row) in to.chunks_exact_mut(from.width()).enumerate() {
        row.copy_from_slice(from.row(y));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WAIT: Duration = Duration::from_secs(10);

    fn offer(filler: &mut Filler, number: u8, size: (usize, usize)) -> Offer {
        // Rows further apart than they are long.
        let pixels: Vec<u8> = (0..size.1 * (size.0 + 3)).map(|i| i as u8 ^ number).collect();
        let picture = Picture::new(&pixels, size.0, size.1, size.0 + 3).unwrap();
        let (timestamp_ns, sequence) = (u64::from(number), u32::from(number));
        filler.offer(&StereoPair { left: picture, right: picture, timestamp_ns, skew_ns: 3, sequence, missed: 1 })
    }

    #[test]
    fn what_does_not_fit_is_dropped_and_what_fits_comes_out_in_order() {
        let (mut filler, stored) = queue(2, (5, 4));
        assert!(matches!(stored.next(Duration::ZERO), Next::NoneYet));
        let offers: Vec<Offer> = (0..4).map(|number| offer(&mut filler, number, (5, 4))).collect();
        assert_eq!(offers, [Offer::Taken, Offer::Taken, Offer::Full, Offer::Full]);
        assert_eq!(offer(&mut filler, 9, (5, 3)), Offer::WrongSize);
        for number in 0..2_u8 {
            let Next::Pair(pair) = stored.next(WAIT) else { panic!("nothing comes") };
            pair.view(|pair| {
                assert_eq!((pair.timestamp_ns, pair.skew_ns, pair.missed), (u64::from(number), 3, 1));
                for y in 0..4 {
                    let expected: Vec<u8> = (0..5).map(|x| (8 * y + x) as u8 ^ number).collect();
                    assert_eq!((pair.left.row(y), pair.right.row(y)), (&expected[..], &expected[..]));
                }
            })
            .unwrap();
            stored.give_back(pair);
        }
        assert_eq!(offer(&mut filler, 7, (5, 4)), Offer::Taken);
        drop(filler);
        assert!(matches!(stored.next(WAIT), Next::Pair(_)), "what was taken is not lost when the camera ends");
        assert!(matches!(stored.next(WAIT), Next::Ended));
    }

    #[test]
    fn a_disk_that_has_given_up_takes_nothing_and_that_is_no_loss_of_its_own() {
        let (mut filler, stored) = queue(3, (2, 2));
        drop(stored);
        let offers: Vec<Offer> = (0..5).map(|number| offer(&mut filler, number, (2, 2))).collect();
        assert_eq!(offers, [Offer::Ended; 5]);
    }
}
