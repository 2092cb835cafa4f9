use super::{MeaninglessValue, Signal};

/// End: ends a scan and says what was left out of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EndRepr {
    /// Index of the scan.
    pub scan_index: u16,
    /// Edge of a cell, millimetres; at most 4095.
    pub cell_size_mm: u16,
    /// Cells left out because they did not fit; 4095 = that many or more.
    pub dropped_cells: u16,
    /// Checksum of all cell frames of the scan, see [`ScanCrc`](crate::wire::ScanCrc).
    pub scan_crc: u8,
}

impl EndRepr {
    /// `ScanIndex`
    pub const SCAN_INDEX: Signal = Signal::new(16, 16);
    /// `CellSize`
    pub const CELL_SIZE: Signal = Signal::new(32, 12);
    /// `DroppedCells`
    pub const DROPPED_CELLS: Signal = Signal::new(44, 12);
    /// `ScanCrc`
    pub const SCAN_CRC: Signal = Signal::new(56, 8);

    /// Reads the signals.
    ///
    /// # Errors
    /// Cells of no size.
    pub fn parse(data: &[u8]) -> Result<Self, MeaninglessValue> {
        let cell_size_mm = Self::CELL_SIZE.get(data) as u16;
        if cell_size_mm == 0 {
            return Err(MeaninglessValue("CellSize"));
        }
        Ok(Self {
            scan_index: Self::SCAN_INDEX.get(data) as u16,
            cell_size_mm,
            dropped_cells: Self::DROPPED_CELLS.get(data) as u16,
            scan_crc: Self::SCAN_CRC.get(data) as u8,
        })
    }

    /// Writes the signals.
    pub fn emit(&self, data: &mut [u8]) {
        Self::SCAN_INDEX.put(data, u32::from(self.scan_index));
        Self::CELL_SIZE.put(data, u32::from(self.cell_size_mm));
        Self::DROPPED_CELLS.put(data, u32::from(self.dropped_cells));
        Self::SCAN_CRC.put(data, u32::from(self.scan_crc));
    }
}
