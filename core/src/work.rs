//! Counts what the loops of the stages really do, to be held against their bounds (`bounds/`).
//!
//! Only with the feature `count-work`: without it every call is empty, and nothing of it is left in the code. Counts are those of the
//! whole program, so whoever counts works in one thread and sets them to zero first.

/// Names the loops, each with the stage that it belongs to. What one step is, is said where it is counted.
macro_rules! loops {
    ($($name:ident $stage:literal $told:literal,)*) => {
        /// A loop whose number of steps the pictures decide.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs, reason = "the table says what they are")]
        #[repr(usize)]
        pub(crate) enum Loop { $($name,)* }

        /// The loops by stage and name, in the order of the counts.
        #[cfg(feature = "count-work")]
        pub const LOOPS: &[(&str, &str)] = &[$(($stage, $told),)*];
    };
}

loops! {
    RectifySegments "rectify" "segments",
    RectifyPixels "rectify" "pixels_one_by_one",
    MatchFiltered "match" "filtered_pixels",
    MatchSlid "match" "column_costs_slid",
    MatchNarrow "match" "narrow_costs",
    MatchWide "match" "wide_costs",
    MatchBegun "match" "costs_begun_afresh",
    MatchDecided "match" "decided_pixels",
    MatchChecked "match" "pixels_checked_back",
    MatchScanned "match" "pixels_scanned_for_weak",
    ValidatePieces "validate" "pieces",
    ValidateEvents "validate" "starts_and_joins",
    ValidateHops "validate" "hops",
    ValidateRuns "validate" "runs",
    ValidatePlaces "validate" "places",
    ValidateTaken "validate" "pixels_taken_out",
    SurfaceRows "surfaces" "rows_of_tiles",
    SurfaceStarts "surfaces" "runs",
    SurfaceJoins "surfaces" "joins",
    SurfaceHops "surfaces" "hops",
    SurfaceNumbers "surfaces" "runs_numbered",
    SurfaceSegments "surfaces" "segments",
    SurfaceSums "surfaces" "pixels_summed",
    SurfaceFitted "surfaces" "planes",
    SurfaceCounted "surfaces" "pixels_counted",
    SurfaceRelabelled "surfaces" "pixels_relabelled",
    RegionPairs "regions" "pairs",
    RegionMoved "regions" "surfaces_moved",
    RegionPlaces "regions" "places",
    GroundSurfaces "ground" "surfaces_asked",
    TerrainPixels "ground" "pixels",
    TerrainBack "ground" "patches_looked_back",
    TerrainPatches "ground" "patches",
    ObstacleSurfaces "obstacles" "surfaces_asked",
    ObstaclesPassed "obstacles" "obstacles_passed",
    MapSurfaces "map" "surfaces",
    MapRows "map" "rows_of_tiles",
    MapRuns "map" "runs",
    MapNoise "map" "noise_filled",
    MapVotes "map" "votes",
    MapCells "map" "cells",
    MapSmears "map" "cells_looked_back",
    MapShadows "map" "directions",
    HealthRows "health" "row_pixels",
    HealthPlaces "health" "places_for_contrast",
    HealthCosts "health" "patches_compared",
    HealthPixels "health" "pixels",
    WireCells "wire" "cells",
    WireSifts "wire" "sifts",
    WireFrames "wire" "frames",
}

/// Adds `steps` to the count of a loop.
#[cfg(not(feature = "count-work"))]
#[inline(always)]
pub(crate) const fn count(_of: Loop, _steps: usize) {}

#[cfg(feature = "count-work")]
pub(crate) use counting::count;
#[cfg(feature = "count-work")]
pub use counting::{reset, taken};

#[cfg(feature = "count-work")]
mod counting {
    use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

    use super::{LOOPS, Loop};

    static COUNTS: [AtomicU32; LOOPS.len()] = [const { AtomicU32::new(0) }; LOOPS.len()];

    /// Adds `steps` to the count of a loop.
    #[inline(always)]
    pub(crate) fn count(of: Loop, steps: usize) {
        if let Some(count) = COUNTS.get(of as usize) {
            // Counted in one thread, and not to be made dear by what would serve several.
            count.store(count.load(Relaxed).saturating_add(steps as u32), Relaxed);
        }
    }

    /// Sets all counts to zero.
    pub fn reset() {
        COUNTS.iter().for_each(|count| count.store(0, Relaxed));
    }

    /// Steps since [`reset`], in the order of [`LOOPS`]; they saturate.
    pub fn taken() -> [u64; LOOPS.len()] {
        core::array::from_fn(|i| COUNTS.get(i).map_or(0, |count| u64::from(count.load(Relaxed))))
    }
}
