//! Work on many rows at once, whose result does not depend on how many threads there are.

use std::sync::Mutex;

/// Calls `work` with the number and the elements of each piece of `length` elements.
pub(crate) fn for_each_chunk<T: Send>(data: &mut [T], length: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get).min(16);
    for_each_chunk_on(threads, data, length, work);
}

/// As [`for_each_chunk`], on a number of threads.
pub(crate) fn for_each_chunk_on<T: Send>(
    threads: usize,
    data: &mut [T],
    length: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    let queue = Mutex::new(data.chunks_mut(length.max(1)).enumerate());
    let (queue, work) = (&queue, &work);
    let run = move || {
        loop {
            // Taken and given back before the work, which is all that may panic.
            let next = match queue.lock() {
                Ok(mut pieces) => pieces.next(),
                Err(_) => None,
            };
            let Some((index, piece)) = next else { return };
            work(index, piece);
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(run);
        }
        run();
    });
}
