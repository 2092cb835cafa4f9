use super::{MeaninglessValue, Signal};

/// Vehicle motion, sent to the node by the vehicle's controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VehicleMotionRepr {
    /// Speed forward, mm/s; `None` if not known.
    pub speed_mm_per_s: Option<i16>,
    /// Turning rate to the left, hundredths of a degree per second; `None` if not known.
    pub yaw_rate_cdeg_per_s: Option<i16>,
}

impl VehicleMotionRepr {
    /// `Speed`
    pub const SPEED: Signal = Signal::new(16, 16);
    /// `YawRate`
    pub const YAW_RATE: Signal = Signal::new(32, 16);
    /// `SpeedValid`
    pub const SPEED_VALID: Signal = Signal::new(48, 1);
    /// `YawRateValid`
    pub const YAW_RATE_VALID: Signal = Signal::new(49, 1);

    /// Reads the signals.
    ///
    /// # Errors
    /// None: every value has a meaning.
    pub fn parse(data: &[u8]) -> Result<Self, MeaninglessValue> {
        let speed = Self::SPEED.get_signed(data) as i16;
        let yaw_rate = Self::YAW_RATE.get_signed(data) as i16;
        Ok(Self {
            speed_mm_per_s: (Self::SPEED_VALID.get(data) != 0).then_some(speed),
            yaw_rate_cdeg_per_s: (Self::YAW_RATE_VALID.get(data) != 0).then_some(yaw_rate),
        })
    }

    /// Writes the signals.
    pub fn emit(&self, data: &mut [u8]) {
        Self::SPEED.put_signed(data, i32::from(self.speed_mm_per_s.unwrap_or(0)));
        Self::YAW_RATE.put_signed(data, i32::from(self.yaw_rate_cdeg_per_s.unwrap_or(0)));
        Self::SPEED_VALID.put(data, u32::from(self.speed_mm_per_s.is_some()));
        Self::YAW_RATE_VALID.put(data, u32::from(self.yaw_rate_cdeg_per_s.is_some()));
    }
}

/// Scan echo, sent to the node by the vehicle's controller: the newest scan that it has taken over as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanEchoRepr {
    /// Index of the scan.
    pub scan_index: u16,
}

impl ScanEchoRepr {
    /// `ScanIndex`
    pub const SCAN_INDEX: Signal = Signal::new(16, 16);

    /// Reads the signals.
    ///
    /// # Errors
    /// None: every value has a meaning.
    pub fn parse(data: &[u8]) -> Result<Self, MeaninglessValue> {
        Ok(Self { scan_index: Self::SCAN_INDEX.get(data) as u16 })
    }

    /// Writes the signals.
    pub fn emit(&self, data: &mut [u8]) {
        Self::SCAN_INDEX.put(data, u32::from(self.scan_index));
    }
}
