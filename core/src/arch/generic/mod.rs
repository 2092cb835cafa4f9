//! The algorithm over vectors, whatever their width.
//!
//! Every function here is inlined into one that is compiled for the instructions of its vector.

mod costs;
mod keys;
mod slide;

use core::ops::Range;

use super::jobs::{CHUNK, PAD, Right, Search};

pub(super) use costs::search_costs;
pub(super) use keys::search_keys;
pub(super) use slide::slide_codes;

/// A vector of bytes.
///
/// # Safety
/// Every function needs a processor with the instructions of the vector; those that take a pointer read or write
/// [`Self::LANES`] bytes there.
pub(super) trait Vector: Copy {
    /// Bytes.
    const LANES: usize;
    /// Vectors of a column up to which the keys of a pixel find room in registers.
    const KEPT: usize;
    /// A left code, ready to be compared with right ones.
    type Code: Copy;
    /// A vector of as many bits, of 16-bit numbers.
    type Wide: Wide;

    unsafe fn load(from: *const u8) -> Self;
    unsafe fn store(self, to: *mut u8);
    unsafe fn add(self, other: Self) -> Self;
    unsafe fn sub(self, other: Self) -> Self;
    unsafe fn and(self, other: Self) -> Self;
    unsafe fn code(code: u8) -> Self::Code;
    /// Bits by which the codes at `low` and `high` differ from the left one.
    unsafe fn hamming(code: Self::Code, low: *const u8, high: *const u8) -> Self;
    /// Numbers without sign, in order.
    unsafe fn widen(self) -> [Self::Wide; 2];
    /// Numbers with a sign, in order.
    unsafe fn widen_signed(self) -> [Self::Wide; 2];
    /// Adds 128 times these numbers, with a sign, to others, in order.
    unsafe fn add_shifted(self, to: [Self::Wide; 2]) -> [Self::Wide; 2];
}

/// A vector of 16-bit numbers with a sign.
///
/// # Safety
/// As [`Vector`].
pub(super) trait Wide: Copy {
    /// Numbers.
    const LANES: usize;
    /// For each number, whether.
    type Mask: Copy;
    /// How often a mask said so.
    type Count: Copy;

    unsafe fn load(from: *const i16) -> Self;
    unsafe fn store(self, to: *mut i16);
    unsafe fn splat(number: i16) -> Self;
    unsafe fn add(self, other: Self) -> Self;
    unsafe fn sub(self, other: Self) -> Self;
    unsafe fn min(self, other: Self) -> Self;
    unsafe fn xor(self, other: Self) -> Self;
    /// 16 times each.
    unsafe fn times_16(self) -> Self;
    unsafe fn greater(self, other: Self) -> Self::Mask;
    unsafe fn equal(self, other: Self) -> Self::Mask;
    /// This where the mask says so, the other elsewhere.
    unsafe fn select(self, mask: Self::Mask, other: Self) -> Self;
    unsafe fn least(self) -> i16;
    /// The first place of a mask that says so; there must be one.
    unsafe fn first(mask: Self::Mask) -> usize;
    unsafe fn none() -> Self::Count;
    unsafe fn count(count: Self::Count, mask: Self::Mask) -> Self::Count;
    /// All that was counted, in no more than 255 masks.
    unsafe fn total(count: Self::Count) -> u16;
}

/// Functions of [`Vector`] that are one instruction each.
macro_rules! byte_instructions {
    ($load:ident, $store:ident, $add:ident, $sub:ident, $and:ident) => {
        #[inline(always)]
        unsafe fn load(from: *const u8) -> Self {
            // SAFETY: the caller guarantees the instructions and what lies behind pointers.
            unsafe { Self($load(from.cast())) }
        }

        #[inline(always)]
        unsafe fn store(self, to: *mut u8) {
            // SAFETY: the caller guarantees the instructions and what lies behind pointers.
            unsafe { $store(to.cast(), self.0) }
        }

        #[inline(always)]
        unsafe fn add(self, other: Self) -> Self {
            // SAFETY: the caller guarantees the instructions.
            unsafe { Self($add(self.0, other.0)) }
        }

        #[inline(always)]
        unsafe fn sub(self, other: Self) -> Self {
            // SAFETY: the caller guarantees the instructions.
            unsafe { Self($sub(self.0, other.0)) }
        }

        #[inline(always)]
        unsafe fn and(self, other: Self) -> Self {
            // SAFETY: the caller guarantees the instructions.
            unsafe { Self($and(self.0, other.0)) }
        }
    };
}
pub(super) use byte_instructions;

