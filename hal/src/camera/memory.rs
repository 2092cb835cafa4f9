//! A camera whose pictures lie in memory.

use core::convert::Infallible;

use fencepost_core::picture::Picture;

use super::{Camera, StereoPair};

/// Delivers pairs that lie in memory, once or over and over. Takes no memory after it was filled.
#[derive(Clone, Debug)]
pub struct MemoryCamera {
    size: (usize, usize),
    pairs: Vec<StoredPair>,
    rounds: u32,
    next: usize,
    sequence: u32,
}

#[derive(Clone, Debug)]
struct StoredPair {
    left: Vec<u8>,
    right: Vec<u8>,
    timestamp_ns: u64,
}

impl MemoryCamera {
    /// Takes every pair of `camera` into memory. Pairs of another size than the first are left out, and so are those that
    /// cannot be had.
    pub fn fill<C: Camera>(camera: &mut C) -> Self {
        let mut filled = Self { size: (0, 0), pairs: Vec::new(), rounds: 1, next: 0, sequence: 0 };
        loop {
            match camera.next_pair(|pair| filled.push(pair)) {
                Ok(Some(())) | Err(_) => {}
                Ok(None) => return filled,
            }
        }
    }

    /// Plays the pairs `rounds` times, with times that go on rising as they did.
    #[must_use]
    pub const fn repeated(mut self, rounds: u32) -> Self {
        self.rounds = rounds;
        self
    }

    /// Number of pairs in memory.
    pub const fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Whether there is no pair.
    pub const fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    fn push(&mut self, pair: &StereoPair<'_>) {
        let size = (pair.left.width(), pair.left.height());
        if self.pairs.is_empty() {
            self.size = size;
        }
        if size == self.size && (pair.right.width(), pair.right.height()) == size {
            let pixels = |picture: &Picture<'_>| (0..size.1).flat_map(|y| picture.row(y)).copied().collect();
            let (left, right) = (pixels(&pair.left), pixels(&pair.right));
            self.pairs.push(StoredPair { left, right, timestamp_ns: pair.timestamp_ns });
        }
    }

    /// From the first pair of a round to the first of the next.
    fn round_ns(&self) -> u64 {
        let (Some(first), Some(last)) = (self.pairs.first(), self.pairs.last()) else { return 0 };
        let span_ns = last.timestamp_ns.saturating_sub(first.timestamp_ns);
        span_ns.saturating_add(span_ns / (self.pairs.len() as u64 - 1).max(1))
    }
}

impl Camera for MemoryCamera {
    type Error = Infallible;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Infallible> {
        let (round, index) = match self.pairs.len() {
            0 => return Ok(None),
            count => (self.next / count, self.next % count),
        };
        let Some(stored) = self.pairs.get(index).filter(|_| round < self.rounds as usize) else { return Ok(None) };
        let (width, height) = self.size;
        let view = |pixels| Picture::packed(pixels, width, height);
        let (Ok(left), Ok(right)) = (view(&stored.left), view(&stored.right)) else { return Ok(None) };
        let timestamp_ns = stored.timestamp_ns.saturating_add(self.round_ns().saturating_mul(round as u64));
        let sequence = self.sequence;
        self.next += 1;
        self.sequence = sequence.wrapping_add(1);
        Ok(Some(consume(&StereoPair { left, right, timestamp_ns, skew_ns: 0, sequence, missed: 0 })))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Scene, SceneOptions};

    #[test]
    fn gives_back_what_it_was_filled_with_round_after_round() {
        let options = SceneOptions { width: 48, height: 32, focal_px: 40.0, frames: 3, ..SceneOptions::default() };
        let scene = || Scene::new(options).unwrap().into_camera();
        let mut memory = MemoryCamera::fill(&mut scene()).repeated(2);
        assert_eq!(memory.len(), 3);
        let mut times = Vec::new();
        for round in 0..2 {
            let mut truth = scene();
            for frame in 0..3 {
                let pixels = |pair: &StereoPair<'_>| (pair.left.row(7).to_vec(), pair.right.row(31).to_vec());
                let expected = truth.next_pair(pixels).unwrap();
                let found = memory.next_pair(|pair| {
                    times.push(pair.timestamp_ns);
                    assert_eq!(pair.sequence, round * 3 + frame);
                    pixels(pair)
                });
                assert_eq!(found.unwrap(), expected);
            }
        }
        assert_eq!(memory.next_pair(|_| ()), Ok(None));
        let steps: Vec<u64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert_eq!(steps, [100_000_000; 5]);
    }
}
