//! The stages of the detector, and who watches them go by.

/// The stages, in the order in which they run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[expect(missing_docs, reason = "the names are those of the modules")]
pub enum Stage {
    Rectify = 0,
    Match = 1,
    Validate = 2,
    Surfaces = 3,
    Ground = 4,
    Obstacles = 5,
    Map = 6,
    Health = 7,
}

impl Stage {
    /// Every stage in order.
    pub const ALL: [Self; 8] = [
        Self::Rectify,
        Self::Match,
        Self::Validate,
        Self::Surfaces,
        Self::Ground,
        Self::Obstacles,
        Self::Map,
        Self::Health,
    ];

    /// Name as it is written in summaries.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rectify => "rectify",
            Self::Match => "match",
            Self::Validate => "validate",
            Self::Surfaces => "surfaces",
            Self::Ground => "ground",
            Self::Obstacles => "obstacles",
            Self::Map => "map",
            Self::Health => "health",
        }
    }
}

/// Watches the stages go by. The core reads no clock: a program that wants times brings one here.
///
/// Rectification, matching and the look at the rows for the health take turns row by row, so `enter` is called up to three times
/// for each row.
pub trait Probe {
    /// The work that follows belongs to `stage`.
    fn enter(&mut self, stage: Stage);
}

/// Watches nothing.
impl Probe for () {
    fn enter(&mut self, _stage: Stage) {}
}
