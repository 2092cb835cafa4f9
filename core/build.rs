//! Says whether the processor has the instructions that work on four bytes of a register. The compiler tells stable programs by nothing
//! but the name of the target.

use std::env;

/// Cortex-M4 and M7. The Thumb instruction set is needed, and that unaligned words can be read.
const WITH_DSP: &str = "thumbv7em";

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-check-cfg=cfg(dsp)");
    if env::var("TARGET").is_ok_and(|target| target.starts_with(WITH_DSP)) {
        println!("cargo:rustc-cfg=dsp");
    }
}
