use crate::health::HealthLevel;

use super::{MeaninglessValue, Signal, health_level};

/// Steps of the age in a header, milliseconds.
pub const AGE_STEP_MS: u32 = 5;

/// Header: begins a scan, also one without cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeaderRepr {
    /// Index of the scan; wraps.
    pub scan_index: u16,
    /// Cells in the cell frames that follow, at most 16383.
    pub cell_count: u16,
    /// How far the cells can be trusted.
    pub health: HealthLevel,
    /// Cell frames that follow.
    pub frame_count: u8,
    /// Time from exposure to this message in steps of [`AGE_STEP_MS`], rounded up; 255 = so old or older.
    pub age_steps: u8,
}

impl HeaderRepr {
    /// `ScanIndex`
    pub const SCAN_INDEX: Signal = Signal::new(16, 16);
    /// `CellCount`
    pub const CELL_COUNT: Signal = Signal::new(32, 14);
    /// `Health`
    pub const HEALTH: Signal = Signal::new(46, 2);
    /// `FrameCount`
    pub const FRAME_COUNT: Signal = Signal::new(48, 8);
    /// `Age`
    pub const AGE: Signal = Signal::new(56, 8);

    /// Steps of an age in nanoseconds: never younger than it is.
    pub const fn age_steps(age_ns: u64) -> u8 {
        let steps = age_ns.div_ceil(AGE_STEP_MS as u64 * 1_000_000);
        if steps > 255 { 255 } else { steps as u8 }
    }

    /// The age in nanoseconds; `None` if it is only known to be 1275 ms or more.
    pub const fn age_ns(&self) -> Option<u64> {
        if self.age_steps == 255 { None } else { Some(self.age_steps as u64 * AGE_STEP_MS as u64 * 1_000_000) }
    }

    /// Reads the signals.
    ///
    /// # Errors
    /// None: every value has a meaning.
    pub fn parse(data: &[u8]) -> Result<Self, MeaninglessValue> {
        Ok(Self {
            scan_index: Self::SCAN_INDEX.get(data) as u16,
            cell_count: Self::CELL_COUNT.get(data) as u16,
            health: health_level(Self::HEALTH.get(data)),
            frame_count: Self::FRAME_COUNT.get(data) as u8,
            age_steps: Self::AGE.get(data) as u8,
        })
    }

    /// Writes the signals.
    pub fn emit(&self, data: &mut [u8]) {
        Self::SCAN_INDEX.put(data, u32::from(self.scan_index));
        Self::CELL_COUNT.put(data, u32::from(self.cell_count));
        Self::HEALTH.put(data, self.health as u32);
        Self::FRAME_COUNT.put(data, u32::from(self.frame_count));
        Self::AGE.put(data, u32::from(self.age_steps));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn age_is_rounded_up_and_saturates() {
        for (age_ns, steps) in [(0, 0), (1, 1), (5_000_000, 1), (5_000_001, 2), (1_270_000_000, 254), (u64::MAX, 255)] {
            assert_eq!(HeaderRepr::age_steps(age_ns), steps);
        }
        let header =
            |age_steps| HeaderRepr { scan_index: 0, cell_count: 0, health: HealthLevel::Ok, frame_count: 0, age_steps };
        assert_eq!(header(254).age_ns(), Some(1_270_000_000));
        assert_eq!(header(255).age_ns(), None);
    }
}