/// Functions of [`Wide`] that are one instruction each.
macro_rules! word_instructions {
    ($load:ident, $store:ident, $splat:ident, $add:ident, $sub:ident, $min:ident, $xor:ident, $shift:ident) => {
        #[inline(always)]
        unsafe fn load(from: *const i16) -> Self {
            // SAFETY: the caller guarantees the instructions and what lies behind pointers.
            unsafe { Self($load(from.cast())) }
        }

        #[inline(always)]
        unsafe fn store(self, to: *mut i16) {
            // SAFETY: the caller guarantees the instructions and what lies behind pointers.
            unsafe { $store(to.cast(), self.0) }
        }

        #[inline(always)]
        unsafe fn splat(number: i16) -> Self {
            // SAFETY: the caller guarantees the instructions.
            unsafe { Self($splat(number)) }
        }

        #[inline(always)]
        unsafe fn add(self, other: Self) -> Self {
            // SAFETY: the caller guarantees the instructions.
            unsafe { Self($add(self.0, other.0)) }
        }

        #[inline(always)]
        unsafe fn sub(self, other: Self) -> Self {
            // SAFETY: the caller guarantees the instructions.
            unsafe { Self($sub(self.0, other.0)) }
        }

        #[inline(always)]
        unsafe fn min(self, other: Self) -> Self {
            // SAFETY: the caller guarantees the instructions.
            unsafe { Self($min(self.0, other.0)) }
        }

        #[inline(always)]
        unsafe fn xor(self, other: Self) -> Self {
            // SAFETY: the caller guarantees the instructions.
            unsafe { Self($xor(self.0, other.0)) }
        }

        #[inline(always)]
        unsafe fn times_16(self) -> Self {
            // SAFETY: the caller guarantees the instructions.
            unsafe { Self($shift::<4>(self.0)) }
        }
    };
}
pub(super) use word_instructions;

/// Calls what is compiled for a number of vectors in a column: the usual numbers, that is; any other does `otherwise`.
macro_rules! by_blocks {
    ($blocks:expr, $n:ident => $call:expr, _ => $otherwise:expr $(,)?) => {
        by_blocks!(@ $blocks, $n, $call, $otherwise, 1 2 3 4 6 8)
    };
    (@ $blocks:expr, $n:ident, $call:expr, $otherwise:expr, $($number:literal)*) => {
        match $blocks {
            $($number => {
                const $n: usize = $number;
                $call
            })*
            _ => $otherwise,
        }
    };
}
use by_blocks;

/// Bytes that let nothing through, everything, and nothing again; long enough for the widest vector.
static MASKS: [u8; 3 * WIDEST] = {
    let mut masks = [0; 3 * WIDEST];
    let mut i = WIDEST;
    while i < 2 * WIDEST {
        masks[i] = 0xff;
        i += 1;
    }
    masks
};

/// The numbers from 0 on, for the widest vector.
static PLACES: [i16; WIDEST / 2] = {
    let mut places = [0; WIDEST / 2];
    let mut i = 0;
    while i < WIDEST / 2 {
        places[i] = i as i16;
        i += 1;
    }
    places
};

const WIDEST: usize = 64;

/// A mask for the lanes from place `place` on: lets places through from `first` up to `end`.
#[inline(always)]
unsafe fn mask<V: Vector>(place: usize, first: usize, end: usize) -> V {
    let skipped = first.saturating_sub(place).min(WIDEST);
    let kept = end.saturating_sub(place).min(WIDEST);
    // SAFETY: the table is three times as long as the widest vector, and both starts lie in its first two thirds.
    unsafe { V::load(MASKS.as_ptr().add(WIDEST - skipped)).and(V::load(MASKS.as_ptr().add(2 * WIDEST - kept))) }
}

/// Whether all that a search touches lies in the slices.
#[inline(always)]
fn search_fits<V: Vector>(search: &Search, columns: &[u8], work: &[i16], right: Option<&Right<'_>>) -> bool {
    let Search { range, radius, stride, disparities, .. } = search;
    let columns_needed = range.end.saturating_add(*radius).saturating_mul(*stride);
    let lead = search.top();
    let partners = range.end.saturating_add(*stride);
    let fits = stride.is_multiple_of(V::LANES)
        && stride >= disparities
        && range.start > *radius
        && range.len() <= CHUNK
        && columns.len() >= columns_needed
        && work.len() >= stride.saturating_add(2 * PAD)
        && right.is_none_or(|right| right.lead == lead && right.tables.iter().all(|t| t.len() >= partners));
    debug_assert!(fits, "the plan of the matcher sees to it that everything fits");
    fits
}

/// Whether a vector from `place` on has no candidates.
#[inline(always)]
fn is_outside<V: Vector>(place: usize, candidates: &Range<usize>) -> bool {
    place.wrapping_add(V::Wide::LANES) <= candidates.start || place >= candidates.end
}

/// # Safety
/// That of [`search_keys`].
#[inline(always)]
unsafe fn outside_is_nothing<V: Vector>(number: V::Wide, place: usize, candidates: &Range<usize>) -> V::Wide {
    // SAFETY: that of this function.
    unsafe {
        if place >= candidates.start && place.wrapping_add(V::Wide::LANES) <= candidates.end {
            return number;
        }
        let nothing = V::Wide::splat(i16::MAX);
        let places = V::Wide::load(PLACES.as_ptr()).add(V::Wide::splat(place as i16));
        let from = places.greater(V::Wide::splat((candidates.start as i16).wrapping_sub(1)));
        let to = V::Wide::splat(candidates.end as i16).greater(places);
        number.select(from, nothing).select(to, nothing)
    }
}
