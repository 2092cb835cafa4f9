//! A camera that was recorded, played as if it were live.

use std::{
    thread,
    time::{Duration, Instant},
};

use super::{Camera, StereoPair};
use crate::clock::monotonic_ns;

/// Delivers the pairs of another camera when they are due, and stamps them with the time at which they are delivered.
#[derive(Clone, Debug)]
pub struct PacedCamera<C> {
    camera: C,
    /// Time between two pairs; `None` for the times of the pairs themselves.
    period: Option<Duration>,
    last: Option<Delivered>,
}

#[derive(Clone, Copy, Debug)]
struct Delivered {
    at: Instant,
    timestamp_ns: u64,
}

/// A pause in a recording is not waited for longer than this.
const LONGEST_WAIT: Duration = Duration::from_secs(1);

impl<C> PacedCamera<C> {
    /// Plays `camera` with the times of its own pairs, or with a pair every `period`.
    pub const fn new(camera: C, period: Option<Duration>) -> Self {
        Self { camera, period, last: None }
    }

    /// The camera.
    pub const fn inner_mut(&mut self) -> &mut C {
        &mut self.camera
    }

    /// Gives the camera back.
    pub fn into_inner(self) -> C {
        self.camera
    }
}

impl<C: Camera> Camera for PacedCamera<C> {
    type Error = C::Error;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, C::Error> {
        let Self { camera, period, last } = self;
        camera.next_pair(|pair| {
            // By the time at which the one before was due, so that delays do not add up.
            let mut due = Instant::now();
            if let Some(before) = *last {
                let own = Duration::from_nanos(pair.timestamp_ns.saturating_sub(before.timestamp_ns));
                let planned = before.at + wait(*period, own);
                thread::sleep(planned.saturating_duration_since(due));
                // Whoever takes longer than a period loses none of the pairs and is not hurried afterwards.
                due = due.max(planned);
            }
            *last = Some(Delivered { at: due, timestamp_ns: pair.timestamp_ns });
            consume(&StereoPair { timestamp_ns: monotonic_ns(), ..*pair })
        })
    }

    fn take_warning(&mut self) -> Option<String> {
        self.camera.take_warning()
    }
}

/// From one pair to the next: as was asked, or as it was recorded.
fn wait(period: Option<Duration>, recorded: Duration) -> Duration {
    period.unwrap_or(recorded.min(LONGEST_WAIT))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::MemoryCamera;
    use crate::scene::{Scene, SceneOptions};

    #[test]
    fn pauses_of_a_recording_are_cut_short_but_a_period_that_was_asked_for_is_kept() {
        let [short, long, hour] = [40, 2500, 3_600_000].map(Duration::from_millis);
        assert_eq!([wait(None, short), wait(None, hour)], [short, LONGEST_WAIT]);
        assert_eq!([wait(Some(long), short), wait(Some(short), hour)], [long, short]);
    }

    #[test]
    fn pairs_come_in_order_no_sooner_than_due_and_stamped_with_the_time_of_delivery() {
        let options = SceneOptions { width: 48, height: 32, focal_px: 40.0, frames: 4, ..SceneOptions::default() };
        let memory = MemoryCamera::fill(&mut Scene::new(options).unwrap().into_camera());
        let mut camera = PacedCamera::new(memory, Some(Duration::from_millis(20)));
        let mut times = Vec::new();
        let start_ns = monotonic_ns();
        while camera.next_pair(|pair| times.push((pair.sequence, pair.timestamp_ns))).unwrap().is_some() {
            assert!(times.last().is_some_and(|(_, time)| *time >= start_ns && *time <= monotonic_ns()));
        }
        assert_eq!(times.iter().map(|(sequence, _)| *sequence).collect::<Vec<_>>(), [0, 1, 2, 3]);
        // Sleeping never ends too soon. How late it ends is up to the machine.
        assert!(times[3].1 - times[0].1 >= 59_000_000, "{times:?}");
    }
}
