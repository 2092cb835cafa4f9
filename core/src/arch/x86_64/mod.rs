//! x86-64: what the processor has, and the functions that are compiled for it.

mod avx2;
mod sse2;
mod sse41;

use core::arch::x86_64::{__cpuid, __cpuid_count, _xgetbv};

use super::{
    Backend, Chosen, Steps, generic,
    jobs::{Found, KeyLimits, Right, Search, SlideCodes},
};
use avx2::Avx2;
use sse2::Sse2;
use sse41::Sse41;

/// Asks the processor, and of wide registers whether the operating system keeps them.
///
/// Source: Intel 64 and IA-32 Architectures Software Developer's Manual, volume 1, sections 14.3 and 14.7.1.
pub(super) fn is_available(backend: Backend) -> bool {
    match backend {
        Backend::Plain | Backend::Sse2 => true,
        Backend::Dsp => false,
        Backend::Sse41 => {
            let (_, features) = features();
            has(features, 9) && has(features, 19)
        }
        Backend::Avx2 => {
            let (highest, features) = features();
            let [saves, avx] = [27, 28].map(|bit| has(features, bit));
            // Registers 1 and 2 of those that the system saves: the lower and upper halves.
            highest >= 7 && saves && avx && saved_registers() & 6 == 6 && {
                let features = __cpuid_count(7, 0).ebx;
                // AVX2, and BMI1 and BMI2, which came with it.
                [5, 3, 8].into_iter().all(|bit| has(features, bit))
            }
        }
    }
}

const fn has(features: u32, bit: u32) -> bool {
    features >> bit & 1 == 1
}

/// The highest leaf, and the features of leaf 1.
fn features() -> (u32, u32) {
    (__cpuid(0).eax, __cpuid(1).ecx)
}

/// What the operating system saves when it changes tasks; to be asked only where it says that it does (OSXSAVE).
fn saved_registers() -> u64 {
    #[target_feature(enable = "xsave")]
    fn ask() -> u64 {
        // SAFETY: register 0 exists wherever XSAVE is enabled, which the caller has seen.
        unsafe { _xgetbv(0) }
    }
    // SAFETY: OSXSAVE, which the caller has seen, says that the processor has XSAVE and that it is enabled.
    unsafe { ask() }
}

macro_rules! functions {
    ($slide:ident, $keys:ident, $costs:ident, $vector:ty, $features:literal) => {
        #[target_feature(enable = $features)]
        fn $slide(job: SlideCodes<'_>) {
            // SAFETY: this function is only called where the instructions are.
            unsafe { generic::slide_codes::<$vector>(job) }
        }

        #[target_feature(enable = $features)]
        fn $keys(
            search: &Search,
            limits: &KeyLimits,
            columns: &[u8],
            work: &mut [i16],
            right: Right<'_>,
            found: &mut Found,
        ) {
            // SAFETY: this function is only called where the instructions are.
            unsafe { generic::search_keys::<$vector>(search, limits, columns, work, right, found) }
        }

        #[target_feature(enable = $features)]
        fn $costs(search: &Search, columns: &[u8], work: &mut [i16], right: Option<Right<'_>>, found: &mut Found) {
            // SAFETY: this function is only called where the instructions are.
            unsafe { generic::search_costs::<$vector>(search, columns, work, right, found) }
        }
    };
}

functions!(slide_sse2, keys_sse2, costs_sse2, Sse2, "sse2");
functions!(slide_sse41, keys_sse41, costs_sse41, Sse41, "ssse3,sse4.1");
functions!(slide_avx2, keys_avx2, costs_avx2, Avx2, "avx2,bmi1,bmi2");

/// Lets a row of codes in and another one out.
pub(super) fn slide_codes(chosen: Chosen, job: SlideCodes<'_>) {
    // SAFETY: `Chosen` holds only a backend whose instructions the processor was found to have.
    unsafe {
        match chosen.backend() {
            Backend::Avx2 => slide_avx2(job),
            Backend::Sse41 => slide_sse41(job),
            Backend::Plain | Backend::Sse2 | Backend::Dsp => slide_sse2(job),
        }
    }
}

/// Searches by keys.
pub(super) fn search_keys(
    chosen: Chosen,
    search: &Search,
    limits: &KeyLimits,
    columns: &[u8],
    work: &mut [i16],
    right: Right<'_>,
    found: &mut Found,
) {
    // SAFETY: as in `slide_codes`.
    unsafe {
        match chosen.backend() {
            Backend::Avx2 => keys_avx2(search, limits, columns, work, right, found),
            Backend::Sse41 => keys_sse41(search, limits, columns, work, right, found),
            Backend::Plain | Backend::Sse2 | Backend::Dsp => keys_sse2(search, limits, columns, work, right, found),
        }
    }
}

/// Searches by costs.
pub(super) fn search_costs(
    chosen: Chosen,
    search: &Search,
    columns: &[u8],
    work: &mut [i16],
    right: Option<Right<'_>>,
    found: &mut Found,
) {
    // SAFETY: as in `slide_codes`.
    unsafe {
        match chosen.backend() {
            Backend::Avx2 => costs_avx2(search, columns, work, right, found),
            Backend::Sse41 => costs_sse41(search, columns, work, right, found),
            Backend::Plain | Backend::Sse2 | Backend::Dsp => costs_sse2(search, columns, work, right, found),
        }
    }
}

/// Runs steps with the instructions that were chosen: plain Rust, of which the compiler makes vectors.
#[inline(always)]
pub(super) fn compiled(chosen: Chosen, steps: impl Steps) {
    #[target_feature(enable = "avx2,bmi1,bmi2")]
    fn with_avx2(steps: impl Steps) {
        steps.run();
    }
    match chosen.backend() {
        // SAFETY: as in `slide_codes`.
        Backend::Avx2 => unsafe { with_avx2(steps) },
        _ => steps.run(),
    }
}
