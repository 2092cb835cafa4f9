//! The inner loops of the matcher, for the processor at hand.
//!
//! One algorithm ([`generic`]) stands over a small vector trait; a backend brings the vectors and a thin layer of functions
//! that are compiled for its instructions. [`plain`] is the same in plain Rust, for every processor: what the others are held
//! against, bit by bit. This is the only place of the core with `unsafe`.
//!
//! On x86-64 the processor is asked when a matcher is configured ([`Backend::fastest`]); elsewhere the compiler's target says
//! it. No call goes through a pointer: each step is a `match` on the backend, once for a row or for 64 pixels.
//!
//! # What it costs
//! Instructions for 32 disparities of a pixel with AVX2, as compiled:
//!
//! | step | loads | arithmetic | stores | limited by |
//! | --- | --- | --- | --- | --- |
//! | a row into and out of the column sums | 5 | 7: four table look-ups, three sums | 1 | loads: half of the unaligned ones lie in two lines of the cache |
//! | sums under the window, as keys | 2 | 8 | 2 | arithmetic |
//! | best left partner of each right pixel | 2 | 4 | 2 | stores: one vector in a cycle |
//! | least key, and the others that are nearly as good | 0 | 6 | 0 | arithmetic |
//!
//! Beside that some 40 instructions for each pixel: the least of a vector, its neighbours, what is found. SSE2 takes twice as many
//! vectors, and 25 instead of 7 to count bits without look-up. AVX-512 and NEON count bits by an instruction, which saves half of the
//! loads of the codes and of the arithmetic; NEON finds the least of a vector by one, too. The
//! wide window is asked for weak pixels only, and made afresh at each run of them.

#[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
#[expect(unsafe_code, reason = "vectors are loaded and stored through pointers")]
mod aarch64;
mod decide;
#[cfg(any(target_arch = "x86_64", all(target_arch = "aarch64", target_feature = "neon")))]
#[expect(clippy::needless_range_loop, reason = "loops of a fixed number of rounds, by number, are what is unrolled")]
#[expect(unsafe_code, reason = "vectors are loaded and stored through pointers, within bounds that are checked before")]
mod generic;
mod jobs;
mod plain;
#[cfg(dsp)]
#[expect(unsafe_code, reason = "instructions that have no functions of their own, and sums read four at a time")]
mod thumb;
#[cfg(target_arch = "x86_64")]
#[expect(unsafe_code, reason = "instructions that not every processor has, used where it has them")]
mod x86_64;

pub(crate) use decide::{Decide, NO_PARTNER, Sums, back_check, evidence, refine};
pub(crate) use jobs::{CHUNK, CodeRow, CostJob, Found, KeyJob, KeyLimits, PAD, Right, Search, SlideCodes};

/// Whose instructions the inner loops are made of. All of them give the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Backend {
    /// Plain Rust, which the compiler makes what it can of.
    Plain = 0,
    /// x86-64 without extensions: 16 bytes at a time.
    Sse2 = 1,
    /// x86-64 with SSE4.1 and SSSE3: 16 bytes at a time, bits counted by looking them up.
    Sse41 = 2,
    /// x86-64 with AVX2: 32 bytes at a time.
    Avx2 = 3,
    /// x86-64 with AVX-512 (F, BW, VL and BITALG: since Ice Lake and Zen 4): 64 bytes at a time, bits counted by an instruction.
    Avx512 = 4,
    /// AArch64: 16 bytes at a time, bits counted by an instruction.
    Neon = 5,
    /// Cortex-M4 and M7: four bytes of a register at a time.
    Dsp = 6,
}

impl Backend {
    /// Every backend; those of a processor slowest first.
    pub const ALL: &[Self] = &[Self::Plain, Self::Sse2, Self::Sse41, Self::Avx2, Self::Avx512, Self::Neon, Self::Dsp];

    /// Name as it is written in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Sse2 => "sse2",
            Self::Sse41 => "sse4.1",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
            Self::Neon => "neon",
            Self::Dsp => "dsp",
        }
    }

    /// Whether this processor has the instructions, and the operating system keeps their registers.
    pub fn is_available(self) -> bool {
        #[cfg(target_arch = "x86_64")]
        return x86_64::is_available(self);
        #[cfg(not(target_arch = "x86_64"))]
        return self == Self::Plain
            || (cfg!(all(target_arch = "aarch64", target_feature = "neon")) && self == Self::Neon)
            || (cfg!(dsp) && self == Self::Dsp);
    }

    /// The last one of [`Self::ALL`] that is available.
    pub fn fastest() -> Self {
        Self::ALL.iter().rev().copied().find(|backend| backend.is_available()).unwrap_or(Self::Plain)
    }

    /// The next slower one; plain Rust after itself.
    pub(crate) fn slower(self) -> Self {
        Self::ALL.iter().rev().copied().find(|&other| other < self).unwrap_or(Self::Plain)
    }

    /// Bytes that are worked on at once: tables are padded to a multiple.
    pub(crate) const fn lanes(self) -> usize {
        match self {
            Self::Plain | Self::Dsp => 1,
            Self::Sse2 | Self::Sse41 | Self::Neon => 16,
            Self::Avx2 => 32,
            Self::Avx512 => 64,
        }
    }

    /// Whether its vectors can work on columns of so many disparities.
    pub(crate) const fn takes(self, disparities: usize) -> bool {
        match self {
            #[cfg(dsp)]
            Self::Dsp => thumb::takes(disparities),
            _ => disparities > 0,
        }
    }

    /// Whether right codes are kept as two rows of four bits each, to be looked up.
    pub(crate) const fn splits_codes(self) -> bool {
        matches!(self, Self::Sse41 | Self::Avx2)
    }
}

