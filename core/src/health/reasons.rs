//! Levels and reasons.

/// How far the cells can be trusted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum HealthLevel {
    /// Everything as it should be.
    Ok = 0,
    /// Usable with care; the reasons say why.
    Degraded = 1,
    /// The cells carry nothing: no picture, or nothing seen in it.
    #[default]
    Blind = 2,
    /// The detector or its hardware does not work.
    Fault = 3,
}

/// One thing that makes the cells less than true. The discriminant is the bit in [`Health::reasons`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[expect(missing_docs, reason = "each name is said in full by `describe`")]
pub enum HealthReason {
    StalePicture = 0,
    MissingPicture = 1,
    FrozenPicture = 2,
    Blocked = 3,
    Underexposed = 4,
    Overexposed = 5,
    BadlyPaired = 6,
    BadlyRectified = 7,
    LowCoverage = 8,
    NoGround = 9,
    GroundHeld = 10,
    MapTruncated = 11,
    Late = 12,
    NearZoneBlocked = 13,
    TableFull = 14,
    Exchanged = 15,
    ExposureMismatch = 16,
    BusTrouble = 17,
    CommandTrouble = 18,
    EchoMissing = 19,
}

impl HealthReason {
    /// Every reason, in the order of its bit.
    pub const ALL: [Self; 20] = [
        Self::StalePicture,
        Self::MissingPicture,
        Self::FrozenPicture,
        Self::Blocked,
        Self::Underexposed,
        Self::Overexposed,
        Self::BadlyPaired,
        Self::BadlyRectified,
        Self::LowCoverage,
        Self::NoGround,
        Self::GroundHeld,
        Self::MapTruncated,
        Self::Late,
        Self::NearZoneBlocked,
        Self::TableFull,
        Self::Exchanged,
        Self::ExposureMismatch,
        Self::BusTrouble,
        Self::CommandTrouble,
        Self::EchoMissing,
    ];

    /// The name in files: lower case, words joined by `_`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::StalePicture => "stale_picture",
            Self::MissingPicture => "missing_picture",
            Self::FrozenPicture => "frozen_picture",
            Self::Blocked => "blocked",
            Self::Underexposed => "underexposed",
            Self::Overexposed => "overexposed",
            Self::BadlyPaired => "badly_paired",
            Self::BadlyRectified => "badly_rectified",
            Self::LowCoverage => "low_coverage",
            Self::NoGround => "no_ground",
            Self::GroundHeld => "ground_held",
            Self::MapTruncated => "map_truncated",
            Self::Late => "late",
            Self::NearZoneBlocked => "near_zone_blocked",
            Self::TableFull => "table_full",
            Self::Exchanged => "exchanged",
            Self::ExposureMismatch => "exposure_mismatch",
            Self::BusTrouble => "bus_trouble",
            Self::CommandTrouble => "command_trouble",
            Self::EchoMissing => "echo_missing",
        }
    }

    /// Whether one moment proves it: counted or read off, not estimated. Such a reason is told at once, others when they have
    /// been found more than once; see [`super::Debounce`].
    pub const fn is_plain(self) -> bool {
        !matches!(self, Self::Blocked | Self::BadlyPaired | Self::BadlyRectified | Self::Late | Self::CommandTrouble)
    }

    /// The reason in words.
    pub const fn describe(self) -> &'static str {
        match self {
            Self::StalePicture => "the newest picture is too old",
            Self::MissingPicture => "a picture is missing",
            Self::FrozenPicture => "the same picture came again",
            Self::Blocked => "a lens is covered",
            Self::Underexposed => "a picture is too dark",
            Self::Overexposed => "a picture is too bright",
            Self::BadlyPaired => "left and right do not show the same moment",
            Self::BadlyRectified => "rows of left and right are out of line",
            Self::LowCoverage => "too few pixels have a disparity",
            Self::NoGround => "no ground plane found",
            Self::GroundHeld => "the ground plane is that of an earlier frame",
            Self::MapTruncated => "more cells than the bus may carry: the farthest are left out",
            Self::Late => "the frame came out too late",
            Self::NearZoneBlocked => "something fills the zone too close for the disparity range",
            Self::TableFull => "more surfaces or obstacles than there is room for: the smallest are left out",
            Self::Exchanged => "left and right seem to be exchanged",
            Self::ExposureMismatch => "left and right are exposed differently",
            Self::BusTrouble => "frames could not be sent: the bus is disturbed, full, down or gone",
            Self::CommandTrouble => "messages of the vehicle's controller are damaged or missing",
            Self::EchoMissing => "the vehicle's controller no longer says that it takes scans over",
        }
    }
}

/// Level and reasons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Health {
    /// How far the cells can be trusted.
    pub level: HealthLevel,
    /// A bit per [`HealthReason`].
    pub reasons: u32,
}

impl Health {
    /// Nothing to say.
    pub const OK: Self = Self { level: HealthLevel::Ok, reasons: 0 };

    /// Adds a reason and raises the level to `level` at least.
    pub fn raise(&mut self, reason: HealthReason, level: HealthLevel) {
        self.reasons |= 1 << reason as u8;
        self.level = self.level.max(level);
    }

    /// Both together: the worse level, and the reasons of both.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self { level: self.level.max(other.level), reasons: self.reasons | other.reasons }
    }

    /// Whether `reason` was given.
    pub const fn has(&self, reason: HealthReason) -> bool {
        self.reasons & (1 << reason as u8) != 0
    }
}
