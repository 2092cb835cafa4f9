//! Several threads for one picture, from a core that knows no threads: it cuts the work into bands of rows, and the caller's
//! [`Workers`] do them side by side.

use core::ops::Range;

use heapless::Vec;

/// Most bands that a picture is cut into.
pub const MAX_BANDS: usize = 8;

/// A piece of work, to be done once by any thread.
pub trait Job: Send {
    /// Does it. Doing it again does nothing.
    fn run(&mut self);
}

/// Whoever brings threads: those of an operating system, tasks of a kernel, the second core of a microcontroller.
///
/// ```
/// use fencepost_core::bands::{Job, Workers};
///
/// /// A thread for each job, of the operating system. Starting one takes some 20 us and memory: a pool is faster.
/// struct Threads;
///
/// impl Workers for Threads {
///     fn run<J: Job>(&mut self, jobs: &mut [J]) {
///         let Some((first, rest)) = jobs.split_first_mut() else { return };
///         std::thread::scope(|scope| {
///             for job in rest {
///                 scope.spawn(|| job.run());
///             }
///             first.run();
///         });
///     }
/// }
/// ```
pub trait Workers {
    /// Has all of `jobs` done, side by side, in any order and by any threads, and comes back when that is so. There are at most
    /// [`MAX_BANDS`] of them, each of about the same length. What is left undone is done by the caller: it takes longer, and nothing
    /// else changes.
    fn run<J: Job>(&mut self, jobs: &mut [J]);
}

/// The caller's own thread, one job after the other.
#[derive(Clone, Copy, Debug, Default)]
pub struct OneThread;

impl Workers for OneThread {
    fn run<J: Job>(&mut self, jobs: &mut [J]) {
        jobs.iter_mut().for_each(Job::run);
    }
}

/// What a band has to do in a stage.
pub(crate) trait Work: Send {
    fn work(&mut self);
}

/// Work that is done once.
pub(crate) struct Ticket<W> {
    pub(crate) work: W,
    done: bool,
}

impl<W: Work> Job for Ticket<W> {
    fn run(&mut self) {
        if !self.done {
            self.work.work();
            self.done = true;
        }
    }
}

/// Has the work of all bands done, whatever `workers` make of it, and gives it back.
pub(crate) fn run_all<W: Work>(
    workers: &mut impl Workers,
    works: impl Iterator<Item = W>,
) -> Vec<Ticket<W>, MAX_BANDS> {
    let mut jobs = collected(works.map(|work| Ticket { work, done: false }));
    workers.run(&mut jobs);
    jobs.iter_mut().for_each(Job::run);
    jobs
}

/// The first [`MAX_BANDS`] of `all`; there are no more.
pub(crate) fn collected<T>(all: impl Iterator<Item = T>) -> Vec<T, MAX_BANDS> {
    let mut kept = Vec::new();
    for one in all {
        if kept.push(one).is_err() {
            break;
        }
    }
    kept
}

/// Cuts `rows` into as many bands as are asked for, from the top, between multiples of `unit` rows. Where there are fewer units than
/// bands, some bands are empty.
pub(crate) fn cut(rows: usize, bands: usize, unit: usize) -> impl Iterator<Item = Range<usize>> + Clone {
    // Rows of a picture and a few bands: no product is too large.
    let units = rows.saturating_add(unit.saturating_sub(1)) / unit.max(1);
    let border = move |band: usize| (units.saturating_mul(band) / bands.max(1)).saturating_mul(unit.max(1)).min(rows);
    (0..bands).map(move |band| border(band)..border(band.saturating_add(1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_all_of_the_rows_in_order_and_even() {
        for rows in 0..200 {
            for bands in 1..=MAX_BANDS {
                for unit in [1, 4, 12, 32] {
                    let mut next = 0;
                    for band in cut(rows, bands, unit) {
                        assert_eq!(band.start, next, "{rows} rows, {bands} bands, {unit}");
                        assert!(band.start % unit == 0 || band.is_empty(), "{rows} rows, {bands} bands, {unit}");
                        assert!(band.len() <= unit * rows.div_ceil(unit).div_ceil(bands));
                        next = band.end;
                    }
                    assert_eq!(next, rows);
                }
            }
        }
    }

    #[test]
    fn of_more_than_there_is_room_for_the_first_are_kept() {
        for count in [0, 1, MAX_BANDS - 1, MAX_BANDS, MAX_BANDS + 1, 1000] {
            let kept = collected(0..count);
            assert!(kept.iter().copied().eq(0..count.min(MAX_BANDS)), "{count}: {kept:?}");
        }
    }

    struct Count<'a>(&'a mut u32);

    impl Work for Count<'_> {
        fn work(&mut self) {
            *self.0 += 1;
        }
    }

    /// Workers that do every job twice, or only every other one, or none, or in the wrong order.
    struct Bad(usize);

    impl Workers for Bad {
        fn run<J: Job>(&mut self, jobs: &mut [J]) {
            match self.0 {
                0 => jobs.iter_mut().for_each(|job| (0..2).for_each(|_| job.run())),
                1 => jobs.iter_mut().step_by(2).for_each(Job::run),
                2 => {}
                _ => jobs.iter_mut().rev().for_each(Job::run),
            }
        }
    }

    #[test]
    fn the_callers_own_thread_does_every_job() {
        let mut done = [0; 3];
        let mut jobs = done.each_mut().map(|done| Ticket { work: Count(done), done: false });
        OneThread.run(&mut jobs);
        assert_eq!(done, [1; 3]);
    }

    #[test]
    fn all_work_is_done_once_whatever_the_workers_do() {
        for how in 0..4 {
            let mut done = [0; 5];
            let tickets = run_all(&mut Bad(how), done.iter_mut().map(Count));
            assert_eq!(tickets.len(), 5);
            drop(tickets);
            assert_eq!(done, [1; 5]);
        }
    }
}