/// A backend that is available. A matcher that is not configured has the plain one, which is all zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Chosen(Backend);

impl Chosen {
    pub(crate) const PLAIN: Self = Self(Backend::Plain);

    /// `None` if the processor does not have the instructions.
    pub(crate) fn new(backend: Backend) -> Option<Self> {
        backend.is_available().then_some(Self(backend))
    }

    pub(crate) const fn backend(self) -> Backend {
        self.0
    }
}

/// Writes census codes of as many pixels as the backend does better than plain Rust, from the first on, and says how many. `rows` are
/// those three above the pixel, two above, its own, two below and three below, from three columns before the first pixel on.
///
/// # Bound
/// One step for each pixel.
#[inline(always)]
pub(crate) fn census_codes(chosen: Chosen, rows: [&[u8]; 5], out: &mut [u8]) -> usize {
    match chosen.0 {
        #[cfg(dsp)]
        Backend::Dsp => thumb::census_codes(rows, out),
        _ => {
            let _ = (rows, out);
            0
        }
    }
}

/// Lets a row of census codes into the sums of its columns and another one out.
///
/// # Bound
/// `width x disparities` steps.
pub(crate) fn slide_codes(chosen: Chosen, job: SlideCodes<'_>) {
    match chosen.0 {
        #[cfg(target_arch = "x86_64")]
        Backend::Sse2 | Backend::Sse41 | Backend::Avx2 | Backend::Avx512 => x86_64::slide_codes(chosen, job),
        #[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
        Backend::Neon => aarch64::slide_codes(job),
        #[cfg(dsp)]
        Backend::Dsp => thumb::slide_codes(job),
        _ => plain::slide_codes(job),
    }
}

/// Lets a row of grey values into the sums of its columns and another one out.
///
/// # Bound
/// `width x disparities` steps.
pub(crate) fn slide_grey(
    columns: &mut [[u8; 2]],
    disparities: usize,
    min_disparity: usize,
    enter: (&[u8], &[u8]),
    leave: Option<(&[u8], &[u8])>,
) {
    plain::slide_grey(columns, disparities, min_disparity, enter, leave);
}

/// The best places of up to [`CHUNK`] pixels of a row, from keys of cost and place.
///
/// # Bound
/// `pixels x disparities` steps, and as many for each column of the window where the sums are made afresh.
pub(crate) fn search_keys(chosen: Chosen, job: KeyJob<'_>) {
    match chosen.0 {
        #[cfg(target_arch = "x86_64")]
        Backend::Sse2 | Backend::Sse41 | Backend::Avx2 | Backend::Avx512 => x86_64::search_keys(chosen, job),
        #[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
        Backend::Neon => aarch64::search_keys(job),
        #[cfg(dsp)]
        Backend::Dsp => thumb::search_keys(job),
        _ => plain::search_keys(job),
    }
}

/// The best places of up to [`CHUNK`] pixels of a row, for sums of bytes.
///
/// # Bound
/// That of [`search_keys`], twice.
pub(crate) fn search_bytes(chosen: Chosen, job: CostJob<'_, u8>) {
    match chosen.0 {
        #[cfg(target_arch = "x86_64")]
        Backend::Sse2 | Backend::Sse41 | Backend::Avx2 | Backend::Avx512 => x86_64::search_costs(chosen, job),
        #[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
        Backend::Neon => aarch64::search_costs(job),
        #[cfg(dsp)]
        Backend::Dsp => thumb::search_costs(job),
        _ => plain::search_costs(job),
    }
}

/// As [`search_bytes`], for sums of 16 bits.
pub(crate) fn search_words(job: CostJob<'_, [u8; 2]>) {
    plain::search_costs(job);
}

/// Steps in plain Rust that are compiled for the chosen backend. `run`, and what it calls, is to be `inline(always)`: that is why
/// this is not a closure.
pub(crate) trait Steps {
    fn run(self);
}

/// Runs steps with the instructions of the chosen backend.
#[inline(always)]
pub(crate) fn compiled(chosen: Chosen, steps: impl Steps) {
    #[cfg(target_arch = "x86_64")]
    x86_64::compiled(chosen, steps);
    #[cfg(not(target_arch = "x86_64"))]
    {
        let _ = chosen;
        steps.run();
    }
}

#[cfg(test)]
mod tests;
