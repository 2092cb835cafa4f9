//! Stereo matching: sums of absolute differences over a window, with every check that comes from the same costs.

mod settings;

pub use settings::{MatchSettings, Prefilter};
