//! AArch64: NEON, which the target has or has not; nobody needs to be asked.

mod neon;

use super::{
    generic,
    jobs::{CostJob, KeyJob, SlideCodes},
};
use neon::Neon;

/// Lets a row of codes in and another one out.
pub(super) fn slide_codes(job: SlideCodes<'_>) {
    // SAFETY: this module is compiled only for targets with NEON.
    unsafe { generic::slide_codes::<Neon>(job) }
}

/// Searches by keys.
pub(super) fn search_keys(job: KeyJob<'_>) {
    // SAFETY: this module is compiled only for targets with NEON.
    unsafe { generic::search_keys::<Neon>(job) }
}

/// Searches by costs.
pub(super) fn search_costs(job: CostJob<'_, u8>) {
    // SAFETY: this module is compiled only for targets with NEON.
    unsafe { generic::search_costs::<Neon>(job) }
}
