//! Which of the ways to search fits the settings.

use super::{MatchCost, MatchSettings, rows::LEAD_ROWS};
use crate::arch::{Backend, Chosen, PAD};

/// What follows from the settings and the processor, and changes no result.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    pub(super) chosen: Chosen,
    /// Sums of a column, the disparities and what is needed to fill vectors.
    pub(super) stride: usize,
    /// Whether cost and place of the narrow window fit 16 bits together.
    pub(super) keys: bool,
    /// Places in front of the first pixel in the tables of right pixels.
    pub(super) lead: usize,
    /// What the disparity is beyond the number in the key of a right pixel.
    pub(super) key_disparity: u16,
}

/// Places of a column that may be there only to fill a vector, less than this many.
const MOST_PADDING: usize = 32;

impl Plan {
    pub(super) const UNSET: Self = Self { chosen: Chosen::PLAIN, stride: 0, keys: false, lead: 0, key_disparity: 0 };

    /// The plan for `settings`, which were checked, for pictures of `width` in tables for up to `WIDTH` and `DISPARITIES`.
    ///
    /// Tables are padded for vectors; where there is no room for that, or too much of it, the next slower backend serves, plain Rust at
    /// last.
    pub(super) fn new<const WIDTH: usize, const DISPARITIES: usize>(
        backend: Backend,
        settings: &MatchSettings,
        width: usize,
    ) -> Self {
        let (disparities, min_disparity) = (usize::from(settings.disparities), usize::from(settings.min_disparity));
        let area = u32::from(settings.window_width).saturating_mul(u32::from(settings.window_height));
        let keys = settings.cost == MatchCost::Census && area <= 510 / 8 && disparities <= 128;
        let back = min_disparity.saturating_add(disparities).saturating_sub(1);
        // Keys count places from 0 at the largest disparity; turned, from 127 down.
        let key_disparity = (back as u16).wrapping_sub(127);
        // That of the signal processing instructions counts them so that it ends at 127.
        let key_disparity_dsp = settings.min_disparity;
        let mut backend = if settings.cost == MatchCost::Census { backend } else { Backend::Plain };
        while backend != Backend::Plain {
            let lanes = backend.lanes().max(1);
            let stride = (disparities / lanes)
                .saturating_add(usize::from(!disparities.is_multiple_of(lanes)))
                .saturating_mul(lanes);
            // What half as wide a vector would do without is no gain.
            let room = backend.takes(disparities)
                && stride.saturating_sub(disparities) < MOST_PADDING
                && width.saturating_mul(stride) <= WIDTH * DISPARITIES * 2
                && back <= LEAD_ROWS * WIDTH
                && width.saturating_add(stride) <= WIDTH + WIDTH / 2
                && stride.saturating_add(2 * PAD) <= 4 * DISPARITIES;
            // To ask a processor takes long where a hypervisor answers.
            if let Some(chosen) = room.then(|| Chosen::new(backend)).flatten() {
                let key_disparity = if backend == Backend::Dsp { key_disparity_dsp } else { key_disparity };
                return Self { chosen, stride, keys, lead: back, key_disparity };
            }
            backend = backend.slower();
        }
        Self { chosen: Chosen::PLAIN, stride: disparities, keys, lead: 0, key_disparity }
    }
}
