use crate::map::{SECTOR_COUNT, SectorDistances};

use super::{MeaninglessValue, SCAN_LOW, Signal};

/// Sectors in a part.
pub const SECTORS_PER_PART: usize = 5;

/// Where the sectors lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SectorLayout {
    /// Bearing of the left edge of the first sector, hundredths of a degree, positive to the left.
    pub left_cdeg: i16,
    /// Width of a sector, hundredths of a degree.
    pub width_cdeg: u16,
    /// Number of sectors.
    pub count: u8,
}

/// Sectors: one part of the sector distances of a scan. Parts 0 to 3 carry five distances each, part 4 where they lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SectorsRepr {
    /// Distances in decimetres, as in [`SectorDistances`].
    Distances {
        /// Low four bits of the scan's index.
        scan_low: u8,
        /// Which part, 0 to 3.
        part: u8,
        /// The distances.
        distance_dm: [u8; SECTORS_PER_PART],
    },
    /// Where the sectors lie.
    Layout {
        /// Low four bits of the scan's index.
        scan_low: u8,
        /// Where the sectors lie.
        layout: SectorLayout,
    },
}

const _: () = assert!(SECTOR_COUNT == SECTORS_PER_PART * SectorsRepr::LAYOUT_PART as usize);

impl SectorsRepr {
    /// Parts of a scan.
    pub const PARTS: u8 = 5;
    /// The part that says where the sectors lie.
    pub const LAYOUT_PART: u8 = 4;

    /// `Part`
    pub const PART: Signal = Signal::new(20, 4);
    /// `Sector00` in part 0, `Sector05` in part 1 and so on; the next sector 8 bits further.
    pub const DISTANCE: Signal = Signal::new(24, 8);
    /// `SectorLeft`
    pub const LEFT: Signal = Signal::new(24, 16);
    /// `SectorWidth`
    pub const WIDTH: Signal = Signal::new(40, 16);
    /// `SectorCount`
    pub const COUNT: Signal = Signal::new(56, 8);

    /// Part `part` of `sectors`.
    pub fn of(sectors: &SectorDistances, scan_low: u8, part: u8) -> Self {
        if part >= Self::LAYOUT_PART {
            let left_cdeg = libm::roundf(sectors.left_deg * 100.0) as i16;
            let width_cdeg = libm::roundf(sectors.width_deg * 100.0) as u16;
            let layout = SectorLayout { left_cdeg, width_cdeg, count: SECTOR_COUNT as u8 };
            return Self::Layout { scan_low, layout };
        }
        let mut distance_dm = [crate::map::SECTOR_UNKNOWN; SECTORS_PER_PART];
        let first = usize::from(part) * SECTORS_PER_PART;
        for (to, from) in distance_dm.iter_mut().zip(sectors.distance_dm.iter().skip(first)) {
            *to = *from;
        }
        Self::Distances { scan_low, part, distance_dm }
    }

    /// Low four bits of the scan's index.
    pub const fn scan_low(&self) -> u8 {
        match self {
            Self::Distances { scan_low, .. } | Self::Layout { scan_low, .. } => *scan_low,
        }
    }

    /// Which part it is.
    pub const fn part(&self) -> u8 {
        match self {
            Self::Distances { part, .. } => *part,
            Self::Layout { .. } => Self::LAYOUT_PART,
        }
    }

    /// Reads the signals.
    ///
    /// # Errors
    /// A part that does not exist.
    pub fn parse(data: &[u8]) -> Result<Self, MeaninglessValue> {
        let scan_low = SCAN_LOW.get(data) as u8;
        let part = Self::PART.get(data) as u8;
        if part > Self::LAYOUT_PART {
            return Err(MeaninglessValue("Part"));
        }
        if part == Self::LAYOUT_PART {
            let layout = SectorLayout {
                left_cdeg: Self::LEFT.get_signed(data) as i16,
                width_cdeg: Self::WIDTH.get(data) as u16,
                count: Self::COUNT.get(data) as u8,
            };
            return Ok(Self::Layout { scan_low, layout });
        }
        let distance_dm = core::array::from_fn(|k| Self::DISTANCE.shifted(8 * k as u8).get(data) as u8);
        Ok(Self::Distances { scan_low, part, distance_dm })
    }

    /// Writes the signals.
    pub fn emit(&self, data: &mut [u8]) {
        SCAN_LOW.put(data, u32::from(self.scan_low()));
        Self::PART.put(data, u32::from(self.part()));
        match self {
            Self::Distances { distance_dm, .. } => {
                for (k, distance) in distance_dm.iter().enumerate() {
                    Self::DISTANCE.shifted(8 * k as u8).put(data, u32::from(*distance));
                }
            }
            Self::Layout { layout, .. } => {
                Self::LEFT.put_signed(data, i32::from(layout.left_cdeg));
                Self::WIDTH.put(data, u32::from(layout.width_cdeg));
                Self::COUNT.put(data, u32::from(layout.count));
            }
        }
    }
}
