//! The most steps that the loops of the core can take, and the search for what comes near: what the program `fencepost-bounds` and a
//! fuzzer have in common. See `docs/bounds.md`.
#![deny(unsafe_code)]

#[cfg(feature = "search")]
pub mod search;
pub mod work;
