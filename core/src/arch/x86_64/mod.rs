//! x86-64: what the processor has, and the functions that are compiled for it.

mod avx2;
mod avx512;
mod sse2;
mod sse41;

use core::arch::x86_64::{__cpuid, __cpuid_count, _xgetbv};

use super::{
    Backend, Chosen, Steps, generic,
    jobs::{CostJob, KeyJob, SlideCodes},
};
use avx2::Avx2;
use avx512::Avx512;
use sse2::Sse2;
use sse41::Sse41;

/// Asks the processor, and of wide registers whether the operating system keeps them.
///
/// Source: Intel 64 and IA-32 Architectures Software Developer's Manual, volume 1, sections 14.3, 14.7.1 and 15.2.
pub(super) fn is_available(backend: Backend) -> bool {
    match backend {
        Backend::Plain | Backend::Sse2 => true,
        Backend::Sse41 => all(features().1, [9, 19]),
        Backend::Avx2 => has_avx2(),
        Backend::Avx512 => {
            // The masks, and the upper halves and the second half of the wide registers; F16C, FMA and POPCNT, which came before.
            has_avx2() && saved_registers() & 0xe0 == 0xe0 && all(features().1, [29, 12, 23]) && {
                let features = __cpuid_count(7, 0);
                // AVX512F, BW and VL; BITALG.
                all(features.ebx, [16, 30, 31]) && all(features.ecx, [12])
            }
        }
        _ => false,
    }
}

fn has_avx2() -> bool {
    let (highest, features) = features();
    // OSXSAVE and AVX; registers 1 and 2 of those that the system saves: the lower and upper halves.
    highest >= 7 && all(features, [27, 28]) && saved_registers() & 6 == 6 && {
        // AVX2, and BMI1 and BMI2, which came with it.
        all(__cpuid_count(7, 0).ebx, [5, 3, 8])
    }
}

/// Whether all of these bits are set.
fn all<const N: usize>(features: u32, bits: [u32; N]) -> bool {
    bits.into_iter().all(|bit| features >> bit & 1 == 1)
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

/// The algorithm with a vector, compiled for its instructions.
macro_rules! functions {
    ($name:ident, $vector:ty, $features:literal) => {
        mod $name {
            use super::*;

            #[target_feature(enable = $features)]
            pub(super) fn slide_codes(job: SlideCodes<'_>) {
                // SAFETY: this function is only called where the instructions are.
                unsafe { generic::slide_codes::<$vector>(job) }
            }

            #[target_feature(enable = $features)]
            pub(super) fn search_keys(job: KeyJob<'_>) {
                // SAFETY: this function is only called where the instructions are.
                unsafe { generic::search_keys::<$vector>(job) }
            }

            #[target_feature(enable = $features)]
            pub(super) fn search_costs(job: CostJob<'_, u8>) {
                // SAFETY: this function is only called where the instructions are.
                unsafe { generic::search_costs::<$vector>(job) }
            }
        }
    };
}

functions!(with_sse2, Sse2, "sse2");
functions!(with_sse41, Sse41, "ssse3,sse4.1");
functions!(with_avx2, Avx2, "avx2,bmi1,bmi2");
functions!(with_avx512, Avx512, "avx512f,avx512bw,avx512vl,avx512bitalg,bmi1,bmi2,popcnt");

/// Calls the function of the chosen backend.
macro_rules! call {
    ($chosen:expr, $function:ident($job:expr)) => {
        // SAFETY: `Chosen` holds only a backend whose instructions the processor was found to have.
        unsafe {
            match $chosen.backend() {
                Backend::Avx512 => with_avx512::$function($job),
                Backend::Avx2 => with_avx2::$function($job),
                Backend::Sse41 => with_sse41::$function($job),
                _ => with_sse2::$function($job),
            }
        }
    };
}

/// Lets a row of codes in and another one out.
pub(super) fn slide_codes(chosen: Chosen, job: SlideCodes<'_>) {
    call!(chosen, slide_codes(job));
}

/// Searches by keys.
pub(super) fn search_keys(chosen: Chosen, job: KeyJob<'_>) {
    call!(chosen, search_keys(job));
}

/// Searches by costs.
pub(super) fn search_costs(chosen: Chosen, job: CostJob<'_, u8>) {
    call!(chosen, search_costs(job));
}

/// Runs steps with the instructions that were chosen: plain Rust, of which the compiler makes vectors. With wider ones than those of
/// AVX2 it is no faster.
#[inline(always)]
pub(super) fn compiled(chosen: Chosen, steps: impl Steps) {
    #[target_feature(enable = "avx2,bmi1,bmi2")]
    fn with_avx2(steps: impl Steps) {
        steps.run();
    }
    match chosen.backend() {
        // SAFETY: `Chosen` holds only a backend whose instructions the processor was found to have; AVX-512 comes with AVX2.
        Backend::Avx2 | Backend::Avx512 => unsafe { with_avx2(steps) },
        _ => steps.run(),
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::is_x86_feature_detected as has;

    use super::*;

    #[test]
    fn what_is_available_is_what_the_standard_library_finds() {
        let avx2 = has!("avx2") && has!("bmi1") && has!("bmi2");
        let before = has!("f16c") && has!("fma") && has!("popcnt");
        let avx512 = has!("avx512f") && has!("avx512bw") && has!("avx512vl") && has!("avx512bitalg");
        for (backend, expected) in [
            (Backend::Plain, true),
            (Backend::Sse2, true),
            (Backend::Sse41, has!("ssse3") && has!("sse4.1")),
            (Backend::Avx2, avx2),
            (Backend::Avx512, avx2 && before && avx512),
            (Backend::Neon, false),
            (Backend::Dsp, false),
        ] {
            assert_eq!(is_available(backend), expected, "{}", backend.name());
        }
    }

    #[test]
    fn a_backend_needs_all_of_its_features() {
        for features in 0..64_u32 {
            assert_eq!(all(features, [0, 2, 5]), features & 0b10_0101 == 0b10_0101, "{features:#b}");
        }
    }
}
