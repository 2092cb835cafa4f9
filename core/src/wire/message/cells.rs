use super::{MeaninglessValue, SCAN_LOW, Signal};

/// Smallest index of a cell along x or y that can be sent.
pub const CELL_INDEX_MIN: i8 = -64;
/// Largest index of a cell along x or y that can be sent.
pub const CELL_INDEX_MAX: i8 = 63;
/// Most cells in a run.
pub const MAX_RUN_LENGTH: u8 = 31;

/// Cells of the same state side by side: `length` of them from cell `(i, j)` along +y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Run {
    /// Index of the cells along x.
    pub i: i8,
    /// Index of the first cell along y.
    pub j: i8,
    /// Number of cells, 1 to 31.
    pub length: u8,
    /// Whether the cells are obstacles; otherwise they are free.
    pub obstacle: bool,
}

impl Run {
    /// The cells, `(i, j)` each.
    pub fn cells(self) -> impl Iterator<Item = (i8, i8)> {
        (0..self.length).map(move |k| (self.i, self.j.saturating_add_unsigned(k)))
    }

    /// Rank in a scan: obstacles before free cells, near before far, then by x and y.
    ///
    /// The distance is that from the vehicle's origin to the centre of the nearest cell, squared, in half cells.
    pub const fn rank(self) -> u32 {
        // Centres lie at odd numbers of half cells; the nearest of the run is the one whose centre is closest to y = 0.
        let first = 2 * self.j as i32 + 1;
        let last = first + 2 * (self.length as i32 - 1);
        let y = if first > 0 {
            first
        } else if last < 0 {
            -last
        } else {
            1
        };
        let x = 2 * self.i as i32 + 1;
        let distance = (x * x + y * y) as u32;
        let place = ((self.i as i32 + 64) << 7) | (self.j as i32 + 64);
        (!self.obstacle as u32) << 31 | (distance & 0xFFFF) << 14 | (place as u32 & 0x3FFF)
    }
}

/// Cells: a frame with some runs of cells; 2 in a classic frame, 8 in a CAN FD frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellsRepr {
    /// Low four bits of the scan's index.
    pub scan_low: u8,
    /// Number of the frame in its scan, from 0; wraps after 15.
    pub sequence: u8,
    /// The runs, those in use first.
    pub runs: [Option<Run>; Self::FD_RUNS],
}

impl CellsRepr {
    /// Runs in a classic frame.
    pub const CLASSIC_RUNS: usize = 2;
    /// Runs in a CAN FD frame.
    pub const FD_RUNS: usize = 8;

    /// `Sequence`
    pub const SEQUENCE: Signal = Signal::new(20, 4);
    /// `Run0X`, and 20 bits further `Run1X` and so on.
    pub const RUN_X: Signal = Signal::new(24, 7);
    /// `Run0Y`
    pub const RUN_Y: Signal = Signal::new(31, 7);
    /// `Run0Length`
    pub const RUN_LENGTH: Signal = Signal::new(38, 5);
    /// `Run0Obstacle`
    pub const RUN_OBSTACLE: Signal = Signal::new(43, 1);
    /// From a run to the next, bits.
    pub const RUN_BITS: u8 = 20;

    /// Runs in a message of `len` bytes.
    const fn runs_in(len: usize) -> usize {
        if len > 8 { Self::FD_RUNS } else { Self::CLASSIC_RUNS }
    }

    /// Reads the signals of a classic or a CAN FD frame.
    ///
    /// # Errors
    /// A run that leaves the range of indices.
    ///
    /// # Bound
    /// The runs of a frame.
    pub fn parse(data: &[u8]) -> Result<Self, MeaninglessValue> {
        let mut runs = [None; Self::FD_RUNS];
        for (k, run) in runs.iter_mut().take(Self::runs_in(data.len())).enumerate() {
            let shift = k as u8 * Self::RUN_BITS;
            let length = Self::RUN_LENGTH.shifted(shift).get(data) as u8;
            if length == 0 {
                continue;
            }
            let i = Self::RUN_X.shifted(shift).get_signed(data) as i8;
            let j = Self::RUN_Y.shifted(shift).get_signed(data) as i8;
            if i16::from(j) + i16::from(length) - 1 > i16::from(CELL_INDEX_MAX) {
                return Err(MeaninglessValue("RunLength"));
            }
            let obstacle = Self::RUN_OBSTACLE.shifted(shift).get(data) != 0;
            *run = Some(Run { i, j, length, obstacle });
        }
        Ok(Self { scan_low: SCAN_LOW.get(data) as u8, sequence: Self::SEQUENCE.get(data) as u8, runs })
    }

    /// Writes the signals; `data` has 8 or 24 bytes.
    ///
    /// # Bound
    /// The runs of a frame.
    pub fn emit(&self, data: &mut [u8]) {
        SCAN_LOW.put(data, u32::from(self.scan_low));
        Self::SEQUENCE.put(data, u32::from(self.sequence & 0xF));
        let count = Self::runs_in(data.len());
        for (k, run) in self.runs.iter().take(count).enumerate() {
            let shift = k as u8 * Self::RUN_BITS;
            let run = run.unwrap_or_default();
            Self::RUN_X.shifted(shift).put_signed(data, i32::from(run.i));
            Self::RUN_Y.shifted(shift).put_signed(data, i32::from(run.j));
            Self::RUN_LENGTH.shifted(shift).put(data, u32::from(run.length));
            Self::RUN_OBSTACLE.shifted(shift).put(data, u32::from(run.obstacle));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rank_puts_obstacles_first_and_then_the_nearest() {
        for i in -64..=63_i8 {
            for j in -64..=63_i8 {
                for length in [1, 2, 7, 31] {
                    let run = Run { i, j, length, obstacle: false };
                    let nearest = run.cells().map(|(i, j)| half(i).pow(2) + half(j).pow(2)).min().unwrap();
                    assert_eq!(run.rank() >> 14 & 0xFFFF, nearest as u32, "{run:?}");
                    assert!(Run { obstacle: true, ..run }.rank() < 1 << 31);
                    assert!(run.rank() >= 1 << 31);
                }
            }
        }
    }

    fn half(index: i8) -> i32 {
        2 * i32::from(index) + 1
    }

    #[test]
    fn a_run_beyond_the_last_index_is_refused() {
        let run = Run { i: 0, j: 60, length: 4, obstacle: true };
        let cells =
            |run| CellsRepr { scan_low: 3, sequence: 15, runs: [Some(run), None, None, None, None, None, None, None] };
        let mut data = [0; 8];
        cells(run).emit(&mut data);
        assert_eq!(CellsRepr::parse(&data), Ok(cells(run)));
        cells(Run { length: 5, ..run }).emit(&mut data);
        assert_eq!(CellsRepr::parse(&data), Err(MeaninglessValue("RunLength")));
    }
}
