#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fencepost_invariants::stages(bytes));
